"""The preflight on the page: flown, seen, kept, stale; a no-go keeps the vehicle on the ground."""

import re
from collections.abc import Iterator
from pathlib import Path
from typing import Literal

import msgspec
import numpy as np
import pytest

from flight import Waypoints
from gcs_web import GroundStation
from gcs_web.planning import preflown
from gcs_web.protocol.plan import Preflight, SimulatedFlight
from goshawk.station_jobs import preflight
from tests.gcs_web.in_browser import SERIOUS, drawn, needs_chromium
from tests.gcs_web.two_pillars import serving
from tests.waiting import until as wait

pytestmark = [needs_chromium, pytest.mark.slow]  # at the station: test_station_preflight, test_station_orders
ASKED = {"wind_m_s": 2.0, "like": "", "risk_percent": 10.0, "flights": 29}
ASIDE = SimulatedFlight([0.8, 3.0], [0.8, 2.2], [1.0, 1.2], [0.1, 0.5], ends=0, is_worst=True)


@pytest.fixture(scope="module")
def station(pillar_map: Path, tmp_path_factory) -> Iterator[GroundStation]:
    with serving(pillar_map, tmp_path_factory.mktemp("preflown") / "project", jobs=(preflight.KIND,)) as running:
        yield running


@pytest.fixture(autouse=True)
def not_flown(station: GroundStation):
    """Whatever ran before."""
    for file in (station.desk.project.folder / ".session").glob("preflights/*"):
        file.unlink()
    station.desk.show_preflight()


def tell(
    station: GroundStation, verdict: Literal["go", "no_go", "not_shown"], remedy: str = "wait for less wind"
) -> None:
    """Keep a preflight of the plan that is checked now."""
    said = {"sentence": "Risk as told.", "remedy": remedy, "assumed": ["a thing is assumed"], "asked": ASKED}
    found = Preflight("current", verdict=verdict, paths=[ASIDE], **said)
    folder = station.desk.project.folder
    preflown.save(folder, preflown.Flown.of(folder, station.desk.checked()), found)
    station.desk.show_preflight()


def block(page):
    return page.get_by_role("region", name="Preflight")


def test_a_plan_is_flown_in_simulation_seen_by_clearance_and_stale_once_it_is_edited(station, page):
    block(page).get_by_text("Not flown yet.").wait_for()
    block(page).get_by_role("button", name="Wind and risk").click()
    form = page.get_by_role("form", name="Preflight of the plan")
    form.get_by_role("textbox", name="Risk that is accepted").fill("10")
    form.get_by_text("29 simulated flights to count").wait_for()
    form.get_by_role("button", name="Start").click()
    block(page).get_by_text(re.compile(r"10 % is accepted\. 29 flights, no wind\.")).wait_for()
    lines = page.locator(".simulated-flights polyline")
    wait(lambda: lines.count() >= 23, "the flights on the map from above")
    assert [line.visible for line in station.view._flights._lines] == [True, True]
    page.get_by_role("checkbox", name="23 simulated flights").uncheck()
    wait(lambda: lines.count() == 0, "the layer's end")
    wait(lambda: not any(line.visible for line in station.view._flights._lines), "the end of that in 3D")
    page.get_by_role("checkbox", name="23 simulated flights").check()
    edit(page)
    block(page).get_by_text("Flown for another plan: go.").wait_for()
    assert lines.count() == 0
    page.keyboard.press("Control+z")
    block(page).get_by_text(re.compile("29 flights")).wait_for()


def test_a_preflight_that_is_cancelled_leaves_the_plan_as_not_flown(station, page):
    block(page).get_by_role("button", name="Wind and risk").click()
    form = page.get_by_role("form", name="Preflight of the plan")
    form.get_by_role("textbox", name="Flights").fill("900000")
    form.get_by_role("button", name="Start").click()
    block(page).get_by_role("button", name="Cancel").click()
    wait(lambda: station.desk.jobs.is_idle, "the job's end")
    block(page).get_by_role("button", name="Fly it in simulation").wait_for()
    assert station.desk.preflight.state == "none"


def test_the_list_before_a_flight_warns_where_none_was_flown_and_forbids_a_no_go(station, page):
    page.keyboard.press("3")
    line = page.get_by_role("listitem").filter(has_text="Preflight")
    line.get_by_text("Not flown yet.").wait_for()
    line.get_by_role("button", name="Fly it in simulation").wait_for()
    station.desk.control.take(next(iter(station.hub.people)), force=True)
    arm = page.get_by_role("button", name="Hold to arm only")
    wait(arm.is_enabled, "an order that may be given")
    tell(station, "no_go")
    line.get_by_text("No-go.").wait_for()
    line.get_by_text("Wait for less wind.").wait_for()
    page.get_by_text("not fit to arm").wait_for()
    assert arm.is_disabled()
    tell(station, "go")
    page.get_by_text("all pass", exact=True).wait_for()
    wait(arm.is_enabled, "an order that may be given again")


def without_plan(asked: preflight.Arguments) -> dict[str, object]:
    return {name: value for name, value in msgspec.structs.asdict(asked).items() if name != "plan"}


def edit(page) -> None:
    """Move the first waypoint."""
    page.get_by_role("gridcell").nth(2).dblclick()
    page.keyboard.press("Control+A")
    page.keyboard.type("1.1")
    page.keyboard.press("Enter")


def test_a_no_go_of_the_plan_before_an_edit_is_still_said(station, page):
    tell(station, "no_go")
    block(page).get_by_text("Risk as told.").wait_for()
    edit(page)
    block(page).get_by_text("Flown for another plan: no-go.").wait_for()
    block(page).get_by_text("No-go, stale").wait_for()
    ended = Preflight("current", verdict="go", sentence="Risk as told.")  # of the plan before, meanwhile
    assert preflight.KIND.done(station.desk, ended) == "of an earlier plan or map: go. Risk as told."
    page.keyboard.press("3")
    line = page.get_by_role("listitem").filter(has_text="Preflight")
    line.get_by_text("Flown for another plan: no-go.").wait_for()
    assert "danger-text" in (line.get_attribute("class") or "")


def test_it_is_flown_again_as_it_was_asked_for_and_what_it_assumed_is_told(station, page):
    tell(station, "go")
    block(page).get_by_text("Assumed, or not counted").click()
    block(page).get_by_text("A thing is assumed.").wait_for()
    block(page).get_by_role("button", name="Fly it again").click()
    block(page).get_by_text(re.compile(r"10 % is accepted\. 29 flights, wind 2 m/s\.")).wait_for()
    assert station.desk.preflight.asked == without_plan(preflight.Arguments()) | ASKED
    tell(station, "not_shown")
    block(page).get_by_role("button", name="Fly more").click()  # the same flights again would show nothing more
    form = page.get_by_role("form", name="Preflight of the plan")
    assert form.get_by_role("textbox", name="Risk that is accepted").input_value() == "10"


def test_without_a_checked_plan_the_list_says_so(station, page):
    below = np.array([[0.8, 0.8, 1.0], [3.0, 2.0, -5.0]])
    station.desk.session.take(Waypoints(below, np.full(2, np.nan)), "below", "test")
    page.keyboard.press("3")
    page.get_by_role("listitem").filter(has_text="There is no checked plan to fly in simulation.").wait_for()


@pytest.mark.parametrize("width", [1280, 360])
def test_nothing_of_a_preflight_is_a_serious_barrier(station, page, width):
    from axe_playwright_python.sync_playwright import Axe

    page.set_viewport_size({"width": width, "height": 844})
    for verdict in ("no_go", "not_shown", "go"):
        tell(station, verdict)
        for step in "23":
            page.keyboard.press(step)
            drawn(page)
            results = Axe().run(page, context={"exclude": [["iframe"]]}).response["violations"]
            assert [rule["id"] for rule in results if rule["impact"] in SERIOUS] == []
