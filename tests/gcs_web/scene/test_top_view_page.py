"""The map from above, in Chromium without WebGL: path, waypoints and vehicle on it, by pointer and by key."""

import re

import numpy as np
import pytest

from gcs_web.protocol.document import Shift
from gcs_web.protocol.vehicle import Vehicle
from tests.gcs_web.in_browser import SERIOUS, drawn, needs_chromium, positions, tab, visited
from tests.gcs_web.telling import telling
from tests.gcs_web.two_pillars import START
from tests.waiting import until as wait

pytestmark = needs_chromium
NO_WEBGL = """const before = HTMLCanvasElement.prototype.getContext;
HTMLCanvasElement.prototype.getContext = function (kind, ...more) {
  return kind.startsWith("webgl") ? null : before.call(this, kind, ...more);
};"""


@pytest.fixture(scope="module")
def without_webgl(browser):
    with tab(browser, with_view=True) as opened_once:
        opened_once.page.context.add_init_script(NO_WEBGL)
        yield opened_once


@pytest.fixture
def page(station, same_waypoints, without_webgl):
    with visited(station, without_webgl) as page:
        page.get_by_text("Checked", exact=True).wait_for()
        page.locator(".section-image").wait_for()
        yield page


@pytest.fixture
def told(station, monkeypatch):
    """The pages hear what the test says of the vehicle, and not from the vehicle."""
    monkeypatch.setattr(station.watch, "on_state", lambda _: None)


def ball(page, number: int):
    return page.locator(".ball").nth(number - 1)


def middle(where) -> np.ndarray:
    box = where.bounding_box()
    return np.array([box["x"] + box["width"] / 2, box["y"] + box["height"] / 2])


def pixel(page, x_m: float, y_m: float) -> np.ndarray:
    """Where a place is on the map, by the first and last waypoint."""
    ends = np.array([middle(ball(page, 1)), middle(ball(page, 3))])
    scale = (ends[1, 0] - ends[0, 0]) / (START[2, 0] - START[0, 0])
    return ends[0] + scale * np.array([x_m - START[0, 0], START[0, 1] - y_m])


def test_without_webgl_nothing_of_the_3d_view_is_loaded_and_the_rest_is_offered(page):
    assert page.locator("iframe").count() == 0
    assert page.get_by_role("button", name="3D").is_disabled()
    assert page.get_by_role("button", name="Top", pressed=True).is_enabled()
    page.get_by_text("no WebGL here").wait_for()


def test_a_waypoint_is_selected_by_a_click_and_moved_by_a_drag(page, station):
    ball(page, 2).click()
    page.get_by_role("row", selected=True).get_by_text("3.00").wait_for()
    start, end = pixel(page, 3.0, 2.0), pixel(page, 3.2, 2.1)
    page.mouse.move(*start)
    page.mouse.down()
    page.mouse.move(*((start + end) / 2))
    page.mouse.move(*end)
    page.mouse.up()
    wait(lambda: np.abs(positions(station)[1, :2] - [3.2, 2.1]).max() < 0.05, "the move")
    assert positions(station)[1, 2] == START[1, 2]


def test_what_somebody_else_did_to_a_waypoint_during_a_drag_stays(page, station):
    start, end = pixel(page, 3.0, 2.0), pixel(page, 3.2, 2.1)
    page.mouse.move(*start)
    page.mouse.down()
    page.mouse.move(*((start + end) / 2))
    session = station.desk.session
    second = session.content.points[1].id
    session.edit(Shift(serial=0, revision=session.revision, waypoints=[second], z_m=0.2), "Bo")
    page.mouse.move(*end)
    page.mouse.up()
    page.get_by_text("Bo changed the same meanwhile").first.wait_for()
    np.testing.assert_allclose(positions(station)[1], START[1] + [0.0, 0.0, 0.2])


def test_a_drag_that_the_system_takes_away_moves_nothing(page, station):
    start, end = pixel(page, 3.0, 2.0), pixel(page, 3.2, 2.1)
    page.mouse.move(*start)
    page.mouse.down()
    page.mouse.move(*end)
    ball(page, 2).evaluate("ball => ball.dispatchEvent(new PointerEvent('pointercancel', {pointerId: 1}))")
    page.mouse.up()
    wait(lambda: np.abs(middle(ball(page, 2)) - start).max() < 2, "the waypoint where it was")
    np.testing.assert_allclose(positions(station)[1], START[1])


def test_a_click_on_the_path_sets_the_moment(page, station):
    series = station.desk.answer.shown.series
    k = len(series.time_s) // 4
    drawn(page)
    page.mouse.click(*pixel(page, series.x_m[k], series.y_m[k]))
    said = page.get_by_role("region", name="Timeline").locator(".drawer-time b")
    wait(lambda: abs(float(said.text_content().split()[0]) - series.time_s[k]) < 0.1, "the moment")


def test_the_map_is_moved_and_enlarged_and_all_of_it_comes_back(page):
    before = middle(ball(page, 3))
    page.get_by_role("button", name="Zoom in").click()
    drawn(page)
    assert np.linalg.norm(middle(ball(page, 3)) - middle(ball(page, 1))) > np.linalg.norm(
        before - middle(ball(page, 1))
    )
    free = pixel(page, 3.0, 0.9)
    page.mouse.move(*free)
    page.mouse.down()
    page.mouse.move(free[0] + 40, free[1] + 30)
    page.mouse.up()
    page.mouse.wheel(0, 200)
    page.get_by_role("button", name="Show all").click()
    wait(lambda: np.abs(middle(ball(page, 3)) - before).max() < 1.0, "all of the map")


@pytest.mark.parametrize(("yaw_rad", "turned"), [(0.0, 0.0), (np.pi / 2, -90.0)])
def test_the_vehicle_has_a_ring_and_an_arrow_where_it_is(page, station, told, yaw_rad, turned):
    here = Vehicle("fresh", "sitl", mission="hold", armed=True, x_m=4.0, y_m=1.0, z_m=1.0, yaw_rad=yaw_rad)
    with telling(station, here):
        page.keyboard.press("3")
        mark = page.locator(".vehicle-mark.fresh")
        wait(lambda: np.abs(middle(mark.locator("circle")) - pixel(page, 4.0, 1.0)).max() < 2.0, "the mark")
        assert mark.locator("circle").bounding_box()["width"] >= 22
        arrow = mark.locator("path").get_attribute("transform")
        assert f"rotate({turned:g})" in arrow.replace("rotate(-0)", "rotate(0)")


def test_a_mark_that_is_old_says_so(page, station, told):
    station.hub.publish(Vehicle("lost", "sitl", 4.2, "hold", True, x_m=4.0, y_m=1.0, z_m=1.0, yaw_rad=0.0))
    page.locator(".vehicle-mark.lost").get_by_text(re.compile(r"\d\.\d s ago")).wait_for()


@pytest.mark.parametrize("size", [(360, 740), (768, 1024), (1440, 900)])
def test_nothing_covers_the_choice_of_view_and_nothing_is_a_barrier(page, size):
    from axe_playwright_python.sync_playwright import Axe

    page.set_viewport_size({"width": size[0], "height": size[1]})
    for step in "1234":
        page.keyboard.press(step)
        drawn(page)
        for name in ("Top", "Zoom in", "Show all"):
            button = page.get_by_role("button", name=re.compile(f"^{name}"))
            box = button.bounding_box()
            hit = page.evaluate(
                "([x, y]) => document.elementFromPoint(x, y)?.closest('button')?.textContent",
                [box["x"] + box["width"] / 2, box["y"] + box["height"] / 2],
            )
            assert hit == button.text_content(), f"{step}: {name}"
            assert size[0] >= 720 or min(box["width"], box["height"]) >= 44
    found = [rule["id"] for rule in Axe().run(page).response["violations"] if rule["impact"] in SERIOUS]
    assert found == []
