"""A trajectory in as few polynomials of degree 7 as the Crazyflie's memory holds, close to the plan.

Every piece has the plan's position, velocity, acceleration and yaw at both ends, so that joins are smooth to the
acceleration; its two other coefficients an axis are fitted to the plan in between by least squares:

    q(s) = quintic Hermite(s) + (a + b s) s^3 (1 - s)^3,  s = 0 to 1 over the piece

The pieces are as long as a tolerance allows, one after the other; the tolerance is the smallest with which they are few
enough.
"""

from dataclasses import dataclass

import numpy as np

from flight import FloatArray, InputError, Trajectory

TERMS, MOST_PIECES = 8, 31
"""Coefficients of a piece; pieces of 132 bytes in the firmware's memory of 4,096."""
WITHIN_M, WITHIN_RAD = 0.01, 0.02
_FINEST = 0.01
"""Of the tolerances tried, as a share of the largest."""
_BETWEEN = 0.97
"""Of a tolerance, at the samples: between them the distance is a little larger."""
_STEP_S, _FEWEST = 0.01, 48
"""Between samples of a piece, at most; and how many a short one has, beside the plan's own joins."""
_HALVINGS, _TRIALS = 9, 6
_FREE = np.zeros((2, TERMS))
_FREE[0, 3:7] = _FREE[1, 4:8] = (1.0, -3.0, 3.0, -1.0)
_TO_QUINTIC = np.linalg.inv([[1.0, 1.0, 1.0], [3.0, 4.0, 5.0], [6.0, 12.0, 20.0]])


@dataclass(frozen=True, slots=True)
class Refit:
    """What of a plan the pieces are."""

    trajectory: Trajectory
    largest_m: float
    """Largest distance from the plan."""
    largest_rad: float
    """Largest difference of the yaw."""
    largest_m_s2: float
    """Largest difference of the acceleration."""


def refit(plan: Trajectory, *, most_pieces: int = MOST_PIECES, within_m: float = WITHIN_M) -> Refit:
    """The plan itself where it fits, else the nearest pieces that do.

    Raises:
        InputError: more pieces are needed to stay so near; how far those that fit reach.
    """
    if len(plan.durations_s) <= most_pieces and not plan.coefficients[:, :, TERMS:].any():
        short = plan.coefficients[:, :, :TERMS]
        padded = np.pad(short, ((0, 0), (0, 0), (0, TERMS - short.shape[2])))
        return Refit(Trajectory(plan.durations_s, padded), 0.0, 0.0, 0.0)
    found = _pieces(plan, within_m, most_pieces)
    if found.duration_s < plan.duration_s - 1e-9:
        raise InputError(_too_long(plan, found.duration_s, most_pieces, within_m))
    low, high = np.log(_FINEST * within_m), np.log(within_m)
    for _ in range(_TRIALS):
        middle = 0.5 * (low + high)
        tried = _pieces_or_none(plan, float(np.exp(middle)), most_pieces)
        if tried is None or tried.duration_s < plan.duration_s - 1e-9:
            low = middle
        else:
            found, high = tried, middle
    return compared(plan, found)


def compared(plan: Trajectory, pieces: Trajectory) -> Refit:
    """How far pieces are from the plan, every 5 ms and at their joins."""
    end_s = min(plan.duration_s, pieces.duration_s)
    times = np.minimum(np.unique(np.concatenate([plan.sample(0.005), plan.starts_s, pieces.starts_s])), end_s)
    away, away_2 = (np.abs(plan.evaluate(times, d) - pieces.evaluate(times, d)) for d in (0, 2))
    far_m, far_m_s2 = (float(np.linalg.norm(each[:, :3], axis=1).max()) for each in (away, away_2))
    return Refit(pieces, far_m, float(away[:, 3].max()), far_m_s2)


def require_near(held: Refit) -> None:
    """
    Raises:
        InputError: pieces are farther from the plan than `WITHIN_M` or `WITHIN_RAD`.
    """
    if held.largest_m > WITHIN_M or held.largest_rad > WITHIN_RAD:
        place_m = float(np.abs(held.trajectory.coefficients[:, :3, 0]).max())
        raise InputError(
            f"read back in the Crazyflie's single precision, the pieces are {100.0 * held.largest_m:.3g} cm and "
            f"{held.largest_rad:.2g} rad from the plan; at most {100.0 * WITHIN_M:g} cm and {WITHIN_RAD:g} rad are "
            f"flown. The plan is up to {place_m:.0f} m from the origin: plan in a frame with its origin nearby"
        )


def _pieces_or_none(plan: Trajectory, within_m: float, most: int) -> Trajectory | None:
    """`_pieces`, or None where even the shortest piece is not so near."""
    try:
        return _pieces(plan, within_m, most)
    except InputError:
        return None


def _pieces(plan: Trajectory, within_m: float, most: int) -> Trajectory:
    """As many as there may be, each as long as it may be; they may end before the plan does."""
    durations: list[float] = []
    coefficients: list[FloatArray] = []
    begin_s, step_s = 0.0, plan.duration_s / most
    while begin_s < plan.duration_s - 1e-9 and len(durations) < most:
        end_s, piece = _longest(plan, begin_s, step_s, within_m)
        step_s = end_s - begin_s
        durations.append(step_s)
        coefficients.append(piece)
        begin_s = end_s
    return Trajectory(np.array(durations), np.array(coefficients))


def _longest(plan: Trajectory, begin_s: float, step_s: float, within_m: float) -> tuple[float, FloatArray]:
    """The end and the coefficients (4, 8) of the longest piece from a time; `step_s` is where to look first."""
    good_s, bad_s, end_s = begin_s, np.inf, begin_s + step_s
    best: FloatArray | None = None
    for _ in range(_HALVINGS):
        end_s = min(end_s, plan.duration_s)
        piece, fits = _fitted(plan, begin_s, end_s, within_m)
        if fits:
            good_s, best = end_s, piece
            if end_s >= plan.duration_s:
                break
        else:
            bad_s = end_s
        end_s = 0.5 * (good_s + bad_s) if np.isfinite(bad_s) else begin_s + 2.0 * (end_s - begin_s)
    if best is None:
        raise InputError(f"the plan has no smooth piece of degree 7 from {begin_s:.2f} s on; plan it again")
    return good_s, best


def _fitted(plan: Trajectory, begin_s: float, end_s: float, within_m: float) -> tuple[FloatArray, bool]:
    """Coefficients (4, 8) of seconds between two times, and whether they stay near enough to the plan."""
    T = end_s - begin_s
    ends = np.array([begin_s, end_s])
    (p0, p1), (v0, v1), (a0, a1) = (plan.evaluate(ends, d) * T**d for d in range(3))
    q = np.zeros((TERMS, 4))
    q[:3] = p0, v0, 0.5 * a0
    q[3:6] = _TO_QUINTIC @ np.array([p1 - p0 - v0 - 0.5 * a0, v1 - v0 - a0, a1 - a0])
    s = _shares(plan, begin_s, end_s)
    values, powers = plan.evaluate(begin_s + T * s), s[:, None] ** np.arange(TERMS)
    q += _FREE.T @ np.linalg.lstsq(powers @ _FREE.T, values - powers @ q)[0]
    missed = values - powers @ q
    near = np.linalg.norm(missed[:, :3], axis=1).max() <= _BETWEEN * within_m
    turned = np.abs(missed[:, 3]).max() <= WITHIN_RAD * within_m / WITHIN_M
    return q.T / T ** np.arange(TERMS), bool(near and turned)


def _shares(plan: Trajectory, begin_s: float, end_s: float) -> FloatArray:
    """Where a piece is compared with the plan, 0 to 1: in steps of time, so that a long one hides no leg."""
    even = np.linspace(0.0, 1.0, max(_FEWEST, int(np.ceil((end_s - begin_s) / _STEP_S)) + 1))
    joins_s = plan.starts_s[(plan.starts_s > begin_s) & (plan.starts_s < end_s)]
    return np.union1d(even, (joins_s - begin_s) / (end_s - begin_s))


def _too_long(plan: Trajectory, reached_s: float, most: int, within_m: float) -> str:
    times = np.linspace(0.0, plan.duration_s, 2000)
    gone_m = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(plan.position(times), axis=0), axis=1))])
    fits_m = float(np.interp(reached_s, times, gone_m))
    return (
        f"the plan of {plan.duration_s:.1f} s and {gone_m[-1]:.1f} m does not fit into {most} poly4d pieces within "
        f"{100.0 * within_m:g} cm; its first {reached_s:.1f} s, {fits_m:.1f} m, do: plan no more than that"
    )
