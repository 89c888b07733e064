"""The lag of motors is known no better than the time of the commands that it follows."""

from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

import vehicle as vehicles
from sysid.estimator.flights.clocks import COMMAND
from sysid.estimator.flights.sampling import Signal
from sysid.estimator.joint_problem.unknowns import Unknowns
from sysid.estimator.uncertainty.sampled_commands import LAGS, variances

UNKNOWNS = Unknowns(("thrust_quadratic.k_n_s2", *LAGS), (), ("bias",))
NODE_S, SAMPLE_S = 0.01, 0.005
LAGGING = vehicles.example("hummingbird").with_effect("motor_lag", rise_s=0.03, fall_s=0.04)


def flight(*, has_pose: bool, on_time: bool, driven: bool = True) -> Any:
    time_s = SAMPLE_S * np.arange(100.0)
    streams = {COMMAND: Signal.held(time_s, np.ones((100, 4)))}
    step_s = np.full(49, NODE_S)
    how = {"has_pose": has_pose, "commands_on_time": on_time, "driven_by_command": driven}
    return cast("Any", SimpleNamespace(streams=streams, step_s=step_s, **how))


@pytest.mark.parametrize("has_pose", [True, False])
def test_a_lag_is_off_by_up_to_a_sample_where_the_delay_of_commands_is_not_estimated(has_pose):
    found = variances([flight(has_pose=has_pose, on_time=True)], UNKNOWNS, LAGGING)
    assert found[1:3] == pytest.approx(SAMPLE_S**2 / 12.0)
    assert not found[[0, 3]].any()


def test_a_pose_that_shows_the_delay_leaves_nothing_open():
    shown = flight(has_pose=True, on_time=False)
    assert not variances([shown], UNKNOWNS, LAGGING).any()
    assert not variances([shown, flight(has_pose=True, on_time=True)], UNKNOWNS, LAGGING).any()


@pytest.mark.parametrize(("lag_s", "left_s"), [(0.04, SAMPLE_S**2 / 0.08), (1e-3, SAMPLE_S / np.sqrt(12.0))])
def test_without_a_pose_an_estimated_delay_leaves_what_is_of_second_order(lag_s, left_s):
    vehicle = LAGGING.with_effect("motor_lag", rise_s=lag_s, fall_s=lag_s)
    found = variances([flight(has_pose=False, on_time=False)], UNKNOWNS, vehicle)
    assert np.sqrt(found[1:3]) == pytest.approx(left_s)


def test_flights_with_measured_rotor_speed_say_nothing_of_it():
    measured = flight(has_pose=True, on_time=False, driven=False)
    assert not variances([measured], UNKNOWNS, LAGGING).any()
    found = variances([flight(has_pose=True, on_time=True), measured], UNKNOWNS, LAGGING)
    assert found[1:3] == pytest.approx(SAMPLE_S**2 / 12.0)
