"""Does the clock of the gyro run at another pace than the attitude's: ever later, or ever earlier?

A fit estimates one delay a stream, so one that grows during the flight goes into the model. Here it is read as
`gyro_clock` reads a delay, but as a straight line in time.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from flight import FlightLog
from flight.flight_log import COLUMNS
from flight.rotations import FloatArray
from sysid.logs.checks import clocks, gyro_clock
from sysid.logs.checks.finding import Finding, error
from sysid.logs.checks.motion import GRID_S, Kinematics, correlation, on_grid, sampled
from sysid.logs.events.repair import Repair
from vehicle import Vehicle

SIGMAS = 5.0
"""A drift within so many standard errors is not worth a word."""
LEAST_S = 4e-3
"""Nor is one that is less than this over the whole log."""
LEAST_QUALITY = 0.8
"""Nor is one between streams that are less correlated than this, the drift taken out."""
WINDOW_S = 4.0
"""Over so long the delay is taken as one, to begin with."""
MOST_WINDOWS = 40
WINDOW_QUALITY = 0.6
"""Correlation from which on a window counts."""
ROUNDS = 3
"""Of these windows: each finds what is left within `clocks.LONGEST_S`."""
STEPS = 6
CLOSED_LOOP_S = 1e-2
"""Part of the standard error of a plain comparison: a controller that answers its gyro's noise makes good gyros late,
in one part of a flight by up to 10 ms more than in another."""


@dataclass(frozen=True, slots=True)
class Line:
    """A delay as a straight line in time; positive: late."""

    middle_s: float
    """Half way."""
    growth_s: float
    """From the first instant to the last."""
    sigma_s: float = np.inf
    """Standard error of `growth_s`."""

    def at(self, count: int) -> FloatArray:
        """(n,) on the grid."""
        return self.middle_s + self.growth_s * _share(count)


def check(log: FlightLog, motion: Kinematics, vehicle: Vehicle | None) -> list[Finding]:
    """What to say of the pace of the gyro's clock against the attitude's; rotor speed is of one of the two clocks."""
    if len(motion.time_s) < 2 * WINDOW_S / GRID_S or not sampled(log, "rate_body_rad_s"):
        return []
    attitude, gyro = motion.rate_body_rad_s, on_grid(log, "rate_body_rad_s", motion.time_s)
    line = grown(attitude, gyro)
    later = clocks.reader(gyro)(line.at(len(gyro)))
    if abs(line.growth_s) <= max(LEAST_S, SIGMAS * line.sigma_s):
        return []
    if correlation(attitude.ravel(), later.ravel()) <= LEAST_QUALITY:
        return []
    imu = (*COLUMNS["rate_body_rad_s"], *COLUMNS["specific_force_body_m_s2"])
    follows: bool | None = False
    if sampled(log, "rotor_speed_rad_s"):
        follows = _rotors_follow(log, motion, vehicle, line) if vehicle is not None else None
    return [_finding(line, motion, imu, follows, log.names("rotor_speed_rad_s"))]


def _rotors_follow(log: FlightLog, motion: Kinematics, vehicle: Vehicle, line: Line) -> bool | None:
    """Whether rotor speed is on the gyro's clock, not the attitude's; None: the two do not show the same."""

    def drifts(streams: clocks.Streams, other: Line) -> bool:
        turning, driven, beside = streams
        reference, count, read = clocks.freed(turning, beside), len(turning), clocks.reader(driven)
        with_one, with_line = (
            clocks.largest_correlation(reference, clocks.freed(read(late_s), beside))[1]
            for late_s in (np.full(count, other.middle_s), other.at(count))
        )
        return with_line > with_one

    by_attitude = drifts(clocks.by_attitude(log, motion, vehicle), line)
    by_gyro = drifts(clocks.by_gyro(log, motion, vehicle), Line(-line.middle_s, -line.growth_s))
    return by_attitude if by_attitude is not by_gyro else None


def grown(attitude: FloatArray, gyro: FloatArray) -> Line:
    """By how much the gyro (n, 3) comes later than the attitude's rate, at the beginning and at the end.

    By what earlier readings predict (`gyro_clock`); where they predict too little, plainly, and less surely.
    """
    begun, nothing, read = _by_windows(attitude, gyro), np.zeros((len(gyro), 3, 0)), clocks.reader(gyro)

    def predicted(late_s: FloatArray) -> tuple[FloatArray, FloatArray, slice]:
        return gyro_clock.terms(attitude, read(late_s))

    def plain(late_s: FloatArray) -> tuple[FloatArray, FloatArray, slice]:
        return *clocks.terms(attitude, read(late_s), nothing)[:2], slice(None)

    line = _refined(begun, len(gyro), predicted)
    if np.isfinite(line.sigma_s):
        return line
    line = _refined(begun, len(gyro), plain)
    return replace(line, sigma_s=float(np.hypot(line.sigma_s, CLOSED_LOOP_S)))


Terms = Callable[[FloatArray], tuple[FloatArray, FloatArray, slice]]
"""Of delays (n,): what is left of them as pull (m,) over weight (m,), and which m of the n instants."""


def _refined(line: Line, count: int, terms: Terms) -> Line:
    """By least squares; its standard error is infinite where the terms weigh nothing."""
    for _ in range(STEPS):
        pull, weight, now = terms(line.at(count))
        at = _share(count)[now]
        basis = np.column_stack([np.ones(len(at)), at])
        information = basis.T @ (weight[:, None] * basis)
        if not np.linalg.eigvalsh(information)[0] > 0.0:
            return replace(line, sigma_s=np.inf)
        inverse = np.linalg.inv(information)
        middle_s, growth_s = inverse @ (basis.T @ pull)
        blocks = np.add.reduceat(basis * pull[:, None], np.arange(0, len(pull), round(clocks.BLOCK_S / GRID_S)))
        sigma_s = float(np.sqrt((inverse @ (blocks.T @ blocks) @ inverse)[1, 1]))
        line = Line(line.middle_s + middle_s, line.growth_s + growth_s, sigma_s)
    return line


def _by_windows(reference: FloatArray, other: FloatArray) -> Line:
    """By the lag of the largest correlation in each window; the line is the median of those through two of them."""
    line, share, read = Line(0.0, 0.0), _share(len(reference)), clocks.reader(other)
    count = int(np.clip(len(reference) * GRID_S / WINDOW_S, 2, MOST_WINDOWS))
    edges = np.linspace(0, len(reference), count + 1).astype(int)
    windows = [slice(a, b) for a, b in pairwise(edges)]
    for _ in range(ROUNDS):
        later = read(line.at(len(other)))
        lags = [clocks.largest_correlation(reference[one], later[one]) for one in windows]
        counts = [k for k, (_, quality) in enumerate(lags) if quality > WINDOW_QUALITY]
        if len(counts) < 2:
            break
        at = share[(edges[:-1] + edges[1:]) // 2][counts]
        lag_s = np.array([lags[k][0] for k in counts])
        i, j = np.triu_indices(len(at), 1)
        growth_s = float(np.median((lag_s[j] - lag_s[i]) / (at[j] - at[i])))
        line = Line(line.middle_s + float(np.median(lag_s - growth_s * at)), line.growth_s + growth_s)
    return line


def _share(count: int) -> FloatArray:
    """(n,) from -1/2 at the first instant to 1/2 at the last."""
    return np.linspace(-0.5, 0.5, count)


def _finding(
    line: Line, motion: Kinematics, columns: tuple[str, ...], follows: bool | None, rotors: tuple[str, ...]
) -> Finding:
    """Args: `follows`: whether rotor speed is on the gyro's clock; None: not known, so that no repair is sure."""
    first_s, length_s = float(motion.time_s[0]), float(motion.time_s[-1] - motion.time_s[0])
    pace = line.growth_s / length_s
    whose = "the gyro, as rotor speed," if follows else "the gyro"
    way = "later" if pace > 0.0 else "earlier"
    sentence = (
        f"{whose} comes ever {way} than the attitude, by {1e3 * abs(line.growth_s):.1f} ± {1e3 * line.sigma_s:.2g} ms "
        f"over the log: clocks {1e6 * abs(pace):.0f} ppm apart"
    )
    if follows is None:
        return error(
            "clock drift",
            sentence,
            "record all on one clock; the vehicle file may show which of them rotor speed is on",
        )
    columns = (*columns, *rotors) if follows else columns
    # what is late by middle + pace (t - half way) was stamped so much too late
    shift_s = pace * (first_s + 0.5 * length_s) - line.middle_s
    moved = "gyro and rotor speed" if follows else "the gyro"
    fix = f"multiply the time stamps of {moved} by {1.0 - pace:.6f}, and add {shift_s:+.4f} s"
    return error("clock drift", sentence, fix, repair=Repair("drift", columns, factor=1.0 - pace, shift_s=shift_s))
