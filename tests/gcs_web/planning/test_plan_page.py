"""The step Plan in a real browser: waypoints, requests, mission, segments; undo."""

import re

import numpy as np
import pytest

from flight import InputError, flight_log, mission
from gcs_web import GroundStation
from tests.gcs_web.in_browser import cell, needs_chromium, positions, verdict
from tests.gcs_web.two_pillars import START
from tests.waiting import until as wait
from tools import page_pictures

pytestmark = needs_chromium


def test_a_cell_is_edited_planned_and_taken_back_by_keyboard(station, page, tmp_path):
    cell(page, 1, 2).dblclick()
    page.keyboard.press("Control+A")
    page.keyboard.type("1.55")
    page.keyboard.press("Enter")
    wait(lambda: positions(station)[1, 2] == 1.55, "the edit")
    page.get_by_text("Checked", exact=True).wait_for()
    page.get_by_role("status").get_by_text("Waypoint 2 moved 0.35 m").wait_for()
    page.keyboard.press("Control+z")
    wait(lambda: np.array_equal(positions(station), START), "undo")
    page.screenshot(path=tmp_path / "page.png")
    assert (tmp_path / "page.png").stat().st_size > 20_000


def test_a_stay_is_asked_for_in_the_table_and_taken_back(station, page):
    page.get_by_role("button", name="Requests").click()
    cell(page, 1, 1).dblclick()
    page.keyboard.type("1.5")
    page.keyboard.press("Enter")
    wait(lambda: station.desk.session.content.points[1].stay_s == 1.5, "the stay")
    page.get_by_role("status").get_by_text("Stay at waypoint 2 1.5 s").wait_for()
    verdict(page).get_by_text("Checked", exact=True).wait_for()
    cell(page, 1, 2).dblclick()
    page.keyboard.type("0.4")
    page.keyboard.press("Enter")
    page.get_by_role("alert").get_by_text("a stay and a radius").wait_for()
    page.keyboard.press("Escape")
    page.keyboard.press("Control+z")
    wait(lambda: station.desk.session.content.points[1].plain, "undo")
    page.get_by_role("button", name="Position").click()


def test_jerks_of_the_path_and_of_a_leg_are_set_planned_with_and_dropped(station, page):
    page.get_by_role("tab", name="Speed").click()
    jerk = page.get_by_role("textbox", name="Jerk", exact=True)
    assert jerk.input_value() == ""
    jerk.fill("60")
    jerk.press("Enter")
    page.get_by_role("tab", name="Waypoints").click()
    page.get_by_role("button", name="Requests").click()
    cell(page, 0, 4).dblclick()
    page.keyboard.type("40")
    page.keyboard.press("Enter")
    wait(lambda: {"jerk", "jerk of legs"} <= names(station), "a plan within both")
    settings, points = station.desk.session.content.settings, station.desk.session.content.points
    assert (settings.jerk_m_s3, points[0].leg_jerk_m_s3) == (60.0, 40.0)
    assert mission.load(station.desk.project.waypoints).leg_jerks == (mission.LegJerk(0, 1, 40.0),)
    checks = {check["name"]: check["value"] for check in station.desk.answer.file.check["checks"]}
    assert checks["jerk"] <= 60.0
    cell(page, 0, 4).dblclick()
    page.keyboard.press("Control+A")
    page.keyboard.press("Delete")
    page.keyboard.press("Enter")
    wait(lambda: station.desk.session.content.points[0].plain, "no jerk of the leg")
    page.get_by_role("button", name="Position").click()
    page.get_by_role("tab", name="Speed").click()
    jerk.fill("")
    jerk.press("Enter")
    wait(lambda: station.desk.session.content.settings.jerk_m_s3 is None, "no jerk of the path")
    wait(lambda: names(station) and not {"jerk", "jerk of legs"} & names(station), "a plan without")
    page.get_by_role("tab", name="Waypoints").click()


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
    page.get_by_role("button", name="Add a gate at waypoint 2").click()
    wait(lambda: station.desk.session.content.points[1].gate is not None, "the gate")
    form = page.get_by_role("region", name="Gate at waypoint 2")
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


def into_the_pillar(page) -> None:
    """Move waypoint 2 there."""
    cell(page, 1, 0).dblclick()
    page.keyboard.press("Control+A")
    page.keyboard.type("2.0")
    page.keyboard.press("Tab")
    page.keyboard.press("Control+A")
    page.keyboard.type("1.5")
    page.keyboard.press("Enter")


def test_a_waypoint_in_a_pillar_is_refused_in_words(station, page):
    into_the_pillar(page)
    verdict(page).get_by_text("Refused").wait_for()
    verdict(page).get_by_text("waypoint 2").first.wait_for()
    assert page.get_by_role("button", name="Compare and upload").is_disabled()


def test_a_scene_of_the_docs_pictures_ends_at_a_refusal_with_its_sentence(station, page):
    page_pictures.checked(page)
    into_the_pillar(page)
    with pytest.raises(InputError, match=r"ends at a refusal: .*waypoint 2"):
        page_pictures.reach(page, verdict(page).get_by_text("2 laps"))


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


def test_the_legend_of_the_strip_sets_letters_apart_from_names(page):
    legend = page.get_by_text(re.compile(r"brighter: above 98 % of limit")).text_content()
    limits = legend.split(" · ")[:-1]
    assert limits
    assert all(re.fullmatch(r"\w: [a-z ]+", limit) for limit in limits), legend
