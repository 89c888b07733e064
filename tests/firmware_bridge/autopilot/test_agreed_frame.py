"""Whether the autopilot may be told where to be: only in the frame of the poses."""

import numpy as np
import pytest

from firmware_bridge.autopilot.agreed_frame import AGREED_S, MOVED_M, OLD_S, READY_M, READY_RAD, AgreedFrame
from firmware_bridge.offboard.poses import Pose
from flight import rotations

STEP_S = 0.01


class Seen:
    """One frame beside poses that come late, as both tell of one vehicle."""

    def __init__(self, *, off_m: float = 0.0, turned_rad: float = 0.0, compass_rad: float = 0.0) -> None:
        self.frame, self.now_s = AgreedFrame(), 10.0
        self.off_m, self.turned_rad, self.compass_rad = off_m, turned_rad, compass_rad
        self.at_m, self.silent, self.q = np.array([1.0, 2.0, 0.0]), False, rotations.exp(np.array([0.1, -0.2, 0.4]))

    def stay(self, seconds: float, *, velocity_m_s: tuple[float, float] = (0.0, 0.0), carried: bool = False) -> "Seen":
        self.frame.armed |= any(velocity_m_s) and not carried
        for _ in range(round(seconds / STEP_S)):
            self.now_s += STEP_S
            self.at_m = self.at_m + STEP_S * np.array([*velocity_m_s, 0.0])
            turn = rotations.from_yaw(self.turned_rad)
            if not self.silent:
                self.frame.position(self.now_s, rotations.rotate(turn, self.at_m) + np.array([self.off_m, 0.0, 0.0]))
                own = rotations.from_yaw(self.turned_rad + self.compass_rad)
                self.frame.attitude(self.now_s, rotations.multiply(own, self.q))
            self.frame.pose(Pose(self.now_s, self.at_m, self.q))
        return self

    @property
    def unready(self) -> str:
        return self.frame.unready(self.now_s)

    @property
    def told(self) -> bool:
        return self.frame.at(self.now_s)


@pytest.mark.parametrize(
    ("more", "seconds", "said"),
    [
        ({}, 2.0 * AGREED_S, ""),
        ({}, 0.5 * AGREED_S, "have not agreed for 0.5 s yet"),
        ({"off_m": 0.9 * READY_M}, 2.0 * AGREED_S, ""),
        ({"off_m": 1.1 * READY_M}, 2.0 * AGREED_S, "is 0.11 m from its poses, at most 0.1; give its estimator"),
        ({"off_m": np.nan}, 2.0 * AGREED_S, "from its poses"),
        ({"compass_rad": 0.9 * READY_RAD}, 2.0 * AGREED_S, ""),
        ({"compass_rad": -1.2 * READY_RAD}, 2.0 * AGREED_S, "heading is 6 deg off its poses', at most 5"),
        ({"compass_rad": np.nan}, 2.0 * AGREED_S, "heading"),
    ],
)
def test_it_may_be_armed_where_place_and_heading_have_long_agreed(more, seconds, said):
    unready = Seen(**more).stay(seconds).unready
    assert said in unready if said else not unready


def test_the_heading_is_about_the_vertical_however_far_it_is_tilted():
    """About the body's z axis a turn of 6 degrees would pass for 3."""
    seen = Seen(compass_rad=1.2 * READY_RAD)
    seen.q = rotations.exp(np.array([1.0, 0.0, 0.0]))
    assert "heading is 6 deg off" in seen.stay(1.0).unready


def test_it_is_told_only_after_a_way_that_agreed_too():
    seen = Seen().stay(1.0)
    assert not seen.told
    assert not seen.stay(0.9 * MOVED_M, velocity_m_s=(1.0, 0.0)).told
    assert seen.stay(0.5 * MOVED_M, velocity_m_s=(0.0, 2.0)).told


def test_one_that_is_carried_about_may_be_armed_where_it_is_put_down():
    """And away from its poses meanwhile; the way counts from there."""
    seen = Seen().stay(1.0).stay(1.2, velocity_m_s=(1.0, 0.0), carried=True)
    seen.silent = True
    assert "nothing came" in seen.stay(1.5 * OLD_S).unready
    seen.silent = False
    assert not seen.stay(2.0 * AGREED_S).unready
    assert not seen.told
    assert not seen.stay(0.9 * MOVED_M, velocity_m_s=(1.0, 0.0)).told
    assert seen.stay(0.3 * MOVED_M, velocity_m_s=(1.0, 0.0)).told


def test_a_place_that_parts_in_flight_may_be_that_of_a_late_word():
    seen = Seen().stay(1.0).stay(3.0, velocity_m_s=(1.0, 0.0))
    seen.off_m = 0.25
    assert seen.stay(0.1).told
    seen.off_m = 0.35
    assert not seen.stay(0.1).told
    assert seen.frame.apart.endswith(
        "is 0.35 m from its poses, at most 0.3; it is another frame, or its words come late"
    )


def test_a_way_in_another_direction_is_of_another_frame_though_heading_and_place_agree():
    """A compass that is as wrong as the frame is turned; about where the vehicle stands."""
    turned_rad = np.deg2rad(12.0)
    seen = Seen(turned_rad=turned_rad, compass_rad=-turned_rad)
    seen.at_m = np.zeros(3)
    assert not seen.stay(1.0).unready
    assert not seen.stay(1.1, velocity_m_s=(1.0, 0.0)).told
    assert "the autopilot's way differs from its poses' by 21% of it, at most 15%" in seen.frame.apart


@pytest.mark.parametrize("lost", ["jump", "turn", "silence", "drift"])
def test_one_that_parts_is_not_believed_again(lost):
    seen = Seen().stay(1.0).stay(1.5, velocity_m_s=(1.0, 0.0))
    assert seen.told
    if lost == "drift":
        for _ in range(40):
            seen.off_m += 0.01
            seen.stay(0.1)
    seen.off_m += 1.0 if lost == "jump" else 0.0
    seen.compass_rad += 0.5 if lost == "turn" else 0.0
    seen.silent = lost == "silence"
    seen.stay(1.5 * OLD_S)
    assert not seen.told
    seen.off_m = seen.compass_rad = 0.0
    seen.silent = False
    seen.stay(2.0, velocity_m_s=(1.0, 0.0))
    assert not seen.told
    assert seen.frame.apart


def test_a_late_pose_of_a_fast_vehicle_is_compared_with_what_was_said_at_its_time():
    """A word comes at once, a pose 50 ms late: at 8 m/s they would be 0.4 m apart."""
    frame, late, told = AgreedFrame(), [], []
    for i in range(300):
        now_s, at_m = 10.0 + i * STEP_S, np.array([8.0 * i * STEP_S, 0.0, 1.0])
        frame.armed = i >= 60
        frame.position(now_s, at_m)
        frame.attitude(now_s, np.array([1.0, 0.0, 0.0, 0.0]))
        late.append(Pose(now_s, at_m, np.array([1.0, 0.0, 0.0, 0.0])))
        if i >= 5:
            frame.pose(late[i - 5])
        told.append(frame.at(now_s))
    assert all(told[100:])


def test_nothing_heard_is_nothing_agreed():
    frame = AgreedFrame()
    assert "nothing came" in frame.unready(0.0)
    assert not frame.at(0.0)
