"""The page in a real browser: edit in table and 3D, undo, save, upload, abort; nothing leaves this machine."""

import contextlib
import re
import shutil
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
import pytest

import esdf
import vehicle
from firmware_bridge import SitlVehicle, controller, keys
from flight import Waypoints, flight_log, mission, project, rotations, trajectory
from gcs_web import GroundStation, protocol, protocol_parts, slices
from gcs_web.map_view import pulled
from tests.waiting import PATIENCE_S
from tests.waiting import until as wait

CHROMIUM = shutil.which("chromium")
FLAGS = [
    "--headless", "--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run",
    "--disable-background-networking", "--disable-component-update", "--disable-sync",
    "--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader",
]  # fmt: skip
SIZE = {"width": 1280, "height": 720}
START = np.array([[0.8, 0.8, 1.0], [3.0, 2.0, 1.2], [5.2, 0.8, 1.2]])

pytestmark = pytest.mark.skipif(CHROMIUM is None, reason="needs Chromium: apt-get install chromium")


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


@contextlib.contextmanager
def opened(station: GroundStation, browser, *, with_view: bool) -> Iterator[Any]:
    """The page in a window of its own, which is closed without an error and without a request to elsewhere."""
    foreign: list[str] = []

    def only_loopback(route):
        if not with_view and "/viser/" in route.request.url:
            route.fulfill(body="", content_type="text/html")
        elif route.request.url.startswith(("http://127.0.0.1:", "data:", "blob:")):
            route.continue_()
        else:
            foreign.append(route.request.url)
            route.abort()

    context = browser.new_context(viewport=SIZE, reduced_motion="reduce")
    context.set_default_timeout(1000 * PATIENCE_S)  # drawn without a graphics card: slow beside other work
    context.route("**/*", only_loopback)
    errors: list[str] = []
    page = context.new_page()
    page.on("pageerror", lambda error: errors.append(str(error)))
    page.goto(station.url)
    yield page
    context.close()
    wait(lambda: not station.hub.people, "the page's leave")
    assert foreign == []
    assert errors == []


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


def start_again(station: GroundStation) -> None:
    """Give the station the waypoints that every test begins with."""
    station.desk.session.take(Waypoints(START, np.full(3, np.nan)), "test begins", "test")
    wait(
        lambda: station.desk.answer and station.desk.answer.request.revision == station.desk.session.revision, "a plan"
    )


def positions(station: GroundStation) -> np.ndarray:
    return station.desk.session.content.waypoints().positions_world_m


def cell(page, row: int, column: int):
    """Of the table of waypoints; columns x y z yaw are 0 to 3."""
    return (
        page.get_by_role("grid", name="Waypoints").get_by_role("row").nth(row + 1).get_by_role("gridcell").nth(column)
    )


def drawn(page) -> None:
    """Return when the browser has drawn what it was told so far."""
    page.evaluate("() => new Promise(done => requestAnimationFrame(() => requestAnimationFrame(done)))")


def test_a_cell_is_edited_planned_and_taken_back_by_keyboard(station, page, tmp_path):
    cell(page, 1, 2).dblclick()
    page.keyboard.press("Control+A")
    page.keyboard.type("1.55")
    page.keyboard.press("Enter")
    wait(lambda: positions(station)[1, 2] == 1.55, "the edit")
    page.get_by_text("Checked", exact=True).wait_for()
    page.get_by_role("status").get_by_text("Waypoint 1 moved 0.35 m").wait_for()
    page.keyboard.press("Control+z")
    wait(lambda: np.array_equal(positions(station), START), "undo")
    page.screenshot(path=tmp_path / "page.png")
    assert (tmp_path / "page.png").stat().st_size > 20_000


def verdict(page):
    return page.get_by_role("region", name="Verdict")


def test_a_stay_is_asked_for_in_the_table_and_taken_back(station, page):
    page.get_by_role("button", name="Requests").click()
    cell(page, 1, 1).dblclick()
    page.keyboard.type("1.5")
    page.keyboard.press("Enter")
    wait(lambda: station.desk.session.content.points[1].stay_s == 1.5, "the stay")
    page.get_by_role("status").get_by_text("Stay at waypoint 1 1.5 s").wait_for()
    verdict(page).get_by_text("Checked", exact=True).wait_for()
    cell(page, 1, 2).dblclick()
    page.keyboard.type("0.4")
    page.keyboard.press("Enter")
    page.get_by_role("alert").get_by_text("a stay and a radius").wait_for()
    page.keyboard.press("Escape")
    page.keyboard.press("Control+z")
    wait(lambda: station.desk.session.content.points[1].plain, "undo")
    page.get_by_role("button", name="Position").click()


def test_a_velocity_begins_with_the_plans_own_is_edited_and_dropped(station, page):
    page.get_by_role("button", name="Requests").click()
    page.get_by_role("grid", name="Waypoints").get_by_role("row").nth(2).get_by_role("rowheader").click()
    passing = next(
        p for p in station.desk.answer.shown.passings if p.waypoint == station.desk.session.content.points[1].id
    )
    velocity = page.get_by_role("region", name="Velocity")
    velocity.get_by_role("button", name="Ask for a velocity").click()
    wait(lambda: station.desk.session.content.points[1].velocity_world_m_s is not None, "the velocity")
    asked = station.desk.session.content.points[1].velocity_world_m_s
    assert np.linalg.norm(asked) == pytest.approx(passing.speed_m_s, abs=0.2)
    field = velocity.get_by_label("vz")
    field.fill("0.25")
    field.press("Enter")
    wait(lambda: station.desk.session.content.points[1].velocity_world_m_s == (*asked[:2], 0.25), "the edit")
    verdict(page).get_by_text("Checked", exact=True).wait_for()
    velocity.get_by_role("button", name="Drop").click()
    wait(lambda: station.desk.session.content.points[1].plain, "its end")
    page.get_by_role("button", name="Position").click()


def test_a_gate_and_a_tube_are_set_in_the_inspector_drawn_and_planned_with(station, page):
    cell(page, 1, 0).click()
    page.get_by_role("button", name="Add a gate at waypoint 1").click()
    wait(lambda: station.desk.session.content.points[1].gate is not None, "the gate")
    form = page.get_by_role("region", name="Gate at waypoint 1")
    for label, text in (("Width", "1.4"), ("Heading, from x towards y", "20")):
        form.get_by_label(label).fill(text)
        form.get_by_label(label).press("Enter")
    wait(lambda: station.desk.session.content.points[1].gate.heading_rad == pytest.approx(np.radians(20.0)), "20 deg")
    assert station.desk.session.content.points[1].gate.width_m == 1.4
    page.get_by_role("tab", name="Mission").click()
    page.get_by_role("checkbox", name="Keep in a tube").click()
    wait(lambda: station.desk.session.content.settings.keep_in is not None, "the tube")
    verdict(page).get_by_text("Checked", exact=True).wait_for()
    wait(lambda: {"gates", "keep-in"} <= names(station), "a plan through the gate, inside the tube")
    drawn = [node.name for node in station.view._course]
    assert drawn == ["/gate_1/frame", "/gate_1/pane", "/tube"]
    kept = mission.load(station.desk.project.waypoints)
    assert (len(kept.gates), kept.keep_in.radius_m) == (1, 1.0)
    page.get_by_role("checkbox", name="Keep in a tube").click()
    wait(lambda: station.desk.session.content.settings.keep_in is None, "no tube")
    wait(lambda: len(station.view._course) == 2, "the tube's end")


def names(station: GroundStation) -> set[str]:
    """Of the checks that the plan in sight has passed."""
    answer = station.desk.answer
    return set() if answer.file is None else {check["name"] for check in answer.file.check["checks"]}


def test_laps_a_landing_and_where_to_look_are_set_in_the_mission_tab(station, page):
    page.get_by_role("tab", name="Mission").click()
    page.get_by_role("checkbox", name="Closed loop").click()
    laps = page.get_by_role("textbox", name="Laps")
    laps.fill("2")
    laps.press("Enter")
    verdict(page).get_by_text("2 laps").wait_for()
    page.get_by_role("checkbox", name="Landing").click()
    wait(lambda: station.desk.session.content.settings.landing is not None, "the landing")
    page.get_by_role("radio", name="Fixed").click()
    heading = page.get_by_label("Heading, from x towards y")
    heading.fill("90")
    heading.press("Enter")
    wait(lambda: station.desk.session.content.settings.heading_rad == pytest.approx(np.pi / 2), "the heading")
    verdict(page).get_by_text("Checked", exact=True).wait_for()
    assert mission.load(station.desk.project.waypoints).yaw.mode == "fixed"
    page.get_by_role("radio", name="Along the path").click()
    wait(lambda: station.desk.session.content.settings.yaw == "along_path", "the yaw mode")


def test_the_tightest_segment_is_shown_everywhere(station, page):
    page.get_by_role("tab", name="Segments").click()
    table = page.get_by_role("table", name="Segments")
    assert table.get_by_role("row").count() == len(START)  # a head, and one between any two waypoints
    page.get_by_role("button", name="Go to the tightest").click()
    tightest = max(station.desk.answer.shown.segments, key=lambda segment: segment.share)
    page.get_by_text(f"{tightest.worst_s:.2f} s", exact=True).first.wait_for()
    wait(lambda: station.view._selected == (tightest.start,), "the waypoint before it")


@pytest.mark.parametrize(("colour", "unit"), [("thrust", "N"), ("rotor_margin", "%"), ("clearance", "m")])
def test_the_path_is_coloured_by_what_is_chosen_with_ends_and_unit(station, page, colour, unit):
    page.get_by_label("Colour of the path").select_option(colour)
    page.locator(".legend-head").get_by_text(unit, exact=True).wait_for()
    wait(lambda: station.view._colour == colour, "the colours")


SERIOUS = ("serious", "critical")


@pytest.mark.parametrize("width", [1280, 390])
def test_nothing_on_the_page_is_a_serious_barrier(page, width):
    from axe_playwright_python.sync_playwright import Axe

    page.set_viewport_size({"width": width, "height": 844})
    found: dict[str, list[str]] = {}

    def look(where: str) -> None:
        drawn(page)
        results = Axe().run(page, context={"exclude": [["iframe"]]}).response["violations"]  # viser's own page
        for rule in results:
            if rule["impact"] in SERIOUS:
                found[f"{where}: {rule['id']}"] = [node["html"] for node in rule["nodes"]]

    for name in ("Waypoints", "Segments", "Speed", "Mission", "Saved"):
        page.get_by_role("tab", name=name).click()
        look(name)
    page.get_by_role("tab", name="Waypoints").click()
    page.get_by_role("button", name="Requests").click()
    look("Requests")
    page.get_by_role("button", name="Position").click()
    for number in "13":
        page.keyboard.press(number)
        look(f"step {number}")
    assert found == {}


@pytest.mark.parametrize("width", [800, 720])
def test_abort_and_the_status_are_whole_in_a_small_window(page, width):
    page.set_viewport_size({"width": width, "height": 600})
    for number in "12345":
        page.keyboard.press(number)
        drawn(page)
        for shown in (page.get_by_role("button", name=re.compile("^Abort")), page.get_by_role("contentinfo")):
            assert shown.evaluate("e => Math.max(e.getBoundingClientRect().right, e.scrollWidth)") <= width
        view = page.locator(".scene")
        assert view.count() == 0 or view.bounding_box()["height"] > 150


def test_a_waypoint_in_a_pillar_is_refused_in_words(station, page):
    cell(page, 1, 0).dblclick()
    page.keyboard.press("Control+A")
    page.keyboard.type("2.0")
    page.keyboard.press("Tab")
    page.keyboard.press("Control+A")
    page.keyboard.type("1.5")
    page.keyboard.press("Enter")
    verdict(page).get_by_text("Refused").wait_for()
    verdict(page).get_by_text("waypoint 1").first.wait_for()
    assert page.get_by_role("button", name="Compare and upload").is_disabled()


def test_saving_writes_a_checked_trajectory(station, page):
    page.get_by_role("button", name="Save", exact=True).first.click()
    page.keyboard.press("Control+A")
    page.keyboard.type("lap-1")
    page.keyboard.press("Enter")
    path = station.desk.project.trajectory("lap-1")
    wait(path.exists, "the file")
    saved = trajectory.load(path)
    assert saved.checked
    assert saved.map_hash == station.desk.parts.map(station.desk.inputs).hash


def test_an_upload_is_compared_first_and_takes_a_held_button(station, page):
    page.get_by_role("button", name="Compare and upload").click()
    hold = page.get_by_role("button", name=re.compile("Hold to upload"))
    if not hold.is_visible():
        page.get_by_role("button", name=re.compile("Take control")).first.click()
    hold.wait_for()
    hold.focus()
    page.keyboard.down("Space")
    page.keyboard.up("Space")  # let go at once: nothing is sent
    drawn(page)
    assert station.watch.held() is None
    page.keyboard.down("Space")
    wait(lambda: station.watch.held() is not None, "the upload")
    page.keyboard.up("Space")
    page.get_by_role("status").get_by_text("read back and equal").wait_for()
    held = station.watch.held()
    assert held.crc32 == station.watch.planned(station.desk.checked(), station.desk.name).crc32


def test_abort_works_from_inside_a_field_and_is_answered(station, page):
    cell(page, 1, 2).dblclick()
    page.keyboard.press("Shift+Escape")
    wait(lambda: (station.desk.project.folder / ".session" / "audit.jsonl").is_file(), "the order's record")
    wait(lambda: '"abort"' in (station.desk.project.folder / ".session" / "audit.jsonl").read_text(), "the abort")


def test_a_foreign_name_is_shown_as_text(page):
    page.get_by_text("two <b>pillars</b>").first.wait_for()
    assert page.locator("header b").count() == 0


def test_a_phone_shows_the_vehicle_and_abort_without_scrolling(station, page, tmp_path):
    page.set_viewport_size({"width": 390, "height": 844})
    abort = page.get_by_role("button", name="Abort")
    abort.wait_for()
    box = abort.bounding_box()
    assert box["y"] + box["height"] < 120
    assert box["height"] >= 40
    page.set_viewport_size({"width": 360, "height": 740})
    state = page.locator(".vehicle-state")
    assert "disarmed" in state.inner_text()
    assert state.evaluate("e => e.scrollWidth - e.clientWidth") <= 0  # the name before it gives way
    assert state.bounding_box()["x"] + state.bounding_box()["width"] <= abort.bounding_box()["x"]
    page.screenshot(path=tmp_path / "phone.png")


def test_a_phone_reaches_the_list_of_projects(page, tmp_path):
    page.set_viewport_size({"width": 360, "height": 740})
    projects = page.get_by_title("Projects")
    box = projects.bounding_box()
    assert min(box["width"], box["height"]) >= 40  # a thumb's width
    projects.click()
    dialog = page.get_by_role("dialog", name="Projects")
    place = dialog.bounding_box()
    assert place["x"] >= 0
    assert place["x"] + place["width"] <= 360
    page.screenshot(path=tmp_path / "projects.png")
    dialog.get_by_role("button", name="Close").click()
    dialog.wait_for(state="detached")


def test_a_number_typed_while_an_earlier_one_is_previewed_stays(page, station: GroundStation, monkeypatch):
    compute = station.desk.map._show_preview

    def slowly(*args, **kwargs):
        time.sleep(0.5)
        compute(*args, **kwargs)

    monkeypatch.setattr(station.desk.map, "_show_preview", slowly)
    page.keyboard.press("1")
    page.get_by_role("toolbar", name="Map").get_by_role("button", name="Box").click()
    form = page.get_by_role("form", name="New edit of the map")
    fields = [form.get_by_label(f"Centre, m {axis}") for axis in "xyz"]
    wait(lambda: station.desk.map._preview.shape is not None, "the first preview")
    first = station.desk.map._preview
    for field, value in zip(fields, ("3.0", "3.4", "0.5"), strict=True):
        if field is fields[2]:  # two were typed during the preview of the first, whose answer comes now
            wait(lambda: station.desk.map._preview is not first, "the answer to the first number")
            page.wait_for_timeout(200)  # until the page has read it, and before the second is answered
        field.fill(value)
        field.press("Enter")
    wait(lambda: station.view.map._shape.centre_m == (3.0, 3.4, 0.5), "the box of the last number typed")
    assert [float(field.input_value()) for field in fields] == [3.0, 3.4, 0.5]
    form.get_by_role("button", name="Cancel").click()


def test_a_no_fly_zone_is_drawn_by_numbers_and_by_its_handle_previewed_applied_and_undone(page, station: GroundStation):
    page.keyboard.press("1")
    page.get_by_role("toolbar", name="Map").get_by_role("button", name="Box").click()
    form = page.get_by_role("form", name="New edit of the map")
    form.get_by_label("Name").fill("<i>cable</i>")
    for axis, value in zip("xyz", ("3.0", "3.4", "0.5"), strict=True):
        form.get_by_label(f"Centre, m {axis}").fill(value)
        form.get_by_label(f"Centre, m {axis}").press("Enter")
    form.get_by_text("no longer free").wait_for()
    wait(lambda: "centre" in station.view.map._handles, "the handles")
    wait(lambda: station.view.map._shape.centre_m == (3.0, 3.4, 0.5), "the box of the last number typed")
    assert not station.desk.map._preview.drawn  # so that no answer replaces what was typed since
    shape = pulled(station.view.map._shape, "size", np.array([3.4, 3.6, 1.0]))  # as viser tells of a drag's end
    station.view.map.on_shape(shape, True)
    assert station.desk.map._preview.drawn
    wait(lambda: form.get_by_label("Size, m x").input_value() == "0.9", "the numbers of the pulled box")
    assert station.desk.session.content.map_edits == ()
    form.get_by_role("button", name="Add to the map").click()
    page.get_by_role("button", name="No-fly: <i>cable</i>").wait_for()
    edits = station.desk.project.map / "esdf" / "edits.json"
    assert [(edit.action, edit.name) for edit in esdf.load_edits(edits)] == [("no-fly", "<i>cable</i>")]
    page.keyboard.press("Control+z")
    page.get_by_text("None. Draw a box").wait_for()
    assert esdf.load_edits(edits) == ()


def test_what_another_person_made_of_a_zone_meanwhile_is_not_overwritten(page, station: GroundStation):
    session = station.desk.session
    shape = protocol_parts.Shape("box", (3.0, 3.4, 0.5), (0.5, 0.5, 0.5))
    asked = {"serial": 0, "revision": session.revision, "shape": shape}
    session.edit(protocol.AddMapEdit(action="no-fly", name="cable", **asked), "Ada")
    page.keyboard.press("1")
    page.get_by_role("button", name="No-fly: cable").click()
    form = page.get_by_role("form", name="Edit of the map")
    form.get_by_label("Centre, m x").wait_for()
    wide = msgspec.structs.replace(shape, size_m=(1.5, 0.5, 0.5))
    asked = {"serial": 0, "revision": session.revision, "shape": wide}
    session.edit(protocol.ChangeMapEdit(edit=session.content.map_edits[0].id, **asked), "Ada")
    page.get_by_role("button", name="No-fly: cable").get_by_text("0.4 m³").wait_for()
    form.get_by_label("Name").fill("wire")
    form.get_by_role("button", name="Apply").click()
    form.get_by_role("alert").get_by_text("changed the same meanwhile").wait_for()
    (zone,) = session.document().map_edits
    assert (zone.name, zone.shape.size_m) == ("cable", (1.5, 0.5, 0.5))
    session.undo("Ada")
    session.undo("Ada")


def test_the_path_is_split_at_the_cursor_and_all_waypoints_are_snapped(station, page):
    split = page.get_by_role("button", name="Split")
    page.locator("tr[data-waypoint] th").last.click()
    wait(split.is_disabled, "the end of splitting: the cursor is where a waypoint is already")
    page.get_by_role("tab", name="Segments").click()
    page.get_by_role("button", name=re.compile(": show ")).first.click()  # puts the cursor inside the path
    page.get_by_role("tab", name="Waypoints").click()
    series = station.desk.answer.shown.series  # of the path that is split; the next one is a draft at first
    path = np.stack([series.x_m, series.y_m, series.z_m], axis=1)
    split.click()
    wait(lambda: len(positions(station)) == 4, "the new waypoint")
    verdict(page).get_by_text("4 waypoints").wait_for()
    new = next(p for p in positions(station) if np.linalg.norm(START - p, axis=1).min() > 1e-6)
    assert np.linalg.norm(path - new, axis=1).min() < 0.1  # it was put on the path
    page.keyboard.press("Escape")  # the tightest segment had selected its waypoint
    page.get_by_text("Arrange", exact=True).click()
    page.get_by_role("button", name="Snap all").wait_for()
    page.get_by_role("region", name="Snap").get_by_label("Spacing").fill("0.4")
    page.get_by_role("region", name="Snap").get_by_label("Spacing").press("Enter")
    page.get_by_role("button", name=re.compile("^Snap ")).click()
    wait(lambda: np.allclose(positions(station) / 0.4, np.round(positions(station) / 0.4)), "the grid")
    page.get_by_role("button", name="Random headings").click()
    wait(lambda: station.desk.session.content.points[1].yaw_rad is not None, "a heading")
    page.keyboard.press("Control+z")
    page.keyboard.press("Control+z")
    wait(lambda: len({*positions(station)[:, 2]} & {*START[:, 2]}) > 0, "both taken back")


def test_waypoints_come_from_a_recorded_flight_by_the_deviation_allowed(station, page):
    t = np.linspace(0.0, 1.0, 200)[:, None]
    ends = np.array([[0.8, 0.8, 1.0], [0.8, 3.2, 1.0], [2.8, 3.2, 1.0]])
    corner = np.where(t < 0.5, ends[0] + 2 * t * (ends[1] - ends[0]), ends[1] + (2 * t - 1) * (ends[2] - ends[1]))
    quantities = {"position_world_m": corner}
    log = flight_log.from_vectors(np.arange(200) / 50.0, quantities)
    flight_log.save(station.desk.project.flight("corner"), log)
    station.desk.show_files()
    page.get_by_text("Arrange", exact=True).click()
    page.get_by_role("button", name="Waypoints from a recorded path").click()
    form = page.get_by_role("region", name="Recorded path")
    form.get_by_role("alert").get_by_text("does not say where its images were taken").wait_for()
    form.get_by_label("Recorded path").select_option("corner")
    form.get_by_text("3 waypoints for 200 recorded positions").wait_for()
    assert station.view._recorded is not None
    form.get_by_role("button", name="Replace the waypoints").click()
    wait(lambda: positions(station).shape == (3, 3) and positions(station)[1, 1] > 3.0, "the corner's waypoints")
    np.testing.assert_allclose(positions(station), ends, atol=0.05)
    wait(lambda: station.view._recorded is None, "an end of the preview")
    page.keyboard.press("Control+z")
    wait(lambda: np.array_equal(positions(station), START), "undo")
    station.desk.project.flight("corner").unlink()


def test_the_projects_beside_this_one_are_listed_as_text(station, page):
    other = project.create(station.desk.project.folder.parent / "yard", "<i>yard</i>")
    page.get_by_title("Projects").click()
    dialog = page.get_by_role("dialog", name="Projects")
    dialog.get_by_text("<i>yard</i>").wait_for()
    dialog.get_by_text("it has no map and no vehicle file").wait_for()
    assert dialog.get_by_role("button", name="Open <i>yard</i>").is_disabled()
    page.keyboard.press("Escape")
    dialog.wait_for(state="detached")
    (other.folder / "project.toml").unlink()


def test_an_oblique_slice_stands_through_the_measured_points(station, page):
    page.keyboard.press("1")
    page.get_by_role("toolbar", name="Map").get_by_role("button", name="Measure").click()
    wait(lambda: station.view.map.measuring, "measuring")
    a, b = np.array([1.0, 0.5, 0.4]), np.array([4.0, 2.5, 1.5])
    for point in (a, b):
        down = np.array([0.0, 0.0, -1.0])
        station.view.on_measure(point - down, down, point)
    page.get_by_role("group", name="Axis of the slice").get_by_role("button", name="oblique").click()
    page.get_by_role("button", name="Through the two measured points").click()
    wait(lambda: station.view.map._slice is not None and station.view.map._slice.at_m != 0.0, "the slice")

    def misses() -> float:
        shown = station.view.map._slice
        return max(abs(float(slices.normal(shown) @ point) - shown.at_m) for point in (a, b))

    wait(lambda: misses() < 0.01, "the slice through both points")
    page.get_by_role("group", name="Axis of the slice").get_by_role("button", name="oblique").click()
    page.get_by_role("toolbar", name="Map").get_by_role("button", name="Measure").click()
    wait(lambda: station.view.map._slice is None and not station.view.map.measuring, "an end")
    page.keyboard.press("2")


def pixel(page, station: GroundStation, point_world_m: np.ndarray) -> tuple[float, float]:
    """Where the browser draws a point: pinhole projection with the camera the 3D view reports."""
    camera = next(iter(station.server.get_clients().values())).camera
    x, y, z = rotations.rotate(rotations.conjugate(camera.wxyz), point_world_m - np.asarray(camera.position))
    box = page.locator("iframe").bounding_box()
    scale = 0.5 * box["height"] / np.tan(0.5 * camera.fov)
    return box["x"] + box["width"] / 2 + scale * x / z, box["y"] + box["height"] / 2 + scale * y / z


def dragged(page, station: GroundStation, start_world_m: np.ndarray, end_world_m: np.ndarray) -> bool:
    """Pull with the mouse as a hand does, each step once the browser has drawn the one before; was it understood?"""
    before = station.desk.session.revision
    start, end = (np.array(pixel(page, station, point)) for point in (start_world_m, end_world_m))
    drawn(page)
    page.mouse.move(*start)
    drawn(page)
    page.mouse.down()
    for share in np.linspace(0.1, 1.0, 10):
        page.mouse.move(*(start + share * (end - start)))
    drawn(page)
    page.mouse.up()
    again_s = time.monotonic() + 20.0  # then the handle was not drawn yet when the mouse came down on it
    while station.desk.session.revision == before and time.monotonic() < again_s:
        drawn(page)
    return station.desk.session.revision > before


def test_a_waypoint_is_dragged_in_the_3d_view(station, page_3d):
    page_3d.get_by_role("grid", name="Waypoints").get_by_role("row").nth(2).get_by_role("rowheader").click()
    pull = np.array([0.0, 0.35, 0.0])
    grip = START[1] + np.array([0.0, 0.25, 0.0])  # on the handle's y arrow
    drafts: list[np.ndarray] = []
    draw, station.view.draw_draft = station.view.draw_draft, lambda path: (drafts.append(path), draw(path))
    try:
        wait(lambda: dragged(page_3d, station, grip, grip + pull), "a drag that the view understands")
        wait(lambda: drafts, "a draft of the path while it was dragged")
    finally:
        station.view.draw_draft = draw
    assert np.linalg.norm(drafts[-1] - positions(station)[1], axis=1).min() < 0.3
    moved = positions(station)
    np.testing.assert_allclose(moved[1], START[1] + pull, atol=0.15)
    np.testing.assert_array_equal(moved[[0, 2]], START[[0, 2]])
    page_3d.get_by_role("status").get_by_text("Waypoint 1 moved").wait_for()


def clicked(page, station: GroundStation, point_world_m: np.ndarray, answered) -> bool:
    """Click where the browser draws a point; was it answered before the browser drew its next pictures?"""
    drawn(page)
    page.mouse.click(*pixel(page, station, point_world_m))
    again_s = time.monotonic() + 20.0  # then the scene was not drawn yet when it was clicked
    while not answered() and time.monotonic() < again_s:
        drawn(page)
    return answered()


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
    page_3d.get_by_role("status").get_by_text("Waypoint 3 inserted").wait_for()


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
        again_s = time.monotonic() + 20.0
        while station.view._selected != (last,) and time.monotonic() < again_s:
            drawn(page_3d)
        return station.view._selected == (last,)

    wait(boxed, "the rectangle that the view understands")
    table = page_3d.get_by_role("grid", name="Waypoints")
    wait(lambda: table.locator("tr[aria-selected=true]").count() == 1, "one row")
    page_3d.keyboard.press("Escape")


def test_a_stroke_of_the_brush_is_drawn_applied_as_one_change_and_undone(station, page_3d):
    page_3d.keyboard.press("1")
    tools = page_3d.get_by_role("toolbar", name="Map")
    tools.get_by_role("button", name="Brush").click()
    wait(lambda: station.view._painting, "the brush")
    before = station.desk.session.revision

    def stroke() -> bool:
        start, end = (np.array(pixel(page_3d, station, np.array(p))) for p in ([4.0, 1.0, 0.0], [5.0, 2.0, 0.0]))
        drawn(page_3d)
        page_3d.mouse.move(*start)
        drawn(page_3d)
        page_3d.mouse.down()
        for share in np.linspace(0.1, 1.0, 8):
            page_3d.mouse.move(*(start + share * (end - start)))
            drawn(page_3d)
        page_3d.mouse.up()
        again_s = time.monotonic() + 20.0
        while station.desk.map._preview.shape is None and time.monotonic() < again_s:
            drawn(page_3d)
        return station.desk.map._preview.shape is not None

    wait(stroke, "a stroke that the view understands")
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
    assert not station.view._painting
    page_3d.keyboard.press("Control+z")
    wait(lambda: station.desk.session.content.map_edits == (), "undo")
    page_3d.keyboard.press("2")
