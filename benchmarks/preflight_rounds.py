"""Plan, preflight, plan: rounds until the risk is met, and how long the plan takes beside the best uniform scaling.

    python benchmarks/preflight_rounds.py --json build/bench/preflight_rounds.json

Every flight is simulated, in a room with two pillars made from solids. The scaling is searched by halving: the first
plan, flown slower as a whole, until the same flights are a go.
"""

import json
import sys
import tempfile
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

import report

import mapping
import preflight
import vehicle
from flight import Trajectory, trajectory
from goshawk.commands.plan import preflight_inputs
from tests import conftest
from tests.goshawk.running import answer
from vehicle import Vehicle

RISK, FIRST_MARGIN_M, GUST_STD_M_S = 0.01, 0.05, 1.0
MOST_ROUNDS, SLOWEST = 5, 4.0
WAYS = {
    "between the pillars": "0.8,0.8,1.0\n3.0,2.0,1.3\n5.2,0.8,1.0\n",
    "round the room": "0.8,0.8,1.0\n3.0,2.0,1.3\n5.2,0.8,1.0\n5.0,3.4,1.6\n1.0,3.2,1.2\n",
    "along a wall": "0.8,0.6,1.2\n5.2,0.6,1.2\n",
}


def rounds(folder: Path, name: str, way: str, flights: int) -> tuple[int, float, float]:
    """Rounds until a go, the duration of that plan, and that of the best scaling of the first; in seconds."""
    world = ("--map", folder / "map", "--vehicle", folder / "vehicle.toml")
    points = folder / f"{name}.csv"
    points.write_text(f"x,y,z\n{way}")
    flown = ("--flights", flights, "--risk", RISK, "--gust-std", GUST_STD_M_S, "-q", "--overwrite")
    first, plan, found = (folder / f"{name} {kind}.json" for kind in ("first", "plan", "found"))
    for turn in range(1, MOST_ROUNDS + 1):
        asked = ("--margin", FIRST_MARGIN_M) if turn == 1 else ("--preflown", found)
        planned = answer("plan", points, *world, *asked, "--out", plan, "-q", "--overwrite")
        if planned.returncode:
            raise RuntimeError(planned.stderr)
        if turn == 1:
            first.write_bytes(plan.read_bytes())
        ended = answer("preflight", plan, *world, *flown, "--out", found)
        if ended.returncode == 0 or json.loads(found.read_text())["plan_again"] is None:
            break
    taken_s = trajectory.load(plan).trajectory.duration_s if ended.returncode == 0 else float("nan")
    return turn, taken_s, _scaled(folder, first, flights)


def _scaled(folder: Path, first: Path, flights: int) -> float:
    """Duration of the least uniform slowing down of a plan that is a go; NaN if none up to `SLOWEST` is."""
    item, drone, area = trajectory.load(first), vehicle.load(folder / "vehicle.toml"), mapping.open_map(folder / "map")
    radius_m, clearance_m = preflight_inputs.body_of(item, drone)
    weather = preflight_inputs.of_map(area, preflight.Uncertainty(gust_std_m_s=GUST_STD_M_S))
    options = preflight.Options(flights, RISK, uncertainty=weather, decide_only=True)

    def is_go(factor: float) -> bool:
        path = item.trajectory.scale_time(factor)
        return _go(drone, path, area, radius_m, clearance_m, options)

    if not is_go(SLOWEST):
        return float("nan")
    low, high = 1.0, SLOWEST
    while high / low > 1.02:
        middle = (low * high) ** 0.5
        low, high = (low, middle) if is_go(middle) else (middle, high)
    return high * item.trajectory.duration_s


def _go(
    drone: Vehicle, path: Trajectory, area: mapping.Map, radius_m: float, clearance_m: float, options: preflight.Options
) -> bool:
    return preflight.fly(drone, path, area.field, radius_m=radius_m, clearance_m=clearance_m, options=options).go


def rows(flights: int = 300) -> list[report.Row]:
    """Measure all ways; the default takes some five minutes of processor time."""
    found: list[report.Row] = []
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        (folder / "map").mkdir()
        conftest._make_pillar_map(folder / "map")
        vehicle.save(folder / "vehicle.toml", vehicle.example())
        for name, way in WAYS.items():
            turns, taken_s, scaled_s = rounds(folder, name, way, flights)
            met, ratio = taken_s == taken_s, taken_s / scaled_s
            kept = met and not ratio > 1.05  # NaN: no scaling is a go at all
            found += [
                report.row(f"{name}: rounds until a go", turns, "", "<= 3", met and turns <= 3),
                report.row("... the plan's duration", taken_s, "s"),
                report.row("... over the best uniform scaling's (nan: none is a go)", ratio, "x", "<= 1.05", kept),
            ]
    return found


if __name__ == "__main__":
    report.main(rows, flights=300)
