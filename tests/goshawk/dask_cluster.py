"""A Dask cluster of real processes on this machine, to be killed at will."""

import os
import signal
import socket
import subprocess
import sys
from collections.abc import Generator
from contextlib import contextmanager, suppress
from pathlib import Path

from tests import waiting

FAULTS = '''
"""Loaded by a worker: what some missions do to it."""
import os, signal, time
from pathlib import Path
from goshawk.commands.plan import batch_mission

FOLDER = Path(os.environ["FAULTS_FOLDER"])

planned = getattr(batch_mission.plan_one, "planned", batch_mission.plan_one)  # this file is loaded twice

def plan_one(path, job):
    with open(FOLDER / "begun", "a") as begun:
        begun.write(f"{path.stem} {os.getpid()}\\n")
    if "poison" in path.stem:
        os.kill(os.getpid(), signal.SIGKILL)
    while "held" in path.stem and not (FOLDER / "go").exists():
        time.sleep(0.02)
    return planned(path, job)

plan_one.planned = planned
batch_mission.plan_one = plan_one
'''


class Cluster:
    """A scheduler and workers with one thread each; in `folder` they tell what they began, and wait for a file `go`."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        (folder / "faults.py").write_text(FAULTS)
        (folder / "begun").touch()
        with socket.socket() as free:
            free.bind(("127.0.0.1", 0))
            self.port = free.getsockname()[1]
        self.address = f"tcp://127.0.0.1:{self.port}"
        self.processes: list[subprocess.Popen[bytes]] = []

    def scheduler(self) -> subprocess.Popen[bytes]:
        return self._start("scheduler", "--host", "127.0.0.1", "--port", self.port, "--no-dashboard")

    def worker(self, *options: object, **environment: str) -> subprocess.Popen[bytes]:
        where = ("--local-directory", self.folder, "--preload", self.folder / "faults.py", "--no-dashboard")
        return self._start("worker", self.address, "--nthreads", 1, *where, *options, **environment)

    def _start(self, *arguments: object, **environment: str) -> subprocess.Popen[bytes]:
        command = [sys.executable, "-m", "dask", *map(str, arguments)]
        log = open(self.folder / "log", "ab")  # noqa: SIM115 (the process keeps it)
        environment = os.environ | {"OPENBLAS_NUM_THREADS": "1", "FAULTS_FOLDER": str(self.folder)} | environment
        process = subprocess.Popen(
            command, cwd=self.folder, env=environment, stdout=log, stderr=log, start_new_session=True
        )
        log.close()
        self.processes.append(process)
        return process

    def begun(self) -> list[str]:
        """Names of the missions that were begun, in order."""
        return [line.split()[0] for line in (self.folder / "begun").read_text().splitlines()]

    def planner_of(self, name: str) -> int:
        """Id of the process that plans a mission; waits until it is begun."""
        waiting.until(lambda: name in self.begun(), f"the beginning of {name}")
        lines = (self.folder / "begun").read_text().splitlines()
        return int(next(line.split()[1] for line in reversed(lines) if line.split()[0] == name))

    def let_go(self) -> None:
        """Missions that are held go on."""
        (self.folder / "go").touch()


def end(process: subprocess.Popen[bytes]) -> None:
    """Kill a process of the cluster with all that it started."""
    with suppress(ProcessLookupError):
        os.killpg(process.pid, signal.SIGKILL)
    process.wait()


@contextmanager
def cluster(folder: Path, workers: int = 1, *options: object) -> Generator[Cluster]:
    """A cluster that is ended with the block."""
    made = Cluster(folder)
    try:
        made.scheduler()
        for _ in range(workers):
            made.worker(*options)
        yield made
    finally:
        for process in made.processes:
            end(process)
