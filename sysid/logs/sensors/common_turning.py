"""The offset between two recorders' clocks, from how both saw the vehicle turn.

The size of the body rate is the same in every frame: that of the poses, differenced over their attitudes, against that
of the gyro. The offset is the shift of largest correlation (Furrer et al. 2017, ISRR, section 3); clocks that run at
different rates are refused.
"""

import numpy as np

from flight import FloatArray, InputError, rotations

GRID_S = 0.005
SMOOTH_S = 0.04
"""Both rates are averaged over so long: poses of a milliradian of noise are differenced."""
LEAST_CORRELATION = 0.8
LEAST_LEAD = 0.05
"""Another shift, outside the best one's peak, is as likely if its correlation is not lower by so much."""
LEAST_COMMON_S = 5.0
MOST_DRIFT_S = 0.01
"""Between the offsets of the flight's two halves."""
LEAST_TURNING_RAD_S = 0.05


def offset_s(
    pose_time_s: FloatArray, q_world_body: FloatArray, gyro_time_s: FloatArray, rate_body_rad_s: FloatArray
) -> float:
    """Seconds to be added to the gyro's times so that they are in the clock of the poses.

    Args:
        pose_time_s: (n,), increasing; q_world_body: (n, 4).
        gyro_time_s: (m,), increasing; rate_body_rad_s: (m, 3).

    Raises:
        InputError: the flight is too short or turns too little, two shifts are about as likely, times do not increase,
            or the clocks drift apart.
    """
    for name, times in (("poses", pose_time_s), ("gyro", gyro_time_s)):
        if len(times) < 2 or not (np.diff(times) > 0.0).all():
            raise InputError(f"times of the {name} do not increase throughout; mend them before clocks are aligned")
    middle_s, turning = _of_attitudes(pose_time_s, q_world_body)
    poses, gyro = _on_grid(middle_s, turning), _on_grid(gyro_time_s, rate_body_rad_s)
    shortest = min(len(poses), len(gyro))
    if shortest * GRID_S < LEAST_COMMON_S or min(poses.std(), gyro.std()) < LEAST_TURNING_RAD_S:
        raise InputError(
            f"{shortest * GRID_S:.1f} s with body rates that change by {min(poses.std(), gyro.std()):.2f} rad/s do not "
            f"tell the clocks apart; at least {LEAST_COMMON_S:g} s and {LEAST_TURNING_RAD_S:g} rad/s are needed"
        )
    shifts, correlation = _correlations(poses, gyro)
    best = int(np.argmax(correlation))
    _require_clear(correlation, best)
    shift = shifts[best] + _between(correlation, best)
    _require_no_drift(poses, gyro, int(shifts[best]))
    return float(middle_s[0] - gyro_time_s[0] + GRID_S * shift)


def _require_no_drift(poses: FloatArray, gyro: FloatArray, shift: int) -> None:
    """Refuse halves of the common time, each long enough for an offset of its own, that differ in it."""
    first, last = max(0, shift), min(len(poses), len(gyro) + shift)
    middle, least = (first + last) // 2, 2.0 * LEAST_COMMON_S / GRID_S
    if last - first < least:
        return
    found = []
    for begin, end in ((first, middle), (middle, last)):
        a, b = poses[begin:end], gyro[begin - shift : end - shift]
        if min(a.std(), b.std()) < LEAST_TURNING_RAD_S:
            return
        shifts, correlation = _correlations(a, b)
        best = int(np.argmax(correlation))
        found.append(GRID_S * (shifts[best] + _between(correlation, best)))
    if abs(found[1] - found[0]) > MOST_DRIFT_S:
        raise InputError(
            f"the clocks' offset changes by {found[1] - found[0]:+.3f} s between the flight's halves, "
            f"beyond {MOST_DRIFT_S:g} s: they run at different rates; scale one's times"
        )


def _of_attitudes(time_s: FloatArray, q_world_body: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Instants between the poses (n - 1,), and the body rate there (n - 1, 3)."""
    step = rotations.log(rotations.multiply(rotations.conjugate(q_world_body[:-1]), q_world_body[1:]))
    return 0.5 * (time_s[1:] + time_s[:-1]), step / np.diff(time_s)[:, None]


def _on_grid(time_s: FloatArray, rate_body_rad_s: FloatArray) -> FloatArray:
    """Size of the averaged rate; the average is over an odd number of rows, so that it shifts nothing."""
    rows = 2 * round(0.5 * SMOOTH_S / float(np.median(np.diff(time_s)))) + 1
    mean = np.full(rows, 1.0 / rows)
    smooth = np.stack([np.convolve(rate_body_rad_s[:, axis], mean, "same") for axis in range(3)], axis=1)
    return np.interp(np.arange(time_s[0], time_s[-1], GRID_S), time_s, np.linalg.norm(smooth, axis=1))


def _correlations(poses: FloatArray, gyro: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Shifts of the gyro in steps of the grid, and the correlation where the two overlap, for overlaps long enough."""
    count = len(poses) + len(gyro) - 1

    def crossed(a: FloatArray, b: FloatArray) -> FloatArray:
        """Sums over i of a[i + shift] b[i], from shift -(len(b) - 1) on."""
        return np.fft.irfft(np.fft.rfft(a, count) * np.fft.rfft(b[::-1], count), count)

    ones = np.ones_like(poses), np.ones_like(gyro)
    common = np.maximum(np.rint(crossed(*ones)), 1.0)
    a, b = crossed(poses, ones[1]) / common, crossed(ones[0], gyro) / common
    var_a, var_b = crossed(poses**2, ones[1]) / common - a**2, crossed(ones[0], gyro**2) / common - b**2
    correlation: FloatArray = (crossed(poses, gyro) / common - a * b) / np.sqrt(np.maximum(var_a * var_b, 1e-12))
    long = common * GRID_S >= max(LEAST_COMMON_S, 0.5 * min(len(poses), len(gyro)) * GRID_S)
    shifts: FloatArray = np.arange(count, dtype=np.float64) - (len(gyro) - 1.0)
    return shifts[long], correlation[long]


def _require_clear(correlation: FloatArray, best: int) -> None:
    if not correlation[best] >= LEAST_CORRELATION:
        raise InputError(
            f"poses and gyro turn alike with a correlation of {correlation[best]:.2f} at best, below "
            f"{LEAST_CORRELATION:g}: are they of the same flight, and its poses' attitudes those of the body?"
        )
    near = correlation > correlation[best] - LEAST_LEAD
    peak = np.cumsum(~near) == np.cumsum(~near)[best]
    others = correlation[near & ~peak]
    if len(others):
        raise InputError(
            f"two offsets of the clocks are about as likely (correlations {correlation[best]:.3f} and "
            f"{others.max():.3f}); record take-off and landing with both, or turn irregularly for some seconds"
        )


def _between(correlation: FloatArray, best: int) -> float:
    """Where the parabola through the best shift and its neighbours has its top, in steps from the best."""
    if not 0 < best < len(correlation) - 1:
        return 0.0
    before, at, after = correlation[best - 1 : best + 2]
    bend = before - 2.0 * at + after
    return float(np.clip(0.5 * (before - after) / bend, -0.5, 0.5)) if bend < 0.0 else 0.0
