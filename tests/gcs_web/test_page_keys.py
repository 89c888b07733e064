"""Keys of the page in a real browser: they work wherever the last click was, and inserting goes on from the new one."""

import re

import pytest

from tests.gcs_web.in_browser import needs_chromium, positions
from tests.waiting import until as wait

pytestmark = needs_chromium


def a_tab(page) -> None:
    page.get_by_role("tab", name="Segments").click()


def a_box(page) -> None:
    page.get_by_role("tab", name="Mission").click()
    box = page.get_by_role("checkbox", name="Closed loop")
    box.focus()


def a_button(page) -> None:
    page.get_by_role("button", name=re.compile("^Colours: ")).click()


@pytest.mark.parametrize("clicked", [a_tab, a_box, a_button])
def test_a_step_is_chosen_by_its_key_after_a_click_elsewhere(page, clicked):
    clicked(page)
    page.keyboard.press("3")
    page.locator(".steps button[aria-current=step]").get_by_text("Fly").wait_for()


@pytest.mark.parametrize("key", ["Space", "k"])
def test_the_plan_plays_and_pauses_by_a_key(page, key):
    drawer = page.get_by_role("region", name="Timeline")
    page.keyboard.press(key)
    drawer.get_by_role("button", name="Pause", exact=True).wait_for()
    page.keyboard.press(key)
    drawer.get_by_role("button", name="Play", exact=True).wait_for()


def test_the_space_bar_presses_the_button_that_has_the_focus(page):
    page.get_by_role("tab", name="Segments").focus()
    colours = page.get_by_role("button", name=re.compile("^Colours: "))
    before = colours.inner_text()
    colours.focus()
    page.keyboard.press("Space")
    wait(lambda: colours.inner_text() != before, "the other colours")
    assert page.get_by_role("button", name="Play", exact=True).first.is_visible()


def test_inserting_again_goes_on_from_the_new_waypoint(station, page):
    page.locator("tr[data-waypoint] th").first.click()
    before = positions(station)
    page.get_by_role("button", name="Insert after").click()
    page.get_by_role("button", name="Insert after").click()
    wait(lambda: len(positions(station)) == len(before) + 2, "the new waypoints")
    towards = before[1] - before[0]
    assert [round(float((p - before[0]) @ towards / (towards @ towards)), 2) for p in positions(station)[:4]] == [
        0,
        0.5,
        0.75,
        1,
    ]
