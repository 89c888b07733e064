"""Stretches on the ground and blows are found, whatever is logged, and a flight in the air has none."""

from functools import cache

import numpy as np
import pytest

import vehicle
from flight import FlightLog, InputError
from flight.flight_log import COLUMNS, from_vectors
from sysid import Options, compare, judge, wrench_errors
from sysid.estimator.prepare import prepare
from sysid.estimator.validation.protocol import PROTOCOLS
from sysid.logs.check import check_log
from sysid.logs.checks import contact
from tests.sysid import flying

RATE_HZ, GRAVITY = 200.0, 9.80665
STANDS_S, FLIES_S = 3.0, 8.0


@cache
def flown(gyro_noise_rad_s: float | None = None) -> FlightLog:
    rng = np.random.default_rng(1)
    truth, paths = flying.Truth(gust=0.1), flying.paper_flights(rng)
    return flying.fly(truth, paths, 3, duration_s=FLIES_S, rng=rng, gyro_noise_rad_s=gyro_noise_rad_s)[1]


def standing(seconds: float, rng: np.random.Generator, *, resting: tuple[float, float, float] = (0.0, 0.0, 1.0)):
    """Rotors idle, the ground carries the vehicle, the pose stands still."""
    n = round(seconds * RATE_HZ)
    vectors = {
        "position_world_m": 1e-3 * rng.standard_normal((n, 3)),
        "q_world_body": np.tile([1.0, 0.0, 0.0, 0.0], (n, 1)),
        "rotor_speed_rad_s": 150.0 + rng.standard_normal((n, 4)),
        "rotor_speed_command_rad_s": np.full((n, 4), 150.0),
        "specific_force_body_m_s2": GRAVITY * np.tile(resting, (n, 1)) + 0.1 * rng.standard_normal((n, 3)),
    }
    return from_vectors(np.arange(n) / RATE_HZ, vectors)


def with_accelerometer(log: FlightLog, rng: np.random.Generator) -> FlightLog:
    """Specific force by the rotors alone, and some drag."""
    force = np.zeros((len(log), 3))
    force[:, 2] = GRAVITY * (log.vector("rotor_speed_rad_s") ** 2).mean(axis=1) / 950.0**2
    force += 0.5 * rng.standard_normal((len(log), 3))
    return FlightLog({**log.columns, **dict(zip(COLUMNS["specific_force_body_m_s2"], force.T, strict=True))}, {})


def joined(*logs: FlightLog) -> FlightLog:
    columns: dict[str, list[np.ndarray]] = {
        name: [] for name in logs[0].columns if all(name in g.columns for g in logs)
    }
    start_s = 0.0
    for log in logs:
        for name in columns:
            columns[name].append(log.columns[name] + (start_s if name == "time_s" else 0.0))
        start_s = float(columns["time_s"][-1][-1]) + 1.0 / RATE_HZ
    return FlightLog({name: np.concatenate(parts) for name, parts in columns.items()}, {})


def only(log: FlightLog, *quantities: str) -> FlightLog:
    kept = {"time_s", *(name for q in quantities for name in COLUMNS[q])}
    return FlightLog({name: values for name, values in log.columns.items() if name in kept}, {})


POSE = ("position_world_m", "q_world_body", "rotor_speed_rad_s")
IMU = ("specific_force_body_m_s2", "rotor_speed_command_rad_s")


@pytest.mark.parametrize("logged", [POSE, IMU, (*POSE, "specific_force_body_m_s2")])
def test_a_flight_in_the_air_touches_nothing(logged):
    rng = np.random.default_rng(2)
    assert contact.spans(only(with_accelerometer(flown(), rng), *logged)) == ()


@pytest.mark.parametrize("turning", [("q_world_body",), ("rate_body_rad_s",), ("q_world_body", "rate_body_rad_s")])
@pytest.mark.parametrize("begin_s", [1.0, 2.5, 4.0])
def test_a_position_frozen_in_flight_is_no_ground(turning, begin_s):
    """Rotors dip below half the weight in a quick flight; what turns meanwhile does not stand."""
    log = only(flown(0.02), "position_world_m", "rotor_speed_rad_s", *turning)
    still = (log.time_s >= begin_s) & (log.time_s <= begin_s + 3.0)
    columns = {name: values.copy() for name, values in log.columns.items()}
    for name in (*COLUMNS["position_world_m"], *COLUMNS["rotor_speed_rad_s"]):
        columns[name][still] = columns[name][still][0]
    for name in COLUMNS["rotor_speed_rad_s"]:
        columns[name][(log.time_s > begin_s + 1.0) & (log.time_s < begin_s + 2.0)] *= 0.6
    assert contact.spans(FlightLog(columns, {})) == ()


@pytest.mark.parametrize("logged", [POSE, IMU, (*POSE, "specific_force_body_m_s2")])
def test_standing_before_and_after_is_found_with_a_margin(logged):
    rng = np.random.default_rng(3)
    aloft = with_accelerometer(flown(), rng)
    log = only(joined(standing(STANDS_S, rng), aloft, standing(STANDS_S, rng)), *logged)
    first, last = contact.spans(log)
    assert first[0] == log.time_s[0]
    assert STANDS_S - 0.3 < first[1] < STANDS_S + 1.0
    assert STANDS_S + FLIES_S - 1.0 < last[0] < STANDS_S + FLIES_S + 0.3
    assert last[1] == log.time_s[-1]


@pytest.mark.parametrize("resting", [(0.0, 0.0, -1.0), (0.0, 1.0, 0.0)])
def test_lying_on_its_back_or_side_is_contact(resting):
    rng = np.random.default_rng(4)
    log = joined(with_accelerometer(flown(), rng), standing(STANDS_S, rng, resting=resting))
    (span,) = contact.spans(only(log, *IMU))
    assert span[0] == pytest.approx(FLIES_S, abs=0.5)


def test_a_blow_is_left_out_and_free_fall_is_not():
    rng = np.random.default_rng(5)
    log = with_accelerometer(flown(), rng)
    force = log.columns["specific_force_body_z_m_s2"].copy()
    force[799:802] = 8.0 * GRAVITY
    (span,) = contact.spans(FlightLog({**log.columns, "specific_force_body_z_m_s2": force}, {}))
    assert span == pytest.approx((4.0 - 0.3, 4.0 + 0.3), abs=0.011)
    falling = standing(1.0, rng, resting=(0.0, 0.0, 0.02))
    assert contact.spans(only(joined(log, falling, log), *IMU)) == ()


def test_fits_leave_contact_out_and_say_so():
    rng = np.random.default_rng(6)
    log = only(joined(standing(STANDS_S, rng), flown()), *POSE)
    (flight,) = prepare(log, 0, Options())
    assert flight.time_s[0] > STANDS_S - 0.3
    assert "left out: 0.0 to 3" in flight.left_out
    assert [f.what for f in check_log(log).findings if f.what == "contact"] == ["contact"]
    models = {"truth": vehicle.example("rigter2019")}
    assert compare([log], models).left_out == (flight.left_out,)
    assert wrench_errors([log], models).left_out == (flight.left_out,)
    assert flight.left_out in judge([log], models, PROTOCOLS["h10"]).findings
    with pytest.raises(InputError, match="no stretch of 1 s in the air is left"):
        prepare(only(joined(standing(4.0, rng), flown().slice(0.0, 0.8)), *POSE), 0, Options(gaps="split"))


def test_rotors_that_read_zero_on_the_ground_are_at_rest_and_not_frozen():
    """A log that begins before arming: nothing is to be mended, and a fit takes it as it is."""
    rng = np.random.default_rng(8)
    waiting = standing(3.0 * FLIES_S, rng)
    still = {name: np.zeros(len(waiting)) for name in COLUMNS["rotor_speed_rad_s"]}
    log = only(joined(FlightLog({**waiting.columns, **still}, {}), flown()), *POSE)
    (said,) = (f for f in check_log(log, vehicle.example("rigter2019")).findings if "rotor" in f.sentence)
    assert said.what == "at rest"
    assert said.repair is None
    (flight,) = prepare(log, 0, Options())
    assert flight.time_s[0] > 3.0 * FLIES_S - 0.3
    lost = {name: np.where(np.abs(log.time_s - 28.0) < 1.0, 0.0, log.columns[name]) for name in still}
    found = check_log(FlightLog({**log.columns, **lost}, {})).findings
    assert [f.what for f in found if "rotor_speed_rad_s repeats" in f.sentence] == ["frozen"]


def test_a_log_in_microseconds_is_looked_at_without_the_pose():
    log = only(flown(), *POSE)
    assert contact.spans(FlightLog({**log.columns, "time_s": 1e6 * log.time_s}, {})) == ()


def test_vibration_and_a_single_bad_sample_are_no_blow():
    rng = np.random.default_rng(7)
    n = round(10.0 * RATE_HZ)
    calm = GRAVITY * np.tile([0.0, 0.0, 1.0], (n, 1)) + 0.1 * rng.standard_normal((n, 3))
    spike = calm.copy()
    spike[n // 2] = [0.0, 80.0, 160.0]
    for force in (calm, spike, calm + 10.0 * rng.standard_normal((n, 3))):
        vectors = {"rotor_speed_rad_s": np.full((n, 4), 950.0), "specific_force_body_m_s2": force}
        assert contact.spans(from_vectors(np.arange(n) / RATE_HZ, vectors)) == ()
