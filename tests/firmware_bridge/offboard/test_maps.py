"""Throttle and force, rates and pulses, poses and states: there and back."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from firmware_bridge.offboard.ladder import Reason, Stage, Wish
from firmware_bridge.offboard.messages import GuardStatus, PlannerCommand, Target
from firmware_bridge.offboard.poses import Pose, UdpPoses, from_tum, tum_line
from firmware_bridge.offboard.prediction import Lags, Motion, Predictor
from firmware_bridge.offboard.rate_profile import RateProfile
from firmware_bridge.offboard.thrust_map import ThrustMap, scaled_to_flight, through
from flight import InputError, rotations

MAP = ThrustMap((0.2, 4.0, 18.0), 16.0, 0.06)
PROFILE = RateProfile((math.radians(1000.0), math.radians(800.0), math.radians(400.0)))


@given(st.floats(0.0, 1.0), st.floats(12.0, 17.0))
def test_a_throttle_gives_the_force_that_asks_for_it(throttle, battery_v):
    assert MAP.throttle(MAP.force_n(throttle, battery_v), battery_v) == pytest.approx(throttle, abs=1e-9)


def test_a_lower_battery_takes_more_throttle_for_the_same_force():
    assert MAP.throttle(8.0, 14.0) > MAP.throttle(8.0, 16.0) == MAP.throttle(8.0)


def test_a_voltage_that_is_none_of_this_battery_moves_the_throttle_little():
    for battery_v in (0.5, 1.0, 60.0):
        assert 0.7 * MAP.throttle(8.0) < MAP.throttle(8.0, battery_v) < 1.6 * MAP.throttle(8.0)


def test_a_map_is_found_from_its_points_and_scaled_to_a_flight():
    u = np.linspace(0.05, 1.0, 60)
    force_n = np.array([MAP.force_n(float(v)) for v in u])
    found = through(u, force_n)
    assert found.coefficients_n == pytest.approx(MAP.coefficients_n)
    assert scaled_to_flight(found, u, 0.93 * force_n).force_n(0.5) == pytest.approx(0.93 * MAP.force_n(0.5))
    with pytest.raises(InputError, match="needs 50"):
        scaled_to_flight(found, u[:20], force_n[:20])
    with pytest.raises(InputError, match="does not rise"):
        through(u, -force_n)


@given(st.lists(st.floats(-6.0, 6.0), min_size=3, max_size=3), st.floats(0.01, 1.0))
def test_pulses_mean_the_rates_and_throttle_they_were_made_from(rate, throttle):
    pulses = PROFILE.pulses_us(np.array(rate), throttle)
    said, open_ = PROFILE.commanded(pulses)
    largest = np.array(PROFILE.largest_rad_s)
    assert np.abs(said - np.clip(rate, -largest, largest)).max() <= 0.5 / 500.0 * largest.max() + 1e-9
    assert open_ == pytest.approx(throttle, abs=0.6 / 950.0)


def test_sticks_go_the_firmwares_way():
    right, nose_down, _, left = PROFILE.pulses_us(np.array([1.0, 1.0, 1.0]), 0.5)
    assert right > 1500
    assert nose_down > 1500
    assert left < 1500  # Betaflight counts yaw clockwise
    assert PROFILE.pulses_us(np.zeros(3), 0.0)[2] == 1000


def test_a_pose_survives_its_line_and_nonsense_is_none():
    pose = Pose(12.5, np.array([1.0, -2.0, 3.0]), rotations.exp(np.array([0.1, -0.2, 0.3])))
    back = from_tum(tum_line(pose))
    assert back is not None
    assert back.position_world_m == pytest.approx(pose.position_world_m)
    assert rotations.angle_between(back.q_world_body, pose.q_world_body) < 1e-6
    for line in (b"", b"# time x y z", b"1 2 3", b"1 2 3 4 0 0 0 2", b"nan 0 0 0 0 0 0 1"):
        assert from_tum(line) is None


def test_poses_of_another_clock_keep_their_spacing_and_lose_their_offset():
    import socket

    heard = UdpPoses("127.0.0.1", 0, delay_s=0.01)
    with socket.socket(type=socket.SOCK_DGRAM) as out:
        for i, late_s in enumerate((0.0, 0.03, 0.0)):
            out.sendto(tum_line(Pose(5.0 + 0.1 * i, np.zeros(3), np.array([1.0, 0, 0, 0]))), heard.address)
            (pose,) = heard(1000.0 + 0.1 * i + late_s)
            assert pose.time_s == pytest.approx(1000.0 + 0.1 * i - 0.01)
    heard.close()


def heard(stamps_and_nows):
    """What a stream makes of stamps that come at times."""
    import socket

    poses = UdpPoses("127.0.0.1", 0)
    with socket.socket(type=socket.SOCK_DGRAM) as out:
        for stamp_s, now_s in stamps_and_nows:
            out.sendto(tum_line(Pose(stamp_s, np.zeros(3), np.array([1.0, 0, 0, 0]))), poses.address)
            yield [pose.time_s for pose in poses(now_s)]
    poses.close()


def test_a_sender_on_our_clock_stays_on_it_when_it_is_late():
    assert list(heard([(9.99, 10.0), (10.0, 10.6)])) == [[pytest.approx(9.99)], [pytest.approx(10.0)]]


def test_a_stamp_of_the_future_is_no_pose():
    assert list(heard([(9.99, 10.0), (10.2, 10.1), (10.19, 10.2)])) == [
        [pytest.approx(9.99)],
        [],
        [pytest.approx(10.19)],
    ]


def test_a_sender_a_tenth_of_a_second_off_is_on_another_clock():
    for off_s in (-0.15, 0.15, 0.9):
        told = list(heard([(10.0 + off_s, 10.0), (10.1 + off_s, 10.1), (10.2 + off_s, 10.5)]))
        assert told == [[pytest.approx(10.0)], [pytest.approx(10.1)], [pytest.approx(10.2)]]


def test_a_planners_pose_of_no_time_is_no_command():
    said = PlannerCommand(1.0, -math.inf, 2.0, np.zeros(3), Wish.FLY)
    assert PlannerCommand.unpack(said.pack()) is not None
    for pose_s in (math.nan, math.inf):
        assert PlannerCommand.unpack(replace(said, pose_s=pose_s).pack()) is None


def test_a_target_goes_along_whole_and_finite_or_not_at_all():
    target = Target(np.arange(3.0), np.arange(3.0, 6.0), np.arange(6.0, 9.0), 0.5, -0.25)
    said = PlannerCommand(1.0, 0.9, 2.0, np.zeros(3), Wish.FLY, target)
    came = PlannerCommand.unpack(said.pack())
    assert came is not None
    assert came.target is not None
    assert came.target.pack() == target.pack()
    broken = PlannerCommand.unpack(replace(said, target=replace(target, yaw_rad=math.nan)).pack())
    assert broken is not None
    assert broken.target is None
    assert PlannerCommand.unpack(said.pack()[:-8]) is None


def test_what_the_guard_tells_comes_whole():
    said = GuardStatus(
        Stage.FOLLOWING, Reason.NONE, True, True, 2.0, 1.9, 16.0, said="it is \u00b5", by_targets=True, apart="too far"
    )
    assert GuardStatus.unpack(said.pack()).said == said.said
    assert GuardStatus.unpack(said.pack()).apart == said.apart
    assert GuardStatus.unpack(said.pack()).by_targets
    assert not GuardStatus.unpack(replace(said, by_targets=False, apart="").pack()).apart


def test_the_prediction_reaches_over_a_late_pose():
    """A body that follows its commands as the predictor thinks is known at once, however late its poses are."""
    lags, mass_kg, g = Lags(0.0, 0.03, 0.04), 0.7, 9.81
    predictor = Predictor(mass_kg, g, lags)
    predictor.on_ground = False
    truth = Predictor(mass_kg, g, lags)
    truth.on_ground = False
    for each in (predictor, truth):
        each.command(0.0, mass_kg * g, np.zeros(3))
        each.pose(Pose(0.0, np.zeros(3), np.array([1.0, 0.0, 0.0, 0.0])))
    late = []
    for k in range(1, 200):
        now_s = 0.01 * k
        rate = np.array([np.sin(3.0 * now_s), 0.5 * np.cos(2.0 * now_s), 0.2])
        for each in (predictor, truth):
            each.command(now_s, mass_kg * g * (1.0 + 0.1 * np.sin(4.0 * now_s)), rate)
        true = truth.at(now_s)
        truth._last = true
        late.append(Pose(now_s, true.position_world_m, true.q_world_body))
        if k > 5:
            predictor.pose(late.pop(0))
    now = predictor.at(now_s)
    assert np.abs(now.position_world_m - true.position_world_m).max() < 2e-3
    assert np.abs(now.rate_body_rad_s - true.rate_body_rad_s).max() < 0.02


ONE = np.array([1.0, 0.0, 0.0, 0.0])


def test_while_nobody_knows_the_commands_poses_tell_the_motion_and_the_next_command_goes_on_from_it():
    """Another flies it for a second, climbing and turning; what was asked for meanwhile is not what moves it."""
    mass_kg, g, lags = 0.7, 9.81, Lags(0.0, 0.03, 0.04)
    predictor, truth = Predictor(mass_kg, g, lags), Predictor(mass_kg, g, lags)
    predictor.on_ground = truth.on_ground = False
    errors, forces = [], []
    for k in range(300):
        now_s, unknown = 0.01 * k, 100 <= k < 200
        force_n = mass_kg * g * (1.2 if unknown else 1.0)
        rate = np.array([0.3, 0.0, 0.5]) if unknown else np.zeros(3)
        truth.command(now_s, force_n, rate)
        if unknown:
            predictor.unknown(now_s)
        else:
            predictor.command(now_s, force_n, rate)
        truth._last = truth.at(now_s) if k else Motion(0.0, *np.zeros((2, 3)), ONE, np.zeros(3), force_n)
        predictor.pose(Pose(now_s, truth._last.position_world_m, truth._last.q_world_body))
        now = predictor.at(now_s)
        errors.append(now.velocity_world_m_s - truth._last.velocity_world_m_s)
        forces.append(now.force_n / (mass_kg * g))
    assert np.abs(errors[150:]).max() < 0.05
    assert np.abs(np.array(forces[150:199]) - 1.2).max() < 0.05
    assert np.abs(np.diff(forces[190:])).max() < 0.06
    assert now.unexplained_world_m_s2 == pytest.approx(np.zeros(3), abs=0.05)


def test_a_pose_that_jumps_is_not_used():
    predictor = Predictor(0.7, 9.81)
    for k in range(20):
        predictor.pose(Pose(0.01 * k, np.zeros(3), np.array([1.0, 0.0, 0.0, 0.0])))
    last_s = predictor.pose_time_s
    assert not predictor.pose(Pose(0.2, np.array([1.0, 0.0, 0.0]), np.array([1.0, 0.0, 0.0, 0.0])))
    assert predictor.pose_time_s == last_s
    assert predictor.refused == 1


def seen(predictor: Predictor, time_s: float, x_m: float) -> bool:
    return predictor.pose(Pose(time_s, np.array([x_m, 0.0, 0.0]), np.array([1.0, 0.0, 0.0, 0.0])))


@pytest.mark.parametrize("jump_m", [0.4, 0.5, 0.7])
def test_a_jump_is_refused_until_poses_are_stale(jump_m):
    predictor = Predictor(0.7, 9.81)
    predictor.on_ground = False
    for k in range(50):
        predictor.command(0.01 * k, 0.7 * 9.81, np.zeros(3))
        seen(predictor, 0.01 * k, 0.0)
    for k in range(50, 80):
        predictor.command(0.01 * k, 0.7 * 9.81, np.zeros(3))
        assert not seen(predictor, 0.01 * k, jump_m)


def test_a_vehicle_that_is_carried_on_the_ground_is_there_and_one_in_the_air_is_not():
    for on_ground in (True, False):
        predictor = Predictor(0.7, 9.81)
        predictor.on_ground = on_ground
        seen(predictor, 0.0, 0.0)
        used = [seen(predictor, 0.01 * k, 2.0) for k in range(1, 30)]
        assert any(used) is on_ground
        assert seen(predictor, 5.0, 4.0) is on_ground


def test_without_poses_the_prediction_ends_soon():
    predictor = Predictor(0.7, 9.81)
    seen(predictor, 0.0, 0.0)
    assert predictor.at(1e6).time_s == pytest.approx(0.3)


def test_a_reset_prediction_begins_at_the_next_pose():
    predictor = Predictor(0.7, 9.81)
    predictor.on_ground = False
    seen(predictor, 0.0, 0.0)
    predictor.reset()
    assert predictor.pose_time_s == -math.inf
    assert seen(predictor, 0.01, 3.0)
