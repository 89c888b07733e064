"""Stretches in which the vehicle stands on the ground, is held, or hits something: no model of a flight holds there.

While it stands, the ground carries what the rotors do not. So rotors that turn far too slowly to carry the vehicle,
while an accelerometer feels most of its weight or the pose stands still, show contact; a shock that no rotor can make
and that lasts more than a sample shows an impact. From there a stretch reaches as far as the ground still carries a
share, and a moment further.
"""

import numpy as np
from numpy.typing import NDArray

from flight import FlightLog
from flight.frames import GRAVITY_M_S2
from flight.rotations import FloatArray
from sysid.logs.checks.motion import LONGEST_S
from sysid.logs.events.repair import Span

UP = np.array([0.0, 0.0, 1.0])
SLOW = 0.5
"""Rotors that make less than this share of the weight do not carry the vehicle."""
FELT = 0.4
"""Specific force beyond the rotors' that the ground must make, in g ..."""
STILL_FELT = 0.15
"""... and as long as it makes this much, the vehicle has not left."""
IMPACT = 3.0
"""Specific force beyond the rotors' that only a blow makes, in g ..."""
IMPACT_S, IMPACT_SAMPLES = 0.01, 3
"""... as a running median over this long, and at least so many samples: a single bad sample is no blow ..."""
IMPACT_SIGMAS = 6.0
"""... and beyond so many standard deviations of the accelerometer's noise: nor is vibration."""
NOISE_SAMPLES = 21
"""Noise is the scatter about a running median over so many samples."""
SIGMA_OF_MAD = 1.4826
"""Standard deviation by the median absolute deviation, for Gaussian noise."""
STILL_M = 0.01
"""A pose that stays within this box ..."""
STILL_S = 0.5
"""... for this long stands still ..."""
STILL_RAD = 0.1
"""... unless attitude or gyro show that it turned by more: then the position is frozen."""
SMOOTHED_S = 0.1
"""Accelerometer and rotor speed are compared as means over this long."""
SHORTEST_S = 0.2
"""Contact that is shorter is none, unless it is an impact."""
MARGIN_S = 0.3
"""Left out on either side: rotors spool up, the vehicle still rocks."""
FEWEST = 50
"""Rows needed to say anything."""

Mask = NDArray[np.bool_]


def spans(log: FlightLog) -> tuple[Span, ...]:
    """Where the vehicle is in contact with something, seconds of the log's clock; empty where nothing shows it."""
    rotors = next((q for q in ("rotor_speed_rad_s", "rotor_speed_command_rad_s") if log.has(q)), "")
    if not rotors:
        return ()
    squares = (log.vector(rotors) ** 2).sum(axis=1)
    rows = np.flatnonzero(np.isfinite(squares))
    if len(rows) < FEWEST:
        return ()
    time_s, thrust = log.time_s[rows], squares[rows]
    felt_g = _felt(log, rows)
    still = _still(log, time_s)
    if felt_g is None and still is None:
        return ()
    strong = thrust > SLOW * np.quantile(thrust, 0.95)
    resting = np.zeros(len(rows), dtype=bool) if still is None else still
    if felt_g is None:
        slow = _smoothed(thrust, time_s) < SLOW * np.median(thrust[strong])
        near, sure, blows = resting, slow & resting, []
    else:
        carried = thrust / np.median(thrust[strong] / felt_g[strong, 2])
        beyond = np.stack([_smoothed(column, time_s) for column in (felt_g - carried[:, None] * UP).T], axis=1)
        size = np.linalg.norm(beyond, axis=1)  # it may lie on its side or on its back
        sure = (_smoothed(carried, time_s) < SLOW) & (size > FELT)
        near = (np.abs(beyond[:, 2]) > STILL_FELT) | sure | resting
        blows = _blows(log, time_s, carried)
    found = [(a, b) for a, b in _runs(near, time_s) if _longest_s(sure, time_s, a, b) >= SHORTEST_S]
    return _joined([*found, *blows], time_s)


def sentence(name: str, where: tuple[Span, ...]) -> str:
    """What was left out of a log, in words."""
    length_s = sum(end - start for start, end in where)
    listed = ", ".join(f"{start:.1f} to {end:.1f} s" for start, end in where[:4])
    more = f" and {len(where) - 4} more" if len(where) > 4 else ""
    return f"{name} was on the ground or in contact for {length_s:.1f} s, which were left out: {listed}{more}"


def _felt(log: FlightLog, rows: NDArray[np.intp]) -> FloatArray | None:
    """(m, 3) specific force in g, body axes; None where the log has no accelerometer."""
    if not log.has("specific_force_body_m_s2"):
        return None
    sampled_s, force_g = _accelerometer(log)
    if len(sampled_s) < FEWEST:
        return None
    return np.stack([np.interp(log.time_s[rows], sampled_s, column) for column in force_g.T], axis=1)


def _accelerometer(log: FlightLog) -> tuple[FloatArray, FloatArray]:
    """Its samples: instants, and (n, 3) specific force in g."""
    force_g = log.vector("specific_force_body_m_s2") / GRAVITY_M_S2
    known = np.flatnonzero(np.isfinite(force_g).all(axis=1))
    return log.time_s[known], force_g[known]


def _blows(log: FlightLog, time_s: FloatArray, carried: FloatArray) -> list[Span]:
    """Where the accelerometer feels more than rotors, vibration and single bad samples make; judged at its own rate."""
    from scipy.ndimage import median_filter

    sampled_s, felt_g = _accelerometer(log)
    inside = (sampled_s >= time_s[0]) & (sampled_s <= time_s[-1])
    sampled_s, felt_g = sampled_s[inside], felt_g[inside]
    if len(sampled_s) < FEWEST:
        return []
    beyond = felt_g - np.interp(sampled_s, time_s, carried)[:, None] * UP
    scatter = np.abs(beyond - median_filter(beyond, (NOISE_SAMPLES, 1), mode="nearest"))
    noise_g = SIGMA_OF_MAD * float(np.median(scatter, axis=0).max())
    width = max(IMPACT_SAMPLES, round(IMPACT_S / float(np.median(np.diff(sampled_s)))))
    size = np.linalg.norm(median_filter(beyond, (width, 1), mode="nearest"), axis=1)
    return _runs(size > max(IMPACT, IMPACT_SIGMAS * noise_g), sampled_s)


def _still(log: FlightLog, time_s: FloatArray) -> Mask | None:
    """(m,) whether the vehicle stands still around each instant; None without a pose, or in another unit of time."""
    if not log.has("position_world_m"):
        return None
    position = log.vector("position_world_m")
    known = np.flatnonzero(np.isfinite(position).all(axis=1))
    if len(known) < FEWEST:
        return None
    first_s, last_s = float(log.time_s[known[0]]), float(log.time_s[known[-1]])
    if last_s - first_s > LONGEST_S:
        return None
    at_s = np.arange(first_s, last_s, 0.5 * STILL_S)
    edges = np.searchsorted(log.time_s[known], at_s)
    q, rate = (log.vector(name)[known] if log.has(name) else None for name in ("q_world_body", "rate_body_rad_s"))
    position = position[known]

    def stands(a: int, b: int) -> bool:
        if b - a < 2 or not (np.ptp(position[a:b], axis=0) < STILL_M).all():
            return False
        return _turned_rad(*(None if v is None else v[a:b] for v in (q, rate))) < STILL_RAD

    calm = np.array([stands(a, b) for a, b in zip(edges[:-2], edges[2:], strict=True)], dtype=bool)
    if not len(calm):
        return np.zeros(len(time_s), dtype=bool)
    middle = np.searchsorted(at_s[1:-1] - 0.25 * STILL_S, time_s) - 1
    return calm[np.clip(middle, 0, len(calm) - 1)]


def _turned_rad(q: FloatArray | None, rate: FloatArray | None) -> float:
    """The largest turn that attitudes (n, 4) or the mean of the gyro (n, 3) show over `STILL_S`."""
    turned_rad = 0.0
    if q is not None and len(q := q[np.isfinite(q).all(axis=1)]):
        turned_rad = float(2.0 * np.arccos(np.clip(np.abs(q @ q[0]), 0.0, 1.0)).max())
    if rate is not None and len(rate := rate[np.isfinite(rate).all(axis=1)]):
        turned_rad = max(turned_rad, STILL_S * float(np.linalg.norm(rate.mean(axis=0))))
    return turned_rad


def _smoothed(values: FloatArray, time_s: FloatArray) -> FloatArray:
    """Means over `SMOOTHED_S` around each sample."""
    width = max(1, round(SMOOTHED_S / float(np.median(np.diff(time_s)))))
    total = np.concatenate([[0.0], np.cumsum(values)])
    first = np.clip(np.arange(len(values)) - width // 2, 0, len(values))
    last = np.clip(first + width, 1, len(values))
    return (total[last] - total[first]) / (last - first)


def _runs(mask: Mask, time_s: FloatArray) -> list[Span]:
    edges = np.flatnonzero(np.diff(np.concatenate([[0], mask.astype(np.int8), [0]])))
    return [(float(time_s[a]), float(time_s[b - 1])) for a, b in zip(edges[::2], edges[1::2], strict=True)]


def _longest_s(mask: Mask, time_s: FloatArray, start_s: float, end_s: float) -> float:
    inside = (time_s >= start_s) & (time_s <= end_s)
    return max((b - a for a, b in _runs(mask & inside, time_s)), default=0.0)


def _joined(found: list[Span], time_s: FloatArray) -> tuple[Span, ...]:
    """With the margin, and overlapping ones as one."""
    joined: list[Span] = []
    for start_s, end_s in sorted(found):
        start_s, end_s = max(start_s - MARGIN_S, float(time_s[0])), min(end_s + MARGIN_S, float(time_s[-1]))
        if joined and start_s <= joined[-1][1]:
            joined[-1] = (joined[-1][0], max(end_s, joined[-1][1]))
        else:
            joined.append((start_s, end_s))
    return tuple(joined)
