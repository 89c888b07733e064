"""Run a simulated vehicle beside the station, and connect to it: what `goshawk sitl` does."""

import threading
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Annotated

import msgspec

from firmware_bridge import keys
from flight import FlightError, InputError, Progress, mission
from flight.project import Project
from gcs_web.desk import Desk
from gcs_web.jobs.jobs import Choices, Kind
from gcs_web.planning import inputs, snapping
from gcs_web.protocol.people import Person
from goshawk.demo.sitl_process import sitl_vehicle

_ROTORS = ("", "0", "1", "2", "3")
_NEAR_M = 0.1
"""A surface below the start is found where the map is this near."""


class Arguments(msgspec.Struct, forbid_unknown_fields=True):
    wind_m_s: Annotated[
        float, msgspec.Meta(title="Wind along x", ge=-30.0, le=30.0, extra_json_schema={"unit": "m/s"})
    ] = 0.0
    gust_std_m_s: Annotated[
        float,
        msgspec.Meta(title="Gusts, standard deviation", ge=0.0, le=10.0, extra_json_schema={"unit": "m/s"}),
    ] = 0.0
    mass_percent: Annotated[
        float, msgspec.Meta(title="True mass, of the file's", ge=50.0, le=150.0, extra_json_schema={"unit": "%"})
    ] = 100.0
    weak_rotor: Annotated[str, msgspec.Meta(title="Weak rotor")] = ""
    thrust_percent: Annotated[
        float, msgspec.Meta(title="Its thrust, of the file's", ge=0.0, le=150.0, extra_json_schema={"unit": "%"})
    ] = 85.0


def _choices(_: Project) -> Choices:
    return {"weak_rotor": _ROTORS}


def _check(project: Project, asked: Arguments) -> None:
    if not project.has_vehicle:
        raise InputError("there is no vehicle to simulate; give the project one first")
    if asked.weak_rotor not in _ROTORS:
        raise InputError(f"{asked.weak_rotor!r} is no rotor; there are 0 to 3")


def _foresee(project: Project, _: Arguments) -> str:
    x, y, z = start_world_m(project)
    return f"it stands at {x:.2f}, {y:.2f}, {z:.2f} m, below the first waypoint where there is one"


def start_world_m(project: Project) -> tuple[float, float, float]:
    """On the floor below the first waypoint; at the origin without one, and at height 0 where no floor is known."""
    try:
        places = mission.load(project.waypoints).waypoints.positions_world_m
    except FlightError:
        return 0.0, 0.0, 0.0
    if not len(places):
        return 0.0, 0.0, 0.0
    x_m, y_m = (float(value) for value in places[0][:2])
    try:
        field = inputs.Parts(project.folder).map(inputs.signature(project.folder)).field
        return x_m, y_m, snapping.surface_below(places[0], field, _NEAR_M)
    except FlightError:
        return x_m, y_m, 0.0


def _run(key_file: Path | None, folder: Path, asked: Arguments, progress: Progress) -> None:
    project = Project(folder, "")
    place = ",".join(f"{value:.3f}" for value in start_world_m(project))
    options: list[object] = ["--vehicle", project.vehicle, f"--at={place}", f"--wind={asked.wind_m_s},0,0"]
    options += ["--gust-std", asked.gust_std_m_s, "--mass-ratio", asked.mass_percent / 100.0]
    if asked.weak_rotor:
        options += ["--rotor", f"{asked.weak_rotor}={asked.thrust_percent / 100.0}"]
    with sitl_vehicle(*options, key_file=key_file or keys.default_path()) as url:
        progress(url, 0.0)
        threading.Event().wait()  # until it is cancelled


def _connect(desk: Desk, url: str) -> Callable[[], None]:
    desk.connect(url, Person("", "The simulator"))

    def disconnect() -> None:
        if desk.watch is not None and desk.watch.url == url:
            desk.listen_to("")

    return disconnect


def _done(_: Desk, __: None) -> str:
    return "the simulator has ended"


def kind(key_file: Path | None) -> Kind[Desk]:
    """`key_file`: that signs the station's link; None: the default one."""
    return Kind(
        "simulate", "Simulator", Arguments, partial(_run, key_file), _done, _choices, _check, _foresee, beside=_connect
    )
