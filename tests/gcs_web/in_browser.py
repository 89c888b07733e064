"""The page in a real browser, for tests: Chromium, an opened page, and where on it things are."""

import contextlib
import shutil
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest

from gcs_web import GroundStation
from tests.waiting import PATIENCE_S
from tests.waiting import until as wait

CHROMIUM = shutil.which("chromium")
FLAGS = [
    "--headless", "--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run",
    "--disable-background-networking", "--disable-component-update", "--disable-sync",
    "--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader",
]  # fmt: skip
SIZE = {"width": 1280, "height": 720}
SERIOUS = ("serious", "critical")
"""Impacts of barriers that axe finds."""

COARSE = """if (location.pathname === "/viser/") history.replaceState(null, "", "/viser/?fixedDpr=0.25");"""
"""Has viser draw a sixteenth of the pixels: without a graphics card they are most of a test's CPU time."""

needs_chromium = pytest.mark.skipif(CHROMIUM is None, reason="needs Chromium: apt-get install chromium")


@contextlib.contextmanager
def opened(station: GroundStation, browser, *, with_view: bool) -> Iterator[Any]:
    """The page in a window of its own, which is closed without an error and without a request to elsewhere."""
    foreign: list[str] = []

    def only_loopback(route):
        if route.request.url.startswith(("http://127.0.0.1:", "data:", "blob:")):
            route.continue_()
        else:
            foreign.append(route.request.url)
            route.abort()

    context = browser.new_context(viewport=SIZE, reduced_motion="reduce")
    context.set_default_timeout(1000 * PATIENCE_S)  # drawn without a graphics card: slow beside other work
    context.route("**/*", only_loopback)
    context.add_init_script(COARSE)
    if not with_view:
        without_view(context)
    errors: list[str] = []
    page = context.new_page()
    page.on("pageerror", lambda error: errors.append(str(error)))
    page.goto(station.url)
    yield page
    context.close()
    wait(lambda: not station.hub.people, "the page's leave")
    assert foreign == []
    assert errors == []


def without_view(context: Any) -> Any:
    """The context, in which the 3D view stays empty; the station draws into it all the same."""
    context.route("**/viser/**", lambda route: route.fulfill(body="", content_type="text/html"))
    return context


def positions(station: GroundStation) -> np.ndarray:
    return station.desk.session.content.waypoints().positions_world_m


def cell(page, row: int, column: int):
    """Of the table of waypoints; columns x y z yaw are 0 to 3."""
    return (
        page.get_by_role("grid", name="Waypoints").get_by_role("row").nth(row + 1).get_by_role("gridcell").nth(column)
    )


def verdict(page):
    return page.get_by_role("region", name="Verdict")


def drawn(page) -> None:
    """Return when the browser has drawn what it was told so far."""
    page.evaluate("() => new Promise(done => requestAnimationFrame(() => requestAnimationFrame(done)))")
