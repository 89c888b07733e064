"""Image pairs to match: the cost of matching all pairs grows with the square of the number of images."""

from collections.abc import Sequence

import numpy as np

from mapping.input.images import ImageSet

SIGNATURE_SIZE = 120
"""Number of an image's largest features that are compared to find similar images."""

_SAME = 0.86
"""Cosine of two descriptors that count as one and the same feature; two random ones reach 0.75 at most."""

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
    all_descriptors = np.concatenate(signatures).astype(np.float32)
    starts = np.concatenate([[0], np.cumsum([len(s) for s in signatures])])[:-1]
    filled = np.array([len(s) > 0 for s in signatures])
    result: list[list[int]] = []
    for index, signature in enumerate(signatures):
        score = np.zeros(len(signatures))
        if len(signature):
            best = np.maximum.reduceat(signature @ all_descriptors.T, starts[filled], axis=1)
            score[filled] = (best > _SAME).sum(axis=0)
        score[index] = 0
        ranked = (int(k) for k in np.argsort(-score, kind="stable") if score[k] >= 4)
        result.append([k for k in ranked if (min(index, k), max(index, k)) not in known][:count])
    return result
