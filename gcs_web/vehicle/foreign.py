"""A vehicle of other firmware, as whoever knows that firmware hands it to the page."""

import threading
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Protocol

from firmware_bridge.arming import ArmingCheck
from flight import FlightLog, FloatArray, Progress, TrajectoryFile
from gcs_web.protocol.vehicle import Failsafe
from vehicle import Vehicle


@dataclass(frozen=True, slots=True)
class Looked:
    """What was read of it on the ground."""

    firmware: str
    checks: Sequence[ArmingCheck]
    failsafes: Sequence[Failsafe]
    kill: str
    """What Kill does to it, and where it cannot."""
    armed: bool | None = None
    """None: it did not tell."""


@dataclass(frozen=True, slots=True)
class Seen:
    """One moment of its flight, by what the station flies it by."""

    mission: str
    position_world_m: FloatArray
    """(3,)."""
    velocity_world_m_s: FloatArray
    """(3,)."""
    q_world_body: FloatArray
    """(4,) w x y z."""
    battery_v: float = 0.0
    """0: not measured."""
    along_s: float | None = None
    """Time along the trajectory, while it is flown."""
    armed: bool = True
    """By the firmware's last word."""
    down: bool = False
    """Its rotors are told to stand still."""


@dataclass(slots=True)
class Asked:
    """What people want of a flight that is under way; thread-safe."""

    land: threading.Event = field(default_factory=threading.Event)
    kill: threading.Event = field(default_factory=threading.Event)
    pause: threading.Event = field(default_factory=threading.Event)
    """Set for as long as it is to pause."""


class Flyer(Protocol):
    """One vehicle of other firmware. Neither call is made while another runs."""

    @property
    def can_pause(self) -> bool: ...
    def look(self) -> Looked:
        """Read what must hold before it is armed. Raises `FlightError` where nothing answers."""
        ...

    def fly(
        self, file: TrajectoryFile, asked: Asked, told: Callable[[Seen], None], progress: Progress
    ) -> tuple[FlightLog, str]:
        """Check, arm, take off, fly, land.

        Returns:
            The log, and why the flight ended early: empty if it did not.

        Raises:
            FlightError: it never left the ground.
        """
        ...


NewFlyer = Callable[[str, str, Callable[[], Vehicle]], Flyer | None]
"""Of an address, that of its poses (empty: the usual one), and the project's vehicle, which may change.

None for the address of a vehicle that our controller flies; raises `InputError` where it is none.
"""
