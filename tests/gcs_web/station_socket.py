"""Pages of a ground station over its WebSocket, without a browser."""

import asyncio
import json
from collections.abc import Callable
from contextlib import AsyncExitStack
from typing import Any

import aiohttp

from gcs_web import GroundStation
from tests.waiting import PATIENCE_S


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
