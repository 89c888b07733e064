"""The page is whole, and no serious barrier, in wide and narrow windows."""

import re

import pytest

from tests.gcs_web.in_browser import SERIOUS, drawn, needs_chromium, opened

pytestmark = needs_chromium


@pytest.fixture(scope="module")
def whole(station, browser):
    """One page for all tests: they change its width and what it shows, and no waypoint."""
    with opened(station, browser, with_view=False) as page:
        page.get_by_text("Checked", exact=True).wait_for()
        yield page


@pytest.fixture
def page(whole):
    whole.keyboard.press("2")
    whole.get_by_role("grid", name="Waypoints").wait_for()
    return whole


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


CUT_OFF = """() => [...document.querySelectorAll("button, select, input, summary")]
    .filter((e) => e.checkVisibility() && e.getBoundingClientRect().width > 1)
    .filter((e) => {
      let [low, high] = [0, innerWidth];
      for (let above = e.parentElement; above !== null; above = above.parentElement) {
        if (getComputedStyle(above).overflowX === "visible") continue;
        const { left, right } = above.getBoundingClientRect();
        [low, high] = [Math.max(low, left), Math.min(high, right)];
      }
      const { left, right } = e.getBoundingClientRect();
      return left < low - 1 || right > high + 1;
    })
    .map((e) => e.ariaLabel || e.textContent)"""
"""Controls of which a part lies beyond the window, or beyond the part of an area that is shown without scrolling."""


@pytest.mark.parametrize("width", [1440, 900, 800, 360])
def test_no_control_is_cut_off_in_any_step(page, width):
    page.set_viewport_size({"width": width, "height": 800})
    for number in "12345":
        page.keyboard.press(number)
        drawn(page)
        assert page.evaluate(CUT_OFF) == [], f"step {number}"


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
