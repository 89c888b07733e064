"""Each condition of arming on its own, and what makes it pass."""

import numpy as np
import pytest

from firmware_bridge import arming
from firmware_bridge.dialect.generated.messages import MissionState, State
from flight import LinkError, rotations

PARAMETERS = {"battery_arm_v": 14.0, "start_radius_m": 0.5} | {
    f"fence_{end}_{axis}_m": sign * 4.0 for end, sign in (("min", -1), ("max", 1)) for axis in "xyz"
}
START = np.array([1.0, 2.0, 1.5])


def said(**changed) -> State:
    on_ground = {
        "position_world_m": (1.0, 2.0, 0.0), "q_world_body": (1.0, 0.0, 0.0, 0.0), "battery_v": 15.0,
        "mission_state": MissionState.DISARMED,
    }  # fmt: skip
    return State(**(on_ground | changed))


def failed(state: State) -> set[str]:
    return {check.name for check in arming.checks(state, PARAMETERS, START) if not check.passed}


def tilted(tilt_deg: float) -> tuple[float, ...]:
    return tuple(rotations.exp([np.radians(tilt_deg), 0.0, 0.0]))


@pytest.mark.parametrize(
    ("passes", "fails", "name"),
    [
        ({"position_world_m": (1.49, 2.0, 0.0)}, {"position_world_m": (1.51, 2.0, 0.0)}, "start"),
        ({"mission_state": MissionState.ARMED}, {"mission_state": MissionState.FAULT}, "mission state"),
        ({"mission_state": MissionState.ARMED}, {"mission_state": MissionState.HOLD}, "mission state"),
        ({}, {"estimate_faults": 1}, "estimator"),
        ({}, {"estimate_faults": 4}, "estimator"),
        ({}, {"estimate_faults": 32}, "estimator"),
        ({"q_world_body": tilted(45.0)}, {"q_world_body": tilted(46.0)}, "level"),
        ({"velocity_world_m_s": (0.0, 0.49, 0.0)}, {"velocity_world_m_s": (0.0, 0.51, 0.0)}, "at rest"),
        ({"rate_body_rad_s": (0.49, 0.0, 0.0)}, {"rate_body_rad_s": (0.51, 0.0, 0.0)}, "at rest"),
        ({"battery_v": 14.01}, {"battery_v": 13.99}, "battery"),
        ({"battery_v": 0.0}, {"battery_v": 1.0}, "battery"),  # 0: not measured
    ],
)  # fmt: skip
def test_a_condition_passes_and_fails_on_the_two_sides_of_its_bound(passes, fails, name):
    assert failed(said(**passes)) == set()
    assert failed(said(**fails)) == {name}


def test_a_take_off_out_of_the_geofence_is_named():
    lower = PARAMETERS | {"fence_max_z_m": 1.4}
    found = {check.name: check for check in arming.checks(said(), lower, START)}
    assert not found["geofence"].passed
    assert found["start"].passed


def test_a_start_below_the_lowest_take_off_is_measured_from_the_end_of_the_take_off():
    low = np.array([1.0, 2.0, 0.1])
    (start,) = (c for c in arming.checks(said(), PARAMETERS | {"start_radius_m": 0.19}, low) if c.name == "start")
    assert not start.passed
    assert "0.20 m" in start.finding


def test_all_that_fails_is_told_with_its_remedy_at_once():
    found = arming.checks(said(battery_v=12.0, estimate_faults=1), PARAMETERS, START)
    with pytest.raises(LinkError, match=r"no usable position; start the localization.*12\.0 V, at least 14\.0 V; ch"):
        arming.required(found)
    arming.required(arming.checks(said(), PARAMETERS, START))
