"""A controller answers its gyro's noise: that makes no good gyro late, and hides no late one."""

from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

import vehicle
from flight import FlightLog, rotations
from flight.flight_log import COLUMNS
from sysid import Options, identify
from sysid.estimator.flights.clocks import Clock
from sysid.estimator.flights.sampling import Signal
from sysid.logs.check import check_log
from sysid.logs.checks import clocks, gyro_clock
from sysid.logs.checks.finding import Finding
from sysid.logs.checks.motion import kinematics
from sysid.logs.fix import fix
from vehicle import flights, manoeuvres

NOISE_RAD_S = (0.02, 0.05, 0.1, 0.2)
PERIOD_S = 0.005


@pytest.fixture(scope="module")
def noisy() -> list[FlightLog]:
    """Twelve flights, a path and a noise of the gyro each; the controller reads gyro and attitude with their noise."""
    return [log for i, name in enumerate(("oblique", "yaw_sweep", "vertical_weave")) for log in _flown(name, i)]


def _flown(name: str, seed: int) -> list[FlightLog]:
    own, path, rng = vehicle.example(), manoeuvres.make(name), np.random.default_rng(seed)
    count = len(NOISE_RAD_S)
    rate_noise = np.array(NOISE_RAD_S)[:, None] * rng.normal(size=(2400, count, 3))
    tilt_noise = rotations.exp(0.001 * rng.normal(size=(2400, count, 3)))
    tracker = vehicle.tracking.Tracker(own, path, PERIOD_S)
    start = vehicle.simulate.hovering(own, path.evaluate(np.zeros(1))[0, :3])
    fleet = vehicle.simulate.Fleet(own, [start] * count)

    def answer(flown: vehicle.simulate.Fleet) -> np.ndarray:
        k = round(flown.time_s / PERIOD_S)
        read = {name: getattr(flown, name) for name in ("time_s", "position_world_m", "velocity_world_m_s")}
        read["rate_body_rad_s"] = flown.rate_body_rad_s + rate_noise[k]
        read["q_world_body"] = rotations.multiply(flown.q_world_body, tilt_noise[k])
        return tracker(cast("Any", SimpleNamespace(**read)))

    truth = flights.fly(fleet, answer, min(12.0, path.duration_s), period_s=PERIOD_S)
    quiet = flights.Noise(attitude_rad=0.0, gyroscope_rad_s=0.0)
    logs = []
    for i in range(count):
        log = flights.measure(truth, noise=quiet, rng=rng, member=i)
        log = _with(log, "rate_body_rad_s", log.vector("rate_body_rad_s") + rate_noise[: len(log), i])
        q = rotations.multiply(log.vector("q_world_body"), tilt_noise[: len(log), i])
        logs.append(_with(log, "q_world_body", q))
    return logs


def _with(log: FlightLog, quantity: str, values: np.ndarray) -> FlightLog:
    return FlightLog({**log.columns, **dict(zip(COLUMNS[quantity], values.T, strict=True))}, log.metadata)


def _late(log: FlightLog, late_s: float) -> FlightLog:
    gyro = Signal.through(log.time_s, log.vector("rate_body_rad_s"))
    return _with(log, "rate_body_rad_s", gyro.value(log.time_s - late_s))


def _offsets(log: FlightLog) -> tuple[clocks.Offset, clocks.Offset]:
    """By instrumental variables, and compared plainly."""
    motion = kinematics(log)
    assert motion is not None
    return gyro_clock.after_attitude(log, motion), gyro_clock.compared_plainly(log, motion)


def test_no_good_gyro_is_named_or_shifted(noisy):
    for log in noisy:
        assert not [f for f in check_log(log).findings if f.what == "clock"]
        assert not [sentence for sentence in fix(log).done if "shifted" in sentence]


@pytest.mark.parametrize("late_ms", [2.0, pytest.param(-5.0, marks=pytest.mark.slow), 8.0])
def test_planted_offsets_come_back_or_are_called_inconclusive(noisy, late_ms):
    found = 0
    for log in noisy:
        offset, plain = _offsets(_late(log, 1e-3 * late_ms))
        assert abs(offset.delay_s - 1e-3 * late_ms) <= gyro_clock.SIGMAS * offset.sigma_s
        named, inconclusive = gyro_clock.findings(offset, plain)
        assert named or inconclusive
        found += bool(named)
    assert found >= len(noisy) // 2


def test_a_sensor_that_is_turned_on_the_vehicle_moves_no_clock(noisy):
    """Turned by 2 degrees about z, roll and pitch mix; on a curved path that looks like a delay."""
    turn = rotations.exp(np.array([0.0, 0.0, np.deg2rad(2.0)]))
    for log in noisy:
        turned = _with(log, "q_world_body", rotations.multiply(log.vector("q_world_body"), turn))
        assert not gyro_clock.findings(*_offsets(turned))[0]


def _fitted(log: FlightLog) -> Clock:
    fit = identify([log], vehicle.example(), Options(gusts="white", node_rate_hz=100.0))
    return next(clock for clock in fit.clocks if clock.stream == "gyro")


@pytest.mark.parametrize("number", [1, 7, *(pytest.param(number, marks=pytest.mark.slow) for number in (2, 3, 11))])
def test_a_fit_calls_no_good_gyro_late(noisy, number):
    """Whose delay it finds 4 to 7 ms late on these five flights, and knew to 0.6 to 1.3 ms without the instruments."""
    found = _fitted(noisy[number])
    assert found.delay_s > 3e-3
    assert found.delay_s < 2.0 * found.std_robust
    assert not found.off


@pytest.mark.parametrize(
    ("number", "late_ms"),
    [
        (4, -5.0),
        (8, 5.0),
        *(pytest.param(*case, marks=pytest.mark.slow) for case in ((4, 5.0), (5, -5.0), (5, 5.0), (8, -5.0))),
    ],
)
def test_a_fit_still_finds_a_late_gyro_where_the_flight_shows_its_clock(noisy, number, late_ms):
    found = _fitted(_late(noisy[number], 1e-3 * late_ms))
    assert found.off
    assert abs(found.delay_s - 1e-3 * late_ms) < max(3e-4, 3.0 * found.std_robust)


def test_a_calm_flight_with_a_very_noisy_gyro_is_inconclusive(noisy):
    report = check_log(noisy[NOISE_RAD_S.index(0.2)])
    assert [sentence for sentence in report.inconclusive if sentence.startswith("the gyro's clock")]


def test_a_plain_comparison_makes_good_gyros_late_and_none_early(noisy):
    plain = [_offsets(log)[1] for log in noisy]
    assert all(offset.delay_s > -gyro_clock.SIGMAS * offset.sigma_s for offset in plain)
    assert max(offset.delay_s for offset in plain) > 8e-3


def test_what_is_inconclusive_is_told_with_the_plain_comparison_and_what_that_is_worth(noisy):
    """The second flight predicts little of its turns."""
    for late_ms, worth in ((-5.0, "can only hide"), (5.0, "may be the cause")):
        named, (said,) = gyro_clock.findings(*_offsets(_late(noisy[1], 1e-3 * late_ms)))
        assert not named
        assert "Compared plainly it is" in said
        assert worth in said


@pytest.mark.parametrize("late_ms", [-60.0, pytest.param(40.0, marks=pytest.mark.slow), 80.0])
def test_a_gyro_further_off_than_any_controller_makes_it_is_named_and_shifted(noisy, late_ms):
    """Where little is predicted, too: a calm flight with noise of 0.05 rad/s had its rotor speed shifted by 88 ms."""
    for log in noisy:
        late = _late(log, 1e-3 * late_ms)
        named, _ = gyro_clock.findings(*_offsets(late))
        assert len(named) == 1
        done = fix(late, vehicle.example()).done
        assert done[0].startswith("the gyro is")
        assert not [said for said in done if said.startswith("rotor speed is") and float(said.split()[3]) > 20.0]


def _rotors(log: FlightLog) -> list[Finding]:
    motion = kinematics(log)
    assert motion is not None
    return clocks.of_rotors(log, motion, vehicle.example(), gyro_is_sure=False)


def test_rotor_speed_is_not_shifted_to_a_gyro_whose_own_clock_is_not_known(noisy):
    """The gyro is late and rotor speed is not: the attitude does not confirm what the gyro says of it."""
    (said,) = _rotors(_late(noisy[8], 0.012))
    assert said.sentence.endswith("against the gyro")
    assert said.repair is None


@pytest.mark.parametrize("number", [2, 8, 9, 11])
def test_late_rotor_speed_that_the_attitude_shows_too_is_shifted_even_then(noisy, number):
    log = noisy[number]
    speed = Signal.through(log.time_s, log.vector("rotor_speed_rad_s"))
    (said,) = _rotors(_with(log, "rotor_speed_rad_s", speed.value(log.time_s - 0.02)))
    assert said.repair is not None
    assert said.repair.shift_s == pytest.approx(-0.02, abs=1.5e-3)


def test_each_part_is_predicted_by_a_regression_on_the_others():
    rng = np.random.default_rng(0)
    earlier = rng.standard_normal((400, 5)) @ rng.standard_normal((5, 5))
    now = earlier[:, :2] + rng.standard_normal((400, 2))
    told = np.empty_like(now)
    for part in np.array_split(np.arange(400), gyro_clock.PARTS):
        others = np.delete(np.arange(400), part)
        told[part] = earlier[part] @ np.linalg.lstsq(earlier[others], now[others], rcond=None)[0]
    np.testing.assert_allclose(gyro_clock._predicted(earlier, now), told - told.mean(axis=0), atol=1e-9)
