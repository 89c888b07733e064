"""The people who have the page open, and what each of them still has to be told.

Every message of a kind replaces the one before (a document, a plan, the vehicle's state), so that a slow browser is
told the newest and the server's memory stays bounded; notices and replies are kept in their order.
"""

import asyncio
import secrets
from dataclasses import dataclass, field

import msgspec

from gcs_web.protocol.base import Message, State
from gcs_web.protocol.people import Notice, Person

MOST_WAITING = 1000
"""Replies and notices that may wait for one browser; then it is cut off and comes back for the newest state."""


@dataclass(slots=True)
class Client:
    """One open page."""

    person: Person
    waiting: dict[str, bytes] = field(default_factory=dict[str, bytes])
    arrived: asyncio.Event = field(default_factory=asyncio.Event)
    lagging: bool = False

    def put(self, message: Message, serial: int) -> None:
        key = type(message).__name__ if isinstance(message, State) else f"{serial}"
        self.waiting.pop(key, None)
        self.waiting[key] = msgspec.json.encode(message)
        self.lagging = len(self.waiting) > MOST_WAITING
        self.arrived.set()

    def take(self) -> list[bytes]:
        taken = list(self.waiting.values())
        self.waiting.clear()
        self.arrived.clear()
        return taken


class Hub:
    """All clients; `publish` may be called from any thread, everything else from the event loop's."""

    def __init__(self, loop: asyncio.AbstractEventLoop) -> None:
        self._loop = loop
        self._clients: dict[str, Client] = {}
        self._newest: dict[type, Message] = {}
        self._joined = 0
        self._serial = 0

    @property
    def people(self) -> list[Person]:
        return [client.person for client in list(self._clients.values())]

    def join(self, *, here: bool = False) -> Client:
        """A new page, with all it has to know waiting for it; `here` on the station's own machine."""
        self._joined += 1
        client = Client(Person(secrets.token_hex(8), f"Pilot {self._joined}", here))
        self._clients[client.person.id] = client
        for message in list(self._newest.values()):
            self._put(client, message)
        return client

    def leave(self, client: Client) -> None:
        self._clients.pop(client.person.id, None)

    def publish(self, message: Message, to: str = "") -> None:
        """Send to everybody, or to one person."""
        self._loop.call_soon_threadsafe(self._publish, message, to)

    def _publish(self, message: Message, to: str) -> None:
        if isinstance(message, State) or (isinstance(message, Notice) and not to):
            self._newest[type(message)] = message
        for name, client in self._clients.items():
            if to in ("", name):
                self._put(client, message)

    def _put(self, client: Client, message: Message) -> None:
        self._serial += 1
        client.put(message, self._serial)
