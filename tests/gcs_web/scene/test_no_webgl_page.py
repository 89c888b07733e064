"""A browser that was started without WebGL plans a path and follows a real SITL flight on the map from above."""

import threading

import numpy as np
import pytest

from tests.gcs_web.in_browser import CHROMIUM, FLAGS, needs_chromium, positions, tab, visited
from tests.gcs_web.station_socket import Page, visit
from tests.gcs_web.two_pillars import START
from tests.waiting import PATIENCE_S, until

pytestmark = needs_chromium


@pytest.fixture(scope="module")
def browser():
    from playwright.sync_api import sync_playwright

    flags = [flag for flag in FLAGS if "gl" not in flag and "swiftshader" not in flag] + ["--disable-3d-apis"]
    with sync_playwright() as playwright:
        started = playwright.chromium.launch(executable_path=CHROMIUM, args=flags, timeout=1000 * PATIENCE_S)
        yield started
        started.close()


async def fly(pilot: Page) -> None:
    """Return once the path is being flown."""
    await pilot.checked()
    await pilot.command("take_control", force=True)
    prepared = await pilot.command("prepare_upload")
    assert not (await pilot.command("upload", nonce=prepared["nonce"]))["error"]
    nonce = (await pilot.command("prepare_order"))["nonce"]
    assert not (await pilot.command("order", order="start", nonce=nonce))["error"]
    await pilot.until(lambda page: (page.state["vehicle"].get("along_s") or 0.0) > 1.5)


def middle(where) -> np.ndarray:
    box = where.bounding_box()
    return np.array([box["x"] + box["width"] / 2, box["y"] + box["height"] / 2])


def test_without_webgl_a_path_is_planned_and_a_flight_is_followed(station, same_waypoints, browser):
    with tab(browser, with_view=True) as opened, visited(station, opened) as page:
        assert page.evaluate("document.createElement('canvas').getContext('webgl')") is None
        page.get_by_text("no WebGL here").wait_for()
        page.locator(".section-image").wait_for()
        ball = page.locator(".ball").nth(1)
        from_px = middle(ball)
        page.mouse.move(*from_px)
        page.mouse.down()
        for right_px, up_px in ((12, 6), (14, 8)):
            page.mouse.move(from_px[0] + right_px, from_px[1] - up_px)
        page.mouse.up()
        until(lambda: np.abs(positions(station)[1] - START[1]).max() > 0.02, "the move")
        page.get_by_text("Checked", exact=True).wait_for()
        path = page.locator(".planned-path:not(.old) polyline").first
        path.wait_for(state="attached")

        flight = threading.Thread(target=visit, args=(station, 1, fly))
        flight.start()
        flown = page.locator("polyline.flown-path")
        until(lambda: flown.count() == 1 and len(flown.get_attribute("points").split()) > 10, "the flown path")
        mark = page.locator(".vehicle-mark.fresh circle")
        places = [middle(mark)]
        until(lambda: np.linalg.norm(middle(mark) - places[0]) > 5.0, "a mark that moves")
        flight.join()
        page.keyboard.press("Shift+Escape")
        until(lambda: not station.watch.state().armed, "the landing")
