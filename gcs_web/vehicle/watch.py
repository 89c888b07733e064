"""What the page needs of a vehicle, whoever's firmware flies it."""

import threading
from collections.abc import Callable
from typing import Protocol

from firmware_bridge.dialect.generated.messages import Command
from flight import FlightLog, TrajectoryFile
from gcs_web.protocol.vehicle import Held, Vehicle


class Watch(Protocol):
    """One vehicle at an address: its state, and how orders get to it."""

    @property
    def url(self) -> str: ...
    def start(self) -> None: ...
    def close(self) -> None: ...
    def state(self) -> Vehicle:
        """What the page shows of it."""
        ...

    def look_again(self) -> None:
        """Check once more what must hold before a flight, where that is not done all the time."""
        ...

    def require_fit(self) -> None:
        """
        Raises:
            LinkError: it is not fit to arm, or does not answer; the message says why.
        """
        ...

    def held(self) -> Held | None:
        """What it holds, read back from it; None for nothing."""
        ...

    def planned(self, file: TrajectoryFile, name: str) -> Held:
        """What it would hold after an upload."""
        ...

    def require_held(self, file: TrajectoryFile, name: str) -> None:
        """
        Raises:
            InputError: it must be told a plan before it flies, and does not hold this one.
        """
        ...

    def upload(self, file: TrajectoryFile, name: str, *, map_hash: str, vehicle_hash: str) -> str:
        """Send, commit, read back; one line on how it went. Raises `FlightError` where it was refused."""
        ...

    def parameters(self) -> dict[str, float]:
        """Those of our controller. Raises `FlightError` where it does not answer, or it is not ours."""
        ...

    def set_parameters(self, values: dict[str, float]) -> None:
        """All of them or none. Raises as `parameters`."""
        ...

    def order(self, command: Command) -> None:
        """Raises `FlightError` where it is refused."""
        ...

    def begin_flight(self) -> threading.Event:
        """Announce a flight before its preparations; the event gives it up. Raises `LinkError`: one is under way."""
        ...

    def end_flight(self) -> None: ...
    def fly(
        self, file: TrajectoryFile, aborted: threading.Event, ended_early: Callable[[FlightLog], None]
    ) -> FlightLog:
        """Take off, fly, land; the log. Raises `LinkError` where it ended early, after `ended_early` had the log."""
        ...

    def land(self) -> None:
        """Now, whoever has control. Raises `LinkError` where nothing flies."""
        ...

    def kill(self) -> None:
        """Stop the rotors now, in the air too. Raises `LinkError`."""
        ...
