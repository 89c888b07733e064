"""The simulated body: it starts its firmware anew a few times only, and sends its poses at the rate asked for."""

import contextlib
import socket
from collections import deque
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from firmware_bridge.betaflight_sitl import body as body_module
from firmware_bridge.betaflight_sitl.body import STEP_S, Body
from firmware_bridge.betaflight_sitl.process import StalledError
from flight import LinkError


class Stalls:
    """A firmware whose lock step never begins."""

    runs = True

    def __init__(self, began) -> None:
        self._began = began

    def begins(self) -> bool:
        self._began()
        return False


class Still:
    """A plant that stays where it is."""

    position_world_m, q_world_body = np.zeros(3), np.array([1.0, 0.0, 0.0, 0.0])


STILL: Any = Still()


@pytest.fixture
def meet(monkeypatch, tmp_path):
    """Runs a body's start with firmwares that stall; how often they were started."""
    starts = []

    def met(body: Body, guard: socket.socket, server: socket.socket, *, at_start=lambda: None) -> list[int]:
        @contextlib.contextmanager
        def flying(folder):
            starts.append(1)
            yield Stalls(at_start)

        monkeypatch.setattr(body_module.process, "flying", flying)
        with contextlib.ExitStack() as stack:
            body._met(stack, tmp_path, server)
        return starts

    with socket.create_server(("127.0.0.1", 0)) as server, socket.create_connection(server.getsockname()) as guard:
        yield lambda body, **more: met(body, guard, server, **more), starts, guard


def test_a_firmware_that_always_stalls_is_given_up_after_three_starts(meet):
    met, starts, _ = meet
    with pytest.raises(StalledError, match="stalled 3 times"):
        met(Body(STILL, 1.0))
    assert len(starts) == 3


def test_it_is_not_started_again_for_nobody(meet):
    met, starts, guard = meet
    with pytest.raises(LinkError, match="the guard was gone"):
        met(Body(STILL, 1.0), at_start=guard.close)
    assert len(starts) == 1


def test_a_body_that_is_given_up_starts_nothing_more(meet):
    met, starts, _ = meet
    body = Body(STILL, 1.0)
    with pytest.raises(LinkError, match="given up"):
        met(body, at_start=lambda: setattr(body, "given_up", True))
    assert len(starts) == 1


@pytest.mark.parametrize("rate_hz", [50.0, 100.0, 200.0])
def test_poses_come_at_the_rate_asked_for(rate_hz):
    body = Body(STILL, 1.0)
    body.tracking = replace(body.tracking, period_s=1.0 / rate_hz)
    late = deque()
    for steps in range(round(2.0 / STEP_S)):
        body._see(late, steps, np.random.default_rng(0))
    assert len(late) == pytest.approx(2.0 * rate_hz, abs=1)
