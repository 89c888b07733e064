"""Features of two images that are alike: found as by definition, from whichever image one looks."""

import numpy as np
import pytest

from mapping.sparse.features import features, matching


def image(rng: np.random.Generator, motifs: np.ndarray, noise: float) -> np.ndarray:
    """(n, 128) float32 of unit length: the motifs in another order, a bit changed."""
    return features.unit(np.maximum(motifs[rng.permutation(len(motifs))] + rng.normal(0.0, noise, motifs.shape), 0.0))


def two_images() -> tuple[np.ndarray, np.ndarray]:
    """Of 120 motifs, some of which are alike, with enough noise that some matches are not clear."""
    rng = np.random.default_rng(1)
    motifs = rng.exponential(1.0, (120, 128))
    motifs[60:90] = motifs[:30] + rng.normal(0.0, 0.3, (30, 128))
    return image(rng, motifs, 0.3)[:100], image(rng, motifs, 0.3)


def is_clear(distance: np.ndarray, index: int) -> bool:
    rest = np.delete(distance, index)
    return distance[index] <= 0.7 and bool((distance[index] < 0.8 * rest).all())


@pytest.mark.parametrize("rows", [7, 512])
def test_matches_are_clear_from_both_images(monkeypatch: pytest.MonkeyPatch, rows: int) -> None:
    monkeypatch.setattr(matching, "_ROWS", rows)
    first, second = two_images()
    apart = np.linalg.norm(first.astype(float)[:, None] - second.astype(float), axis=2)
    expected = [(i, j) for i, j in np.ndindex(apart.shape) if is_clear(apart[i], j) and is_clear(apart[:, j], i)]
    assert 20 < len(expected) < 80
    assert matching.match(first, second).tolist() == [list(pair) for pair in expected]


def test_exchanged_images_have_the_same_matches() -> None:
    first, second = two_images()
    forth, back = matching.match(first, second), matching.match(second, first)
    assert {tuple(pair) for pair in forth.tolist()} == {tuple(pair[::-1]) for pair in back.tolist()}


def at(*angles_rad: float) -> np.ndarray:
    """(n, 128) unit vectors in a plane."""
    result = np.zeros((len(angles_rad), 128), np.float32)
    result[:, 0], result[:, 1] = np.cos(angles_rad), np.sin(angles_rad)
    return result


def test_thresholds_are_those_of_lowe_and_colmap() -> None:
    far = at(3.0)
    for distance, matches in ((0.69, 1), (0.71, 0)):
        angle_rad = 2.0 * np.arcsin(distance / 2.0)
        assert len(matching.match(np.vstack([at(0.0), far]), np.vstack([at(angle_rad), -at(1.5)]))) == matches
    for ratio, matches in ((0.79, 1), (0.81, 0)):  # of two features of the other image, and of its own
        pair = np.vstack([at(0.0), at(3.0)]), np.vstack([at(ratio * 0.3), at(-0.3)])
        assert len(matching.match(*pair)) == len(matching.match(*pair[::-1])) == matches


def test_equal_features_match_nothing() -> None:
    once, twice = np.vstack([at(0.0), at(2.0)]), np.vstack([at(0.0), at(0.0)])
    assert matching.match(once, twice).shape == matching.match(twice, once).shape == (0, 2)


def test_an_image_of_no_or_one_feature_has_no_matches() -> None:
    first, _ = two_images()
    for few in (first[:0], first[:1]):
        assert matching.match(few, first).shape == matching.match(first, few).shape == (0, 2)
