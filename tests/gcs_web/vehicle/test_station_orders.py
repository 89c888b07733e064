"""Orders from the page to a SITL vehicle that really flies: who may give them, and how they end.

The last flight is killed in the air: the vehicle lies as it fell.
"""

import json
import threading
from dataclasses import replace

import msgspec
import numpy as np
import pytest

from firmware_bridge import arming
from firmware_bridge.dialect.generated.messages import MissionState
from flight import LinkError, Waypoints, flight_log
from gcs_web.gateway import page_socket
from gcs_web.planning import preflown
from gcs_web.protocol.plan import Preflight
from tests.gcs_web.station_socket import Page, visit
from tests.waiting import PATIENCE_S, until

pytestmark = pytest.mark.usefixtures("same_waypoints")


def test_orders_need_control_and_a_nonce_that_is_good_once(station):
    async def talk(anna: Page, ben: Page):
        await anna.checked()
        assert "nobody is in control" in (await anna.command("prepare_upload"))["error"]
        assert not (await anna.command("take_control"))["error"]
        assert "is in control" in (await ben.command("take_control"))["error"]
        assert "is in control; take control first" in (await ben.command("prepare_upload"))["error"]
        prepared = await anna.command("prepare_upload")
        assert prepared["here"]["crc32"] == anna.state["plan"]["crc32"]
        assert not (await anna.command("upload", nonce=prepared["nonce"]))["error"]
        assert "given before" in (await anna.command("upload", nonce=prepared["nonce"]))["error"]
        nonce = (await anna.command("prepare_order"))["nonce"]
        assert "given before" in (await anna.command("upload", nonce=nonce))["error"]  # nor for another purpose
        assert not (await ben.command("take_control", force=True))["error"]
        await anna.until(lambda p: any("took over control" in text for text in p.notices))
        assert "is in control" in (await anna.command("order", order="arm", nonce="x"))["error"]
        await ben.until(lambda p: p.state["vehicle"]["holds_crc32"] == p.state["plan"]["crc32"])
        log = (station.desk.project.folder / ".session" / "audit.jsonl").read_text().splitlines()
        uploads = [line for line in map(json.loads, log) if line["what"] == "upload"]
        assert [line["answer"].split(":")[0] for line in uploads[-3:]] == ["done", "refused", "refused"]
        assert {line["crc32"] for line in uploads[-3:]} == {prepared["here"]["crc32"]}

    visit(station, 2, talk)


async def flying(page: Page) -> None:
    """Return once the vehicle is on the plan's path."""
    await page.checked()
    await page.command("take_control", force=True)
    prepared = await page.command("prepare_upload")
    assert not (await page.command("upload", nonce=prepared["nonce"]))["error"]
    nonce = (await page.command("prepare_order"))["nonce"]
    assert not (await page.command("order", order="start", nonce=nonce))["error"]
    await page.until(lambda p: p.state["vehicle"].get("error_m") is not None)


async def ordered(page: Page, order: str) -> str:
    nonce = (await page.command("prepare_order"))["nonce"]
    return (await page.command("order", order=order, nonce=nonce))["error"]


def test_neither_a_start_nor_arming_lifts_a_vehicle_that_is_not_fit(station):
    far = np.array([[3.0, 3.6, 1.0], [5.2, 0.8, 1.2]])
    station.desk.session.take(Waypoints(far, np.full(2, np.nan)), "elsewhere", "test")

    async def talk(page: Page, _: Page):
        await page.checked()
        await page.command("take_control", force=True)
        prepared = await page.command("prepare_upload")
        assert not (await page.command("upload", nonce=prepared["nonce"]))["error"]
        await page.until(lambda p: any(not check["passed"] for check in p.state["vehicle"]["checks"]))
        (failed,) = (check for check in page.state["vehicle"]["checks"] if not check["passed"])
        assert failed["name"] == "start"
        for order in ("arm", "start"):
            assert "not armed. start: the trajectory begins" in await ordered(page, order)
        assert page.state["vehicle"]["mission"] == "disarmed"

    visit(station, 2, talk)


STREAMS = {"position": 0b1, "attitude": 0b100, "rate": 0b10000}
"""First bit of each in the vehicle's word of faults."""
HEARD: list[tuple[str, dict[str, object]]] = [
    ("mission state", {"mission_state": MissionState.FAULT}),
    *(("estimator", {"estimate_faults": bit}) for bit in STREAMS.values()),
    ("level", {"q_world_body": [0.7071, 0.7071, 0.0, 0.0]}),
    ("at rest", {"velocity_world_m_s": [0.0, 0.6, 0.0]}),
    ("at rest", {"rate_body_rad_s": [0.0, 0.0, 0.6]}),
    ("battery", {"battery_v": 5.0}),
    ("start", {"position_world_m": [3.0, 3.6, 0.0]}),
    ("geofence", {"position_world_m": [0.8, 0.8, 40.0]}),
]
"""What the vehicle says of itself, and the item of the list that it makes false."""


NO_GO = Preflight("current", verdict="no_go", sentence="Risk about 5 %.", remedy="wait for less wind")
FORBIDS = "preflight: no-go. Risk about 5 %. Wait for less wind. Change the plan, or fly its preflight again"


@pytest.fixture(autouse=True)
def not_flown(station):
    """In simulation, but for what a test tells."""
    yield
    for file in (station.desk.project.folder / ".session").glob("preflights/*"):
        file.unlink()


def tell(station, found: Preflight, item=None) -> None:
    """Keep it as that of a plan; of the checked one where none is given."""
    folder = station.desk.project.folder
    preflown.save(folder, preflown.Flown.of(folder, item or station.desk.checked()), found)
    station.desk.show_preflight()


def test_arming_is_refused_with_each_of_twelve_kinds_of_items_false_and_nothing_climbs(station, monkeypatch):
    """Telemetry is changed where the list is made of it; the vehicle itself stands as it should."""
    false: dict[str, object] = {}
    judged = arming.checks
    monkeypatch.setattr(arming, "checks", lambda state, *rest: judged(replace(state, **false), *rest))
    parameters = station.watch.parameters() | {"battery_arm_v": 13.0, "fence_max_z_m": 30.0}
    monkeypatch.setattr(station.watch.link, "parameters", lambda: parameters)
    desk, stands_at_m = station.desk, station.watch.link.state.position_world_m[2]

    async def talk(page: Page, _: Page):
        await page.checked()
        await page.command("take_control", force=True)
        prepared = await page.command("prepare_upload")
        assert not (await page.command("upload", nonce=prepared["nonce"]))["error"]
        for item, heard in HEARD:
            false.clear()
            false.update(heard)
            for order in ("arm", "start"):
                said = await ordered(page, order)
                assert said.startswith("not armed. "), (item, order, said)
                assert f"{item}: " in said
        false.clear()
        tell(station, NO_GO)
        for order in ("arm", "start"):
            assert FORBIDS in await ordered(page, order)
        for verdict in ("not_shown", "go"):
            tell(station, msgspec.structs.replace(NO_GO, verdict=verdict))
            assert not await ordered(page, "arm")
            assert not await ordered(page, "disarm")
        desk.rename("another plan")  # which is not the one that it holds
        assert "holds plan, not this plan; upload it first" in await ordered(page, "start")
        desk.rename("plan")
        assert station.watch.state().mission == "disarmed"
        assert station.watch.link.state.position_world_m[2] == pytest.approx(stands_at_m, abs=0.01)

    visit(station, 2, talk)


def test_a_no_go_forbids_the_plan_it_is_of_and_no_other(station):
    """Nor does it where that plan is no longer there: refused, or too short."""
    desk = station.desk

    async def talk(page: Page, _: Page):
        await page.checked()
        await page.command("take_control", force=True)
        tell(station, NO_GO)
        assert FORBIDS in await ordered(page, "arm")
        assert audited(desk)["preflight"] == {"state": "current", "verdict": "no_go", "sentence": "Risk about 5 %."}
        below = np.array([[0.8, 0.8, 1.0], [3.0, 2.0, -5.0]])
        for points, state in ((below, "refused"), (below[:1], "none")):
            desk.session.take(Waypoints(points, np.full(len(points), np.nan)), "edited", "test")
            await page.until(lambda p, state=state: p.state["plan"]["state"] == state)
            assert not await ordered(page, "arm")
            assert "preflight" not in audited(desk)
            assert not await ordered(page, "disarm")
        away = np.array([[0.8, 0.8, 1.0], [5.2, 0.8, 1.2]])
        desk.session.take(Waypoints(away, np.full(2, np.nan)), "another", "test")
        await page.checked()
        assert desk.preflight.state == "stale"
        assert not await ordered(page, "arm")
        assert audited(desk)["preflight"] == {"state": "stale"}
        assert not await ordered(page, "disarm")

    visit(station, 2, talk)


def audited(desk) -> dict:
    """The newest line."""
    return json.loads((desk.project.folder / ".session" / "audit.jsonl").read_text().splitlines()[-1])


def test_who_started_which_job_with_which_risk_is_in_the_audit_log(station, monkeypatch):
    monkeypatch.setattr(station.desk.jobs, "start", lambda *_: 1)

    async def talk(page: Page, _: Page):
        asked = {"risk_percent": 5.0, "wind_m_s": 2.0}
        assert not (await page.command("start_job", kind="preflight", arguments=asked))["error"]
        line = audited(station.desk)
        assert (line["what"], line["kind"], line["arguments"], line["answer"]) == ("job", "preflight", asked, "started")
        assert line["who"] in {person["name"] for person in page.state["people"]["people"]}

    visit(station, 2, talk)


def test_a_no_go_that_comes_while_the_vehicle_is_read_back_keeps_it_on_the_ground(station, monkeypatch):
    read_back = station.watch.require_held

    def meanwhile(file, name):
        read_back(file, name)
        tell(station, NO_GO, file)

    async def talk(page: Page, _: Page):
        await page.checked()
        await page.command("take_control", force=True)
        prepared = await page.command("prepare_upload")
        assert not (await page.command("upload", nonce=prepared["nonce"]))["error"]
        monkeypatch.setattr(station.watch, "require_held", meanwhile)
        assert FORBIDS in await ordered(page, "start")
        assert station.watch.state().mission == "disarmed"

    visit(station, 2, talk)


def plan_from_where_it_stands(station) -> None:
    x_m, y_m, _ = station.watch.link.state.position_world_m
    away = np.array([[x_m, y_m, 1.0], [5.2, 0.8, 1.2] if x_m < 3.0 else [0.8, 0.8, 1.2]])
    station.desk.session.take(Waypoints(away, np.full(2, np.nan)), "from here", "test")


@pytest.mark.parametrize("emergency", ["abort", "kill"])
def test_a_flight_that_anybody_aborts_or_kills_leaves_its_log(station, emergency):
    before = set(station.desk.project.flights())
    plan_from_where_it_stands(station)

    async def talk(page: Page, other: Page):
        await flying(page)
        await page.until(lambda _: station.view.vehicle._setpoint.visible)  # not `until`, which answers no ping
        assert not (await other.command(emergency))["error"]  # by whoever sees the danger
        await page.until(lambda p: p.state["vehicle"]["mission"] in ("disarmed", "armed", "fault"))
        await page.until(lambda _: set(station.desk.project.flights()) - before)
        await page.until(lambda p: any("The flight ended early" in text for text in p.notices))
        if page.state["vehicle"]["mission"] != "disarmed":
            assert not await ordered(page, "disarm")
        await page.until(lambda p: p.state["vehicle"]["mission"] == "disarmed")

    visit(station, 2, talk)
    (new,) = set(station.desk.project.flights()) - before
    log = flight_log.load(new)
    assert log.metadata["ended_early"]
    assert log.vector("position_world_m")[:, 2].max() > 0.5


def test_an_abort_while_a_start_is_prepared_keeps_the_vehicle_on_the_ground(station):
    watch, desk = station.watch, station.desk
    until(lambda: desk.answer is not None and desk.answer.request.revision == desk.session.revision, "a plan")
    aborted = watch.begin_flight()
    with pytest.raises(LinkError):  # on the ground it cannot land; the flight is given up all the same
        watch.land()
    assert aborted.is_set()
    with pytest.raises(LinkError, match="aborted before the take-off"):
        watch.fly(desk.checked(), aborted, lambda _: None)
    with pytest.raises(LinkError, match="a flight is under way"):
        watch.begin_flight()
    watch.end_flight()
    watch.begin_flight()
    watch.end_flight()


def test_a_path_that_the_vehicle_cannot_store_is_refused_and_the_next_one_is_planned(station):
    async def talk(page: Page):
        line = np.stack([np.linspace(0.8, 5.2, 300), np.full(300, 0.6), np.full(300, 1.2)], axis=1)
        station.desk.session.take(Waypoints(line, np.full(300, np.nan)), "many", "test")
        await page.until(lambda p: p.state["plan"]["state"] == "refused")
        await page.command("undo")
        await page.checked()

    visit(station, 1, talk)


def test_orders_beyond_the_bound_are_refused_at_once_and_an_abort_is_not(station, monkeypatch):
    let_go = threading.Event()

    def held_up() -> None:
        let_go.wait(PATIENCE_S)

    async def talk(page: Page):
        monkeypatch.setattr(station.watch, "held", held_up)
        await page.checked()
        await page.command("take_control", force=True)
        for serial in range(1000, 1000 + page_socket.MOST_APART):
            await page.send("prepare_upload", serial)
        assert "orders of this page still wait" in (await page.command("prepare_upload"))["error"]
        assert "still wait" not in (await page.command("abort"))["error"]
        let_go.set()

    visit(station, 1, talk)
