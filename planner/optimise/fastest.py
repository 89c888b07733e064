"""The fastest path along a route that the whole vehicle can fly: optimise, measure, correct, repeat.

The optimiser works with a reduced vehicle (`planner.optimise.airframe`). After each round the vehicle's own model is
asked along the path where a limit is near. What it says beyond the reduced one is added there, what is still exceeded
is asked for more strictly there (the multiplier of an augmented Lagrangian), and so is what only the gate sees; where
clearance is lacking, more is aimed at. Other segments keep their way and speed.
"""

from dataclasses import dataclass, replace

import numpy as np

import esdf
from flight import FloatArray, Progress, Trajectory, polynomial, silent
from flight.trajectory import LONGEST_S
from planner.curve import minimum_snap
from planner.curve.attitude import Memory, segment_keys
from planner.gate import limits
from planner.gate.gate import AskGate, GateReport
from planner.optimise import descents
from planner.optimise.corrections import Corrections
from planner.optimise.time_allocation import Problem
from planner.request import space
from planner.request.conditions import Conditions
from planner.request.inputs import Request
from planner.request.options import PlanInfeasibleError

_WHOLE = 3
"""Rounds about all segments; later ones mend what is exceeded here and there."""
_ROUNDS = 40
_RELIEVED, _LONGER, _AGAIN = 0.02, 1.002, 8
"""Where the vehicle's own model asks for so much less than was believed, a path that passes is optimised once more, and
all of it in the open where it takes so many times the optimum; so many rounds are given to that. Among obstacles the
latter made 50 flights .01 % shorter, for a fifth of the work."""
_FEW = 0.4
"""Share of the segments below which only those that exceed a limit, and their neighbours, are optimised again."""
_REACH, _FAR = 4, 6
"""Neighbours on either side that are; so many where a waypoint has moved."""
_LOOKED_AT = np.linspace(0.0, 1.0, 33)
"""Where in each segment clearance is looked at, once the path is known to lack some."""


@dataclass(frozen=True, slots=True, eq=False)
class Kept:
    """How an optimised path came about."""

    problem: Problem
    spline: minimum_snap.Spline
    corrections: Corrections


@dataclass(frozen=True, slots=True)
class Optimum:
    """How close a path is to the shortest time that the optimiser knows of."""

    shortest_s: float
    """What it took for the shortest time when it first ended, before the vehicle's own model and the gate spoke."""
    converged: bool = False
    """Whether the last descent ended by itself, and not because its iterations were used up."""
    residual: float = np.nan
    """Share of the flight time that it would still gain by its undamped quadratic model; at kinks, less."""
    active: tuple[str, ...] = ()
    """The limit that holds each segment back most, by its multipliers; "" where none does."""
    spread: float = np.nan
    """How much longer the slowest path from any start of the descent took, as a share; NaN of a single start."""


@dataclass(frozen=True, slots=True, eq=False)
class _Candidate:
    """A path that keeps clear of obstacles and within limits as far as the optimiser measured; not at the gate yet."""

    trajectory: Trajectory
    waypoint: np.ndarray
    method: str
    optimum: Optimum
    kept: Kept

    def judged(self, ask_gate: AskGate, known: limits.Known | None = None) -> "Path":
        report = ask_gate(self.trajectory, known)
        return Path(self.trajectory, self.waypoint, self.method, report, self.optimum, self.kept)


@dataclass(frozen=True, slots=True, eq=False)
class Path:
    """A trajectory as it went through the gate, and how it came about."""

    trajectory: Trajectory
    waypoint: np.ndarray
    """(k + 1,) which waypoint each knot is, -1 for none."""
    method: str
    report: GateReport
    optimum: Optimum
    kept: Kept | None = None
    """From what it can be optimised further; None for a path in a corridor, and for one that was slowed down."""


@dataclass(frozen=True, slots=True, eq=False)
class _Round:
    """Where one round's descent ended, with what the vehicle's own model and the field say of it."""

    problem: Problem
    descended: descents.Descended
    touched: np.ndarray
    """(k,) bool: the segments that it was about."""
    path: Trajectory
    optimised_s: float
    exceeded: np.ndarray
    """(k,) bool: where the vehicle's own model finds a limit exceeded."""
    relieved: np.ndarray
    """(k,) bool: where it asks for much less than was believed."""
    lack_m: FloatArray
    """(k,) the clearance that each segment lacks."""

    @property
    def clear(self) -> bool:
        return not self.lack_m.any()

    def candidate(self, waypoint: np.ndarray, method: str, shortest_s: float, corrections: Corrections) -> _Candidate:
        ended, active = self.descended, corrections.active(self.touched)
        optimum = Optimum(shortest_s, ended.converged, ended.residual, active)
        kept = Kept(self.problem, ended.spline, corrections.spliced(0, 0, 0))
        return _Candidate(self.path, waypoint, method, optimum, kept)


def until_flyable(
    problem: Problem,
    spline: minimum_snap.Spline,
    waypoint: np.ndarray,
    request: Request,
    ask_gate: AskGate,
    *,
    wrong: np.ndarray | None = None,
    drawn: bool = True,
    corrections: Corrections | None = None,
    used: tuple[Trajectory, limits.Usage] | None = None,
    progress: Progress = silent,
) -> Path | None:
    """Optimise until a trajectory passes the gate; None if it stays too close to obstacles.

    The first rounds are about all segments, unless `wrong` (k,) says which ones to begin with; then only those that
    exceed a limit are optimised again, with their neighbours, and the first path that passes will do. Where limits stay
    exceeded in spite of it, the last trajectory is returned with its report.

    Args:
        spline: the path to go on from.
        drawn: False where only places of the knots about `wrong` are known.
        corrections, used: those of an earlier answer, and what the gate found of it.
    """
    corrections = (
        Corrections(len(spline.durations_s), len(problem.airframe.names)) if corrections is None else corrections
    )
    memory = Memory()  # the last path that is measured is the one that the gate looks at
    proven = set[bytes]()
    optimum_s, bends, begun = np.nan, 0, _WHOLE if wrong is not None else 0
    early, rounds, may_gain = None, _ROUNDS, begun == 0
    in_open = descents.in_the_open(problem, spline, request.options.clearance_m)
    at_first, later = descents.precision(in_open)
    for round_ in range(begun, _ROUNDS):
        if early is not None and round_ == rounds:
            judged, early = early.judged(ask_gate, limits.Known(used, memory)), None
            if judged.report.passed:
                return judged
        progress("optimise", 1.0 - 0.7 ** (round_ - begun + 1))  # how many rounds it takes is not known before
        charged_s = spline.durations_s if round_ > 0 else None
        offsets, farther_m = corrections.total(), corrections.farther_m
        problem = replace(problem, offsets=offsets, farther_m=farther_m, reference_s=charged_s)
        reach = _FAR if round_ == begun else _REACH
        touched = np.ones(len(spline.durations_s), dtype=bool) if wrong is None else descents.grown(wrong, reach)
        if round_ == begun and not drawn:
            spline = descents.redrawn(problem, spline, touched, request.stop)
        precision = at_first if round_ < _WHOLE else later
        descended = descents.refined(problem, spline, touched, precision, request.stop, near=round_ > _WHOLE)
        now = _measured(problem, descended, touched, corrections, request, memory, proven)
        problem, spline, exceeded = now.problem, descended.spline, now.exceeded
        optimum_s = now.optimised_s if round_ == begun else optimum_s
        last = round_ == _ROUNDS - 1
        if now.clear and (last or not exceeded.any()):
            here = now.candidate(waypoint, "bent" if bends else "direct", optimum_s, corrections)
            longer = in_open and now.path.duration_s > _LONGER * optimum_s
            if may_gain and not last and (longer or now.relieved.any()):
                early, rounds, may_gain = here, round_ + _AGAIN, False
                wrong = None if longer else now.relieved
                corrections.press(touched)
                continue
            judged = here.judged(ask_gate, limits.Known(used, memory))
            used = judged.report.usage and (now.path, judged.report.usage)
            slower, on_legs = _refused(judged.report, request.conditions, waypoint)
            if judged.report.passed or last or not slower.any():  # nothing else gets better by more rounds
                return _better(early, judged, ask_gate, limits.Known(used, memory))
            assert used is not None
            corrections.stricter(used[1], on_legs)
            exceeded = exceeded | slower
        corrections.press(touched)
        if not now.clear:
            if bends == request.options.repairs:
                break
            bends += 1
            problem = _dearer(problem)
            corrections.farther(now.lack_m)
            exceeded = exceeded | (now.lack_m > 0.0)
        few = descents.grown(exceeded, _REACH).mean() < _FEW
        wrong = exceeded if wrong is not None or few or round_ + 1 >= _WHOLE else None
    return early and early.judged(ask_gate, limits.Known(used, memory))


def _measured(
    problem: Problem,
    descended: descents.Descended,
    touched: np.ndarray,
    corrections: Corrections,
    request: Request,
    memory: Memory,
    proven: set[bytes],
) -> _Round:
    """Look at where a descent in the segments `touched` (k,) ended; the corrections learn what the model says there.

    Args:
        proven: keys of segments that keep clear of obstacles; it is extended.

    Raises:
        PlanInfeasibleError: it takes longer than a trajectory may.
        PlanCancelledError: the request's `stop` was set.
    """
    spline, believed = descended.spline, corrections.model.copy()
    optimised_s = float(spline.durations_s.sum())
    if optimised_s > LONGEST_S:
        raise _too_long(spline.durations_s)
    problem = replace(problem, knots=spline.states[:, 0])
    path = minimum_snap.trajectory(spline)
    excess = corrections.measure(problem, spline, path, request.vehicle, touched, memory, request.stop)
    relieved = (believed - corrections.model).max(axis=(1, 2)) > _RELIEVED
    exceeded = excess.max(axis=(1, 2)) > 0.0
    if not exceeded.any():  # the gate is next, and looks at all of it
        proven.clear()
    lack_m = _lacking(request, path, proven)
    return _Round(problem, descended, touched, path, optimised_s, exceeded, relieved, lack_m)


def _lacking(request: Request, path: Trajectory, proven: set[bytes]) -> FloatArray:
    """(k,) what each segment not yet `proven` lacks of the required clearance, and 0 for the others."""
    keys, required_m = segment_keys(path, np.arange(len(path.durations_s))), request.options.clearance_m
    new, lack_m = np.array([i for i, key in enumerate(keys) if key not in proven], dtype=np.int64), np.zeros(len(keys))
    if not new.size:
        return lack_m
    durations, coefficients = path.durations_s[new], path.coefficients[new]
    found = esdf.certify(request.field, Trajectory(durations, coefficients), required_m)
    if found.passed:
        proven.update(keys)
        return lack_m
    points = polynomial.evaluate(coefficients[:, None, :3], (_LOOKED_AT * durations[:, None])[..., None])
    nearest = space.distance(request.field, points.reshape(-1, 3)).reshape(len(new), -1).min(axis=1)
    lack_m[new] = np.maximum(required_m - nearest, 0.0)
    lack_m[new[found.segment]] = required_m - found.proven_m
    return lack_m


def _better(early: _Candidate | None, last: Path, ask_gate: AskGate, known: limits.Known) -> Path:
    """The last path, unless the early one takes less time, or the last one is refused, and the early one passes."""
    if early is None or (last.report.passed and last.trajectory.duration_s <= early.trajectory.duration_s):
        return last
    first = early.judged(ask_gate, known)
    return first if first.report.passed else last


def _refused(report: GateReport, asked: Conditions, waypoint: np.ndarray) -> tuple[np.ndarray, dict[str, np.ndarray]]:
    """(k,) bool: the segments that the gate found too fast for a limit or for what is asked of their leg, and by name
    of the limit those for their leg; `waypoint` (k + 1,) is which waypoint each knot is."""
    used = report.usage
    if used is None:
        return np.zeros(len(waypoint) - 1, dtype=bool), {}
    most_on_legs = asked.most_on_legs(waypoint)
    beyond = {name: used.value[limits.NAMES.index(name)] > most for name, most in most_on_legs.items()}
    return ~used.passed.all(axis=0) | np.any(list(beyond.values()), axis=0), beyond


def faster(found: Path | None, here: Path) -> Path:
    """The path that was found before, unless the one that is here passes and takes less time."""
    if found is None or (here.report.passed and here.trajectory.duration_s < found.trajectory.duration_s):
        return here
    return found


def _too_long(durations_s: FloatArray) -> PlanInfeasibleError:
    return PlanInfeasibleError(
        f"the shortest time found is {durations_s.sum():.3g} s, and a trajectory lasts at most {LONGEST_S:g} s",
        "raise the speeds asked for on legs, or plan the flight in parts",
    )


def _dearer(problem: Problem) -> Problem:
    """Raise the price of clearance: in a gap narrower than what is aimed at, aiming at more changes nothing."""
    return replace(problem, weights=replace(problem.weights, clearance=problem.weights.clearance * 4.0))
