"""The lag of motors is known no better than the time of the commands that it follows."""

from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from sysid.estimator.flights.clocks import COMMAND
from sysid.estimator.flights.sampling import Signal
from sysid.estimator.joint_problem.unknowns import Unknowns
from sysid.estimator.uncertainty.sampled_commands import LAGS, variances

UNKNOWNS = Unknowns(("thrust_quadratic.k_n_s2", *LAGS), (), ("bias",))
NODE_S, SAMPLE_S = 0.01, 0.005


def flight(*, has_pose: bool, on_time: bool, driven: bool = True) -> Any:
    time_s = SAMPLE_S * np.arange(100.0)
    streams = {COMMAND: Signal.held(time_s, np.ones((100, 4)))}
    step_s = np.full(49, NODE_S)
    how = {"has_pose": has_pose, "commands_on_time": on_time, "driven_by_command": driven}
    return cast("Any", SimpleNamespace(streams=streams, step_s=step_s, **how))


@pytest.mark.parametrize("has_pose", [True, False])
def test_a_lag_is_off_by_up_to_a_sample_where_the_delay_of_commands_is_not_estimated(has_pose):
    found = variances([flight(has_pose=has_pose, on_time=True)], UNKNOWNS)
    assert found[1:3] == pytest.approx(SAMPLE_S**2 / 12.0)
    assert not found[[0, 3]].any()


@pytest.mark.parametrize("has_pose", [True, False])
def test_an_estimated_delay_takes_it_up(has_pose):
    shown = flight(has_pose=has_pose, on_time=False)
    assert not variances([shown], UNKNOWNS).any()
    assert not variances([shown, flight(has_pose=True, on_time=True)], UNKNOWNS).any()


def test_flights_with_measured_rotor_speed_say_nothing_of_it():
    measured = flight(has_pose=True, on_time=False, driven=False)
    assert not variances([measured], UNKNOWNS).any()
    found = variances([flight(has_pose=True, on_time=True), measured], UNKNOWNS)
    assert found[1:3] == pytest.approx(SAMPLE_S**2 / 12.0)
