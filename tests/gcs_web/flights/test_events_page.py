"""What happened during a flight stands on its time line with the words of the checks; one click mends one event."""

import re
from pathlib import Path

import numpy as np
import pytest

import sysid
import vehicle
from flight import FlightLog, flight_log, project, rotations
from flight.flight_log import COLUMNS
from gcs_web import GroundStation
from goshawk.station_jobs import KINDS
from sysid.logs.events.event import SPLITS
from sysid.logs.fix import FIXES
from tests.gcs_web.in_browser import CHROMIUM, FLAGS, without_view
from tests.waiting import PATIENCE_S
from tests.waiting import until as wait
from vehicle import flights, manoeuvres

pytestmark = pytest.mark.skipif(CHROMIUM is None, reason="needs Chromium: apt-get install chromium")


def faulty() -> FlightLog:
    """A weave whose heading jumps by 30 deg, and whose position drops out for three rows after that."""
    truth, bob = vehicle.example(), [(1.25, 1.0), (1.25, -1.0)] * 2
    weave = manoeuvres.from_legs(x=[(2.5, 9.0), (2.5, -9.0)], y=[(1.0, 0.0), (2.0, 4.0), (2.0, -4.0)], z=bob)
    log = flights.measure(flights.fly_trajectory(truth, weave), rng=np.random.default_rng(5))
    q, position = log.vector("q_world_body").copy(), log.vector("position_world_m").copy()
    first, second = len(log) // 3, 2 * len(log) // 3
    q[first:] = rotations.multiply(rotations.exp(np.array([0.0, 0.0, np.deg2rad(30.0)])), q[first:])
    position[second : second + 3] += 0.6
    changed = [("q_world_body", q), ("position_world_m", position)]
    columns = {name: values for what, v in changed for name, values in zip(COLUMNS[what], v.T, strict=True)}
    return FlightLog({**log.columns, **columns}, log.metadata)


def test_a_click_on_an_event_shows_its_words_and_another_mends_it_alone(tmp_path: Path) -> None:
    from playwright.sync_api import sync_playwright

    opened = project.create(tmp_path / "project", "events")
    believed = vehicle.example()
    vehicle.save(opened.vehicle, believed)
    opened.flight("a").parent.mkdir(parents=True, exist_ok=True)
    flight_log.save(opened.flight("a"), faulty())
    found = sysid.check_log(flight_log.load(opened.flight("a")), believed).findings
    (jump,) = (f for f in found if f.what == "attitude jump")
    assert any(f.what == "position excursion" for f in found)
    with sync_playwright() as playwright, GroundStation(opened.folder, jobs=KINDS) as station:
        browser = playwright.chromium.launch(executable_path=CHROMIUM, args=FLAGS, timeout=1000 * PATIENCE_S)
        context = without_view(browser.new_context(viewport={"width": 1440, "height": 900}, reduced_motion="reduce"))
        context.set_default_timeout(1000 * PATIENCE_S)
        page = context.new_page()
        errors: list[str] = []
        page.on("pageerror", lambda error: errors.append(str(error)))
        page.goto(station.url)
        page.get_by_text("Saved, revision").wait_for()
        page.keyboard.press("4")
        page.get_by_role("button", name=re.compile("^a"), pressed=True).wait_for()
        strip = page.get_by_role("group", name="Findings of the checks")
        strip.get_by_role("button", name=re.compile("^" + re.escape(jump.sentence))).click()
        words = page.locator(".mark-words")
        words.get_by_text(jump.sentence).wait_for()
        words.get_by_role("button", name="Apply this to a new log").click()
        page.get_by_label("What a-fixed is for").wait_for()
        wait(lambda: station.desk.flights.names("leave") == ["a"], "the log that was mended to be left out")
        browser.close()
    assert errors == []
    mended = flight_log.load(opened.flight("a-fixed"))
    assert len(mended.metadata[SPLITS]) == len(mended.metadata[FIXES]) == 1
    assert jump.sentence in mended.metadata[FIXES][0]
    left = sysid.check_log(mended, believed).findings
    assert [f.what for f in left if f.event is not None] == ["position excursion"]
