"""The vehicle as predicted: its measured pose and what the prediction was off, and nothing where none was made."""

from types import SimpleNamespace
from unittest.mock import MagicMock

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from flight import rotations
from gcs_web.comparison import predicted
from gcs_web.comparison.flight_scene import FlightScene
from gcs_web.flights.recorded import Path3D
from sysid.estimator.validation.comparison import Deviation

TIME_S = np.linspace(0.0, 10.0, 101)


def deviation(*, gap: bool = False) -> Deviation:
    """0.2 m sideways and 0.3 rad about body z, all the time but in the gap."""
    pose = np.tile([0.0, 0.2, 0.0, 0.0, 0.0, 0.3], (101, 1))
    if gap:
        pose[40:60] = np.nan
    return Deviation(TIME_S, pose)


@given(
    off_m=st.tuples(*[st.floats(-5.0, 5.0)] * 3), turn=st.tuples(*[st.floats(-1.5, 1.5)] * 3), yaw=st.floats(-3.0, 3.0)
)
def test_a_deviation_leads_from_the_measured_to_the_predicted_pose(off_m, turn, yaw):
    measured_m, q_measured = np.array([1.0, 2.0, 3.0]), rotations.from_yaw(yaw)
    q_predicted = rotations.multiply(q_measured, rotations.exp(turn))
    found = predicted.at(Deviation(TIME_S, np.tile([*off_m, *turn], (101, 1))), 5.03, measured_m, q_measured)
    assert found is not None
    np.testing.assert_allclose(found[0] - measured_m, off_m, atol=1e-12)
    assert rotations.angle_between(found[1], q_predicted) < 1e-7


@pytest.mark.parametrize("time_s", [-0.1, 10.1, 4.5, 3.95, np.nan])
def test_nothing_is_predicted_in_a_gap_nor_outside_the_comparison(time_s):
    assert predicted.at(deviation(gap=True), time_s, np.zeros(3), rotations.IDENTITY) is None
    assert predicted.at(deviation(), 5.0, np.full(3, np.nan), rotations.IDENTITY) is None


def test_the_first_vehicle_is_drawn_as_predicted_at_the_cursor_and_not_in_a_gap(monkeypatch):
    monkeypatch.setattr("gcs_web.scene.drawing.draw_vehicle", MagicMock())
    node = SimpleNamespace(visible=False, position=None, wxyz=None)
    monkeypatch.setattr("gcs_web.scene.drawing.draw_predicted", lambda *_: node)
    shown = FlightScene(MagicMock())
    position_m = np.stack([TIME_S, 0.0 * TIME_S, 1.0 + 0.0 * TIME_S], axis=1)
    path = Path3D(TIME_S, position_m, np.tile(rotations.IDENTITY, (101, 1)), None, None)
    shown.draw({"a": path, "b": path}, {}, {"a": 2.0}, {}, {"a": deviation(gap=True)})
    shown.look(4.0)  # 2 s of the flight
    assert node.visible
    np.testing.assert_allclose(node.position, [2.0, 0.2, 1.0])
    np.testing.assert_allclose(node.wxyz, rotations.from_yaw(0.3))
    shown.look(7.0)  # 5 s: in the gap
    assert not node.visible
    shown.look(2.0)
    assert node.visible
    shown.draw({"b": path, "a": path}, {}, {}, {}, {})
    shown.look(2.0)
    assert not node.visible
