"""By how much the gyro is late against the attitude, though a controller turns the vehicle by that very gyro.

The gyro's noise turns the vehicle a little later, so a plain comparison with the attitude finds a good gyro late: by 2
to 12 ms in calm simulated flights with noise of 0.05 to 0.2 rad/s. But noise turns nothing before it was read. Hence
instrumental variables (Soederstrom and Stoica, System Identification, 1989, chapter 8; closed loops: chapter 10): of
both streams only the part is compared that earlier readings predict. Where they predict little, the clock is
inconclusive.
"""

from dataclasses import replace

import numpy as np

from flight import FlightLog
from flight.flight_log import COLUMNS
from flight.rotations import FloatArray
from sysid.logs.checks.clocks import BLOCK_S, LONGEST_S, STEPS, SYSTEMATIC_S, Offset, clock_offset, reader
from sysid.logs.checks.finding import Finding, warning
from sysid.logs.checks.motion import GRID_S, WINDOW, Kinematics, correlation, on_grid
from sysid.logs.events.repair import Repair

SIGMAS = 3.5
"""An offset within so many standard errors is not worth a word: 3 of a normal distribution, with some 15 blocks."""
LEAST_QUALITY = 0.8
"""Nor is one between streams that are less correlated than this."""
LEAST_SURE_S = 2e-3
"""When so many standard errors are more than this, the clock is inconclusive."""
EARLIER = tuple(WINDOW + k for k in (1, 5, 10, 17))
"""Samples before: nothing smoothed there has a sample in common with what is smoothed now."""
LEAST_PREDICTED = 5.0
"""Standard errors by which the slope must be predicted. With less (0.4 to 3.7 on five of eight flights of a nano-drone,
whose fast turns nothing predicts) the estimate may be off by several standard errors: weak instruments."""
CLOSED_LOOP_S = 6e-3
"""Part of the standard error of the plain comparison, which stands where little is predicted: a controller made good
gyros 2 to 12 ms late. So a clock that is off by more than all that is named even then."""
SLOW_S, SLOW_SHARE = 0.03, 0.1
"""Of samples farther apart, this share of their distance is part of the standard error: quick turns pass between
them (at 10 Hz a good gyro looked 23 ms late)."""
PARTS = 5
"""Each part of the flight is predicted by a fit to the others, so that none of its own noise is in it."""


def findings(offset: Offset, plain: Offset) -> tuple[list[Finding], list[str]]:
    """What to say of the gyro's clock, and a sentence where it is inconclusive.

    Args:
        offset: by `after_attitude`.
        plain: by `compared_plainly`; it decides nothing, but is told beside what is inconclusive.
    """
    if offset.quality <= LEAST_QUALITY:
        return [], []
    if offset.worth_a_word(LEAST_QUALITY, SIGMAS):
        fix = f"shift the gyro's time stamps by {-1e3 * offset.delay_s:+.1f} ms"
        repair = Repair("shift", COLUMNS["rate_body_rad_s"], shift_s=-offset.delay_s)
        return [warning("clock", f"the gyro is {offset.words} against the attitude", fix, repair=repair)], []
    if SIGMAS * offset.sigma_s > LEAST_SURE_S:
        return [], [_inconclusive(offset, plain)]
    return [], []


def _inconclusive(offset: Offset, plain: Offset) -> str:
    known = f"known to ±{1e3 * SIGMAS * offset.sigma_s:.1f} ms only" if np.isfinite(offset.sigma_s) else "not known"
    said = f"the gyro's clock, against the attitude, is {known}: this flight turns too little for the gyro's noise"
    if np.isfinite(plain.sigma_s):
        said += f". Compared plainly it is {plain.words}, {_worth(plain)}. Nothing is shifted"
    return f"{said}; fly doublets or fast turns to tell (a fit estimates this clock in any case)"


def _worth(plain: Offset) -> str:
    """What a plain comparison is worth: a controller makes gyros late, none early."""
    if plain.worth_a_word(LEAST_QUALITY, SIGMAS) and plain.delay_s < 0.0:
        return "which a controller that answers that noise can only hide"
    return "but a controller that answers that noise may be the cause, or hide more"


def after_attitude(log: FlightLog, motion: Kinematics) -> Offset:
    """By how much the gyro comes later than the attitude.

    The instruments are the gyro's own earlier rate and slope: the noise of what is compared now, white, is not in them.
    """
    gyro = on_grid(log, "rate_body_rad_s", motion.time_s)
    attitude = motion.rate_body_rad_s
    slow_s = _slow_s(log)
    plain = clock_offset(attitude, gyro)
    plain = replace(plain, sigma_s=float(np.hypot(plain.sigma_s, slow_s)))
    if not np.isfinite(plain.sigma_s) or len(attitude) < 8 * EARLIER[-1]:
        return Offset(0.0, np.inf, plain.quality)
    delay_s, sigma_s, read = plain.delay_s, np.inf, reader(gyro)
    for _ in range(STEPS):
        step_s, sigma_s = _left(attitude, read(delay_s))
        delay_s = float(np.clip(delay_s + step_s, -LONGEST_S, LONGEST_S))
    if not sigma_s <= CLOSED_LOOP_S:
        return replace(plain, sigma_s=float(np.hypot(plain.sigma_s, CLOSED_LOOP_S)))
    quality = correlation(attitude.ravel(), read(delay_s).ravel())
    return Offset(delay_s, float(np.hypot(sigma_s, np.hypot(slow_s, SYSTEMATIC_S))), quality)


def _slow_s(log: FlightLog) -> float:
    """Part of the standard error that comes of samples far apart."""
    apart_s = 0.0
    for quantity in ("rate_body_rad_s", "q_world_body"):
        known = np.isfinite(log.vector(quantity)).all(axis=1)
        apart_s = max(apart_s, float(np.median(np.diff(log.time_s[known]))))
    return SLOW_SHARE * apart_s if apart_s > SLOW_S else 0.0


def compared_plainly(log: FlightLog, motion: Kinematics) -> Offset:
    """By how much the gyro comes later than the attitude, as if no controller answered its noise."""
    return clock_offset(motion.rate_body_rad_s, on_grid(log, "rate_body_rad_s", motion.time_s))


def _left(attitude: FloatArray, gyro: FloatArray) -> tuple[float, float]:
    """The delay that is left between two rates (n, 3), and its standard error; infinite where nothing is predicted."""
    pull, weight, _ = terms(attitude, gyro)
    information = float(weight.sum())
    if not information > 0.0:
        return 0.0, np.inf
    return float(pull.sum()) / information, _error(pull) / information


def terms(attitude: FloatArray, gyro: FloatArray) -> tuple[FloatArray, FloatArray, slice]:
    """What is left of the delay between two rates (n, 3): its pull (m,) over its weight (m,), at which m of n instants.

    By axis `gyro = gain attitude - delay gyro'`, less what means and the rates about the other axes explain: pose and
    gyro may be turned against each other. Gain and delay come from what earlier readings predict of `attitude` and of
    `gyro'`, the latter freed of the gain. All weights are 0 where nothing is predicted.
    """
    moving = np.gradient(gyro, GRID_S, axis=0)
    now = slice(EARLIER[-1] + WINDOW, len(gyro) - WINDOW)
    earlier = np.concatenate([x[now.start - k : now.stop - k] for x in (gyro, moving) for k in EARLIER], axis=1)
    pull, free, slope = (np.zeros((len(earlier), 3)) for _ in range(3))
    for i in range(3):
        beside = np.column_stack([np.ones(len(earlier)), np.delete(attitude[now], i, axis=1)])
        both = np.column_stack([attitude[now, i], gyro[now, i], moving[now, i], earlier])
        both -= beside @ np.linalg.lstsq(beside.T @ beside, beside.T @ both)[0]  # as in `_predicted`
        own, read, slope[:, i] = both[:, :3].T
        told, told_slope = _predicted(both[:, 3:], np.column_stack([own, slope[:, i]])).T
        if told @ own > 0.0:  # else nothing about this axis is predicted
            free[:, i] = told_slope - told * (told_slope @ own) / (told @ own)
            pull[:, i] = free[:, i] * (own * (told @ read) / (told @ own) - read)
    weight = (free * slope).sum(axis=1)
    information, size = float(weight.sum()), float((free**2).sum())
    chance = free * (slope - free * information / max(size, np.finfo(float).tiny))
    if information <= LEAST_PREDICTED * _error(chance.sum(axis=1)):
        return np.zeros(len(pull)), np.zeros(len(pull)), now
    return pull.sum(axis=1), weight, now


def _error(terms: FloatArray) -> float:
    """Standard error of the sum of terms (n,) that are independent between blocks of time."""
    blocks = np.add.reduceat(terms, np.arange(0, len(terms), round(BLOCK_S / GRID_S)))
    return float(np.sqrt((blocks**2).sum()))


def _predicted(earlier: FloatArray, now: FloatArray) -> FloatArray:
    """(n, c) of `now` as linear in what was `earlier` (n, k), less its mean.

    By normal equations, of which a part's are taken out: a fit to an hour of flight takes a second.
    """
    told = np.empty_like(now)
    parts = np.array_split(np.arange(len(now)), PARTS)
    squares = [earlier[part].T @ np.column_stack([earlier[part], now[part]]) for part in parts]
    whole, k = np.sum(squares, axis=0), earlier.shape[1]
    for part, own in zip(parts, squares, strict=True):
        others = whole - own
        told[part] = earlier[part] @ np.linalg.lstsq(others[:, :k], others[:, k:])[0]
    return told - told.mean(axis=0)
