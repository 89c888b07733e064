"""One flight made ready for the estimator: nodes in time, what was measured there, mean rotor speed in between."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline

from flight import FlightLog, InputError, rotations
from flight.rotations import FloatArray
from sysid.estimator import rotor_noise
from sysid.estimator.options import Options
from sysid.logs.payload import carries_payload

IndexArray = NDArray[np.intp]

GAP_FACTOR = 4.0
"""A pause is a gap when it lasts this many usual sample intervals ..."""
GAP_LEAST_S = 0.04
"""... and at least this long: single lost frames are harmless."""
LEAD_IN_S = 0.3
"""Where only commands are known, this much is given to the rotors to reach the speed that nobody measured."""
SLOWEST_S = 0.5
"""Samples further apart than this show no motion of a multirotor; the time is in another unit."""
SHORTEST_S = 1.0
"""Pieces between gaps that are shorter say nothing and are left out."""


@dataclass(frozen=True, slots=True, eq=False)
class Flight:
    """A stretch of one log without gaps. What was not measured is NaN."""

    name: str
    """For messages: the log's name and the piece of it."""
    log_index: int
    """Which of the logs handed in it came from; pieces of one log share the sensors' biases."""
    time_s: FloatArray
    """(n,) instants of the states."""
    position_world_m: FloatArray
    """(n, 3) measured by the pose sensor."""
    q_world_sensor: FloatArray
    """(n, 4) measured by the pose sensor, continuous in sign."""
    rate_body_rad_s: FloatArray
    """(n, 3) measured by the gyro."""
    specific_force_body_m_s2: FloatArray
    """(n - 1, 3) mean of the accelerometer over each interval."""
    rotor_speed_rad_s: FloatArray
    """(n - 1, 4) mean over each interval; found from the command where it was not measured."""
    rotor_acceleration_rad_s2: FloatArray
    """(n - 1, 4) mean over each interval."""
    rotor_command_rad_s: FloatArray
    """(n - 1, 4) mean over each interval; only used where rotor speed was not measured."""
    battery_v: FloatArray
    """(n - 1,) mean over each interval."""
    lead_in: "LeadIn | None" = None
    """What was commanded just before; only where rotor speed was not measured."""
    carries_payload: bool | None = None
    """Whether the vehicle's payload, if it has one, was on board; None where the log does not say: it was."""

    @property
    def step_s(self) -> FloatArray:
        """(n - 1,) lengths of the intervals."""
        return np.diff(self.time_s)

    @property
    def has_pose(self) -> bool:
        return bool(np.isfinite(self.position_world_m).any())

    @property
    def has_accelerometer(self) -> bool:
        return bool(np.isfinite(self.specific_force_body_m_s2).all())

    @property
    def driven_by_command(self) -> bool:
        """Whether rotor speed was not measured and comes from the commands."""
        return bool(np.isfinite(self.rotor_command_rad_s).all())

    def __len__(self) -> int:
        return len(self.time_s)


@dataclass(frozen=True, slots=True, eq=False)
class LeadIn:
    """Intervals before the first node: only the motors are simulated there."""

    step_s: FloatArray
    """(m,)."""
    rotor_command_rad_s: FloatArray
    """(m, 4)."""
    battery_v: FloatArray
    """(m,)."""


@dataclass(frozen=True, slots=True)
class _Source:
    """Which quantities of a log the estimator is going to use."""

    name: str
    nodes: tuple[str, ...]
    """Quantities that must be there at every node: the pose, or the IMU."""
    rotors: str
    """`rotor_speed_rad_s`, or the command."""


def prepare(log: FlightLog, index: int, options: Options) -> list[Flight]:
    """Flights without gaps from one log.

    Raises:
        InputError: it has neither pose nor IMU, or neither rotor speed nor command, or there is a gap and the options
            refuse gaps.
    """
    source = _source(log, str(log.metadata.get("name", f"flight {index + 1}")))
    pieces = _split(log, source, options)
    return [_flight(log, piece, source, index, len(pieces), options) for piece in pieces]


def _source(log: FlightLog, name: str) -> _Source:
    pose, imu = ("position_world_m", "q_world_body"), ("rate_body_rad_s", "specific_force_body_m_s2")
    if not all(log.has(q) for q in pose) and not all(log.has(q) for q in imu):
        missing = " and ".join(q for q in pose if not log.has(q))
        raise InputError(f"{name} has no {missing}, nor gyro and accelerometer to do without: nothing shows the motion")
    rotors = "rotor_speed_rad_s" if log.has("rotor_speed_rad_s") else "rotor_speed_command_rad_s"
    if not log.has(rotors):
        raise InputError(
            f"{name} has no rotor_speed_rad_s and no rotor_speed_command_rad_s: something must drive the model; "
            "record rotor speed (ESC telemetry)"
        )
    return _Source(name, pose if all(log.has(q) for q in pose) else imu, rotors)


def _split(log: FlightLog, source: _Source, options: Options) -> list[tuple[float, float]]:
    """Start and end of each stretch where both pose (or IMU) and rotor speed (or command) were sampled."""
    name = source.name
    pose_s = log.time_s[_finite_rows(log, source.nodes, name)]
    rotor_s = log.time_s[_finite_rows(log, (source.rotors,), name)]
    kind = "pose" if source.nodes[0] == "position_world_m" else "IMU"
    usual_s = float(np.median(np.diff(pose_s)))
    if usual_s >= SLOWEST_S:
        raise InputError(
            f"{name} has a {kind} every {usual_s:.3g} s: its time is in another unit, or it is too slow to fit; time_s "
            "must be in seconds"
        )
    gaps = sorted(_gaps(pose_s, kind) + _gaps(rotor_s, "rotor speed"))
    start_s, end_s = max(pose_s[0], rotor_s[0]), min(pose_s[-1], rotor_s[-1])
    if gaps and options.gaps == "refuse":
        begin, end, what = gaps[0]
        more = f" and {len(gaps) - 1} more gaps" if len(gaps) > 1 else ""
        raise InputError(
            f"{name} has no {what} from {begin:.3f} s to {end:.3f} s ({end - begin:.3f} s){more}; "
            "fit the pieces between as separate flights with gaps='split', or cut the log there"
        )
    edges = [start_s]
    for begin, end, _ in gaps:
        edges += [begin, end]
    edges.append(end_s)
    pieces = [(a, b) for a, b in zip(edges[::2], edges[1::2], strict=True) if b - a >= SHORTEST_S]
    if not pieces:
        raise InputError(f"{name} has no stretch of {SHORTEST_S:g} s with both pose and rotor speed")
    return pieces


def _finite_rows(log: FlightLog, quantities: tuple[str, ...], name: str) -> IndexArray:
    values = np.concatenate([log.vector(quantity) for quantity in quantities], axis=1)
    finite = np.isfinite(values).all(axis=1)
    partly = np.isfinite(values).any(axis=1) & ~finite
    if partly.any():
        row = int(np.flatnonzero(partly)[0])
        raise InputError(
            f"{name}: {' and '.join(quantities)} are not all finite in row {row} ({log.time_s[row]:.3f} s), "
            f"{int(partly.sum())} such rows in all; write NaN in all of them where nothing was sampled"
        )
    if finite.sum() < 10:
        raise InputError(f"{name} has {int(finite.sum())} samples of {' and '.join(quantities)}; 10 are needed")
    return np.flatnonzero(finite)


def _gaps(time_s: FloatArray, what: str) -> list[tuple[float, float, str]]:
    step_s = np.diff(time_s)
    longest_s = max(GAP_FACTOR * float(np.median(step_s)), GAP_LEAST_S)
    return [(float(time_s[i]), float(time_s[i + 1]), what) for i in np.flatnonzero(step_s > longest_s)]


def _flight(
    log: FlightLog, piece: tuple[float, float], source: _Source, index: int, pieces: int, options: Options
) -> Flight:
    start_s, end_s = piece
    inside = (log.time_s >= start_s) & (log.time_s <= end_s)
    rows = np.flatnonzero(inside & np.isfinite(log.vector(source.nodes[0])).all(axis=1))
    rows = rows[_thin(log.time_s[rows], options.node_rate_hz)]
    time_s, n = log.time_s[rows], len(rows)
    with_pose = source.nodes[0] == "position_world_m"
    position, q, rate, force = (np.full((m, c), np.nan) for m, c in ((n, 3), (n, 4), (n, 3), (n - 1, 3)))
    if with_pose:
        position = log.vector("position_world_m")[rows]
        q = _continuous(_unit(log.vector("q_world_body")[rows], source.name))
        if options.use_rates and log.has("rate_body_rad_s"):
            rate = log.vector("rate_body_rad_s")[rows]
    else:
        rate = _around_nodes(log, "rate_body_rad_s", inside, time_s)
    if (options.use_accelerometer or not with_pose) and _sampled(log, "specific_force_body_m_s2", inside):
        force = _means(log, "specific_force_body_m_s2", inside, time_s)[0]
    speed, acceleration = _means(log, source.rotors, inside, time_s)
    measured = source.rotors == "rotor_speed_rad_s"
    battery = _battery(log, inside, time_s)
    flight = Flight(
        name=source.name if pieces == 1 else f"{source.name} from {start_s:.2f} s",
        log_index=index,
        time_s=time_s,
        position_world_m=position,
        q_world_sensor=q,
        rate_body_rad_s=rate,
        specific_force_body_m_s2=force,
        rotor_speed_rad_s=speed,
        rotor_acceleration_rad_s2=acceleration,
        rotor_command_rad_s=np.full_like(speed, np.nan) if measured else speed,
        battery_v=battery,
        carries_payload=carries_payload(log),
    )
    return flight if measured else _after_lead_in(flight)


def _after_lead_in(flight: Flight) -> Flight:
    """The flight less its first moments, in which rotor speed still depends on what was before the log."""
    m = int(np.searchsorted(flight.time_s, flight.time_s[0] + LEAD_IN_S))
    own = {name: getattr(flight, name) for name in Flight.__slots__}
    cropped = {name: value[m:] if isinstance(value, np.ndarray) else value for name, value in own.items()}
    before = LeadIn(flight.step_s[:m], flight.rotor_command_rad_s[:m], flight.battery_v[:m])
    return Flight(**{**cropped, "lead_in": before})


def _means(
    log: FlightLog, quantity: str, inside: NDArray[np.bool_], node_s: FloatArray
) -> tuple[FloatArray, FloatArray]:
    values = log.vector(quantity)
    rows = inside & np.isfinite(values).all(axis=1)
    if quantity == "rotor_speed_command_rad_s":
        means = held_means(log.time_s[rows], values[rows], node_s)
        return means, np.zeros_like(means)
    if quantity == "rotor_speed_rad_s":
        return interval_means(log.time_s[rows], rotor_noise.most_likely(log.time_s[rows], values[rows]), node_s)
    return interval_means(log.time_s[rows], values[rows], node_s)


def _sampled(log: FlightLog, quantity: str, inside: NDArray[np.bool_]) -> bool:
    """Whether a quantity was recorded in a stretch, not only named."""
    return log.has(quantity) and int((inside & np.isfinite(log.vector(quantity)).all(axis=1)).sum()) >= 2


def _around_nodes(log: FlightLog, quantity: str, inside: NDArray[np.bool_], node_s: FloatArray) -> FloatArray:
    """Means over half an interval to each side of every node."""
    middle = 0.5 * (node_s[1:] + node_s[:-1])
    return _means(log, quantity, inside, np.concatenate([node_s[:1], middle, node_s[-1:]]))[0]


def _battery(log: FlightLog, inside: NDArray[np.bool_], node_s: FloatArray) -> FloatArray:
    middle = 0.5 * (node_s[1:] + node_s[:-1])
    if "battery_v" not in log.columns:
        return np.full(len(middle), np.nan)
    values = log.columns["battery_v"]
    rows = inside & np.isfinite(values)
    return np.interp(middle, log.time_s[rows], values[rows]) if rows.any() else np.full(len(middle), np.nan)


def _thin(time_s: FloatArray, rate_hz: float) -> IndexArray:
    """Indices so that no more than about `rate_hz` remain per second."""
    every = max(1, int(np.floor(1.0 / (float(np.median(np.diff(time_s))) * rate_hz) + 0.5)))
    return np.arange(0, len(time_s), every)


def interval_means(time_s: FloatArray, values: FloatArray, node_s: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Mean of a sampled signal and of its slope over each interval between nodes: (k, c) twice.

    The spline matters: a mean of the two end samples damps what the midpoint rule of the model passes, and biases
    inertias by (frequency x interval)^2 / 12, about 1 % for a fast motor at 100 Hz.
    """
    spline = CubicSpline(time_s, values, axis=0)
    step_s = np.diff(node_s)[:, None]
    return np.diff(spline.antiderivative()(node_s), axis=0) / step_s, np.diff(spline(node_s), axis=0) / step_s


def held_means(time_s: FloatArray, values: FloatArray, node_s: FloatArray) -> FloatArray:
    """Mean over each interval of a signal that holds each value until the next: (k, c)."""
    step_s = np.diff(time_s)[:, None]
    area = np.concatenate([np.zeros((1, values.shape[1])), np.cumsum(values[:-1] * step_s, axis=0)])
    at_nodes = np.stack([np.interp(node_s, time_s, column) for column in area.T], axis=1)
    return np.diff(at_nodes, axis=0) / np.diff(node_s)[:, None]


def _unit(q: FloatArray, name: str) -> FloatArray:
    norm = np.linalg.norm(q, axis=1)
    if np.abs(norm - 1.0).max() > 0.02:
        row = int(np.abs(norm - 1.0).argmax())
        raise InputError(f"{name}: q_world_body has length {norm[row]:.3f} in pose sample {row}; it must be 1")
    return q / norm[:, None]


def _continuous(q: FloatArray) -> FloatArray:
    """The same attitudes with signs chosen so that neighbours are close."""
    flips = np.cumprod(np.where((q[1:] * q[:-1]).sum(axis=1) < 0.0, -1.0, 1.0))
    return q * np.concatenate([[1.0], flips])[:, None]


def rates_from_attitude(time_s: FloatArray, q: FloatArray) -> FloatArray:
    """(n - 1, 3) mean body rate between neighbouring attitudes."""
    return rotations.log(rotations.multiply(rotations.conjugate(q[:-1]), q[1:])) / np.diff(time_s)[:, None]
