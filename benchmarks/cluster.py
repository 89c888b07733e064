"""A batch of 61 missions on a Dask cluster of this machine whose parts are killed: how many rows equal one process'.

python benchmarks/cluster.py [--missions 61] [--json FILE]
"""

import json
import os
import signal
import subprocess
import sys
import tempfile
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
import gcs_station
import numpy as np
import report

from flight import Waypoints, project
from tests import waiting
from tests.goshawk.dask_cluster import Cluster, cluster, end

POISON = "poison"
"""The mission that ends its worker, every time."""


def rows(missions: int = 61) -> list[report.Row]:
    with tempfile.TemporaryDirectory() as made:
        folder = Path(made)
        gcs_station.new_project(folder / "project")
        write_missions(folder, missions)
        batch(folder, "one", "missions").communicate()
        whole = recorded(folder, "one")
        cases = {
            "a worker killed": worker_killed(folder, missions // 3),
            "the scheduler killed, the command repeated": scheduler_killed(folder, missions // 3),
            "a mission that kills its workers": poisonous(folder),
        }
    found = []
    for name, got in cases.items():
        equal = sum(got.get(mission) == row for mission, row in whole.items())
        if name.startswith("a mission"):
            equal += got.get(POISON, {}).get("status") == "crashed"
        title, planned = f"Dask, {name}: rows recorded", sum(row["status"] == "planned" for row in got.values())
        found.append(report.row(title, len(got), "rows", f"{missions}", len(got) == missions, {"planned": planned}))
        found.append(report.row("  as they must be", equal, "rows", f"{missions}", equal == missions))
    return found


def write_missions(folder: Path, count: int) -> None:
    """Walks between the hall's pillars; in one of the two folders the last one has the name that ends a worker."""
    rng = np.random.default_rng(0)
    for place in ("missions", "with_poison"):
        (folder / place).mkdir()
    for i in range(count):
        x = np.array([2.0, 6.0, 10.0, 14.0])
        points = np.column_stack([x, rng.choice([1.5, 4.5, 7.5], 4), rng.uniform(0.8, 2.0, 4)])
        asked = Waypoints(points, np.full(4, np.nan))
        last = i == count - 1
        project.save_waypoints(folder / "missions" / f"{'z' if last else f'm{i:02d}'}.json", asked)
        project.save_waypoints(folder / "with_poison" / f"{POISON if last else f'm{i:02d}'}.json", asked)


def batch(folder: Path, out: str, missions: str, *options: str) -> subprocess.Popen[str]:
    """The command as a program of its own."""
    made = folder / "project"
    where = ("--map", made / "map", "--vehicle", made / "vehicle.toml", "--out", folder / out)
    command = [sys.executable, "-m", "goshawk", "plan", "batch", folder / missions, *where, *options]
    return subprocess.Popen(list(map(str, command)), stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)


def recorded(folder: Path, out: str) -> dict[str, dict]:
    """The rows by mission, without what differs from run to run."""
    found = json.loads((folder / out / "results.json").read_text())["missions"]
    return {row["name"]: {name: cell for name, cell in row.items() if name != "cpu_s"} for row in found}


def new_folder(folder: Path) -> Path:
    return Path(tempfile.mkdtemp(dir=folder))


def wait_for_rows(folder: Path, out: str, count: int) -> None:
    journal = folder / out / "journal.jsonl"
    waiting.until(lambda: journal.is_file() and len(journal.read_text().splitlines()) >= count, f"row {count}")


def worker_killed(folder: Path, after: int) -> dict[str, dict]:
    """The process that plans is killed, and started again by its nanny."""
    with cluster(new_folder(folder), 2) as made:
        program = batch(folder, "worker", "missions", "--scheduler", made.address)
        wait_for_rows(folder, "worker", after)
        os.kill(made.planner_of(made.begun()[-1]), signal.SIGKILL)
        program.communicate()
    return recorded(folder, "worker")


def scheduler_killed(folder: Path, after: int) -> dict[str, dict]:
    """The scheduler is killed, and started again with its workers before the command is repeated."""
    with cluster(new_folder(folder), 2) as made:
        program = batch(folder, "scheduler", "missions", "--scheduler", made.address)
        wait_for_rows(folder, "scheduler", after)
        end(made.processes[0])
        program.communicate()
        assert program.returncode == 1
        again(made)
        batch(folder, "scheduler", "missions", "--scheduler", made.address).communicate()
    return recorded(folder, "scheduler")


def again(made: Cluster) -> None:
    made.scheduler()
    for _ in range(2):
        made.worker()


def poisonous(folder: Path) -> dict[str, dict]:
    with cluster(new_folder(folder), 2) as made:
        batch(folder, "poisonous", "with_poison", "--scheduler", made.address).communicate()
    return recorded(folder, "poisonous")


if __name__ == "__main__":
    report.main(rows, missions=61)
