"""The page in a real browser, for tests: Chromium, an opened page, and where on it things are."""

import contextlib
import shutil
from collections.abc import Iterator
from dataclasses import dataclass, field
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
    "--autoplay-policy=document-user-activation-required",  # as on a desk; a headless one sounds at once
]  # fmt: skip
SIZE = {"width": 1280, "height": 720}
SERIOUS = ("serious", "critical")
"""Impacts of barriers that axe finds."""

needs_chromium = pytest.mark.skipif(CHROMIUM is None, reason="needs Chromium: apt-get install chromium")


@dataclass(frozen=True)
class Tab:
    """A tab with cookies of its own, and what went wrong in it."""

    page: Any
    foreign: list[str] = field(default_factory=list)
    """Requests to elsewhere, which were refused."""
    errors: list[str] = field(default_factory=list)
    """Of the page's code."""


@contextlib.contextmanager
def tab(browser, *, with_view: bool) -> Iterator[Tab]:
    # A page that is kept would answer for a station of another test, past the routes below.
    context = browser.new_context(viewport=SIZE, reduced_motion="reduce", service_workers="block")
    context.set_default_timeout(1000 * PATIENCE_S)  # drawn without a graphics card: slow beside other work
    new = Tab(context.new_page())

    def only_loopback(route):
        if route.request.url.startswith(("http://127.0.0.1:", "data:", "blob:")):
            route.continue_()
        else:
            new.foreign.append(route.request.url)
            route.abort()

    context.route("**/*", only_loopback)
    if not with_view:
        without_view(context)
    new.page.on("pageerror", lambda error: new.errors.append(str(error)))
    yield new
    context.close()


@contextlib.contextmanager
def visited(station: GroundStation, where: Tab) -> Iterator[Any]:
    """The page as a new browser shows it, which is left without an error and without a request to elsewhere.

    A new context for each would compile the page's code each time, which is most of its CPU time.
    """
    where.page.goto(station.url)
    yield where.page
    where.page.mouse.up()
    where.page.goto("about:blank")
    wait(lambda: not station.hub.people, "the page's leave")
    assert where.foreign == []
    assert where.errors == []
    _forget(station, where.page)


def _forget(station: GroundStation, page: Any) -> None:
    """Cookies, what the page keeps in the browser, the window's size and the mouse."""
    page.context.clear_cookies()
    keeps = page.context.new_cdp_session(page)
    keeps.send("Storage.clearDataForOrigin", {"origin": station.url.rstrip("/"), "storageTypes": "all"})
    keeps.detach()
    page.set_viewport_size(SIZE)
    page.mouse.move(0, 0)


@contextlib.contextmanager
def opened(station: GroundStation, browser, *, with_view: bool) -> Iterator[Any]:
    """As `visited`, in a tab that is closed then."""
    if with_view:
        with_plain_light(station)
    with tab(browser, with_view=with_view) as new, visited(station, new) as page:
        if with_view:  # loaded after the page; `only_loopback` answers only inside calls of Playwright
            page.frame_locator("iframe").locator("canvas").first.wait_for()
        yield page


def with_plain_light(station: GroundStation) -> None:
    """Leave out shadows and light from all sides in the 3D view: without a graphics card they take 12 s of CPU time."""
    station.server.scene.configure_environment_map(None)
    station.server.scene.configure_default_lights(cast_shadow=False)


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
