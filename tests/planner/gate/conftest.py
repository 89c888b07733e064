"""The gate's answer for a trajectory made by hand."""

import dataclasses

import numpy as np
import pytest

from planner import Conditions, PlanOptions
from planner.gate import gate


@pytest.fixture
def verdicts(open_sky, drone):
    def ask(path, waypoints=None, tolerance_m=0.25, options=None, yaw=None, **conditions):
        options = PlanOptions(yaw="free") if options is None else options
        report = gate.check(
            path,
            open_sky,
            drone,
            dataclasses.replace(options, waypoint_tolerance_m=tolerance_m),
            waypoints_world_m=None if waypoints is None else np.array(waypoints, dtype=float),
            yaw_rad=yaw,
            conditions=Conditions(**conditions),
        )
        return {check.name: check for check in report.checks}

    return ask
