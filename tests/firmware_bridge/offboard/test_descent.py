"""A descent without the planner, of a point mass: it ends on the ground, softly, whatever its sensors say."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import pytest

from firmware_bridge.offboard.descent import Descent
from firmware_bridge.offboard.firmware import FirmwareState
from firmware_bridge.offboard.prediction import Motion

G, HOVER_N, MASS_KG = 9.81, 7.0, 7.0 / 9.81
STEP_S = 0.004
LEVEL = np.array([1.0, 0.0, 0.0, 0.0])


@dataclass
class Body:
    """Vertical motion, rotors with a lag, damped by inflow."""

    height_m: float
    climb_m_s: float = 0.0
    force_n: float = HOVER_N
    touch_m_s: float = 0.0

    def step(self, force_n: float) -> None:
        self.force_n += (force_n - self.force_n) * STEP_S / 0.035
        self.climb_m_s += STEP_S * (self.force_n / MASS_KG - G - 0.32 * self.climb_m_s)
        self.height_m += STEP_S * self.climb_m_s
        if self.height_m <= 0.0:
            self.touch_m_s = max(self.touch_m_s, -self.climb_m_s)
            self.height_m, self.climb_m_s = 0.0, max(self.climb_m_s, 0.0)


Sense = Callable[[float, Body, FirmwareState], Motion | None]


def descended(
    sense: Sense, *, height_m: float = 2.0, told_m: float | None = None, longest_s: float = 60.0
) -> tuple[Body, float, float]:
    """The body, when it landed, and its height then."""
    body, firmware = Body(height_m), FirmwareState(roll_pitch_rad=np.zeros(2))
    descent = Descent(0.0, HOVER_N, height_m if told_m is None else told_m, G)
    for k in range(1, round(longest_s / STEP_S)):
        now_s = k * STEP_S
        firmware.attitude_s = now_s
        motion = sense(now_s, body, firmware)
        force_n, _ = descent.force_and_rate(now_s, firmware, motion)
        if descent.landed:
            return body, now_s, body.height_m
        body.step(force_n)
    return body, np.inf, body.height_m


def by_poses(now_s: float, body: Body, firmware: FirmwareState) -> Motion:
    velocity = np.array([0.0, 0.0, body.climb_m_s])
    return Motion(now_s, np.array([0.0, 0.0, body.height_m]), velocity, LEVEL, np.zeros(3), body.force_n)


def barometer(noise_m_s: float = 0.0) -> Sense:
    rng = np.random.default_rng(0)

    def sense(now_s: float, body: Body, firmware: FirmwareState) -> None:
        firmware.has_barometer, firmware.altitude_s, firmware.altitude_changed_s = True, now_s, now_s
        firmware.altitude_m = body.height_m
        firmware.climb_m_s = body.climb_m_s + noise_m_s * float(rng.standard_normal())

    return sense


def stuck(now_s: float, body: Body, firmware: FirmwareState) -> None:
    """A barometer that has said the same for ever."""
    firmware.has_barometer, firmware.altitude_s = True, now_s
    firmware.altitude_m = firmware.climb_m_s = 0.0


def blind(now_s: float, body: Body, firmware: FirmwareState) -> None: ...


@pytest.mark.parametrize("height_m", [0.4, 2.0, 8.0])
@pytest.mark.parametrize("sense", [by_poses, barometer(), blind, stuck])
def test_it_is_on_the_ground_before_it_says_so_and_came_down_softly(sense, height_m):
    body, landed_s, left_m = descended(sense, height_m=height_m)
    assert landed_s < 60.0
    assert left_m == 0.0
    assert body.touch_m_s < 1.5


def frozen(now_s: float, body: Body, firmware: FirmwareState) -> Motion:
    """Poses that say that nothing moves."""
    return Motion(now_s, np.array([0.0, 0.0, 2.0]), np.zeros(3), LEVEL, np.zeros(3), body.force_n)


def test_sensors_that_stand_still_never_say_landed_in_the_air():
    """Nor does it cut the rotors before its bound, by which the body has long been down."""
    _, _, left_m = descended(frozen, height_m=6.0)
    assert left_m == 0.0


def test_a_gust_that_carries_it_near_the_ground_is_not_the_ground():
    began_s = 0.0

    def carried(now_s: float, body: Body, firmware: FirmwareState) -> Motion:
        nonlocal began_s
        if body.height_m < 0.4:
            began_s = began_s or now_s
            body.climb_m_s += STEP_S * 2.0 * (now_s - began_s < 0.8)
        return by_poses(now_s, body, firmware)

    _, landed_s, left_m = descended(carried, height_m=2.0)
    assert landed_s < 60.0
    assert left_m == 0.0


@pytest.mark.parametrize("noise_m_s", [0.3, 0.6])
def test_a_barometer_that_shakes_in_ground_wash_keeps_no_vehicle_armed_for_ever(noise_m_s):
    _, landed_s, left_m = descended(barometer(noise_m_s), height_m=2.0)
    assert landed_s < 2.0 / 0.3 + 10.0 + 5.0
    assert left_m == 0.0


def test_upside_down_it_does_not_push_itself_down():
    firmware = FirmwareState(roll_pitch_rad=np.array([np.pi - 0.1, 0.0]), attitude_s=0.004)
    force_n, rate = Descent(0.0, HOVER_N, 2.0, G).force_and_rate(0.004, firmware, None)
    assert force_n <= 0.1 * HOVER_N
    assert abs(rate[0]) > 0.3  # and turns back


def test_a_pose_of_no_time_is_none():
    motion = by_poses(0.004, Body(2.0, -5.0), FirmwareState())
    motion.time_s = np.nan
    descent = Descent(0.0, HOVER_N, 2.0, G)
    force_n, _ = descent.force_and_rate(0.004, FirmwareState(), motion)
    assert force_n < HOVER_N  # as blind, not as falling
