"""The web ground station: how fast an edit lasts and reaches everybody, and what kill -9 loses.

    python benchmarks/gcs.py [--kills 1000] [--flights 60] [--json FILE]

The parts for recorded flights and for large maps run alone as well: `gcs_flights.py`, `gcs_scene.py`.

Beside ours in the same process: the physical limit, an append of the same bytes with fsync; for a plan after an edit,
the same from scratch. A plan is all that the planning process does for the page: path, gate, series, limits. No browser
takes part: the people are ten WebSockets of a real station in the same process. Wall times are of the machine as busy
as it is; CPU times are of all threads. One in fifty of the kills is of a station whose planning process just began.
"""

import asyncio
import contextlib
import multiprocessing
import os
import random
import tempfile
import time
from multiprocessing import connection
from pathlib import Path
from typing import Any

import aiohttp
import gcs_flights
import gcs_scene
import msgspec
import numpy as np
from gcs_station import Hall, Page, new_project, ring
from report import Row, main, row

import planner
import vehicle
from firmware_bridge import SitlVehicle, controller, keys
from flight import Waypoints, project
from gcs_web import GroundStation
from gcs_web.document.document import Content, Settings
from gcs_web.document.session import Session
from gcs_web.planning import planning, replanning
from gcs_web.protocol.document import Shift

WAYPOINTS, EDITS, KILLS, CLIENTS, MIXED = 50, 10_000, 200, 10, 1000


def moved(content: Content, number: int) -> Content:
    point = content.points[number]
    x, y, z = point.position_world_m
    points = list(content.points)
    points[number] = msgspec.structs.replace(point, position_world_m=(x, y, z + 0.1))
    return content.with_points(points)


def plans() -> list[Row]:
    """CPU time of drafts while a waypoint is dragged, and of the checked plan once it is let go."""
    hall, base, replanner = Hall(), planner.PlanOptions(), replanning.Replanner()

    def planned_ms(content: Content, *, afresh: bool = False) -> float:
        replanner.begin()
        begun_s = time.process_time()
        answer = planning.answer(planning.Request(0, content, (), afresh), hall, base, replanner)
        assert answer.file is not None, answer.shown.sentence
        return 1000.0 * (time.process_time() - begun_s)

    planned_ms(ring(50))
    begun_s = time.process_time()
    for k in range(100):
        x, y, z = ring(50).points[20].position_world_m
        assert replanner.draft(20, np.array([x, y, z + 0.002 * k])) is not None
    draft_ms = 10.0 * (time.process_time() - begun_s)
    content = ring(19)
    planned_ms(content)
    edits_ms, scratch_ms = [], []
    for k in range(10):
        content = moved(content, 1 + (5 * k) % 17)
        edits_ms.append(planned_ms(content))
    scratch_ms = [planned_ms(content, afresh=True) for _ in range(3)]
    first, tenth = edits_ms[0], edits_ms[-1]
    peers = {"from scratch": float(np.median(scratch_ms))}
    return [
        row("draft of 50 waypoints", draft_ms, "CPU ms", "<= 10", draft_ms <= 10.0),
        row("checked plan of 19 waypoints, first edit", first, "CPU ms", "<= 80", first <= 80.0, peers=peers),
        row("checked plan of 19 waypoints, tenth edit", tenth, "CPU ms", "<= 80", tenth <= 80.0, peers=peers),
        row("the same, median of ten", float(np.median(edits_ms)), "CPU ms"),
    ]


def new_session(folder: Path) -> Session:
    opened = project.create(folder, "benchmark")
    points = np.random.default_rng(0).uniform(0.0, 10.0, (WAYPOINTS, 3))
    project.save_waypoints(opened.waypoints, Waypoints(points, np.full(WAYPOINTS, np.nan)))
    return Session(opened, Settings())


def shift(session: Session, k: int) -> Shift:
    return Shift(serial=0, revision=session.revision, waypoints=[k % WAYPOINTS], z_m=0.001)


def edits(folder: Path) -> list[Row]:
    """Time of an edit that lasts, beside an append with fsync, and what ten thousand leave on disk."""
    session = new_session(folder / "edits")
    durations = []
    for k in range(EDITS):
        begun_s = time.perf_counter()
        session.edit(shift(session, k), "benchmark")
        durations.append(time.perf_counter() - begun_s)
    size = sum(path.stat().st_size for path in (session.project.folder / ".session").iterdir())
    session.close()
    appends = []
    with open(folder / "append", "ab", buffering=0) as file:
        for _ in range(200):
            begun_s = time.perf_counter()
            file.write(b"x" * 300)
            os.fsync(file.fileno())
            appends.append(time.perf_counter() - begun_s)
    limit_ms = 1000.0 * float(np.median(appends))
    return [
        row("edit of one of 50 waypoints, lasting", 1000.0 * np.median(durations), "ms", peers={"fsync": limit_ms}),
        row("10,000 edits on disk", size / 1e6, "MB", "< 20", size < 20e6),
    ]


_STATIONS = multiprocessing.get_context("forkserver")
_STATIONS.set_forkserver_preload(["aiohttp", "trimesh", "firmware_bridge", "goshawk.rendered.world", "gcs_web.app"])
"""What this script imports, which each station would import again: so a start costs a fork."""
_WITH_PLANNER = 50
"""Of so many kills one is of a station with a planning process, which costs a start of Python each."""


def edit_for_ever(folder: Path, told: connection.Connection, with_planner: bool) -> None:
    """Be a station: edit, and tell each revision once it was acknowledged; first the planning process's id, or 0."""
    session, planned = Session(project.open_project(folder), Settings()), None
    if with_planner:
        planned = planning.PlanningProcess(folder, planner.PlanOptions(), lambda _: None)
    told.send(0 if planned is None else planned._process.pid)
    while True:
        session.edit(shift(session, 0), "benchmark")
        told.send(session.revision)
        if planned is not None:
            planned.request(planning.Request(session.revision, session.content, ()))


def killed(folder: Path, count: int) -> list[Row]:
    """Kill a station at random moments of an edit; how many acknowledged changes and how many processes are left."""
    session = new_session(folder / "kills")
    opened = session.project
    session.close()
    lost, planners = 0, []
    chance = random.Random(0)
    for k in range(count):
        ours, theirs = _STATIONS.Pipe(duplex=False)
        child = _STATIONS.Process(target=edit_for_ever, args=(opened.folder, theirs, k % _WITH_PLANNER == 0))
        child.start()
        theirs.close()
        planners.append(ours.recv())
        last = ours.recv()
        time.sleep(chance.uniform(0.0, 0.02))
        child.kill()
        with contextlib.suppress(EOFError):
            while True:
                last = ours.recv()
        child.join()
        again = Session(opened, Settings())
        lost += max(last - again.revision, 0)
        again.close()
    started = [pid for pid in planners if pid]
    end_s = time.monotonic() + 60.0
    while (left := [pid for pid in started if Path(f"/proc/{pid}").exists()]) and time.monotonic() < end_s:
        time.sleep(0.1)
    return [
        row(f"changes lost in {count} kill -9", lost, "", "0", lost == 0),
        row(f"planning processes left of {len(started)}", len(left), "", "0", not left),
    ]


# --- a real station, ten people and a vehicle ---


def mixed_edit(k: int, ids: list[int]) -> tuple[str, dict[str, Any]]:
    one = [ids[k % (len(ids) - 1)]]
    kinds: list[tuple[str, dict[str, Any]]] = [
        ("shift", {"waypoints": one, "z_m": 0.01}),
        ("turn", {"waypoints": one, "yaw_deg": 0.1 * k + 0.1}),
        ("shift", {"waypoints": one, "z_m": -0.01}),
        ("ask", {"waypoints": one, "leg_speed_m_s": 2.0 + 0.001 * k}),
        ("choose", {"speed_m_s": 3.0 + 0.001 * k}),
    ]
    return kinds[k % len(kinds)]


async def talk(station: GroundStation, url: str) -> list[Row]:
    async with contextlib.AsyncExitStack() as stack:
        pages = []
        for _ in range(CLIENTS):
            browser = await stack.enter_async_context(aiohttp.ClientSession(cookie_jar=aiohttp.CookieJar(unsafe=True)))
            async with browser.get(station.url, allow_redirects=False):
                pass
            socket = browser.ws_connect(f"{url}/ws", headers={"Origin": url}, max_msg_size=0)
            pages.append(Page(await stack.enter_async_context(socket)))
        await pages[0].until("plan", lambda p: p["state"] == "checked")
        return [*await mixed(station, pages), *await scrub_and_arm(station, pages[0])]


async def mixed(station: GroundStation, pages: list[Page]) -> list[Row]:
    session = station.desk.session
    ids, begun, refused, waits, cpu_s = [p.id for p in session.content.points], session.revision, 0, [], 0.0
    for k in range(MIXED):
        kind, arguments = mixed_edit(k, ids)
        begun_s, begun_cpu_s = time.perf_counter(), time.process_time()
        reply = await pages[k % CLIENTS].command(kind, revision=session.revision, **arguments)
        refused += bool(reply["error"])
        made = session.revision
        await asyncio.gather(*(p.until("document", lambda d, made=made: d["revision"] >= made) for p in pages))
        waits.append(time.perf_counter() - begun_s)
        cpu_s += time.process_time() - begun_cpu_s
    lost = MIXED - refused - (session.revision - begun)
    p95_ms = 1000.0 * float(np.percentile(waits, 95))
    return [
        row(f"edits lost of {MIXED} by {CLIENTS} people ({refused} refused)", lost, "", "0", lost == 0),
        row("edit until all are told, 95 %", p95_ms, "ms", "< 150", p95_ms < 150.0),
        row("the same, the ten clients included", 1000.0 * cpu_s / MIXED, "CPU ms"),
    ]


async def scrub_and_arm(station: GroundStation, page: Page) -> list[Row]:
    station.desk.session.take(ring(19).waypoints(), "as at the beginning", "benchmark")
    await page.until("plan", lambda p: p["state"] == "checked" and p["revision"] == station.desk.session.revision)
    scrubs, changes = [], []
    for time_s in np.linspace(0.0, 5.0, 300):
        begun_s = time.perf_counter()
        await page.command("look", time_s=float(time_s))
        scrubs.append(time.perf_counter() - begun_s)
    await page.command("take_control")
    for armed in (True, False) * 5:
        nonce = (await page.command("prepare_order"))["nonce"]
        begun_s = time.perf_counter()
        reply = await page.command("order", order="arm" if armed else "disarm", nonce=nonce)
        assert not reply["error"], reply["error"]
        await page.until("vehicle", lambda v, armed=armed: v["armed"] == armed)
        changes.append(time.perf_counter() - begun_s)
    scrub_ms, change_s = 1000.0 * float(np.percentile(scrubs, 95)), max(changes)
    return [
        row("scrub until the 3D view is told, 95 %", scrub_ms, "ms", "<= 30", scrub_ms <= 30.0),
        row("order until the page shows the vehicle's change, worst of 10", change_s, "s", "<= 0.5", change_s <= 0.5),
    ]


def people(folder: Path) -> list[Row]:
    """Mixed edits of ten people over their sockets, a cursor that is dragged, and a vehicle that is armed."""
    opened = new_project(folder / "people")
    key_file = folder / "link.key"
    believed = Hall().vehicle(())
    start = vehicle.simulate.State(position_world_m=np.array([15.0, 6.0, 0.0]))
    plant = vehicle.simulate.Plant(believed, start, ground_m=0.0)
    with (
        SitlVehicle(plant, controller.parameters_of(believed).parameters, key=keys.create(key_file)) as simulated,
        GroundStation(opened.folder, vehicle_url=simulated.url, key_file=key_file, triangles=500) as station,
    ):
        return asyncio.run(talk(station, station.url.split("/?")[0]))


def rows(kills: int = KILLS, flights: int = 60) -> list[Row]:
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        ours = [*plans(), *edits(folder), *people(folder), *killed(folder, kills)]
    return [*ours, *gcs_flights.rows(flights), *gcs_scene.rows()]


if __name__ == "__main__":
    main(rows, kills=KILLS, flights=60)
