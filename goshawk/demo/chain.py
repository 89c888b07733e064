"""The whole chain once, on a rendered room: map, plan, fly, learn; every step is compared with ground truth.

The vehicle that flies (`truth.toml`) is the paper's. The first model (`vehicle.toml`) has the CAD
inertias, a thrust coefficient 8 % off and no rotor drag. Two flights identify it, without and then with rotor drag; the
third, along the recorded walk, is held out and evaluates both.
"""

from importlib import metadata
from pathlib import Path
from typing import Any

import numpy as np

import esdf
import firmware_bridge
import mapping
import planner
import sysid
import vehicle
from firmware_bridge.airborne import in_the_air, tracking
from flight import FlightLog, FloatArray, InputError, Progress, Waypoints, flight_log, project, trajectory
from flight.project import Project
from goshawk.demo import demo_folder
from goshawk.demo.map_accuracy import measure
from goshawk.demo.sitl_process import again_if_link_dies, sitl_vehicle
from goshawk.rendered import scene as rendered_room
from goshawk.rendered import world as rendered_world
from planner.route import simplify
from vehicle import Vehicle

HIDDEN_EFFECT = "rotor_drag_thrust"
FLIGHTS = ("train-1", "train-2", "walk")
TRUTH, LEARNED = "truth.toml", "learned.toml"
SITL_TIMEOUT_S = 20.0
"""The vehicle is a program on this machine that we started: silence means that the machine is busy, not a lost link."""
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
MARGIN_M = 0.20
"""Between vehicle and obstacles: with the first model, whose thrust is a guess, the vehicle is 16 cm off its path."""
ROOM_M = 0.5
"""From a training flight's waypoint to anything occupied or unknown."""


def run(out: Path, *, pairs: int = 60, progress: Progress) -> dict[str, Any]:
    """Run the demo into the project folder `out`; returns (and writes to `demo.json`) what came of it.

    An earlier demo in `out` makes room: it is removed when the new one is complete, or stays beside it if anything in
    it was changed since. One that was broken off goes on after the last step it finished.

    Args:
        pairs: image pairs to render; fewer make a quicker and worse map.

    Raises:
        InputError: `out` holds something else than an earlier demo.
        LinkError: the SITL vehicle stopped answering, several times over.
    """
    settings = {"pairs": pairs, "goshawk": metadata.version("goshawk")}
    with demo_folder.making(out, settings) as steps:
        facts = _run(project.open_project(out), pairs, steps, progress)
        steps.finish(facts)
    return facts


def _run(opened: Project, pairs: int, steps: demo_folder.Steps, progress: Progress) -> dict[str, Any]:
    """Everything the demo claims, in one JSON document."""
    mapped = steps.do("map", lambda: make_map(opened, pairs, progress))
    truth, believed = vehicles()
    plans = steps.do("plans", lambda: make_plans(opened, truth, believed, progress))

    def flight(name: str, believed_file: Path, save_as: str) -> dict[str, float]:
        return steps.do(f"flight {save_as}", lambda: tracking(fly(opened, name, believed_file, save_as, progress)))

    flights = {name: flight(name, opened.vehicle, name) for name in FLIGHTS}
    learned = steps.do("identified model", lambda: learn(opened, believed, truth, progress))
    flights["walk-learned"] = flight("walk", opened.folder / LEARNED, "walk-learned")
    return {"map": mapped, "plans": plans, "flights": flights, **learned}


def make_map(opened: Project, pairs: int, progress: Progress) -> dict[str, Any]:
    """Render the walk and map it; how far the map is from the truth."""
    images = rendered_world.write_rendered_sequence(
        opened.folder / "rendered", flight=rendered_world.loop_flight(pairs), progress=progress
    )
    rig = mapping.rig.load(images / "camera.toml")
    report = mapping.build_map(images, rig, opened.map, overwrite=True, progress=progress)
    accuracy = measure(mapping.open_map(opened.map), images / "truth" / "poses.csv", rendered_room.furnished())
    return report.as_dict() | {"accuracy": accuracy.as_dict()}


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


def make_plans(opened: Project, truth: Vehicle, believed: Vehicle, progress: Progress) -> dict[str, Any]:
    """Plan the recorded walk and two training flights, and save them (`trajectories/NAME.json`) and the vehicles."""
    vehicle.save(opened.folder / TRUTH, truth)
    vehicle.save(opened.vehicle, believed)
    area = mapping.open_map(opened.map)
    walked = area.T_world_body[:, :3, 3]
    how = planner.PlanOptions(margin_m=MARGIN_M).sized(believed)
    along_the_walk, _ = simplify.waypoints_along(walked, 0.10, area.field, how)
    project.save_waypoints(opened.waypoints, along_the_walk)
    rng = np.random.default_rng(1)
    asked = {
        "walk": along_the_walk,
        "train-1": excursion(walked[::8], area.field, rng, yaw_swing_rad=0.0),
        "train-2": excursion(walked[::-7], area.field, rng, yaw_swing_rad=1.0),
    }
    facts = {}
    for name, waypoints in asked.items():
        progress(f"plan {name}", 0.0)
        plan = planner.plan(waypoints, area.field, believed, how)
        planner.save_plan(opened.trajectory(name), plan, name=name)
        facts[name] = {"duration_s": plan.trajectory.duration_s, "clearance_m": plan.gate.clearance_m}
        progress(f"plan {name}", 1.0)
    return facts


def excursion(path: FloatArray, field: esdf.Field, rng: np.random.Generator, *, yaw_swing_rad: float) -> Waypoints:
    """Waypoints up and down and to the sides of a path, where there is room: a flight that shakes the model.

    A place without room on any side is left out: where the walker stood, a vehicle may still not fit.
    """
    chosen = []
    for i, point in enumerate(path):
        tries = point + rng.uniform([-0.5, -0.5, 0.1], [0.5, 0.5, 0.7], (40, 3)) * [1.0, 1.0, (-1.0) ** i]
        roomy = tries[np.nan_to_num(field.distance(tries), nan=-1.0) > ROOM_M]
        chosen += [roomy[0]] if len(roomy) else []
    positions = np.array(chosen)
    if not yaw_swing_rad:
        return Waypoints(positions, np.full(len(positions), np.nan))
    along = np.unwrap(np.arctan2(*np.gradient(positions[:, :2], axis=0).T[::-1]))
    return Waypoints(positions, along + yaw_swing_rad * (-1.0) ** np.arange(len(positions)))


def fly(opened: Project, name: str, believed_file: Path, save_as: str, progress: Progress) -> FlightLog:
    """Fly one saved trajectory in the SITL vehicle: upload, read back, take off, fly, land, fetch the log.

    Raises:
        LinkError: the link died in each of several tries.
    """
    item = trajectory.load(opened.trajectory(name))
    key_file = opened.folder / "link.key"
    truth_file, start = opened.folder / TRUTH, opened.trajectory(name)
    options = ("--vehicle", truth_file, "--believed", believed_file, "--start-of", start, "--time-factor", 0)
    ground = ("--ground", _ground_m(opened))

    def fly_once() -> FlightLog:
        with (
            sitl_vehicle(*options, *ground, key_file=key_file) as url,
            firmware_bridge.connect(url, key=key_file, timeout_s=SITL_TIMEOUT_S) as link,
        ):
            link.upload(item, progress=lambda stage, fraction: progress(f"{stage} {save_as}", fraction))
            return link.fly(item, progress=lambda stage, fraction: progress(f"fly {save_as}: {stage}", fraction))

    log = again_if_link_dies(fly_once, f"flight {save_as}")
    flight_log.save(opened.flight(save_as), log)
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


def learn(opened: Project, believed: Vehicle, truth: Vehicle, progress: Progress) -> dict[str, Any]:
    """Identify without and with the hidden effect on the training flights; compare on the walk, which neither used."""
    logs = {name: in_the_air(flight_log.load(opened.flight(name)), name) for name in FLIGHTS}
    training = [logs[name] for name in FLIGHTS if name != "walk"]
    options = sysid.Options(unseen="hold")
    without = sysid.identify(training, believed, options, progress=progress)
    with_effect = sysid.identify(training, believed.with_effect(HIDDEN_EFFECT), options, progress=progress)
    models = {"believed": believed, "identified": without.vehicle, "with rotor drag": with_effect.vehicle}
    comparison = sysid.compare([logs["walk"]], models, progress=progress)
    sysid.plots.comparison(comparison, opened.folder / "figures")
    sysid.plots.identification(with_effect, opened.folder / "figures")
    vehicle.save(opened.folder / LEARNED, with_effect.vehicle)
    identified = {
        name: {
            "estimate": with_effect.estimate(name).value,
            "std": with_effect.estimate(name).std_robust,
            "truth": truth.value(name),
            "without_effect": None if name.startswith(HIDDEN_EFFECT) else without.estimate(name).value,
            "unit": with_effect.estimate(name).unit,
        }
        for name in SHOWN
    }
    return {"identified": identified, "held_out": comparison.as_dict()}
