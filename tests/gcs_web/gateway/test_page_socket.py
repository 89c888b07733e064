"""What a page sends is read on whatever is being done: an emergency waits for nothing."""

import asyncio
import json
import threading
from collections.abc import AsyncIterator, Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import pytest

from flight.project import Project
from gcs_web.gateway.hub import Hub
from gcs_web.gateway.page_socket import MOST_IN_LINE, PageSocket
from gcs_web.protocol.flights import ListFlights, ReadSpectrum
from gcs_web.protocol.vehicle import Abort

SPECTRUM = {"type": "read_spectrum", "flight": "a", "stream": "speed", "from_s": 0, "to_s": 1}
LIST, ABORT = {"type": "list_flights"}, {"type": "abort"}


class Socket:
    """A browser that sends commands, then stays until it is let go."""

    def __init__(self, commands: list[dict[str, Any]], until: Callable[[], bool]) -> None:
        self._commands, self._until = commands, until
        self.said: list[dict[str, Any]] = []

    async def send_str(self, text: str) -> None:
        self.said.append(json.loads(text))

    async def __aiter__(self) -> AsyncIterator[SimpleNamespace]:
        for serial, command in enumerate(self._commands):
            yield SimpleNamespace(type=SimpleNamespace(name="TEXT"), data=json.dumps({**command, "serial": serial}))
        while not self._until():
            await asyncio.sleep(0.01)


def serve(socket: Socket, handlers: dict[type, Callable[..., Any]], folder: Path) -> None:
    async def talk() -> None:
        project = cast(Project, SimpleNamespace(name="hall", folder=folder))
        pages = PageSocket(
            Hub(asyncio.get_running_loop()), handlers, project=project, arrived=lambda: None, left=lambda _: None
        )
        await asyncio.wait_for(pages.serve(cast(Any, socket), False), 60.0)

    asyncio.run(talk())


@pytest.mark.parametrize("slow", [SPECTRUM, LIST])
def test_an_abort_waits_for_nothing_else_of_its_page(slow: dict[str, Any], tmp_path: Path):
    aborted, done = threading.Event(), []

    def wait(_: object, __: object) -> None:
        done.append(aborted.wait(20.0))

    handlers = {ReadSpectrum: wait, ListFlights: wait, Abort: lambda _, __: aborted.set()}
    serve(Socket([slow, slow, slow, ABORT], until=lambda: len(done) == 3), handlers, tmp_path)
    assert done == [True, True, True]


def test_what_changes_something_is_done_in_its_order_and_waits_for_no_question(tmp_path: Path):
    last, done = threading.Event(), []

    def take(_: object, wanted: ListFlights) -> None:
        done.append(wanted.serial)
        if len(done) == 5:
            last.set()

    answered: list[bool] = []
    handlers = {ReadSpectrum: lambda _, __: answered.append(last.wait(20.0)), ListFlights: take}
    serve(Socket([SPECTRUM, *5 * [LIST]], until=lambda: bool(answered)), handlers, tmp_path)
    assert done == [1, 2, 3, 4, 5]
    assert answered == [True]


def test_a_page_that_sends_more_than_is_done_is_told_so(tmp_path: Path):
    more = threading.Event()

    def told() -> bool:
        if any("nothing was done" in str(message) for message in socket.said):
            more.set()
        return more.is_set()

    socket = Socket((MOST_IN_LINE + 2) * [LIST], until=told)
    serve(socket, {ListFlights: lambda _, __: more.wait(20.0)}, tmp_path)
    assert more.is_set()


def test_what_was_sent_before_a_page_left_is_done(tmp_path: Path):
    done: list[int] = []
    serve(Socket(20 * [LIST], lambda: True), {ListFlights: lambda _, wanted: done.append(wanted.serial)}, tmp_path)
    assert done == list(range(20))
