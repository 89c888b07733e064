"""What a pilot must notice without looking is said, sounded and felt; silence is a choice that lasts."""

import json
import re
from collections.abc import Iterator

import pytest

from gcs_web import GroundStation
from gcs_web.protocol.people import Person
from gcs_web.protocol.vehicle import LostLinkAct, Vehicle
from tests.gcs_web.in_browser import drawn, needs_chromium, visited
from tests.gcs_web.telling import empty_station, telling
from tests.waiting import until as wait

pytestmark = needs_chromium
ACTS = [LostLinkAct(2.0, "stops and hovers"), LostLinkAct(22.0, "lands")]
HEARD = """window.tones = 0; window.shakes = 0;
const start = OscillatorNode.prototype.start;
OscillatorNode.prototype.start = function (...when) { window.tones += 1; return start.apply(this, when); };
Navigator.prototype.vibrate = () => { window.shakes += 1; return true; };
setInterval(() => console.debug(JSON.stringify(
  [window.tones, window.shakes, document.querySelector(".flight-bar")?.innerText ?? ""])), 200);"""
"""It tells what it heard without being asked: asking counts as a touch of the page, which lets it sound."""


@pytest.fixture(scope="module")
def station(tmp_path_factory) -> Iterator[GroundStation]:
    with empty_station(tmp_path_factory.mktemp("alarm")) as running:
        yield running


@pytest.fixture(scope="module")
def listening_tab(one_tab):
    one_tab.page.context.add_init_script(HEARD)
    return one_tab


@pytest.fixture
def page(station, listening_tab):
    station.hub.publish(Vehicle("none"))  # not the one of the test before
    with visited(station, listening_tab) as opened:
        wait(lambda: station.hub.people, "the page")
        opened.keyboard.press("3")
        yield opened


def of(link="fresh", *, armed: bool = True, mission="trajectory", **more) -> Vehicle:
    return Vehicle(link, "sitl", mission=mission, armed=armed, if_link_lost=ACTS if armed else [], **more)


def tones(page) -> int:
    drawn(page)
    return page.evaluate("window.tones")


def test_a_good_flight_is_silent_and_an_error_beyond_its_room_is_not(page, station):
    bar = page.get_by_role("region", name="Flight", exact=True)
    with telling(station, of(error_m=0.1, room_m=0.16, along_s=1.0)):
        bar.get_by_text("100 / 160").wait_for()
        assert tones(page) == 0
    with telling(station, of(error_m=0.2, room_m=0.16, along_s=1.1)):
        bar.get_by_role("alert").get_by_text("Off the path by 200 mm: room is 160 mm.").wait_for()
        wait(lambda: tones(page) >= 6, "the alarm, again and again")
        assert page.evaluate("window.shakes") >= 2
    with telling(station, of(error_m=0.1, room_m=0.16, along_s=1.2)):
        bar.get_by_role("alert").wait_for(state="detached")


def test_a_silent_link_counts_down_to_what_the_vehicle_does_then(page, station):
    bar = page.get_by_role("region", name="Flight", exact=True)
    counts = re.compile(r"heard for \d\.\d s: in \d\.\d s it stops and hovers")
    with telling(station, of("stale", age_s=0.8)):
        bar.get_by_role("status").get_by_text(counts).wait_for()
        wait(lambda: tones(page) > 0, "a tone")
    with telling(station, of("lost", age_s=2.5)):
        acts = re.compile(r"Link lost: it stops and hovers; lands in about \d+ s")
        bar.get_by_role("alert").get_by_text(acts).wait_for()


def test_a_page_that_hears_no_station_does_not_say_what_the_vehicle_does(page, station):
    """The station may hear it well, and nothing of that happens."""
    station.hub.publish(of())
    bar = page.get_by_role("region", name="Flight", exact=True)
    bar.get_by_role("alert").get_by_text(
        "This page lost the station: what the vehicle does is not known here."
    ).wait_for()
    assert "stops and hovers" not in bar.inner_text()
    assert "Station lost" in bar.inner_text()


def test_a_page_that_nobody_touched_says_that_its_sound_is_blocked_and_queues_none(station, listening_tab):
    said: list[str] = []
    listening_tab.page.on("console", lambda message: said.append(message.text))
    station.hub.publish(Vehicle("none"))
    with visited(station, listening_tab) as page, telling(station, of(error_m=0.2, room_m=0.16)):

        def heard() -> tuple[int, int, str]:
            page.wait_for_timeout(100)
            return json.loads(said[-1]) if said and said[-1].startswith("[") else (0, 0, "")

        wait(lambda: heard()[1] >= 3, "three alarms")
        assert heard()[0] == 0
        assert "Sound is blocked: click" in heard()[2]
        page.mouse.click(5, 5)
        wait(lambda: heard()[0] >= 6 and "blocked" not in heard()[2], "the alarm")


def test_a_key_takes_control_from_nobody_only(page, station):
    bo = Person("bo", "Bo")
    station.desk.control.take(bo, force=False)
    with telling(station, of()):
        page.keyboard.press("3")
        mute = page.get_by_role("button", name="Mute alarms")
        mute.wait_for()
        page.keyboard.press("c")
        page.keyboard.press("n")
        page.get_by_role("button", name="Mute alarms", pressed=True).wait_for()
        page.keyboard.press("n")
        page.wait_for_timeout(500)
        assert station.desk.control.holder == "bo"
        station.desk.control.give_up(bo)
        page.get_by_role("button", name="Take control", exact=True).wait_for()
        page.keyboard.press("Alt+c")
        page.wait_for_timeout(500)
        assert station.desk.control.holder == ""
        page.keyboard.press("c")
        wait(lambda: station.desk.control.holder not in ("", "bo"), "control")


def test_a_key_that_is_held_mutes_once(page, station):
    with telling(station, of()):
        page.get_by_role("button", name="Mute alarms", pressed=False).wait_for()
        for _ in range(4):
            page.keyboard.down("n")  # without a release: the browser's repeats
        page.get_by_role("button", name="Mute alarms", pressed=True).wait_for()
        drawn(page)
        assert page.get_by_role("button", name="Mute alarms", pressed=True).is_visible()
        page.keyboard.up("n")
        page.keyboard.press("n")
        page.get_by_role("button", name="Mute alarms", pressed=False).wait_for()


def test_alarms_are_muted_by_a_key_and_still_said_and_it_is_remembered(page, station):
    mute = page.get_by_role("button", name="Mute alarms")
    with telling(station, of("lost", age_s=3.0)):
        mute.wait_for()
        page.keyboard.press("n")
        page.get_by_role("button", name="Mute alarms", pressed=True).wait_for()
        page.reload()
        page.get_by_role("alert").get_by_text("Link lost").wait_for()
    page.get_by_role("button", name="Mute alarms", pressed=True).wait_for()
    assert tones(page) == 0
    page.get_by_role("button", name="Mute alarms").click()
    wait(lambda: tones(page) > 0, "the alarm")


def test_a_battery_says_how_long_it_lasts_and_warns_when_that_is_little(page, station):
    bar = page.get_by_role("region", name="Flight", exact=True)
    with telling(station, of(battery_v=15.1, battery_left_s=240.0)):
        bar.get_by_text("4 min left").wait_for()
        assert tones(page) == 0
    with telling(station, of(battery_v=14.1, battery_left_s=40.0)):
        bar.get_by_role("status").get_by_text("Battery: 40 s left. Land.").wait_for()
        wait(lambda: tones(page) == 1, "one tone")


def test_the_worst_is_said_and_nothing_is_on_the_ground(page, station):
    bar = page.get_by_role("region", name="Flight", exact=True)
    with telling(station, of("lost", mission="fault", age_s=3.0, reason="a rotor is stuck")):
        bar.get_by_role("alert").get_by_text("Fault: a rotor is stuck.").wait_for()
    with telling(station, of("lost", armed=False, mission="disarmed", age_s=3.0)):
        bar.wait_for(state="detached")
        heard = tones(page)
        page.wait_for_timeout(1800)
        assert tones(page) == heard
