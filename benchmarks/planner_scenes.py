"""Seeded places to plan in: forests of pillars, furnished rooms with doorways; and an independent check."""

from dataclasses import dataclass

import numpy as np

import esdf
import planner
from esdf import solids
from flight import Waypoints
from vehicle import Vehicle, flatness

VOXEL_M = 0.1


@dataclass(frozen=True)
class Place:
    """A scene in closed form, its sampled field, and waypoints that are themselves free."""

    kind: str
    scene: solids.Scene
    field: esdf.Field
    waypoints: Waypoints


def place(seed: int) -> Place:
    """Even seeds are forests, odd ones rooms."""
    rng = np.random.default_rng(seed)
    kind, scene, size = ("forest", *forest(rng)) if seed % 2 == 0 else ("rooms", *rooms(rng))
    points = waypoints(rng, scene, size, int(rng.integers(2, 8)))
    return Place(kind, scene, sampled(scene, size), Waypoints(points, np.full(len(points), np.nan)))


def forest(rng: np.random.Generator) -> tuple[solids.Scene, tuple[float, float, float]]:
    size = (16.0, 16.0, 3.5)
    items: list[solids.Solid] = [solids.Room((0.0, 0.0, 0.0), size)]
    for x, y in rng.uniform(1.0, 15.0, (25, 2)):
        items.append(solids.Cylinder((x, y, 1.75), float(rng.uniform(0.1, 0.4)), 3.5))
    return solids.Scene(items), size


def rooms(rng: np.random.Generator) -> tuple[solids.Scene, tuple[float, float, float]]:
    """Three rooms in a row, doorways 0.9 to 1.2 m wide and 2.1 m high, and some boxes on the floor or in the air."""
    size = (16.0, 12.0, 3.0)
    items: list[solids.Solid] = [solids.Room((0.0, 0.0, 0.0), size)]
    for x in (5.0, 10.5):
        y, half = rng.uniform(2.0, 10.0), 0.5 * rng.uniform(0.9, 1.2)
        items += [
            solids.Box((x, 0.0, 0.0), (x + 0.2, y - half, 3.0)),
            solids.Box((x, y + half, 0.0), (x + 0.2, 12.0, 3.0)),
            solids.Box((x, y - half - 0.01, 2.1), (x + 0.2, y + half + 0.01, 3.0)),
        ]
    for low in rng.uniform([1.0, 1.0, 0.0], [14.0, 10.0, 2.0], (5, 3)):
        items.append(solids.Box(tuple(low), tuple(low + rng.uniform(0.3, 1.2, 3))))
    return solids.Scene(items), size


def waypoints(
    rng: np.random.Generator, scene: solids.Scene, size: tuple[float, float, float], count: int
) -> np.ndarray:
    points: list[np.ndarray] = []
    while len(points) < count:
        point = rng.uniform(0.5, np.array(size) - 0.5)
        apart = not points or np.linalg.norm(point - points[-1]) > 1.0
        if apart and scene.distance(point[None])[0] > 0.5:
            points.append(point)
    return np.array(points)


def sampled(scene: solids.Scene, size: tuple[float, float, float]) -> esdf.Field:
    cells = np.ceil((np.array(size) + 0.6) / VOXEL_M).astype(int)
    grid = esdf.Grid(np.full(3, -0.3), (VOXEL_M,) * 3, (int(cells[0]), int(cells[1]), int(cells[2])))
    return esdf.build(esdf.rasterize(scene, grid), grid)


def faults(plan: planner.Plan, where: Place, vehicle: Vehicle, required_m: float = 0.3) -> list[str]:
    """What is wrong with a plan, by brute force: 20,000 samples, the closed form, differences for derivatives."""
    path, limits, found = plan.trajectory, vehicle.limits, []
    t = np.linspace(0.0, path.duration_s, 20_001)
    p = path.position(t)
    # Rasterizing moves a surface by at most half a voxel's diagonal.
    if where.scene.distance(p).min() < required_m - 0.5 * VOXEL_M * np.sqrt(3.0):
        found.append("too close to the real surface")
    if where.field.distance(p).min() < required_m:
        found.append("too close in the field")
    gaps = np.linalg.norm(p[:, None] - where.waypoints.positions_world_m, axis=2).min(axis=0)
    if gaps.max() > 0.02:
        found.append("a waypoint is missed")
    dt = t[1]
    if np.linalg.norm(np.diff(p, axis=0), axis=1).max() / dt > limits.speed_m_s * 1.001:
        found.append("too fast")
    if np.linalg.norm(np.diff(p, 2, axis=0), axis=1).max() / dt**2 > limits.acceleration_m_s2 * 1.01:
        found.append("too much acceleration")
    state = flatness.state(vehicle, path, t[::20])
    n, slowest, fastest = state.rotor_speed_rad_s, limits.rotor_speed_min_rad_s, limits.rotor_speed_max_rad_s
    if not ((n >= slowest) & (n <= fastest)).all():
        found.append("rotor speed")
    if np.abs(state.rate_body_rad_s[:, 2]).max() > limits.yaw_rate_rad_s:
        found.append("yaw rate")
    if np.hypot(*state.rate_body_rad_s[:, :2].T).max() > limits.rate_rad_s or state.tilt_rad.max() > limits.tilt_rad:
        found.append("tilt or rate")
    return found
