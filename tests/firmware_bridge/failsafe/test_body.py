"""The judge is judged first: known answers for the body, its air, its floor, its sensors."""

import numpy as np
import pytest
from harness import load
from scenario import FROM_START, TABLE, TAKE_OFF, Command, Fault, Kind, Loss, Order, Scenario, State, circle, land

import vehicle
from vehicle import dynamics

FREE_FALL = (Order(Command.ARM, 0, 0.3, FROM_START), Order(Command.KILL, 0, 1.0))


def test_hover_is_at_the_papers_rotor_speed(body):
    weight_n = 4 * body.rotor_thrust_n(9085 * 2 * np.pi / 60, 0.0, 0.0)
    assert weight_n == pytest.approx(0.7 * 9.80665, rel=2e-3)


@pytest.mark.parametrize("climb_m_s", [-2.0, 0.0, 3.0])
@pytest.mark.parametrize("lateral_m_s", [0.0, 5.0, 10.0])
def test_thrust_agrees_with_the_vehicle_package_that_shares_no_code(body, climb_m_s, lateral_m_s):
    truth = vehicle.example("rigter2019")
    air = np.array([[lateral_m_s, 0.0, climb_m_s]])
    for speed in (600.0, 951.0, 1500.0):
        force, _ = dynamics.wrench(truth, air, np.zeros((1, 3)), np.full((1, 4), speed))
        thrust_n = force[0, 2] + 0.0185 * abs(climb_m_s) * climb_m_s  # without the parasitic drag
        assert 4 * body.rotor_thrust_n(speed, climb_m_s, lateral_m_s) == pytest.approx(thrust_n, rel=1e-4)


def test_thrust_falls_with_climb_and_grows_with_sink(body):
    thrust = [body.rotor_thrust_n(951.0, v_z, 0.5) for v_z in np.linspace(-8, 8, 161)]
    assert (np.diff(thrust) < 1e-4).all()


def test_a_fall_meets_the_floor_at_the_speed_that_physics_says(body):
    kill = Order(Command.KILL, after_s=1.0)
    flight = body.fly(Scenario(orders=(*TAKE_OFF, kill), vehicle={"rotor_lag_s": 0.001}))
    assert flight.first_touchdown_m_s == pytest.approx(np.sqrt(2 * 9.80665 * 1.5), rel=0.03)
    assert flight.stop_clearance_m == pytest.approx(1.5, abs=0.05)
    assert flight.at_rest


def test_it_rests_on_a_slope_below_friction_and_slides_above(body):
    def slid_m(slope: float) -> float:
        flight = body.fly(Scenario(orders=(), world={"slope": (slope, 0.0)}, limit_s=4.0), trace_every=10)
        return abs(flight.trace["x"][-1] - flight.trace["x"][0])

    assert slid_m(0.3) < 0.03
    assert slid_m(1.0) > 1.0


def test_the_plate_is_a_table_and_the_floor_is_beside_it(body):
    flight = body.fly(Scenario(orders=(), world=TABLE | {"floor_m": -0.75}, limit_s=1.0), trace_every=10)
    assert flight.trace["z"][-1] == pytest.approx(0.0, abs=0.005)
    pushed = Fault(Kind.KICK, (2.0, 0.0, 1.0), after_s=0.2, since=FROM_START)
    flight = body.fly(Scenario(orders=(), world=TABLE | {"floor_m": -0.75}, faults=(pushed,), limit_s=4.0))
    assert flight.end_position_m[2] == pytest.approx(-0.75, abs=0.1)


@pytest.mark.parametrize("push_m_s", [(2.0, 0.3, 1.0), (2.75, 0.3, 0.0)])
def test_the_edge_of_the_table_throws_nothing_up(body, push_m_s):
    """What comes into it through a side gains no energy but what the springs give back."""
    pushed = Fault(Kind.KICK, push_m_s, after_s=0.2, since=FROM_START)
    scenario = Scenario(orders=(), world=TABLE | {"floor_m": -0.75}, faults=(pushed,), limit_s=5.0)
    trace = body.fly(scenario, trace_every=2).trace
    energy = 9.81 * trace["z"] + 0.5 * (trace["vx"] ** 2 + trace["vy"] ** 2 + trace["vz"] ** 2)
    energy = energy[trace["time_s"] > 0.22]
    assert (energy - np.minimum.accumulate(energy)).max() < 3.0


def test_the_noise_of_close_seeds_has_nothing_in_common(body):
    """Neither of two seeds, nor of two streams of one: no sequence is another one's, some draws on."""
    seen: set[float] = set()
    for seed in range(8):
        for stream in range(3):
            draws = body.uniform(seed, stream, 1000)
            assert draws.mean() == pytest.approx(0.5, abs=0.05)
            assert len(set(draws)) == 1000
            assert not seen & set(draws)
            seen |= set(draws)


def test_the_same_seed_gives_the_same_flight(body):
    scenario = Scenario(orders=(*TAKE_OFF, land(1.0)), world={"gust_std_m_s": 1.0})
    first, second = body.fly(scenario), body.fly(scenario)
    assert first == second
    assert first != body.fly(Scenario(orders=scenario.orders, world=scenario.world, seed=2))


def test_the_estimate_is_the_truth_late_and_noisy(body):
    curve = circle(5.0)
    scenario = Scenario(orders=(*TAKE_OFF, Order(Command.START, after_s=0.5)), path=curve, limit_s=20.0)
    trace = body.fly(scenario, trace_every=1).trace
    moving = (trace["state"] == State.TRAJECTORY) & (np.hypot(trace["vx"], trace["vy"]) > 4.5)
    gap = np.stack([trace[f"estimate_{axis}"] - trace[axis] for axis in "xyz"])[:, moving]
    along = -np.sum(gap * np.stack([trace[f"v{axis}"][moving] for axis in "xyz"]), axis=0) / 25.0
    assert np.mean(along) == pytest.approx(0.01 + 0.004, abs=0.003)  # the delay, and half the pose's period
    hover = trace["state"] == State.HOLD
    assert np.std(trace["estimate_z"][hover] - trace["z"][hover]) == pytest.approx(0.003, rel=0.3)


@pytest.mark.parametrize("loss", Loss)
def test_a_lost_position_is_lost_in_every_way(body, loss):
    lost = Fault(Kind.POSITION_LOST, (loss,), after_s=1.0)
    trace = body.fly(Scenario(faults=(lost,), limit_s=8.0), trace_every=1).trace
    assert (trace["estimate_faults"][-1] != 0) or loss in (Loss.NOT_VALID, Loss.NO_XY)


def test_flights_are_clean_under_the_sanitizer():
    """Every kind of fault, three to a flight; undefined behaviour ends the process."""
    kinds = [kind for kind in Kind if kind != Kind.PARAMETER]
    clean = load(sanitize=True)
    for i in range(0, len(kinds), 3):
        faults = tuple(
            Fault(kind, (1.0, 0.5, 0.2, 0.1), after_s=0.7 * k, duration_s=0.5)
            for k, kind in enumerate(kinds[i : i + 3])
        )
        assert clean.fly(Scenario(orders=(*TAKE_OFF, land(2.5)), faults=faults, limit_s=12.0)).ticks > 1000
