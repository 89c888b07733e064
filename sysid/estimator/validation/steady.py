"""What the measured disturbance says of weight, wind, drag and centre of mass: what lasts, apart from what follows.

The observer measures, in world axes and over the flight (means of half a second),

    force = s F(v - w) - F_flown(v) - c v + R b

with the force F of the model at the rotors' speeds, the wind w, constant in the world, drag c that follows velocity,
b that is fixed in the body (a tilted thrust axis), and s = mass of the file over the true one. Weaker rotors make s as
small as a heavier body does. The torque that goes with thrust is an offset of the centre of mass: r x F.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from flight import FlightLog, rotations
from flight.rotations import FloatArray
from sysid.estimator.flights.sampling import means_over
from sysid.estimator.trajectory.model import surroundings
from sysid.estimator.validation.observed import Observed, observed
from vehicle import Vehicle, rigid_body, wrench

BLOCK_S = 0.5
SHORTEST_S = 3.0
"""With less of the observer's time nothing is said."""
MOST_CORRELATED = 0.8
"""Neighbouring means: gusts of 2 s."""
SETTLES_S = 0.5
"""After lift-off, until its low-passes have settled."""
TURNED_M_S = 0.3
"""Where headings differ enough that wind is known to this beside a force fixed in the body, that is fitted too."""
LEAST_DRAG = 0.002
"""Of the weight, for each m/s of wind: a model with less of it turns no force into wind."""
LEAST_DRAG_OF_GUSTS = 0.01
"""The same for gusts: what is left holds all errors of the model too, which little drag makes storms of."""
SIGMA90 = 1.645
SIGMAS = 3.0
SEEN_WEIGHT, SEEN_WIND_M_S, SEEN_OFFSET_M = 0.02, 0.3, 0.001
"""Less than this is not worth a change of the file."""


@dataclass(frozen=True, slots=True)
class Known:
    """A value with its standard error, by the scatter of half-second means and how it lasts."""

    value: float
    std: float

    @property
    def interval90(self) -> tuple[float, float]:
        return self.value - SIGMA90 * self.std, self.value + SIGMA90 * self.std

    def shows(self, least: float) -> bool:
        """Whether it is that large at least, and not by chance."""
        return abs(self.value) >= max(least, SIGMAS * self.std)


@dataclass(frozen=True, slots=True)
class Steady:
    """What lasted on one flight."""

    weight: Known
    """True weight over the model's, or the model's thrust over the true one."""
    wind_m_s: tuple[Known, Known] | None
    """Along world x and y; None where the model has no drag to tell it by, or a constant force fits better."""
    force_n: tuple[Known, Known]
    """Lasting horizontal force in world axes, beside what follows velocity."""
    drag_n_s_m: Known
    """Drag beside the model's that follows velocity."""
    level_m_s: float
    """Root mean square of the level speed, by which that drag shows."""
    offset_m: tuple[Known, Known]
    """Centre of mass beside the model's, along body x and y."""
    turned: bool
    """Whether the heading changed so much that a tilted thrust axis was fitted too."""
    gust_m_s: float | None = None
    """Root mean square of the air's level velocity about its mean, each axis, if all that is left is the air's;
    some tenths off in a flight of a minute. None where the model has too little drag to tell it by."""


@dataclass(frozen=True, slots=True)
class _Motion:
    """Of the rows where the observer ran, and their block means."""

    log: FlightLog
    found: Observed
    q: FloatArray
    velocity_world_m_s: FloatArray

    def mean(self, values: FloatArray) -> FloatArray:
        bins = means_over(np.concatenate([values, np.ones((len(values), 1))], axis=1), self.found.time_s, BLOCK_S)
        return bins[bins[:, -1] > 0.0, :-1]

    def force_world_n(self, model: Vehicle, wind_m_s: FloatArray) -> FloatArray:
        """(k, 3) force of air and rotors by the model in this wind."""
        rows = self.found.rows
        air = self.velocity_world_m_s - [*wind_m_s, 0.0]
        back = rotations.conjugate(self.q)
        still = np.zeros((len(self.q), model.rotors))
        around = surroundings(self.log.vector("position_world_m")[rows], self.q, still)
        rate, speed = self.log.vector("rate_body_rad_s")[rows], self.log.vector("rotor_speed_rad_s")[rows]
        force, _ = wrench(model, rotations.rotate(back, air), rate, speed, around)
        return rotations.rotate(self.q, force)


NEEDS = ("position_world_m", "velocity_world_m_s", "q_world_body", "rate_body_rad_s", "rotor_speed_rad_s")


def steady(log: FlightLog, model: Vehicle, flown: Vehicle) -> Steady | None:
    """What lasted on a flight; None where the observer did not run for long, or the motion was not recorded.

    Args:
        model: of the vehicle.
        flown: what of it the vehicle's controller knows, whose forces the observer has taken off.
    """
    motion = _motion(log)
    if motion is None:
        return None
    left = motion.found.force_world_n + motion.force_world_n(flown, np.zeros(2))

    def each(p: FloatArray, fixed: bool, constant: bool) -> FloatArray:
        """(k, 3) what a set of unknowns leaves: s, wind or force x y, drag, body force x y."""
        wind, push = (np.zeros(2), p[1:3]) if constant else (p[1:3], np.zeros(2))
        tilt = np.append(p[4:6] if fixed else np.zeros(2), 0.0)
        explained = p[0] * motion.force_world_n(model, wind) + [*push, 0.0]
        explained = explained - p[3] * motion.velocity_world_m_s * [1.0, 1.0, 0.0]
        return left - explained - rotations.rotate(motion.q, np.tile(tilt, (len(motion.q), 1)))

    def residual(p: FloatArray, fixed: bool, constant: bool) -> FloatArray:
        """Its blocks by axes."""
        return motion.mean(each(p, fixed, constant))

    force = _Fit.of(lambda p: residual(p, False, True), np.array([1.0, 0.0, 0.0, 0.0]))
    away = force.at[1:3] / max(float(np.hypot(*force.at[1:3])), 1e-9)
    with_tilt = _Fit.of(lambda p: residual(p, True, False), np.array([1.0, *away, 0.0, 0.0, 0.0]))
    turned = bool(max(with_tilt.std[1:3]) < TURNED_M_S)
    wind = with_tilt if turned else _Fit.of(lambda p: residual(p, False, False), np.array([1.0, *away, 0.0]))
    weight_n = rigid_body(model).mass_kg * model.gravity_m_s2
    drag_n_s_m = _drag_per_m_s(motion, model, away)
    drags = drag_n_s_m > LEAST_DRAG * weight_n
    told = drag_n_s_m > LEAST_DRAG_OF_GUSTS * weight_n
    shown = drags and _as_good(wind, force)
    best = wind if shown else force
    gusts_n = each(best.at, shown and turned, not shown)
    return Steady(
        weight=Known(1.0 / float(best.at[0]), float(best.std[0] / best.at[0] ** 2)),
        wind_m_s=(wind.known(1), wind.known(2)) if shown else None,
        force_n=(force.known(1), force.known(2)),
        drag_n_s_m=best.known(3),
        level_m_s=float(np.sqrt((motion.velocity_world_m_s[:, :2] ** 2).sum(axis=1).mean())),
        offset_m=_offsets(motion, flown),
        turned=turned,
        gust_m_s=_level_n(motion, gusts_n) / (drag_n_s_m + max(float(best.at[3]), 0.0)) if told else None,
    )


def _level_n(motion: _Motion, left_n: FloatArray) -> float:
    """Root mean square, each level axis, of forces (k, 3) beyond the sensors' noise."""
    noise = np.nan_to_num(motion.found.force_std_n) ** 2
    return float(np.sqrt(max(float((left_n[:, :2] ** 2).mean() - noise.mean()), 0.0)))


def _motion(log: FlightLog) -> _Motion | None:
    if not all(log.has(name) for name in NEEDS):
        return None
    found = observed(log)
    if found is None:
        return None
    known = np.isfinite(np.concatenate([log.vector(name) for name in NEEDS], axis=1)).all(axis=1)
    rows = found.rows & known & (log.time_s > found.time_s[0] + SETTLES_S)
    if not rows.any() or rows.sum() * float(np.median(np.diff(log.time_s))) < SHORTEST_S:
        return None
    columns = {**log.columns, "observer_state": np.where(rows, log.columns["observer_state"], np.nan)}
    found = observed(FlightLog(columns, log.metadata))
    assert found is not None
    return _Motion(log, found, log.vector("q_world_body")[rows], log.vector("velocity_world_m_s")[rows])


def _drag_per_m_s(motion: _Motion, model: Vehicle, away: FloatArray) -> float:
    """By how much the model's mean force across the rotors' axis grows along the wind, between 1 and 2 m/s of it."""
    grown = motion.force_world_n(model, 2.0 * away) - motion.force_world_n(model, away)
    across = rotations.rotate(rotations.conjugate(motion.q), grown) * [1.0, 1.0, 0.0]
    return float((rotations.rotate(motion.q, across)[:, :2] @ away).mean())


def _as_good(wind: "_Fit", force: "_Fit") -> bool:
    """Whether wind explains the disturbance as a constant force does, or better."""
    return wind.cost <= 1.1 * force.cost


def _offsets(motion: _Motion, flown: Vehicle) -> tuple[Known, Known]:
    """Centre of mass beside the model's, from the torque that goes with thrust."""
    back = rotations.conjugate(motion.q)
    thrust = rotations.rotate(back, motion.force_world_n(flown, np.zeros(2)))[:, 2]
    both = motion.mean(np.column_stack([motion.found.wrench_body[:, 3:5], thrust]))
    about_y = _Fit.of(lambda p: (both[:, 1] - p[0] * both[:, 2])[:, None], np.zeros(1))
    about_x = _Fit.of(lambda p: (both[:, 0] + p[0] * both[:, 2])[:, None], np.zeros(1))
    return about_y.known(0), about_x.known(0)


@dataclass(frozen=True, slots=True)
class _Fit:
    """Least squares."""

    at: FloatArray
    std: FloatArray
    cost: float
    """Mean square of what is left, N2."""

    @staticmethod
    def of(residual: Callable[[FloatArray], FloatArray], start: FloatArray) -> "_Fit":
        """Gauss-Newton with differences; what the flight does not show stays where it was, of unknown error."""
        at, steps = start.astype(np.float64), 6
        slopes = np.zeros((1, len(at)))
        for _ in range(steps):
            left = residual(at)
            moved = [residual(at + step) - left for step in 1e-4 * np.eye(len(at))]
            slopes = np.stack([column.ravel() for column in moved], axis=1) / 1e-4
            at = at - np.linalg.lstsq(slopes, left.ravel(), rcond=1e-8)[0]
        left = residual(at)
        information = slopes.T @ slopes
        shown = np.diag(information) > 1e-9 * max(float(np.diag(information).max()), 1e-30)
        inverse = np.linalg.pinv(information[np.ix_(shown, shown)], rcond=1e-12, hermitian=True)
        scatter = _scatter(slopes[:, shown].reshape(*left.shape, -1), left)
        std = np.full(len(at), np.inf)
        std[shown] = np.sqrt(np.diag(inverse @ scatter @ inverse).clip(0.0))
        return _Fit(at, std, float((left**2).mean()))

    def known(self, i: int) -> Known:
        return Known(float(self.at[i]), float(self.std[i]))


def _scatter(slopes: FloatArray, left: FloatArray) -> FloatArray:
    """(p, p) covariance of the gradient where each axis of what is left is a first-order Gauss-Markov process.

    Args:
        slopes: (blocks, axes, p).
        left: (blocks, axes).
    """
    blocks, axes, p = slopes.shape
    apart = np.abs(np.subtract.outer(np.arange(blocks), np.arange(blocks)))
    found = np.zeros((p, p))
    for axis in range(axes):
        rows, one = slopes[:, axis], left[:, axis]
        power = float(one @ one)
        r = float(one[1:] @ one[:-1]) / power if power > 0.0 else 0.0
        r = min(max(r + (1.0 + 4.0 * r) / blocks, 0.0), MOST_CORRELATED)  # a short series shows less than there is
        found += power / max(blocks - p, 1) * rows.T @ r**apart @ rows
    return found
