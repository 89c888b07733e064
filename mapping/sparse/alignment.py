"""Metric scale and the world frame (z up, metres), and the source of each.

Scale comes from the first of these that is available: a length the user gives, the distance between the cameras of
the rig, recorded positions or poses, odometry. Up comes from recorded gravity, else from recorded poses, else the first
image is taken to be level. With recorded positions or poses the world frame is theirs; otherwise its origin is the
first image and x its horizontal viewing direction.

`references.csv`: `image,x_m,y_m,z_m` (position of the body in any metric frame with z up) and, as well or instead,
`up_body_x,up_body_y,up_body_z` (the direction away from the ground, in the body frame). Cells may be empty.
"""

import dataclasses
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from flight import FloatArray, FormatError, InputError, MapError, errors, frames, rotations
from mapping import reach
from mapping.camera.pose_priors import LATE_SIGMAS
from mapping.camera.rig import Rig
from mapping.camera.trial import LEAST_BASELINE_M
from mapping.input.images import ImageSet, read_table
from mapping.input.trajectory import Motion, MotionKind
from mapping.sparse.recorded_motion import motion
from mapping.sparse.recorded_motion.motion import MotionCheck
from mapping.sparse.similarity import Fit, about_z, better_axes

_POSITION = ("x_m", "y_m", "z_m")
_UP = ("up_body_x", "up_body_y", "up_body_z")
_LEAST_POSITIONS = 4
LARGE_RESIDUAL = 0.1
"""Of the extent of the recorded positions: beyond, they lie beside the map."""
_LENGTH_STD = 0.01
"""A length that a user measured is taken to be good to 1 %."""
_DEPTH_STD = 0.01
"""Standard deviation of a depth camera's scale, relative: what calibrated sensors keep over their range."""
_BASELINE_STD_M = 0.0005
"""Standard deviation of the distance between two cameras in a camera file: what a calibration on a target leaves."""
DEPTH_SOURCE = "depth images"
"""Name of the scale that depth images of a sensor give; where they are there, it is theirs."""
BASELINE = "rig baseline"
"""Name of the scale that the distance between the cameras gives."""
GRAVITY = "recorded gravity"
"""The source of up that `references.csv` is."""
LONGEST_M = 1e5
"""A longer length is in another unit."""
NO_SCALE = (
    "no metric scale: images of a single camera do not determine it, nor those of several without images of one name "
    "(one instant). Give the length of the path (--length 13.2) or between two images (--length A.jpg,B.jpg,2.5), "
    "depth images (--depth FOLDER), or recorded motion (--poses FILE, --odometry FILE). A rig with the distance "
    f"between its cameras in camera.toml will do, too, or {_LEAST_POSITIONS} positions in references.csv "
    "(image,x_m,y_m,z_m; --references FILE)"
)


@dataclass(frozen=True, slots=True, eq=False)
class References:
    """Positions and gravity recorded with the images."""

    position_m: FloatArray
    """(instants, 3) NaN where nothing was recorded."""
    up_body: FloatArray
    """(instants, 3) unit vectors, NaN where nothing was recorded."""
    position_source: str = "recorded positions"
    up_source: str = GRAVITY


@dataclass(frozen=True, slots=True)
class Length:
    """A length the user measured, which fixes the scale."""

    metres: float
    """The length in metres."""
    between: tuple[str, str] | None = None
    """Two image names; without them the length is that of the whole path."""

    def __post_init__(self) -> None:
        if not 0.0 < self.metres <= LONGEST_M:
            raise InputError(
                f"a length of {self.metres:g} m cannot give a scale; it must be above 0 and at most {LONGEST_M:g} m"
            )


@dataclass(frozen=True, slots=True)
class ScaleWitness:
    """One source of the metric scale, laid beside the scale that the map has."""

    source: str
    """As `Alignment.scale_source`."""
    ratio: float
    """The map's scale divided by this source's: 1 when they agree."""
    std: float
    """Relative standard deviation of this source's scale."""


@dataclass(frozen=True, slots=True, eq=False)
class Alignment:
    """The similarity from COLMAP's world to ours, and the source of its scale and up direction."""

    scale: float
    """Metres per unit of COLMAP's world."""
    T_world_scaled: FloatArray
    """(4, 4), applied after scaling."""
    scale_source: str
    """"depth images", "given length", "rig baseline", "recorded positions", "recorded poses" or "odometry"."""
    up_source: str
    """"recorded gravity", "recorded poses" or "first image taken as level"."""
    position_residual_m: float | None = None
    """Median distance between aligned and recorded positions; none without them."""
    positions_used: int = 0
    """Recorded positions that agree with the map."""
    position_extent_m: float = 0.0
    """Root mean square distance of the recorded positions from their centre: what the residual is beside."""
    better_axes: str = ""
    """Other axes of the recorded positions with which they fit far better, in words; empty: none."""
    poses_up_off_rad: float | None = None
    """Angle between up by the recorded poses and the map's up; none where they do not show it."""
    scale_ratio_to_positions: float | None = None
    """This scale divided by the scale from recorded positions alone; 1 when they agree."""
    up_spread_rad: float | None = None
    """Median angle between the recorded up directions, turned into the world frame; 0 when all agree."""
    witnesses: tuple[ScaleWitness, ...] = ()
    """Every source of the scale that was there, the one in use first."""
    motions: tuple[MotionCheck, ...] = ()
    """How recorded poses and odometry fit; their scale is over the scale of this map: 1 when they agree."""

    def points(self, points_old: FloatArray) -> FloatArray:
        """(n, 3) points of COLMAP's world in ours."""
        return frames.apply(self.T_world_scaled, self.scale * points_old)

    def poses(self, T_old_body: FloatArray) -> FloatArray:
        """(n, 4, 4) poses in COLMAP's world to poses in ours."""
        scaled = np.array(T_old_body)
        scaled[:, :3, 3] *= self.scale
        return self.T_world_scaled @ scaled


def read_references(images: ImageSet, path: Path | None = None) -> References:
    """Read `path`, or `references.csv` of the image folder; all NaN when there is none.

    Raises:
        FormatError: the file has neither positions nor up directions, or a cell is no number.
        InputError: not one of its rows names an image of the folder, a position is too far from the origin, or recorded
            poses give the positions as well.
    """
    count = len(images.instants)
    if path is not None and not path.is_file():
        raise errors.missing(path, "the recorded positions or gravity")
    path = path or images.folder / "references.csv"
    if not path.is_file():
        return References(np.full((count, 3), np.nan), np.full((count, 3), np.nan))
    header = _header(path)
    groups = [columns for columns in (_POSITION, _UP) if columns[0] in header]
    if not groups:
        raise FormatError(f"{path} has neither {','.join(_POSITION)} nor {','.join(_UP)} in its first line")
    if _POSITION in groups and any(m.kind is MotionKind.POSES for m in images.motions):
        raise InputError(f"--poses and {path} both say where the images were taken; leave the positions of one out")
    values = {columns: _column_group(path, columns, images.instants) for columns in groups}
    if all(np.isnan(v).any(axis=1).all() for v in values.values()):
        raise InputError(f"{path} names none of the images in {images.folder}; its first column is the file name")
    empty = np.full((count, 3), np.nan)
    reach.require_near_origin(values.get(_POSITION, empty), f"with the positions of {path} the map")
    up = values.get(_UP, empty)
    with np.errstate(invalid="ignore"):
        return References(values.get(_POSITION, empty), up / np.linalg.norm(up, axis=1, keepdims=True))


def require_scale(
    folder: Path, rig: Rig, length: Length | None, references: Path | None, *, has_other: bool = False
) -> None:
    """Check, before any work, that a source of the metric scale is available.

    Args:
        has_other: depth images or recorded motion are given.

    Raises:
        MapError: none is; the message lists the ways to give one.
    """
    path = references or folder / "references.csv"
    if has_other or length is not None or rig.baseline_m > LEAST_BASELINE_M or not folder.exists():
        return
    recorded = 0
    if path.is_file() and _POSITION[0] in _header(path):
        rows = read_table(path, ("image", *_POSITION)).values()
        recorded = sum(all(np.isfinite(row)) for row in rows)
    if recorded < _LEAST_POSITIONS:
        raise MapError(NO_SCALE)


def _header(path: Path) -> list[str]:
    with open(path, encoding="utf-8-sig", errors="replace") as stream:
        return [name.strip() for name in stream.readline().split(",")]


def require_ends(images: ImageSet, length: Length | None) -> None:
    """Check, before any work, that a length between two images can give a scale.

    Raises:
        InputError: one of the images is not there, or both are the same.
    """
    if length is None or length.between is None:
        return
    for name in length.between:
        if name not in images.instants:
            raise InputError(
                f"the length is given between images, but {images.folder} has no {name!r}; its "
                f"{len(images.instants)} images go from {images.instants[0]} to {images.instants[-1]}"
            )
    if length.between[0] == length.between[1]:
        raise InputError(f"the length is given from the image {length.between[0]!r} to itself; name two images")


def _column_group(path: Path, columns: tuple[str, ...], instants: tuple[str, ...]) -> FloatArray:
    table = read_table(path, ("image", *columns))
    missing = (np.nan,) * len(columns)
    return np.array([table.get(name, missing) for name in instants], dtype=np.float64)


def baseline_std(rig: Rig, matches_std: float) -> float:
    """Relative standard deviation of the scale from a rig: that of its baseline, and of the matches."""
    return float(np.hypot(matches_std, _BASELINE_STD_M / rig.baseline_m))


def align(
    images: ImageSet,
    T_old_body: FloatArray,
    references: References,
    *,
    baseline_std: float | None,
    length: Length | None,
    has_depth: bool = False,
    by_motion: Sequence[int] = (),
    tracked_body: Mapping[str, FloatArray] | None = None,
    clocks: Mapping[str, Sequence[float]] | None = None,
) -> Alignment:
    """Find scale and world frame.

    Args:
        images: with the motion that was recorded beside them.
        T_old_body: (instants, 4, 4) poses in COLMAP's world, NaN where not registered.
        baseline_std: relative standard deviation of the scale of COLMAP's world, if the rig's baseline gave it one.
        has_depth: depth images gave COLMAP's world its scale.
        by_motion: instants that recorded motion placed; it is compared with the others.
        tracked_body: by the kind of a recording, the body on what was tracked (4, 4), where that is known.
        clocks: likewise how late its clock is and the standard deviation (s), from more than the turns that are else
            compared.

    Raises:
        MapError: nothing gives the scale, or the given length is from an image that is not in the map.
        InputError: the given length is between two images at one place.
    """
    known = np.asarray(np.isfinite(T_old_body[:, :3, 3]).all(axis=1))
    witnessing = T_old_body.copy()
    witnessing[list(by_motion)] = np.nan
    checks = [(m, _checked(m, images.time_s, witnessing, clocks or {})) for m in images.motions]
    for recorded, found in checks:
        if recorded.kind is MotionKind.POSES and found is not None:
            T_start_body, known_axes = _of_body(recorded, images.time_s, tracked_body or {})
            references = _with_poses(references, T_start_body, T_old_body, found.scale, known_axes=known_axes)
    R_level, up_source, up_spread_rad = _level(T_old_body, references, known)
    level = T_old_body[:, :3, 3] @ R_level.T
    usable = known & np.isfinite(references.position_m).all(axis=1)
    fit = Fit.robust(level[usable], references.position_m[usable]) if usable.sum() >= _LEAST_POSITIONS else None
    sources = _scales_of_images(images, T_old_body, baseline_std, length, has_depth=has_depth)
    if fit is not None:
        std = fit.scale_std(level[usable], references.position_m[usable])
        sources.append((references.position_source, fit.scale, std))
    found_of = [(m.kind, found) for m, found in checks if found is not None]
    sources += [(kind, found.scale, found.scale_std) for kind, found in found_of if kind is MotionKind.ODOMETRY]
    if not sources:
        raise MapError(NO_SCALE)
    source, scale, _ = sources[0]
    at_first = Alignment(
        scale,
        _start_at_first(scale * level[known][0], R_level, T_old_body[known][0]),
        source,
        up_source,
        poses_up_off_rad=_off_up(checks, images.time_s, T_old_body, R_level[2], tracked_body or {}),
        up_spread_rad=up_spread_rad,
        witnesses=tuple(ScaleWitness(name, scale / other, std) for name, other, std in sources),
        motions=tuple(dataclasses.replace(found, scale=found.scale / scale) for _, found in found_of),
    )
    return (
        at_first if fit is None else _at_positions(at_first, fit, R_level, level[usable], references.position_m[usable])
    )


def _checked(
    recorded: Motion, time_s: FloatArray, T_old_body: FloatArray, clocks: Mapping[str, Sequence[float]]
) -> MotionCheck | None:
    found = motion.check(recorded, time_s, T_old_body)
    if found is None or recorded.kind not in clocks:
        return found
    late_s, late_std_s = clocks[recorded.kind]
    apart_s = abs(found.late_s - late_s) if found.late_s is not None else 0.0
    if apart_s > LATE_SIGMAS * float(np.hypot(found.late_std_s or 0.0, late_std_s)):  # a jump of the poses rather
        return dataclasses.replace(found, late_s=None, late_std_s=None)
    return dataclasses.replace(found, late_s=late_s, late_std_s=late_std_s)


_Scale = tuple[str, float, float]
"""Source, metres per unit of COLMAP's world, relative standard deviation."""


def _scales_of_images(
    images: ImageSet, T_old_body: FloatArray, baseline_std: float | None, length: Length | None, *, has_depth: bool
) -> list[_Scale]:
    scales: list[_Scale] = []
    if has_depth:  # first: surfaces are where the depth images say
        scales.append((DEPTH_SOURCE, 1.0, _DEPTH_STD))
    if length is not None:
        scales.append(("given length", _from_length(images, T_old_body[:, :3, 3], length), _LENGTH_STD))
    if baseline_std is not None:
        scales.append((BASELINE, 1.0, baseline_std))
    return scales


def _at_positions(
    at_first: Alignment, fit: Fit, R_level: FloatArray, level: FloatArray, recorded_m: FloatArray
) -> Alignment:
    """The alignment moved to the recorded positions, its scale kept.

    Args:
        fit: of `level` to the positions, their scale free.
        level: (n, 3) positions in COLMAP's world, turned upright.
        recorded_m: (n, 3) recorded with them.
    """
    placed = Fit.robust(level, recorded_m, scale=at_first.scale)
    extent_m = float(np.sqrt(((recorded_m - recorded_m.mean(axis=0)) ** 2).sum(axis=1).mean()))
    is_far = placed.residual_m > LARGE_RESIDUAL * extent_m
    T = np.eye(4)
    T[:3, :3] = placed.R @ R_level
    T[:3, 3] = placed.t
    return dataclasses.replace(
        at_first,
        T_world_scaled=T,
        position_residual_m=placed.residual_m,
        positions_used=int(placed.inliers.sum()),
        position_extent_m=extent_m,
        better_axes=better_axes(level, recorded_m, placed.residual_m) if is_far else "",
        scale_ratio_to_positions=at_first.scale / fit.scale,
    )


def _off_up(
    checks: Sequence[tuple[Motion, MotionCheck | None]],
    time_s: FloatArray,
    T_old_body: FloatArray,
    up_old: FloatArray,
    tracked_body: Mapping[str, FloatArray],
) -> float | None:
    """Angle between up in recorded poses and `up_old` (3,), both in COLMAP's world; None where nothing shows it."""
    for recorded, found in checks:
        if recorded.kind is MotionKind.POSES and found is not None:
            T_start_body, known_axes = _of_body(recorded, time_s, tracked_body)
            both = np.isfinite(T_start_body[:, 0, 0]) & np.isfinite(T_old_body[:, 0, 0])
            if (up := _up_old(T_start_body[both], T_old_body[both], found.scale, known_axes=known_axes)) is not None:
                return float(np.arccos(np.clip(up @ up_old, -1.0, 1.0)))
    return None


def _of_body(recorded: Motion, time_s: FloatArray, tracked_body: Mapping[str, FloatArray]) -> tuple[FloatArray, bool]:
    """(instants, 4, 4) recorded poses, and whether they are the body's: else of something on it, in axes of its own."""
    T = recorded.trajectory.at(time_s)
    known = tracked_body.get(recorded.kind)
    return (T, False) if known is None else (T @ known, True)


def _up_old(T_start_body: FloatArray, T_old_body: FloatArray, scale: float, *, known_axes: bool) -> FloatArray | None:
    """The z axis of recorded poses (n, 4, 4) in COLMAP's world, (3,); None if they do not determine it."""
    if not known_axes:
        return motion.up_old(T_start_body, T_old_body, scale)
    up = np.einsum("nij,nj->ni", T_old_body[:, :3, :3], T_start_body[:, 2, :3]).mean(axis=0)
    return up / np.linalg.norm(up)


def _with_poses(
    references: References, T_start_body: FloatArray, T_old_body: FloatArray, scale: float, *, known_axes: bool
) -> References:
    """Recorded poses as positions and, where no gravity was recorded, as directions of up.

    Args:
        T_start_body: (instants, 4, 4) recorded, NaN where not; scale: metres per unit of COLMAP's world.
        known_axes: the poses are the body's, not those of something on it in axes of its own.
    """
    up_body, up_source = references.up_body, references.up_source
    both = np.isfinite(T_start_body[:, 0, 0]) & np.isfinite(T_old_body[:, 0, 0])
    if (
        not np.isfinite(up_body).any()
        and (up := _up_old(T_start_body[both], T_old_body[both], scale, known_axes=known_axes)) is not None
    ):
        up_body, up_source = np.einsum("nji,j->ni", T_old_body[:, :3, :3], up), MotionKind.POSES
    return References(T_start_body[:, :3, 3], up_body, MotionKind.POSES, up_source)


def _level(T_old_body: FloatArray, references: References, known: np.ndarray) -> tuple[FloatArray, str, float | None]:
    """Rotation that turns COLMAP's world upright."""
    up_body = references.up_body
    recorded = known & np.isfinite(up_body).all(axis=1)
    if not recorded.any():
        return upright(T_old_body[known][0][:3, 2]), "first image taken as level", None
    ups = (T_old_body[recorded, :3, :3] @ up_body[recorded][..., None])[..., 0]
    up = ups.mean(axis=0)
    for _ in range(20):  # the median direction: one outlier does not tilt the map
        weight = 1.0 / np.maximum(np.linalg.norm(ups - up, axis=1), 1e-4)
        up = (weight[:, None] * ups).sum(axis=0)
        up /= np.linalg.norm(up)
    spread_rad = float(np.median(np.arccos(np.clip(ups @ up, -1.0, 1.0))))
    return upright(up), references.up_source, spread_rad


def upright(up: FloatArray) -> FloatArray:
    """The smallest rotation that takes the unit vector `up` to z."""
    up = up / np.linalg.norm(up)
    across = np.array([up[1], -up[0], 0.0])
    if np.linalg.norm(across) < 1e-12:
        return np.eye(3) if up[2] > 0.0 else np.diag([1.0, -1.0, -1.0])
    angle_rad = np.arctan2(np.linalg.norm(across), up[2])
    return rotations.matrix(rotations.exp(across / np.linalg.norm(across) * angle_rad))


def _start_at_first(first_m: FloatArray, R_level: FloatArray, T_old_body: FloatArray) -> FloatArray:
    """World with its origin at the first body and x along its heading."""
    forward = R_level @ T_old_body[:3, 0]
    yaw_rad = np.arctan2(forward[1], forward[0])
    R_yaw = about_z(-yaw_rad)
    T = np.eye(4)
    T[:3, :3] = R_yaw @ R_level
    T[:3, 3] = -R_yaw @ first_m
    return T


def _from_length(images: ImageSet, positions: FloatArray, length: Length) -> float:
    if length.between is None:
        known = positions[np.isfinite(positions).all(axis=1)]
        units = float(np.linalg.norm(np.diff(known, axis=0), axis=1).sum())
    else:
        ends = []
        for name in length.between:
            ends.append(positions[images.instants.index(name)])
            if not np.isfinite(ends[-1]).all():
                raise MapError(f"the length is given from image {name!r}, which could not be placed in the map")
        units = float(np.linalg.norm(ends[1] - ends[0]))
    if units < 1e-9:
        raise InputError("the given length is between two images at one and the same place")
    return length.metres / units
