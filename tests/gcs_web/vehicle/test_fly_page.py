"""Fly on the page, in Chromium: the list before a flight, and the bar during one."""

import re

import numpy as np
import pytest

from firmware_bridge.dialect.generated.messages import Command
from flight import Waypoints
from tests.gcs_web.in_browser import drawn, needs_chromium
from tests.waiting import until

pytestmark = needs_chromium


@pytest.fixture
def armed(station, page):
    station.watch.order(Command.ARM)
    page.get_by_role("region", name="Flight", exact=True).wait_for()
    yield page
    if station.watch.state().mission != "disarmed":
        station.watch.order(Command.DISARM)
    page.get_by_role("region", name="Flight", exact=True).wait_for(state="detached")


@pytest.mark.parametrize("size", [(360, 740), (768, 1024), (1440, 900)])
def test_pause_land_kill_and_abort_are_in_reach_in_every_step_while_armed(armed, size):
    width, height = size
    armed.set_viewport_size({"width": width, "height": height})
    orders = [
        armed.get_by_role("button", name=re.compile(name)) for name in ("^Pause", "^Land", "^Hold to kill", "^Abort")
    ]
    for step in "12345":
        armed.keyboard.press(step)
        drawn(armed)
        for order in orders:
            box = order.bounding_box()
            assert box["height"] >= 44 or (width >= 720 and box["height"] >= 24)  # a thumb, a pointer
            assert box["x"] >= 0
            assert box["y"] >= 0
            assert box["x"] + box["width"] <= width
            assert box["y"] + box["height"] <= height
            centre = [box["x"] + box["width"] / 2, box["y"] + box["height"] / 2]
            hit = armed.evaluate("([x, y]) => document.elementFromPoint(x, y)?.closest('button')?.textContent", centre)
            assert hit == order.text_content()  # nothing covers it


def test_a_kill_is_held_for_a_second_and_needs_no_control(armed, station):
    kill = armed.get_by_role("button", name=re.compile("^Hold to kill"))
    kill.click()  # let go at once: nothing is sent
    drawn(armed)
    assert station.watch.state().armed
    kill.hover()
    armed.mouse.down()
    until(lambda: station.watch.state().mission in ("fault", "disarmed"), "the kill")
    armed.mouse.up()


def test_a_failed_check_is_shown_with_its_remedy_and_keeps_the_vehicle_from_being_armed(page, station):
    page.keyboard.press("3")
    page.get_by_text("all pass").wait_for()
    station.desk.control.take(next(iter(station.hub.people)), force=True)
    arm = page.get_by_role("button", name="Hold to arm only")
    until(arm.is_enabled, "an order that may be given")
    far = np.array([[3.0, 3.6, 1.0], [5.2, 0.8, 1.2]])
    station.desk.session.take(Waypoints(far, np.full(2, np.nan)), "elsewhere", "test")
    page.get_by_text("not fit to arm").wait_for()
    page.get_by_text(re.compile("Put the vehicle at x 3.00, y 3.60 m")).wait_for()
    assert arm.is_disabled()


def test_a_plan_that_begins_elsewhere_is_begun_where_the_vehicle_stands_by_one_press(page, station):
    page.keyboard.press("3")
    far = np.array([[3.0, 0.8, 1.0], [5.2, 0.8, 1.2]])
    station.desk.session.take(Waypoints(far, np.full(2, np.nan)), "elsewhere", "test")
    page.get_by_role("button", name="Begin the plan here").dblclick()
    page.get_by_text("all pass").wait_for()
    places = station.desk.session.content.waypoints().positions_world_m
    np.testing.assert_allclose(places[0], [*station.watch.link.state.position_world_m[:2], 1.0], atol=0.02)
    np.testing.assert_allclose(places[1:], far)


def test_control_is_taken_and_an_upload_begun_by_a_key(page, station):
    page.keyboard.press("3")
    page.get_by_role("button", name="Take control").wait_for()
    page.keyboard.press("c")
    page.get_by_text("Your orders go to the vehicle.").wait_for()
    page.keyboard.press("u")
    page.get_by_role("button", name=re.compile("^Hold to upload")).wait_for()
