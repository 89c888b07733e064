"""Shared by the ground station's benchmarks: a hall as a project, a station's process, a page's socket."""

import contextlib
import json
import multiprocessing
import re
import sys
import time
from collections.abc import AsyncIterator, Callable, Iterator
from dataclasses import dataclass
from multiprocessing import connection
from pathlib import Path
from typing import Any

import aiohttp
import numpy as np
import trimesh

import esdf
import mapping
import vehicle
from esdf import solids
from flight import Waypoints, file_format, project
from gcs_web import GroundStation
from gcs_web.document.document import Content, Settings
from gcs_web.planning import inputs
from goshawk.rendered import world as rendered_world
from mapping import map_folder
from mapping.camera import rig


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

    def free_space(self, wanted: inputs.Signature) -> None:
        """Nobody has seen it."""

    def vehicle(self, wanted: inputs.Signature) -> vehicle.Vehicle:
        return self._vehicle


def ring(count: int) -> Content:
    """Waypoints round the pillars, up and down."""
    angle = np.linspace(0.0, 2.0 * np.pi, count, endpoint=False)
    points = np.stack([8.0 + 7.0 * np.cos(angle), 6.0 + 5.2 * np.sin(angle), 1.4 + 0.4 * np.sin(3 * angle)], axis=1)
    settings = Settings(speed_m_s=5.0, acceleration_m_s2=8.0)
    return Content(settings=settings).with_waypoints(Waypoints(points, np.full(count, np.nan)))


def new_project(folder: Path) -> project.Project:
    """The hall as a map folder."""
    opened, hall = project.create(folder, "benchmark"), Hall()
    field = hall.map(()).field
    opened.map.mkdir()
    esdf.save(opened.map / "esdf", field)
    trimesh.creation.box(bounds=[[0.0, 0.0, -0.05], [16.0, 12.0, 0.0]]).export(opened.map / "mesh.glb")
    rig.save(opened.map / "camera.toml", rendered_world.default_rig())
    (opened.map / "poses.csv").write_text("image,time_s,x_m,y_m,z_m,qw,qx,qy,qz\n0.png,0,1,1,1,1,0,0,0\n")
    facts = {"hash": field.hash, "verdict": "good", "reasons": []}
    file_format.write_toml(opened.map / "map.toml", format=map_folder.FORMAT, version=1, body=facts)
    vehicle.save(opened.vehicle, hall.vehicle(()))
    project.save_waypoints(opened.waypoints, ring(19).waypoints())
    return opened


class Page:
    """What a browser's page does with its socket."""

    def __init__(self, socket: aiohttp.ClientWebSocketResponse) -> None:
        self._socket, self._serial = socket, 0
        self.state: dict[str, dict[str, Any]] = {}

    async def until(self, kind: str, condition: Callable[[dict[str, Any]], bool]) -> dict[str, Any]:
        while kind not in self.state or not condition(self.state[kind]):
            message = await self._socket.receive_json()
            self.state[message["type"]] = message
        return self.state[kind]

    async def command(self, type: str, **arguments: Any) -> dict[str, Any]:
        self._serial += 1
        await self._socket.send_str(json.dumps({"type": type, "serial": self._serial, **arguments}))
        return await self.until("reply", lambda reply: reply["serial"] == self._serial)

    async def asked(self, type: str, **arguments: Any) -> dict[str, Any]:
        """The reply to a command that must be done."""
        reply = await self.command(type, **arguments)
        assert not reply["error"], reply["error"]
        return reply


@contextlib.asynccontextmanager
async def page(url: str) -> AsyncIterator[Page]:
    """Come in with a station's address."""
    origin = url.split("/?")[0]
    async with aiohttp.ClientSession(cookie_jar=aiohttp.CookieJar(unsafe=True)) as browser:
        async with browser.get(url, allow_redirects=False):
            pass
        async with browser.ws_connect(f"{origin}/ws", headers={"Origin": origin}, max_msg_size=0) as socket:
            yield Page(socket)


@dataclass(frozen=True, slots=True)
class StationProcess:
    """A station that runs in a process of its own, so that its memory is nobody else's."""

    url: str
    pid: int

    @property
    def peak_mb(self) -> float:
        """The most resident memory it ever had."""
        status = Path(f"/proc/{self.pid}/status").read_text()
        return int(re.findall(r"VmHWM:\s+(\d+) kB", status)[0]) * 1024e-6

    @property
    def cpu_s(self) -> float:
        return time.clock_gettime((~self.pid << 3) | 2)  # Linux' clock of another process, clock_getcpuclockid(3)


@contextlib.contextmanager
def station_process(folder: Path, **options: Any) -> Iterator[StationProcess]:
    context = multiprocessing.get_context("spawn")
    ours, theirs = context.Pipe()
    child = context.Process(target=_serve, args=(folder, options, theirs))
    child.start()
    theirs.close()
    try:
        yield StationProcess(ours.recv(), child.pid or 0)
    finally:
        ours.close()
        child.join()


def _serve(folder: Path, options: dict[str, Any], told: connection.Connection) -> None:
    sys.modules["pandas"] = None  # Arrow imports it where it is; users lack it
    with GroundStation(folder, **options) as station, contextlib.suppress(EOFError):
        told.send(station.url)
        told.recv()
