"""A ground station with two pillars and a SITL vehicle, and pages of it in a browser."""

import shutil
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

import vehicle
from firmware_bridge import SitlVehicle, controller, keys
from flight import Waypoints, project
from gcs_web import GroundStation
from tests.gcs_web.in_browser import CHROMIUM, FLAGS, START, opened, start_again
from tests.waiting import PATIENCE_S
from tests.waiting import until as wait


@pytest.fixture(scope="module")
def station(pillar_map: Path, tmp_path_factory) -> Iterator[GroundStation]:
    folder = tmp_path_factory.mktemp("station") / "project"
    opened = project.create(folder, "two <b>pillars</b>")  # foreign strings are text, never markup
    shutil.copytree(pillar_map, opened.map)
    believed = vehicle.example("rigter2019")
    vehicle.save(opened.vehicle, believed)
    project.save_waypoints(opened.waypoints, Waypoints(START, np.full(3, np.nan)))
    key_file = folder / "link.key"
    plant = vehicle.simulate.Plant(believed, vehicle.simulate.State(), ground_m=0.0)
    with (
        SitlVehicle(plant, controller.parameters_of(believed).parameters, key=keys.create(key_file)) as simulated,
        GroundStation(folder, triangles=500, vehicle_url=simulated.url, key_file=key_file) as running,
    ):
        yield running


@pytest.fixture(scope="module")
def browser():
    from playwright.sync_api import sync_playwright

    with sync_playwright() as playwright:
        started = playwright.chromium.launch(executable_path=CHROMIUM, args=FLAGS, timeout=1000 * PATIENCE_S)
        yield started
        started.close()


@pytest.fixture
def page(station: GroundStation, browser):
    """A page that shows the checked plan of the same waypoints, whatever ran before.

    Its 3D view stays empty: without a graphics card each view takes 6 s of CPU time to start.
    """
    start_again(station)
    with opened(station, browser, with_view=False) as page:
        page.get_by_text("Checked", exact=True).wait_for()
        yield page


@pytest.fixture(scope="module")
def window(station: GroundStation, browser):
    """A page with its 3D view, for all tests of it: they come last, so that no other test waits for its pictures."""
    with opened(station, browser, with_view=True) as page:
        wait(lambda: len(station.server.get_clients()) == 1, "the 3D view")
        yield page


@pytest.fixture
def page_3d(station: GroundStation, window):
    """Like `page`, with its 3D view."""
    start_again(station)
    window.get_by_text("Checked", exact=True).wait_for()
    return window
