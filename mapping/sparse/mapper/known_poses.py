"""Places of images from recorded poses, where the matches agree with these. Runs in a child process only (see `child`).

Images close together hardly say from where they were taken: nine instants of a rig along 17 cm were placed 25 mm off by
their matches, and 1 mm off from the poses of visual-inertial odometry. The poses are those of the body, of one of its
cameras, or of something that is turned against it: the matches tell which. COLMAP then triangulates the points, goes on
with the images that have no pose, and adjusts everything.
"""

import itertools
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from flight import FloatArray, frames, rotations
from mapping.input.images import ImageSet
from mapping.input.trajectory import LONGEST_GAP_S, Motion
from mapping.sparse.mapper import agreement, colmap_model
from mapping.sparse.mapper.agreement import PairShares
from mapping.sparse.recorded_motion import motion

_SURELY = 0.95
"""Share of the matches in agreement from which no other reading of the poses is tried."""
_LEAST_INSTANTS = 3
_LEAST_SHARE = 0.5
"""Of the instants with a pose, whose matches must agree with it."""
_LEAST_LOOPS = 5
"""Pairs of instants far apart in time that show whether the poses drift."""
_LEAST_TURN_RAD, _LEAST_SECOND = 0.02, 0.05
"""Turns between two images that show how the tracked thing is turned against the body; and about a second axis, as a
share of those about the first."""
_TRIED_PAIRS = 150
"""On which other readings of poses that fail are tried, as those of the body or of the first camera."""
_LATE_S = (0.02, 0.05, 0.1, 0.2, 0.5)
"""Errors of the clock that are tried where poses fail, so that the message names one."""

_AXES = (
    ("north, east, down beside east, north, up", np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])),
    ("north, east, down beside north, west, up", np.diag([1.0, -1.0, -1.0])),
    ("x, z, -y beside x, y, z (y up)", np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]])),
    ("x, -z, y beside x, y, z (y up)", np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])),
)
"""Positions in one frame and attitudes in another, as a converter leaves them that turned only one."""
_LEFT_HANDED = (
    ("with y mirrored", np.diag([1.0, -1.0, 1.0])),
    ("with z mirrored", np.diag([1.0, 1.0, -1.0])),
)
"""Of game engines. Which axis is mirrored shows only in where up is."""


@dataclass(frozen=True, slots=True, eq=False)
class KnownPoses:
    """Where recorded poses place the images."""

    motion: Motion
    """What was recorded."""
    of: str
    """Whose poses they are."""
    T_tracked_body: FloatArray
    """(4, 4) the body on what was tracked."""
    T_world_body: FloatArray
    """(instants, 4, 4) metres in the recorder's frame; NaN where there is none, or the matches contradict it."""


def find(database: Path, images: ImageSet, window: int) -> tuple[KnownPoses | None, list[str]]:
    """The first recording with which the matches agree, and of each one before it why they do not.

    Args:
        database: COLMAP's, with verified matches.
        window: instants further apart than this show whether the poses drift.
    """
    notes: list[str] = []
    for recorded in images.motions:
        found, why = _find(database, images, recorded, window)
        if found is not None:
            return found, notes
        notes.append(f"{recorded.name} place no image: {why}")
    return None, notes


def triangulated(database: Path, images: ImageSet, known: KnownPoses, options: Any) -> Any:
    """COLMAP's model at the poses: the points that the matches have in common."""
    return colmap_model.triangulated(
        database, images, known.T_world_body @ images.rig.cameras[0].T_body_camera, options, without_matches=False
    )


def placed_text(known: KnownPoses) -> str:
    """What they placed, in words."""
    count = int(np.isfinite(known.T_world_body[:, 0, 0]).sum())
    return f"{known.motion.name}: as poses of {known.of} they placed {count} of {len(known.T_world_body)} images first"


def _find(database: Path, images: ImageSet, recorded: Motion, window: int) -> tuple[KnownPoses | None, str]:
    T_start_tracked = recorded.trajectory.at(images.time_s)
    best, best_share = None, -1.0
    for of, T_tracked_body in _readings(database, images, T_start_tracked):
        T_world_body = T_start_tracked @ T_tracked_body
        pairs = agreement.of_pairs(database, images, images.rig, T_world_body)
        near = _part(pairs, _apart(pairs) <= window)
        if not len(near.share):
            return None, "no two consecutive images that they cover have matches enough"
        if (share := float(np.median(near.share))) > best_share:
            best, best_share = (of, T_tracked_body, T_world_body, pairs), share
        if best_share >= _SURELY:
            break
    assert best is not None
    of, T_tracked_body, T_world_body, pairs = best
    near = _part(pairs, _apart(pairs) <= window)
    agreeing = (near.of_instants() >= agreement.LEAST) & (near.part() == 0)
    covered = int(np.isfinite(T_start_tracked[:, 0, 0]).sum())
    if agreeing.sum() < max(_LEAST_INSTANTS, _LEAST_SHARE * covered):
        return None, (
            f"only {best_share:.0%} of the matches lie where these poses put them (median over pairs of images, at "
            f"least {agreement.LEAST:.0%} must)" + _explained(database, images, recorded, best_share)
        )
    loops = pairs.share[(_apart(pairs) > window) & agreeing[pairs.instants].all(axis=1)]
    if len(loops) >= _LEAST_LOOPS and np.median(loops) < agreement.LEAST:
        return None, (
            f"they drift: only {np.median(loops):.0%} of the matches between images far apart in time lie where these "
            "poses put them"
        )
    return KnownPoses(recorded, of, T_tracked_body, np.where(agreeing[:, None, None], T_world_body, np.nan)), ""


def _apart(pairs: PairShares) -> np.ndarray:
    """(p,) how many instants the two of each pair are apart."""
    return np.asarray(np.abs(pairs.instants[:, 0] - pairs.instants[:, 1]))


def _part(pairs: PairShares, kept: np.ndarray) -> PairShares:
    return PairShares(pairs.count, pairs.instants[kept], pairs.share[kept])


def _readings(database: Path, images: ImageSet, T_start_tracked: FloatArray) -> Iterator[tuple[str, FloatArray]]:
    """Whose poses they may be, with the pose (4, 4) of the body on it."""
    yield "the body", np.eye(4)
    for camera in images.rig:
        yield f"camera {camera.name}", frames.invert(camera.T_body_camera)
    if (turned := _turned(database, images, T_start_tracked)) is not None:
        yield "a thing turned against the body", turned


def _turned(database: Path, images: ImageSet, T_start_tracked: FloatArray) -> FloatArray | None:
    """T_tracked_body (4, 4) whose rotation fits the turns between images best; None if they do not determine one.

    The two are taken to be at one place: some centimetres between them are left to the adjustment.
    """
    tracked, body = [], []
    known = np.isfinite(T_start_tracked[:, 0, 0])
    for i, k, q_body in _turns(database, images):
        if known[i] and known[k]:
            R = T_start_tracked[k, :3, :3].T @ T_start_tracked[i, :3, :3]
            tracked.append(rotations.log(rotations.from_matrix(R)))
            body.append(rotations.log(q_body))
    if not tracked:
        return None
    theirs, ours = np.array(tracked), np.array(body)
    used = np.linalg.norm(ours, axis=1) > _LEAST_TURN_RAD
    product = theirs[used].T @ ours[used]
    strength = np.linalg.svd(product, compute_uv=False)
    if not strength[1] > _LEAST_SECOND * strength[0]:
        return None
    T_tracked_body = np.eye(4)
    T_tracked_body[:3, :3] = motion.nearest_rotation(product)
    return T_tracked_body


def _turns(database: Path, images: ImageSet) -> Iterator[tuple[int, int, FloatArray]]:
    """Two instants, and the rotation q_k_i of the body between them by the matches of one camera."""
    import pycolmap

    where = {images.relative(i, c): (i, c) for i, c in images.pairs()}
    with pycolmap.Database.open(database) as opened:
        shots = {row.image_id: where[row.name] for row in opened.read_all_images()}
        pair_ids, geometries = opened.read_two_view_geometries()
        for pair_id, geometry in zip(pair_ids, geometries, strict=True):
            ids = pycolmap.pair_id_to_image_pair(pair_id)
            (i, camera), (k, other) = (shots[each] for each in ids)
            if camera != other or len(geometry.inlier_matches) < agreement.LEAST_MATCHES:
                continue
            lens = opened.read_camera(opened.read_image(ids[0]).camera_id)
            a, b = (opened.read_keypoints(each)[:, :2] for each in ids)
            is_known = pycolmap.estimate_two_view_geometry_pose(lens, a, lens, b, geometry)
            if is_known and geometry.cam2_from_cam1 is not None:
                R = images.rig.cameras[camera].T_body_camera[:3, :3]
                turn = np.asarray(geometry.cam2_from_cam1.rotation.matrix(), dtype=np.float64)
                yield i, k, rotations.from_matrix(R @ turn @ R.T)


def _explained(database: Path, images: ImageSet, recorded: Motion, share: float) -> str:
    """What is wrong with poses that the matches contradict, if another reading of the file fits: a clause."""
    for what, T_world_tracked, readings in _misread(recorded, images.time_s):
        for _, T_tracked_body in itertools.islice(_readings(database, images, T_world_tracked), readings):
            T_world_body = T_world_tracked @ T_tracked_body
            pairs = agreement.of_pairs(database, images, images.rig, T_world_body, most=_TRIED_PAIRS)
            if len(pairs.share) and np.median(pairs.share) > max(agreement.LEAST, share):
                return f"; they fit if {what}"
    return ""


def _misread(recorded: Motion, time_s: FloatArray) -> Iterator[tuple[str, FloatArray, int | None]]:
    """Poses as other readings of the file have them: other order of the quaternion, inverse, another clock, other axes.

    And of how many of the things that may have been tracked they are tried as the poses; None: of all.
    """
    T = recorded.trajectory.at(time_s)
    q = rotations.from_matrix(np.where(np.isfinite(T[:, :3, :3]), T[:, :3, :3], np.eye(3)))
    yield "they are from world to body: give their inverse", frames.invert(T), 2
    for what, order in (("its scalar stands first", [3, 0, 1, 2]), ("its scalar stands last", [1, 2, 3, 0])):
        swapped = T.copy()
        swapped[:, :3, :3] = rotations.matrix(q[:, order])
        yield f"the quaternion is of another order, as {what}", np.where(np.isfinite(T), swapped, np.nan), 2
    for late_s in itertools.chain.from_iterable((s, -s) for s in _LATE_S if s <= LONGEST_GAP_S):
        when = "late" if late_s > 0.0 else "early"
        yield (
            f"their times are about {abs(late_s):g} s {when} against the images: shift them",
            recorded.trajectory.at(time_s + late_s),
            2,
        )
    for what, M in _AXES:
        moved = T.copy()
        moved[:, :3, 3] = T[:, :3, 3] @ M.T
        yield f"their positions are in other axes than their quaternions, as {what}", moved, None
    for what, M in _LEFT_HANDED:
        moved = T.copy()
        moved[:, :3, 3], moved[:, :3, :3] = T[:, :3, 3] @ M.T, M @ T[:, :3, :3] @ M.T
        yield f"their axes are left-handed, as {what}", moved, None
