"""A flight in a process of its own: what people want of it comes through, and nobody's silence holds it up."""

import multiprocessing
import time

import numpy as np
import pytest

from flight import FlightLog, LinkError, silent
from gcs_web.vehicle.foreign import Asked, Seen
from goshawk.commands.fly import apart

SEEN = Seen("hold", np.zeros(3), np.zeros(3), np.array([1.0, 0.0, 0.0, 0.0]))
END_S = 100.0
"""Of a flight that nobody ends, so that a failing test ends."""


def until_asked(asked, told, progress, restarted) -> tuple[FlightLog, str]:
    """Flies until somebody wants it to land, and says what else was wanted."""
    restarted()
    end_s, paused = time.monotonic() + END_S, ""
    while not asked.land.is_set() and time.monotonic() < end_s:
        told(SEEN)
        paused = paused or ("paused " if asked.pause.is_set() else "")
        time.sleep(0.001)
    words = f"{paused}{'resumed ' if not asked.pause.is_set() else ''}{'killed' if asked.kill.is_set() else ''}"
    return FlightLog({"time_s": np.zeros(1)}, {}), words


def fails(asked, told, progress, restarted) -> tuple[FlightLog, str]:
    raise ValueError("of our own")


def test_what_people_want_comes_through_and_the_log_back():
    asked, restarts = Asked(), []
    heard: list[Seen] = []

    def told(seen: Seen) -> None:
        heard.append(seen)
        if len(heard) == 3:
            asked.pause.set()
        if len(heard) == 300:
            asked.pause.clear()
        if len(heard) == 600:
            asked.kill.set()
            asked.land.set()

    log, early = apart.fly(until_asked, asked, told, silent, lambda: restarts.append(1))
    assert early == "paused resumed killed"
    assert len(log.time_s) == 1
    assert restarts == [1]


def test_an_error_of_the_flight_is_said_as_one_of_the_link():
    with pytest.raises(LinkError, match="of our own"):
        apart.fly(fails, Asked(), lambda _: None, silent)


def test_a_station_that_hangs_holds_up_nothing_and_one_that_dies_lands_it():
    context = multiprocessing.get_context("spawn")
    ours, theirs = context.Pipe()
    process = context.Process(target=apart.main, args=(until_asked, theirs), daemon=True)
    process.start()
    theirs.close()
    assert ours.recv() == "restart"
    ours.send("restarted")
    ours.recv()  # it flies; from here on nobody reads
    ours.close()
    process.join(END_S / 2)
    assert process.exitcode == 0
