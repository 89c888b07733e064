"""The page in a real browser: a dragged waypoint is planned anew, undo brings it back, nothing leaves this machine."""

import shutil
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

import vehicle
from firmware_bridge import SitlVehicle, controller, keys
from flight import Waypoints, project
from gcs_web import GroundStation
from tests.waiting import PATIENCE_S
from tests.waiting import until as wait

CHROMIUM = shutil.which("chromium")
FLAGS = [
    "--headless", "--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run",
    "--disable-background-networking", "--disable-component-update", "--disable-sync",
    "--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader",
]  # fmt: skip
SIZE = (900, 560)
WAYPOINTS = np.array([[0.8, 0.8, 1.0], [3.0, 2.0, 1.2], [5.2, 0.8, 1.2]])

pytestmark = pytest.mark.skipif(CHROMIUM is None, reason="needs Chromium: apt-get install chromium")


@pytest.fixture(scope="module")
def station(pillar_map: Path, tmp_path_factory) -> Iterator[GroundStation]:
    folder = tmp_path_factory.mktemp("station") / "project"
    opened = project.create(folder, "two pillars")
    shutil.copytree(pillar_map, opened.map)
    vehicle.save(opened.vehicle, vehicle.example("rigter2019"))
    project.save_waypoints(opened.waypoints, Waypoints(WAYPOINTS, np.full(3, np.nan)))
    key_file = folder / "link.key"
    parameters = controller.parameters_of(vehicle.load(opened.vehicle)).parameters
    plant = vehicle.simulate.Plant(vehicle.load(opened.vehicle), vehicle.simulate.State(), ground_m=0.0)
    with (
        SitlVehicle(plant, parameters, key=keys.create(key_file)) as simulated,
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
    foreign: list[str] = []

    def only_loopback(route):
        if route.request.url.startswith(("http://127.0.0.1:", "data:", "blob:")):
            route.continue_()
        else:
            foreign.append(route.request.url)
            route.abort()

    context = browser.new_context(viewport={"width": SIZE[0], "height": SIZE[1]})
    context.set_default_timeout(1000 * PATIENCE_S)  # drawn without a graphics card: slow beside other work
    context.route("**/*", only_loopback)
    opened = context.new_page()
    opened.goto(station.url)
    wait(lambda: len(station.server.get_clients()) == 1, "the browser")
    for index, position in enumerate(WAYPOINTS):  # each test begins with the same plan, whatever ran before it
        station.session.move(index, position)
    station.session.request_plan()
    wait(lambda: settled(station), "a plan")
    assert station.session.state()["plan"], station.session.state()
    yield opened
    context.close()
    wait(lambda: not station.server.get_clients(), "the browser's leave")
    assert foreign == []


def pixel(station: GroundStation, point_world_m: np.ndarray) -> tuple[float, float]:
    """Where the browser draws a point: pinhole projection with the camera the browser reports."""
    camera = next(iter(station.server.get_clients().values())).camera
    from flight import rotations

    x, y, z = rotations.rotate(rotations.conjugate(camera.wxyz), point_world_m - np.asarray(camera.position))
    height = SIZE[1]
    width = camera.aspect * height
    scale = 0.5 * height / np.tan(0.5 * camera.fov)
    return width / 2 + scale * x / z, height / 2 + scale * y / z


def drawn(page) -> None:
    """Return when the browser has drawn what it was told so far."""
    page.evaluate("() => new Promise(done => requestAnimationFrame(() => requestAnimationFrame(done)))")


def dragged(page, station: GroundStation, start_world_m: np.ndarray, end_world_m: np.ndarray) -> bool:
    """Pull with the mouse as a hand does, each step once the browser has drawn the one before; was it understood?"""
    before = station.session.state()["revision"]
    start, end = np.array(pixel(station, start_world_m)), np.array(pixel(station, end_world_m))
    drawn(page)
    page.mouse.move(*start)
    drawn(page)
    page.mouse.down()
    for share in np.linspace(0.1, 1.0, 10):
        page.mouse.move(*(start + share * (end - start)))
    drawn(page)
    page.mouse.up()
    again_s = time.monotonic() + 20.0  # then the handle was not drawn yet when the mouse came down on it
    while station.session.state()["revision"] == before and time.monotonic() < again_s:
        drawn(page)
    return station.session.state()["revision"] > before


def settled(station: GroundStation) -> bool:
    return not station.session.state()["planning"]


def test_a_dragged_waypoint_is_planned_anew_and_undo_brings_it_back(station, page, tmp_path):
    before = station.session.state()
    assert before["plan"]["checked"]

    pull = np.array([0.0, 0.35, 0.0])
    grip = WAYPOINTS[1] + np.array([0.0, 0.3, 0.0])  # on the gizmo's y arrow
    wait(lambda: dragged(page, station, grip, grip + pull), "a drag that the page understands")
    wait(lambda: settled(station))
    moved = np.array(station.session.state()["waypoints_world_m"])
    np.testing.assert_allclose(moved[1], WAYPOINTS[1] + pull, atol=0.15)
    np.testing.assert_array_equal(moved[[0, 2]], WAYPOINTS[[0, 2]])
    saved = project.load_waypoints(station.session.project.waypoints).positions_world_m
    np.testing.assert_array_equal(saved, moved)

    page.get_by_role("button", name="Undo").click()
    wait(lambda: station.session.state()["can_redo"])
    np.testing.assert_array_equal(station.session.positions_world_m, WAYPOINTS)
    page.screenshot(path=tmp_path / "page.png")
    assert (tmp_path / "page.png").stat().st_size > 20_000


def test_a_waypoint_in_a_pillar_is_refused_with_the_reason(station, page):
    station.session.move(1, np.array([2.0, 1.5, 1.2]))
    wait(lambda: settled(station))
    state = station.session.state()
    assert state["plan"] is None
    assert "waypoint 1" in state["problem"]
    page.get_by_text("no plan").wait_for()
    assert page.get_by_role("button", name="Upload").is_disabled()
    station.session.undo()
    wait(lambda: station.session.state()["plan"])


def test_saving_writes_a_checked_trajectory(station, page):
    page.get_by_role("button", name="Save").click()
    path = station.session.project.trajectory("plan")
    wait(path.exists)
    from flight import trajectory

    saved = trajectory.load(path)
    assert saved.checked
    assert saved.map_hash == station.session.map.hash

    first = path.read_bytes()
    station.session.move(1, WAYPOINTS[1] + [0.0, 0.2, 0.0])
    wait(lambda: station.session.state()["plan"])
    page.get_by_role("button", name="Save").click()
    page.get_by_text("it will be kept beside the new one").wait_for()
    assert path.read_bytes() == first
    page.get_by_role("button", name="Replace").click()
    page.get_by_text("the one before is kept as plan.json.old-1").wait_for()
    assert path.with_name("plan.json.old-1").read_bytes() == first
    assert path.read_bytes() != first


def test_an_upload_is_shown_first_then_done_and_the_vehicle_is_drawn(station, page):
    page.get_by_role("button", name="Upload ...").click()
    page.get_by_text("It replaces what the vehicle holds").wait_for()
    assert "holds no trajectory" in station.watch.describe()
    page.get_by_role("button", name="Upload", exact=True).click()
    wait(lambda: "holds plan" in station.watch.describe())
    page.get_by_text("read back and equal").wait_for()
    assert station.page.vehicle_frame.visible
    np.testing.assert_allclose(station.page.vehicle_frame.position, [0.0, 0.0, 0.0], atol=0.05)
