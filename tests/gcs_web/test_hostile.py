"""What no browser of ours would send: all of it is refused by a real station, which lives on and still takes edits."""

import asyncio
import itertools
import json
import resource
import shutil
import socket as sockets
import struct
from collections.abc import Awaitable, Callable, Iterator
from contextlib import asynccontextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any

import aiohttp
import msgspec
import pytest
import viser

import vehicle
from firmware_bridge import SitlVehicle, controller, keys
from flight import project
from gcs_web.document.document import Settings
from gcs_web.document.session import Session
from gcs_web.gateway import gateway
from gcs_web.protocol.document import Shift
from tests.gcs_web.station_process import StationProcess, new_project
from tests.waiting import PATIENCE_S, goshawk

MARKUP = "<img src=x onerror=window.ran=1><script>window.ran=1</script>"
MOST_GROWTH_MB = 60.0
"""Of the station's memory while hundreds of megabytes are sent to it."""
_serial = itertools.count(1)

Visit = Callable[[StationProcess, aiohttp.ClientSession], Awaitable[None]]


@pytest.fixture(scope="module")
def opened(pillar_map: Path, tmp_path_factory) -> project.Project:
    return new_project(tmp_path_factory.mktemp("hostile") / "project", pillar_map)


@pytest.fixture(scope="module")
def station(opened: project.Project) -> Iterator[StationProcess]:
    key_file = opened.folder / "link.key"
    believed = vehicle.example("rigter2019")
    plant = vehicle.simulate.Plant(believed, vehicle.simulate.State(), ground_m=0.0)
    with (
        SitlVehicle(plant, controller.parameters_of(believed).parameters, key=keys.create(key_file)) as simulated,
        StationProcess(opened.folder, "--url", simulated.url, "--key", key_file) as running,
    ):
        yield running


@pytest.fixture
def at_the(station: StationProcess) -> Callable[[Visit], None]:
    """`at_the(visit)` runs a coroutine function with a browser that was let in; afterwards the station is as good."""

    def run(visit: Visit) -> None:
        async def all_of_it() -> None:
            jar = aiohttp.CookieJar(unsafe=True)
            async with aiohttp.ClientSession(cookie_jar=jar) as browser:
                await station.enter(browser)
                await visit(station, browser)
                await still_good(station, browser)

        asyncio.run(all_of_it())

    return run


@asynccontextmanager
async def page(station: StationProcess, browser: aiohttp.ClientSession, path: str = "/ws", **options: Any):
    async with browser.ws_connect(f"{station.origin}{path}", headers={"Origin": station.origin}, **options) as socket:
        yield socket


async def reply(socket: aiohttp.ClientWebSocketResponse, serial: int) -> dict[str, Any]:
    while True:
        message = await socket.receive_json(timeout=PATIENCE_S)
        if message["type"] == "reply" and message["serial"] == serial:
            return message


async def command(socket: aiohttp.ClientWebSocketResponse, type: str, **arguments: Any) -> dict[str, Any]:
    serial = next(_serial)
    await socket.send_str(json.dumps({"type": type, "serial": serial, **arguments}))
    return await reply(socket, serial)


async def state(station: StationProcess, browser: aiohttp.ClientSession) -> dict[str, Any]:
    async with browser.get(f"{station.origin}/state") as answer:
        assert answer.status == 200
        return await answer.json()


async def still_good(station: StationProcess, browser: aiohttp.ClientSession) -> None:
    """It runs, answers, and takes an edit and its undo."""
    assert station.process.poll() is None
    before = (await state(station, browser))["document"]
    chosen = [before["waypoints"][1]["id"]]
    async with page(station, browser) as socket:
        done = await command(socket, "shift", revision=before["revision"], waypoints=chosen, z_m=0.01)
        assert done["error"] == ""
        assert (await command(socket, "undo"))["error"] == ""
    after = (await state(station, browser))["document"]
    assert after["revision"] == before["revision"] + 2
    assert after["waypoints"] == before["waypoints"]


# --- who may come in ---


def test_foreign_hosts_origins_and_cookies_are_refused(at_the):
    async def visit(station: StationProcess, browser: aiohttp.ClientSession) -> None:
        for host in ("evil.example", f"evil.example:{station.port}", "127.0.0.1:1", "[::1]", ""):
            async with browser.get(f"{station.origin}/state", headers={"Host": host}) as answer:
                assert answer.status in (400, 403), host
        origins = ("http://evil.example", "null", f"https://127.0.0.1:{station.port}", "file://", "")
        for headers in ({}, *({"Origin": origin} for origin in origins)):
            for path in ("/ws", "/viser", "/viser/"):
                with pytest.raises(aiohttp.WSServerHandshakeError) as refusal:
                    await browser.ws_connect(f"{station.origin}{path}", headers=headers)
                assert refusal.value.status == 403
        name = f"goshawk_{station.port}"
        async with aiohttp.ClientSession(cookie_jar=aiohttp.DummyCookieJar()) as stranger:
            for cookie in ("", f"{name}=", f"{name}=x", f"{name}=\xff\xfe", f"{name}={'x' * 5000}", "goshawk=1"):
                for path in ("/", "/state", "/static/app.js", "/viser/", "/ws", "/?token=", "/?token=\u00e9"):
                    async with stranger.get(f"{station.origin}{path}", headers={"Cookie": cookie}) as answer:
                        assert answer.status == 403, (cookie, path)

    at_the(visit)


def test_other_methods_do_nothing(at_the):
    async def visit(station: StationProcess, browser: aiohttp.ClientSession) -> None:
        for method in ("POST", "PUT", "DELETE", "PATCH", "OPTIONS", "TRACE", "CONNECT", "BREW"):
            for path in ("/", "/state", "/ws", "/static/app.js", "/viser/"):
                async with browser.request(method, f"{station.origin}{path}", data=b"x" * 1000) as answer:
                    assert answer.status in (400, 403, 405), (method, path)

    at_the(visit)


def raw(station: StationProcess, request: bytes) -> bytes:
    """What it answers to these bytes."""
    with sockets.create_connection(("127.0.0.1", station.port), timeout=PATIENCE_S) as connection:
        connection.sendall(request)
        connection.shutdown(sockets.SHUT_WR)
        answer = b""
        while block := connection.recv(65536):
            answer += block
        return answer


def test_no_address_leads_out_of_the_pages_files(at_the):
    async def visit(station: StationProcess, browser: aiohttp.ClientSession) -> None:
        cookie = next(iter(browser.cookie_jar))
        head = f"Host: 127.0.0.1:{station.port}\r\nCookie: {cookie.key}={cookie.value}\r\nConnection: close\r\n\r\n"
        ways = (
            "../",
            "..%2f",
            "%2e%2e/",
            "%252e%252e/",
            "..\\",
            "..%5c",
            "....//",
            "..%00/",
            "/",
            "//",
            "%c0%ae%c0%ae/",
        )
        for base in ("/static/", "/viser/", "/"):
            for way in ways:
                for goal in ("etc/passwd", "gateway.py"):
                    request = f"GET {base}{8 * way}{goal} HTTP/1.1\r\n{head}".encode()
                    answer = await asyncio.to_thread(raw, station, request)
                    assert b"root:" not in answer, (base, way)
                    assert b"hmac" not in answer, (base, way)
        for target in ("http://evil.example/", "file:///etc/passwd", "*", "\x00", "/static/" + "a" * 100_000):
            answer = await asyncio.to_thread(raw, station, f"GET {target} HTTP/1.1\r\n{head}".encode())
            assert b"root:" not in answer
        for noise in (
            b"\x16\x03\x01\x02\x00\x01\x00\x01\xfc\x03\x03",
            b"\x00" * 1000,
            b"GET",
            b"PRI * HTTP/2.0\r\n\r\n",
        ):
            await asyncio.to_thread(raw, station, noise)

    at_the(visit)


def test_the_view_is_not_published_on_a_share_server(at_the):
    async def visit(station: StationProcess, browser: aiohttp.ClientSession) -> None:
        protocols = [f"viser-v{viser.__version__}"]
        async with page(station, browser, "/viser", protocols=protocols, max_msg_size=0) as socket:
            for name in sorted(gateway.REFUSED_MESSAGES):
                await socket.send_bytes(msgspec.msgpack.encode({"type": name}))
            await socket.send_bytes(b"\xc1 no msgpack")
            await socket.send_bytes(msgspec.msgpack.encode([1, 2]))
            await socket.send_bytes(msgspec.msgpack.encode({"type": "NobodyKnowsThis", "x": 1}))
        said = "".join(station.said).lower()
        assert "share.viser" not in said

    at_the(visit)


# --- how much ---


def frame(data: bytes, *, opcode: int = 1, last: bool = True, length: int | None = None) -> bytes:
    """A WebSocket frame, masked with zeros; it may claim another length than it has."""
    claimed = len(data) if length is None else length
    return struct.pack(">BBQ4x", (0x80 if last else 0) | opcode, 0x80 | 127, claimed) + data


async def pour(station: StationProcess, browser: aiohttp.ClientSession, path: str, frames: Iterator[bytes]) -> int:
    """Send frames on a socket of its own until the station hangs up; how many bytes it took."""
    cookie = next(iter(browser.cookie_jar))
    reader, writer = await asyncio.open_connection("127.0.0.1", station.port)
    writer.write(
        (
            f"GET {path} HTTP/1.1\r\nHost: 127.0.0.1:{station.port}\r\nOrigin: {station.origin}\r\n"
            f"Cookie: {cookie.key}={cookie.value}\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n"
            "Sec-WebSocket-Version: 13\r\nSec-WebSocket-Key: AAAAAAAAAAAAAAAAAAAAAA==\r\n\r\n"
        ).encode()
    )
    assert b" 101 " in await reader.readuntil(b"\r\n\r\n")

    async def swallow() -> None:
        while await reader.read(1 << 16):
            pass

    sent, swallowing = 0, asyncio.create_task(swallow())
    try:
        for data in frames:
            if swallowing.done():
                break
            writer.write(data)
            await writer.drain()
            sent += len(data)
        await asyncio.wait_for(swallowing, PATIENCE_S)
    except ConnectionError:
        pass
    finally:
        swallowing.cancel()
        writer.close()
    return sent


@pytest.mark.parametrize("path", ["/ws", "/viser"])
def test_a_message_beyond_a_mebibyte_costs_no_memory(at_the, path):
    block = b"x" * (1 << 18)

    def one_frame() -> Iterator[bytes]:
        yield frame(block, length=1 << 30)
        for _ in range(800):
            yield block

    def many_frames() -> Iterator[bytes]:
        yield frame(block, last=False)
        for _ in range(800):
            yield frame(block, opcode=0, last=False)

    async def visit(station: StationProcess, browser: aiohttp.ClientSession) -> None:
        before_mb = station.resident_mb()
        for frames in (one_frame, many_frames):
            sent = await pour(station, browser, path, frames())
            assert sent < 100e6  # it hung up long before all of it
            assert station.resident_mb() - before_mb < MOST_GROWTH_MB

    at_the(visit)


def test_a_small_message_that_unpacks_to_a_large_one_costs_no_memory(at_the):
    async def visit(station: StationProcess, browser: aiohttp.ClientSession) -> None:
        before_mb = station.resident_mb()
        async with page(station, browser, compress=15) as socket:
            await socket.send_str("x" * 200_000_000)
            while (await socket.receive(timeout=PATIENCE_S)).type == aiohttp.WSMsgType.TEXT:
                pass
            assert socket.close_code is not None
        assert station.resident_mb() - before_mb < MOST_GROWTH_MB

    at_the(visit)


def test_of_five_hundred_sockets_all_beyond_the_bound_are_refused_and_a_page_still_comes_in(at_the):
    async def visit(station: StationProcess, browser: aiohttp.ClientSession) -> None:
        idle = [sockets.create_connection(("127.0.0.1", station.port), timeout=PATIENCE_S) for _ in range(300)]
        held, refused = [], []
        for _ in range(500):
            try:
                held.append(await browser.ws_connect(f"{station.origin}/ws", headers={"Origin": station.origin}))
            except aiohttp.WSServerHandshakeError as error:
                refused.append(error.status)
        assert len(held) <= gateway.MOST_SOCKETS
        assert refused == [503] * (500 - len(held))
        await state(station, browser)
        for connection in idle:
            connection.close()
        await asyncio.gather(*(socket.close() for socket in held))
        for _ in range(1000):  # until the station has noticed that they left
            if (await state(station, browser))["people"] == 0:
                break
            await asyncio.sleep(0.05)

    at_the(visit)


# --- what is said ---


def test_values_that_are_no_numbers_or_too_large_change_nothing(at_the):
    async def visit(station: StationProcess, browser: aiohttp.ClientSession) -> None:
        before = (await state(station, browser))["document"]
        revision, ids = before["revision"], [w["id"] for w in before["waypoints"]]
        first = ids[0]
        async with page(station, browser) as socket:
            for number in ("NaN", "Infinity", "-Infinity", "1e400", "1e9", "-1e9", '"1"', "[]", "{}", "true"):
                for text in (
                    f'{{"type":"move","serial":%d,"revision":{revision},"waypoints":[{first}],"x_m":{number}}}',
                    f'{{"type":"shift","serial":%d,"revision":{revision},"waypoints":[{first}],"z_m":{number}}}',
                    f'{{"type":"turn","serial":%d,"revision":{revision},"waypoints":[{first}],"yaw_deg":{number}}}',
                    f'{{"type":"insert","serial":%d,"revision":{revision},"after":{first},"y_m":{number}}}',
                    f'{{"type":"choose","serial":%d,"revision":{revision},"speed_m_s":{number}}}',
                    f'{{"type":"choose","serial":%d,"revision":{revision},"look_at_m":[0,0,{number}]}}',
                    f'{{"type":"pass","serial":%d,"revision":{revision},"waypoints":[{first}],"velocity_m_s":[0,0,{number}]}}',
                    f'{{"type":"ground","serial":%d,"revision":{revision},"end":"landing","z_m":{number}}}',
                    f'{{"type":"move","serial":%d,"revision":{revision},"waypoints":[{number}],"x_m":1}}',
                    f'{{"type":"loop","serial":%d,"revision":{revision},"laps":{number}}}',
                ):
                    if number in ("1e9", "-1e9") and '"turn"' in text:
                        continue  # a heading of any size is one within a turn
                    serial = next(_serial)
                    await socket.send_str(text % serial)
                    while (message := await socket.receive_json(timeout=PATIENCE_S))["type"] != "reply":
                        pass
                    assert message["error"], text
            for text in ("", "null", "[1]", "{" * 100_000, '{"type":"\\ud800"}', '{"type":"move"}', "\x00", '"' * 9999):
                await socket.send_str(text)
                while (message := await socket.receive_json(timeout=PATIENCE_S))["type"] != "reply":
                    pass
                assert message["error"], text[:40]
            too_many = await command(socket, "move", revision=revision, waypoints=[first] * 100_000, x_m=1e9)
            assert "within 10000 m" in too_many["error"]
        assert (await state(station, browser))["document"] == before

    at_the(visit)


def test_frames_that_are_no_text_close_their_socket_only(at_the):
    async def visit(station: StationProcess, browser: aiohttp.ClientSession) -> None:
        for data in (frame(b"\xff\xfe\xfd"), frame(b"binary", opcode=2), frame(b"", opcode=5), b"\xff" * 64):
            await pour(station, browser, "/ws", iter([data, frame(b"\x03\xe8", opcode=8)]))

    at_the(visit)


def test_names_that_lead_out_or_carry_markup_are_refused(at_the, opened: project.Project):
    async def visit(station: StationProcess, browser: aiohttp.ClientSession) -> None:
        async with page(station, browser) as socket:
            for name in ("../x", "..", "/etc/passwd", "a/b", "a\\b", "a\x00b", MARKUP, "x" * 10_000, "\u202egpj", ""):
                for type in ("save", "open", "discard"):
                    assert "cannot be a name" in (await command(socket, type, name=name))["error"], name

    files = sorted(opened.folder.parent.rglob("*.json"))
    at_the(visit)
    assert sorted(opened.folder.parent.rglob("*.json")) == files


def test_an_order_that_is_given_again_or_by_another_person_is_refused(at_the):
    async def visit(station: StationProcess, browser: aiohttp.ClientSession) -> None:
        async with page(station, browser) as anna:
            assert (await command(anna, "take_control"))["error"] == ""
            prepared: dict[str, Any] = {"error": "not asked yet"}
            while prepared["error"]:  # until there is a checked plan and the vehicle answers
                prepared = await command(anna, "prepare_upload")
                await asyncio.sleep(0.1)
            nonce = prepared["nonce"]
            async with page(station, browser) as ben:  # now: a socket that reads nothing for long is closed
                assert "is in control" in (await command(ben, "upload", nonce=nonce))["error"]
            assert (await command(anna, "upload", nonce=nonce))["error"] == ""
            for again in (nonce, "", "x" * 100_000):
                assert "given before" in (await command(anna, "upload", nonce=again))["error"]
                assert "given before" in (await command(anna, "order", order="arm", nonce=again))["error"]
            await command(anna, "give_up_control")

    at_the(visit)


# --- the disk ---


def test_a_full_disk_refuses_edits_in_words_until_there_is_room(at_the, opened: project.Project):
    async def visit(station: StationProcess, browser: aiohttp.ClientSession) -> None:
        before = (await state(station, browser))["document"]
        chosen = [before["waypoints"][0]["id"]]
        pid, journal = station.process.pid, opened.folder / ".session" / "journal.jsonl"
        old = resource.prlimit(pid, resource.RLIMIT_FSIZE)
        try:
            for room in (0, 1, 100):  # bytes that the disk still takes
                resource.prlimit(pid, resource.RLIMIT_FSIZE, (journal.stat().st_size + room, old[1]))
                async with page(station, browser) as socket:
                    asked = {"revision": before["revision"], "waypoints": chosen, "z_m": 0.01}
                    refused = await command(socket, "shift", **asked)
                assert "free some disk space" in refused["error"]
                assert (await state(station, browser))["document"] == before
        finally:
            resource.prlimit(pid, resource.RLIMIT_FSIZE, old)

    at_the(visit)


def test_a_journal_cut_off_at_any_byte_of_its_last_record_opens_with_all_before(tmp_path, pillar_map):
    opened = new_project(tmp_path / "project", pillar_map)
    session = Session(opened, Settings())
    for k in range(3):
        edit = Shift(serial=0, revision=session.revision, waypoints=[k], z_m=0.01)
        session.edit(edit, "Anna")
    session.close()
    path = opened.folder / ".session" / "journal.jsonl"
    whole = path.read_bytes()
    last = whole[:-1].rindex(b"\n") + 1
    shutil.copytree(opened.folder / ".session", tmp_path / "kept")
    kept = opened.waypoints.read_bytes()
    for end in range(last, len(whole)):
        shutil.copytree(tmp_path / "kept", opened.folder / ".session", dirs_exist_ok=True)
        path.write_bytes(whole[:end])
        opened.waypoints.unlink()
        again = Session(opened, Settings())
        try:
            assert (again.revision, len(again.content.points)) == (2, 3)
            again.edit(Shift(serial=0, revision=2, waypoints=[0], z_m=0.01), "Ben")
        finally:
            again.close()
    opened.waypoints.write_bytes(kept)


def test_a_second_station_on_the_project_is_refused_and_the_first_one_lives(at_the, opened: project.Project):
    async def visit(station: StationProcess, browser: aiohttp.ClientSession) -> None:
        second = await asyncio.to_thread(goshawk, "gcs", opened.folder, "--port", "0")
        assert second.returncode != 0
        assert f"another ground station (process {station.process.pid})" in second.stderr

    at_the(visit)


# --- foreign strings, in a browser ---


@pytest.mark.slow
@pytest.mark.skipif(shutil.which("chromium") is None, reason="needs Chromium: apt-get install chromium")
def test_markup_in_every_string_is_shown_as_text_and_runs_nowhere(pillar_map: Path, tmp_path: Path):
    from playwright.sync_api import sync_playwright

    from tests.gcs_web.in_browser import CHROMIUM, FLAGS

    harmless = MARKUP.replace("</script>", "")  # a file's name has no slash
    opened = new_project(tmp_path / "project", pillar_map, name=MARKUP)
    vehicle.save(opened.vehicle, replace(vehicle.load(opened.vehicle), name=MARKUP))
    for folder in ("trajectories", "flights"):
        (opened.folder / folder).mkdir()
    (opened.folder / "trajectories" / f"{harmless}.json").write_text("{}")
    (opened.folder / "flights" / f"{harmless}.parquet").write_bytes(b"")
    (opened.folder / "flights" / "plain.parquet").write_bytes(MARKUP.encode())
    with sync_playwright() as playwright, StationProcess(opened.folder) as station:
        browser = playwright.chromium.launch(executable_path=CHROMIUM, args=FLAGS, timeout=1000 * PATIENCE_S)
        tab = browser.new_context().new_page()
        tab.set_default_timeout(1000 * PATIENCE_S)
        asked: list[str] = []
        tab.on("request", lambda request: asked.append(request.url))
        tab.goto(station.addresses()[-1])
        tab.get_by_text("Checked", exact=True).wait_for()
        tab.get_by_text(MARKUP, exact=True).first.wait_for()
        for name in ("Saved", "Mission", "Segments", "Waypoints"):
            tab.get_by_role("tab", name=name).click()
        for number in "12345":
            tab.keyboard.press(number)
            tab.evaluate("() => new Promise(done => requestAnimationFrame(() => requestAnimationFrame(done)))")
            assert tab.evaluate("() => window.ran") is None
            assert tab.locator("img[src='x']").count() == 0
        origin = station.origin
        assert all(url.startswith((origin, "data:", "blob:")) for url in asked)
        assert not [url for url in asked if url.endswith("/x")]
        browser.close()
