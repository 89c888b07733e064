"""The mission: legal and illegal commands, what the vehicle does by itself, and shaping along the path."""

import numpy as np
import pytest

import vehicle
from firmware_bridge import controller, wire
from firmware_bridge.controller import Command, Controller, LinkLoss, RefusedError, State, parameters_of
from flight import InputError, Trajectory


def _hovering(flight_of, **options):
    flight = flight_of(**options)
    flight.hover()
    return flight


def test_nothing_flies_before_parameters_are_set():
    raw = controller._controller.Controller()
    raw.tick(0, np.array([0, 0, 0, 0, 0, 0, 1.0, 0, 0, 0, 0, 0, 0]), 0, 0, 0.0)
    assert controller._controller.reason_text(raw.command(int(Command.ARM), 0.0)) == "vehicle parameters were never set"


@pytest.mark.parametrize("command", [c for c in Command if c not in (Command.ARM, Command.DISARM, Command.KILL)])
def test_a_disarmed_vehicle_only_arms(flight_of, command):
    flight = flight_of()
    flight.tick()
    if command == Command.TIME_SCALE:
        flight.controller.command(command, 0.5)  # a setting, not a manoeuvre
    else:
        with pytest.raises(RefusedError):
            flight.controller.command(command, 1.0)
    assert flight.controller.state == State.DISARMED


def test_disarming_is_refused_in_the_air_and_killing_is_not(flight_of):
    flight = _hovering(flight_of)
    with pytest.raises(RefusedError, match="not in this state"):
        flight.controller.command(Command.DISARM)
    flight.controller.command(Command.KILL)
    assert (flight.tick()["rotor_speed_rad_s"] == 0).all()
    assert flight.controller.state == State.FAULT
    flight.controller.command(Command.DISARM)
    assert flight.controller.state == State.DISARMED


def test_arming_a_tipped_vehicle_is_refused(flight_of):
    flight = flight_of()
    flight.spoil = lambda row, at: (np.concatenate([row[:6], [0.7, 0.714, 0, 0], row[10:]]), at, at)
    flight.tick()
    with pytest.raises(RefusedError, match="attitude"):
        flight.controller.command(Command.ARM)


def test_shadow_mode_ends_on_the_ground_and_only_where_it_began(flight_of):
    flight = flight_of()
    flight.tick()
    with pytest.raises(RefusedError, match="the end of shadow mode"):
        flight.controller.end_shadow()
    flight.controller.shadow()
    flight.tick()
    assert flight.controller.state == State.SHADOW
    flight.controller.end_shadow()
    assert flight.controller.state == State.DISARMED
    assert (flight.tick()["rotor_speed_rad_s"] == 0).all()


def test_starting_needs_a_trajectory_that_begins_here(flight_of, curves):
    flight = _hovering(flight_of)
    with pytest.raises(RefusedError, match="no trajectory"):
        flight.controller.command(Command.START)
    away = curves.fitted(lambda t: np.stack([5 + 0 * t, 0 * t, 1.5 + 0 * t, 0 * t], -1), np.array([1.0]))
    flight.controller.upload(away)
    with pytest.raises(RefusedError, match="too far"):
        flight.controller.command(Command.START)
    assert flight.controller.state == State.HOLD


def _setpoints(flight, first):
    rows = [row["setpoint"] for row in flight.log[first:]]
    return {name: np.array([row[name] for row in rows]) for name in ("position_world_m", "velocity_world_m_s",
            "acceleration_world_m_s2", "jerk_world_m_s3")}  # fmt: skip


def _assert_consistent(flight, first):
    """Each derivative of the set-point is the slope of the one before, through every change of rate and of state."""
    s, h = _setpoints(flight, first), flight.step_us * 1e-6
    names = list(s)
    for low, high, tolerance in zip(names[:-1], names[1:], (2e-2, 0.1, 1.5), strict=True):
        slope = (s[low][2:] - s[low][:-2]) / (2 * h)
        assert np.abs(slope - s[high][1:-1]).max() < tolerance, high


def test_pause_stands_on_the_path_and_resume_finishes_it(flight_of, curves):
    flight = flight_of()
    flight.start(curves.figure_eight(speed_m_s=6.0, turns=1))
    first = len(flight.log)
    flight.run(4.0)
    flight.controller.command(Command.PAUSE)
    assert flight.run(6.0, State.PAUSED)
    stood = flight.controller.telemetry["path_time_us"]
    flight.run(2.0)
    assert flight.controller.telemetry["path_time_us"] == stood
    assert np.linalg.norm(flight.plant.velocity_world_m_s) < 0.02
    flight.controller.command(Command.RESUME)
    assert flight.run(20.0, State.HOLD)
    assert max(row["error_m"] for row in flight.log[first:]) < 0.05
    _assert_consistent(flight, first)


def test_slow_motion_doubles_the_time_and_stays_on_the_path(flight_of, curves):
    trajectory = curves.straight(duration_s=3.0)
    flight = flight_of()
    flight.hover()
    flight.controller.command(Command.TIME_SCALE, 0.5)
    flight.controller.upload(trajectory)
    flight.controller.command(Command.START)
    assert flight.run(5.0, State.TRAJECTORY)
    start_us = flight.time_us
    assert flight.run(10.0, State.HOLD)
    assert (flight.time_us - start_us) * 1e-6 == pytest.approx(6.0, abs=0.01)


def test_hold_brakes_along_the_path_at_the_set_deceleration(flight_of, curves):
    flight = flight_of()
    flight.start(curves.loop(lambda a: [a, 0 * a, 1.5 + 0 * a, 0 * a], rate=4.0, turns=4))
    flight.run(4.0)
    first = len(flight.log)
    flight.controller.command(Command.HOLD)
    assert flight.run(6.0, State.HOLD)
    flight.run(1.0)
    s = _setpoints(flight, first)
    braking = -s["acceleration_world_m_s2"][:, 0]
    assert braking.max() == pytest.approx(controller.PARAMETERS["brake_m_s2"].preset, rel=0.02)
    assert np.abs(s["velocity_world_m_s"][-1]).max() < 1e-3
    _assert_consistent(flight, first)


def test_abort_brakes_along_the_path_then_lands(flight_of, curves):
    flight = flight_of()
    flight.start(curves.figure_eight(speed_m_s=5.0, turns=1))
    flight.run(4.0)
    first = len(flight.log)
    flight.controller.command(Command.LAND)
    assert flight.run(6.0, State.LANDING)
    assert flight.run(15.0, State.DISARMED)
    braking = [row["error_m"] for row in flight.log[first:] if row["state"] == State.ABORTING]
    assert max(braking) < 0.1


def test_a_nan_estimate_for_a_moment_is_bridged(flight_of, curves):
    flight = flight_of()
    flight.start(curves.figure_eight(speed_m_s=6.0, turns=1))
    flight.run(3.0)
    first = len(flight.log)
    until = flight.time_us + 60_000
    flight.spoil = lambda row, at: (row * np.nan if flight.time_us < until else row, at, at)
    flight.run(1.0)
    assert flight.controller.state == State.TRAJECTORY
    assert max(row["error_m"] for row in flight.log[first:]) < 0.15


@pytest.mark.parametrize("how", ["stale", "not finite"])
def test_a_lost_position_is_dead_reckoned_then_sinks_level_to_the_ground(flight_of, how):
    flight = _hovering(flight_of)
    lost = flight.time_us

    def spoil(row, at):
        if how == "stale":
            return row, min(at, lost), at
        row[:6] = np.nan
        return row, at, at

    flight.spoil = spoil
    flight.run(1.9)
    assert flight.controller.state == State.HOLD
    assert flight.log[-1]["reckoning_s"] == pytest.approx(1.8, abs=0.02)
    assert flight.log[-1]["reckoning_std_m"] == pytest.approx(0.6, abs=0.1)  # and it says what that may be worth
    assert flight.run(0.4, State.EMERGENCY)
    assert how.split()[-1] in controller._controller.reason_text(flight.log[-1]["reason"])
    assert flight.run(8.0, State.DISARMED)
    assert controller._controller.reason_text(flight.log[-1]["reason"]) == "touched down"
    assert flight.plant.position_world_m[2] < 0.05
    tilt = max(np.hypot(*row["q_reference"][1:3]) for row in flight.log[-1000:] if row["state"] == State.EMERGENCY)
    assert tilt < 0.02


def test_a_position_that_comes_back_in_time_changes_nothing(flight_of, curves):
    flight = flight_of()
    flight.start(curves.figure_eight(speed_m_s=6.0, turns=1))
    flight.run(3.0)
    first, lost, last = len(flight.log), flight.time_us, flight.past[-1][1]

    def spoil(row, at):
        gap = lost < flight.time_us < lost + 600_000
        return (np.concatenate([last[:6], row[6:]]), lost, at) if gap else (row, at, at)

    flight.spoil = spoil
    assert flight.run(20.0, State.HOLD)
    assert min(row["path_rate"] for row in flight.log[first : first + 1000]) < 0.5  # it braked meanwhile
    assert max(row["error_m"] for row in flight.log[first:]) < 0.15


def test_a_position_that_comes_back_late_leads_to_a_landing(flight_of):
    flight = _hovering(flight_of, overrides={"emergency_sink": 0.98})
    lost = flight.time_us
    flight.spoil = lambda row, at: (row, min(at, lost) if flight.time_us < lost + 2_600_000 else at, at)
    assert flight.run(2.3, State.EMERGENCY)
    assert flight.run(1.0, State.LANDING)
    assert flight.run(10.0, State.DISARMED)


def test_without_attitude_it_levels_on_the_gyro_for_the_stated_time_then_stops(flight_of):
    flight = flight_of()
    flight.hover(20.0)
    lost = flight.time_us
    gyro_s = flight.controller.parameters()["gyro_hold_s"]
    flight.spoil = lambda row, at: (row, at, min(at, lost))
    flight.gyro_survives = True
    assert flight.run(0.3, State.EMERGENCY)
    assert "level on the gyro" in controller._controller.reason_text(flight.log[-1]["reason"])
    flight.run(gyro_s - 0.5)
    assert flight.controller.state == State.EMERGENCY
    assert abs(flight.plant.q_world_body[1:3]).max() < 0.05
    assert flight.run(1.0, State.FAULT)


def test_without_gyro_the_rotors_stop(flight_of):
    flight = _hovering(flight_of)
    lost = flight.time_us
    flight.spoil = lambda row, at: (row, at, min(at, lost))
    assert flight.run(0.3, State.FAULT)
    assert (flight.log[-1]["rotor_speed_rad_s"] == 0).all()


@pytest.mark.parametrize("observer", [0.0, 1.0])
def test_a_vehicle_that_does_not_follow_its_attitude_is_an_emergency(flight_of, observer):
    flight = _hovering(flight_of, overrides={"observer": observer})
    upset = np.array([np.cos(0.75), np.sin(0.75), 0.0, 0.0])  # 86 degrees of roll that never goes away
    flight.spoil = lambda row, at: (np.concatenate([row[:6], upset, 0 * row[10:]]), at, at)
    assert flight.run(0.5, State.EMERGENCY)
    assert flight.run(1.0, State.FAULT)


def test_a_tip_over_at_take_off_stops_the_rotors_at_once(flight_of):
    flight = flight_of()
    flight.tick()
    flight.controller.command(Command.ARM)
    flight.controller.command(Command.TAKE_OFF, 1.0)
    upset = np.array([np.cos(1.3), np.sin(1.3), 0.0, 0.0])
    flight.spoil = lambda row, at: (np.concatenate([row[:6], upset, 0 * row[10:]]), at, at)
    assert flight.run(0.5, State.FAULT)


def test_leaving_the_geofence_lands(flight_of):
    flight = _hovering(flight_of, overrides={"fence_max_z_m": 3.0})
    flight.spoil = lambda row, at: (row + np.array([0, 0, 2.0] + [0] * 10), at, at)
    flight.run(1.0)  # half a second of which a position that jumps is not believed
    assert flight.controller.state == State.LANDING


@pytest.mark.parametrize("phase", range(8))
@pytest.mark.parametrize(
    ("what", "least_s", "late_s"), [("fence", 0.0, 0.010), ("tilt", 0.28, 0.040), ("link", 2.0, 0.040)]
)
def test_at_200_hz_a_failsafe_check_is_hardly_late_whichever_tick_it_falls_on(what, least_s, late_s, phase):
    """A tilt error is taken to have begun with the last look that found none: it may count as 20 ms older."""
    c = Controller(parameters_of(vehicle.example("rigter2019")))
    row = np.array([0, 0, 0, 0, 0, 0, 1.0, 0, 0, 0, 0, 0, 0])
    ticks = 0

    def run(count: int) -> None:
        nonlocal ticks
        for _ in range(count):
            ticks += 1
            c.tick(5000 * ticks, row)
            if c.state == State.TAKE_OFF:
                row[:3] = c.telemetry["setpoint"]["position_world_m"]

    run(16 + phase)
    c.command(Command.ARM)
    run(1)
    if what != "link":  # an armed vehicle on the ground disarms when nobody is there
        c.command(Command.TAKE_OFF, 1.0)
        while c.state != State.HOLD:
            run(1)
    run(8)
    c.raw.ground_alive(0)
    state, before = c.state, ticks
    if what == "fence":
        row[0] = 2000.0
    elif what == "tilt":
        row[6:10] = [np.cos(1.0), np.sin(1.0), 0.0, 0.0]
    while c.state == state and ticks < before + 1000:
        run(1)
    assert least_s <= 0.005 * (ticks - before) <= least_s + late_s + 1e-9


@pytest.mark.parametrize(
    ("policy", "states"),
    [(LinkLoss.FINISH, [State.HOLD]), (LinkLoss.HOLD, [State.STOPPING, State.HOLD]),
     (LinkLoss.LAND, [State.ABORTING, State.LANDING])],
)  # fmt: skip
def test_the_policy_of_the_upload_decides_what_a_lost_link_does(flight_of, curves, policy, states):
    flight = flight_of()
    flight.start(curves.figure_eight(speed_m_s=5.0, turns=1), link_loss=policy)
    flight.controller.raw.ground_alive(0)
    for state in states:
        assert flight.run(20.0, state)


def test_a_hover_without_a_link_lands_in_the_end(flight_of):
    flight = _hovering(flight_of, overrides={"link_hold_s": 3.0})
    flight.controller.raw.ground_alive(0)
    flight.run(2.5)
    assert flight.controller.state == State.HOLD
    assert flight.run(3.0, State.LANDING)


@pytest.mark.parametrize("step_s", [-5.0, -0.5, -2e-3, 0.0, 0.5, 60.0, 3600.0])
def test_a_step_of_the_clock_does_not_disturb_the_flight(flight_of, curves, step_s):
    flight = flight_of()
    flight.start(curves.figure_eight(speed_m_s=6.0, turns=1))
    flight.run(3.0)
    flight.time_us += round(step_s * 1e6)
    first = len(flight.log)
    assert flight.run(20.0, State.HOLD)
    assert max(row["error_m"] for row in flight.log[first:]) < 0.05
    assert flight.controller.telemetry["refused_ticks"] == int(step_s != 0.0)


def test_killing_works_whatever_the_clock_does(flight_of):
    flight = _hovering(flight_of)
    flight.run(5.0)
    flight.time_us -= 5_000_000
    flight.controller.command(Command.KILL)
    assert (flight.tick()["rotor_speed_rad_s"] == 0).all()


def test_parameters_change_together_or_not_at_all(flight_of):
    flight = _hovering(flight_of)
    before = flight.controller.parameters()
    with pytest.raises(RefusedError, match="disarmed"):
        flight.controller.set_parameters({"kp_xy_1_s2": 7.0, "rotor0_x_m": 0.1})
    assert flight.controller.parameters() == before
    flight.controller.set_parameters({"kp_xy_1_s2": 7.0})
    assert flight.controller.parameters()["kp_xy_1_s2"] == 7.0


def test_a_new_geofence_discards_trajectories_checked_against_the_old_one(curves):
    c = Controller(parameters_of(vehicle.example("rigter2019")))
    c.upload(curves.straight())
    assert c.raw.has_trajectory()
    c.set_parameters({"fence_max_x_m": 2.0})
    assert not c.raw.has_trajectory()
    with pytest.raises(RefusedError, match="leaves the fence"):
        c.upload(curves.straight())


def _with_jump(trajectory: Trajectory, size_m: float) -> Trajectory:
    coefficients = trajectory.coefficients.copy()
    coefficients[len(coefficients) // 2 :, 0, 0] += size_m
    return Trajectory(trajectory.durations_s, coefficients)


@pytest.mark.parametrize(
    ("limits", "words"),
    [({"path_speed_m_s": 8.0}, "speed limit"), ({"path_acc_m_s2": 8.0}, "acceleration limit"),
     ({"path_jerk_m_s3": 10.0}, "jerk limit"), ({"fence_max_x_m": 5.9}, "leaves the fence")],
)  # fmt: skip
def test_the_vehicle_checks_limits_itself(curves, limits, words):
    c = Controller(parameters_of(vehicle.example("rigter2019"), **limits))
    with pytest.raises(RefusedError, match=words):
        c.upload(curves.figure_eight())
    assert not c.raw.has_trajectory()


def test_limits_just_above_what_is_needed_pass(curves):
    """The hull is tight: within 1 % of the true largest speed and position."""
    c = Controller(parameters_of(vehicle.example("rigter2019"), path_speed_m_s=8.6, fence_max_x_m=6.05))
    c.upload(curves.figure_eight())


def test_jumps_yaw_rates_and_moving_ends_are_refused(curves):
    c = Controller(parameters_of(vehicle.example("rigter2019"), path_yaw_rad_s=4.0))
    with pytest.raises(RefusedError, match="jumps at a join"):
        c.upload(_with_jump(curves.figure_eight(), 0.01))
    with pytest.raises(RefusedError, match="yaw rate"):
        c.upload(curves.general())
    moving = curves.fitted(lambda t: np.stack([t, 0 * t, 1.5 + 0 * t, 0 * t], -1), np.array([1.0, 1.0]))
    with pytest.raises(RefusedError, match="at rest"):
        c.upload(moving)
    short = curves.straight(duration_s=0.01, to_m=(0.0, 0.0, 1.5))
    with pytest.raises(InputError, match=r"lasts 0\.01 s"):  # refused before the vehicle is asked ...
        c.upload(short)
    assert c.raw.upload_begin(9, 0, 1, 8, 0) == 0
    too_short = c.raw.upload_segment(0, 10_000, np.zeros((4, 8), np.float32))  # ... which refuses it, too
    assert controller._controller.reason_text(too_short) == "segment too short or too long"


def test_a_damaged_upload_is_never_activated(curves):
    c = Controller(parameters_of(vehicle.example("rigter2019")))
    plan = wire.plan_from_trajectory(curves.figure_eight(), id=5, on_link_loss=LinkLoss.FINISH)
    k, _, n = plan.coefficients.shape
    raw, text = c.raw, controller._controller.reason_text
    assert raw.upload_begin(5, plan.crc32 ^ 1, k, n, 0) == 0
    assert text(raw.upload_finish()) == "segments are missing"
    for i in range(k):
        assert raw.upload_segment(i, int(plan.durations_us[i]), plan.coefficients[i]) == 0
    assert text(raw.upload_finish()) == "CRC does not match"
    assert raw.upload_activate(5, plan.crc32 ^ 1) != 0
    assert not raw.has_trajectory()


def test_a_planner_that_evaluates_another_curve_is_refused(curves):
    c = Controller(parameters_of(vehicle.example("rigter2019")))
    plan = wire.plan_from_trajectory(curves.straight(), id=1, on_link_loss=LinkLoss.FINISH)
    c.raw.upload_begin(1, plan.crc32, 1, plan.coefficients.shape[2], 0)
    c.raw.upload_segment(0, int(plan.durations_us[0]), plan.coefficients[0])
    c.raw.upload_sample(1_500_000, np.array([1.5, 0.01, 1.5, 0.0], np.float32))
    assert controller._controller.reason_text(c.raw.upload_finish()) == "vehicle evaluates another curve than planner"


def test_the_flown_slot_cannot_be_replaced_and_staging_goes_on_in_flight(flight_of, curves):
    flight = flight_of()
    flight.start(curves.figure_eight(speed_m_s=5.0, turns=1))
    crc = flight.controller.telemetry["trajectory_crc32"]
    with pytest.raises(RefusedError, match="being flown"):
        flight.controller.upload(curves.straight(), id=2)
    flight.run(1.0)
    assert flight.controller.telemetry["trajectory_crc32"] == crc
