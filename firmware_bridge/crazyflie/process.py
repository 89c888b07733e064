"""A Crazyflie's flight in a process of its own: if the one that asked for it dies, it lands.

The Crazyflie itself flies on without its ground station, so something must outlive whoever waits for the flight.
"""

import contextlib
import math
import time
from collections.abc import Callable
from dataclasses import dataclass
from multiprocessing.connection import Connection

from firmware_bridge.crazyflie.client import Client
from firmware_bridge.crazyflie.crtp import UdpTransport, endpoint
from firmware_bridge.crazyflie.flight import Flight, Seen
from firmware_bridge.own_process import begun, has_room, outlive_the_terminal
from flight import FlightError, FlightLog, LinkError, Progress, Trajectory

_POLL_S = 0.1
_TELL_S = 0.1
_CANCEL, _STOP = "cancel", "stop"


@dataclass(frozen=True, slots=True)
class Order:
    """What is to be flown."""

    address: str
    plan: Trajectory
    arms: bool
    motor_of_rotor: tuple[int, ...]


@dataclass(frozen=True, slots=True)
class Flown:
    """How it ended."""

    log: FlightLog
    ended_early: str


class _Asked:
    """What the other process wants; a dead one wants it to land."""

    def __init__(self, line: Connection) -> None:
        self._line, self._heard = line, set[str]()

    def _hear(self) -> set[str]:
        try:
            while self._line.poll():
                self._heard.add(self._line.recv())
        except (EOFError, OSError):
            self._heard.add(_CANCEL)
        return self._heard

    def cancel(self) -> bool:
        return _CANCEL in self._hear()

    def stop(self) -> bool:
        return _STOP in self._hear()


def fly(
    order: Order, *, progress: Progress, cancel: Callable[[], bool], stop: Callable[[], bool] = lambda: False,
    told: Callable[[Seen], None] = lambda _: None,
) -> tuple[FlightLog, str]:  # fmt: skip
    """Fly in a process of its own. A second Ctrl-C is an emergency stop.

    Args:
        stop: rotors off now, wherever it is.
        told: is given what was logged, ten times a second.

    Returns:
        The log, and why the flight ended early: empty if it did not.

    Raises:
        InputError: the address is none.
        LinkError: it never left the ground.
    """
    endpoint(order.address)
    with begun(_main, order, name="crazyflie") as line:
        return _until_flown(line, progress, cancel, stop, told)


def _until_flown(
    line: Connection, progress: Progress, cancel: Callable[[], bool], stop: Callable[[], bool],
    told: Callable[[Seen], None],
) -> tuple[FlightLog, str]:  # fmt: skip
    sent = set[str]()
    while True:
        try:
            for word, asked in ((_STOP, stop), (_CANCEL, cancel)):
                if word not in sent and asked():
                    sent.add(word)
                    line.send(word)
            if not line.poll(_POLL_S):
                continue
            said = line.recv()
        except KeyboardInterrupt:
            line.send(_STOP)
            continue
        except (EOFError, OSError) as error:
            raise LinkError("the process that flew the Crazyflie ended") from error
        if isinstance(said, Flown):
            return said.log, said.ended_early
        if isinstance(said, FlightError):
            raise said
        if isinstance(said, Seen):
            told(said)
        else:
            progress(*said)


def _main(order: Order, line: Connection) -> None:
    outlive_the_terminal()

    def tell(what: object) -> None:
        with contextlib.suppress(OSError):  # nobody waits any more
            line.send(what)

    def tell_if_heard(what: object) -> None:
        """In flight: whoever does not listen holds up no flight, and misses this."""
        if has_room(line):
            tell(what)

    asked, transport = _Asked(line), UdpTransport(*endpoint(order.address))
    told_s = [-math.inf]

    def stop() -> bool:
        """Asked at every wait: so often it is told what is seen, too."""
        if time.monotonic() - told_s[0] >= _TELL_S and (seen := flight.seen()) is not None:
            told_s[0] = time.monotonic()
            tell_if_heard(seen)
        return asked.stop()

    flight = Flight(
        Client(transport), order.plan, arms=order.arms,
        progress=lambda stage, fraction: tell_if_heard((stage, fraction)),
        cancel=asked.cancel, stop=stop, motor_of_rotor=order.motor_of_rotor,
    )  # fmt: skip
    try:
        log = flight.fly()
        tell(Flown(log, flight.ended_early))
    except FlightError as error:
        tell(error)
    finally:
        transport.close()
