"""Which kinds of motion flights show: what acts in a kind that none shows cannot be told, however many there are."""

from collections.abc import Sequence

import numpy as np

from flight import FlightLog, rotations
from flight.rotations import FloatArray
from sysid.logs.checks.motion import FARTHEST_M, LONGEST_S
from vehicle import Vehicle

LEVEL, VERTICAL, TILTING, YAWING = "level flight", "climb and descent", "roll and pitch", "yaw"
FLY = {LEVEL: "fast_level", VERTICAL: "vertical", TILTING: "doublets", YAWING: "yaw_doublets"}
"""A manoeuvre of each kind."""
ALIKE = ("all flights ", "the flight ")
"""How a note begins on flights that are of one kind, or of none."""
HOVERING = ("all flights hover: ", "the flight hovers: ")
"""How it begins where they only hover."""
LEAST_SPEED = 0.25
"""Of the downwash in hover: what air speed changes at the rotors is of this order. Gusts move a hover by less."""
HOVERS = 0.4
"""Of that: what stays below, and turns less than the rates below, hovers."""
LEAST_RATE_RAD_S = {TILTING: 1.0, YAWING: 0.8}
STEP_S = 0.2
"""Velocity is taken between poses this far apart, beside which their noise is small."""
TURN_STEP_S = 0.05
"""The gyro is averaged over so long, for its noise: a turn to and fro at 5 Hz loses a tenth."""
FASTEST_RAD_S = 1e3
"""No body turns faster: beyond, it is damage."""
LASTS_S, LEAST_SAMPLES = 0.5, 3
"""A flight shows what it does for so long in all, and in so many samples: no jump of a pose, and however long it is."""


def notes(logs: Sequence[FlightLog], vehicle: Vehicle) -> tuple[str, ...]:
    """Say which kinds of motion no flight shows; nothing of a kind that some log has no measurement of."""
    seen = [_most(log) for log in logs]
    speed = LEAST_SPEED * _downwash_m_s(vehicle)
    least = {LEVEL: speed, VERTICAL: speed, **LEAST_RATE_RAD_S}
    judged = [kind for kind in FLY if seen and all(kind in one for one in seen)]
    lacking = [kind for kind in judged if not max(one[kind] for one in seen) >= least[kind]]
    if not lacking:
        return ()
    alike = _alike(seen, least) if len(judged) == len(FLY) else ""
    to_fly = ", ".join(FLY[kind] for kind in lacking)
    return (f"{alike}no {', no '.join(lacking)}, so what acts there cannot be told; fly {to_fly}",)


def _alike(seen: Sequence[dict[str, float]], least: dict[str, float]) -> str:
    """What the flights have in common: they hover, they are slow, or each shows the one kind that any does."""
    shown = [kind for kind in FLY if any(one[kind] >= least[kind] for one in seen)]
    alone = len(seen) == 1
    if not shown:
        hover = all(one[kind] < HOVERS * least[kind] for one in seen for kind in (LEVEL, VERTICAL))
        does = ("hovers" if alone else "hover") if hover else ("is slow" if alone else "are slow")
        return f"{'the flight' if alone else 'all flights'} {does}: "
    same = len(shown) == 1 and all(one[shown[0]] >= least[shown[0]] for one in seen)
    return "all flights are of one kind: " if same and not alone else ""


def _most(log: FlightLog) -> dict[str, float]:
    """Of each kind that the log has a measurement of, how much of it the flight shows: m/s, or rad/s.

    Turns are those of the pose or of the gyro, whichever shows more: a gyro may end early, and poses miss quick turns.
    Of none in a log that is in another unit of time: that is its own check's to say.
    """
    found: dict[str, float] = {}
    if log.has("position_world_m") and log.has("q_world_body"):
        found |= _by_pose(log)
    if log.has("rate_body_rad_s"):
        found |= {kind: max(most, found.get(kind, 0.0)) for kind, most in _by_gyro(log).items()}
    return found


def _by_pose(log: FlightLog) -> dict[str, float]:
    position, q = log.vector("position_world_m"), log.vector("q_world_body")
    usable = (np.abs(position) < FARTHEST_M).all(axis=1) & np.isfinite(q).all(axis=1)
    known = np.flatnonzero(usable)
    time_s = log.time_s[known]
    if len(known) < 2 or not time_s[-1] - time_s[0] < LONGEST_S:
        return {}
    at = known[np.unique(np.searchsorted(time_s, np.arange(time_s[0], time_s[-1], STEP_S)))]
    if len(at) < 2:
        return {}
    step_s = np.diff(log.time_s[at])
    velocity = np.diff(position[at], axis=0) / step_s[:, None]
    turned = rotations.log(rotations.multiply(rotations.conjugate(q[at][:-1]), q[at][1:])) / step_s[:, None]
    motions = {LEVEL: velocity[:, :2], VERTICAL: velocity[:, 2:], TILTING: turned[:, :2], YAWING: turned[:, 2:]}
    return {kind: _reached(motion, step_s) for kind, motion in motions.items()}


def _by_gyro(log: FlightLog) -> dict[str, float]:
    """Quicker turns than poses show."""
    rate = log.vector("rate_body_rad_s")
    known = np.flatnonzero((np.abs(rate) < FASTEST_RAD_S).all(axis=1))
    time_s = log.time_s[known]
    if len(known) < 2 or not time_s[-1] - time_s[0] < LONGEST_S:
        return {}
    span = np.floor((time_s[1:] - time_s[0]) / TURN_STEP_S).astype(int)
    _, at, count = np.unique(span, return_inverse=True, return_counts=True)
    rate = np.stack([np.bincount(at, weights=axis) for axis in rate[known[1:]].T], axis=1) / count[:, None]
    step_s = np.bincount(at, weights=np.diff(time_s)).astype(float)
    return {TILTING: _reached(rate[:, :2], step_s), YAWING: _reached(rate[:, 2:], step_s)}


def _reached(motion: FloatArray, step_s: FloatArray) -> float:
    """Size that is reached for `LASTS_S` in all.

    Args:
        motion: (k, 1 or 2).
        step_s: (k,) how long before each sample the last one was; after a gap it counts as `STEP_S`.
    """
    step_s = np.minimum(step_s, STEP_S)
    size = np.linalg.norm(motion, axis=1)
    order = np.argsort(-size)
    enough = (np.cumsum(step_s[order]) >= LASTS_S) & (np.arange(len(size)) >= LEAST_SAMPLES - 1)
    return float(size[order][np.argmax(enough)]) if enough.any() else 0.0


def _downwash_m_s(vehicle: Vehicle) -> float:
    """Speed that momentum theory gives the air at the rotors in hover."""
    area_m2 = vehicle.rotors * np.pi * vehicle.value("rotor_radius_m") ** 2
    weight_n = vehicle.value("mass_kg") * vehicle.gravity_m_s2
    return float(np.sqrt(weight_n / (2.0 * vehicle.value("air_density_kg_m3") * area_m2)))
