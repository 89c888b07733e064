"""One flight made ready for the estimator: nodes in time, what was measured there, mean rotor speed in between."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline

from flight import FlightLog, InputError, rotations
from flight.rotations import FloatArray
from sysid.options import Options

IndexArray = NDArray[np.intp]

GAP_FACTOR = 4.0
"""A pause is a gap when it lasts this many usual sample intervals ..."""
GAP_LEAST_S = 0.04
"""... and at least this long: single lost frames are harmless."""
SHORTEST_S = 1.0
"""Pieces between gaps that are shorter say nothing and are left out."""


@dataclass(frozen=True, slots=True, eq=False)
class Flight:
    """A stretch of one log without gaps."""

    name: str
    """For messages: the log's name and the piece of it."""
    log_index: int
    """Which of the logs handed in it came from; pieces of one log share the gyro bias."""
    time_s: FloatArray
    """(n,) instants of the states."""
    position_world_m: FloatArray
    """(n, 3) measured by the pose sensor."""
    q_world_sensor: FloatArray
    """(n, 4) measured by the pose sensor, continuous in sign."""
    rate_body_rad_s: FloatArray
    """(n, 3) measured by the gyro; NaN where not measured."""
    rotor_speed_rad_s: FloatArray
    """(n - 1, 4) mean over each interval."""
    rotor_acceleration_rad_s2: FloatArray
    """(n - 1, 4) mean over each interval."""

    @property
    def step_s(self) -> FloatArray:
        """(n - 1,) lengths of the intervals."""
        return np.diff(self.time_s)

    def __len__(self) -> int:
        return len(self.time_s)


def prepare(log: FlightLog, index: int, options: Options) -> list[Flight]:
    """Flights without gaps from one log.

    Raises:
        InputError: pose or rotor speed is missing or not finite, or there is a gap and the options refuse gaps.
    """
    name = str(log.metadata.get("name", f"flight {index + 1}"))
    for quantity, why in (
        ("position_world_m", "the position is what the model is compared with"),
        ("q_world_body", "the attitude turns thrust into acceleration"),
        ("rotor_speed_rad_s", "it drives the model; record measured rotor speed (ESC telemetry)"),
    ):
        if not log.has(quantity):
            raise InputError(f"{name} has no {quantity}: {why}")
    pieces = _split(log, name, options)
    return [_flight(log, piece, name, index, len(pieces), options) for piece in pieces]


def _split(log: FlightLog, name: str, options: Options) -> list[tuple[float, float]]:
    """Start and end of each stretch where both pose and rotor speed were sampled."""
    pose_s = log.time_s[_finite_rows(log, ("position_world_m", "q_world_body"), name)]
    rotor_s = log.time_s[_finite_rows(log, ("rotor_speed_rad_s",), name)]
    gaps = sorted(_gaps(pose_s, "pose") + _gaps(rotor_s, "rotor speed"))
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


def _flight(log: FlightLog, piece: tuple[float, float], name: str, index: int, pieces: int, options: Options) -> Flight:
    start_s, end_s = piece
    inside = (log.time_s >= start_s) & (log.time_s <= end_s)
    position, q = log.vector("position_world_m"), log.vector("q_world_body")
    rows = np.flatnonzero(inside & np.isfinite(position).all(axis=1))
    rows = rows[_thin(log.time_s[rows], options.node_rate_hz)]
    time_s = log.time_s[rows]
    rotor_rows = np.flatnonzero(inside & np.isfinite(log.vector("rotor_speed_rad_s")).all(axis=1))
    speed, acceleration = interval_means(log.time_s[rotor_rows], log.vector("rotor_speed_rad_s")[rotor_rows], time_s)
    rate = np.full((len(rows), 3), np.nan)
    if options.use_rates and log.has("rate_body_rad_s"):
        rate = log.vector("rate_body_rad_s")[rows]
    return Flight(
        name=name if pieces == 1 else f"{name} from {start_s:.2f} s",
        log_index=index,
        time_s=time_s,
        position_world_m=position[rows],
        q_world_sensor=_continuous(_unit(q[rows], name)),
        rate_body_rad_s=rate,
        rotor_speed_rad_s=speed,
        rotor_acceleration_rad_s2=acceleration,
    )


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
