"""Whether a map may be flown in: good, doubtful or refused, with the reasons.

A map that is too large by a tenth looks like any other. What gives it away stands beside it: matches that contradict
the camera file, sources of scale that contradict each other, images that found no place.
"""

import enum
from dataclasses import dataclass

import numpy as np

from flight import FloatArray
from mapping.camera import advice
from mapping.camera.errors import OF_THE_LENS, UNTIMED, Kind
from mapping.camera.trial import SIGMAS90, SIGMAS95, Finding, Verdict
from mapping.input.trajectory import MotionKind
from mapping.sparse import reconstruction
from mapping.sparse.alignment import BASELINE, GRAVITY, LARGE_RESIDUAL, Alignment, ScaleWitness
from mapping.sparse.features import repetition
from mapping.sparse.mapper import overlap
from mapping.sparse.reconstruction import SparseMap
from mapping.sparse.recorded_motion.motion import MotionCheck

LEAST_PLACED = 0.9
"""Share of the images that a good map has placed."""
LARGEST_NOISE_PX = 1.0
"""Standard deviation of a match beyond which the lens model does not fit these images."""
SCALE_DOUBT, SCALE_REFUSED = 0.05, 0.15
"""Relative disagreement of two sources of scale, beyond three standard deviations of it."""
OTHER_CAMERA_PX = 20.0
"""A correction that moves the image by more says that the camera file belongs to other images."""
LATE_DOUBT_S = 0.01
"""A clock that is off by less does no harm."""
TURN_DOUBT_RAD = float(np.radians(3.0))
SHAPE_DOUBT = 0.10
"""Recorded motion of the same flight fits the map better than these."""
DIRECTION_REFUSED_RAD = float(np.radians(25.0))
"""Poses with a noise of 5 cm and 2 deg differ by 9 deg; quaternions in another order, or inverted, by 40 to 54 deg."""
TILT_DOUBT_RAD = float(np.radians(60.0))
"""No vehicle flies like this for half of its images."""
UP_DOUBT_RAD = float(np.radians(10.0))
"""Between two sources of up: an accelerometer in flight is off by less."""
HANGING_DOUBT_RAD = float(np.radians(120.0))
"""Nor does anybody carry one like this; less may be a camera file that does not say how the camera looks."""
OTHER_LENS = 0.02
"""The same for what is wrong with a lens, as a share of the image's width: lenses of one make differ by less."""
SHIFT_DOUBT_PX = 1.0
"""An error that could be this large without the matches showing it is a reason for doubt."""


SHAPE_DOUBT_M = 0.05
"""RMS standard deviation of the positions, but for place, attitude and size of the whole: a voxel as maps have them."""
RESIZED = 0.15
"""Logarithm of the factor by which the trial of the camera file changed a map's size, from which that is said."""
_RECORDED = 0.5
"""Share of the placed images whose recorded positions agree with the map, from which these vouch for its shape."""


class Standing(enum.StrEnum):
    """What may be done in a map."""

    GOOD = "good"
    DOUBTFUL = "doubtful"
    REFUSED = "refused"
    NOT_JUDGED = "not judged"
    """Made by a version that did not put the calibration on trial."""


@dataclass(frozen=True, slots=True)
class MapVerdict:
    """The verdict on a map."""

    standing: Standing
    """The worst that any reason asks for."""
    reasons: tuple[str, ...]
    """Why it is not good; empty if it is."""
    corrections: tuple[str, ...]
    """What was wrong with the camera file and is right in the map."""


def judge(placed: SparseMap) -> MapVerdict:
    """The verdict on a sparse map; everything dense stands on it."""
    doubts, refusals = [], []
    share = float(placed.registered.sum()) / placed.images.count
    if share < LEAST_PLACED:
        lacking = placed.images.count - int(placed.registered.sum())
        runs = overlap.summary(reconstruction.unplaced_runs(placed))
        doubts.append(f"{lacking} of {placed.images.count} images could not be placed{': ' if runs else ''}{runs}")
    if placed.repeated > repetition.MOST:
        doubts.append(
            f"repeated texture: {placed.repeated:.0%} of the features look like others of the same image, so images "
            "may lie where another copy of the texture is"
        )
    for one, other in placed.breaks:
        names = placed.images.instants
        refusals.append(
            f"the map is broken between the images {names[one]} and {names[other]}: each part fits, but no matches "
            "across fit their places, so one part is turned or shifted. Take more images there, closer together and "
            "with more texture, or give a camera file of a calibrated lens"
        )
    of_the_file = _of_the_camera_file(placed)
    doubts, refusals = doubts + of_the_file[0], refusals + of_the_file[1]
    doubts += _bent_doubts(placed)
    lost = [camera.name for number, camera in enumerate(placed.rig) if not placed.registered[:, number].any()]
    if lost:
        doubts.append(f"no image of camera {', '.join(lost)} is in the map: its calibration was not tried")
    for witness in placed.alignment.witnesses[:1]:
        if SIGMAS95 * witness.std > SCALE_DOUBT:
            said = f"the {witness.source} gives the scale to ± {100 * SIGMAS95 * witness.std:.0f} % (95 %) only"
            why = advice.scale_text(placed.trial, is_timed=_is_timed(placed)) if witness.source == BASELINE else ""
            doubts.append(f"{said}, {why}" if why else said)
    for witness in placed.alignment.witnesses[1:]:
        _weigh(placed.alignment.witnesses[0], witness, doubts, refusals)
    doubts += _frame_doubts(placed.alignment)
    for check in placed.alignment.motions:
        doubts += _motion_doubts(check)
        refusals += _motion_refusals(check)
    if placed.alignment.up_source == MotionKind.POSES:
        doubts += _tilt_doubts(placed.T_world_body[placed.placed])
    if placed.alignment.up_source == GRAVITY:
        doubts += _hanging_doubts(placed.T_world_body[placed.placed])
    standing = Standing.REFUSED if refusals else Standing.DOUBTFUL if doubts else Standing.GOOD
    trial = placed.trial
    corrected = [] if placed.images.depths else [f for f in trial.present if f not in trial.inexpressible]
    said = tuple(f"{f.candidate}: {size_text(f)}, corrected" for f in corrected)
    return MapVerdict(standing, (*refusals, *doubts), (*said, *_resized(placed)))


def _of_the_camera_file(placed: SparseMap) -> tuple[list[str], list[str]]:
    """Doubts and refusals by the trial of the camera file."""
    trial, doubts, refusals = placed.trial, list[str](), list[str]()
    if trial.noise_px > LARGEST_NOISE_PX:
        doubts.append(
            f"matches miss their points by {trial.noise_px:.2f} px (up to {LARGEST_NOISE_PX:g} is usual): the lens "
            "model does not fit these images, or things moved"
        )
    others: list[str] = []
    guessed: list[str] = []
    for finding in trial.present:
        width = placed.rig[finding.candidate.camera].width
        is_lens = finding.candidate.kind in OF_THE_LENS
        if finding.shift_px > OTHER_CAMERA_PX or (is_lens and finding.shift_px > OTHER_LENS * width):
            said = f"{finding.candidate} is off by {size_text(finding)}, {finding.shift_px:.0f} px in the image"
            (guessed if is_lens and placed.rig.refine_intrinsics else others).append(said)
        elif placed.images.depths is not None and finding.shift_px > SHIFT_DOUBT_PX:
            doubts.append(
                f"{finding.candidate} is off by {size_text(finding)}: not corrected, as the depth images are drawn for "
                "the lens of the camera file"
            )
        elif finding in trial.inexpressible:
            said = f"{finding.candidate} of {size_text(finding)}, which a camera file cannot state"
            kind = finding.candidate.kind
            remedy = f": {advice.to_record(kind, is_timed=_is_timed(placed))}" if kind in UNTIMED.values() else ""
            doubts.append(said + remedy)
    if others:
        refusals.append(
            f"the camera file is that of another lens, image size or other images: {', '.join(others)}. If it is not, "
            "keep the calibration found here (goshawk camera add) and make the map again"
        )
    if guessed:
        doubts.append(
            f"the lens of the camera file is a first guess, far from the one found here: {', '.join(guessed)}. Keep "
            "that (goshawk camera add) and make the map again: its matches were chosen by the guess"
        )
    for finding in trial.findings:
        if finding.verdict is Verdict.UNKNOWN and finding.largest_shift_px > SHIFT_DOUBT_PX:
            doubts.append(
                f"these images cannot tell an error of the {finding.candidate} of up to {size_text(finding, most=True)}"
            )
    return doubts, refusals


def _is_timed(placed: SparseMap) -> bool:
    return bool(np.isfinite(placed.images.time_s[placed.placed]).all())


def _resized(placed: SparseMap) -> list[str]:
    """That the trial changed the size of a map which the rig's baseline gives."""
    growth = placed.trial.growth
    if placed.alignment.scale_source != BASELINE or abs(np.log(growth)) < RESIZED:
        return []
    return [f"the map was made {growth:.3g} times as large as it was first placed, as the matches ask"]


def _bent_doubts(placed: SparseMap) -> list[str]:
    """Whether small errors that all images share may have bent the path as a whole."""
    std_m = placed.shape_std_m[placed.placed]
    known = np.isfinite(std_m)
    if not known.any() or np.sqrt(np.mean(std_m[known] ** 2)) <= SHAPE_DOUBT_M or _shape_is_recorded(placed):
        return []
    worst = np.array(placed.images.instants)[placed.placed][np.nanargmax(std_m)]
    return [
        f"the map may be bent: image {worst} may be {SIGMAS95 * np.nanmax(std_m):.2g} m beside its place in the whole. "
        f"Come back to places seen before (a loop), or record positions within {100.0 * SHAPE_DOUBT_M:.0f} cm "
        "(references.csv, --poses)"
    ]


def _shape_is_recorded(placed: SparseMap) -> bool:
    """Whether the recorded positions of most images lie where the map has them: it is bent no further."""
    residual_m, used = placed.alignment.position_residual_m, placed.alignment.positions_used
    return residual_m is not None and residual_m <= SHAPE_DOUBT_M and used >= _RECORDED * placed.placed.sum()


def _motion_doubts(check: MotionCheck) -> list[str]:
    """What a recorded motion says against the map, or against itself."""
    doubts = []
    if check.late_s is not None and abs(check.late_s) > max(LATE_DOUBT_S, 3.0 * (check.late_std_s or 0.0)):
        doubts.append(
            f"the times of the {check.source} are {abs(check.late_s):.3f} ± {SIGMAS95 * (check.late_std_s or 0.0):.3f} "
            f"s {'late' if check.late_s > 0.0 else 'early'} against the images: shift them"
        )
    if check.turn_error_rad > TURN_DOUBT_RAD:
        doubts.append(
            f"the turns of the {check.source} differ from the map's by {np.degrees(check.turn_error_rad):.1f} deg "
            "(median): they are of another flight or clock, or the map is wrong"
        )
    if check.shape > SHAPE_DOUBT:
        doubts.append(
            f"the {check.source} and the map differ in shape: along the path the scale between them changes by "
            f"{100.0 * check.shape:.0f} %"
        )
    return doubts


def _motion_refusals(check: MotionCheck) -> list[str]:
    """Why the frame of a map with these recorded poses is wrong; odometry does not give one, and drifts."""
    off_rad = check.direction_error_rad or 0.0
    if not check.source.startswith(MotionKind.POSES) or off_rad < DIRECTION_REFUSED_RAD:
        return []
    return [
        f"the {check.source} turn and move along other axes than the images "
        f"({np.degrees(off_rad):.0f} deg apart). They are of another flight, or their quaternions are of another order "
        "(TUM: x y z w, EuRoC: w x y z) or direction (world to body)"
    ]


def _frame_doubts(alignment: Alignment) -> list[str]:
    """Recorded positions that lie beside the map, and poses whose up is not the map's."""
    doubts: list[str] = []
    residual_m, up_off_rad = alignment.position_residual_m or 0.0, alignment.poses_up_off_rad or 0.0
    if residual_m > LARGE_RESIDUAL * alignment.position_extent_m:
        better = f"; they fit if {alignment.better_axes}" if alignment.better_axes else ""
        doubts.append(
            f"recorded and mapped positions are {residual_m:.2g} m apart (median; the path extends over "
            f"{alignment.position_extent_m:.2g} m): their frame is another, or they are wrong{better}"
        )
    if alignment.up_source != MotionKind.POSES and up_off_rad > UP_DOUBT_RAD:
        doubts.append(
            f"up by the recorded poses is {np.degrees(up_off_rad):.0f} deg from the {alignment.up_source}: give them "
            "with z up, or as --odometry"
        )
    return doubts


def _hanging_doubts(T_world_body: FloatArray) -> list[str]:
    tilt_rad = _tilt_rad(T_world_body)
    if tilt_rad < HANGING_DOUBT_RAD:
        return []
    return [
        f"by the recorded gravity the vehicle hangs upside down (its z axis is {np.degrees(tilt_rad):.0f} deg from up, "
        "median). up_body must point up, as an accelerometer at rest shows; change the signs if yours points down"
    ]


def _tilt_rad(T_world_body: FloatArray) -> float:
    """Median angle between the body's z axis and up."""
    return float(np.median(np.arccos(np.clip(T_world_body[:, 2, 2], -1.0, 1.0))))


def _tilt_doubts(T_world_body: FloatArray) -> list[str]:
    tilt_rad = _tilt_rad(T_world_body)
    if tilt_rad < TILT_DOUBT_RAD:
        return []
    likely = max(_OTHER_UP, key=lambda up: float(np.median(T_world_body[:, :3, 2] @ np.array(up))))
    return [
        f"by the recorded poses the vehicle is tilted by {np.degrees(tilt_rad):.0f} deg (median), as if in them "
        f"{_OTHER_UP[likely]}. Give them with z up, or as --odometry, or correct the direction in which the camera "
        "file has the camera look"
    ]


_OTHER_UP = {
    (0.0, 0.0, -1.0): "z were down (north, east, down)",
    (0.0, 1.0, 0.0): "y were up (ARKit, T265)",
    (0.0, -1.0, 0.0): "y were down (a camera's axes)",
    (1.0, 0.0, 0.0): "x were up",
    (-1.0, 0.0, 0.0): "x were down",
}


def _weigh(used: ScaleWitness, other: ScaleWitness, doubts: list[str], refusals: list[str]) -> None:
    off, std = abs(other.ratio - 1.0), float(np.hypot(used.std, other.std))
    if off < max(SCALE_DOUBT, 3.0 * std):
        return
    text = (
        f"the scale from the {used.source} is {other.ratio:.3f} times that from the {other.source} "
        f"(± {SIGMAS95 * std:.3f}); one of them is wrong{_unit(other.ratio)}"
    )
    (refusals if off > max(SCALE_REFUSED, 3.0 * std) else doubts).append(text)


def _unit(ratio: float) -> str:
    """A unit that the ratio of two scales would come from."""
    for factor, unit in ((100.0, "centimetres"), (1000.0, "millimetres")):
        if min(abs(ratio / factor - 1.0), abs(ratio * factor - 1.0)) < SCALE_REFUSED:
            return f", as if it were in {unit}"
    return ""


def size_text(finding: Finding, *, most: bool = False) -> str:
    """The size of an error with its 95 % interval, in the unit a user knows.

    Args:
        most: the largest size that the matches allow, instead.
    """
    factor, unit = _SHOWN[finding.candidate.kind]
    size, std = factor * _length(finding.size), factor * _length(finding.std)
    return (f"{size + SIGMAS90 * std:.3g} {unit}" if most else f"{size:.3g} ± {SIGMAS95 * std:.1g} {unit}").rstrip()


_SHOWN = {
    Kind.FOCAL: (100.0, "%"),
    Kind.CENTRE: (1.0, "px"),
    Kind.RADIAL: (1.0, "(k1)"),
    Kind.HIGHER: (1.0, "(k2, k3, k4)"),
    Kind.TANGENTIAL: (1.0, "(p1, p2)"),
    Kind.ROTATION: (float(np.degrees(1.0)), "deg"),
    Kind.TRANSLATION: (float(np.degrees(1.0)), "deg"),
    Kind.OFFSET: (1000.0, "ms"),
    Kind.SHUTTER: (1000.0, "ms"),
    Kind.UNTIMED_OFFSET: (1.0, ""),
    Kind.UNTIMED_SHUTTER: (1.0, ""),
    Kind.BASELINE: (100.0, "%"),
}


def _length(values: FloatArray) -> float:
    return float(np.linalg.norm(values))
