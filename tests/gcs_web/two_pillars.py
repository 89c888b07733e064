"""A ground station with two pillars and a SITL vehicle, and the waypoints that tests of it begin with."""

import shutil
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

import numpy as np

import vehicle
from firmware_bridge import SitlVehicle, controller, keys
from flight import Waypoints, project
from gcs_web import GroundStation
from gcs_web.jobs.jobs import Kind
from tests.waiting import until

TRIANGLES = 500
"""That the stations show of it."""
START = np.array([[0.8, 0.8, 1.0], [3.0, 2.0, 1.2], [5.2, 0.8, 1.2]])


def shown(pillar_map: Path) -> Path:
    """Where what the 3D view shows of the map lies, made once for all stations: each would take 1.4 s of CPU time."""
    return pillar_map.with_name("pillar_map_shown")


def add_map(opened: project.Project, pillar_map: Path) -> None:
    shutil.copytree(pillar_map, opened.map)
    shutil.copytree(shown(pillar_map), opened.folder / ".session")


@contextmanager
def serving(pillar_map: Path, folder: Path, *, jobs: Sequence[Kind] = ()) -> Iterator[GroundStation]:
    """A station of a new project with the vehicle on the ground below the first waypoint."""
    opened = project.create(folder, "two <b>pillars</b>")  # foreign strings are text, never markup
    add_map(opened, pillar_map)
    believed = vehicle.example("rigter2019")
    vehicle.save(opened.vehicle, believed)
    project.save_waypoints(opened.waypoints, Waypoints(START, np.full(len(START), np.nan)))
    key_file = opened.folder / "link.key"
    on_ground = vehicle.simulate.State(position_world_m=START[0] * [1.0, 1.0, 0.0])
    plant = vehicle.simulate.Plant(believed, on_ground, ground_m=0.0)
    with (
        SitlVehicle(plant, controller.parameters_of(believed).parameters, key=keys.create(key_file)) as simulated,
        GroundStation(
            opened.folder, triangles=TRIANGLES, vehicle_url=simulated.url, key_file=key_file, jobs=jobs
        ) as running,
    ):
        yield running


def start_again(station: GroundStation) -> None:
    """Give the station the same waypoints, whatever was edited before, and wait for their plan."""
    station.desk.session.take(Waypoints(START, np.full(len(START), np.nan)), "test begins", "test")
    until(
        lambda: station.desk.answer and station.desk.answer.request.revision == station.desk.session.revision, "a plan"
    )
