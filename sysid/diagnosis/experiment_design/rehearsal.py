"""A manoeuvre made to fit a room and a vehicle, flown in simulation, and said in waypoints."""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from flight import FlightLog, FloatArray, InfeasibleError, InputError, Trajectory, Waypoints, rotations
from flight.flight_log import COLUMNS
from sysid.estimator.blocks.catalogue import reported
from sysid.estimator.flights.flight_data import Flight
from sysid.estimator.options import Options
from sysid.estimator.prepare import prepare_all
from sysid.estimator.result import Identification
from sysid.estimator.trajectory.states import States
from sysid.logs.checks import contact
from vehicle import Vehicle, flatness, flights, manoeuvres

LEAST_FLOOR_M = 0.5
"""Height of the free volume's floor above the ground, when nothing is said: clear of the ground's effect."""
LARGEST_M = 1000.0
"""A longer side of the free volume is in another unit."""
STRAY_M = 0.1
"""Kept free inside the volume's walls, for the controller's errors."""
RESERVE = 0.92
"""Share of each limit that a manoeuvre may use; the rest is the controller's."""
SLOWEST = 4.0
"""Manoeuvres that would have to be flown this many times as slowly as designed excite nothing any more."""
SLOWER = 1.08
"""Step of the search for the fastest time within the limits."""
LEAST_SCALE = 0.04
"""A manoeuvre shrunk further than this is none."""
CHORD_M, CHORD_RAD = 0.05, 0.15
"""How far a manoeuvre may bend away from the lines between its waypoints, in place and in heading."""
APART_M = 0.02
"""Waypoints nearer to each other than this are one."""


@dataclass(frozen=True, slots=True)
class Room:
    """A box in which the vehicle's centre may move."""

    low_world_m: FloatArray
    high_world_m: FloatArray

    @staticmethod
    def of(size_m: tuple[float, float, float], corner_world_m: tuple[float, float, float] | None = None) -> "Room":
        """From its size, and its lowest corner; without one it stands round the origin, clear of the ground.

        Raises:
            InputError: a side is not positive or leaves no room for the controller's errors.
        """
        size = np.asarray(size_m, dtype=np.float64)
        if size.shape != (3,) or not np.isfinite(size).all() or (size <= 2.0 * STRAY_M).any():
            raise InputError(f"a free volume of {size.tolist()} m leaves no room; every side must exceed 0.2 m")
        if (size > LARGEST_M).any():
            raise InputError(f"a free volume of {size.tolist()} m: every side must be at most {LARGEST_M:g} m")
        default = (-0.5 * size[0], -0.5 * size[1], LEAST_FLOOR_M)
        low = np.asarray(default if corner_world_m is None else corner_world_m, dtype=np.float64)
        return Room(low, low + size)


@dataclass(frozen=True, slots=True, eq=False)
class Rehearsal:
    """A simulated flight as the estimator would see it, with its true states."""

    flight: Flight
    states: States


def fitted_into(trajectory: Trajectory, room: Room, vehicle: Vehicle) -> Trajectory:
    """The manoeuvre in the middle of the room, as large and then as fast as room and vehicle allow.

    It is never larger than designed, and never harder: shrunk to a tenth, it may be flown in a third of the time.

    Raises:
        InfeasibleError: it does not fit, or only so slowly or so small that it would show nothing.
    """
    path = trajectory.position(trajectory.sample(0.02))
    start, low, high = path[0], path.min(axis=0), path.max(axis=0)
    free_low, free_high = room.low_world_m + STRAY_M, room.high_world_m - STRAY_M
    near_ground = flies_near_ground(trajectory)  # then it keeps its height
    if near_ground and free_low[2] > low[2]:
        raise InfeasibleError(f"it goes down to {low[2]:.2f} m above the ground, and the free volume does not")
    extent = np.where(high - low > 1e-6, high - low, 1e-6)
    scale = float(min(1.0, ((free_high - free_low) / extent).min()))
    if near_ground and scale < 1.0:
        raise InfeasibleError("the free volume is too small for it, and near the ground it must keep its size")
    if scale < LEAST_SCALE:
        raise InfeasibleError(f"it would have to shrink to {scale:.1%} of its size")
    middle = 0.5 * (free_low + free_high)
    moved = middle - (start + scale * (0.5 * (low + high) - start))
    moved[2] = 0.0 if near_ground else moved[2]
    shrunk = shrink(trajectory, scale, vehicle)
    coefficients = shrunk.coefficients.copy()
    coefficients[:, :3, 0] += moved
    return Trajectory(shrunk.durations_s, coefficients)


def shrink(trajectory: Trajectory, scale: float, vehicle: Vehicle) -> Trajectory:
    """A manoeuvre with positions from its start scaled, and then as fast as the vehicle allows, with some reserve.

    Raises:
        InfeasibleError: it would have to be flown so slowly that it would show nothing.
    """
    smaller = manoeuvres.scaled(trajectory, scale)
    return _as_fast_as_allowed(smaller, float(np.sqrt(scale)), vehicle)


def flies_near_ground(trajectory: Trajectory) -> bool:
    """Whether what a manoeuvre is to show depends on its height above the ground."""
    return bool(trajectory.position(trajectory.sample(0.02))[:, 2].min() < LEAST_FLOOR_M - 1e-9)


def _as_fast_as_allowed(trajectory: Trajectory, fastest: float, vehicle: Vehicle) -> Trajectory:
    factor = fastest
    while factor < SLOWEST:
        slower = trajectory.scale_time(factor)
        exceeded = _most_exceeded(slower, vehicle)
        if exceeded is None:
            return slower
        factor *= SLOWER
    raise InfeasibleError(f"the vehicle's {exceeded} does not allow it, nor {SLOWEST:g} times as slowly")


def _most_exceeded(trajectory: Trajectory, vehicle: Vehicle) -> str | None:
    """Name of the limit that is exceeded most, if one is."""
    limits, times = vehicle.limits, trajectory.sample(0.01)
    flat = flatness.state(vehicle, trajectory, times)
    tilt = np.arccos(np.clip(rotations.rotate(flat.q_world_body, np.array([0.0, 0.0, 1.0]))[:, 2], -1.0, 1.0))
    speed = np.nan_to_num(flat.rotor_speed_rad_s, nan=np.inf)
    middle = 0.5 * (limits.rotor_speed_max_rad_s + limits.rotor_speed_min_rad_s)
    shares = {
        "speed limit": np.linalg.norm(trajectory.position(times, 1), axis=1).max() / limits.speed_m_s,
        "acceleration limit": np.linalg.norm(trajectory.position(times, 2), axis=1).max() / limits.acceleration_m_s2,
        "tilt limit": tilt.max() / limits.tilt_rad,
        "roll and pitch rate limit": np.abs(flat.rate_body_rad_s[:, :2]).max() / limits.rate_rad_s,
        "yaw rate limit": np.abs(flat.rate_body_rad_s[:, 2]).max() / limits.yaw_rate_rad_s,
        "range of rotor speed": np.abs(speed - middle).max() / (limits.rotor_speed_max_rad_s - middle),
    }
    worst = max(shares, key=lambda name: float(shares[name]))
    return worst if shares[worst] > RESERVE else None


def rehearse(
    fit: Identification,
    trajectory: Trajectory,
    room: Room,
    node_rate_hz: float,
    rng: np.random.Generator,
    *,
    ground_m: float = 0.0,
) -> Rehearsal:
    """Fly it with the fitted vehicle in still air; what the log lacks, the flights so far lacked too.

    `ground_m` is the height (world z) of the ground, minus infinity for none.

    Raises:
        InfeasibleError: the vehicle cannot follow, leaves the room, or touches the ground.
    """
    if trajectory.position(np.zeros(1))[0, 2] < ground_m:
        raise InfeasibleError("the flight would begin below the ground")
    truth = flights.fly_trajectory(fit.vehicle, trajectory, rng=rng, ground_m=ground_m)
    place = truth.rows[:, 0, :3]
    if not np.isfinite(place).all() or ((place < room.low_world_m) | (place > room.high_world_m)).any():
        raise InfeasibleError("the simulated vehicle leaves the free volume")
    levels = reported(fit.noise)
    noise = flights.Noise(levels["position_m"], levels["attitude_rad"], 0.0, levels["rate_rad_s"], levels["force_m_s2"])
    log = _as_before(flights.measure(truth, noise=noise, rng=rng), fit.flights[0])
    options = Options(
        node_rate_hz=node_rate_hz,
        use_rates=any(f.has_gyro for f in fit.flights),
        use_accelerometer=any(f.has_accelerometer for f in fit.flights),
    )
    if contact.spans(log):
        raise InfeasibleError("the simulated vehicle touches the ground")
    (flight,) = prepare_all([log], options, [fit.vehicle])
    at = np.searchsorted(truth.time_s, flight.time_s - 1e-9)
    rows = truth.rows[at, 0]
    states = States(rows[:, 0:3], rows[:, 3:6], rows[:, 6:10], rows[:, 10:13])
    return Rehearsal(flight, states if fit.noise.gusts is None else states.with_gust())


def _as_before(log: FlightLog, example: Flight) -> FlightLog:
    """The log without what the flights so far did not measure either."""
    unmeasured = []
    if example.driven_by_command:
        unmeasured.append("rotor_speed_rad_s")
    if not example.has_pose:
        unmeasured += ["position_world_m", "q_world_body"]
    gone = {column for quantity in unmeasured for column in COLUMNS[quantity]}
    return FlightLog({name: values for name, values in log.columns.items() if name not in gone}, log.metadata)


def waypoints_of(trajectory: Trajectory, name: str) -> Waypoints:
    """Ends and turns of a trajectory, and what lies between where it bends.

    Raises:
        InputError: it stays in one place.
    """
    knots = np.concatenate([[0.0], np.cumsum(trajectory.durations_s)])
    times = np.concatenate([_bends(trajectory, a, b) for a, b in pairwise(knots.tolist())] + [knots[-1:]])
    points = trajectory.evaluate(times)
    kept = [0]
    for i in range(1, len(points)):
        if np.linalg.norm(points[i, :3] - points[kept[-1], :3]) > APART_M:
            kept.append(i)
    if len(kept) < 2:
        raise InputError(f"{name} stays in one place; hold that position, there is no way to plan")
    return Waypoints(points[kept, :3], points[kept, 3])


def _bends(trajectory: Trajectory, begin_s: float, end_s: float) -> list[float]:
    """Instants from `begin_s` (included) to `end_s` (not) between which the way is nearly straight."""
    times = np.linspace(begin_s, end_s, 9)
    points = trajectory.evaluate(times)
    chord = points[-1] - points[0]
    square = float(chord[:3] @ chord[:3])
    along = np.clip((points - points[0])[:, :3] @ chord[:3] / square, 0.0, 1.0) if square > 1e-6 else np.zeros(9)
    off = points - points[0] - along[:, None] * chord
    bent = np.linalg.norm(off[:, :3], axis=1).max() > CHORD_M or np.abs(off[:, 3]).max() > CHORD_RAD
    if not bent or end_s - begin_s < 0.1:
        return [begin_s]
    middle = 0.5 * (begin_s + end_s)
    return [*_bends(trajectory, begin_s, middle), *_bends(trajectory, middle, end_s)]
