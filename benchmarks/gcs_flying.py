"""The web ground station while something flies: an order's way to the wire, logs of flights that end badly, a restart.

    python benchmarks/gcs_flying.py [--flights 12] [--restarts 3] [--only PART] [--json FILE]

The parts are `wire`, `logs` and `restart`.

Vehicles are SITL ones, the page is a WebSocket as a browser's. A flight ends by Abort, by Kill, or as its vehicle falls
silent, in turn; its log must be in the project. A restart is kill -9 of the station's process with the vehicle in the
air, and a start at once: the page tries again every quarter of a second, as the browser's does, and aborts.
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
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import aiohttp
import numpy as np
from gcs_station import Hall, Page, StationProcess, new_project, page
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
_LANES = 4
"""Flights at a time: a lost one waits for the autopilot's own policy, which costs time and no work."""
_AGAIN_S, _PATIENCE_S, _BACK_WITHIN_S = 0.25, 900.0, 120.0
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
    """Flights that end badly, and how many of them left a log of what was flown: `_LANES` at a time."""
    lanes = [range(lane, count, _LANES) for lane in range(min(_LANES, count))]
    with ThreadPoolExecutor(len(lanes)) as pool:
        kept = sum(pool.map(lambda lane: logs_of(folder / f"lane{lane[0]}", lane), lanes))
    return [row(f"flights aborted, killed or lost with a log, of {count}", kept, "", f"{count}", kept == count)]


def logs_of(folder: Path, numbers: range) -> int:
    """One flight after the other in a project of their own; how many left a log."""
    folder.mkdir()
    opened, kept = hall_with_line(folder), 0
    for number in numbers:
        end = _ENDS[number % len(_ENDS)]
        good = leaves_log(opened, folder / "link.key", end)
        kept += good
        print(f"flight {number + 1} ({end}): {'a log' if good else 'NO LOG'}", file=sys.stderr, flush=True)
    return kept


def leaves_log(opened: project.Project, key_file: Path, end: str) -> bool:
    """Whether the project has a new log that shows the vehicle in the air."""
    known = set(opened.flights())
    with contextlib.ExitStack() as vehicles:
        url = vehicles.enter_context(standing(key_file)).url
        with GroundStation(opened.folder, vehicle_url=url, key_file=key_file, triangles=500) as station:
            asyncio.run(ended(station, end, vehicles))
            until_s = time.monotonic() + _PATIENCE_S
            while not (new := set(opened.flights()) - known) and time.monotonic() < until_s:
                time.sleep(0.1)
    return any(flight_log.load(file).vector("position_world_m")[:, 2].max() > 0.5 for file in new)


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


@dataclass(frozen=True, slots=True)
class Restart:
    """Times since the first station was killed, s; the next one is started at once."""

    listens_s: float
    back_s: float
    """The page has a fresh state of the vehicle."""
    aborted_s: float
    """The vehicle says that it lands."""
    cpu_s: float
    """What the new station's process had worked by then; no less passes on a quiet machine."""


def restarted_in_flight(folder: Path, count: int) -> list[Row]:
    """A station that is killed in flight and started again: until the page is back, and Abort is heard."""
    opened, found = hall_with_line(folder), []
    for _ in range(count):
        with standing(folder / "link.key") as simulated:
            command = [sys.executable, "-u", "-m", "goshawk", "gcs", str(opened.folder), "--url", simulated.url,
                       "--key", str(folder / "link.key"), "--triangles", "500"]  # fmt: skip
            found.append(asyncio.run(restarted(command)))
        print(found[-1], file=sys.stderr, flush=True)
    worst = max(found, key=lambda one: one.aborted_s)
    heard = sum(math.isfinite(one.aborted_s) for one in found)
    peers = {"listens": worst.listens_s, "page back": worst.back_s, "CPU s": worst.cpu_s}
    name = f"kill -9 and restart in flight until Abort is heard, worst of {count}"
    return [
        row(name, worst.aborted_s, "s", "<= 3", worst.aborted_s <= 3.0, peers=peers),
        row("Abort heard after the restart", heard, "", f"{count}", heard == count),
    ]


async def restarted(command: list[str]) -> Restart:
    first, url = started([*command, "--port", "0"])
    origin = url.split("/?")[0]
    async with aiohttp.ClientSession(cookie_jar=aiohttp.CookieJar(unsafe=True)) as browser:
        async with browser.get(url, allow_redirects=False):
            pass
        async with browser.ws_connect(f"{origin}/ws", headers={"Origin": origin}, max_msg_size=0) as socket:
            await in_the_air(Page(socket))
            first.kill()
            begun_s = time.perf_counter()
            first.wait()
        second = subprocess.Popen(
            [*command, "--port", origin.rpartition(":")[2]], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL
        )
        try:
            return await back(browser, origin, begun_s, second.pid)
        finally:
            second.terminate()
            second.wait()


async def back(browser: aiohttp.ClientSession, origin: str, begun_s: float, pid: int) -> Restart:
    """Try again as the page does; no Abort is heard where the start took so long that the vehicle has landed."""
    listens_s = back_s = aborted_s = math.inf
    while time.perf_counter() - begun_s < _BACK_WITHIN_S and math.isinf(back_s):
        try:
            async with browser.ws_connect(f"{origin}/ws", headers={"Origin": origin}, max_msg_size=0) as socket:
                listens_s = time.perf_counter() - begun_s
                of = Page(socket)
                await of.until("vehicle", lambda v: v["link"] == "fresh")
                back_s = time.perf_counter() - begun_s
                if not (await of.command("abort"))["error"]:
                    await of.until("vehicle", lambda v: v["mission"] in ("landing", "disarmed"))
                    aborted_s = time.perf_counter() - begun_s
        except aiohttp.ClientError:
            await asyncio.sleep(_AGAIN_S)
    return Restart(listens_s, back_s, aborted_s, StationProcess(origin, pid).cpu_s)


def started(command: list[str]) -> tuple[subprocess.Popen[str], str]:
    process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
    assert process.stdout is not None
    for line in process.stdout:
        if "token=" in line:
            return process, line.split()[-1]
    raise RuntimeError("the station did not start")


def rows(flights: int = FLIGHTS, restarts: int = RESTARTS, only: str = "") -> list[Row]:
    parts = {
        "wire": to_the_wire,
        "logs": partial(logs, count=flights),
        "restart": partial(restarted_in_flight, count=restarts),
    }
    with tempfile.TemporaryDirectory() as name:
        folder, found = Path(name), []
        for part in [only] if only else parts:
            (folder / part).mkdir()
            found += parts[part](folder / part)
            print(*found, sep="\n", file=sys.stderr, flush=True)  # so that what is cut off has shown something
        return found


if __name__ == "__main__":
    main(rows, flights=FLIGHTS, restarts=RESTARTS, only="")
