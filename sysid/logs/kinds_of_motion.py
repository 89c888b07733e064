"""Which kinds of motion flights show: what acts in a kind that none shows cannot be told, however many there are."""

from collections.abc import Sequence

import numpy as np

from flight import FlightLog, InputError, rotations
from flight.rotations import FloatArray
from sysid.logs.checks.motion import LONGEST_S
from vehicle import Vehicle

LEVEL, VERTICAL, TILTING, YAWING = "level flight", "climb and descent", "roll and pitch", "yaw"
FLY = {LEVEL: "fast_level", VERTICAL: "vertical", TILTING: "doublets", YAWING: "yaw_doublets"}
"""A manoeuvre of each kind."""
LEAST_SPEED = 0.25
"""Of the downwash in hover: what air speed changes at the rotors is of this order. Gusts move a hover by less."""
HOVERS = 0.4
"""Of that: what stays below, and turns less than the rates below, hovers."""
LEAST_RATE_RAD_S = {TILTING: 1.0, YAWING: 0.8}
STEP_S = 0.2
"""Motion is taken between poses this far apart, beside which their noise is small."""
REACHED = 0.99
"""A speed is what this share of a flight stays below."""


def check(logs: Sequence[FlightLog], vehicle: Vehicle) -> tuple[str, ...]:
    """Refuse flights that all hover; of others, say which kinds of motion none of them shows.

    Logs without a pose show no kind, and are not judged.

    Raises:
        InputError: all hover.
    """
    seen = [most for log in logs if (most := _most(log)) is not None]
    if not seen:
        return ()
    most = {kind: max(one[kind] for one in seen) for kind in FLY}
    speed = LEAST_SPEED * _downwash_m_s(vehicle)
    least = {LEVEL: speed, VERTICAL: speed, **LEAST_RATE_RAD_S}
    lacking = [kind for kind in FLY if not most[kind] >= least[kind]]
    if not lacking:
        return ()
    to_fly = ", ".join(FLY[kind] for kind in lacking)
    fastest = max(most[LEVEL], most[VERTICAL])
    if len(lacking) == len(FLY) and fastest < HOVERS * speed:
        raise InputError(
            f"all flights hover: they reach {fastest:.2g} m/s, and below {HOVERS * speed:.2g} m/s air speed tells "
            f"nothing; fly {to_fly}"
        )
    alike = "all flights are of one manoeuvre: " if len(lacking) == len(FLY) - 1 and len(seen) > 1 else ""
    return (f"{alike}no {', no '.join(lacking)}, so what acts there cannot be told; fly {to_fly}",)


def _most(log: FlightLog) -> dict[str, float] | None:
    """Of each kind, how much of it a flight shows: m/s, or rad/s; None without a pose, or in another unit of time."""
    if not (log.has("position_world_m") and log.has("q_world_body")):
        return None
    position, q = log.vector("position_world_m"), log.vector("q_world_body")
    known = np.flatnonzero(np.isfinite(position).all(axis=1) & np.isfinite(q).all(axis=1))
    time_s = log.time_s[known]
    if len(known) < 2 or not time_s[-1] - time_s[0] < LONGEST_S:
        return None
    at = known[np.unique(np.searchsorted(time_s, np.arange(time_s[0], time_s[-1], STEP_S)))]
    if len(at) < 2:
        return None
    step_s = np.diff(log.time_s[at])[:, None]
    velocity = np.diff(position[at], axis=0) / step_s
    rate = rotations.log(rotations.multiply(rotations.conjugate(q[at][:-1]), q[at][1:])) / step_s
    return {
        LEVEL: _reached(velocity[:, :2]),
        VERTICAL: _reached(velocity[:, 2:]),
        TILTING: _reached(rate[:, :2]),
        YAWING: _reached(rate[:, 2:]),
    }


def _reached(motion: FloatArray) -> float:
    return float(np.quantile(np.linalg.norm(motion, axis=1), REACHED))


def _downwash_m_s(vehicle: Vehicle) -> float:
    """Speed that momentum theory gives the air at the rotors in hover."""
    area_m2 = vehicle.rotors * np.pi * vehicle.value("rotor_radius_m") ** 2
    weight_n = vehicle.value("mass_kg") * vehicle.gravity_m_s2
    return float(np.sqrt(weight_n / (2.0 * vehicle.value("air_density_kg_m3") * area_m2)))
