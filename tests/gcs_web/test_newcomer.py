"""A newcomer with a map, a vehicle and only the page: waypoints, a checked plan, an upload, a flight, its log."""

import json
import re
from collections.abc import Callable
from pathlib import Path

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


def test_from_a_map_to_a_flown_plan_on_the_page_alone(pillar_map: Path, tmp_path: Path):
    from playwright.sync_api import sync_playwright

    opened = new_project(tmp_path / "project", pillar_map)
    opened.waypoints.unlink()  # a newcomer has none
    key_file = tmp_path / "link.key"
    believed = vehicle.example("rigter2019")
    start = vehicle.simulate.State(position_world_m=np.array([0.8, 0.8, 0.0]))
    plant = vehicle.simulate.Plant(believed, start, ground_m=0.0)
    with (
        sync_playwright() as playwright,
        SitlVehicle(plant, controller.parameters_of(believed).parameters, key=keys.create(key_file)) as simulated,
        StationProcess(opened.folder, "--url", simulated.url, "--key", key_file) as station,
    ):
        browser = playwright.chromium.launch(executable_path=CHROMIUM, args=FLAGS, timeout=1000 * PATIENCE_S)
        page = browser.new_context(viewport={"width": 1440, "height": 900}, accept_downloads=True).new_page()
        page.set_default_timeout(1000 * PATIENCE_S)
        errors: list[str] = []
        page.on("pageerror", lambda error: errors.append(str(error)))

        def picture(name: str) -> None:
            page.screenshot(path=tmp_path / f"{name}.png")

        page.goto(station.addresses()[-1])
        page.get_by_role("button", name=re.compile("Map")).first.click()
        page.frame_locator("iframe").locator("canvas").first.wait_for()
        picture("map")

        page.get_by_role("button", name="Plan on this map").click()
        for row, place in enumerate(PLACES):
            page.get_by_role("button", name="Insert after" if row else "Insert the first").click()
            for column, value in enumerate(place):
                cell(page, row, column).dblclick()
                page.keyboard.press("Control+A")
                page.keyboard.type(value)
                page.keyboard.press("Enter")
                said = f"{float(value):.2f}"
                wait(lambda at=(row, column), said=said: cell(page, *at).inner_text() == said, f"{said} in the table")
            page.get_by_role("grid", name="Waypoints").get_by_role("row").nth(row + 1).get_by_role("rowheader").click()
        picture("waypoints")
        page.get_by_text("Checked", exact=True).wait_for()
        page.get_by_role("tab", name="Segments").click()
        page.get_by_role("button", name="Go to the tightest").click()
        picture("checked")

        page.get_by_role("button", name="Save", exact=True).first.click()
        page.keyboard.press("Control+A")
        page.keyboard.type("first flight")
        page.keyboard.press("Enter")
        page.get_by_role("tab", name="Saved").click()
        page.get_by_role("button", name="Compare first flight").click()
        page.get_by_role("table").get_by_text("passes").first.wait_for()
        with page.expect_download() as download:
            page.get_by_role("link", name="Share first flight").click()
        shared = tmp_path / "shared.html"
        download.value.save_as(shared)
        picture("saved")

        page.get_by_role("button", name="Compare and upload").click()
        page.get_by_role("button", name=re.compile("Take control")).first.click()
        hold(page, "upload first flight", until=lambda: "upload" in ordered(opened))
        page.get_by_role("status").get_by_text("read back and equal").wait_for()
        picture("upload")
        page.get_by_role("button", name=re.compile("Fly$")).first.click()
        hold(page, "arm and fly first flight", until=lambda: "start" in ordered(opened))
        picture("flying")
        page.get_by_role("status").get_by_text("Landed; the log is saved").wait_for()
        page.get_by_role("listitem").get_by_text(re.compile("^first flight-")).wait_for()
        picture("landed")
        page.set_viewport_size({"width": 390, "height": 844})
        picture("phone")

        other = browser.new_context(offline=True).new_page()
        asked: list[str] = []
        other.on("request", lambda request: asked.append(request.url))
        other.goto(shared.as_uri())
        assert other.get_by_text("passes the gate").is_visible()
        assert asked == [shared.as_uri()]
        browser.close()
    assert errors == []
    assert trajectory.load(opened.trajectory("first flight")).checked
    flown = flight_log.load(opened.flights()[0]).vector("position_world_m")
    for place in np.array(PLACES, dtype=np.float64):
        assert np.linalg.norm(flown - place, axis=1).min() < 0.2
    for name in PICTURES:
        assert (tmp_path / f"{name}.png").stat().st_size > 20_000


def test_from_an_empty_folder_to_a_compared_flight_on_the_page_alone(tmp_path: Path):
    from playwright.sync_api import sync_playwright

    (tmp_path / "yard").mkdir()
    room = tmp_path / "room.ply"
    pillar = trimesh.creation.cylinder(0.25, 2.5)
    pillar.apply_translation([3.0, 1.0, 1.25])
    trimesh.util.concatenate([trimesh.creation.box(bounds=[[0, 0, 0], [6, 4, 2.5]]), pillar]).export(room)
    opened = project.Project(tmp_path / "yard", "yard")
    keys.create(tmp_path / "link.key")
    acts = 0

    def act(locator, how: str = "click", *given: str):
        nonlocal acts
        acts += 1
        return getattr(locator, how)(*given)

    with sync_playwright() as playwright, StationProcess(opened.folder, "--key", tmp_path / "link.key") as station:
        browser = playwright.chromium.launch(executable_path=CHROMIUM, args=FLAGS, timeout=1000 * PATIENCE_S)
        page = browser.new_context(viewport={"width": 1440, "height": 900}).new_page()
        page.set_default_timeout(1000 * PATIENCE_S)
        errors: list[str] = []
        page.on("pageerror", lambda error: errors.append(str(error)))
        page.goto(station.addresses()[-1])
        with page.expect_file_chooser() as chooser:
            act(page.get_by_text("Import mesh or points"))
        chooser.value.set_files(room)
        form = page.get_by_role("form", name="Map from a mesh or points")
        act(form.get_by_label("Unit"), "select_option", "m")
        act(form.get_by_label("Up"), "select_option", "z")
        act(form.get_by_label("A place that is free"), "fill", "1, 1, 1")
        act(form.get_by_role("button", name="Start"))
        act(page.get_by_role("button", name="An example"))
        form = page.get_by_role("form", name="Example vehicle")
        act(form.get_by_label("Vehicle"), "select_option", "rigter2019")
        act(form.get_by_role("button", name="Start"))
        page.get_by_role("button", name="Look at the map").wait_for()
        act(page.get_by_role("button", name="Plan with it"))
        for row, place in enumerate(PLACES):
            act(page.get_by_role("button", name="Insert after" if row else "Insert the first"))
            for column, value in enumerate(place):
                cell(page, row, column).dblclick()
                page.keyboard.press("Control+A")
                page.keyboard.type(value)
                act(page.keyboard, "press", "Enter")
                said = f"{float(value):.2f}"
                wait(lambda at=(row, column), said=said: cell(page, *at).inner_text() == said, f"{said} in the table")
            page.get_by_role("grid", name="Waypoints").get_by_role("row").nth(row + 1).get_by_role("rowheader").click()
        page.get_by_text("Checked", exact=True).wait_for()
        act(page.get_by_role("button", name="Start the simulator"))
        act(page.get_by_role("form", name="Simulator").get_by_role("button", name="Start"))
        act(page.get_by_role("button", name="Fly it"))
        act(page.get_by_role("button", name="Compare and upload"))
        act(page.get_by_role("button", name="Take control"))
        hold(page, "upload plan", until=lambda: "upload" in ordered(opened))
        page.get_by_role("status").get_by_text("read back and equal").wait_for()
        hold(page, "arm and fly plan", until=lambda: "start" in ordered(opened))
        page.get_by_role("status").get_by_text("Landed; the log is saved").wait_for()
        acts += 2  # the two buttons that were held
        act(page.get_by_role("button", name=re.compile("^Compare plan-")))
        page.get_by_role("img", name=re.compile("over time")).first.wait_for()
        browser.close()
    assert errors == []
    assert acts <= 40
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
