"""Gyro, accelerometer and motor commands from 0 to 1, without pose and rotor speed, to a vehicle's parameters."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from scipy import signal

import sysid
from flight import FlightLog, InputError
from sysid.diagnosis.procedure import diagnose
from sysid.estimator import from_imu
from sysid.estimator.options import HoverCommand, Options
from sysid.estimator.prepare import prepare_all
from sysid.estimator.without_pose import anchors, sensing, told
from sysid.logs.sensors.low_pass import LowPass

INERTIAS = tuple(f"inertia_{2 * axis}_kg_m2" for axis in "xyz")


@pytest.fixture(scope="module")
def twins():
    """Two vehicles: their parameters, and their logs."""
    import without_pose_flights as flights

    rng = np.random.default_rng(11)
    values = flights.drawn(2, rng)
    return values, flights.flown(flights.body(), values, rng, duration_s=12.0)


@pytest.fixture(scope="module")
def start():
    import without_pose_flights as flights

    return flights.start()


@pytest.fixture(scope="module")
def fitted(twins, start):
    return [sysid.identify([log], start) for log in twins[1]]


def _changed(log: FlightLog, **columns: np.ndarray) -> FlightLog:
    return FlightLog({**log.columns, **columns}, log.metadata)


def _with_commands(log: FlightLog, ratio: np.ndarray) -> FlightLog:
    return _changed(log, **{f"motor_command_{i}_ratio": ratio[:, i] for i in range(4)})


def _commands(log: FlightLog) -> np.ndarray:
    return np.stack([log.columns[f"motor_command_{i}_ratio"] for i in range(4)], axis=1)


def test_inertia_and_lag_are_found_within_five_percent(twins, fitted):
    for i, found in enumerate(fitted):
        assert found.converged
        assert str(found.verdict.use) == "usable"
        for name in (*INERTIAS, "motor_lag.rise_s", "motor_lag.fall_s"):
            assert found.estimate(name).value == pytest.approx(twins[0][name][i], rel=0.05)


BEHIND_RAD_S = 2.0 * np.pi * 10.0 / np.sqrt(np.sqrt(2.0) - 1.0)
"""Of each of the two lags of a Betaflight whose accelerometer is logged behind 10 Hz."""


@pytest.fixture(scope="module")
def behind(twins):
    """The first twin's log, its accelerometer behind two lags."""
    log = twins[1][0]
    share, through = 1.0 - np.exp(-0.002 * BEHIND_RAD_S), {}
    for name in (f"specific_force_body_{axis}_m_s2" for axis in "xyz"):
        values = log.columns[name]
        for _ in range(2):
            values = signal.lfilter([share], [1.0, share - 1.0], values, zi=[(1.0 - share) * values[0]])[0]
        through[name] = values
    return FlightLog({**log.columns, **through}, log.metadata)


def test_a_low_pass_that_the_log_names_does_not_shrink_thrust_and_inertia(twins, behind, start):
    """Taken for the force itself, inertias came out 70 % small."""
    named = FlightLog(behind.columns, {**behind.metadata, **LowPass(BEHIND_RAD_S, 1.0).metadata()})
    found = sysid.identify([named], start)
    for name in INERTIAS:
        assert found.estimate(name).value == pytest.approx(twins[0][name][0], rel=0.03)


def test_of_measured_rotor_speeds_the_linear_term_of_thrust_is_tried_as_of_commands(twins, start):
    """Left out of twins that have it, inertias came out 2 to 3 % large, with 0.8 % stated."""
    import without_pose_flights as flights

    log, values = twins[1][0], {name: float(one[0]) for name, one in twins[0].items()}
    ratio, turning = _commands(log), [_commands(log)[0]]
    for wanted in ratio[1:]:
        lag_s = np.where(wanted > turning[-1], values["motor_lag.rise_s"], values["motor_lag.fall_s"])
        turning.append(turning[-1] + (wanted - turning[-1]) * (1.0 - np.exp(-2e-3 / lag_s)))
    speed = flights.FULL_RAD_S * np.array(turning)
    measured = {name: values for name, values in log.columns.items() if not name.startswith("motor_command")}
    measured |= {f"rotor_speed_{i}_rad_s": speed[:, i] for i in range(4)}
    found = sysid.identify([FlightLog(measured, log.metadata)], start)
    for name in INERTIAS:
        assert found.estimate(name).value == pytest.approx(values[name], rel=0.015)


def test_an_accelerometer_late_as_behind_a_low_pass_that_nobody_named_is_doubtful(behind, start):
    found = sysid.identify([behind], start)
    assert str(found.verdict.use) == "doubtful"
    assert any("Name its low-pass" in doubt and doubt in found.findings for doubt in found.verdict.doubts)


def test_a_turning_is_told_as_readings_that_are_means_about_the_nodes_show_it():
    """A gyro's readings are means about the nodes: their differences damp what the mean over an interval does not."""
    step_s, by_rad_s = 6e-3, np.array([5.0, 20.0, 60.0])
    edges_s = step_s * np.arange(-0.5, 400.0)
    readings = np.diff(-np.cos(np.outer(edges_s, by_rad_s)) / by_rad_s, axis=0) / step_s
    nodes_s = edges_s[:-1] + 0.5 * step_s
    exact = np.diff(np.sin(np.outer(nodes_s, by_rad_s)), axis=0) / step_s
    shown, inside = np.diff(readings, axis=0) / step_s, slice(1, -1)
    off = np.abs(sensing.about_nodes(exact) - shown)[inside].max(axis=0) / by_rad_s
    before = np.abs(exact - shown)[inside].max(axis=0) / by_rad_s
    assert (off < 1e-2 * before).all()


def test_a_steady_turning_is_measured_as_it_is_whatever_rows_a_log_lost(twins, start):
    log = twins[1][0]
    kept = np.random.default_rng(1).random(len(log.time_s)) > 0.2
    log = FlightLog({name: values[kept] for name, values in log.columns.items()}, log.metadata)
    steady = {f"rate_body_{axis}_rad_s": (i + 1.0) * log.time_s for i, axis in enumerate("xyz")}
    for flight in prepare_all([_changed(log, **steady)], Options(), [start]):
        assert np.ptp(flight.step_s) > 0.5 * np.median(flight.step_s)
        assert sensing.measured(flight)[:, 3:] == pytest.approx(
            np.tile([1.0, 2.0, 3.0], (len(flight) - 1, 1)), rel=1e-6
        )


def test_errors_are_as_large_as_stated(twins, fitted):
    """Of commands logged at half the loop's rate, whose delay is estimated, the sampling leaves nothing open."""
    for i, found in enumerate(fitted):
        for name in (*INERTIAS, "motor_lag.rise_s", "motor_lag.fall_s"):
            one = found.estimate(name)
            assert abs(one.value - twins[0][name][i]) < 2.5 * one.std_robust
            assert one.std_robust < 0.1 * one.value


def test_thrust_by_command_is_found_whatever_speed_full_throttle_is(twins, fitted, start):
    import without_pose_flights as flights

    ratio, body = np.array([0.35, 0.48, 0.65]), flights.body()
    assert start.limits.rotor_speed_max_rad_s != flights.FULL_RAD_S
    for i, found in enumerate(fitted):
        speed = flights.FULL_RAD_S * ratio
        truth = twins[0]["thrust_quadratic.k_n_s2"][i] * speed**2 + body.value("thrust_affine.slope_n_s") * speed
        thrust, half = told.thrust_by_command(found.flights, found.solution, found.unknowns, ratio)
        assert thrust == pytest.approx(truth, rel=0.05)
        assert (half < 0.1 * thrust).all()


def test_thrust_is_not_told_at_commands_that_the_rotors_never_followed(fitted):
    """They were gone before the rotors turned as fast: of a Crazyflie in crazyflow it was told 60 % wrong."""

    def told_at(solution):
        (line,) = (s for s in told.sentences(found.flights, solution, found.unknowns) if s.startswith("thrust of"))
        return [float(part.split(" at ")[1]) for part in line.split(": ")[1].split(", ")]

    found = fitted[0]
    point, slow = found.solution.point, {"motor_lag.rise_s": 0.5, "motor_lag.fall_s": 0.5}
    vehicle = point.vehicle
    for name, value in slow.items():
        vehicle = vehicle.with_value(name, value)
    assert len(told_at(found.solution)) > 1
    assert len(told_at(replace(found.solution, point=replace(point, vehicle=vehicle)))) == 1


def test_the_command_is_found_late_and_the_accelerometer_beside_the_centre_of_mass(fitted):
    import without_pose_flights as flights

    recorder = flights.Recorder()
    filtered_s = 1.0 / (2.0 * np.pi * recorder.gyro_cutoff_hz)
    for found in fitted:
        (command,) = (clock for clock in found.clocks if clock.stream == "rotor speed command")
        assert -command.delay_s == pytest.approx(recorder.latency_s + filtered_s, abs=1.5e-3)
        place = [found.solution.point.sensors[name] for name in sensing.PLACE]
        assert place == pytest.approx(recorder.place_m, abs=5e-3)


def test_what_stays_unknown_without_a_pose_is_told_in_one_line(fitted):
    assert sum(finding == told.UNKNOWN for finding in fitted[0].findings) == 1


def test_the_derivatives_are_those_of_what_is_left(fitted):
    found = fitted[0]
    flight, point, unknowns = sensing.with_delays(found.flights[0]), found.solution.point, found.unknowns
    point = replace(point, states=())
    by = sensing.shown(flight, point.vehicle, unknowns.names, unknowns.model, point.sensors).by
    values = point.shared(unknowns)
    for i, name in enumerate(unknowns.names):
        step = np.zeros(len(values))
        late = "delay" in name  # commands step, so that a delay has slopes only on average
        step[i] = 1e-3 if late else 1e-4 * max(abs(values[i]), 1e-3 if i >= len(unknowns.model) else 0.0)
        up, down = (point.moved(unknowns, sign * step, ()) for sign in (1.0, -1.0))
        there, here = (sensing.left(flight, one.vehicle, one.sensors) for one in (up, down))
        slope = (here - there) / (2.0 * step[i])
        # small products are left out: of the accelerometer's turn or place with what the model's slopes are
        of_model = late or i < len(unknowns.model)
        rows, share = (slice(2, 6), 0.25 if late else 0.02) if of_model else (slice(0, 6), 1e-3)
        off, size = (np.sqrt((v[:, rows] ** 2).mean(axis=0)) for v in (by[:, :, i] - slope, slope))
        assert (off <= share * size.max()).all(), name


def test_drag_is_held_because_nothing_measured_depends_on_it(twins, start):
    with_drag = start.with_effect("parasitic_drag")
    found = sysid.identify([twins[1][0]], with_drag, sysid.Options(free=("parasitic_drag.drag_xy_kg_m", *INERTIAS)))
    assert found.estimate("parasitic_drag.drag_xy_kg_m").status == "not identifiable"


def test_motors_that_never_vary_are_refused(twins, start):
    log = twins[1][0]
    with pytest.raises(InputError, match="the motors never vary"):
        sysid.identify([_with_commands(log, np.full((len(log), 4), 0.5))], start)


def test_a_hover_is_refused_with_what_to_fly(twins, start):
    log, rng = twins[1][0], np.random.default_rng(0)
    n = len(log)
    still = {f"rate_body_{axis}_rad_s": 2e-3 * rng.standard_normal(n) for axis in "xyz"}
    force = {f"specific_force_body_{axis}_m_s2": 0.05 * rng.standard_normal(n) for axis in "xyz"}
    force["specific_force_body_z_m_s2"] += 9.81
    hover = _with_commands(_changed(log, **still, **force), 0.48 + 0.012 * rng.standard_normal((n, 4)))
    with pytest.raises(InputError, match=r"only hover.*throttle up and down in steps, then quick rolls"):
        sysid.identify([hover], start)


def test_an_imu_at_50_hz_is_refused_with_the_rate_that_does(twins, start):
    every = {name: values[::10] for name, values in twins[1][0].columns.items()}
    with pytest.raises(InputError, match=r"at 50 Hz and no pose.*90 Hz or more"):
        sysid.identify([FlightLog(every, {"name": "slow"})], start)


def test_a_gyro_at_the_end_of_its_range_is_refused_with_what_to_fly(twins, start):
    """Fitted as it is, inertias came out 30 % too large, and the fit was called usable."""
    clipped = {f"rate_body_{a}_rad_s": np.clip(twins[1][0].columns[f"rate_body_{a}_rad_s"], -4.0, 4.0) for a in "xyz"}
    with pytest.raises(InputError, match=r"gyro of .* sits at its extremes about x, 4 rad/s.*with less stick"):
        sysid.identify([_changed(twins[1][0], **clipped)], start)


def test_propellers_off_are_refused(twins, start):
    """The accelerometer feels gravity and shaking, whatever is commanded."""
    log, rng = twins[1][0], np.random.default_rng(0)
    force = {f"specific_force_body_{axis}_m_s2": 0.5 * rng.standard_normal(len(log)) for axis in "xyz"}
    force["specific_force_body_z_m_s2"] += 9.81
    rates = {f"rate_body_{axis}_rad_s": 0.05 * rng.standard_normal(len(log)) for axis in "xyz"}
    with pytest.raises(InputError, match="does not feel what is commanded: propellers off"):
        sysid.identify([_changed(log, **force, **rates)], start)


def test_outputs_of_another_flight_forbid_the_use_of_the_fit(twins, start):
    own, other = twins[1]
    found = sysid.identify([_with_commands(own, _commands(other)[::-1])], start)
    assert str(found.verdict.use) == "do not use"
    assert any("commands explain" in reason for reason in found.verdict.reasons)


def test_a_diagnosis_of_flights_without_a_pose_is_refused_with_what_needs_none(twins, start):
    with pytest.raises(InputError, match=r"no flight has a pose.*goshawk diagnose"):
        diagnose(twins[1], start)


def test_the_report_draws_what_the_imu_shows(fitted, tmp_path):
    """Force along the thrust, not gravity turned about: the overlay's model is beside the measured."""
    from sysid.report import fit_plots

    found = fitted[0]
    flight, states = found.flights[0], found.solution.point.states[0]
    shown = fit_plots._motion(found, flight, states)
    left = fit_plots._left_over(found, flight, states)
    assert shown[:, 2].mean() == pytest.approx(0.65 * 9.8, rel=0.1)
    assert left[:, 2].std() < 0.5 * shown[:, 2].std()


def test_where_throttle_steps_are_too_small_to_tell_the_curve_of_thrust_intervals_of_inertia_hold(start):
    """With the curve taken for a plain square there, inertias were 10 % off, at 6 to 13 standard errors."""
    import without_pose_flights as flights

    rng = np.random.default_rng(2)
    values = flights.drawn(1, rng)
    (log,) = flights.flown(flights.body(), values, rng, duration_s=12.0, effort=(0.1, 0.1, 0.1))
    found = sysid.identify([log], start)
    assert "thrust_affine" in found.vehicle.effects
    for name in INERTIAS[:2]:
        estimate = found.estimate(name)
        assert 0.02 < estimate.interval90 / estimate.value < 0.3
        assert abs(estimate.value - values[name][0]) < 1.5 * estimate.interval90


def test_no_damping_of_yaw_is_found_where_there_is_none(fitted):
    assert all(from_imu.DAMPING not in found.vehicle.effects for found in fitted)


def test_a_vehicle_that_damps_yaw_by_rotor_drag_gets_no_second_damping(start):
    flight = SimpleNamespace(full_throttle_rad_s=1.0)
    dragging = start.with_effect("rotor_drag_speed")
    assert from_imu.DAMPING in from_imu._tried([flight], start, from_imu.TRIED)
    assert from_imu.DAMPING not in from_imu._tried([flight], dragging, from_imu.TRIED)


@pytest.mark.slow
def test_torques_of_rotors_that_turn_and_speed_up_leave_the_inertia_about_z_right(start):
    """Without the gyroscopic one it came out 25 % small in crazyflow's flights, and 1.8 % large in this one."""
    import without_pose_flights as flights

    rng, body = np.random.default_rng(2), flights.body()
    values = flights.drawn(1, rng)
    for effect in (from_imu.REACTION, from_imu.GYROSCOPIC):
        body = body.with_effect(effect, rotor_inertia_kg_m2=4e-6)
    log = flights.flown(body, values, rng, duration_s=30.0)
    found = sysid.identify(log, start)
    about_z, truth = found.estimate("inertia_zz_kg_m2"), values["inertia_zz_kg_m2"][0]
    assert about_z.value == pytest.approx(truth, abs=about_z.interval90)
    assert about_z.value == pytest.approx(truth, rel=0.01)
    per_speed = flights.FULL_RAD_S / start.limits.rotor_speed_max_rad_s  # full throttle's is not known
    for name in anchors.SPINNING:
        assert found.vehicle.value(name) == pytest.approx(4e-6 * per_speed, rel=0.05)
    known = sysid.identify(log, start, sysid.Options(anchors=(HoverCommand(0.48, 0.01),)))  # beside the torques' tie
    assert known.estimate("inertia_zz_kg_m2").value == pytest.approx(truth, rel=0.02)


def test_inflow_and_yaws_damping_are_kept_where_they_damp_and_never_where_they_drive(start):
    """Thrust that falls with the hub's speed through the air damps turning; no propeller's thrust rises with it.

    Without yaw's damping, which drag at the hubs makes, RotorPy's motors came out 4 % too quick, and rotors got an
    inertia that they do not have.
    """
    import without_pose_flights as flights

    rng, inflow, drag = np.random.default_rng(3), np.array([1.5e-4, -1.5e-4]), np.array([6e-5, 0.0])
    values = {**flights.drawn(2, rng), "inflow_linear.inflow_kg": inflow, "rotor_drag_speed.drag_kg": drag}
    body = flights.body().with_effect("rotor_drag_speed")
    damped, driven = (sysid.identify([log], start) for log in flights.flown(body, values, rng, duration_s=12.0))
    hubs_m2, speed = (body.hub_body_m[:, :2] ** 2).sum(axis=1), 0.48 * flights.FULL_RAD_S
    assert damped.estimate("angular_damping.z_n_m_s").value == pytest.approx(drag[0] * speed * hubs_m2.sum(), rel=0.2)
    assert damped.vehicle.value("angular_damping.x_n_m_s") == damped.vehicle.value("angular_damping.y_n_m_s") == 0.0
    assert not set(damped.vehicle.effects) & {from_imu.REACTION, "rotor_drag_speed"}
    assert not set(driven.vehicle.effects) & {from_imu.INFLOW, from_imu.DAMPING}
    per_speed = flights.FULL_RAD_S / start.limits.rotor_speed_max_rad_s  # full throttle's is not known
    assert damped.estimate("inflow_linear.inflow_kg").value == pytest.approx(inflow[0] * per_speed, rel=0.1)
    for name in ("motor_lag.rise_s", "motor_lag.fall_s"):
        assert damped.estimate(name).value == pytest.approx(values[name][0], rel=0.05)


def test_inflow_that_cannot_be_fitted_costs_nothing_and_ends_the_progress(twins, start, fitted, monkeypatch):

    fit, done = from_imu._identified, []

    def fails_with_inflow(flights, vehicle, *rest):
        if from_imu.INFLOW in vehicle.effects:
            raise InputError("it is not identifiable")
        return fit(flights, vehicle, *rest)

    monkeypatch.setattr(from_imu, "_identified", fails_with_inflow)
    found = sysid.identify([twins[1][0]], start)
    assert found.vehicle.effects == fitted[0].vehicle.effects
    monkeypatch.undo()
    sysid.identify([twins[1][0].slice(0.0, 9.0)], start, progress=lambda _, fraction: done.append(fraction))
    fit_done = done.index(0.6)
    assert max(done[:fit_done]) < 0.6 <= min(done[fit_done:])
    assert done[-1] == 1.0


@pytest.mark.slow
def test_a_vehicle_that_rotorpy_flies_is_found_within_five_percent():
    import without_pose_rotorpy

    twin = without_pose_rotorpy.flown("hummingbird", np.random.default_rng(3), duration_s=20.0)
    found = sysid.identify([twin.log], twin.given)
    for name in (*INERTIAS[:2], "motor_lag.rise_s", "motor_lag.fall_s"):
        assert found.estimate(name).value == pytest.approx(twin.values[name], rel=0.05)
    thrust, _ = told.thrust_by_command(found.flights, found.solution, found.unknowns, twin.commands)
    np.testing.assert_allclose(thrust, twin.thrust_n, rtol=0.05)
