"""The whole chain once, on a rendered room: map, plan, fly, learn. Truth is known, so every step is judged against it.

The vehicle that flies (`truth.toml`) is the paper's. What is believed of it at first (`vehicle.toml`) has the CAD
inertias, a thrust coefficient 8 % off and no rotor drag. Two flights identify it, without and then with rotor drag; the
third, along the recorded walk, was not used and judges both.
"""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

import esdf
import firmware_bridge
import mapping
import planner
import sysid
import vehicle
from flight import (
    FlightLog,
    FloatArray,
    InputError,
    Progress,
    Waypoints,
    file_format,
    flight_log,
    project,
    trajectory,
)
from flight.project import Project
from goshawk import demo_folder
from goshawk.commands.plan import waypoints_along
from goshawk.flights import in_the_air, tracking
from goshawk.map_accuracy import Accuracy, measure
from goshawk.virtual_flight import sitl_vehicle
from mapping import rendered_room, rendered_world
from vehicle import Vehicle

HIDDEN_EFFECT = "rotor_drag_thrust"
FLIGHTS = ("train-1", "train-2", "walk")
SHOWN = (
    "thrust_bem.k1_n_s2",
    "inertia_xx_kg_m2",
    "inertia_yy_kg_m2",
    "inertia_zz_kg_m2",
    "parasitic_drag.drag_xy_kg_m",
    f"{HIDDEN_EFFECT}.drag_s_m",
)
"""Parameters in the demo's table."""

_SPEED_M_S, _ACCELERATION_M_S2 = 5.0, 8.0  # brisk for a room of 10 by 8 m


@dataclass(frozen=True, slots=True)
class Learned:
    """Two identifications and how they predict a flight that neither saw."""

    without_effect: sysid.Identification
    with_effect: sysid.Identification
    comparison: sysid.Comparison


def run(out: Path, *, pairs: int = 60, progress: Progress) -> dict[str, Any]:
    """Run the demo into the project folder `out`; returns (and writes to `demo.json`) what came of it.

    An earlier demo in `out` makes room: it is removed when the new one is complete, or stays beside it if anything in
    it was changed since.

    Args:
        pairs: image pairs to render; fewer make a quicker and worse map.

    Raises:
        InputError: `out` holds something else than an earlier demo.
    """
    with demo_folder.making(out):
        facts = _run(out, pairs, progress)
        body = facts | {"files": demo_folder.hashes(out)}
        file_format.write_json(
            out / demo_folder.FACTS, format=demo_folder.FORMAT, version=demo_folder.VERSION, body=body
        )
    return facts


def _run(out: Path, pairs: int, progress: Progress) -> dict[str, Any]:
    opened = project.create(out, demo_folder.NAME)
    images = rendered_world.write_rendered_sequence(
        out / "rendered", flight=rendered_world.loop_flight(pairs), progress=progress
    )
    report = mapping.build_map(images, mapping.rig.load(images / "camera.toml"), opened.map, progress=progress)
    area = mapping.open_map(opened.map)
    accuracy = measure(area, images / "truth" / "poses.csv", rendered_room.furnished())

    truth, believed = vehicles()
    vehicle.save(out / "truth.toml", truth)
    vehicle.save(opened.vehicle, believed)
    plans = plan_flights(opened, area, believed, progress)
    logs = {name: fly(opened, name, out / "truth.toml", opened.vehicle, progress) for name in FLIGHTS}
    learned = learn(opened, logs, believed, progress)

    vehicle.save(out / "learned.toml", learned.with_effect.vehicle)
    again = fly(opened, "walk", out / "truth.toml", out / "learned.toml", progress, save_as="walk-learned")
    return _facts(report, accuracy, plans, logs | {"walk-learned": again}, learned, truth)


def vehicles() -> tuple[Vehicle, Vehicle]:
    """The vehicle that flies, and what is believed of it at first."""
    truth = vehicle.example("rigter2019")
    for axis in "xyz":  # the SITL vehicle reports the pose of its centre of mass
        truth = truth.with_value(f"pose_sensor_{axis}_m", 0.0, source="SITL vehicle")
    truth = truth.with_limits(speed_m_s=_SPEED_M_S, acceleration_m_s2=_ACCELERATION_M_S2)
    believed = truth.without_effect(HIDDEN_EFFECT)
    for name, value in {"inertia_xx_kg_m2": 0.00241, "inertia_yy_kg_m2": 0.00342, "inertia_zz_kg_m2": 0.00522}.items():
        believed = believed.with_value(name, value, std=0.001, source="Rigter et al. 2019, CAD")
    k1 = truth.value("thrust_bem.k1_n_s2")
    return truth, believed.with_value("thrust_bem.k1_n_s2", 1.08 * k1, std=0.1 * k1, source="a guess")


def plan_flights(opened: Project, area: mapping.Map, believed: Vehicle, progress: Progress) -> dict[str, planner.Plan]:
    """Plan the recorded walk and two training flights, and save them: `trajectories/NAME.json`."""
    walked = area.T_world_body[:, :3, 3]
    along_the_walk, _ = waypoints_along(walked, 0.10, area, planner.PlanOptions())
    project.save_waypoints(opened.waypoints, along_the_walk)
    rng = np.random.default_rng(1)
    asked = {
        "walk": along_the_walk,
        "train-1": _excursion(walked[::8], area.field, rng, yaw_swing_rad=0.0),
        "train-2": _excursion(walked[::-7], area.field, rng, yaw_swing_rad=1.0),
    }
    plans = {}
    for name, waypoints in asked.items():
        progress(f"plan {name}", 0.0)
        plans[name] = planner.plan(waypoints, area.field, believed)
        planner.save_plan(opened.trajectory(name), plans[name], name=name)
        progress(f"plan {name}", 1.0)
    return plans


def _excursion(path: FloatArray, field: esdf.Field, rng: np.random.Generator, *, yaw_swing_rad: float) -> Waypoints:
    """Waypoints up and down and to the sides of a path, as far as there is room: a flight that shakes the model."""
    chosen = []
    for i, point in enumerate(path):
        tries = point + rng.uniform([-0.5, -0.5, 0.1], [0.5, 0.5, 0.7], (40, 3)) * [1.0, 1.0, (-1.0) ** i]
        roomy = tries[np.nan_to_num(field.distance(tries), nan=-1.0) > 0.5]
        chosen.append(roomy[0] if len(roomy) else point)
    positions = np.array(chosen)
    if not yaw_swing_rad:
        return Waypoints(positions, np.full(len(positions), np.nan))
    along = np.unwrap(np.arctan2(*np.gradient(positions[:, :2], axis=0).T[::-1]))
    return Waypoints(positions, along + yaw_swing_rad * (-1.0) ** np.arange(len(positions)))


def fly(
    opened: Project, name: str, truth: Path, believed: Path, progress: Progress, *, save_as: str | None = None
) -> FlightLog:
    """Fly one saved trajectory in the SITL vehicle: upload, read back, take off, fly, land, fetch the log."""
    item = trajectory.load(opened.trajectory(name))
    key_file = opened.folder / "link.key"
    options = ("--vehicle", truth, "--believed", believed, "--start-of", opened.trajectory(name), "--speed", 0)
    ground = ("--ground", _ground_m(opened))
    label = save_as or name
    with (
        sitl_vehicle(*options, *ground, key_file=key_file) as url,
        firmware_bridge.connect(url, key=key_file) as link,
    ):
        link.upload(item, progress=lambda stage, fraction: progress(f"{stage} {label}", fraction))
        log = link.fly(item, progress=lambda stage, fraction: progress(f"fly {label}: {stage}", fraction))
    flight_log.save(opened.flight(label), log)
    return log


def _ground_m(opened: Project) -> float:
    """Height of the mapped floor below the start of the walk."""
    start = trajectory.load(opened.trajectory("walk")).trajectory.position([0.0])[0]
    return floor_below(mapping.open_map(opened.map).field, start)


def floor_below(field: esdf.Field, point_world_m: FloatArray, *, step_m: float = 0.01) -> float:
    """Height of the first solid (or unknown) thing straight below a free point.

    Raises:
        InputError: the point itself is not free.
    """
    down = point_world_m - np.outer(np.arange(0.0, 10.0, step_m), [0.0, 0.0, 1.0])
    solid = np.flatnonzero(np.nan_to_num(field.distance(down), nan=-1.0) <= 0.0)
    if not solid.size or solid[0] == 0:
        raise InputError(f"no floor below {np.round(point_world_m, 2).tolist()}: the point is not free in this map")
    return float(down[solid[0], 2])


def learn(opened: Project, logs: dict[str, FlightLog], believed: Vehicle, progress: Progress) -> Learned:
    """Identify without and with the hidden effect on the training flights; compare on the walk; draw both."""
    training = [in_the_air(logs[name], name) for name in FLIGHTS if name != "walk"]
    options = sysid.Options(unseen="hold")
    without = sysid.identify(training, believed, options, progress=progress)
    with_effect = sysid.identify(training, believed.with_effect(HIDDEN_EFFECT), options, progress=progress)
    models = {"believed": believed, "identified": without.vehicle, "with rotor drag": with_effect.vehicle}
    comparison = sysid.compare([in_the_air(logs["walk"], "walk")], models, progress=progress)
    sysid.plots.comparison(comparison, opened.folder / "figures")
    sysid.plots.identification(with_effect, opened.folder / "figures")
    return Learned(without, with_effect, comparison)


def _facts(
    report: mapping.MapReport,
    accuracy: Accuracy,
    plans: dict[str, planner.Plan],
    logs: dict[str, FlightLog],
    learned: Learned,
    truth: Vehicle,
) -> dict[str, Any]:
    """Everything the demo claims, in one JSON document."""
    identified = learned.with_effect
    return {
        "map": report.as_dict() | {"accuracy": accuracy.as_dict()},
        "plans": {
            name: {"duration_s": plan.trajectory.duration_s, "clearance_m": plan.gate.clearance_m}
            for name, plan in plans.items()
        },
        "flights": {name: tracking(log) for name, log in logs.items()},
        "identified": {
            name: {
                "estimate": identified.estimate(name).value,
                "std": identified.estimate(name).std_robust,
                "truth": truth.value(name),
                "without_effect": None
                if name.startswith(HIDDEN_EFFECT)
                else learned.without_effect.estimate(name).value,
                "unit": identified.estimate(name).unit,
            }
            for name in SHOWN
        },
        "held_out": learned.comparison.as_dict(),
    }
