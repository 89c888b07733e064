"""A flight from the page in a process of its own: what loads the station's interpreter does not slow its loop down.

If the station dies or hangs, the vehicle lands.
"""

import contextlib
import threading
from collections.abc import Callable
from multiprocessing.connection import Connection
from typing import cast

from firmware_bridge.own_process import begun, has_room, outlive_the_terminal
from flight import FlightError, FlightLog, LinkError, Progress
from gcs_web.vehicle.foreign import Asked, Seen

_POLL_S = 0.02
_RESTART, _RESTARTED, _RESUME = "restart", "restarted", "resume"
_LAND, _KILL, _PAUSE = "land", "kill", "pause"
Told = Callable[[Seen], None]
Restarted = Callable[[], object]
Work = Callable[[Asked, Told, Progress, Restarted], tuple[FlightLog, str]]
"""The flight, which can be pickled."""


def fly(
    work: Work, asked: Asked, told: Told, progress: Progress, restarted: Restarted = lambda: None
) -> tuple[FlightLog, str]:
    """
    Args:
        restarted: of `offboard.fly`; it is called here.

    Raises:
        LinkError: it never left the ground, or its process ended.
    """
    with begun(main, work, name="flight") as line:
        return _until_flown(line, asked, told, progress, restarted)


def _until_flown(
    line: Connection, asked: Asked, told: Told, progress: Progress, restarted: Restarted
) -> tuple[FlightLog, str]:
    sent: dict[str, bool] = dict.fromkeys((_LAND, _KILL, _PAUSE), False)
    try:
        while True:
            _pass_on(line, asked, sent)
            if not line.poll(_POLL_S):
                continue
            said = line.recv()
            if isinstance(said, Seen):
                told(said)
            elif said == _RESTART:
                restarted()
                line.send(_RESTARTED)
            elif isinstance(said, LinkError):
                raise said
            elif isinstance(said[0], FlightLog):
                return cast(tuple[FlightLog, str], said)
            else:
                progress(*said)
    except (EOFError, OSError) as error:
        raise LinkError("the process that flew the vehicle ended; its guard brings it down") from error


def _pass_on(line: Connection, asked: Asked, sent: dict[str, bool]) -> None:
    for word, event in ((_KILL, asked.kill), (_LAND, asked.land), (_PAUSE, asked.pause)):
        if event.is_set() is not sent[word]:
            sent[word] = event.is_set()
            line.send(word if sent[word] else _RESUME)


def _hear(line: Connection, asked: Asked, restarted: threading.Event) -> None:
    """What people want, until nobody is there who could want anything: then it lands."""
    events = {_LAND: asked.land, _KILL: asked.kill, _PAUSE: asked.pause, _RESTARTED: restarted}
    try:
        while True:
            word = line.recv()
            asked.pause.clear() if word == _RESUME else events[word].set()
    except (EOFError, OSError):
        asked.land.set()
        restarted.set()


def main(work: Work, line: Connection) -> None:
    outlive_the_terminal()
    asked, restarted = Asked(), threading.Event()
    threading.Thread(target=_hear, args=(line, asked, restarted), name="hear", daemon=True).start()

    def tell(what: object) -> None:
        """In flight: a station that does not listen misses it."""
        with contextlib.suppress(OSError):
            if has_room(line):
                line.send(what)

    def restart() -> None:
        line.send(_RESTART)
        restarted.wait()

    ended: object
    try:
        ended = work(asked, tell, lambda stage, fraction: tell((stage, fraction)), restart)
    except FlightError as error:
        ended = LinkError(str(error))
    except Exception as error:
        ended = LinkError(f"the flight failed: {error!r}")
    with contextlib.suppress(OSError):  # the station is gone
        line.send(ended)
