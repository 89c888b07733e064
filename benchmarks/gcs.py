"""The web ground station: how fast an edit lasts and reaches everybody, and what kill -9 loses.

    python benchmarks/gcs.py [--json FILE]

Beside ours in the same process: the physical limit, an append of the same bytes with fsync. No browser takes part; the
plan and the 3D view are measured by the tests that look at them.
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

import numpy as np
from report import Row, main, row

from flight import Waypoints, project
from gcs_web import protocol
from gcs_web.document import Settings
from gcs_web.hub import Hub
from gcs_web.session import Session

WAYPOINTS, EDITS, KILLS, CLIENTS, MIXED = 50, 10_000, 200, 10, 1000


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
        return [*edits(folder), *asyncio.run(people(folder)), *kills(folder)]


if __name__ == "__main__":
    main(rows)
