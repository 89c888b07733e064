"""The 3D view in a real browser: clicks, drags, a rectangle, a brush."""

import numpy as np
import pytest

from flight import rotations
from flight.trajectory import fingerprint
from gcs_web import GroundStation
from tests.gcs_web.in_browser import drawn, needs_chromium, positions, verdict
from tests.gcs_web.two_pillars import START
from tests.waiting import until as wait
from tests.waiting import within

pytestmark = needs_chromium

STEPS = (0.1, 0.4, 0.7, 1.0)
"""Of a pull, as shares: without a graphics card each picture takes half a second of CPU time."""


def pixel(page, station: GroundStation, point_world_m: np.ndarray) -> tuple[float, float]:
    """Where the browser draws a point: pinhole projection with the camera the 3D view reports."""
    camera = next(iter(station.server.get_clients().values())).camera
    x, y, z = rotations.rotate(rotations.conjugate(camera.wxyz), point_world_m - np.asarray(camera.position))
    box = page.locator("iframe").bounding_box()
    scale = 0.5 * box["height"] / np.tan(0.5 * camera.fov)
    return box["x"] + box["width"] / 2 + scale * x / z, box["y"] + box["height"] / 2 + scale * y / z


def pull(page, station: GroundStation, start_world_m: np.ndarray, end_world_m: np.ndarray, understood) -> bool:
    """Pull with the mouse as a hand does, each step once the browser has drawn the one before; was it understood?"""
    start, end = (np.array(pixel(page, station, point)) for point in (start_world_m, end_world_m))
    drawn(page)
    page.mouse.move(*start)
    drawn(page)
    page.mouse.down()
    for share in STEPS:
        page.mouse.move(*(start + share * (end - start)))
        drawn(page)
    page.mouse.up()
    return within(20.0, understood)  # or nothing was drawn yet where the mouse came down


def dragged(page, station: GroundStation, start_world_m: np.ndarray, end_world_m: np.ndarray) -> bool:
    before = station.desk.session.revision
    return pull(page, station, start_world_m, end_world_m, lambda: station.desk.session.revision > before)


def test_the_scale_bar_is_as_long_as_it_says_where_the_camera_looks_and_moves_with_it(station, page_3d):
    def shown() -> tuple[float, float]:
        words = page_3d.locator(".scale-3d .scale").text_content()
        return float(words.split(" m ")[0]), page_3d.locator(".scale-3d .bar").bounding_box()["width"]

    def is_true() -> bool:
        camera = next(iter(station.server.get_clients().values())).camera
        middle = np.asarray(camera.look_at)
        long_m, width = shown()
        beside = middle + long_m * rotations.rotate(camera.wxyz, np.array([1.0, 0.0, 0.0]))
        return abs(pixel(page_3d, station, beside)[0] - pixel(page_3d, station, middle)[0] - width) < 0.02 * width

    page_3d.locator(".scale-3d .scale").wait_for()
    wait(is_true, "a true scale bar")
    before, box = shown(), page_3d.locator("iframe").bounding_box()
    page_3d.mouse.move(box["x"] + 0.5 * box["width"], box["y"] + 0.5 * box["height"])
    page_3d.mouse.wheel(0, -400)
    wait(lambda: shown() != before and is_true(), "a true scale bar from nearer")
    page_3d.mouse.wheel(0, 400)


def test_a_waypoint_is_dragged_in_the_3d_view(station, page_3d):
    page_3d.get_by_role("grid", name="Waypoints").get_by_role("row").nth(2).get_by_role("rowheader").click()
    offset = np.array([0.0, 0.35, 0.0])
    grip = START[1] + np.array([0.0, 0.25, 0.0])  # on the handle's y arrow
    drafts: list[np.ndarray] = []
    draw = station.view.draw_draft
    station.view.draw_draft = lambda shown, path: (drafts.append(path), draw(shown, path))
    try:
        wait(lambda: dragged(page_3d, station, grip, grip + offset), "a drag that the view understands")
        wait(lambda: drafts, "a draft of the path while it was dragged")
    finally:
        station.view.draw_draft = draw
    assert np.linalg.norm(drafts[-1] - positions(station)[1], axis=1).min() < 0.3
    moved = positions(station)
    np.testing.assert_allclose(moved[1], START[1] + offset, atol=0.15)
    np.testing.assert_array_equal(moved[[0, 2]], START[[0, 2]])
    page_3d.get_by_role("status").get_by_text("Waypoint 2 moved").wait_for()


def test_while_a_waypoint_is_held_the_page_shows_a_draft_that_cannot_be_saved_or_uploaded(station, page_3d):
    page_3d.get_by_role("grid", name="Waypoints").get_by_role("row").nth(2).get_by_role("rowheader").click()
    verdict(page_3d).get_by_text("Checked", exact=True).wait_for()
    grip, offset = START[1] + np.array([0.0, 0.25, 0.0]), np.array([0.0, 0.35, 0.0])
    before, revision = station.desk.checked(), station.desk.session.revision

    def held() -> bool:
        drawn(page_3d)
        start, end = (np.array(pixel(page_3d, station, point)) for point in (grip, grip + offset))
        page_3d.mouse.move(*start)
        drawn(page_3d)
        page_3d.mouse.down()
        for share in STEPS:
            page_3d.mouse.move(*(start + share * (end - start)))
            drawn(page_3d)
        is_draft = within(20.0, lambda: verdict(page_3d).get_by_text("Draft", exact=True).count() > 0)
        if not is_draft:
            page_3d.mouse.up()
        return is_draft

    wait(held, "a draft while the waypoint is held")
    verdict(page_3d).get_by_text("Planned and checked: let go here to take it").wait_for()
    assert verdict(page_3d).get_by_text("Draft", exact=True).count() == 1
    assert page_3d.get_by_role("button", name="Save").first.is_disabled()
    assert page_3d.get_by_role("button", name="Compare and upload").is_disabled()
    assert station.desk.session.revision == revision
    assert fingerprint(station.desk.checked().trajectory) == fingerprint(before.trajectory)
    page_3d.mouse.up()
    verdict(page_3d).get_by_text("Checked", exact=True).wait_for()
    assert station.desk.session.revision > revision
    page_3d.get_by_role("button", name="Undo").first.click()
    wait(lambda: np.array_equal(positions(station), START), "the waypoint where it was")
    wait(lambda: verdict(page_3d).get_by_text("Checked", exact=True).count() > 0, "the plan of before")


def clicked(page, station: GroundStation, point_world_m: np.ndarray, answered) -> bool:
    """Click where the browser draws a point; was it answered?"""
    drawn(page)
    page.mouse.click(*pixel(page, station, point_world_m))
    return within(20.0, answered)  # or the scene was not drawn yet when it was clicked


def test_a_click_on_the_path_moves_the_cursor_there(station, page_3d):
    series = station.desk.answer.shown.series
    k = len(series.time_s) // 3
    place = np.array([series.x_m[k], series.y_m[k], series.z_m[k]])
    told: list[float] = []
    publish, station.view.on_moment = station.view.on_moment, lambda time_s: (told.append(time_s), publish(time_s))
    try:
        wait(lambda: clicked(page_3d, station, place, lambda: bool(told)), "the click on the path")
    finally:
        station.view.on_moment = publish
    assert told[-1] == pytest.approx(series.time_s[k], abs=0.3)  # a pixel is a few centimetres
    page_3d.get_by_text(f"{told[-1]:.2f} s", exact=True).first.wait_for()


def test_a_shift_click_on_the_floor_adds_a_waypoint_after_the_last(station, page_3d):
    floor = np.array([5.5, 2.0, 0.0])
    page_3d.keyboard.down("Shift")
    wait(lambda: clicked(page_3d, station, floor, lambda: len(positions(station)) == 4), "the shift-click on the floor")
    page_3d.keyboard.up("Shift")
    np.testing.assert_allclose(positions(station)[3], [5.5, 2.0, START[2, 2]], atol=0.05)
    page_3d.get_by_role("status").get_by_text("Waypoint 4 inserted").wait_for()


def test_waypoints_inside_a_drawn_rectangle_are_selected(station, page_3d):
    last = station.desk.session.content.points[2].id

    def boxed() -> bool:
        x, y = pixel(page_3d, station, START[2])
        drawn(page_3d)
        page_3d.keyboard.down("Control")
        page_3d.mouse.move(x - 25, y - 25)
        page_3d.mouse.down()
        for share in (0.3, 0.7, 1.0):
            page_3d.mouse.move(x - 25 + 50 * share, y - 25 + 50 * share)
        drawn(page_3d)
        page_3d.mouse.up()
        page_3d.keyboard.up("Control")
        return within(20.0, lambda: station.view._selected == (last,))

    wait(boxed, "the rectangle that the view understands")
    table = page_3d.get_by_role("grid", name="Waypoints")
    wait(lambda: table.locator("tr[aria-selected=true]").count() == 1, "one row")
    page_3d.keyboard.press("Escape")


def test_a_stroke_of_the_brush_is_drawn_applied_as_one_change_and_undone(station, page_3d):
    page_3d.keyboard.press("1")
    tools = page_3d.get_by_role("toolbar", name="Map")
    tools.get_by_role("button", name="Brush").click()
    wait(lambda: station.view.map.mesh._painting, "the brush")
    before = station.desk.session.revision

    ends = np.array([4.0, 1.0, 0.0]), np.array([5.0, 2.0, 0.0])

    def understood() -> bool:
        return station.desk.map._preview.shape is not None

    wait(lambda: pull(page_3d, station, *ends, understood), "a stroke that the view understands")
    form = page_3d.get_by_role("form", name="New edit of the map")
    form.get_by_label("Name").fill("hose")
    form.get_by_role("button", name="Add to the map").click()
    page_3d.get_by_role("button", name="No-fly: hose").wait_for()
    (zone,) = station.desk.session.content.map_edits
    assert station.desk.session.revision == before + 1
    assert zone.solid == "Stroke"
    line = np.array(zone.edit().solid.points_world_m)
    assert np.abs(line[:, 2]).max() < 0.1  # on the floor
    assert np.linalg.norm(line[[0, -1], :2] - [[4.0, 1.0], [5.0, 2.0]], axis=1).max() < 0.4
    wait(lambda: not station.view.map.mesh._painting, "the brush put away")
    page_3d.keyboard.press("Control+z")
    wait(lambda: station.desk.session.content.map_edits == (), "undo")
    page_3d.keyboard.press("2")


def test_the_camera_follows_the_vehicle_in_the_page_that_asks_and_comes_back(station, page_3d):
    camera = next(iter(station.server.get_clients().values())).camera
    page_3d.keyboard.press("f")
    wait(lambda: np.linalg.norm(camera.look_at - station.watch.link.state.position_world_m) < 0.05, "the camera")
    wait(lambda: 1.0 < np.linalg.norm(camera.position - camera.look_at) < 4.0, "the camera near the vehicle")
    page_3d.keyboard.press("v")
    overview, _ = station.view._camera
    wait(lambda: np.linalg.norm(camera.position - overview) < 0.1, "the camera back")


def test_the_map_from_above_takes_the_place_of_the_3d_view_and_gives_it_back(page_3d):
    page_3d.keyboard.press("t")
    page_3d.get_by_role("group", name="Map from above").wait_for()
    page_3d.keyboard.press("v")
    page_3d.get_by_role("group", name="Map from above").wait_for(state="detached")
    page_3d.locator("iframe").wait_for(state="visible")
