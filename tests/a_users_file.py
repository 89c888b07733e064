"""Thirty lines as a user writes them: `test_wheel.py` runs them, and two type checkers read them."""

import sys
from pathlib import Path

import numpy as np

import planner
import sysid
import vehicle
from esdf import solids
from flight import FlightLog, Waypoints, flight_log, trajectory


def planned(drone: vehicle.Vehicle, file: Path) -> trajectory.Trajectory:
    hall = solids.Scene([solids.Room((0, 0, 0), (8, 6, 3)), solids.Cylinder((4, 3, 1.5), 0.4, 3)])
    points = np.array([[1.0, 1.0, 1.0], [4.0, 5.0, 1.5], [7.0, 1.0, 1.0]])
    plan: planner.Plan = planner.plan(Waypoints(points, np.full(3, np.nan)), hall, drone)
    planner.save_plan(file, plan, name="lap")
    return trajectory.load(file).trajectory


def thrust_coefficient(log: FlightLog, drone: vehicle.Vehicle) -> tuple[float, float]:
    fit: sysid.Identification = sysid.identify([log], drone, sysid.Options(unseen="hold"))
    found = fit.estimate("thrust_bem.k1_n_s2")
    return found.value, found.std_robust


if __name__ == "__main__":
    folder, rng = Path(sys.argv[1]), np.random.default_rng(0)
    drone = vehicle.load(folder / "vehicle.toml")
    flown = vehicle.flights.fly_trajectory(drone, planned(drone, folder / "lap.json"), rng=rng)
    flight_log.save(folder / "lap.parquet", vehicle.flights.measure(flown, rng=rng))
    value, std = thrust_coefficient(sysid.read_log(folder / "lap.parquet"), drone)
    print(f"k1 = {value:.4g} +- {std:.1g} N s2")
