"""Levels of detail: every tile is kept, no browser holds more than its bound, and what is near comes in full."""

import contextlib
import time
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from flight import MapError
from gcs_web.map import display_points
from gcs_web.scene import tiles
from gcs_web.scene.detail_view import DetailView
from gcs_web.scene.tiles import Tile, Tiles


@given(
    count=st.integers(1, 400),
    most=st.integers(1, 50),
    overlap_m=st.sampled_from([0.0, 0.02]),
    seed=st.integers(0, 99),
)
def test_every_place_is_in_a_part_and_parts_meet_only_where_they_border(count, most, overlap_m, seed):
    places_m = np.random.default_rng(seed).uniform(0.0, 1.0, (count, 3))
    parts = tiles.split(places_m, most, overlap_m=overlap_m)
    assert set(np.concatenate(parts).tolist()) == set(range(count))
    if overlap_m == 0.0:
        assert sum(map(len, parts)) == count
        assert max(map(len, parts)) <= most


def test_many_equal_places_are_one_part():
    assert [len(part) for part in tiles.split(np.ones((100, 3)), 10)] == [100]


def row_of_tiles(path: Path, count: int = 6, size: int = 10) -> Tiles:
    """Boxes of a metre along x."""
    made = [
        Tile(np.array([k, 0.0, 0.0]), np.array([k + 1.0, 1.0, 1.0]), np.array([k]), np.array([k, k]), size)
        for k in range(count)
    ]
    tiles.save(path, "key", made, {"other": np.eye(2)})
    opened = tiles.load(path, "key")
    assert opened is not None
    return opened


def test_tiles_on_disk_are_as_they_were_and_those_of_something_else_or_damaged_are_none(tmp_path):
    path = tmp_path / "tiles.npz"
    opened = row_of_tiles(path)
    assert len(opened) == 6
    np.testing.assert_array_equal(opened.level(3, fine=True), [3, 3])
    np.testing.assert_array_equal(opened.level(3, fine=False), [3])
    np.testing.assert_array_equal(opened.array("other"), np.eye(2))
    assert tiles.load(path, "another key") is None
    path.write_bytes(path.read_bytes()[:-200])
    assert tiles.load(path, "key") is None
    path.unlink()
    assert tiles.load(path, "key") is None


def test_the_nearest_tiles_are_shown_in_full_within_the_bound_and_none_behind_the_camera(tmp_path):
    opened = row_of_tiles(tmp_path / "tiles.npz")
    forward, at_m = np.array([1.0, 0.0, 0.0]), np.array([2.5, 0.5, 0.5])
    assert tiles.near(opened, at_m, forward, 29) == {2, 3}
    assert tiles.near(opened, at_m, -forward, 1000) == {0, 1, 2}
    assert tiles.near(opened, at_m, forward, 9) == frozenset()


class Scene:
    """What a browser holds, by name."""

    def __init__(self) -> None:
        self.nodes: dict[str, int] = {}
        self.drags: dict[str, Any] = {}
        self.visible = True

    def put(self, name: str, data: np.ndarray, fine: bool) -> Any:
        assert len(data) == (2 if fine else 1)
        self.nodes[name] = len(data)
        self.drags.pop(name, None)  # a new node answers none
        return SimpleNamespace(
            remove=lambda: self.nodes.pop(name, None),
            on_drag=lambda drag: self.drags.update({name: drag}),
            remove_drag_callback=lambda _: self.drags.pop(name),
        )


class Client:
    def __init__(self) -> None:
        self.client_id, self.scene, self.atomic = 1, Scene(), contextlib.nullcontext
        self.camera = SimpleNamespace(
            position=(0.0, 0.5, 0.5), look_at=(9.0, 0.5, 0.5), on_update=lambda moved: setattr(self, "moved", moved)
        )
        self.moved: Any = None

    def fine(self) -> set[str]:
        return {name for name, count in self.scene.nodes.items() if count == 2}


@pytest.fixture
def view():
    server = SimpleNamespace(
        scene=SimpleNamespace(add_frame=lambda *_, **__: SimpleNamespace(visible=True)),
        on_client_connect=lambda _: None,
        on_client_disconnect=lambda _: None,
    )
    made = DetailView(server, "/map", lambda scene, name, data, fine: scene.put(name, data, fine), most=20)
    yield made
    made.close()


def test_a_browser_has_all_tiles_at_once_and_the_fine_ones_follow_its_camera(view, tmp_path):
    client = Client()
    view._joined(client)
    assert client.scene.nodes == {}
    view._tiles = row_of_tiles(tmp_path / "tiles.npz")
    view._begin(view._browsers[1])
    assert len(client.scene.nodes) == 6
    assert client.fine() == set()
    view._follow(view._browsers[1])
    assert client.fine() == {"/map/0", "/map/1"}
    client.camera.position = (4.2, 0.5, 0.5)
    view._follow(view._browsers[1])
    assert client.fine() == {"/map/4", "/map/5"}
    assert len(client.scene.nodes) == 6
    view._left(client)
    view.show(None)
    assert len(client.scene.nodes) == 6  # nothing is sent to a browser that left


def test_a_browser_that_draws_slowly_has_one_piece_and_no_fine_tiles(view, tmp_path):
    asked: list[int] = []
    view._plain = lambda shown, most: asked.append(most) or shown.level(0, fine=False)
    client, late = Client(), Client()
    late.client_id = 2
    view._tiles = row_of_tiles(tmp_path / "tiles.npz")
    view._joined(client)
    view.simplify([1], 6000)
    view.plain_of = {late: 1500}.get
    view._joined(late)
    for browser in view._browsers.values():
        view._follow(browser)
    assert client.scene.nodes == late.scene.nodes == {"/map/0": 1}
    assert asked == [6000, 1500]


def test_drags_are_answered_by_every_tile_in_every_browser_until_they_are_not(view, tmp_path):
    async def painted(_: Any) -> None: ...

    early, late = Client(), Client()
    late.client_id = 2
    view._tiles = row_of_tiles(tmp_path / "tiles.npz")
    view._joined(early)
    view.set_drag(painted)
    view._joined(late)
    view._follow(view._browsers[1])
    for client in (early, late):
        assert client.scene.drags == dict.fromkeys(client.scene.nodes, painted)
    view.set_drag(None)
    assert early.scene.drags == late.scene.drags == {}


def test_what_one_browser_cannot_be_shown_keeps_nothing_from_the_others(view, tmp_path):
    class NoCamera:
        @property
        def position(self) -> Any:
            raise RuntimeError("it is gone")

    gone, there = Client(), Client()
    there.client_id = 2
    for client in (gone, there):
        view._joined(client)
    gone.camera = NoCamera()
    view.show(row_of_tiles(tmp_path / "tiles.npz"))
    wait_until = time.monotonic() + 5.0
    while not there.fine() and time.monotonic() < wait_until:
        time.sleep(0.01)
    assert there.fine() == {"/map/0", "/map/1"}


def test_points_are_all_there_once_and_those_not_finite_are_left_out(tmp_path, monkeypatch):
    monkeypatch.setattr(display_points, "COARSE_POINTS", 300)
    monkeypatch.setattr(display_points, "TILE_POINTS", 500)
    points = np.random.default_rng(0).uniform(-5.0, 5.0, (3000, 3))
    np.savez(tmp_path / "points.npz", points_world_m=np.concatenate([points, np.full((2, 3), np.nan)]))
    display_points._make(tmp_path, (tmp_path / "points.npz", "key"), lambda *_: None)
    shown = tiles.load(tmp_path / display_points.CACHE, "key")
    assert shown is not None
    fine = np.concatenate([shown.level(k, fine=True) for k in range(len(shown))])
    order = [np.lexsort(each.T) for each in (fine, points.astype(np.float32))]
    np.testing.assert_array_equal(fine[order[0]], points.astype(np.float32)[order[1]])
    coarse = [shown.level(k, fine=False) for k in range(len(shown))]
    assert 280 <= sum(map(len, coarse)) <= 320
    for k, part in enumerate(coarse):
        assert (part >= shown.low_m[k]).all()
        assert (part <= shown.high_m[k]).all()


def test_a_map_without_points_or_with_damaged_ones_says_so(tmp_path):
    with pytest.raises(MapError, match="no points"):
        display_points.load(tmp_path / "points.npz", tmp_path / "cache")
    (tmp_path / "points.npz").write_bytes(b"PK no")
    with pytest.raises(MapError, match=r"points\.npz cannot be read"):
        display_points.load(tmp_path / "points.npz", tmp_path / "cache")
