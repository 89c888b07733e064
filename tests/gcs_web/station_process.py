"""`goshawk gcs` as a process of its own, over real sockets, as browsers and attackers meet it."""

import re
import subprocess
import sys
import threading
from pathlib import Path

import aiohttp
import numpy as np

import vehicle
from flight import Waypoints, project
from tests.gcs_web.two_pillars import START, TRIANGLES, add_map
from tests.waiting import until

_ADDRESS = re.compile(r"https?://\S+/\?token=\S+")


def new_project(folder: Path, pillar_map: Path, *, name: str = "two pillars") -> project.Project:
    opened = project.create(folder, name)
    add_map(opened, pillar_map)
    vehicle.save(opened.vehicle, vehicle.example("rigter2019"))
    project.save_waypoints(opened.waypoints, Waypoints(START, np.full(len(START), np.nan)))
    return opened


class StationProcess:
    """A running `goshawk gcs`; use as a context manager."""

    def __init__(self, folder: Path, *options: object) -> None:
        shown = ("--port", 0, "--triangles", TRIANGLES)
        command = [sys.executable, "-u", "-m", "goshawk", "gcs", folder, *shown, *options]
        self.process = subprocess.Popen(
            [str(part) for part in command], stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True
        )
        self.said: list[str] = []
        self._reader = threading.Thread(target=self._read, daemon=True)
        self._reader.start()
        until(lambda: self.addresses() or self.process.poll() is not None, "the station's address")
        assert self.process.poll() is None, "".join(self.said)

    def _read(self) -> None:
        assert self.process.stdout is not None
        for line in self.process.stdout:
            self.said.append(line)

    def addresses(self) -> list[str]:
        return _ADDRESS.findall("".join(self.said))

    @property
    def origin(self) -> str:
        return self.addresses()[0].split("/?")[0]

    @property
    def port(self) -> int:
        return int(self.origin.rpartition(":")[2])

    async def enter(self, browser: aiohttp.ClientSession) -> None:
        """Come in with the newest address; it is used up, and the next one is printed."""
        known = len(self.addresses())
        async with browser.get(self.addresses()[-1], allow_redirects=False) as answer:
            assert answer.status == 302
        until(lambda: len(self.addresses()) > known, "the next address")

    def children(self) -> list[int]:
        """Processes that it started."""
        return children(self.process.pid)

    def resident_mb(self) -> float:
        status = Path(f"/proc/{self.process.pid}/status").read_text()
        return int(re.findall(r"VmRSS:\s+(\d+) kB", status)[0]) / 1024.0

    def kill(self) -> None:
        self.process.kill()
        self.process.wait()

    def __enter__(self) -> "StationProcess":
        return self

    def __exit__(self, *_: object) -> None:
        self.process.terminate()
        self.process.wait()
        self._reader.join()


def children(pid: int) -> list[int]:
    """Living processes below another one."""
    found = []
    for tasks in Path(f"/proc/{pid}/task").glob("*/children"):
        for child in map(int, tasks.read_text().split()):
            found += [child, *children(child)]
    return found


def alive(pid: int) -> bool:
    """Whether a process runs; one that has ended and was not fetched yet does not."""
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except (FileNotFoundError, ProcessLookupError):
        return False
