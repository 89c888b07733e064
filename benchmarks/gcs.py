"""The web ground station: how fast an edit lasts and reaches everybody, and what kill -9 loses.

    python benchmarks/gcs.py [--json FILE]

Beside ours in the same process: the physical limit, an append of the same bytes with fsync; for a plan after an edit,
the same from scratch. A plan is all that the planning process does for the page: path, gate, series, limits. No browser
takes part.
"""

import asyncio
import json
import os
import random
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import msgspec
import numpy as np
from report import Row, main, row

import esdf
import mapping
import planner
import vehicle
from esdf import solids
from flight import Waypoints, project
from gcs_web import inputs, planning, protocol, replanning
from gcs_web.document import Content, Settings
from gcs_web.hub import Hub
from gcs_web.session import Session
from mapping import rendered_world

WAYPOINTS, EDITS, KILLS, CLIENTS, MIXED = 50, 10_000, 200, 10, 1000


class Hall(inputs.Parts):
    """A hall of 16 x 12 m with pillars in place of a project's map."""

    def __init__(self) -> None:
        pillars = [solids.Cylinder((x, y, 1.5), 0.3, 3.0) for x in (4.0, 8.0, 12.0) for y in (3.0, 6.0, 9.0)]
        grid = esdf.Grid(np.full(3, -0.2), np.full(3, 0.05), (328, 248, 68))
        room = solids.Scene([solids.Room((0.0, 0.0, 0.0), (16.0, 12.0, 3.0)), *pillars])
        self._field = esdf.build(esdf.rasterize(room, grid), grid)
        self._vehicle = vehicle.example("rigter2019")

    def map(self, wanted: inputs.Signature) -> mapping.Map:
        nobody = np.zeros(0)
        return mapping.Map(Path(), self._field, rendered_world.default_rig(), (), nobody, nobody, {})

    def vehicle(self, wanted: inputs.Signature) -> vehicle.Vehicle:
        return self._vehicle


def ring(count: int) -> Content:
    """Waypoints round the pillars, up and down."""
    angle = np.linspace(0.0, 2.0 * np.pi, count, endpoint=False)
    points = np.stack([8.0 + 7.0 * np.cos(angle), 6.0 + 5.2 * np.sin(angle), 1.4 + 0.4 * np.sin(3 * angle)], axis=1)
    settings = Settings(speed_m_s=5.0, acceleration_m_s2=8.0)
    return Content(settings=settings).with_waypoints(Waypoints(points, np.full(count, np.nan)))


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


def shift(session: Session, k: int) -> protocol.Shift:
    return protocol.Shift(serial=0, revision=session.revision, waypoints=[k % WAYPOINTS], z_m=0.001)


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


def kills(folder: Path) -> list[Row]:
    """Kill a station at random moments of an edit; how many acknowledged changes are gone afterwards."""
    session = new_session(folder / "kills")
    opened = session.project
    session.close()
    script = f"""
from pathlib import Path
from flight import project
from gcs_web import protocol
from gcs_web.document import Settings
from gcs_web.session import Session
session = Session(project.open_project(Path({str(opened.folder)!r})), Settings())
while True:
    session.edit(protocol.Shift(serial=0, revision=session.revision, waypoints=[0], z_m=0.001), "benchmark")
    print(session.revision, flush=True)
"""
    lost = 0
    chance = random.Random(0)
    for _ in range(KILLS):
        child = subprocess.Popen([sys.executable, "-c", script], stdout=subprocess.PIPE, text=True)
        assert child.stdout is not None
        last = int(child.stdout.readline())
        time.sleep(chance.uniform(0.0, 0.02))
        child.kill()
        last = max([last, *map(int, child.stdout.read().split())])
        child.wait()
        again = Session(opened, Settings())
        lost += max(last - again.revision, 0)
        again.close()
    return [row(f"changes lost in {KILLS} kill -9", lost, "", "0", lost == 0)]


async def people(folder: Path) -> list[Row]:
    """Mixed edits of ten people; time until each of them has been handed the newest document."""
    session = new_session(folder / "people")
    hub = Hub(asyncio.get_running_loop())
    session.on_change(lambda: hub.publish(session.document()))
    joined = [hub.join() for _ in range(CLIENTS)]
    waits = []
    for k in range(MIXED):
        begun_s = time.perf_counter()
        await asyncio.to_thread(session.edit, shift(session, k), f"Pilot {k % CLIENTS}")
        for client in joined:
            await client.arrived.wait()
        newest = [json.loads(client.take()[-1])["revision"] for client in joined]
        assert newest == [session.revision] * CLIENTS
        waits.append(time.perf_counter() - begun_s)
    made = session.revision
    session.close()
    p95_ms = 1000.0 * np.percentile(waits, 95)
    return [
        row(f"edits lost of {MIXED} by {CLIENTS} people", MIXED - made, "", "0", made == MIXED),
        row("edit until all are told, 95 %", p95_ms, "ms", "< 150", p95_ms < 150.0),
    ]


def rows() -> list[Row]:
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        return [*plans(), *edits(folder), *asyncio.run(people(folder)), *kills(folder)]


if __name__ == "__main__":
    main(rows)
