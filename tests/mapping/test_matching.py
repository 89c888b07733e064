"""Features of two images that are alike: found as by definition, from whichever image one looks."""

import numpy as np

from mapping.sparse import matching


def image(rng: np.random.Generator, motifs: np.ndarray, noise: float) -> np.ndarray:
    """(n, 128) uint8: the motifs in another order, a bit changed, of length 512."""
    values = np.maximum(motifs[rng.permutation(len(motifs))] + rng.normal(0.0, noise, motifs.shape), 0.0)
    return np.round(512.0 * values / np.linalg.norm(values, axis=1, keepdims=True)).clip(0, 255).astype(np.uint8)


def two_images() -> tuple[np.ndarray, np.ndarray]:
    """Of 120 motifs, some of which are alike, with enough noise that some matches are not clear."""
    rng = np.random.default_rng(1)
    motifs = rng.exponential(1.0, (120, 128))
    motifs[60:90] = motifs[:30] + rng.normal(0.0, 0.3, (30, 128))
    return image(rng, motifs, 0.3)[:100], image(rng, motifs, 0.3)


def is_clear(distance: np.ndarray, index: int) -> bool:
    rest = np.delete(distance, index)
    return distance[index] <= 0.7 * 512.0 and bool((distance[index] < 0.8 * rest).all())


def test_matches_are_clear_from_both_images() -> None:
    first, second = two_images()
    apart = np.linalg.norm(first.astype(float)[:, None] - second.astype(float), axis=2)
    expected = [(i, j) for i, j in np.ndindex(apart.shape) if is_clear(apart[i], j) and is_clear(apart[:, j], i)]
    assert 20 < len(expected) < 80
    assert matching.match(first, second).tolist() == [list(pair) for pair in expected]


def test_exchanged_images_have_the_same_matches() -> None:
    first, second = two_images()
    forth, back = matching.match(first, second), matching.match(second, first)
    assert {tuple(pair) for pair in forth.tolist()} == {tuple(pair[::-1]) for pair in back.tolist()}


def test_an_image_without_features_has_no_matches_and_one_feature_may_have_one() -> None:
    first, _ = two_images()
    assert matching.match(first[:0], first).shape == matching.match(first, first[:0]).shape == (0, 2)
    assert matching.match(first[:1], first[:1]).tolist() == [[0, 0]]
