"""The step Fly shows the flight: a cursor that runs with it, flown over planned, what a lost link brings."""

import re
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

import vehicle
from flight import Waypoints, project
from gcs_web import GroundStation
from gcs_web.protocol.flights import FlightCard, Flights
from gcs_web.protocol.vehicle import LostLinkAct, Vehicle
from tests.gcs_web.in_browser import drawn, needs_chromium, visited
from tests.gcs_web.two_pillars import START, add_map
from tests.waiting import until as wait

pytestmark = needs_chromium
ACTS = [LostLinkAct(2.0, "stops and hovers"), LostLinkAct(22.0, "lands")]


@pytest.fixture(scope="module")
def station(pillar_map: Path, tmp_path_factory) -> Iterator[GroundStation]:
    """With a plan, and no vehicle: the tests tell the page of one."""
    opened = project.create(tmp_path_factory.mktemp("flight") / "hall", "hall")
    add_map(opened, pillar_map)
    vehicle.save(opened.vehicle, vehicle.example("rigter2019"))
    project.save_waypoints(opened.waypoints, Waypoints(START, np.full(len(START), np.nan)))
    with GroundStation(opened.folder, triangles=500) as running:
        yield running


@pytest.fixture
def page(station, one_tab):
    with visited(station, one_tab) as opened:
        opened.get_by_text("Checked", exact=True).wait_for()
        opened.keyboard.press("3")
        yield opened


def tell(
    station: GroundStation, along_s: float | None, *, link="fresh", age_s: float = 0.0, armed: bool = True
) -> None:
    station.hub.publish(
        Vehicle(
            link, "sitl", age_s, "trajectory" if armed else "disarmed", armed, x_m=0.8, y_m=0.8, z_m=1.0,
            speed_m_s=1.5, error_m=0.01, along_s=along_s, duration_s=5.0, if_link_lost=ACTS if armed else [],
        )
    )  # fmt: skip


def test_the_cursor_and_the_flown_curve_run_with_the_vehicle(station, page):
    for along_s in (0.5, 1.0, 1.5):
        tell(station, along_s)
        page.get_by_role("region", name="Timeline").get_by_text(f"{along_s:.2f} s", exact=True).wait_for()
    page.get_by_role("region", name="Timeline").get_by_text("flown 1.50").first.wait_for()
    page.get_by_role("region", name="Flight").get_by_text(re.compile(r"1\.5 / 5\.0")).wait_for()
    page.get_by_text("If the link is lost").wait_for()
    page.keyboard.press("2")
    tell(station, 2.0)
    page.get_by_role("region", name="Flight").get_by_text(re.compile(r"2\.0 / 5\.0")).wait_for()
    assert page.get_by_role("region", name="Timeline").get_by_text("1.50 s", exact=True).count() == 1  # planned there


def test_a_lost_link_says_what_the_vehicle_does_now_and_when_what_is_next(station, page):
    tell(station, 1.0)
    tell(station, 1.0, link="lost", age_s=5.0)
    alert = page.get_by_role("region", name="Flight").get_by_role("alert")
    alert.get_by_text(re.compile(r"Link lost: it stops and hovers; lands in about 1\d s")).wait_for()
    for width, height in ((1440, 900), (768, 1024), (360, 740)):
        page.set_viewport_size({"width": width, "height": height})
        for step in "12345":
            page.keyboard.press(step)
            drawn(page)
            for each in (alert, page.get_by_role("button", name=re.compile("kill"))):
                place = each.bounding_box()
                assert place["x"] >= 0.0
                assert place["x"] + place["width"] <= width
                assert place["y"] + place["height"] <= height


def test_a_flight_that_landed_stands_beside_the_last_one_of_its_course_and_opens_with_it(station, page):
    tell(station, None, armed=False)
    cards = [
        FlightCard(name, "ready", trajectory=course, tracking_mean_m=error_m, duration_s=5.0)
        for name, course, error_m in (("lap-2", "lap", 0.006), ("other", "hop", 0.02), ("lap-1", "lap", 0.081))
    ]
    station.hub.publish(Flights(cards))
    last = page.get_by_role("region", name="The last flight")
    last.get_by_text("6 mm").wait_for()
    assert last.get_by_text("81 mm").is_visible()
    last.get_by_role("button", name="Compare with the one before").click()
    wait(lambda: "step=4&flights=lap-2%7Clap-1" in page.evaluate("() => location.hash"), "both flights in Compare")
