"""The web ground station while something flies: an order's way to the wire, logs of flights that end badly, a restart.

    python benchmarks/gcs_flying.py [--flights 12] [--restarts 3] [--json FILE]

Vehicles are SITL ones, the page is a WebSocket as a browser's. A flight ends by Abort, by Kill, or as its vehicle falls
silent, in turn; its log must be in the project. A restart is kill -9 of the station's process with the vehicle in the
air: the page tries again every half second, as the browser's does at first, comes in by its cookie, and aborts.
Wall times are of the machine as busy as it is.
"""

import asyncio
import contextlib
import math
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from functools import partial
from pathlib import Path

import aiohttp
import numpy as np
from gcs_station import Hall, Page, new_project, page
from report import Row, main, row

import vehicle
from firmware_bridge import SitlVehicle, controller, keys
from firmware_bridge.port import Port
from flight import Waypoints, flight_log, project
from gcs_web import GroundStation

FLIGHTS, RESTARTS, ORDERS = 12, 3, 10
_ENDS = ("abort", "kill", "lost")
_BY_ANYBODY = ("abort", "kill")
"""Orders that need neither control nor a nonce."""
_AGAIN_S, _PATIENCE_S, _BACK_WITHIN_S = 0.5, 900.0, 120.0
_LINE = np.array([[15.0, 6.0, 1.2], [14.3, 9.5, 1.6], [10.0, 10.9, 1.2]])


def hall_with_line(folder: Path) -> project.Project:
    opened = new_project(folder)
    project.save_waypoints(opened.waypoints, Waypoints(_LINE, np.full(len(_LINE), np.nan)))
    return opened


@contextlib.contextmanager
def standing(key_file: Path) -> Iterator[SitlVehicle]:
    """A vehicle below the first waypoint."""
    believed = Hall().vehicle(())
    start = vehicle.simulate.State(position_world_m=_LINE[0] * [1.0, 1.0, 0.0])
    plant = vehicle.simulate.Plant(believed, start, ground_m=0.0)
    key = keys.load_or_create(key_file)
    with SitlVehicle(plant, controller.parameters_of(believed).parameters, key=key) as simulated:
        yield simulated


async def in_the_air(of: Page) -> None:
    """Return once the vehicle is on the plan's path."""
    plan = await of.until("plan", lambda p: p["state"] in ("checked", "refused"))
    assert plan["state"] == "checked", plan["sentence"]
    await of.asked("take_control", force=True)
    await of.until("vehicle", lambda v: v["link"] == "fresh")
    prepared = await of.asked("prepare_upload")
    await of.asked("upload", nonce=prepared["nonce"])
    await of.asked("order", order="start", nonce=(await of.asked("prepare_order"))["nonce"])
    await of.until("vehicle", lambda v: v.get("along_s") is not None)


def logs(folder: Path, count: int) -> list[Row]:
    """Flights that end badly, and how many of them left a log of what was flown."""
    opened, kept = hall_with_line(folder), 0
    for number in range(count):
        end = _ENDS[number % len(_ENDS)]
        known = set(opened.flights())
        with contextlib.ExitStack() as vehicles:
            url = vehicles.enter_context(standing(folder / "link.key")).url
            station = GroundStation(opened.folder, vehicle_url=url, key_file=folder / "link.key", triangles=500)
            with station:
                asyncio.run(ended(station, end, vehicles))
                until_s = time.monotonic() + _PATIENCE_S
                while not (new := set(opened.flights()) - known) and time.monotonic() < until_s:
                    time.sleep(0.1)
        good = any(flight_log.load(file).vector("position_world_m")[:, 2].max() > 0.5 for file in new)
        kept += good
        print(f"flight {number + 1} ({end}): {'a log' if good else 'NO LOG'}", file=sys.stderr)
    return [row(f"flights aborted, killed or lost with a log, of {count}", kept, "", f"{count}", kept == count)]


async def ended(station: GroundStation, end: str, vehicles: contextlib.ExitStack) -> None:
    async with page(station.url) as of:
        await in_the_air(of)
        if end == "lost":
            vehicles.close()
            await of.until("vehicle", lambda v: v["link"] == "lost")
        else:
            await of.asked(end)


def to_the_wire(folder: Path) -> list[Row]:
    """From a page's word to the datagram that leaves for the vehicle."""
    opened, sent_s = hall_with_line(folder), []
    with (
        standing(folder / "link.key") as simulated,
        GroundStation(opened.folder, vehicle_url=simulated.url, key_file=folder / "link.key", triangles=500) as station,
    ):
        waits = asyncio.run(acts(station, sent_s))
    worst_s = max(waits)
    return [
        row(
            f"pause, resume, land, abort, kill: page to the wire, worst of {len(waits)}",
            worst_s,
            "s",
            "<= 0.1",
            worst_s <= 0.1,
        )
    ]


async def acts(station: GroundStation, sent_s: list[float]) -> list[float]:
    waits = []
    async with page(station.url) as of:
        await in_the_air(of)
        with heard_commands(sent_s):
            for order in [*("pause", "resume") * (ORDERS // 2), "land", "abort", "kill"]:
                ordered = order not in _BY_ANYBODY
                nonce = (await of.asked("prepare_order"))["nonce"] if ordered else ""
                sent_s.clear()
                begun_s = time.perf_counter()
                await (of.command("order", order=order, nonce=nonce) if ordered else of.command(order))
                waits.append((sent_s or [math.inf])[0] - begun_s)
    return waits


@contextlib.contextmanager
def heard_commands(sent_s: list[float]) -> Iterator[None]:
    """Note when a command leaves for the vehicle."""
    send = Port.send

    def noted(self: Port, message: object) -> None:
        send(self, message)  # pyright: ignore[reportArgumentType]
        if type(message).__name__ == "MissionCommand":
            sent_s.append(time.perf_counter())

    Port.send = noted
    try:
        yield
    finally:
        Port.send = send


def restarted_in_flight(folder: Path, count: int) -> list[Row]:
    """A station that is killed in flight and started again: until the page is back, and Abort is heard."""
    opened, backs_s, started_s, aborted = hall_with_line(folder), [], [], 0
    for _ in range(count):
        with standing(folder / "link.key") as simulated:
            command = [sys.executable, "-u", "-m", "goshawk", "gcs", str(opened.folder), "--url", simulated.url,
                       "--key", str(folder / "link.key"), "--triangles", "500"]  # fmt: skip
            back_s, start_s, done = asyncio.run(restarted(command))
        backs_s.append(back_s)
        started_s.append(start_s)
        aborted += done
    back_s, start_s = max(backs_s), max(started_s)
    return [
        row(
            f"page back after the station listens again (its start not counted), worst of {count}",
            back_s,
            "s",
            "<= 3",
            back_s <= 3.0,
        ),
        row("start of the station's process until it listens, worst", start_s, "s"),
        row("Abort heard after the restart", aborted, "", f"{count}", aborted == count),
    ]


async def restarted(command: list[str]) -> tuple[float, float, bool]:
    """Seconds from listening to back, and from start to listening; whether Abort brought the vehicle down."""
    first, url = started([*command, "--port", "0"])
    origin = url.split("/?")[0]
    async with aiohttp.ClientSession(cookie_jar=aiohttp.CookieJar(unsafe=True)) as browser:
        async with browser.get(url, allow_redirects=False):
            pass
        async with browser.ws_connect(f"{origin}/ws", headers={"Origin": origin}, max_msg_size=0) as socket:
            await in_the_air(Page(socket))
            first.kill()
            first.wait()
        begun_s = time.perf_counter()
        second, _ = started([*command, "--port", origin.rpartition(":")[2]])
        listens_s = time.perf_counter()
        try:
            back_s, aborted = await back(browser, origin, listens_s)
            return back_s, listens_s - begun_s, aborted
        finally:
            second.terminate()
            second.wait()


async def back(browser: aiohttp.ClientSession, origin: str, listens_s: float) -> tuple[float, bool]:
    """Seconds since the station listened, and whether Abort was heard: a slow start finds the vehicle landed."""
    while time.perf_counter() - listens_s < _BACK_WITHIN_S:
        try:
            async with browser.ws_connect(f"{origin}/ws", headers={"Origin": origin}, max_msg_size=0) as socket:
                of = Page(socket)
                await of.until("vehicle", lambda v: v["link"] == "fresh")
                back_s = time.perf_counter() - listens_s
                if (await of.command("abort"))["error"]:
                    return back_s, False
                await of.until("vehicle", lambda v: v["mission"] in ("landing", "disarmed"))
                return back_s, True
        except aiohttp.ClientError:
            await asyncio.sleep(_AGAIN_S)
    return math.inf, False


def started(command: list[str]) -> tuple[subprocess.Popen[str], str]:
    process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
    assert process.stdout is not None
    for line in process.stdout:
        if "token=" in line:
            return process, line.split()[-1]
    raise RuntimeError("the station did not start")


def rows(flights: int = FLIGHTS, restarts: int = RESTARTS) -> list[Row]:
    with tempfile.TemporaryDirectory() as name:
        folder, found = Path(name), []
        for part, measured in (
            ("wire", to_the_wire),
            ("logs", partial(logs, count=flights)),
            ("restart", partial(restarted_in_flight, count=restarts)),
        ):
            (folder / part).mkdir()
            found += measured(folder / part)
            print(*found, sep="\n", file=sys.stderr, flush=True)  # so that what is cut off has shown something
        return found


if __name__ == "__main__":
    main(rows, flights=FLIGHTS, restarts=RESTARTS)
