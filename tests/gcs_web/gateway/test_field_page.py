"""A day in the field: another device by a code, a page that is kept for a silent station, a screen that stays on."""

import json
import re
from collections.abc import Iterator

import numpy as np
import pytest

from gcs_web import GroundStation
from gcs_web.protocol.people import Invitation, People, Person
from gcs_web.protocol.vehicle import Vehicle
from tests.gcs_web.in_browser import SERIOUS, drawn, needs_chromium, visited
from tests.gcs_web.telling import empty_station, telling
from tests.waiting import PATIENCE_S
from tests.waiting import until as wait

pytestmark = needs_chromium
ARMED = Vehicle("fresh", "sitl", mission="hold", armed=True)
DISARMED = Vehicle("fresh", "sitl", mission="disarmed", armed=False)
KEPT = ("app.js", "app.css", "icon.svg")
LOCKS = """window.locks = [];
Object.defineProperty(Navigator.prototype, "wakeLock", { get: () => ({ request: async (kind) => {
  const lock = { kind, released: false, release: async () => { lock.released = true; } };
  window.locks.push(lock);
  return lock;
}})});"""


@pytest.fixture(scope="module")
def station(tmp_path_factory) -> Iterator[GroundStation]:
    with empty_station(tmp_path_factory.mktemp("field")) as running:
        yield running


@pytest.fixture(scope="module")
def tab_with_locks(one_tab):
    one_tab.page.context.add_init_script(LOCKS)
    return one_tab


@pytest.fixture
def page(station, tab_with_locks):
    station.hub.publish(Vehicle("none"))
    with visited(station, tab_with_locks) as opened:
        wait(lambda: station.hub.people, "the page")
        yield opened


def held(page) -> int:
    drawn(page)
    return page.evaluate("window.locks.filter(({ kind, released }) => kind === 'screen' && !released).length")


def look(page, state: str) -> None:
    """As if the tab came behind another one, or back."""
    page.evaluate(
        """state => {
          Object.defineProperty(document, "visibilityState", { value: state, configurable: true });
          document.dispatchEvent(new Event("visibilitychange"));
        }""",
        state,
    )


def test_the_screen_stays_on_while_armed_and_only_then(page, station):
    assert held(page) == 0
    with telling(station, ARMED):
        wait(lambda: held(page) == 1, "the lock")
        look(page, "hidden")
        wait(lambda: held(page) == 0, "its release while nobody looks")
        look(page, "visible")
        wait(lambda: held(page) == 1, "the lock again")
    with telling(station, DISARMED):
        wait(lambda: held(page) == 0, "its release")


@pytest.mark.parametrize("size", [(360, 740), (768, 1024), (1440, 900)])
def test_each_pilot_sees_in_flight_whose_orders_count(page, station, size):
    page.set_viewport_size({"width": size[0], "height": size[1]})
    bar = page.get_by_role("region", name="Flight", exact=True)
    bo = Person("bo", "Bo")
    with telling(station, ARMED):
        bar.get_by_text("Nobody is in control").wait_for()
        station.hub.publish(People([*station.hub.people, bo], bo.id))
        bar.get_by_text("Bo is in control").wait_for()
        station.hub.publish(People(station.hub.people, ""))
        bar.get_by_text("Nobody is in control").wait_for()
        page.keyboard.press("c")
        words = bar.get_by_text("You are in control")
        words.wait_for()
        kill = page.get_by_role("button", name=re.compile("kill")).bounding_box()
        assert kill["y"] + kill["height"] <= size[1]
        place = words.bounding_box()
        assert place["x"] >= 0
        assert place["x"] + place["width"] <= size[0]
    station.desk.control.give_up(*station.hub.people)
    station.hub.publish(Vehicle("none"))


def test_a_code_lets_one_more_device_in_and_is_another_one_then(page, station, browser):
    cv2 = pytest.importorskip("cv2")
    only_here = station.desk.invitation

    def elsewhere() -> tuple[Invitation, bool]:
        found, is_new = only_here()
        return Invitation(found.address, found.code, False, found.good_s), is_new

    station.desk.invitation = elsewhere
    try:
        page.keyboard.press("q")
        dialog = page.get_by_role("dialog", name="People and devices")
        code = dialog.get_by_role("img", name="QR code of the address")
        code.wait_for()

        def address() -> str:
            seen = cv2.imdecode(np.frombuffer(code.screenshot(), np.uint8), cv2.IMREAD_GRAYSCALE)
            return cv2.QRCodeDetector().detectAndDecode(seen)[0]

        first = address()
        assert first != station.url
        page.get_by_text("shows a code that lets a device in").first.wait_for()
        context = browser.new_context(service_workers="block")
        phone = context.new_page()
        phone.set_default_timeout(1000 * PATIENCE_S)
        assert phone.goto(first).status == 200
        wait(lambda: address() not in ("", first), "another code")
        context.close()
        last = address()
        page.keyboard.press("Escape")
        dialog.wait_for(state="detached")
        wait(lambda: page.request.get(last).status == 403, "its end")
        assert '"invite"' in (station.desk.project.folder / ".session" / "audit.jsonl").read_text()
    finally:
        station.desk.invitation = only_here


def test_pause_and_land_are_on_their_keys_while_a_dialog_is_open_and_it_ends_above_them(page, station):
    page.set_viewport_size({"width": 360, "height": 740})
    sent = """() => {
  window.sent = [];
  const send = WebSocket.prototype.send;
  WebSocket.prototype.send = function (text) { window.sent.push(String(text)); return send.call(this, text); };
}"""
    page.evaluate(sent)
    bar = page.get_by_role("region", name="Flight", exact=True)
    with telling(station, ARMED):
        bar.wait_for()
        page.keyboard.press("c")
        bar.get_by_text("You are in control").wait_for()
        page.keyboard.press("q")
        dialog = page.get_by_role("dialog", name="People and devices")
        dialog.get_by_role("button", name="Copy the address").wait_for()
        for count, key in enumerate("pl", start=1):
            page.keyboard.press(key)
            orders = "window.sent.filter((text) => text.includes('prepare_order')).length"
            wait(lambda count=count, orders=orders: page.evaluate(orders) == count, f"the order of {key}")
        place = dialog.bounding_box()
        assert place["y"] + place["height"] <= bar.bounding_box()["y"]
        page.keyboard.press("Escape")
        dialog.wait_for(state="detached")
    station.desk.control.give_up(*station.hub.people)
    station.hub.publish(Vehicle("none"))


@pytest.mark.parametrize("size", [(360, 740), (1440, 900)])
def test_a_station_of_its_own_machine_says_so_in_place_of_a_code(page, size):
    from axe_playwright_python.sync_playwright import Axe

    page.set_viewport_size({"width": size[0], "height": size[1]})
    page.get_by_title("Projects").click()
    page.get_by_role("button", name="People and devices").click()
    dialog = page.get_by_role("dialog", name="People and devices")
    said = dialog.get_by_text("answers on its own machine only")
    said.wait_for()
    assert len(said.inner_text().split()) <= 25
    assert dialog.get_by_role("img").count() == 0
    place = dialog.bounding_box()
    assert place["x"] >= 0
    assert place["x"] + place["width"] <= size[0]
    found = [rule["id"] for rule in Axe().run(page).response["violations"] if rule["impact"] in SERIOUS]
    assert found == []


def test_the_page_is_kept_for_a_silent_station_and_no_token_and_no_refusal_is(station, browser):
    context = browser.new_context(reduced_motion="reduce")
    context.set_default_timeout(1000 * PATIENCE_S)
    page = context.new_page()
    token = station.url
    page.goto(token)
    page.evaluate("() => navigator.serviceWorker.ready.then(() => 0)")
    kept = "caches.open('page').then(page => page.keys()).then(keys => keys.map(({ url }) => url))"
    wait(lambda: len(page.evaluate(kept)) == 4, "the kept files")
    origin = token.split("/?")[0]
    assert {url.removeprefix(origin) for url in page.evaluate(kept)} == {"/", *(f"/static/{name}" for name in KEPT)}
    text = "caches.match('/').then(found => found.text())"
    assert "token" not in page.evaluate(text)
    context.set_offline(True)
    page.goto(station.url.split("?")[0])
    page.get_by_text("Connecting to the ground station").or_(page.get_by_text("Not connected")).first.wait_for()
    assert page.evaluate("fetch('/state').then(() => 'answered', () => 'no')") == "no"
    context.set_offline(False)
    page.reload()
    page.get_by_text("1 person here").or_(page.get_by_text("people here")).first.wait_for()
    context.clear_cookies()
    assert page.goto(station.url.split("?")[0]).status == 403  # not the kept page: this browser is not let in any more
    context.close()


def test_a_browser_may_install_the_page(station, browser):
    context = browser.new_context()
    context.set_default_timeout(1000 * PATIENCE_S)
    page = context.new_page()
    page.goto(station.url)
    page.evaluate("() => navigator.serviceWorker.ready.then(() => 0)")
    asked = context.new_cdp_session(page)
    manifest = asked.send("Page.getAppManifest")
    assert manifest["errors"] == []
    assert json.loads(manifest["data"])["start_url"] == "/"
    errors = {each["errorId"] for each in asked.send("Page.getInstallabilityErrors")["installabilityErrors"]}
    assert errors <= {"in-incognito"}  # every context of a test is one
    context.close()
