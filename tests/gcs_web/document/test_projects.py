"""The projects beside the open one, and one opened in the place of another: nothing half-written, nobody in flight."""

import asyncio
import fcntl
import json
from pathlib import Path

import aiohttp
import pytest

from flight import InputError, project
from gcs_web.document import projects
from gcs_web.document.document import Settings
from gcs_web.document.session import Session
from tests.gcs_web.station_process import StationProcess, new_project
from tests.waiting import PATIENCE_S


@pytest.fixture(scope="module")
def neighbours(tmp_path_factory, pillar_map: Path) -> Path:
    root = tmp_path_factory.mktemp("places")
    new_project(root / "hall", pillar_map, name="hall")
    new_project(root / "yard", pillar_map, name="<b>yard</b>")
    project.create(root / "empty", "no map yet")
    (root / "other").mkdir()
    (root / "damaged").mkdir()
    (root / "damaged" / "project.toml").write_text("not toml")
    return root


def test_neighbours_are_listed_with_what_keeps_each_from_being_opened(neighbours: Path):
    listed = {entry.folder: entry for entry in projects.beside(project.open_project(neighbours / "hall"))}
    assert set(listed) == {"damaged", "empty", "hall", "yard"}
    assert listed["hall"].current
    assert (listed["yard"].name, listed["yard"].problem) == ("<b>yard</b>", "")
    assert listed["empty"].problem == ""  # its parts come on the page
    assert "not valid TOML" in listed["damaged"].problem


def test_a_project_that_another_station_has_is_named_and_its_lock_is_left_alone(neighbours: Path):
    held = Session(project.open_project(neighbours / "yard"), Settings())
    try:
        listed = projects.beside(project.open_project(neighbours / "hall"))
        assert next(e for e in listed if e.folder == "yard").problem == "another ground station has it open"
        with pytest.raises(InputError, match="another ground station"):
            Session(project.open_project(neighbours / "yard"), Settings())
    finally:
        held.close()


async def told(socket, kind: str, *, serial: int | None = None) -> dict:
    while True:
        message = json.loads((await asyncio.wait_for(socket.receive(), PATIENCE_S)).data)
        if message["type"] == kind and serial in (None, message.get("serial")):
            return message


def test_another_project_opens_in_place_for_a_browser_that_came_in_and_not_while_somebody_is_in_control(neighbours):
    async def visit(station: StationProcess) -> None:
        async with aiohttp.ClientSession(cookie_jar=aiohttp.CookieJar(unsafe=True)) as browser:
            await station.enter(browser)
            headers = {"Origin": station.origin}
            async with browser.ws_connect(f"{station.origin}/ws", headers=headers, max_msg_size=0) as socket:
                first = await told(socket, "welcome")
                serial = 0

                async def command(**fields) -> str:
                    nonlocal serial
                    serial += 1
                    await socket.send_str(json.dumps({"serial": serial, **fields}))
                    return (await told(socket, "reply", serial=serial))["error"]

                for folder in ("hall", "nowhere", "../yard", "other"):
                    assert await command(type="open_project", folder=folder) != ""
                assert await command(type="take_control") == ""
                assert "in control" in await command(type="open_project", folder="yard")
                assert await command(type="give_up_control") == ""
                revision = (await told_document(browser, station))["revision"]
                shift = {"type": "shift", "waypoints": [0], "z_m": 0.1, "revision": revision}
                assert await command(**shift) == ""
                await socket.send_str(json.dumps({"type": "open_project", "serial": 99, "folder": "yard"}))
                while not socket.closed:
                    await asyncio.wait_for(socket.receive(), PATIENCE_S)
            second = await again(browser, station)
            assert (first["project"], second["project"]) == ("hall", "<b>yard</b>")
            assert second["station"] != first["station"]

    async def told_document(browser, station) -> dict:
        async with browser.get(f"{station.origin}/state") as answer:
            return (await answer.json())["document"]

    async def again(browser, station) -> dict:
        """As the page does when its connection closes, with the cookie that it has."""
        end_s = asyncio.get_running_loop().time() + PATIENCE_S
        while True:
            try:
                headers = {"Origin": station.origin}
                async with browser.ws_connect(f"{station.origin}/ws", headers=headers, max_msg_size=0) as socket:
                    return await told(socket, "welcome")
            except aiohttp.ClientError:
                assert asyncio.get_running_loop().time() < end_s
                await asyncio.sleep(0.2)

    with StationProcess(neighbours / "hall") as station:
        asyncio.run(visit(station))
        with open(neighbours / "hall" / ".session" / "lock") as lock:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)  # free: the first project was closed
        with pytest.raises(InputError, match="another ground station"):
            Session(project.open_project(neighbours / "yard"), Settings())
    left = Session(project.open_project(neighbours / "hall"), Settings())
    try:
        assert left.revision == 1
        assert left.document().undo == "waypoint 1 moved 0.10 m"
    finally:
        left.close()
