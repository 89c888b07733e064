"""Image pairs to match: the cost of matching all pairs grows with the square of the number of images."""

from collections.abc import Sequence

import numpy as np

from mapping.input.images import ImageSet

SIGNATURE_SIZE = 120
"""Number of an image's largest features that are compared to find similar images."""

_SAME = 0.86
"""Cosine of two descriptors that count as one and the same feature; two random ones reach 0.75 at most."""
_LEAST_SHARED = 4
"""Features that similar images have in common."""
_PER_WORD, _PROBES = 500, 3
"""Descriptors in a visual word, and words in which the likes of a descriptor are looked for."""
_AT_ONCE = 4_000_000
"""Cosines that are computed at once: 16 MB."""
_MARKS = 16_000_000
"""Descriptors times images that are marked at once: 16 MB."""

Shot = tuple[int, int]
"""(instant, camera)."""


def choose(
    shots: list[Shot],
    signatures: list[np.ndarray],
    *,
    window: int,
    similar: int,
    near: Sequence[tuple[int, int]] = (),
) -> list[tuple[Shot, Shot]]:
    """Pairs worth matching: neighbours in time, cameras of one rig at neighbouring instants, similar images elsewhere.

    Args:
        shots: all images.
        signatures: for each a (k, 128) array of unit descriptors.
        window: how many later images of the same camera each is matched with.
        similar: how many of the most similar other images each is matched with.
        near: instants that were at the same place, as `near_in_space` finds them.
    """
    place = {shot: index for index, shot in enumerate(shots)}
    cameras = max(camera for _, camera in shots) + 1
    chosen: set[tuple[int, int]] = set()

    def add(a: int, b: int | None) -> None:
        if b is not None and a != b:
            chosen.add((min(a, b), max(a, b)))

    for index, (instant, camera) in enumerate(shots):
        for step in range(1, window + 1):
            add(index, place.get((instant + step, camera)))
        for other in range(cameras):
            if other != camera:
                for step in (-1, 0, 1):
                    add(index, place.get((instant + step, other)))
    for a, b in near:
        for camera in range(cameras):
            if (a, camera) in place:
                add(place[a, camera], place.get((b, camera)))
    for index, others in enumerate(_most_similar(signatures, similar, known=chosen)):
        for other in others:
            add(index, other)
    return [(shots[a], shots[b]) for a, b in sorted(chosen)]


def near_in_space(images: ImageSet, window: int) -> list[tuple[int, int]]:
    """Pairs of instants that recorded motion says were taken near to each other, but not one soon after the other.

    Near is what is nearer than the images that are matched as neighbours in time, `window` apart. Each instant has at
    most `window` such pairs.
    """
    pairs: set[tuple[int, int]] = set()
    for motion in images.motions:
        positions_m = motion.trajectory.at(images.time_s)[:, :3, 3]
        for k in map(int, np.flatnonzero(np.isfinite(positions_m[:, 0]))):
            off_m = np.linalg.norm(positions_m - positions_m[k], axis=1)
            in_time = np.abs(np.arange(len(off_m)) - k) <= window
            near = np.flatnonzero(~in_time & (off_m < np.nanmax(off_m[in_time])))
            nearest = near[np.argsort(off_m[near], kind="stable")][:window]
            pairs |= {(min(k, int(other)), max(k, int(other))) for other in nearest}
    return sorted(pairs)


def _most_similar(signatures: list[np.ndarray], count: int, *, known: set[tuple[int, int]]) -> list[list[int]]:
    """For each image the `count` others that share most of their largest features, pairs already known left out."""
    if count == 0:
        return []
    result: list[list[int]] = []
    for index, shared in enumerate(_shared_features(signatures)):
        shared[index] = 0
        ranked = (int(k) for k in np.argsort(-shared, kind="stable") if shared[k] >= _LEAST_SHARED)
        result.append([k for k in ranked if (min(index, k), max(index, k)) not in known][:count])
    return result


def _shared_features(signatures: list[np.ndarray]) -> np.ndarray:
    """(images, images) how many features of the first image the second one has as well.

    A descriptor is compared only with those of the visual words that are most like it (Sivic and Zisserman, "Video
    Google", 2003). The words are descriptors drawn at random. A few hundred have one word: all are compared.
    """
    descriptors = np.concatenate(signatures).astype(np.float32)
    image = np.repeat(np.arange(len(signatures)), [len(each) for each in signatures])
    shared = np.zeros((len(signatures), len(signatures)), np.int32)
    if not len(descriptors):
        return shared
    drawn = np.random.default_rng(0).choice(len(descriptors), 1 + len(descriptors) // _PER_WORD, replace=False)
    likest = _likest(descriptors, descriptors[drawn])
    of_word = [np.flatnonzero(likest[:, 0] == word) for word in range(len(drawn))]  # in the order of the images
    for rows in np.array_split(np.arange(len(descriptors)), 1 + len(descriptors) * len(signatures) // _MARKS):
        has = np.zeros((len(rows), len(signatures)), bool)  # of one image several words may have the likes
        words = likest[rows]
        for word in np.unique(words):
            if not len(own := of_word[word]):
                continue
            asking = np.flatnonzero((words == word).any(axis=1))
            images, first = np.unique(image[own], return_index=True)
            for part in np.array_split(asking, 1 + len(asking) * len(own) // _AT_ONCE):
                found = np.maximum.reduceat(descriptors[rows[part]] @ descriptors[own].T, first, axis=1) > _SAME
                has[np.ix_(part, images)] |= found
        askers, start = np.unique(image[rows], return_index=True)
        shared[askers] += np.add.reduceat(has, start, axis=0, dtype=np.int32)
    return shared


def _likest(descriptors: np.ndarray, words: np.ndarray) -> np.ndarray:
    """(n, `_PROBES`) numbers of the words (w, 128) most like each descriptor (n, 128), the likest first."""
    result = np.empty((len(descriptors), _PROBES), np.int64)
    for rows in np.array_split(np.arange(len(descriptors)), 1 + len(descriptors) * len(words) // _AT_ONCE):
        cosine = descriptors[rows] @ words.T
        for probe in range(_PROBES):
            result[rows, probe] = cosine.argmax(axis=1)
            cosine[np.arange(len(rows)), result[rows, probe]] = -np.inf
    return result
