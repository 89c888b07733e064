"""Residual force and torque as arrows at the vehicle: turned into the world, to scale, and none where none is known."""

from types import SimpleNamespace
from unittest.mock import MagicMock

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from flight import rotations
from gcs_web.comparison import arrows
from gcs_web.comparison.arrows import Wrench
from gcs_web.comparison.flight_scene import FlightScene
from gcs_web.flights.recorded import Path3D
from gcs_web.protocol.comparison import ArrowScale

TIME_S = np.linspace(0.0, 10.0, 101)
SIDEWAYS = rotations.from_yaw(np.pi / 2)


def wrench(*, gap: bool = False) -> Wrench:
    """2 N forwards and 0.1 N m about body z, all the time but in the gap."""
    residual = np.tile([2.0, 0.0, 0.0, 0.0, 0.0, 0.1], (101, 1))
    if gap:
        residual[40:60] = np.nan
    return Wrench(TIME_S, residual)


def test_an_arrow_lies_along_the_world_as_the_vehicle_is_turned():
    found = arrows.at(wrench(), 5.03, SIDEWAYS, ArrowScale(4.0, 0.2))
    np.testing.assert_allclose(found, [[0.0, 0.5, 0.0], [0.0, 0.0, 0.5]], atol=1e-12)


@pytest.mark.parametrize("time_s", [-0.1, 10.1, 4.5, 3.95, np.nan])
def test_there_is_no_arrow_in_a_gap_nor_outside_the_flight(time_s):
    assert arrows.at(wrench(gap=True), time_s, SIDEWAYS, ArrowScale(1.0, 1.0)) is None
    assert arrows.at(wrench(), 5.0, np.full(4, np.nan), ArrowScale(1.0, 1.0)) is None


@given(force_n=st.floats(1e-6, 1e4), torque_n_m=st.floats(1e-6, 1e4))
def test_a_metre_is_a_round_number_and_a_large_residual_about_as_long(force_n, torque_n_m):
    found = arrows.scale([Wrench(TIME_S, np.tile([force_n, 0, 0, 0, 0, torque_n_m], (101, 1)))])
    assert found is not None
    for size, metre in ((force_n, found.force_n_per_m), (torque_n_m, found.torque_n_m_per_m)):
        assert 0.39 * arrows.LONGEST_M < size / metre <= arrows.LONGEST_M * (1.0 + 1e-6)
        assert f"{metre:.6e}"[0] in "125"
        assert float(f"{metre:.0e}") == pytest.approx(metre)


def test_where_nothing_is_known_there_is_no_scale():
    assert arrows.scale([]) is None
    assert arrows.scale([Wrench(TIME_S, np.full((101, 6), np.nan))]) is None


def test_the_arrows_begin_at_the_vehicle_follow_the_moved_clock_and_go_in_a_gap(monkeypatch):
    monkeypatch.setattr("gcs_web.scene.drawing.draw_vehicle", MagicMock())
    shown, node = FlightScene(MagicMock()), SimpleNamespace(visible=False, points=None, remove=lambda: None)
    monkeypatch.setattr("gcs_web.scene.drawing.draw_arrows", lambda *_: node)
    position_m = np.stack([TIME_S, 0.0 * TIME_S, 1.0 + 0.0 * TIME_S], axis=1)
    path = Path3D(TIME_S, position_m, np.tile(SIDEWAYS, (101, 1)), None, None)
    scale, _ = shown.draw({"a": path}, {}, {"a": 2.0}, {"a": wrench(gap=True)}, {})
    assert scale == ArrowScale(2.0, pytest.approx(0.1))
    shown.look(4.0)  # 2 s of the flight
    assert node.visible
    np.testing.assert_allclose(node.points, [[[2, 0, 1], [2, 1, 1]], [[2, 0, 1], [2, 0, 2]]], atol=1e-6)
    shown.look(7.0)  # 5 s: in the gap
    assert not node.visible
    shown.look(2.0)
    assert node.visible
    shown.look(None)
    assert not node.visible
    assert shown.draw({"a": path}, {}, {}, {}, {}) == (None, None)
