"""Our planner beside the methods of others in the same cluttered places: the corridor, Bry et al., OMPL's searches.

Every flight is flown to the same limits of the same vehicle and is checked by brute force.
"""

import time
from dataclasses import replace

import numpy as np
import planner_scenes
import report

import planner
import vehicle
from flight import InfeasibleError
from planner.request.options import SEARCHES


def rows(seeds: int = 10) -> list[report.Row]:
    drone = planner_scenes.clutter_vehicle(vehicle.example("rigter2019"))
    options = planner.PlanOptions(radius_m=0.1, margin_m=0.1, control_reserve=0.0)
    ours = flights(drone, options, seeds)
    found = [report.row("fastest: planning, median", ours.median_s, "CPU s")]
    corridor = flights(drone, replace(options, method="corridor"), seeds)
    ratios = [b / a for a, b in zip(ours.duration_s, corridor.duration_s, strict=True)]
    stops = int(np.sum(corridor.stops))
    found += [
        report.row(
            "corridor: solved", corridor.solved, "scenes", f"{corridor.count}", corridor.solved == corridor.count
        ),
        report.row("  stops that nobody asked for", stops, "stops", "0", stops == 0),
        report.row("  flight time over the fastest, worst", np.nanmax(ratios), "x", "< 1.2", np.nanmax(ratios) < 1.2),
        report.row("  planning, median", corridor.median_s, "CPU s", "< 0.5", corridor.median_s < 0.5),
        report.row("  planning, longest", corridor.longest_s, "CPU s", "< 0.5", corridor.longest_s < 0.5),
        report.row("  plans that fail the brute-force check", corridor.faulty, "plans", "0", corridor.faulty == 0),
    ]
    found += compared("Bry et al. 2015", flights(drone, replace(options, method="bry"), seeds), ours)
    for search in SEARCHES[1:]:
        found += compared(f"fastest, {search}", flights(drone, replace(options, search=search), min(seeds, 2)), ours)
    return found


def compared(name: str, other: "Flights", ours: "Flights") -> list[report.Row]:
    """What another method solves, how long its flights are beside ours in the same scenes, and its time."""
    both = [(ours.by_place[p], T) for p, T in other.by_place.items() if p in ours.by_place]
    ratio = float(np.median([T / mine for mine, T in both])) if both else float("nan")
    return [
        report.row(f"{name}: solved", other.solved, "scenes", f"{other.count}", None),
        report.row("  flight time over ours, median", ratio, "x"),
        report.row("  planning, median", other.median_s, "CPU s"),
        report.row("  plans that fail the brute-force check", other.faulty, "plans", "0", other.faulty == 0),
    ]


class Flights:
    """What one method made of all places."""

    def __init__(self) -> None:
        self.by_place: dict[tuple[str, int], float] = {}
        self.duration_s: list[float] = []
        self.stops: list[int] = []
        self.seconds: list[float] = []
        self.faulty = 0

    @property
    def count(self) -> int:
        return len(self.seconds)

    @property
    def solved(self) -> int:
        return len(self.by_place)

    @property
    def median_s(self) -> float:
        return float(np.median(self.seconds))

    @property
    def longest_s(self) -> float:
        return float(np.max(self.seconds))


def flights(drone: vehicle.Vehicle, options: planner.PlanOptions, seeds: int) -> Flights:
    """Plan in every kind of clutter; a place without a plan has a NaN duration."""
    found = Flights()
    for kind in planner_scenes.CLUTTER:
        for seed in range(seeds):
            place = planner_scenes.clutter(kind, seed)
            begun = time.process_time()
            try:
                plan = planner.plan(place.waypoints, place.field, drone, options)
            except InfeasibleError:
                found.duration_s.append(float("nan"))
                continue
            finally:
                found.seconds.append(time.process_time() - begun)
            path = plan.trajectory
            found.by_place[kind, seed] = path.duration_s
            found.duration_s.append(path.duration_s)
            found.stops.append(int((np.linalg.norm(path.position(path.starts_s[1:-1], 1), axis=1) < 0.05).sum()))
            found.faulty += bool(planner_scenes.faults(plan, place, drone, 0.2))
    return found


if __name__ == "__main__":
    report.main(rows)
