"""A path planned in a map of a rendered room, and flown in simulation."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

import mapping
import planner
from firmware_bridge import Sensors, closed_loop
from firmware_bridge.controller import parameters_of
from flight import Progress
from goshawk import plot
from goshawk.paper import ladder, theirs
from goshawk.rendered import world
from planner import Plan
from planner.route import simplify
from sysid.report import drawing
from vehicle import Vehicle, simulate

PAIRS, SHARE = 30, 0.5
"""Image pairs rendered, and the share of the loop round the room that they are spread over."""
SPEED_M_S, ACCELERATION_M_S2 = 5.0, 8.0
"""Brisk for a room of 10 by 8 m."""
WITHIN_M = 0.1
"""Of the recorded walk, that waypoints are taken from."""
_INSTANTS = 2000
_TAKE_OFF_M = 1.0
"""Height of the start above where the vehicle stands."""
SLICE, PLAN = "distance_field.png", "plan.png"


@dataclass(frozen=True, slots=True, eq=False)
class Flown:
    """What was mapped, planned and flown."""

    area: mapping.Map
    plan: Plan
    drone: Vehicle
    tracking_cm: float
    """Mean distance from the set-point, in simulation."""


def flown(folder: Path, pairs: int, progress: Progress) -> Flown:
    """Render, map, plan and fly; images and map stay in `folder`."""
    images = world.write_rendered_sequence(
        folder / "images", flight=world.loop_flight(pairs, share=SHARE), progress=progress
    )
    mapping.build_map(images, mapping.rig.load(images / "camera.toml"), folder / "map", progress=progress)
    area = mapping.open_map(folder / "map")
    drone = theirs.drone().with_limits(speed_m_s=SPEED_M_S, acceleration_m_s2=ACCELERATION_M_S2)
    progress("plan the path", 0.0)
    how = planner.PlanOptions().sized(drone)
    waypoints, _ = simplify.waypoints_along(area.T_world_body[:, :3, 3], WITHIN_M, area.field, how)
    plan = planner.plan(waypoints, area.field, drone, how)
    progress("fly the path", 0.0)
    return Flown(area, plan, drone, _tracking_cm(plan, drone))


def _tracking_cm(plan: Plan, drone: Vehicle) -> float:
    path = plan.trajectory
    start = path.position([0.0])[0] - [0.0, 0.0, _TAKE_OFF_M]  # a map begins where its camera did, not at the floor
    plant = simulate.Plant(
        drone, simulate.State(start), rng=np.random.default_rng(1), wind=ladder.GUSTS, ground_m=float(start[2])
    )
    done = closed_loop.fly(plant, parameters_of(drone), path, sensors=Sensors.typical(), seed=1)
    return 100.0 * float(done.error_m.mean())


def facts(shown: Flown) -> dict[str, Any]:
    """In SI, but for the tracking error."""
    path, gate = shown.plan.trajectory, shown.plan.gate
    times_s = np.linspace(0.0, path.duration_s, _INSTANTS)
    speed_m_s = np.linalg.norm(path.position(times_s, 1), axis=1)
    return {
        "images_placed": len(shown.area.images), "length_m": float(np.trapezoid(speed_m_s, times_s)),
        "duration_s": path.duration_s,
        "top_speed_m_s": float(speed_m_s.max()), "clearance_m": gate.clearance_m, "passes_gate": gate.passed,
        "tracking_cm": shown.tracking_cm,
    }  # fmt: skip


def draw(shown: Flown, folder: Path) -> tuple[Path, Path]:
    """A level slice of the distance field at the path's middle height, and the plan in the map."""
    path = shown.plan.trajectory
    height_m = float(np.median(path.position(np.linspace(0.0, path.duration_s, _INSTANTS))[:, 2]))
    return (
        drawing.written(plot.map_slice(shown.area.field, round(height_m, 2)), folder / SLICE),
        drawing.written(plot.plan(shown.plan, shown.drone, shown.area.field), folder / PLAN),
    )
