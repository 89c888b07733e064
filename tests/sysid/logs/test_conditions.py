"""What a log shows of the conditions: known gaps and noise come back, and what it does not show is not told."""

import numpy as np
import pytest

from flight import flight_log, rotations
from sysid.logs import conditions

RATE_HZ, SECONDS = 200, 60.0
POSITION_M, ATTITUDE_RAD, GYRO_RAD_S = 0.003, 0.004, 0.02


def flown(rng: np.random.Generator, gap_s: float = 0.3, gaps_per_s: float = 0.2) -> tuple[dict, float, int]:
    """Columns of a flight along a lively curve, with gaps at random moments; the time missing; their number."""
    time_s = np.arange(0.0, SECONDS, 1.0 / RATE_HZ)
    n = len(time_s)
    curve = np.stack([2.0 * np.sin(1.1 * time_s), 1.5 * np.cos(0.9 * time_s), 1.0 + 0.3 * np.sin(time_s)], axis=1)
    turn = np.stack([0.3 * np.sin(2.0 * time_s), 0.3 * np.cos(1.7 * time_s), 0.2 * time_s], axis=1)
    position = curve + rng.normal(0.0, POSITION_M, (n, 3))
    q = rotations.multiply(rotations.exp(turn), rotations.exp(rng.normal(0.0, ATTITUDE_RAD, (n, 3))))
    rate = np.gradient(turn, time_s, axis=0) + rng.normal(0.0, GYRO_RAD_S, (n, 3))
    lost, until_s, count = np.zeros(n, dtype=bool), 0.0, 0
    for i in range(1, n - 1):
        if time_s[i] >= until_s and rng.random() < gaps_per_s / RATE_HZ and time_s[i] + gap_s < SECONDS - 0.1:
            until_s, count = time_s[i] + gap_s - 1e-6, count + 1
        lost[i] = time_s[i] < until_s
    position[lost], q[lost] = np.nan, np.nan
    return {"time": time_s, "position_world_m": position, "q_world_body": q, "rate_body_rad_s": rate}, lost, count


def log_of(vectors: dict, **scalars) -> flight_log.FlightLog:
    given = dict(vectors)
    return flight_log.from_vectors(given.pop("time"), given, scalars=scalars)


def held(vectors: dict) -> dict:
    """The same where the last pose comes again in a gap."""
    filled = dict(vectors)
    for name in ("position_world_m", "q_world_body"):
        known = np.isfinite(filled[name][:, 0])
        filled[name] = filled[name][np.maximum.accumulate(np.where(known, np.arange(len(known)), 0))]
    return filled


def without_rows(vectors: dict) -> dict:
    known = np.isfinite(vectors["position_world_m"][:, 0])
    return {name: values[known] for name, values in vectors.items()}


@pytest.mark.parametrize("gap_s", [0.1, 0.3])
@pytest.mark.parametrize("shape", [dict, held, without_rows])
def test_known_gaps_and_noise_come_back(shape, gap_s):
    vectors, lost, count = flown(np.random.default_rng(3), gap_s)
    found = conditions.of_logs([log_of(shape(vectors))])
    assert found.gaps == count > 4
    assert found.gap_s == pytest.approx(gap_s, abs=0.001)
    assert found.gaps_per_s == pytest.approx(count / (SECONDS - lost.sum() / RATE_HZ), rel=0.1)
    assert found.position_std_m == pytest.approx(POSITION_M, rel=0.2)
    assert found.attitude_std_rad == pytest.approx(ATTITUDE_RAD, rel=0.2)
    assert found.rate_std_rad_s == pytest.approx(GYRO_RAD_S, rel=0.2)


def test_one_missing_pose_is_no_gap_and_jitter_is_none():
    rng = np.random.default_rng(5)
    vectors, _, _ = flown(rng, gaps_per_s=0.0)
    vectors["time"] = vectors["time"] + rng.uniform(0.0, 0.3 / RATE_HZ, len(vectors["time"]))
    vectors["position_world_m"][::50] = np.nan
    found = conditions.of_logs([log_of(vectors)])
    assert (found.gaps, found.gaps_per_s, found.gap_s) == (0, 0.0, None)


def test_unlike_gaps_miss_as_much_time_and_the_long_ones_count_for_more():
    vectors, _, _ = flown(np.random.default_rng(1), gaps_per_s=0.0)
    lost = np.zeros(len(vectors["time"]), dtype=bool)
    for start_s, length_s in ((5.0, 0.05), (15.0, 0.05), (25.0, 0.05), (35.0, 1.0)):
        lost |= (vectors["time"] >= start_s - 1e-6) & (vectors["time"] < start_s + length_s - 1e-6)
    vectors["position_world_m"][lost] = np.nan
    found = conditions.of_logs([log_of(vectors)])
    assert found.gaps == 4
    assert found.gap_s > 0.8
    missing = found.gaps_per_s * found.gap_s / (1.0 + found.gaps_per_s * found.gap_s)
    assert missing == pytest.approx(lost.mean(), rel=0.05)


def test_dead_reckoned_rows_of_an_on_board_log_are_a_gap():
    vectors, _, _ = flown(np.random.default_rng(2), gaps_per_s=0.0)
    into_s = vectors["time"] - 20.0
    reckoned_s = np.where((into_s > conditions.CARRIED_S) & (into_s < 0.4), into_s - conditions.CARRIED_S, 0.0)
    found = conditions.of_logs([log_of(vectors, reckoning_s=reckoned_s)])
    assert found.gaps == 1
    assert found.gap_s == pytest.approx(0.4, rel=0.05)


def test_what_a_log_does_not_show_is_not_told():
    vectors, _, _ = flown(np.random.default_rng(4))
    gyro = log_of({name: vectors[name] for name in ("time", "rate_body_rad_s")})
    found = conditions.of_logs([gyro])
    assert found.rate_std_rad_s == pytest.approx(GYRO_RAD_S, rel=0.2)
    assert (found.gaps, found.gaps_per_s, found.gap_s) == (None, None, None)
    assert found.position_std_m is None
    assert found.attitude_std_rad is None
    short = {name: values[:30] for name, values in vectors.items()}
    assert conditions.of_logs([log_of(short)]) == conditions.Conditions(0.0)


def test_the_noisiest_of_two_flights_is_told():
    quiet, _, _ = flown(np.random.default_rng(6))
    loud = dict(quiet, rate_body_rad_s=quiet["rate_body_rad_s"] * 3.0)
    both = conditions.of_logs([log_of(quiet), log_of(loud)])
    assert both.rate_std_rad_s == conditions.of_logs([log_of(loud)]).rate_std_rad_s
    assert both.position_std_m == pytest.approx(POSITION_M, rel=0.2)
