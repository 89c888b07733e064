"""What the guard learns of a flight: lift-off, height, and the force that hovers."""

import numpy as np
import pytest

from firmware_bridge.offboard.airborne import Airborne
from firmware_bridge.offboard.firmware import FirmwareState
from firmware_bridge.offboard.poses import Pose

MASS_KG, G = 0.7, 9.81
WEIGHT_N = MASS_KG * G


def pose(time_s: float, z_m: float) -> Pose:
    return Pose(time_s, np.array([0.0, 0.0, z_m]), np.array([1.0, 0.0, 0.0, 0.0]))


def standing(z_m: float = 0.2) -> Airborne:
    airborne = Airborne(MASS_KG, G)
    for k in range(50):
        airborne.pose(pose(0.01 * k, z_m), armed=False)
    return airborne


def test_idling_rotors_are_no_flight():
    airborne = standing()
    for k in range(1000):
        airborne.pose(pose(0.5 + 0.004 * k, 0.25), armed=True)
        airborne.commanded(0.004, 0.9 * WEIGHT_N, armed=True)
    assert not airborne.lifted


def test_a_vehicle_that_is_carried_does_not_fly():
    airborne = standing()
    airborne.pose(pose(1.0, 1.5), armed=True)
    airborne.commanded(0.004, 0.1 * WEIGHT_N, armed=True)
    airborne.commanded(0.004, 1.0 * WEIGHT_N, armed=False)
    assert not airborne.lifted


def test_it_has_lifted_off_when_it_rose_by_its_own_force():
    airborne = standing()
    airborne.pose(pose(1.0, 0.31), armed=True)
    airborne.commanded(0.004, 0.9 * WEIGHT_N, armed=True)
    assert airborne.lifted


def test_it_has_lifted_off_by_its_force_where_poses_stand_still():
    airborne = standing()
    for _ in range(150):
        airborne.commanded(0.004, 1.1 * WEIGHT_N, armed=True)
    assert airborne.lifted


def test_the_ground_is_not_a_first_wrong_pose():
    airborne = Airborne(MASS_KG, G)
    airborne.pose(pose(0.0, -3.0), armed=False)
    for k in range(50):
        airborne.pose(pose(0.01 * k, 0.0), armed=False)
    airborne.pose(pose(1.0, 2.0), armed=True)
    assert airborne.height_m(1.0, FirmwareState(), lying=False) == pytest.approx(2.0)


def test_the_hover_force_is_vertical_and_of_moments_that_neither_rise_nor_fall():
    airborne = Airborne(MASS_KG, G)
    for k in range(3000):
        tilt_rad = 0.52
        airborne.hovers(0.02, 1.02 * WEIGHT_N / np.cos(tilt_rad), np.cos(tilt_rad), 0.1)
        airborne.hovers(0.02, 1.35 * WEIGHT_N, 1.0, 3.0 if k % 2 else -3.0)
    assert airborne.hover_n == pytest.approx(1.02 * WEIGHT_N, rel=1e-3)


def test_a_height_by_poses_that_lied_is_taken_as_more_and_a_barometer_counts_if_it_lives():
    airborne = standing(0.0)
    airborne.pose(pose(1.0, 2.0), armed=True)
    barometer = FirmwareState(has_barometer=True, altitude_m=4.0, altitude_changed_s=1.0)
    assert airborne.height_m(1.0, FirmwareState(), lying=True) == pytest.approx(3.0)
    assert airborne.height_m(1.5, barometer, lying=False) == pytest.approx(4.0)
    assert airborne.height_m(9.0, barometer, lying=False) == pytest.approx(2.0)


@pytest.mark.parametrize(("z_m", "age_s", "flies"), [(0.22, 0.1, False), (1.5, 0.1, True), (0.22, 5.0, True)])
def test_a_pilots_vehicle_flies_unless_poses_of_now_see_it_on_the_ground(z_m, age_s, flies):
    airborne = standing()
    airborne.pose(pose(10.0, z_m), armed=True)
    airborne.piloted(10.0 + age_s)
    assert airborne.lifted is flies
