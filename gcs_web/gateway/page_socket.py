"""One page's WebSocket: commands in, each checked; messages out, newest state first.

Commands are answered in their order, except that what waits for the vehicle is done beside them, questions among
themselves, and emergencies at once: reading goes on whatever is being done.
"""

import asyncio
import logging
import secrets
from collections.abc import Callable, Mapping
from concurrent.futures import ThreadPoolExecutor
from typing import TYPE_CHECKING, Any, Union

import msgspec

from flight import FlightError
from flight.project import Project
from gcs_web.gateway.hub import Client, Hub
from gcs_web.protocol.base import Command, Question, VehicleCommand
from gcs_web.protocol.people import PROTOCOL, Person, Welcome
from gcs_web.protocol.reply import Reply
from gcs_web.protocol.vehicle import Abort, Kill
from gcs_web.protocol.wording import for_page

if TYPE_CHECKING:
    from aiohttp import web

logger = logging.getLogger(__name__)

MOST_APART = 8
"""Commands of one page that may wait for the vehicle at a time; with its emergencies twice as many."""
MOST_IN_LINE = 256
"""Other commands of one page, and its questions, that may wait at a time."""
EMERGENCY = (Abort, Kill)
"""Never wait behind other commands."""


class PageSocket:
    """Serves the pages of one project."""

    def __init__(
        self,
        hub: Hub,
        handlers: Mapping[type[Command], Callable[[Person, Any], Reply | None]],
        *,
        project: Project,
        arrived: Callable[[], None],
        left: Callable[[Person], None],
    ) -> None:
        """
        Args:
            handlers: by command, what does it, in a thread; a reply only where it has something to say. Raises
                `FlightError` to refuse it.
            arrived, left: called when somebody opened or closed the page.
        """
        self._hub, self._handlers = hub, handlers
        self._decoder: msgspec.json.Decoder[Command] = msgspec.json.Decoder(Union[tuple(handlers)])  # noqa: UP007
        self._project, self._folder, self._arrived, self._left = project.name, project.folder, arrived, left
        self._id = secrets.token_hex(8)
        self._for_emergencies = ThreadPoolExecutor(2, "abort")  # never behind other work
        self._for_questions = ThreadPoolExecutor(2, "question")  # nothing behind them

    async def serve(self, socket: "web.WebSocketResponse", is_here: bool) -> None:
        """Talk to one page, which may be on the station's own machine, until it leaves."""
        client = self._hub.join(here=is_here)
        welcome = Welcome(PROTOCOL, client.person.id, self._project, self._id)
        writer = asyncio.create_task(_write(socket, client, welcome))
        await asyncio.to_thread(self._arrived)
        apart: set[asyncio.Task[None]] = set()
        line, questions = (asyncio.Queue[str](MOST_IN_LINE) for _ in range(2))
        workers = [asyncio.create_task(self._work(client, queue, apart)) for queue in (line, questions)]
        try:
            async for message in socket:
                if message.type.name != "TEXT":
                    break
                if self._names(message.data, EMERGENCY):
                    self._start(client, message.data, apart, 2 * MOST_APART)
                else:
                    self._enqueue(client, message.data, questions if self._names(message.data, Question) else line)
            await line.join()  # who left has sent it all the same
        finally:
            for task in (writer, *workers):
                task.cancel()
            self._hub.leave(client)
            await asyncio.to_thread(self._left, client.person)

    def _enqueue(self, client: Client, text: str, queue: asyncio.Queue[str]) -> None:
        try:
            queue.put_nowait(text)
        except asyncio.QueueFull:
            self._refuse(client, text, f"{MOST_IN_LINE} commands of this page still wait; nothing was done")

    async def _work(self, client: Client, queue: asyncio.Queue[str], apart: set[asyncio.Task[None]]) -> None:
        """Do commands in their order; those for the vehicle are begun in it."""
        while True:
            text = await queue.get()
            if self._names(text, VehicleCommand):
                self._start(client, text, apart, MOST_APART)
            else:
                await self._command(client, text)
            queue.task_done()

    def _start(self, client: Client, text: str, apart: set[asyncio.Task[None]], most: int) -> None:
        if len(apart) >= most:
            said = f"{len(apart)} orders of this page still wait for the vehicle; nothing was sent"
            self._refuse(client, text, said)
            return
        task = asyncio.create_task(self._command(client, text))
        apart.add(task)
        task.add_done_callback(apart.discard)

    def _refuse(self, client: Client, text: str, said: str) -> None:
        self._hub.publish(Reply(_serial(text), error=said), client.person.id)

    async def _command(self, client: Client, text: str) -> None:
        try:
            command = self._decoder.decode(text)
        except msgspec.DecodeError as error:
            reply = Reply(_serial(text), error=f"the page sent what this station does not understand: {error}")
        else:
            reply = await asyncio.get_running_loop().run_in_executor(
                self._pool(command), self._done, client.person, command
            )
        self._hub.publish(reply, client.person.id)

    def _pool(self, command: Command) -> ThreadPoolExecutor | None:
        if isinstance(command, EMERGENCY):
            return self._for_emergencies
        return self._for_questions if isinstance(command, Question) else None

    def _done(self, person: Person, command: Command) -> Reply:
        try:
            return self._handlers[type(command)](person, command) or Reply(command.serial)
        except FlightError as error:
            return Reply(command.serial, error=for_page(str(error), self._folder))
        except Exception as error:  # a page must not be able to take the station down
            logger.exception("%s failed", type(command).__name__)
            return Reply(command.serial, error=f"internal error: {error}; the station's log has more")

    def _names(self, text: str, kind: type[Command] | tuple[type[Command], ...]) -> bool:
        return _head(text).type in {each.__struct_config__.tag for each in self._handlers if issubclass(each, kind)}


async def _write(socket: "web.WebSocketResponse", client: Client, welcome: Welcome) -> None:
    await socket.send_str(msgspec.json.encode(welcome).decode())
    while True:
        await client.arrived.wait()
        if client.lagging:
            await socket.close(message=b"this page is too slow; it comes back for the newest state")
            return
        for message in client.take():
            await socket.send_str(message.decode())


class _Head(msgspec.Struct):
    type: str = ""
    serial: int = 0


def _head(text: str) -> _Head:
    try:
        return msgspec.json.decode(text, type=_Head)
    except msgspec.DecodeError:
        return _Head()


def _serial(text: str) -> int:
    return _head(text).serial
