"""The whole station over its WebSocket, as a page talks to it, with a SITL vehicle that really flies."""

import asyncio
import json
import re
import shutil
import socket
import threading
from collections.abc import Callable
from contextlib import AsyncExitStack
from pathlib import Path
from typing import Any

import aiohttp
import numpy as np
import pytest

import esdf
import vehicle
from firmware_bridge import SitlVehicle, controller, keys
from flight import InputError, LinkError, Waypoints, flight_log, mission, project, trajectory
from gcs_web import GroundStation, gateway, page_socket
from tests.gcs_web.station_process import new_project
from tests.waiting import PATIENCE_S, until

MARKUP = "<img src=x onerror=alert(1)>"
START = np.array([[0.8, 0.8, 1.0], [3.0, 2.0, 1.2], [5.2, 0.8, 1.2]])


@pytest.fixture(scope="module")
def station(pillar_map: Path, tmp_path_factory):
    opened = project.create(tmp_path_factory.mktemp("station") / "project", "two pillars")
    shutil.copytree(pillar_map, opened.map)
    believed = vehicle.example("rigter2019")
    vehicle.save(opened.vehicle, believed)
    project.save_waypoints(opened.waypoints, Waypoints(START, np.full(3, np.nan)))
    key_file = opened.folder / "link.key"
    start = vehicle.simulate.State(position_world_m=np.array([0.8, 0.8, 0.0]))
    plant = vehicle.simulate.Plant(believed, start, ground_m=0.0)
    with (
        SitlVehicle(plant, controller.parameters_of(believed).parameters, key=keys.create(key_file)) as simulated,
        GroundStation(opened.folder, vehicle_url=simulated.url, key_file=key_file, triangles=500) as running,
    ):
        yield running


class Page:
    """What a browser's page does: keeps the newest state, sends commands and waits for their replies."""

    def __init__(self, socket: aiohttp.ClientWebSocketResponse) -> None:
        self._socket = socket
        self._serial = 0
        self.state: dict[str, dict[str, Any]] = {}
        self.notices: list[str] = []

    async def _receive(self) -> dict[str, Any]:
        message = json.loads(await asyncio.wait_for(self._socket.receive_str(), PATIENCE_S))
        self.state[message["type"]] = message
        if message["type"] == "notice":
            self.notices.append(message["text"])
        return message

    async def until(self, condition: Callable[["Page"], Any]) -> None:
        while not condition(self):
            await self._receive()

    async def send(self, type: str, serial: int, **arguments: Any) -> None:
        await self._socket.send_str(json.dumps({"type": type, "serial": serial, **arguments}))

    async def command(self, type: str, **arguments: Any) -> dict[str, Any]:
        """Send a command; its reply."""
        self._serial += 1
        await self.send(type, self._serial, **arguments)
        while True:
            message = await self._receive()
            if message["type"] == "reply" and message["serial"] == self._serial:
                return message

    async def edit(self, type: str, **arguments: Any) -> dict[str, Any]:
        revision = arguments.pop("revision", self.state["document"]["revision"])
        return await self.command(type, revision=revision, **arguments)

    async def checked(self) -> None:
        """Wait for the checked plan of the newest document."""

        def answered(page: Page) -> bool:
            document, plan = page.state.get("document"), page.state.get("plan")
            return bool(document and plan and plan["revision"] == document["revision"] and plan["state"] == "checked")

        await self.until(answered)

    def heights(self) -> list[float]:
        return [w["z_m"] for w in self.state["document"]["waypoints"]]


def visit(station: GroundStation, people: int, talk: Callable[..., Any]) -> None:
    """Run a coroutine function with the pages of so many people, each with its own cookie."""

    async def run() -> None:
        async with AsyncExitStack() as stack:
            pages = []
            for _ in range(people):
                jar = aiohttp.CookieJar(unsafe=True)
                browser = await stack.enter_async_context(aiohttp.ClientSession(cookie_jar=jar))
                url = station.url
                async with browser.get(url, allow_redirects=False):
                    pass
                origin = url.split("/?")[0]
                socket = await stack.enter_async_context(browser.ws_connect(f"{origin}/ws", headers={"Origin": origin}))
                page = Page(socket)
                await page.until(lambda p: {"welcome", "document", "plan", "files"} <= p.state.keys())
                pages.append(page)
            await talk(*pages)

    asyncio.run(run())


@pytest.fixture(autouse=True)
def same_waypoints(station: GroundStation):
    """Each test begins with the same waypoints, whatever ran before it."""
    station.desk.session.take(Waypoints(START, np.full(3, np.nan)), "test begins", "test")


def test_an_edit_is_planned_and_undo_brings_the_waypoint_back(station):
    async def talk(page: Page):
        ids = [w["id"] for w in page.state["document"]["waypoints"]]
        assert (await page.edit("move", waypoints=[ids[1]], z_m=1.5))["error"] == ""
        await page.checked()
        assert page.heights() == [1.0, 1.5, 1.2]
        assert page.state["notice"]["undo"]
        await page.command("undo")
        await page.until(lambda p: p.heights() == [1.0, 1.2, 1.2])

    visit(station, 1, talk)


def test_a_missions_requests_are_edited_planned_and_taken_back(station):
    async def talk(page: Page):
        ids = [w["id"] for w in page.state["document"]["waypoints"]]
        assert not (await page.edit("ask", waypoints=[ids[1]], stay_s=1.0))["error"]
        assert not (await page.edit("loop", laps=2))["error"]
        assert not (await page.edit("ground", end="take_off"))["error"]
        await page.until(lambda p: p.state["document"]["mission"]["take_off"] is not None)
        ground = page.state["document"]["mission"]["take_off"]
        assert (ground["x_m"], ground["y_m"]) == (0.8, 0.8)
        assert 0.0 < ground["z_m"] < 0.2  # on the floor below waypoint 0
        await page.checked()
        assert page.state["plan"]["passings"][0]["waypoint"] is None
        saved = mission.load(station.desk.project.waypoints)
        assert (saved.laps.count, saved.stays[0].duration_s) == (2, 1.0)
        for _ in range(3):
            await page.command("undo")
        await page.until(lambda p: p.state["document"]["mission"]["laps"] == 0)
        assert mission.load(station.desk.project.waypoints).plain

    visit(station, 1, talk)


def test_all_pages_know_what_the_one_3d_view_shows(station):
    async def talk(anna: Page, ben: Page):
        await anna.command("show", colour="thrust")
        await ben.until(lambda p: p.state.get("shown", {}).get("colour") == "thrust")
        await anna.command("show", colour="clearance")
        for of in ("distance", "unknown", "could_hide"):
            await anna.command("show_map", slice={"axis": "y", "at_m": 1.0, "of": of}, layers=["cameras", "points"])
            await ben.until(lambda p, of=of: (p.state.get("map_shown", {}).get("slice") or {}).get("of") == of)
        assert ben.state["map_shown"]["layers"] == ["cameras", "points"]
        refused = await anna.command("show_map", slice={"axis": "y", "at_m": 1e9}, layers=[])
        assert "finite place" in refused["error"]
        await anna.command("show_map", slice=None, layers=["mesh", "edits"])

    visit(station, 2, talk)


BOX = {"form": "box", "centre_m": [3.0, 0.8, 1.2], "size_m": [0.2, 4.0, 2.0]}


def test_a_no_fly_zone_over_the_path_is_previewed_applied_refused_and_undone(station):
    async def talk(anna: Page, ben: Page):
        await anna.checked()
        plan = anna.state["plan"]
        shape = BOX | {"size_m": [0.2, 1.0, 2.0]}
        await anna.command("preview_map_edit", action="no-fly", shape=shape)
        await ben.until(lambda p: p.state.get("map_preview", {}).get("voxels", 0) > 0)
        assert 0.0 < ben.state["map_preview"]["closed_m3"] <= 0.3 * 1.1 * 2.1
        assert "another person" in (await ben.command("preview_map_edit", action="add", shape=BOX))["error"]
        assert station.desk.session.content.map_edits == ()
        reply = await anna.edit("add_map_edit", action="no-fly", name="<b>cable</b>", shape=shape)
        assert reply["error"] == ""
        await anna.checked()  # a way round it
        assert anna.state["plan"]["crc32"] != plan["crc32"]
        field = esdf.load(station.desk.project.map / "esdf")
        assert field.distance([[3.0, 0.8, 1.2]])[0] < 0.0
        assert anna.state["map_preview"]["shape"] is None
        number = anna.state["document"]["map_edits"][0]["id"]
        await anna.edit("change_map_edit", edit=number, shape=BOX)  # from wall to wall
        await ben.until(lambda p: p.state["plan"]["state"] == "refused")
        assert ben.state["document"]["undo"] == "no-fly zone <b>cable</b> changed"
        await ben.command("undo")
        await anna.checked()
        await ben.command("undo")
        await anna.checked()
        assert esdf.load_edits(station.desk.project.map / "esdf" / "edits.json") == ()
        await anna.until(lambda p: p.state["plan"]["crc32"] == plan["crc32"])

    visit(station, 2, talk)


@pytest.mark.parametrize(
    ("edit", "said"),
    [
        ({"action": "no-fly", "name": "", "shape": BOX}, "needs a name"),
        ({"action": "add", "name": "far", "shape": BOX | {"centre_m": [500.0, 0.0, 0.0]}}, "touches no voxel"),
        ({"action": "add", "name": "far", "shape": BOX | {"centre_m": [1e9, 0.0, 0.0]}}, "finite and within"),
        ({"action": "add", "name": "flat", "shape": BOX | {"size_m": [0.0, 1.0, 1.0]}}, "is empty"),
        ({"action": "add", "name": "two", "shape": {"form": "prism", "corners_m": [[0, 0], [1, 1]]}}, "3 corners"),
        ({"action": "burn", "name": "x", "shape": BOX}, "Invalid enum value 'burn'"),
        ({"action": "add", "name": "x" * 61, "shape": BOX}, "at most 60"),
    ],
)
def test_an_edit_of_the_map_that_makes_no_sense_is_refused_and_changes_nothing(station, edit, said):
    async def talk(page: Page):
        assert said in (await page.edit("add_map_edit", **edit))["error"]
        assert station.desk.session.content.map_edits == ()

    visit(station, 1, talk)


def test_what_is_clicked_to_measure_has_its_clearance_and_the_distance(station):
    async def talk(page: Page):
        await page.command("measure", active=True)
        down = np.array([0.0, 0.0, -1.0])
        for x in (1.0, 4.0):
            station.desk.map.take_click(np.array([x, 1.0, 5.0]), down, np.array([x, 1.0, 1.0]))
        await page.until(lambda p: len(p.state.get("measured", {}).get("points_m", ())) == 2)
        assert page.state["measured"]["distance_m"] == pytest.approx(3.0)
        near = station.desk.parts.map(station.desk.inputs).field.distance([[1.0, 1.0, 1.0], [4.0, 1.0, 1.0]])
        np.testing.assert_allclose(page.state["measured"]["clearances_m"], near, atol=1e-3)
        await page.command("measure", active=False)
        await page.until(lambda p: p.state["measured"]["points_m"] == [])

    visit(station, 1, talk)


def test_two_people_see_each_others_edits_and_conflicts_are_refused(station):
    async def talk(anna: Page, ben: Page):
        ids = [w["id"] for w in anna.state["document"]["waypoints"]]
        seen = anna.state["document"]["revision"]
        assert not (await anna.edit("move", waypoints=[ids[0]], z_m=1.1, revision=seen))["error"]
        assert not (await ben.edit("move", waypoints=[ids[2]], z_m=1.3, revision=seen))["error"]
        refused = await ben.edit("move", waypoints=[ids[0]], z_m=1.4, revision=seen)
        assert "changed the same meanwhile" in refused["error"]
        for page in (anna, ben):
            await page.until(lambda p: p.heights() == [1.1, 1.2, 1.3])

    visit(station, 2, talk)


def test_a_saved_plan_is_checked_and_never_replaced_unasked(station):
    async def talk(page: Page):
        await page.checked()
        assert not (await page.command("save", name="lap-1"))["error"]
        saved = trajectory.load(station.desk.project.trajectory("lap-1"))
        assert saved.checked
        assert saved.map_hash == station.desk.parts.map(station.desk.inputs).hash
        assert "--overwrite" in (await page.command("save", name="lap-1"))["error"]
        assert not (await page.command("save", name="lap-1", overwrite=True))["error"]
        assert "kept as lap-1.json.old-1" in page.notices[-1]
        for name in ("../../../x", "<iframe srcdoc=x>", "", ".hidden", "a/b"):
            assert "cannot be a name" in (await page.command("save", name=name))["error"]
        await page.until(lambda p: [t["name"] for t in p.state["files"]["trajectories"]] == ["lap-1"])
        await page.command("discard", name="lap-1")
        await page.until(lambda p: p.state["files"]["trajectories"] == [])

    visit(station, 1, talk)


def test_a_discarded_or_replaced_trajectory_is_restored_and_never_over_another(station):
    async def talk(page: Page):
        def bin_names(p: Page) -> list[str]:
            return [each["file"] for each in p.state["files"]["bin"]]

        await page.checked()
        assert not (await page.command("save", name="lap-7"))["error"]
        first = station.desk.project.trajectory("lap-7").read_bytes()
        assert not (await page.command("discard", name="lap-7"))["error"]
        await page.until(lambda p: "lap-7.json.old-1" in bin_names(p))
        assert not (await page.command("save", name="lap-7"))["error"]
        assert "discard that one first" in (await page.command("restore", file="lap-7.json.old-1"))["error"]
        await page.command("discard", name="lap-7")
        assert not (await page.command("restore", file="lap-7.json.old-1"))["error"]
        await page.until(lambda p: bin_names(p)[:1] == ["lap-7.json.old-2"])
        assert station.desk.project.trajectory("lap-7").read_bytes() == first
        for file in ("lap-7.json.old-9", "../project.toml", "lap-7.json", MARKUP):
            assert "is not in the bin" in (await page.command("restore", file=file))["error"]
        await page.command("discard", name="lap-7")

    visit(station, 1, talk)


def test_two_trajectories_are_compared_for_the_map_and_the_vehicle_as_they_are_now(station):
    async def talk(page: Page):
        await page.checked()
        await page.command("save", name="fast", overwrite=True)
        await page.edit("choose", speed_m_s=1.5)
        await page.checked()
        fast, slow = (await page.command("compare_plans", names=["fast", ""]))["plans"]
        await page.command("undo")
        assert fast["passes"]
        assert slow["passes"]
        assert slow["duration_s"] > fast["duration_s"]
        assert slow["top_speed_m_s"] <= 1.5 < fast["top_speed_m_s"]
        direct_m = np.linalg.norm(np.diff(START, axis=0), axis=1).sum()
        assert fast["length_m"] >= direct_m - 0.1
        for plan in (fast, slow):
            clearance = next(limit for limit in plan["limits"] if limit["name"] == "clearance")
            assert clearance["value"] >= clearance["bound"]
        assert "nowhere" in (await page.command("compare_plans", names=["nowhere", ""]))["error"]
        assert "choose two" in (await page.command("compare_plans", names=[""] * 9))["error"]
        await page.command("discard", name="fast")

    visit(station, 1, talk)


def test_a_plan_is_shared_as_one_file_that_asks_nobody(station):
    async def visit_share() -> None:
        async with aiohttp.ClientSession(cookie_jar=aiohttp.CookieJar(unsafe=True)) as browser:
            origin = station.url.split("/?")[0]
            async with browser.get(f"{origin}/share") as refused:
                assert refused.status == 403  # nobody who was not let in
            async with browser.get(station.url):
                pass
            async with browser.get(f"{origin}/share") as answer:
                text = await answer.text()
                assert answer.headers["Content-Disposition"] == f"attachment; filename*=UTF-8''{station.desk.name}.html"
            assert "passes the gate" in text
            shades = re.findall(r'stroke="(#[0-9a-f]{6})" stroke-width="3"', text)
            assert len(set(shades)) > 3  # coloured by clearance
            assert not re.search(r"(src|href|action)=|url\(|@import|<script", text)
            for name in ("nowhere", "../waypoints", MARKUP):
                async with browser.get(f"{origin}/share", params={"name": name}) as answer:
                    assert answer.status == 404
                    assert answer.content_type == "text/plain"

    until(
        lambda: (
            station.desk.answer is not None and station.desk.answer.request.revision == station.desk.session.revision
        )
    )
    asyncio.run(visit_share())


def test_a_plan_is_void_once_the_vehicle_changes_underneath(station):
    async def talk(page: Page):
        await page.checked()
        path = station.desk.project.vehicle
        before = path.read_bytes()
        vehicle.save(path, vehicle.load(path).with_value("mass_kg", 0.72))
        await page.until(lambda p: p.state["plan"]["state"] == "void")
        assert "map or the vehicle changed" in (await page.command("save", name="stale"))["error"]
        await page.command("plan_again")
        await page.checked()
        path.write_bytes(before)
        await page.until(lambda p: p.state["plan"]["state"] == "void")
        await page.command("plan_again")
        await page.checked()

    visit(station, 1, talk)


def test_waypoints_changed_by_another_program_appear_on_the_page(station):
    async def talk(page: Page):
        project.save_waypoints(
            station.desk.project.waypoints, Waypoints(np.add(START, (0.0, 0.0, 0.25)), np.full(3, np.nan))
        )
        await page.until(lambda p: p.heights() == [1.25, 1.45, 1.45])
        assert page.state["document"]["author"] == "another program"
        await page.command("undo")
        await page.until(lambda p: p.heights() == [1.0, 1.2, 1.2])

    visit(station, 1, talk)


def test_what_a_page_may_not_send_is_answered_and_does_no_harm(station):
    async def talk(page: Page):
        before = page.state["document"]
        for text in (
            "", "[]", "null", '{"type": "explode"}', '{"type": "move"}', "{" * 3000, '"' + "a" * 100_000 + '"',
            '{"type": "move", "serial": 1, "revision": 0, "waypoints": ["a"]}',
            '{"type": "move", "serial": 1, "revision": 0, "waypoints": [0], "x_m": NaN}',
            '{"type": "move", "serial": 1, "revision": 0, "waypoints": [0], "x_m": 1e400}',
        ):  # fmt: skip
            await page._socket.send_str(text)
            reply = await page._receive()
            while reply["type"] != "reply":
                reply = await page._receive()
            assert "does not understand" in reply["error"]
        huge = await page.edit("move", waypoints=[w["id"] for w in before["waypoints"]], x_m=1e9)
        assert "within 10000 m" in huge["error"]
        assert page.state["document"]["waypoints"] == before["waypoints"]

    visit(station, 1, talk)


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


def test_a_flight_is_flown_logged_and_aborted_from_the_page(station):
    async def talk(page: Page, other: Page):
        await page.checked()
        await page.command("take_control", force=True)
        prepared = await page.command("prepare_upload")
        assert not (await page.command("upload", nonce=prepared["nonce"]))["error"]
        nonce = (await page.command("prepare_order"))["nonce"]
        assert not (await page.command("order", order="start", nonce=nonce))["error"]
        await page.until(lambda p: p.state["vehicle"].get("error_m") is not None)
        until(lambda: station.view.vehicle._setpoint.visible, "the set-point in the 3D view")
        assert not (await other.command("abort"))["error"]  # by whoever sees the danger
        await page.until(lambda p: any("The flight ended early" in text for text in p.notices))
        await page.until(lambda p: p.state["vehicle"]["mission"] in ("disarmed", "armed"))
        if page.state["vehicle"]["mission"] == "armed":
            nonce = (await page.command("prepare_order"))["nonce"]
            await page.command("order", order="disarm", nonce=nonce)
        await page.until(lambda p: p.state["vehicle"]["mission"] == "disarmed")

    visit(station, 2, talk)
    assert not list(station.desk.project.flights()) or flight_log.load(station.desk.project.flights()[0])


def test_an_abort_while_a_start_is_prepared_keeps_the_vehicle_on_the_ground(station):
    watch, desk = station.watch, station.desk
    until(lambda: desk.answer is not None and desk.answer.request.revision == desk.session.revision, "a plan")
    aborted = watch.begin_flight()
    with pytest.raises(LinkError):  # on the ground it cannot land; the flight is given up all the same
        watch.land()
    assert aborted.is_set()
    with pytest.raises(LinkError, match="aborted before the take-off"):
        watch.fly(desk.checked(), aborted)
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


@pytest.fixture
def slow_to_close(monkeypatch):
    """The gateway's end is reported as late."""
    stop = gateway.Gateway.stop

    async def stopped_late(self: gateway.Gateway) -> None:
        await stop(self)
        raise TimeoutError

    monkeypatch.setattr(gateway.Gateway, "stop", stopped_late)


def test_an_error_of_the_body_is_not_hidden_by_one_of_closing(pillar_map, tmp_path, slow_to_close, caplog):
    new_project(tmp_path / "hall", pillar_map, name="hall")
    with pytest.raises(KeyError, match="first"), GroundStation(tmp_path / "hall", triangles=500):
        raise KeyError("first")
    assert "not closed properly: TimeoutError()" in caplog.text
    with pytest.raises(TimeoutError), GroundStation(tmp_path / "hall", triangles=500):
        pass


def test_why_a_station_does_not_open_is_not_hidden_by_an_error_of_closing(pillar_map, tmp_path, slow_to_close):
    new_project(tmp_path / "hall", pillar_map, name="hall")
    with socket.create_server(("127.0.0.1", 0)) as taken, pytest.raises(InputError, match="cannot be used"):
        GroundStation(tmp_path / "hall", triangles=500, port=taken.getsockname()[1])
