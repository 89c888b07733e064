"""What a plan may ask of an autopilot's own position loops."""

import numpy as np
import pytest
from numpy.typing import ArrayLike

from firmware_bridge.autopilot.loop_limits import Asked, require_within
from flight import InputError
from tests.firmware_bridge.autopilot import flights
from tests.firmware_bridge.autopilot.test_checks import found
from tests.firmware_bridge.autopilot.test_flights import HOVER, by_targets
from tests.firmware_bridge.offboard import curves


def asked(velocity=(0.0, 0.0, 0.0), acceleration=(0.0, 0.0, 0.0), tilt_deg: ArrayLike = 0.0) -> Asked:
    """At rest but for an instant, at 1 s."""
    along = np.array([0.0, 1.0, 0.0])
    return Asked(
        along * 1.0, np.outer(along, velocity), np.outer(along, acceleration), np.deg2rad(tilt_deg) * along
    )  # fmt: skip


@pytest.mark.parametrize(
    ("kind", "name", "value", "asks", "said"),
    [
        ("px4", "MPC_XY_VEL_MAX", 5.0, {"velocity": (-3.0, 4.0, 0.0)}, "flies 5.00 m/s at 1.0 s, at most 4.50"),
        ("px4", "MPC_Z_VEL_MAX_UP", 3.0, {"velocity": (0.0, 0.0, 2.8)}, "climbs 2.80 m/s at 1.0 s, at most 2.70"),
        ("px4", "MPC_Z_VEL_MAX_DN", 1.5, {"velocity": (0.0, 0.0, -1.5)}, "sinks 1.50 m/s at 1.0 s, at most 1.35"),
        ("px4", "MPC_TILTMAX_AIR", 45.0, {"tilt_deg": 42.0}, "tilts 42.00 deg at 1.0 s, at most 40.50"),
        ("ardupilot", "WPNAV_SPEED", 500.0, {"velocity": (-3.0, 4.0, 0.0)}, "set WPNAV_SPEED to 556, or leave out"),
        ("ardupilot", "WPNAV_SPEED_UP", 250.0, {"velocity": (0.0, 0.0, 2.4)}, "climbs 2.40 m/s"),
        ("ardupilot", "WPNAV_SPEED_DN", 150.0, {"velocity": (0.0, 0.0, -1.5)}, "sinks 1.50 m/s"),
        ("ardupilot", "WPNAV_ACCEL", 250.0, {"acceleration": (1.5, -2.0, 0.0)}, "speeds up or bends by 2.50 m/s2"),
        ("ardupilot", "WPNAV_ACCEL_Z", 100.0, {"acceleration": (0.0, 0.0, -1.0)}, "speeds up or down by 1.00 m/s2"),
        ("ardupilot", "ANGLE_MAX", 3000.0, {"tilt_deg": 28.0}, "tilts 28.00 deg at 1.0 s, at most 27.00"),
        ("ardupilot", "PSC_ANGLE_MAX", 20.0, {"tilt_deg": 19.0}, "tilts 19.00 deg at 1.0 s, at most 18.00"),
    ],
)  # fmt: skip
def test_a_plan_beyond_a_limit_is_refused_with_the_figure(kind, name, value, asks, said):
    told = found(kind, **{name: value})
    with pytest.raises(InputError, match=name) as refused:
        require_within(told, asked(**asks))
    assert said in str(refused.value)
    assert len(str(refused.value).split()) <= 30
    require_within(told, asked(**{what: 0.85 * np.array(figure) for what, figure in asks.items()}))


@pytest.mark.parametrize("name", ["MPC_Z_VEL_MAX_DN", "MPC_TILTMAX_AIR"])
def test_a_limit_that_is_not_told_is_refused(name):
    with pytest.raises(InputError, match=f"does not tell {name}"):
        require_within(found("px4", **{name: None}), asked())


def test_the_limits_are_read_and_compared_before_anything_is_armed():
    """ArduPilot's own 2.5 m/s2; by rates and thrust the same circle passes."""
    simulation = flights.simulated(curves.circle(), "ardupilot", parameters={"WPNAV_ACCEL": 250.0})
    flown, _ = by_targets(simulation)
    assert "the plan speeds up or bends by 3.02 m/s2" in flown.error
    assert "set WPNAV_ACCEL to 336, or leave out targets=position" in flown.error
    assert not simulation.setpoints


def test_a_plan_that_is_too_slow_for_targets_is_named_before_it_is_armed():
    simulation = flights.simulated(HOVER, prearm="compass")
    _, said = by_targets(simulation, HOVER, cancel=lambda: True)
    assert said[0] == "flown by rates and thrust alone: position targets are for above 1.4 m/s"
