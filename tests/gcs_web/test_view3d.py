"""What clicks in the 3D view do, without a browser."""

from types import SimpleNamespace
from unittest.mock import MagicMock

import numpy as np
import pytest

from gcs_web import protocol, scene
from gcs_web.view3d import View3D

WALL_X_M = 2.0


class Wall:
    """A surface at WALL_X_M that faces the viewer."""

    def first_hit(self, origin_m, direction):
        return np.array([WALL_X_M, 0.0, 1.0]), np.array([-1.0, 0.0, 0.0])


@pytest.fixture
def view(monkeypatch, tmp_path) -> View3D:
    monkeypatch.setattr(scene, "draw_path", MagicMock())
    monkeypatch.setattr(scene, "draw_vehicle", MagicMock())
    return View3D(MagicMock(), triangles=1, cache=tmp_path)


def click(y_m: float = 0.0) -> SimpleNamespace:
    """A ray along x."""
    return SimpleNamespace(ray_origin=(0.0, y_m, 1.0), ray_direction=(1.0, 0.0, 0.0))


def series() -> protocol.Series:
    """Along y at x = 1 m and z = 1 m, with 1 m/s."""
    y_m = np.linspace(-1.0, 1.0, 21).tolist()
    same = dict.fromkeys(protocol.Series.__struct_fields__, [1.0] * 21)
    return protocol.Series(**{**same, "y_m": y_m, "time_s": [y + 1.0 for y in y_m]})


def test_the_first_waypoint_before_a_wall_keeps_the_required_clearance(view: View3D):
    view.require_clearance(0.45)
    view._surface = Wall()
    placed = []
    view.on_add = lambda after, position_m: placed.append(position_m)
    view._shift_clicked(click())
    assert WALL_X_M - placed[0][0] >= 0.45


def test_a_click_on_the_path_answers_only_while_the_plan_is_checked(view: View3D):
    chosen = []
    view.on_moment = chosen.append
    view.draw_plan(series())
    view._clicked(click(0.5))
    assert chosen == [pytest.approx(1.5)]
    view.draw_plan(None)
    view._clicked(click(0.5))
    assert len(chosen) == 1
