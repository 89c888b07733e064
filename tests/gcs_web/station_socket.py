"""Pages of a ground station over its WebSocket, without a browser, and a SITL vehicle that really flies."""

import asyncio
import json
import shutil
from collections.abc import Callable, Iterator
from contextlib import AsyncExitStack, contextmanager
from pathlib import Path
from typing import Any

import aiohttp
import numpy as np

import vehicle
from firmware_bridge import SitlVehicle, controller, keys
from flight import Waypoints, project
from gcs_web import GroundStation
from tests.waiting import PATIENCE_S

START = np.array([[0.8, 0.8, 1.0], [3.0, 2.0, 1.2], [5.2, 0.8, 1.2]])


@contextmanager
def serving(pillar_map: Path, folder: Path) -> Iterator[GroundStation]:
    """A station of a new project with the vehicle on the ground below the first waypoint."""
    opened = project.create(folder, "two pillars")
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


def start_again(station: GroundStation) -> None:
    """The same waypoints, whatever was edited before."""
    station.desk.session.take(Waypoints(START, np.full(len(START), np.nan)), "test begins", "test")


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
