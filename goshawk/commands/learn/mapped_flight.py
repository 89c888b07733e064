"""The next flight inside a map: the manoeuvre that tells most of an open question, with place, heading and size.

Every manoeuvre of the library is made as large as some place and heading of the map allow, checked by the planner's
gate, and flown in simulation there; the one from which most is expected is proposed.
"""

import logging
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from math import log

import numpy as np

import planner
from esdf.field import SampledField
from flight import FloatArray, InfeasibleError, InputError, Progress, Trajectory, TrajectoryFile, silent
from planner import GateReport, PlanOptions
from planner.gate import gate
from planner.request import space
from planner.route import placing
from sysid.diagnosis.experiment_design.next_flight import NEEDS_A_CEILING, Proposal, Question
from sysid.diagnosis.experiment_design.rehearsal import Room, flies_near_ground, rehearse, shrink, waypoints_of
from sysid.diagnosis.procedure import NODE_RATE_HZ
from vehicle import Vehicle, manoeuvres

logger = logging.getLogger(__name__)

SETTLED_LOG_ODDS = log(0.95 / 0.05)
"""A question counts as answered when its likelier answer is expected to be 95 % certain."""
SIZES = np.geomspace(1.0, 0.05, 14)
"""Shares of the designed size that are tried, the largest that fits is refined by `_BISECTIONS`."""
_BISECTIONS = 3
_SHRINK, _SHRINKS = 0.97, 4
"""The gate proves clearance along the whole curve and may find less than the points showed: then a little smaller."""
_SLOWER, _SLOWER_TIMES = 1.05, 8
"""The gate's reserves differ from those of the rehearsal: then a little slower."""
_PATH_STEP_S = 0.02
_SIZED = 3
"""Manoeuvres whose least telling size is looked for when nothing in the map tells."""
ANYWHERE = Room(np.full(3, -np.inf), np.full(3, np.inf))


@dataclass(frozen=True, slots=True, eq=False)
class MappedFlight:
    """A manoeuvre where it fits, checked by the gate."""

    proposal: Proposal
    """What it would tell; its trajectory is the checked one."""
    gate: GateReport
    waypoints_world_m: FloatArray
    """(n, 3) points of the manoeuvre, between which its path is nearly straight."""
    size: float
    """Share of its designed size."""
    heading_rad: float
    """By how much it is turned."""

    @property
    def path_world_m(self) -> FloatArray:
        """(n, 3) close points along it."""
        return _path(self.proposal.trajectory)

    @property
    def low_world_m(self) -> FloatArray:
        """(3,) lowest corner of the box its path takes up."""
        return self.path_world_m.min(axis=0)

    @property
    def high_world_m(self) -> FloatArray:
        return self.path_world_m.max(axis=0)

    @property
    def sentence(self) -> str:
        """Where it is, how near to obstacles, and what it would tell."""
        x, y, z = 0.5 * (self.low_world_m + self.high_world_m)
        return (
            f"{self.proposal.name} at {self.size:.0%} of its size about ({x:.2f}, {y:.2f}, {z:.2f}) m, turned by "
            f"{np.degrees(self.heading_rad):.0f} deg: {self.gate.clearance_m:.2f} m from obstacles, "
            f"{self.gate.required_clearance_m:.2f} m is needed. "
            f"{self.proposal.sentence[:1].upper()}{self.proposal.sentence[1:]}"
        )

    def file(self, name: str) -> TrajectoryFile:
        """The manoeuvre itself as a checked trajectory."""
        return planner.checked_file(self.proposal.trajectory, self.gate, self.waypoints_world_m, name=name)

    def as_dict(self) -> dict[str, object]:
        return {
            **self.proposal.as_dict(),
            "size": self.size,
            "heading_rad": self.heading_rad,
            "low_world_m": self.low_world_m.tolist(),
            "high_world_m": self.high_world_m.tolist(),
            "clearance_m": self.gate.clearance_m,
            "required_clearance_m": self.gate.required_clearance_m,
        }


@dataclass(frozen=True, slots=True, eq=False)
class MappedRanking:
    """Flights that fit into the map, the most telling first, and why the others do not."""

    candidates: tuple[str, ...]
    flights: tuple[MappedFlight, ...]
    skipped: tuple[tuple[str, str], ...]


def rank_in_map(
    question: Question,
    field: SampledField,
    believed: Vehicle,
    options: PlanOptions,
    *,
    library: Sequence[str] | None = None,
    rng: np.random.Generator,
    progress: Progress = silent,
) -> MappedRanking:
    """Fit every manoeuvre into the map; the one with the largest expected log odds comes first.

    Args:
        believed: the vehicle whose limits the gate checks.
        options: clearance and limits to keep; headings are the manoeuvre's own.
        library: names of manoeuvres; else all of `vehicle.manoeuvres.LIBRARY`.

    Raises:
        InfeasibleError: none fits so that the question would be answered; the message says how much free space that
            takes, and how much there is.
    """
    options = replace(options, yaw="free").sized(believed)
    names = tuple(library or manoeuvres.LIBRARY)
    flown_s = np.cumsum([0.0, *(manoeuvres.make(name).duration_s for name in names)])
    fitted: list[MappedFlight] = []
    skipped: list[tuple[str, str]] = []
    for name, before_s in zip(names, flown_s, strict=False):
        progress("fit into the map", float(before_s / flown_s[-1]))  # simulating it takes as long as it is, about
        try:
            fitted.append(_fit(name, question, field, believed, options, rng))
        except InfeasibleError as error:
            skipped.append((name, str(error)))
            logger.info("%s: %s", name, error)
    fitted.sort(key=lambda each: -each.proposal.expected_log_odds)
    if not fitted or not _answers(fitted[0].proposal):
        raise InfeasibleError(_refusal(question, field, options, names, fitted, rng, progress))
    progress("fit into the map", 1.0)
    return MappedRanking(tuple(c.name for c in question.candidates), tuple(fitted), tuple(skipped))


def _answers(proposal: Proposal) -> bool:
    return proposal.known_log_odds + proposal.expected_log_odds >= SETTLED_LOG_ODDS


def _fit(
    name: str,
    question: Question,
    field: SampledField,
    believed: Vehicle,
    options: PlanOptions,
    rng: np.random.Generator,
) -> MappedFlight:
    """One manoeuvre, as large as the map allows.

    Raises:
        InfeasibleError: it does not fit, stays in one place, or the simulated vehicle comes too close.
    """
    design = _designed(name)
    size, placed, report, points = _largest(design, name, question.model.fit.vehicle, field, believed, options)
    flown = rehearse(question.model.fit, placed[0], ANYWHERE, NODE_RATE_HZ, rng, ground_m=-np.inf)
    nearest_m = float(np.nan_to_num(field.distance(flown.states.position_world_m), nan=-np.inf).min())
    if nearest_m < options.body_radius_m:
        raise InfeasibleError(f"the simulated vehicle, as it follows, comes within {nearest_m:.2f} m of obstacles")
    return MappedFlight(question.proposal(name, placed[0], flown), report, points, size, placed[1])


def _designed(name: str) -> Trajectory:
    design = manoeuvres.make(name)
    if name in NEEDS_A_CEILING:
        raise InfeasibleError("it needs a known ceiling above it, not free space")
    if flies_near_ground(design):
        raise InfeasibleError("it flies nearer to the ground than the clearance allows")
    if float(np.ptp(_path(design), axis=0).max()) <= 0.0:
        raise InfeasibleError("it stays in one place; hover anywhere for it")
    return design


def _largest(
    design: Trajectory,
    name: str,
    fitted: Vehicle,
    field: SampledField,
    believed: Vehicle,
    options: PlanOptions,
) -> tuple[float, tuple[Trajectory, float], GateReport, FloatArray]:
    """Size, the trajectory and its heading, the gate's report and waypoints of the largest that passes the gate."""
    path = _path(design)
    wanted_m = space.aim(field, options.planned_clearance_m)
    size = _largest_size(lambda s: placing.place(s * path, field, wanted_m) is not None)
    if size is None:
        low = SIZES[-1] * np.ptp(path, axis=0)
        raise InfeasibleError(
            f"even at {SIZES[-1]:.0%} of its size, {_box(low)} and {options.clearance_m:.2f} m round it, it finds no "
            "place in the map"
        )
    for _ in range(_SHRINKS):
        placement = placing.place(size * path, field, wanted_m)
        if placement is not None:
            smaller = shrink(design, size, fitted)
            placed = placement.apply(smaller, placing.middle_of(_path(smaller)))
            checked = _slowed_to_pass(placed, name, field, believed, options)
            if checked is not None:
                trajectory, report, points = checked
                return size, (trajectory, placement.heading_rad), report, points
        size *= _SHRINK
    raise InfeasibleError("where it finds room, the gate does not pass it")


def _largest_size(fits: Callable[[float], bool]) -> float | None:
    """The largest share of the designed size that fits; None if none of `SIZES` does."""
    above = None
    for size in SIZES.tolist():
        if fits(size):
            break
        above = size
    else:
        return None
    if above is None:
        return size
    for _ in range(_BISECTIONS):
        middle = float(np.sqrt(size * above))
        size, above = (middle, above) if fits(middle) else (size, middle)
    return size


def _slowed_to_pass(
    placed: Trajectory, name: str, field: SampledField, believed: Vehicle, options: PlanOptions
) -> tuple[Trajectory, GateReport, FloatArray] | None:
    """The trajectory, as fast as the gate allows; None if it is not speed that it fails by."""
    for _ in range(_SLOWER_TIMES):
        points = _waypoints(placed, name)
        report = gate.check(placed, field, believed, options, waypoints_world_m=points)
        if report.passed:
            return placed, report, points
        if any(check.name in ("clearance", "waypoints") for check in report.failures):
            return None
        placed = placed.scale_time(_SLOWER)
    return None


def _waypoints(trajectory: Trajectory, name: str) -> FloatArray:
    try:
        return waypoints_of(trajectory, name).positions_world_m
    except InputError as error:
        raise InfeasibleError(str(error)) from error


def _path(trajectory: Trajectory) -> FloatArray:
    return trajectory.position(trajectory.sample(_PATH_STEP_S))


# --- where nothing fits ---


def _refusal(
    question: Question,
    field: SampledField,
    options: PlanOptions,
    names: Sequence[str],
    fitted: Sequence[MappedFlight],
    rng: np.random.Generator,
    progress: Progress,
) -> str:
    """How much space an answer takes, how much there is, and what the best flight here would be worth."""
    asked = " or ".join(c.name for c in question.candidates)
    try:
        box = placing.largest_free_box(field)
        free = f"the largest free box is {_box(np.array(box.size_m))} (to {box.cell_m:.2f} m)"
    except InfeasibleError as error:
        free = str(error)
    here = ""
    if fitted:
        best = fitted[0].proposal
        here = f"; the best that fits, {best.name} at {fitted[0].size:.0%}, is worth {best.expected_log_odds:.1f}"
        here += f" log odds where {SETTLED_LOG_ODDS - best.known_log_odds:.1f} are needed"
    needed = _least_space(question, options, names, rng, progress)
    if needed is None:
        return f"no manoeuvre would answer {asked}, even in open space{here}; fly longer, or name another candidate"
    name, size_m = needed
    return f"not in this map: {name} needs {_box(size_m)} of free space to answer {asked}; {free}{here}"


def _least_space(
    question: Question, options: PlanOptions, names: Sequence[str], rng: np.random.Generator, progress: Progress
) -> tuple[str, FloatArray] | None:
    """The manoeuvre that answers in the least free space, and (3,) that space, clearance included; None if none does.

    The most telling ones of open space are made smaller until they tell no more.
    """

    def worth(name: str, size: float) -> Proposal | None:
        try:
            trajectory = shrink(_designed(name), size, question.model.fit.vehicle)
            flown = rehearse(question.model.fit, trajectory, ANYWHERE, NODE_RATE_HZ, rng, ground_m=-np.inf)
        except InfeasibleError:
            return None
        return question.proposal(name, trajectory, flown)

    open_: dict[str, Proposal] = {}
    for i, name in enumerate(names):
        progress("what it takes", i / len(names))
        proposal = worth(name, 1.0)
        if proposal is not None and _answers(proposal):
            open_[name] = proposal
    boxes: dict[str, FloatArray] = {}
    for name in sorted(open_, key=lambda n: -open_[n].expected_log_odds)[:_SIZED]:
        telling, silent_ = 1.0, float(SIZES[-1])
        for _ in range(_BISECTIONS + 1):
            middle = float(np.sqrt(telling * silent_))
            smaller = worth(name, middle)
            if smaller is not None and _answers(smaller):
                telling = middle
            else:
                silent_ = middle
        boxes[name] = telling * np.ptp(_path(manoeuvres.make(name)), axis=0) + 2.0 * options.clearance_m
    if not boxes:
        return None
    least = min(boxes, key=lambda n: float(np.prod(boxes[n])))
    return least, boxes[least]


def _box(size_m: FloatArray) -> str:
    return " x ".join(f"{side:.1f}" for side in size_m) + " m"
