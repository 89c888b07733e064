"""Motions of a depth camera between images that depth and features do not join, from recorded motion.

Pairs of images that depth and features placed against each other show where the camera sits on the tracked thing (see
`hand_eye`), and how exactly recorded motion predicts the camera's. It joins consecutive images elsewhere, unless it is
too inexact, or contradicts the images on both sides of a gap.
"""

import itertools
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from flight import FloatArray, frames
from mapping.input.images import ImageSet
from mapping.sparse.recorded_motion import hand_eye
from mapping.sparse.recorded_motion.hand_eye import HandEye

Pair = tuple[int, int]
"""Two instants, the earlier first."""

_NEAR = 5
"""Instants between the images of a pair that is compared: odometry drifts over more."""
_LEAST_INSTANTS = 6
"""Placed images that recorded motion must cover."""
_STEPS = 2
"""An image is joined with so many recorded ones before and after it: one of them may show nothing of it."""
_MOST_UNEXPLAINED = 0.2
"""Share of the camera's motion. Measured with noise of 3 mm and .2 deg: .02; half a second late, another flight: .25
to .8."""
_OTHER_SCALE = 0.15
"""A recording whose scale differs by more is not in the metres of the depth images; less is taken into account."""
_LARGEST_STD_RAD, _LARGEST_STD_M = 0.02, 0.03
"""Of a predicted motion: what is known less exactly places nothing."""
_MOST_SQUARED = 30.0
"""Squared Mahalanobis distance of the placed images on both sides of a gap from recorded motion: by chance larger once
in 25,000 gaps (chi squared, six degrees of freedom)."""


@dataclass(frozen=True, slots=True, eq=False)
class RecordedEdge:
    """How one image of a pair lies to the other by recorded motion."""

    T_b_a: FloatArray
    """(4, 4) of the camera."""
    covariance: FloatArray
    """(6, 6) of its turn (rad) and shift (m), in the camera frame at a."""


def between(
    images: ImageSet, measured: Mapping[Pair, FloatArray], T_world_camera: FloatArray
) -> tuple[dict[Pair, RecordedEdge], list[str]]:
    """Motions between consecutive images that the measured ones leave apart, and why recordings gave none or fewer.

    Args:
        measured: T_b_a (4, 4) of pairs that depth and features placed.
        T_world_camera: (instants, 4, 4) the largest piece that they make; NaN elsewhere.
    """
    edges: dict[Pair, RecordedEdge] = {}
    notes: list[str] = []
    for motion in images.motions:
        T_start_tracked = motion.trajectory.at(images.time_s)
        apart = _apart(measured, np.isfinite(T_start_tracked[:, 0, 0]))
        if not apart:
            continue
        found, why = _of(T_start_tracked, apart, images, measured, T_world_camera)
        edges = found | edges  # the first recording goes before later ones
        notes += [f"{motion.name}: {each}" for each in why]
    return edges, notes


def _of(
    T_start_tracked: FloatArray,
    apart: list[Pair],
    images: ImageSet,
    measured: Mapping[Pair, FloatArray],
    T_world_camera: FloatArray,
) -> tuple[dict[Pair, RecordedEdge], list[str]]:
    """Of one recording."""
    known = np.isfinite(T_start_tracked[:, 0, 0])
    used = [(a, b) for a, b in sorted(measured) if b - a <= _NEAR and known[a] and known[b]]
    covered = len({k for pair in used for k in pair})
    if covered < _LEAST_INSTANTS:
        return {}, [f"it covers {covered} images that depth and features place, {_LEAST_INSTANTS} are needed"]
    hand = hand_eye.calibrate(np.array([measured[pair] for pair in used]), _motions(T_start_tracked, used))
    if hand.unexplained > _MOST_UNEXPLAINED:
        return {}, [
            f"it leaves {hand.unexplained:.0%} of the images' motion unexplained: it is of another flight or clock, or "
            "too inexact"
        ]
    if abs(hand.scale - 1.0) > _OTHER_SCALE:
        return {}, [f"its distances are {1.0 / hand.scale:.2f} times those of the depth images"]
    edges, notes = _exact(hand, T_start_tracked, apart)
    gaps = _contradicted(hand, T_start_tracked, T_world_camera)
    for a, b in gaps:
        edges = {(c, d): edge for (c, d), edge in edges.items() if d <= a or b <= c}
        notes.append(
            f"it contradicts the images {images.instants[a]} and {images.instants[b]}, so it places none between"
        )
    return edges, notes


def _apart(measured: Mapping[Pair, FloatArray], known: np.ndarray) -> list[Pair]:
    """Pairs of recorded instants that follow each other, in different pieces of what was measured."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    first, second = np.array(list(measured)).T
    links = coo_array((np.ones(len(first)), (first, second)), shape=(len(known), len(known)))
    _, piece = connected_components(links, directed=False)
    recorded = np.flatnonzero(known).tolist()
    following = itertools.chain.from_iterable(zip(recorded, recorded[k:], strict=False) for k in range(1, _STEPS + 1))
    return sorted((a, b) for a, b in following if piece[a] != piece[b])


def _motions(T_start_tracked: FloatArray, pairs: list[Pair]) -> FloatArray:
    """(n, 4, 4) of the tracked thing: its pose at the first instant of each pair, in its frame at the second."""
    a, b = np.array(pairs).T
    return frames.invert(T_start_tracked[b]) @ T_start_tracked[a]


def _exact(hand: HandEye, T_start_tracked: FloatArray, pairs: list[Pair]) -> tuple[dict[Pair, RecordedEdge], list[str]]:
    """The motions of pairs that are known well enough, and what is said of the others."""
    tracked = _motions(T_start_tracked, pairs)
    covariances = hand.covariances(tracked)
    std = np.sqrt(np.stack([np.linalg.eigvalsh(covariances[:, k : k + 3, k : k + 3])[:, -1] for k in (0, 3)], axis=1))
    exact = np.asarray((std <= [_LARGEST_STD_RAD, _LARGEST_STD_M]).all(axis=1))
    predicted = zip(pairs, hand.predicted(tracked), covariances, exact, strict=True)
    edges = {pair: RecordedEdge(T_b_a, covariance) for pair, T_b_a, covariance, is_exact in predicted if is_exact}
    if exact.all():
        return edges, []
    turn_rad, shift_m = std[~exact].max(axis=0)
    is_noisy = hand.turn_noise_rad > _LARGEST_STD_RAD or hand.shift_noise_m > _LARGEST_STD_M
    cause = "its noise" if is_noisy else "the turns are too few or too small to tell where the camera sits"
    return edges, [
        f"{int((~exact).sum())} of {len(pairs)} motions between images are not known well enough (standard deviation "
        f"{np.degrees(turn_rad):.1f} deg, {1000.0 * shift_m:.0f} mm): {cause}"
    ]


def _contradicted(hand: HandEye, T_start_tracked: FloatArray, T_world_camera: FloatArray) -> list[Pair]:
    """Placed instants on both sides of a gap that recorded motion contradicts; its noise adds up over the gap."""
    placed = np.flatnonzero(np.isfinite(T_world_camera[:, 0, 0]) & np.isfinite(T_start_tracked[:, 0, 0]))
    gaps = [(int(a), int(b)) for a, b in itertools.pairwise(placed) if b - a > 1]
    if not gaps:
        return []
    a, b = np.array(gaps).T
    tracked = _motions(T_start_tracked, gaps)
    off = hand_eye.difference(frames.invert(T_world_camera[b]) @ T_world_camera[a], hand.predicted(tracked))
    covariances = hand.covariances(tracked) * (b - a)[:, None, None]
    squared = np.einsum("ni,nij,nj->n", off, np.linalg.inv(covariances), off)
    return [gap for gap, each in zip(gaps, squared, strict=True) if each > _MOST_SQUARED]
