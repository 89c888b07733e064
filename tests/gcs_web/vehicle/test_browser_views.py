"""The vehicle is seen from every distance, and a camera follows it in the browser that asked, without a browser."""

from types import SimpleNamespace
from unittest.mock import MagicMock

import numpy as np
import pytest

from flight import rotations
from gcs_web.scene import drawing
from gcs_web.vehicle.browser_views import LAST_SEEN, LEAST_PX, SEEN, BrowserViews

HEIGHT_PX, FOV_RAD = 800, 1.0


@pytest.fixture
def drawn(monkeypatch) -> list[SimpleNamespace]:
    """The marks, as they were drawn one after the other."""
    marks: list[SimpleNamespace] = []

    def draw(client, pieces, colour, *, name, thickness_px):
        radius_m = np.linalg.norm(pieces.reshape(-1, 3)[0])
        marks.append(SimpleNamespace(client=client, radius_m=radius_m, colour=tuple(colour)))
        return marks[-1]

    monkeypatch.setattr(drawing, "draw_pieces", draw)
    return marks


def browser(number: int, position=(0.0, 0.0, 0.0), look_at=(1.0, 0.0, 0.0)) -> SimpleNamespace:
    camera = SimpleNamespace(position=position, look_at=look_at, fov=FOV_RAD, image_height=HEIGHT_PX)
    return SimpleNamespace(client_id=number, camera=camera)


def on_screen_px(radius_m: float, away_m: float) -> float:
    return radius_m / (2.0 * away_m * np.tan(0.5 * FOV_RAD)) * HEIGHT_PX


@pytest.mark.parametrize("away_m", [0.5, 3.0, 20.0, 150.0])
def test_the_ring_is_at_least_as_large_as_the_vehicle_and_never_a_speck(drawn, away_m):
    views = BrowserViews(MagicMock())
    views.came(browser(1), "a")
    views.move(np.array([away_m, 0.0, 0.0]), rotations.IDENTITY)
    assert drawn[-1].radius_m >= 0.3
    assert on_screen_px(drawn[-1].radius_m, away_m) >= LEAST_PX * 0.99


def test_the_ring_of_each_browser_fits_its_own_camera_and_is_drawn_anew_only_when_it_must(drawn):
    views = BrowserViews(MagicMock())
    near, far = browser(1), browser(2, position=(-100.0, 0.0, 0.0))
    for each in (near, far):
        views.came(each, "")
    views.move(np.array([2.0, 0.0, 0.0]), rotations.IDENTITY)
    views.move(np.array([2.01, 0.0, 0.0]), rotations.IDENTITY)
    assert [mark.client for mark in drawn] == [near, far]
    assert drawn[1].radius_m > drawn[0].radius_m
    far.camera.position = (-300.0, 0.0, 0.0)
    views.looked(far)
    assert len(drawn) == 3
    assert drawn[2].radius_m == pytest.approx(3.0 * drawn[1].radius_m, rel=0.1)


def test_a_vehicle_that_is_heard_no_more_leaves_its_mark_where_it_was_in_another_colour(drawn):
    server = MagicMock()
    views = BrowserViews(server)
    views.came(browser(1), "")
    views.move(np.array([2.0, 1.0, 1.0]), rotations.IDENTITY)
    views.lose()
    frame = server.scene.add_frame.return_value
    assert drawn[-1].colour == LAST_SEEN
    assert frame.visible
    assert frame.position == (2.0, 1.0, 1.0)
    views.move(np.array([2.0, 1.0, 1.0]), rotations.IDENTITY)
    assert drawn[-1].colour == SEEN
    views.forget()
    assert not frame.visible


def test_the_camera_follows_only_where_it_was_asked_for_and_keeps_its_distance(drawn):
    views = BrowserViews(MagicMock())
    following, other = browser(1), browser(2, position=(9.0, 9.0, 9.0))
    views.came(following, "a")
    views.came(other, "b")
    views.move(np.array([1.0, 2.0, 1.0]), rotations.from_yaw(np.pi / 2))
    views.follow("a", following=True)
    assert following.camera.look_at == (1.0, 2.0, 1.0)
    assert following.camera.position[1] < 2.0  # behind, as it looks along y
    following.camera.position = (1.0, 2.0, 6.0)  # somebody turned it
    views.move(np.array([2.0, 3.0, 1.5]), rotations.IDENTITY)
    assert following.camera.look_at == (2.0, 3.0, 1.5)
    assert following.camera.position == pytest.approx((2.0, 3.0, 6.5))
    assert other.camera.position == (9.0, 9.0, 9.0)
    views.follow("a", following=False)
    views.move(np.array([5.0, 5.0, 5.0]), rotations.IDENTITY)
    assert following.camera.look_at == (2.0, 3.0, 1.5)


def test_a_view_that_asked_before_it_was_there_follows_when_it_comes(drawn):
    views = BrowserViews(MagicMock())
    views.follow("a", following=True)
    views.move(np.array([1.0, 2.0, 1.0]), rotations.IDENTITY)
    late = browser(1)
    views.came(late, "a")
    assert late.camera.look_at == (1.0, 2.0, 1.0)
