"""Calibration on trial: which error of a camera file the matches of a map show, how large it is, and how sure that is.

A reprojection error that falls proves nothing, since every freed parameter lowers it. An error is therefore estimated
from some of the points and judged by the others (cross-validation).
"""

import dataclasses
import enum
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from flight import FloatArray
from mapping.camera import pose_priors
from mapping.camera.adjustment import Normal, Observations, adjust, cost, counted, initial, twists
from mapping.camera.errors import BEYOND_THESE_IMAGES, INEXPRESSIBLE, PLAUSIBLE, Candidate, Kind, State, candidates
from mapping.camera.pose_priors import Judged, Recorded
from mapping.camera.rig import Rig

LEAST_BASELINE_M = 0.005
"""A shorter baseline gives no scale."""
LEAST_GAIN = 30.0
"""Fall of the withheld points' chi squared from which an error is present."""
NOTICEABLE_PX = 0.10
"""RMS shift of the image below which an error does not matter: matching itself has systematic errors of this size."""
SIGMAS90 = 1.645
"""Half width of a 90 % interval, in standard deviations."""
SIGMAS95 = 1.96
"""Of a 95 % interval: every `±` on the screen and in sentences is one."""

_NARROWED = 0.1
"""An error whose standard deviation is still this share of what is plausible was not looked at by the matches."""
_MOST_ROUNDS = 4
_LEAST_TIMED = 0.9
"""Share of the placed images with a velocity from which their times are used."""
_AS_WELL = 1.1
"""Median residual, over that with all errors free, up to which the camera file explains the matches."""
_CLEARLY = 0.9
"""... and over that of the map as it was made, from which another size explains them better."""
_OTHER_SIZE = float(np.log(2.0))
"""Logarithm of two sizes of a map from which the second is tried: from nearer, the adjustment finds it. Half of it in a
linear step is enough to look."""


class Verdict(enum.StrEnum):
    """What the matches say of a candidate error."""

    PRESENT = "present"
    EXCLUDED = "excluded"
    UNKNOWN = "cannot tell"


@dataclass(frozen=True, slots=True, eq=False)
class Finding:
    """What the matches say of one candidate, once the errors that are present were corrected."""

    candidate: Candidate
    """The error on trial."""
    verdict: Verdict
    """Whether it is there."""
    size: FloatArray
    """(n,) the true value less the camera file's, in `Kind.units`."""
    std: FloatArray
    """(n,) of `size`, see `Normal.dispersion`."""
    shift_px: float
    """How far the error moves the image, RMS over all observations of the camera."""
    largest_shift_px: float
    """The same at the far end of the 90 % interval: no larger error is likely."""
    gain: float
    """Fall of the withheld points' chi squared when it is corrected, over `Normal.dispersion`."""
    scale_std: float = 0.0
    """Relative standard deviation of the rig's scale that would be gone if the size of this error were known."""

    def as_dict(self) -> dict[str, Any]:
        """Numbers and words for a report file."""
        return {
            "camera": self.candidate.camera,
            "error": str(self.candidate.kind),
            "verdict": str(self.verdict),
            "size": self.size.tolist(),
            "std": self.std.tolist(),
            "units": list(self.candidate.kind.units),
            "shift_px": self.shift_px,
            "largest_shift_px": self.largest_shift_px,
            "gain": self.gain,
            "scale_std": self.scale_std,
        }

    @staticmethod
    def from_dict(numbers: dict[str, Any]) -> "Finding":
        """The finding that `as_dict` described."""
        return Finding(
            Candidate(numbers["camera"], Kind(numbers["error"])),
            Verdict(numbers["verdict"]),
            np.array(numbers["size"]),
            np.array(numbers["std"]),
            numbers["shift_px"],
            numbers["largest_shift_px"],
            numbers["gain"],
            numbers.get("scale_std", 0.0),
        )


@dataclass(frozen=True, slots=True, eq=False)
class Trial:
    """The outcome of a trial."""

    findings: tuple[Finding, ...]
    """One for each candidate; those that are present come first, in the order in which they were found."""
    rig: Rig
    """The rig, corrected by what is present as far as a camera file can express it."""
    T_world_body: FloatArray
    """(instants, 4, 4) adjusted together with everything that is present; NaN where not placed."""
    points_world: FloatArray
    """(m, 3), likewise."""
    noise_px: float
    """Standard deviation of a match in each pixel coordinate, with what is present corrected."""
    scale_std: float
    """Relative standard deviation of the scale that the distance between the cameras gives, see `Normal.scale_std`, if
    any error may be there, as large as the matches allow. Infinite for one camera."""
    shape_std: FloatArray | None = None
    """(instants,) of each position, see `Normal.shape_std`, in the unit of `points_world`; None if not known."""
    growth: float = 1.0
    """Size of the path over that before the trial."""
    priors: Judged | None = None
    """What recorded poses are worth, if they held the poses, too."""

    @property
    def present(self) -> tuple[Finding, ...]:
        return tuple(f for f in self.findings if f.verdict is Verdict.PRESENT)

    @property
    def inexpressible(self) -> tuple[Finding, ...]:
        """What is present and no camera file can state; only `T_world_body` and `points_world` allow for it."""
        return tuple(f for f in self.present if f.candidate.kind in INEXPRESSIBLE)


def hold(seen: Observations, recorded: Recorded | None = None) -> Trial:
    """Try every calibration error on the matches of a map.

    All errors are estimated together and then given up one by one, the least missed first, until each that is left is
    missed by the withheld points (backward elimination: two errors that only explain the matches together, such as
    focal length and radial distortion, are not overlooked). The adjustment is linearised anew with what is left, until
    the same errors are left twice. Then those are given up which errors that all matches of one image share could have
    made, again the least missed first. Recorded poses say nothing in all this: they hold the poses afterwards.
    """
    timed = _timed(seen)
    seen = seen if timed else counted(seen)
    observed = {seen.rig.cameras[k].name for k in np.unique(seen.index[:, 2])}
    tried = [c for c in candidates(seen.rig, timed=timed) if c.camera in observed]
    present: list[Candidate] = []
    start, state = _at_its_size(seen, tried)
    sizes: dict[Candidate, FloatArray] = {}
    for _ in range(_MOST_ROUNDS):
        normal = Normal(seen, state, tried)
        left = _eliminate(normal, sizes)
        if set(left) == set(present):
            break
        present = left
        state, sizes = adjust(seen, start, present)
    else:
        normal = Normal(seen, state, tried)
    while (least := _least_needed(normal, present, sizes)) is not None:
        present = [c for c in present if c != least]
        state, sizes = adjust(seen, start, present)
        normal = Normal(seen, state, tried)
    findings = [_finding(normal, present, sizes, c) for c in tried]
    scale_std, findings = _scale(normal, state, present, findings)
    findings.sort(key=lambda f: (f.verdict is not Verdict.PRESENT, -f.shift_px if f.candidate in present else 0.0))
    held = pose_priors.adjusted(seen, state, recorded, tried) if recorded is not None else None
    if held is not None:
        state, pull, _ = held
        normal = Normal(seen, state, tried, pull=pull)
    return Trial(
        tuple(findings),
        state.rig,
        state.T_world_body,
        state.points_world,
        normal.noise_px,
        scale_std,
        normal.shape_std(state),
        _extent(state.T_world_body) / max(_extent(seen.T_world_body), 1e-12),
        held[2] if held is not None else None,
    )


def _extent(T_world_body: FloatArray) -> float:
    """Root mean square distance of the positions from their middle."""
    return float(np.sqrt(np.nansum(np.nanvar(T_world_body[:, :3, 3], axis=0))))


def _timed(seen: Observations) -> bool:
    """Whether times give nearly all images a velocity: where a few have one, a late camera looks like a wrong lens."""
    known = np.isfinite(twists(seen.time_s, seen.T_world_body)[np.isfinite(seen.T_world_body[:, 0, 0]), 0])
    return bool(known.size) and float(known.mean()) >= _LEAST_TIMED


def _at_its_size(seen: Observations, tried: Sequence[Candidate]) -> tuple[State, State]:
    """The map as it was made, and adjusted; or as large as its matches ask for, if the camera file then explains them.

    A baseline that is short beside the path acts on the matches by its share of the path's length, so that a map ten
    times too large is far from linear in its size, and near in the length of its baseline. That is estimated.
    """
    start = initial(seen)
    adjusted, _ = adjust(seen, start, [])
    first = seen.rig.cameras[0].T_body_camera[:3, 3]
    lines_m = {c.name: float(np.linalg.norm(c.T_body_camera[:3, 3] - first)) for c in seen.rig}
    observed = sorted({c.camera for c in tried})
    freed = [Candidate(name, Kind.BASELINE) for name in observed if lines_m[name] > LEAST_BASELINE_M]
    if not freed:
        return start, adjusted
    asked, _ = Normal(seen, start, freed, folds=1).solve(freed)
    if not np.abs(np.log(np.maximum(1.0 + asked, 1e-3))).max() > 0.5 * _OTHER_SIZE:
        return start, adjusted
    free, _ = adjust(seen, start, freed)
    found_m = {c.name: float(np.linalg.norm(c.T_body_camera[:3, 3] - first)) for c in free.rig}
    stretch = float(np.median([found_m[c.camera] / lines_m[c.camera] for c in freed]))
    if not abs(np.log(stretch)) > _OTHER_SIZE:
        return start, adjusted
    T = free.T_world_body.copy()
    T[:, :3, 3] /= stretch
    resized = dataclasses.replace(start, T_world_body=T, points_world=free.points_world / stretch)
    again, _ = adjust(seen, resized, [])
    if cost(seen, again) > _CLEARLY * cost(seen, adjusted):
        return start, adjusted
    corrected, _ = adjust(seen, again, tried)
    is_right = cost(seen, again) <= _AS_WELL * cost(seen, corrected)  # else the size hides an error of the lens
    return (resized, again) if is_right else (start, adjusted)


def _scale(
    normal: "Normal", state: State, present: Sequence[Candidate], findings: Sequence[Finding]
) -> tuple[float, list[Finding]]:
    """Relative standard deviation of the scale, each error as large as the matches allow; and each finding's part."""

    # an excluded error moves no image noticeably, but a time offset of 1 ms at 4 m/s is a twentieth of a baseline
    whole = max(normal.scale_std(state, present), normal.scale_std(state, normal.tried))
    if not np.isfinite(whole):
        return whole, list(findings)

    def part(c: Candidate) -> float:
        known = normal.scale_std(state, [other for other in normal.tried if other != c])
        return float(np.sqrt(max(whole**2 - known**2, 0.0)))

    return whole, [dataclasses.replace(f, scale_std=part(f.candidate)) for f in findings]


def _eliminate(normal: "Normal", sizes: dict[Candidate, FloatArray]) -> list[Candidate]:
    """The candidates that withheld points miss, and that move the image noticeably.

    Args:
        sizes: what the state of `normal` already allows for; giving such a candidate up takes that away again.
    """
    left = list(normal.tried)
    given_up: dict[Candidate, FloatArray] = {}
    while left:
        whole = normal.gain(left, given_up)
        delta, _ = normal.solve(left)
        missed: dict[Candidate, float] = {}
        for c in left:
            size = delta[normal.place(left, c)] + sizes.get(c, 0.0)
            without = [other for other in left if other != c]
            loss = whole - normal.gain(without, given_up | _undone(sizes, c))
            missed[c] = loss if normal.shift_px(c, size) > NOTICEABLE_PX else min(loss, 0.0)
        least = min(left, key=lambda c: missed[c])
        if missed[least] > LEAST_GAIN:
            break
        # the higher terms can take the place of k1, three numbers for one: where both may go, they go first
        higher = Candidate(least.camera, Kind.HIGHER)
        if least.kind is Kind.RADIAL and missed.get(higher, np.inf) <= LEAST_GAIN:
            least = higher
        left.remove(least)
        given_up |= _undone(sizes, least)
    return left


def _least_needed(
    normal: "Normal", present: Sequence[Candidate], sizes: dict[Candidate, FloatArray]
) -> Candidate | None:
    """What the matches miss least of what is present; None if they miss each, whatever the images' errors are."""
    gains = {c: _gain(normal, present, sizes, c) for c in present}
    needless = [c for c in present if gains[c] <= LEAST_GAIN or normal.shift_px(c, sizes[c]) <= NOTICEABLE_PX]
    return min(needless, key=lambda c: gains[c], default=None)


def _gain(normal: "Normal", chosen: Sequence[Candidate], sizes: dict[Candidate, FloatArray], c: Candidate) -> float:
    """Fall of the withheld points' chi squared by one of the chosen, over its dispersion.

    A withheld point shares the errors of its images with the others: without the dispersion they would count as found.
    """
    without = [other for other in chosen if other != c]
    return (normal.gain(chosen, {}) - normal.gain(without, _undone(sizes, c))) / normal.dispersion(chosen, c)


def _undone(sizes: dict[Candidate, FloatArray], candidate: Candidate) -> dict[Candidate, FloatArray]:
    return {candidate: -sizes[candidate]} if candidate in sizes else {}


def _finding(
    normal: "Normal", present: Sequence[Candidate], sizes: dict[Candidate, FloatArray], c: Candidate
) -> Finding:
    chosen = list(present) if c in present else [*present, c]
    delta, covariance = normal.solve(chosen)
    own = normal.place(chosen, c)
    covariance = normal.dispersion(chosen, c) * covariance[own, own]
    size = sizes.get(c, delta[own])
    shift_px = normal.shift_px(c, size)
    largest_px = shift_px + SIGMAS90 * normal.spread_px(c, covariance)
    std = np.sqrt(np.diag(covariance))
    narrowed = c.kind not in BEYOND_THESE_IMAGES or bool((std < _NARROWED * PLAUSIBLE[c.kind]).all())
    excluded = largest_px < NOTICEABLE_PX and narrowed and normal.is_redundant
    acquitted = Verdict.EXCLUDED if excluded else Verdict.UNKNOWN
    gain = _gain(normal, chosen, sizes, c)
    return Finding(c, Verdict.PRESENT if c in present else acquitted, size, std, shift_px, largest_px, gain)
