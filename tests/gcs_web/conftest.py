"""A ground station with two pillars and a SITL vehicle, and pages of it in a browser."""

from collections.abc import Iterator
from pathlib import Path

import pytest

from gcs_web import GroundStation
from gcs_web.map import display_mesh
from tests.gcs_web.in_browser import CHROMIUM, FLAGS, opened, tab, visited
from tests.gcs_web.two_pillars import TRIANGLES, serving, shown, start_again
from tests.waiting import PATIENCE_S
from tests.waiting import until as wait


@pytest.fixture(scope="session")
def pillar_map(pillar_map: Path, made_once) -> Path:
    """With what the 3D view shows of it beside it."""
    made_once(shown(pillar_map).name, lambda folder: display_mesh.load(pillar_map / "mesh.glb", TRIANGLES, folder))
    return pillar_map


@pytest.fixture(scope="module")
def station(pillar_map: Path, tmp_path_factory) -> Iterator[GroundStation]:
    with serving(pillar_map, tmp_path_factory.mktemp("station") / "project") as running:
        yield running


@pytest.fixture
def same_waypoints(station: GroundStation):
    start_again(station)


@pytest.fixture(scope="module")
def browser():
    from playwright.sync_api import sync_playwright

    with sync_playwright() as playwright:
        started = playwright.chromium.launch(executable_path=CHROMIUM, args=FLAGS, timeout=1000 * PATIENCE_S)
        yield started
        started.close()


@pytest.fixture(scope="module")
def one_tab(browser):
    with tab(browser, with_view=False) as opened_once:
        yield opened_once


@pytest.fixture
def page(station: GroundStation, same_waypoints, one_tab):
    """A page that shows the checked plan of the same waypoints, whatever ran before.

    Its 3D view stays empty: without a graphics card each view takes 6 s of CPU time to start.
    """
    with visited(station, one_tab) as page:
        page.get_by_text("Checked", exact=True).wait_for()
        yield page


@pytest.fixture(scope="module")
def window(station: GroundStation, browser):
    """A page with its 3D view, for all tests of it: they come last, so that no other test waits for its pictures."""
    with opened(station, browser, with_view=True) as page:
        wait(lambda: len(station.server.get_clients()) == 1, "the 3D view")
        yield page


@pytest.fixture
def page_3d(same_waypoints, window):
    """Like `page`, with its 3D view."""
    window.get_by_text("Checked", exact=True).wait_for()
    return window
