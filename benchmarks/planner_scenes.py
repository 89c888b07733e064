"""Seeded places to plan in: forests of pillars, furnished rooms with doorways; and an independent check."""

from dataclasses import dataclass

import numpy as np

import esdf
import planner
from esdf import solids
from flight import Waypoints
from flight.mission import Gate, Mission
from planner.route import routes, simplify
from vehicle import Parameter, Vehicle, draft, example, flatness, invert

OPTIONS = planner.PlanOptions(radius_m=0.15)
"""Gaps are drawn for a clearance of 0.3 m; the example vehicle reaches 0.189 m."""
VOXEL_M = 0.1
_STEP_M, _SWAY_M = 0.33, 0.3
"""Between recorded positions of a walk, and how far it sways."""


@dataclass(frozen=True)
class Place:
    """A scene in closed form, its sampled field, and waypoints that are themselves free."""

    kind: str
    scene: solids.Scene
    field: esdf.Field
    waypoints: Waypoints


@dataclass(frozen=True)
class Clutter:
    """A cluttered place in closed form, its sampled field, and the two points to fly between."""

    scene: solids.Scene
    field: esdf.Field
    waypoints: Waypoints


def place(seed: int) -> Place:
    """Even seeds are forests, odd ones rooms."""
    rng = np.random.default_rng(seed)
    kind, scene, size = ("forest", *forest(rng)) if seed % 2 == 0 else ("rooms", *rooms(rng))
    points = waypoints(rng, scene, size, int(rng.integers(2, 8)))
    return Place(kind, scene, sampled(scene, size), Waypoints(points, np.full(len(points), np.nan)))


def forest_of_ten(seed: int) -> Place:
    """A forest and ten waypoints in it."""
    rng = np.random.default_rng(seed)
    scene, size = forest(rng)
    points = waypoints(rng, scene, size, 10)
    return Place("forest", scene, sampled(scene, size), Waypoints(points, np.full(len(points), np.nan)))


def walked(seed: int) -> Place:
    """The places of `place`, and waypoints along a swaying walk through them.

    Where it came too close they are left out, and many of the others keep little more than the clearance required.
    """
    where, rng = place(seed), np.random.default_rng(seed + 10_000)
    route = routes.find(where.waypoints, where.field, OPTIONS).points
    lengths = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(route, axis=0), axis=1))])
    at = np.arange(0.0, lengths[-1], _STEP_M)
    walk = np.stack([np.interp(at, lengths, route[:, axis]) for axis in range(3)], axis=1)
    waves = rng.normal(size=(2, 3, 3)) * _SWAY_M / np.sqrt(3.0)
    turns = 2.0 * np.pi * at[:, None] / rng.uniform(1.5, 6.0, 3)
    walk += np.sin(turns) @ waves[0] + np.cos(turns) @ waves[1]
    kept, _ = simplify.waypoints_along(walk, 0.1, where.field, OPTIONS)
    return Place(f"walk, {where.kind}", where.scene, where.field, kept)


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


def faults(plan: planner.Plan, where: Place | Clutter, vehicle: Vehicle, required_m: float = 0.3) -> list[str]:
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


CLUTTER = ("forest .05", "forest .15", "forest .25", "office", "maze")
"""Kinds of cluttered place; the numbers are trunks per square metre."""


def clutter(kind: str, seed: int) -> Clutter:
    """A forest 40 x 20 x 3 m, an office of 5 x 3 rooms of 5 m, or a maze of 10 x 10 cells of 2 m."""
    rng = np.random.default_rng(seed)
    if kind == "office":
        items, size = _office(rng), (25.0, 15.0, 3.0)
        start, goal = (1.0, 1.0), (24.0, 14.0)
    elif kind == "maze":
        items, size = _maze(rng), (20.0, 20.0, 3.0)
        start, goal = (1.0, 1.0), (19.0, 19.0)
    else:
        size = (40.0, 20.0, 3.0)
        start, goal = (1.0, 10.0), (39.0, 10.0)
        items = _trunks(rng, float(kind.split()[1]), np.array([start, goal]))
    points = np.array([[*start, 1.2], [*goal, 1.2]])
    scene = solids.Scene([solids.Room((0.0, 0.0, 0.0), size), *items])
    return Clutter(scene, sampled(scene, size), Waypoints(points, np.full(2, np.nan)))


def _trunks(rng: np.random.Generator, per_m2: float, ends: np.ndarray) -> list[solids.Solid]:
    """Trunks at least 0.9 m apart (between bark and bark), none within 1.2 m of either end."""
    placed: list[tuple[float, float, float]] = []
    for _ in range(100_000):
        if len(placed) >= per_m2 * 800.0:
            break
        x, y, radius = rng.uniform((0.0, 0.0, 0.15), (40.0, 20.0, 0.35))
        apart = all(np.hypot(x - a, y - b) > radius + r + 0.9 for a, b, r in placed)
        if apart and np.hypot(*(ends - (x, y)).T).min() > radius + 1.2:
            placed.append((x, y, radius))
    return [solids.Cylinder((x, y, 1.5), radius, 3.0) for x, y, radius in placed]


def _walls(open_doors: set[tuple[int, int, int]], cells: tuple[int, int], edge_m: float) -> list[solids.Solid]:
    """Inner walls 0.1 m thick between cells; door (i, j, axis) leads from cell (i, j) one step up that axis."""
    half, items = 0.05, []
    for i, j, axis in np.ndindex(*cells, 2):
        if (i + (axis == 0), j + (axis == 1)) >= cells or i + (axis == 0) >= cells[0] or j + (axis == 1) >= cells[1]:
            continue
        low, high = np.array([i, j]) * edge_m, np.array([i + 1, j + 1]) * edge_m
        low[axis], high[axis] = high[axis] - half, high[axis] + half
        spans = [(low, high)]
        if (i, j, axis) in open_doors:
            if edge_m < 3.0:  # a maze: the whole side is open
                continue
            across, middle = 1 - axis, 0.5 * (low[1 - axis] + high[1 - axis])
            left, right = high.copy(), low.copy()
            left[across], right[across] = middle - 0.5, middle + 0.5
            spans = [(low, left), (right, high)]
        items += [solids.Box((a[0], a[1], 0.0), (b[0], b[1], 3.0)) for a, b in spans]
    return items


def _spanning_tree(rng: np.random.Generator, cells: tuple[int, int]) -> set[tuple[int, int, int]]:
    """Doors that join all cells in one way only, by a random walk with backtracking."""
    doors, seen, stack = set(), {(0, 0)}, [(0, 0)]
    while stack:
        i, j = stack[-1]
        steps = [(i + a, j + b) for a, b in ((1, 0), (-1, 0), (0, 1), (0, -1))]
        free = [c for c in steps if 0 <= c[0] < cells[0] and 0 <= c[1] < cells[1] and c not in seen]
        if not free:
            stack.pop()
            continue
        nxt = free[int(rng.integers(len(free)))]
        doors.add((min(i, nxt[0]), min(j, nxt[1]), int(nxt[1] != j)))
        seen.add(nxt)
        stack.append(nxt)
    return doors


def _office(rng: np.random.Generator) -> list[solids.Solid]:
    """Doors 1 m wide in the middle of half of the walls, all rooms joined; two boxes stand in each room."""
    doors = _spanning_tree(rng, (5, 3))
    doors |= {(i, j, a) for i, j, a in np.ndindex(5, 3, 2) if rng.uniform() < 0.4}
    items = _walls(doors, (5, 3), 5.0)
    for i, j in np.ndindex(5, 3):
        for _ in range(2):
            edge = rng.uniform(0.4, 1.0, 2)
            corner = np.array([i, j]) * 5.0 + rng.uniform(1.2, 3.0, 2)
            items.append(solids.Box((*corner, 0.0), (*(corner + edge), rng.uniform(0.8, 3.0))))
    return items


def _maze(rng: np.random.Generator) -> list[solids.Solid]:
    return _walls(_spanning_tree(rng, (10, 10)), (10, 10), 2.0)


def clutter_vehicle(drone: Vehicle) -> Vehicle:
    """The vehicle of the clutter benchmark: 8 m/s, 60 degrees, 2 to 14 N in all at 0.7 kg."""
    hover_n, hover_rad_s = drone.mass_kg * 9.80665, float(np.mean(invert.hover(drone)))
    slowest, fastest = (hover_rad_s * np.sqrt(thrust_n / hover_n) for thrust_n in (2.0, 14.0))
    return drone.with_limits(
        speed_m_s=8.0,
        acceleration_m_s2=20.0,
        tilt_rad=np.deg2rad(60.0),
        rotor_speed_min_rad_s=float(slowest),
        rotor_speed_max_rad_s=float(fastest),
    )


def vehicles() -> dict[str, Vehicle]:
    """The example, and two of which only a data sheet is known: 250 g on 3 inches, and 1.5 kg on 7 inches."""
    whoop = _from_sheet(mass_kg=0.25, arm_m=0.07, diameter_m=0.076)
    large = _from_sheet(mass_kg=1.5, arm_m=0.16, diameter_m=0.178)
    return {
        "rigter2019": example("rigter2019"),
        "whoop": whoop.with_limits(speed_m_s=8.0, acceleration_m_s2=10.0, tilt_rad=0.9, rate_rad_s=8.0),
        "7-inch": large.with_limits(speed_m_s=10.0, acceleration_m_s2=8.0, tilt_rad=0.9, rate_rad_s=5.0),
    }


def _from_sheet(mass_kg: float, arm_m: float, diameter_m: float) -> Vehicle:
    hubs, spin = draft.layout(arm_m, "x")
    mass, radius = Parameter(mass_kg, 0.0, "kg", "given"), Parameter(0.5 * diameter_m, 0.0, "m", "given")
    return draft.draft(draft.Known(mass_kg=mass, hub_body_m=hubs, spin=spin, rotor_radius_m=radius))


def walk(count: int, seed: int) -> np.ndarray:
    """(count, 3) waypoints of a random walk in the open."""
    return np.cumsum(np.random.default_rng(seed).normal(size=(count, 3)) * [3.0, 3.0, 0.7], axis=0)


def gate_course(seed: int, off_rad: float) -> Mission:
    """Five to ten gates of .6 to 2 m in the open, 2.5 to 7 m apart, each turned at random.

    Args:
        off_rad: how far a gate may be turned from the direction between its neighbours.
    """
    rng = np.random.default_rng(seed)
    count, heading_rad = int(rng.integers(5, 11)), 0.0
    points = [np.array([0.0, 0.0, 2.0])]
    for _ in range(count + 1):
        heading_rad += rng.uniform(-1.6, 1.6)
        step = np.array([np.cos(heading_rad), np.sin(heading_rad), rng.uniform(-0.3, 0.3)])
        points.append(points[-1] + rng.uniform(2.5, 7.0) * step)
    gates = []
    for i in range(1, count + 1):
        x, y, _ = points[i + 1] - points[i - 1]
        turned = [np.arctan2(y, x) + rng.uniform(-off_rad, off_rad), *rng.uniform(-0.7, 0.7, 2)]
        gates.append(Gate(i, *rng.uniform(0.6, 2.0, 2).tolist(), *np.array(turned).tolist()))
    return Mission(Waypoints(np.array(points), np.full(count + 2, np.nan)), gates=tuple(gates))
