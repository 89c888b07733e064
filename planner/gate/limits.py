"""Whether the vehicle can fly a trajectory: every limit bounded over all time, segment by segment.

Speed, acceleration and jerk are polynomials: the bound is the hull of their control points. Tilt, rates and rotor
speeds follow from the vehicle's own forces (`planner.curve.attitude`, drag included): the hull of the polynomials that
interpolate them, and an allowance for what those cannot show. Pieces of a path are halved where that decides about a
limit.
"""

from dataclasses import asdict, dataclass
from functools import cache

import numpy as np
from numpy.polynomial import chebyshev

from flight import FlightError, FloatArray, Trajectory, polynomial, portable
from planner._planner import StopFlag
from planner.curve import attitude
from planner.request.options import PlanCancelledError, check_stop
from vehicle import Limits, Vehicle, invert

_PIECES = 16
"""Parts of a segment in which the hull bound is taken; its gap falls with the square of their number."""
NAMES = ("speed", "acceleration", "jerk", "tilt", "roll and pitch rate", "yaw rate", "rotor speed", "slowest rotor")
"""The checks of this module, in order; that of jerk only where there is a limit."""
_UNITS = ("m/s", "m/s2", "m/s3", "rad", "rad/s", "rad/s", "rad/s", "rad/s")
PROVED = 3
"""The first so many are polynomials; the others are interpolated by some."""
_LONGEST_STEPS, _SHORTEST_STEPS = 50, 0.25
"""Length of the pieces to begin with, and from which on they are halved no more, in units of the sampling step.
Where drag changes sign a rotor's speed jumps: over pieces of 10 ms bounds lie up to 3 % beyond it, and the optimiser
avoids what is no excess. With pieces of 2 ms a path through a maze is refused .7 times, not 2.2 times."""
_SETTLED = 0.003
"""Share of a limit that a bound may lie above the values it bounds."""
_SLOWEST = NAMES.index("slowest rotor")
_POWERS = (1, 2, 3, 2, 3, 1, 2, 2)
"""With which power of the time the use of each limit falls: speed and yaw rate with the time, acceleration and what
follows from it with its square, jerk and rates of the thrust's direction with its cube."""
_GROUP = 100
"""Segments that are looked at together: more would make cancelling slow, fewer the check."""
_DOUBT = 5.0
"""Error over the sum of the last four coefficients: at most this where a force has a kink (drag changes sign); the
excess seen beyond it was 0.1 % of a rotor's speed."""
_PARTS = 4
"""Parts of a piece in which the hull bound is taken."""
_BINDING = 0.97
"""Share of a limit from which on it counts as what decides the time of a segment."""


@dataclass(frozen=True, slots=True)
class Check:
    """One check of the gate and its result."""

    name: str
    value: float
    bound: float
    unit: str
    passed: bool
    time_s: float | None = None
    """When on the trajectory the value occurs, if it belongs to an instant."""
    segment: int | None = None
    reason: str = ""
    """Method by which the value was found, or why there is none."""

    @property
    def ratio(self) -> float:
        """Value over bound, for checks whose value must stay below it."""
        return self.value / self.bound

    def as_dict(self) -> dict[str, object]:
        """JSON-able: what is not finite is None."""
        return {k: None if isinstance(v, float) and not np.isfinite(v) else v for k, v in asdict(self).items()}


@dataclass(frozen=True, slots=True, eq=False)
class Usage:
    """The worst value of each limited quantity in each segment: arrays (limits, segments) in the order of `NAMES`."""

    value: FloatArray
    """What lies between samples allowed for; NaN where the vehicle cannot fly the motion at all."""
    time_s: FloatArray
    """When it occurs."""
    share: FloatArray
    """Of the limit that it uses; from hover to the limit for rotors."""
    bound: FloatArray
    """(limits,); of jerk infinite where there is no limit."""

    @property
    def limited(self) -> np.ndarray:
        """(limits,) bool: all but jerk where it has no limit."""
        return np.isfinite(self.bound)

    @property
    def passed(self) -> np.ndarray:
        """(limits, segments) bool."""
        bound = self.bound[:, None]
        lowest = (np.arange(len(NAMES)) == _SLOWEST)[:, None]
        return np.where(lowest, self.value >= bound, self.value <= bound)

    @property
    def binding(self) -> tuple[str, ...]:
        """The limit that decides each segment's time; empty where none is used to the full."""
        most = np.nanargmax(np.where(np.isfinite(self.share), self.share, np.inf), axis=0)
        used = self.share[most, np.arange(len(most))]
        return tuple(NAMES[i] if not share < _BINDING else "" for i, share in zip(most, used, strict=True))

    def worst(self, limit: int) -> int:
        """The segment with the worst value of one limit."""
        value = self.value[limit] if limit != _SLOWEST else -self.value[limit]
        return int(np.argmax(np.where(np.isfinite(value), value, np.inf)))


@dataclass(frozen=True, slots=True, eq=False)
class Known:
    """What was found before of the same vehicle within the same limits: it holds for segments equal bit by bit."""

    usage: tuple[Trajectory, Usage] | None = None
    """Another trajectory and what was found of it."""
    memory: attitude.Memory | None = None
    """What only its forces were asked for."""


def check(
    trajectory: Trajectory, vehicle: Vehicle, limits: Limits | None = None, *, step_s: float = 0.005
) -> list[Check]:
    """Every limit with the worst value over the whole trajectory; never raises for a trajectory that fails."""
    return measure(trajectory, vehicle, vehicle.limits if limits is None else limits, step_s=step_s)[1]


def measure(
    trajectory: Trajectory,
    vehicle: Vehicle,
    limits: Limits,
    *,
    step_s: float,
    known: Known | None = None,
    stop: StopFlag | None = None,
) -> tuple[Usage | None, list[Check]]:
    """As `check`, and the usage of each segment; None where the vehicle's model has no answer.

    Raises:
        PlanCancelledError: `stop` was set.
    """
    try:
        used = usage(trajectory, vehicle, limits, step_s=step_s, known=known, stop=stop)
    except PlanCancelledError:
        raise
    except FlightError as error:
        rows = [row for row in zip(NAMES, bounds_of(limits).tolist(), _UNITS, strict=True) if np.isfinite(row[1])]
        return None, [Check(name, np.nan, bound, unit, False, reason=str(error)) for name, bound, unit in rows]
    return used, [_verdict(used, int(i), trajectory) for i in np.flatnonzero(used.limited)]


def _verdict(used: Usage, limit: int, trajectory: Trajectory) -> Check:
    segment = used.worst(limit)
    value, time_s, bound = float(used.value[limit, segment]), float(used.time_s[limit, segment]), used.bound[limit]
    passed = bool(used.passed[limit, segment])
    if passed:
        reason = "proved between samples" if limit < PROVED else "interpolated, with an allowance for what that misses"
    else:
        reason = excess_text(used, limit, segment, trajectory)
    return Check(NAMES[limit], value, float(bound), _UNITS[limit], passed, time_s, segment, reason)


def excess_text(used: Usage, limit: int, segment: int, trajectory: Trajectory) -> str:
    """Where a limit is exceeded, by what, and how long the segment should take instead."""
    value, time_s = used.value[limit, segment], used.time_s[limit, segment]
    T = float(trajectory.durations_s[segment])
    where = f"segment {segment} at {time_s:.1f} s"
    if not np.isfinite(value):
        return f"{where}: no rotor speeds produce this motion; give it more than {1.5 * T:.2f} s"
    longer = T * float(time_factor(np.maximum(used.share[:, segment], 1.0))[limit])
    unit = _UNITS[limit]
    return f"{where}: {NAMES[limit]} {value:.4g} {unit}, limit {used.bound[limit]:.4g}; give it {longer:.2f} s"


def usage(
    trajectory: Trajectory,
    vehicle: Vehicle,
    limits: Limits,
    *,
    step_s: float,
    known: Known | None = None,
    stop: StopFlag | None = None,
) -> Usage:
    """How much of each limit each segment uses.

    Args:
        known: segments that come again are not looked at again.

    Raises:
        FlightError: the vehicle's model has no answer.
        PlanCancelledError: `stop` was set.
    """
    k, starts = len(trajectory.durations_s), trajectory.starts_s[:-1]
    value, after_s, new = np.empty((len(NAMES), k)), np.empty((len(NAMES), k)), np.ones(k, dtype=bool)
    known = Known() if known is None else known
    if known.usage is not None:
        path, used = known.usage
        where = {key: i for i, key in enumerate(attitude.segment_keys(path, np.arange(len(path.durations_s))))}
        same = np.array([where.get(key, -1) for key in attitude.segment_keys(trajectory, np.arange(k))])
        new = same < 0
        value[:, ~new] = used.value[:, same[~new]]
        after_s[:, ~new] = used.time_s[:, same[~new]] - path.starts_s[same[~new]]
    chosen = np.flatnonzero(new)
    for group in np.split(chosen, range(_GROUP, len(chosen), _GROUP)) if len(chosen) else []:
        check_stop(stop)
        some = Trajectory(trajectory.durations_s[group], trajectory.coefficients[group])
        found, time_s = _attitude_bounds(some, vehicle, limits, step_s, known.memory or attitude.Memory())
        found[_SLOWEST] *= -1.0
        for derivative in range(1, PROVED + 1):
            found[derivative - 1], time_s[derivative - 1] = certified_maxima(some, derivative)
        value[:, group], after_s[:, group] = found, time_s - some.starts_s[:-1]
    return Usage(value, starts + after_s, shares_used(value, limits, mean_hover_rad_s(vehicle)), bounds_of(limits))


def _attitude_bounds(
    trajectory: Trajectory, vehicle: Vehicle, limits: Limits, step_s: float, memory: attitude.Memory
) -> tuple[FloatArray, FloatArray]:
    """Bounds (limits, segments) of tilt, rates and rotor speeds, and when; those of the slowest rotor are negative.

    NaN where no rotor speeds give the motion. The first rows, speed, acceleration and jerk, are left open.
    """
    k, hover = len(trajectory.durations_s), mean_hover_rad_s(vehicle)
    bound, time_s = np.full((len(NAMES), k), -np.inf), np.zeros((len(NAMES), k))
    pieces, coefficients = memory.coefficients(vehicle, trajectory, np.arange(k), _LONGEST_STEPS * step_s)
    while True:
        found, fraction, seen = _piece_bounds(coefficients)
        signs = np.where(np.arange(len(NAMES)) == _SLOWEST, -1.0, 1.0)[:, None]
        share, seen_share = (shares_used(signs * x, limits, hover) for x in (found, seen))
        with np.errstate(invalid="ignore"):  # infinite where the motion is impossible
            near = ~(share < _BINDING) & ~(share - seen_share < _SETTLED)
        halved = near.any(axis=0) & (pieces.length_s > _SHORTEST_STEPS * step_s)
        _keep_largest(bound, time_s, found, _times(trajectory, pieces, fraction), pieces.segment, ~halved)
        if not halved.any():
            break
        pieces = _halves(pieces, halved)
        coefficients = attitude.coefficients(vehicle, trajectory, pieces)
    return np.where(bound == np.inf, np.nan, bound), time_s


def _halves(pieces: attitude.Pieces, chosen: np.ndarray) -> attitude.Pieces:
    """Both halves of each chosen piece (p,) bool."""
    start, half = pieces.start_s[chosen], 0.5 * pieces.length_s[chosen]
    starts = np.stack([start, start + half], axis=1).ravel()
    return attitude.Pieces(np.repeat(pieces.segment[chosen], 2), starts, np.repeat(half, 2))


def _times(trajectory: Trajectory, pieces: attitude.Pieces, fraction: FloatArray) -> FloatArray:
    return trajectory.starts_s[pieces.segment] + pieces.start_s + fraction * pieces.length_s


def _piece_bounds(coefficients: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Bound over each piece, at which fraction of it, and the largest of its control points alone: (limits, p) each.

    Infinite where the vehicle cannot fly the motion; of the slowest rotor the negative.
    """
    points, fractions = hull(coefficients), _hull_fractions()
    beyond, inside = allowance(coefficients)[:, None], _at_nodes(coefficients)

    def quantities(values: FloatArray, more: FloatArray | float) -> FloatArray:
        shown = np.zeros((len(NAMES), *values.shape[:2]))
        more = np.broadcast_to(more, (len(values), 1, values.shape[-1]))
        rate, rotor = np.abs(values[..., attitude.RATE]) + more[..., attitude.RATE], values[..., attitude.ROTOR]
        up = values[..., attitude.UP] - more[..., attitude.UP]
        shown[3] = portable.arccosine(np.clip(up, -1.0, 1.0))
        shown[4], shown[5] = portable.length(rate[..., :2]), rate[..., 2]
        shown[6] = (rotor + more[..., attitude.ROTOR]).max(axis=-1)
        shown[7] = -(rotor - more[..., attitude.ROTOR]).min(axis=-1)
        return np.where(np.isnan(shown), np.inf, shown)

    bounds = quantities(points, beyond)
    worst = bounds.argmax(axis=2)
    return bounds.max(axis=2), fractions[worst], quantities(inside, 0.0).max(axis=2)


def hull(coefficients: FloatArray) -> FloatArray:
    """(p, m, values) control points: over each piece the values stay within their convex hull."""
    return np.einsum("mk,pkv->pmv", _control_points(), coefficients)


def _hull_fractions() -> FloatArray:
    """(m,) near which fraction of its piece each control point belongs."""
    inside = np.arange(attitude.NODES) / (attitude.NODES - 1)
    return ((np.arange(_PARTS)[:, None] + inside) / _PARTS).ravel()


def _at_nodes(coefficients: FloatArray) -> FloatArray:
    """(p, NODES, values) values spread evenly over each piece, its ends among them."""
    return np.einsum(
        "nk,pkv->pnv",
        chebyshev.chebvander(np.linspace(-1.0, 1.0, attitude.NODES) / attitude.REACH, attitude.NODES - 1),
        coefficients,
    )


def allowance(coefficients: FloatArray) -> FloatArray:
    """(p, values) by how much the values may miss what they stand for."""
    return _DOUBT * np.abs(coefficients[:, -4:]).sum(axis=1)


@cache
def _control_points() -> FloatArray:
    """(parts * NODES, NODES): Bernstein control points of each part of a piece from the coefficients."""
    ascending = np.zeros((attitude.NODES, attitude.NODES))
    for k in range(attitude.NODES):
        ascending[k, : k + 1] = chebyshev.cheb2poly(np.eye(attitude.NODES)[k])[: k + 1]
    rows = []
    for part in range(_PARTS):
        start, length = 2.0 * part / _PARTS - 1.0, 2.0 / _PARTS
        shifted = polynomial.shift_argument(
            polynomial.scale_argument(ascending, 1.0 / attitude.REACH), np.full(attitude.NODES, start)
        )
        rows.append(polynomial.bernstein_from_seconds(shifted, np.full(attitude.NODES, length)).T)
    return np.concatenate(rows)


def _keep_largest(
    bound: FloatArray,
    time_s: FloatArray,
    found: FloatArray,
    found_time_s: FloatArray,
    segment: np.ndarray,
    chosen: np.ndarray,
) -> None:
    """Enter the chosen pieces' bounds into those of their segments, where they are larger, with their times."""
    for row in range(PROVED, len(NAMES)):
        order = np.flatnonzero(chosen)
        order = order[np.argsort(found[row, order], kind="stable")]  # the largest is written last
        larger = order[found[row, order] > bound[row, segment[order]]]
        bound[row, segment[larger]], time_s[row, segment[larger]] = found[row, larger], found_time_s[row, larger]


def certified_maxima(trajectory: Trajectory, derivative: int) -> tuple[FloatArray, FloatArray]:
    """Upper bound (k,) of the norm of a derivative of position in each segment, and near which time.

    The norm of a point of the hull is at most that of its farthest corner, the control points of a short piece.
    """
    T = trajectory.durations_s
    c = polynomial.differentiate(trajectory.coefficients[:, :3], derivative)
    starts = (np.arange(_PIECES) / _PIECES)[None, :, None] * T[:, None, None]
    pieces = polynomial.shift_argument(
        np.repeat(c[:, None], _PIECES, axis=1), np.broadcast_to(starts, (*c.shape[:1], _PIECES, 3))
    )
    lengths = np.broadcast_to((T / _PIECES)[:, None, None], pieces.shape[:3])
    norms = np.linalg.norm(polynomial.bernstein_from_seconds(pieces, lengths), axis=2).max(axis=2)
    piece = np.argmax(norms, axis=1)
    return norms.max(axis=1), trajectory.starts_s[:-1] + T * (piece + 0.5) / _PIECES


def bounds_of(limits: Limits) -> FloatArray:
    return np.array(
        [
            limits.speed_m_s,
            limits.acceleration_m_s2,
            limits.largest_jerk_m_s3,
            limits.tilt_rad,
            limits.rate_rad_s,
            limits.yaw_rate_rad_s,
            limits.rotor_speed_max_rad_s,
            limits.rotor_speed_min_rad_s,
        ]
    )


def mean_hover_rad_s(vehicle: Vehicle) -> float:
    return float(invert.hover(vehicle).mean())


def shares_used(value: FloatArray, limits: Limits, hover_rad_s: float) -> FloatArray:
    """Shares of the limits that values (limits, n) use; never negative."""
    base = np.array([0.0] * (_SLOWEST - 1) + [hover_rad_s] * 2)[:, None]
    room = bounds_of(limits)[:, None] - base
    room = np.where(np.abs(room) > 1e-9, room, np.array([1e-9] * _SLOWEST + [-1e-9])[:, None])
    return np.maximum((value - base) / room, 0.0)


def time_factor(share: FloatArray) -> FloatArray:
    """Factor on the time at which each limit (limits, ...), used to such a share, is just met."""
    roots = {1: share, 2: np.sqrt(share), 3: portable.exponential(portable.logarithm(share) / 3.0)}
    return np.stack([roots[power][row] for row, power in enumerate(_POWERS)])
