"""A newcomer with a map, a vehicle and only the page: waypoints, a checked plan, an upload, a flight, its log."""

import contextlib
import json
import re
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh

import vehicle
from firmware_bridge import SitlVehicle, controller, keys
from flight import flight_log, project, trajectory
from tests.gcs_web.in_browser import CHROMIUM, FLAGS, cell
from tests.gcs_web.station_process import StationProcess, new_project
from tests.waiting import PATIENCE_S
from tests.waiting import until as wait

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(CHROMIUM is None, reason="needs Chromium: apt-get install chromium"),
]
PLACES = [("0.8", "0.8", "1"), ("3", "2", "1.2"), ("5.2", "0.8", "1.2")]
PICTURES = ("map", "waypoints", "checked", "saved", "upload", "flying", "landed", "phone")


class Newcomer:
    """Acts on a page, and counts what a person would call one act."""

    def __init__(self, page: Any, project: project.Project) -> None:
        self.page, self.project = page, project
        self.acts = 0

    def click(self, locator: Any) -> None:
        self.acts += 1
        locator.click()

    def press(self, name: str | re.Pattern[str]) -> None:
        """The button of this name, which is the only one."""
        self.click(self.page.get_by_role("button", name=name))

    def choose(self, field: Any, option: str) -> None:
        self.acts += 1
        field.select_option(option)

    def fill(self, field: Any, value: str) -> None:
        self.acts += 1
        field.fill(value)

    def type(self, value: str) -> None:
        """In place of what stands in the field."""
        self.acts += 1
        self.page.keyboard.press("Control+A")
        self.page.keyboard.type(value)
        self.page.keyboard.press("Enter")

    def form(self, name: str) -> Any:
        return self.page.get_by_role("form", name=name)

    def enter_waypoints(self) -> None:
        rows = self.page.get_by_role("grid", name="Waypoints").get_by_role("row")
        for row, place in enumerate(PLACES):
            self.press("Insert after" if row else "Insert the first")
            for column, value in enumerate(place):
                cell(self.page, row, column).dblclick()
                self.type(value)
                self.wait_for_cell(row, column, f"{float(value):.2f}")
            rows.nth(row + 1).get_by_role("rowheader").click()

    def wait_for_cell(self, row: int, column: int, value: str) -> None:
        wait(lambda: cell(self.page, row, column).inner_text() == value, f"{value} in the table")

    def hold(self, order: str, *, until: str) -> None:
        self.acts += 1
        hold(self.page, order, until=lambda: until in ordered(self.project))

    def upload(self, plan: str) -> None:
        self.press("Compare and upload")
        self.press("Take control")
        self.hold(f"upload {plan}", until="upload")
        self.page.get_by_role("status").get_by_text("read back and equal").wait_for()

    def wait_for_checked_plan(self) -> None:
        self.page.get_by_text("Checked", exact=True).wait_for()

    def wait_for_landing(self) -> None:
        self.page.get_by_role("status").get_by_text("Landed; the log is saved").wait_for()


def test_from_a_map_to_a_flown_plan_on_the_page_alone(pillar_map: Path, tmp_path: Path):
    opened = new_project(tmp_path / "project", pillar_map)
    opened.waypoints.unlink()  # a newcomer has none
    key_file, shared = tmp_path / "link.key", tmp_path / "shared.html"
    believed = vehicle.example("rigter2019")
    start = vehicle.simulate.State(position_world_m=np.array([0.8, 0.8, 0.0]))
    plant = vehicle.simulate.Plant(believed, start, ground_m=0.0)
    with (
        SitlVehicle(plant, controller.parameters_of(believed).parameters, key=keys.create(key_file)) as simulated,
        StationProcess(opened.folder, "--url", simulated.url, "--key", key_file) as station,
        chromium() as browser,
        first_visit(browser, station, opened) as newcomer,
    ):

        def picture(name: str) -> None:
            newcomer.page.screenshot(path=tmp_path / f"{name}.png")

        look_at_the_map(newcomer)
        picture("map")
        newcomer.press("Plan on this map")
        newcomer.enter_waypoints()
        picture("waypoints")
        look_at_the_tightest_place(newcomer)
        picture("checked")
        save_and_compare(newcomer)
        share(newcomer, shared)
        picture("saved")
        newcomer.upload("first flight")
        picture("upload")
        newcomer.click(newcomer.page.get_by_role("button", name=re.compile("Fly$")).first)
        newcomer.hold("arm and fly first flight", until="start")
        picture("flying")
        newcomer.wait_for_landing()
        newcomer.page.get_by_role("listitem").get_by_text(re.compile("^first flight-")).wait_for()
        picture("landed")
        newcomer.page.set_viewport_size({"width": 390, "height": 844})
        picture("phone")
        assert_whole_without_a_network(browser, shared)
    assert trajectory.load(opened.trajectory("first flight")).checked
    assert_flown_past_the_places(opened)
    for name in PICTURES:
        assert (tmp_path / f"{name}.png").stat().st_size > 20_000


def test_from_an_empty_folder_to_a_compared_flight_on_the_page_alone(tmp_path: Path):
    (tmp_path / "yard").mkdir()
    opened = project.Project(tmp_path / "yard", "yard")
    room = room_with_a_pillar(tmp_path / "room.ply")
    keys.create(tmp_path / "link.key")
    with (
        StationProcess(opened.folder, "--key", tmp_path / "link.key") as station,
        chromium() as browser,
        first_visit(browser, station, opened) as newcomer,
    ):
        import_map(newcomer, room)
        take_the_example_vehicle(newcomer)
        newcomer.press("Plan with it")
        newcomer.enter_waypoints()
        newcomer.wait_for_checked_plan()
        newcomer.press("Start the simulator")
        newcomer.click(newcomer.form("Simulator").get_by_role("button", name="Start"))
        newcomer.press("Fly it")
        newcomer.upload("plan")
        newcomer.hold("arm and fly plan", until="start")
        newcomer.wait_for_landing()
        newcomer.press(re.compile("^Compare plan-"))
        newcomer.page.get_by_role("img", name=re.compile("over time")).first.wait_for()
    assert newcomer.acts <= 40
    assert_flown_past_the_places(opened)


@contextlib.contextmanager
def chromium() -> Iterator[Any]:
    from playwright.sync_api import sync_playwright

    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=CHROMIUM, args=FLAGS, timeout=1000 * PATIENCE_S)
        yield browser
        browser.close()


@contextlib.contextmanager
def first_visit(browser: Any, station: StationProcess, opened: project.Project) -> Iterator[Newcomer]:
    """Somebody on the station's page, which is left without an error of its code."""
    page = browser.new_context(viewport={"width": 1440, "height": 900}, accept_downloads=True).new_page()
    page.set_default_timeout(1000 * PATIENCE_S)
    errors: list[str] = []
    page.on("pageerror", lambda error: errors.append(str(error)))
    page.goto(station.addresses()[-1])
    yield Newcomer(page, opened)
    assert errors == []


def look_at_the_map(newcomer: Newcomer) -> None:
    newcomer.click(newcomer.page.get_by_role("button", name=re.compile("Map")).first)
    newcomer.page.frame_locator("iframe").locator("canvas").first.wait_for()


def look_at_the_tightest_place(newcomer: Newcomer) -> None:
    newcomer.wait_for_checked_plan()
    newcomer.page.get_by_role("tab", name="Segments").click()
    newcomer.press("Go to the tightest")


def save_and_compare(newcomer: Newcomer) -> None:
    newcomer.click(newcomer.page.get_by_role("button", name="Save", exact=True).first)
    newcomer.type("first flight")
    newcomer.page.get_by_role("tab", name="Saved").click()
    newcomer.press("Compare first flight")
    newcomer.page.get_by_role("table").get_by_text("passes").first.wait_for()


def share(newcomer: Newcomer, saved_as: Path) -> None:
    with newcomer.page.expect_download() as download:
        newcomer.page.get_by_role("link", name="Share first flight").click()
    download.value.save_as(saved_as)


def assert_whole_without_a_network(browser: Any, shared: Path) -> None:
    page = browser.new_context(offline=True).new_page()
    asked: list[str] = []
    page.on("request", lambda request: asked.append(request.url))
    page.goto(shared.as_uri())
    assert page.get_by_text("passes the gate").is_visible()
    assert asked == [shared.as_uri()]


def room_with_a_pillar(file: Path) -> Path:
    pillar = trimesh.creation.cylinder(0.25, 2.5)
    pillar.apply_translation([3.0, 1.0, 1.25])
    trimesh.util.concatenate([trimesh.creation.box(bounds=[[0, 0, 0], [6, 4, 2.5]]), pillar]).export(file)
    return file


def import_map(newcomer: Newcomer, mesh: Path) -> None:
    with newcomer.page.expect_file_chooser() as chooser:
        newcomer.click(newcomer.page.get_by_text("Import a map"))
    chooser.value.set_files(mesh)
    form = newcomer.form("Map from a file")
    newcomer.choose(form.get_by_label("Unit"), "m")
    newcomer.choose(form.get_by_label("Up"), "z")
    newcomer.fill(form.get_by_label("A place that is free"), "1, 1, 1")
    newcomer.click(form.get_by_role("button", name="Start"))


def take_the_example_vehicle(newcomer: Newcomer) -> None:
    newcomer.press("An example")
    form = newcomer.form("Example vehicle")
    newcomer.choose(form.get_by_label("Vehicle"), "rigter2019")
    newcomer.click(form.get_by_role("button", name="Start"))
    newcomer.page.get_by_role("button", name="Look at the map").wait_for()


def assert_flown_past_the_places(opened: project.Project) -> None:
    flown = flight_log.load(opened.flights()[0]).vector("position_world_m")
    for place in np.array(PLACES, dtype=np.float64):
        assert np.linalg.norm(flown - place, axis=1).min() < 0.2


def ordered(opened: project.Project) -> list[str]:
    """What was ordered so far, as the audit log has it."""
    log = opened.folder / ".session" / "audit.jsonl"
    return [json.loads(line)["what"] for line in log.read_text().splitlines()] if log.exists() else []


def hold(page, act: str, *, until: Callable[[], bool]) -> None:
    """Hold a button by the space bar until its order was given."""
    button = page.get_by_role("button", name=re.compile(f"Hold to {act}"))
    button.wait_for()
    button.focus()
    page.keyboard.down("Space")
    wait(until, f"the order to {act}")
    page.keyboard.up("Space")
