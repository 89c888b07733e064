"""What clicks in the 3D view do, without a browser."""

from types import SimpleNamespace
from unittest.mock import MagicMock

import numpy as np
import pytest

from flight import rotations
from gcs_web.comparison import flight_scene
from gcs_web.flights.recorded import Path3D
from gcs_web.protocol.map import Shape
from gcs_web.protocol.plan import Draft, Series
from gcs_web.scene import drawing
from gcs_web.vehicle import vehicle_view
from gcs_web.view3d import View3D

WALL_X_M = 2.0


class Wall:
    """A surface at WALL_X_M that faces the viewer."""

    def first_hit(self, origin_m, direction):
        return np.array([WALL_X_M, 0.0, 1.0]), np.array([-1.0, 0.0, 0.0])


@pytest.fixture
def view(monkeypatch, tmp_path) -> View3D:
    monkeypatch.setattr(drawing, "draw_path", MagicMock())
    monkeypatch.setattr(drawing, "draw_vehicle", MagicMock())
    return View3D(MagicMock(), triangles=1, cache=tmp_path)


def click(y_m: float = 0.0) -> SimpleNamespace:
    """A ray along x."""
    return SimpleNamespace(ray_origin=(0.0, y_m, 1.0), ray_direction=(1.0, 0.0, 0.0))


def series() -> Series:
    """Along y at x = 1 m and z = 1 m, with 1 m/s."""
    y_m = np.linspace(-1.0, 1.0, 21).tolist()
    same = dict.fromkeys(Series.__struct_fields__, [1.0] * 21)
    return Series(**{**same, "y_m": y_m, "time_s": [y + 1.0 for y in y_m]})


def test_the_first_waypoint_before_a_wall_keeps_the_required_clearance(view: View3D):
    view.require_clearance(0.45)
    view.map.mesh.surface = Wall()
    placed = []
    view.on_add = lambda after, position_m: placed.append(position_m)
    view._shift_clicked(click())
    assert WALL_X_M - placed[0][0] >= 0.45


def test_the_brush_takes_the_drags_over_the_mesh_and_gives_them_back(view: View3D, monkeypatch):
    taken = []
    mesh = view.map.mesh
    monkeypatch.setattr(mesh._tiles, "set_drag", taken.append)
    for active in (False, True, True, False):
        mesh.paint(active)
    assert taken == [mesh._painted, None]


def test_a_slice_is_drawn_anew_by_a_preview_only_where_it_shows_another_field(view: View3D, monkeypatch):
    drawn = MagicMock()
    monkeypatch.setattr(view.map, "_draw_slice", drawn)
    field = MagicMock()
    stroke = Shape("stroke", radius_m=0.1, points_m=[(0.0, 0.0, 0.0)])
    for shape, shown in ((stroke, None), (stroke, None), (stroke, field), (stroke, field), (None, None)):
        view.map.preview("add", shape, shown)
    assert drawn.call_count == 2


def test_a_click_on_the_path_answers_only_while_the_plan_is_checked(view: View3D):
    chosen = []
    view.on_moment = chosen.append
    view.draw_plan(series())
    view._clicked(click(0.5))
    assert chosen == [pytest.approx(1.5)]
    view.draw_plan(None)
    view._clicked(click(0.5))
    assert len(chosen) == 1


def drag(phase: str, browser: int) -> SimpleNamespace:
    return SimpleNamespace(phase=phase, client_id=browser, target=SimpleNamespace(position=(0.0, 0.0, 1.0)))


def test_a_drag_in_one_browser_is_not_ended_by_another(view: View3D):
    pulled, moved = [], []
    view.on_pull = lambda waypoint, _: pulled.append(waypoint)
    view.on_drag = lambda waypoint, _: moved.append(waypoint)
    view._dragged(1, drag("start", browser=1))
    view._dragged(2, drag("start", browser=2))
    view._dragged(2, drag("end", browser=2))
    view._dragged(1, drag("update", browser=1))
    view._dragged(2, drag("update", browser=2))  # came after its end
    assert (pulled, moved) == ([1], [2])


def test_a_browser_that_leaves_in_the_middle_of_a_drag_moves_nothing_and_ends_the_draft(view: View3D):
    view.on_drag = lambda *_: pytest.fail("nobody let go")
    view._dragged(1, drag("start", browser=1))
    told = []
    view.on_draft = told.append
    draft = Draft(1, "about 5 s")
    view.draw_draft(draft, np.zeros((2, 3)))
    assert view._draft is not None
    view._browser_left(SimpleNamespace(client_id=1))
    assert view._draft is None
    view.draw_draft(draft, np.zeros((2, 3)))  # came late
    assert view._draft is None
    assert told == [draft, Draft(None)]


def test_a_waypoint_dragged_where_no_path_leads_leaves_no_draft_of_before_and_says_so(view: View3D):
    told = []
    view.on_draft = told.append
    view._dragged(1, drag("start", browser=1))
    view.draw_draft(Draft(1, "about 5 s"), np.zeros((2, 3)))
    view.draw_draft(Draft(1, "waypoint 2 is inside an obstacle", "refused"), None)
    assert view._draft is None
    view._dragged(1, drag("end", browser=1))
    assert [draft.state for draft in told[:2]] == ["clear", "refused"]
    assert told[2] == Draft(None)


def test_the_trail_begins_with_arming_goes_where_the_vehicle_was_and_stays_after_landing(monkeypatch):
    drawn = []
    monkeypatch.setattr(drawing, "draw_vehicle", MagicMock())
    monkeypatch.setattr(drawing, "draw_pieces", lambda _, line, *__, **___: drawn.append(line) or MagicMock())
    monkeypatch.setattr(vehicle_view, "_TRAIL_PERIOD_S", 0.0)
    shown = vehicle_view.VehicleView(MagicMock())
    flown = np.stack([np.linspace(0.0, 1.0, 21), np.zeros(21), np.ones(21)], axis=1)
    shown.move(np.array([9.0, 9.0, 0.0]), rotations.IDENTITY)  # carried to the start
    shown.set_armed(True)
    for position in flown:
        shown.move(position, rotations.IDENTITY)
    np.testing.assert_allclose([drawn[-1][0, 0], drawn[-1][-1, 1]], flown[[0, -1]], atol=0.051)
    shown.set_armed(False)
    count = len(drawn)
    shown.move(np.array([2.0, 0.0, 0.0]), rotations.IDENTITY)
    assert len(drawn) == count
    shown.set_armed(True)
    for position in flown[:3] + 5.0:
        shown.move(position, rotations.IDENTITY)
    assert drawn[-1].min() >= 5.0  # a new flight, a new trail


def test_marked_moments_are_the_pieces_of_the_path_flown_in_them():
    time_s = np.linspace(0.0, 10.0, 101)
    position_m = np.stack([time_s, 0.0 * time_s, 1.0 + 0.0 * time_s], axis=1)
    position_m[50] = np.nan  # nothing was known there
    path = Path3D(time_s, position_m, None, None, None)
    pieces = flight_scene._pieces(path, [(1.02, 1.98), (4.5, 5.5)])
    np.testing.assert_allclose(pieces[:, 1] - pieces[:, 0], np.broadcast_to([0.1, 0.0, 0.0], (len(pieces), 3)))
    x_m = pieces[:, 0, 0]
    np.testing.assert_allclose(
        x_m, [*np.arange(1.0, 1.95, 0.1), *np.arange(4.5, 4.85, 0.1), *np.arange(5.1, 5.45, 0.1)]
    )
    assert len(flight_scene._pieces(path, [])) == 0
