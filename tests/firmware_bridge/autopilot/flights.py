"""A flight on a simulated autopilot, its guard and planner as in real life, all in lock step."""

import threading
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

import vehicle
from flight import FlightError, FlightLog, Trajectory, TrajectoryFile, silent
from goshawk.commands.fly import autopilot, offboard
from tests.firmware_bridge.autopilot.simulated_autopilot import IDLE, SimulatedAutopilot

MODEL = vehicle.example("rigter2019")


def hover_thrust(kind: str, model: vehicle.Vehicle = MODEL) -> float:
    """What a pilot would have found."""
    weight_n = model.mass_kg * model.gravity_m_s2
    if kind == "px4":
        return offboard.thrust_map(model, idle=IDLE).throttle(weight_n)
    return weight_n / offboard.thrust_map(model, idle=IDLE).force_n(1.0)


def simulated(way: Trajectory, kind: str = "px4", *, model: vehicle.Vehicle = MODEL, **more) -> SimulatedAutopilot:
    """On the ground below the start, set up well but for `more`."""
    start = way.position([0.0])[0]
    name = {"px4": "MPC_THR_HOVER", "ardupilot": "MOT_THST_HOVER"}[kind]
    parameters = {name: hover_thrust(kind, model)} | more.pop("parameters", {})
    still = np.zeros(model.rotors)
    state = vehicle.simulate.State(position_world_m=np.array([start[0], start[1], 0.0]), rotor_speed_rad_s=still)
    plant = vehicle.simulate.Plant(model, state, rng=np.random.default_rng(1), ground_m=0.0)
    return SimulatedAutopilot(plant, kind, parameters, **more)


@dataclass
class Flown:
    """How it ended."""

    log: FlightLog | None = None
    early: str = ""
    error: str = ""


def fly(
    way: Trajectory, simulation: SimulatedAutopilot, *, arms: bool = True, query: str = "",
    cancel: Callable[[], bool] = lambda: False, progress=silent,
) -> Flown:  # fmt: skip
    """`goshawk fly --on mavlink:...` without the command line."""
    failed: list[BaseException] = []

    def run() -> None:
        try:
            simulation.run()
        except BaseException as error:
            failed.append(error)

    thread = threading.Thread(target=run, daemon=True)
    thread.start()
    where = offboard.Where(simulation.address + query, "127.0.0.1", 0, 0.0, simulation.clock_port)
    file = TrajectoryFile(way, "way", "", "", way.position([0.0, way.duration_s]), {})
    flown = Flown()
    try:
        model = simulation.plant.vehicle
        flown.log, flown.early = autopilot.fly(model, file, where, arms=arms, progress=progress, cancel=cancel)
    except FlightError as error:
        flown.error = str(error)
    simulation.given_up = True
    thread.join(60.0)
    simulation.close()
    if failed and not flown.error:
        raise failed[0]
    return flown
