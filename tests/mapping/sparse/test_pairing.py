"""Image pairs to match: similar images are found by the features that they share."""

import numpy as np
import pytest

from mapping.sparse.features import features
from mapping.sparse.mapper import pairing


def signatures(rng: np.random.Generator, places: int, images_each: int, size: int = 40) -> list[np.ndarray]:
    """Images of places, one after the other round all: each shows half of its place's features, a bit changed."""
    of_place = rng.exponential(1.0, (places, 2 * size, 128))
    shown = [of_place[k % places][rng.permutation(2 * size)[:size]] for k in range(places * images_each)]
    return [features.unit(np.maximum(each + rng.normal(0.0, 0.25, each.shape), 0.0)) for each in shown]


def exact(images: list[np.ndarray]) -> np.ndarray:
    """(images, images) features of the first image of which the second has one that counts as the same."""
    return np.array([[int(((a @ b.T) > pairing._SAME).any(axis=1).sum()) for b in images] for a in images])


def test_of_few_images_all_features_are_compared() -> None:
    images = signatures(np.random.default_rng(1), 3, 4)
    images[5] = images[5][:0]  # an image without features
    assert np.array_equal(pairing._shared_features(images), exact(images))


def test_of_many_images_nearly_all_shared_features_are_found_and_no_others() -> None:
    images = signatures(np.random.default_rng(2), 60, 4)
    found, truth = pairing._shared_features(images), exact(images)
    assert found.sum() > 0.8 * truth.sum() > 0
    assert (found <= truth).all()


def test_a_feature_counts_once_however_many_copies_of_it_another_image_has() -> None:
    rng = np.random.default_rng(4)
    motifs = rng.exponential(1.0, (30, 128))
    copies = (motifs[rng.integers(0, 30, 60)] + rng.normal(0.0, 0.3, (60, 128)) for _ in range(60))
    images = [features.unit(np.maximum(each, 0.0)) for each in copies]
    assert (pairing._shared_features(images) <= exact(images)).all()


def test_what_is_counted_does_not_depend_on_how_much_is_marked_at_once(monkeypatch: pytest.MonkeyPatch) -> None:
    images = signatures(np.random.default_rng(5), 30, 2)
    counted = pairing._shared_features(images)
    monkeypatch.setattr(pairing, "_MARKS", 7_000)  # parts that end within an image
    assert np.array_equal(pairing._shared_features(images), counted)


def test_the_most_similar_images_are_of_the_same_place() -> None:
    places = 60
    images = signatures(np.random.default_rng(3), places, 4)
    shots = [(k, 0) for k in range(len(images))]
    pairs = pairing.choose(shots, images, window=1, similar=2)
    similar = [(a, b) for (a, _), (b, _) in pairs if b - a > 1]
    assert len(similar) >= len(images)
    assert all((b - a) % places == 0 for a, b in similar)


def test_images_without_any_features_are_matched_with_their_neighbours_only() -> None:
    shots = [(k, 0) for k in range(5)]
    assert pairing.choose(shots, [np.zeros((0, 128))] * 5, window=1, similar=2) == [
        ((k, 0), (k + 1, 0)) for k in range(4)
    ]
