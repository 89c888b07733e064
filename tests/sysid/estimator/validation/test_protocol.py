"""Prediction by a protocol: what each predictor knows, what it learns, and how it does where the truth is known."""

import json
from dataclasses import replace

import numpy as np
import pytest

from flight import FlightLog, rotations
from flight.flight_log import COLUMNS
from sysid.estimator.flights.sampling import Signal
from sysid.estimator.options import Options
from sysid.estimator.prepare import prepare
from sysid.estimator.trajectory.states import States
from sysid.estimator.validation import carried, closed_loop
from sysid.estimator.validation.carried import Disturbance
from sysid.estimator.validation.closed_loop import LAG_S, ClosedLoop
from sysid.estimator.validation.prediction import Predictor, predict
from sysid.estimator.validation.protocol import ALONE, PROTOCOLS, Way, judge

STEP_S = 0.01


@pytest.fixture(scope="module")
def judged(campaign, truth):
    return judge(short(campaign), {"truth": truth}, PROTOCOLS["h50"])


def short(logs: list[FlightLog]) -> list[FlightLog]:
    return [log.slice(0.0, 8.0) for log in logs]


def rotors_late(log: FlightLog, late_s: float) -> FlightLog:
    speed = Signal.through(log.time_s, log.vector("rotor_speed_rad_s")).value(log.time_s - late_s)
    return FlightLog({**log.columns, **dict(zip(COLUMNS["rotor_speed_rad_s"], speed.T, strict=True))}, log.metadata)


def test_the_true_model_beats_every_trivial_one(judged):
    model = judged.pooled(Way("truth", "model", False))
    for trivial in (Way("", "held", False), Way("truth", "held", False), Way("truth", "held", True)):
        for quantity, error in judged.pooled(trivial).items():
            assert model[quantity] < 0.5 * error, (trivial.name, quantity)


def test_without_the_models_moment_the_rate_is_the_zero_models(judged):
    zero, held = Way("", "held", False), Way("truth", "held", False)
    assert judged.errors[zero]["rate"] == judged.errors[held]["rate"]
    assert judged.errors[zero]["attitude"] == judged.errors[held]["attitude"]


def test_a_flight_alone_says_what_is_left_out(campaign, truth):
    alone = judge(campaign[:1], {"truth": truth}, PROTOCOLS["h10"])
    assert ALONE in alone.findings
    assert not any(way.learned for way in alone.errors)
    taught = judge(campaign[:1], {"truth": truth}, PROTOCOLS["h10"], training=campaign[1:])
    assert any(way.learned for way in taught.errors)
    assert ALONE not in taught.findings


def test_flights_without_velocity_or_gyro_are_named_and_an_empty_column_is_none(campaign, truth):
    log = campaign[0].slice(0.0, 6.0)
    time_s, n = log.time_s, len(log)
    true = {
        "velocity_world_m_s": np.gradient(log.vector("position_world_m"), time_s, axis=0),
        "rate_body_rad_s": np.zeros((n, 3)),
    }
    empty = {quantity: np.full((n, 3), np.nan) for quantity in true}

    def findings(vectors: dict[str, np.ndarray]) -> tuple[str, ...]:
        more = {name: v[:, i] for q, v in vectors.items() for i, name in enumerate(COLUMNS[q])}
        logs = [FlightLog({**log.columns, **more}, {})]
        return tuple(f for f in judge(logs, {"truth": truth}, PROTOCOLS["h10"]).findings if f != ALONE)

    assert findings(true) == ()
    (neither,) = findings(empty)
    assert "velocity and rate not measured" in neither
    (no_velocity,) = findings({**true, "velocity_world_m_s": empty["velocity_world_m_s"]})
    assert "velocity not measured" in no_velocity


def test_every_state_with_a_past_and_a_horizon_is_a_start(judged, campaign):
    flights = [f for i, log in enumerate(short(campaign)) for f in prepare(log, i, Options())]
    for flight, starts in zip(flights, judged.starts, strict=True):
        step_s = float(np.median(flight.step_s))
        assert starts == len(flight) - round(0.2 / step_s) - round(0.5 / step_s)


def test_figures_are_json(judged):
    facts = json.loads(json.dumps(judged.as_dict(), allow_nan=False))
    assert facts["protocol"] == "h50"
    assert {p["name"] for p in facts["predictors"]} >= {"zero", "truth", "truth, rate held"}
    assert set(facts["predictors"][0]["error_mean"]) == {"position_m", "velocity_m_s", "attitude_rad", "rate_rad_s"}


def test_a_missing_torque_is_carried_from_the_past(campaign, truth):
    """A centre of mass that the model does not know is a lasting moment: carried on, most of its error is gone."""
    wrong = truth.with_value("centre_of_mass.y_m", truth.value("centre_of_mass.y_m") + 0.004)
    found = judge(short(campaign), {"wrong": wrong}, PROTOCOLS["h50"])
    open_loop, carrying = (found.pooled(Way("wrong", "model", past)) for past in (False, True))
    assert carrying["rate"] < 0.5 * open_loop["rate"]
    assert carrying["attitude"] < 0.5 * open_loop["attitude"]


def random_states(rng: np.random.Generator, n: int) -> States:
    q = rotations.exp(0.4 * rng.standard_normal((n, 3)))
    return States(rng.standard_normal((n, 3)), rng.standard_normal((n, 3)), q, rng.standard_normal((n, 3)))


def still_flight(campaign, n: int, step_s: float):
    """A stretch of a flight with evenly spaced nodes, whose readings nothing here looks at."""
    flight = prepare(campaign[0], 0, Options())[0]
    return replace(
        flight,
        time_s=step_s * np.arange(n),
        rotor_speed_rad_s=flight.rotor_speed_rad_s[: n - 1],
        rotor_acceleration_rad_s2=flight.rotor_acceleration_rad_s2[: n - 1],
    )


def test_the_law_of_a_closed_loop_is_recovered(campaign):
    law = ClosedLoop(4.0, 9.0, 1.5, 3.0)
    rng = np.random.default_rng(1)
    at = random_states(rng, 200)
    rate = at.rate_body_rad_s.copy()
    for k in range(199):
        before = replace(at.picked(slice(k, k + 1)), rate_body_rad_s=rate[k : k + 1])
        rate[k + 1] = rate[k] + LAG_S * law.angular_acceleration(before)[0]
    flight = still_flight(campaign, 200, LAG_S)
    found = closed_loop.learn([flight], [replace(at, rate_body_rad_s=rate)])
    for name in ClosedLoop.__slots__:
        assert getattr(found, name) == pytest.approx(getattr(law, name), rel=1e-9)


def test_a_closed_loop_levels_and_brakes():
    law = ClosedLoop(0.0, 1.0, 1.0, 0.0)
    rolled = rotations.exp(np.array([[0.2, 0.0, 0.0]]))
    still = States(np.zeros((1, 3)), np.zeros((1, 3)), rolled, np.zeros((1, 3)))
    assert law.angular_acceleration(still)[0, 0] < 0.0  # rolled to the right: it rolls back
    forward = States(np.zeros((1, 3)), np.array([[1.0, 0.0, 0.0]]), rotations.exp(np.zeros((1, 3))), np.zeros((1, 3)))
    assert law.angular_acceleration(forward)[0, 1] < 0.0  # flies forward: the nose rises


def gauss_markov(rng: np.random.Generator, n: int, size: float, lasts_s: float) -> np.ndarray:
    keep = np.exp(-STEP_S / lasts_s)
    found = np.zeros(n)
    for k in range(1, n):
        found[k] = keep * found[k - 1] + size * np.sqrt(1.0 - keep**2) * rng.standard_normal()
    return found


def test_size_and_duration_of_a_disturbance_are_learned():
    rng = np.random.default_rng(3)
    n = 30_000
    lasting = np.stack([gauss_markov(rng, n, 2.0, 0.6) for _ in range(6)], axis=1)
    left = lasting + 5.0 * rng.standard_normal((n, 6))
    found = carried.learn([left], [np.linspace(0.0, STEP_S * n, n)])
    np.testing.assert_allclose(found.size, 2.0, rtol=0.2)
    np.testing.assert_allclose(found.lasts_s, 0.6, rtol=0.35)
    np.testing.assert_allclose(found.white, 5.0 * np.sqrt(STEP_S), rtol=0.15)
    known = found.just_before(left, STEP_S)[:-1]
    error = np.sqrt(((known - lasting) ** 2).mean())
    assert error < 0.75 * 2.0  # less than not knowing it


def test_what_is_known_before_an_instant_does_not_hang_on_what_follows():
    rng = np.random.default_rng(4)
    disturbance = Disturbance(np.full(6, 2.0), np.full(6, 0.5), np.full(6, 0.3))
    left = rng.standard_normal((100, 6))
    other = left.copy()
    other[60:] += 10.0
    first, second = disturbance.just_before(left, STEP_S), disturbance.just_before(other, STEP_S)
    np.testing.assert_array_equal(first[:61], second[:61])
    assert np.abs(first[61] - second[61]).max() > 0.1


def test_a_carried_disturbance_acts_and_fades(campaign):
    n, lasts_s = 101, 0.4
    flight = still_flight(campaign, n, STEP_S)
    zero = np.zeros((n, 3))
    start = States(zero, zero, rotations.exp(zero), zero, np.tile([1.0, 0.0, 0.0, 0.0, 0.0, 2.0], (n, 1)))
    predictor = Predictor(None, None, lasts_s=np.full(6, lasts_s))
    found = predict(flight, start, predictor, (0.5,), every_s=0.0).states[0]
    gained = lasts_s * (1.0 - np.exp(-0.5 / lasts_s))
    np.testing.assert_allclose(found.velocity_world_m_s[:, 0], gained, rtol=2e-4)
    np.testing.assert_allclose(found.rate_body_rad_s[:, 2], 2.0 * gained, rtol=2e-4)
    assert found.gust is not None
    np.testing.assert_allclose(found.gust[:, 0], np.exp(-0.5 / lasts_s))


def test_the_velocity_of_the_log_is_taken_for_true(campaign, truth):
    log = campaign[1]
    fast = {f"velocity_world_{axis}_m_s": np.full(len(log.time_s), 3.0) for axis in "xyz"}
    plain, told = (
        judge([one], {"truth": truth}, PROTOCOLS["h10"]).pooled(Way("", "held", False))
        for one in (log, FlightLog({**log.columns, **fast}, log.metadata))
    )
    assert told["velocity"] < 0.1 * plain["velocity"]  # what is left is the lever arm of the pose sensor


def test_what_is_carried_does_not_know_what_is_blind():
    rng = np.random.default_rng(3)
    fading = Disturbance(np.ones(6), np.full(6, 0.4), np.full(6, 0.1))
    left, k = rng.standard_normal((80, 6)), 50
    other = np.concatenate([left[:k], 10.0 + rng.standard_normal((30, 6))])
    for blind in (0, 7):
        seen, changed = (fading.just_before(x, STEP_S, blind * STEP_S) for x in (left, other))
        np.testing.assert_array_equal(seen[: k + blind + 1], changed[: k + blind + 1])
        assert not np.allclose(seen[k + blind + 1], changed[k + blind + 1])
        np.testing.assert_allclose(
            seen[blind:], fading.just_before(left, STEP_S)[: 81 - blind] * np.exp(-blind * STEP_S / 0.4)
        )


def test_late_rotor_speed_costs_nothing(judged, campaign, truth):
    """Delays are estimated here too: 15 ms would lose most of what the model knows of turning."""
    late = [rotors_late(log, 0.015) for log in short(campaign)]
    found = judge(late, {"truth": truth}, PROTOCOLS["h50"])
    way = Way("truth", "model", False)
    for quantity, error in judged.pooled(way).items():
        assert found.pooled(way)[quantity] < 1.1 * error, quantity
