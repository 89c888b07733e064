"""Fly, identify, fly again: tracking error before and after learning, on a second flight of the same course."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

import sysid
from firmware_bridge import Sensors, closed_loop, controller
from firmware_bridge.airborne import in_the_air
from flight import FlightLog, Trajectory
from sysid.diagnosis import diagnose
from vehicle import Vehicle, simulate

Learn = Callable[[Sequence[FlightLog], Vehicle], Vehicle]
"""From flights and the present model to a better one."""


@dataclass(frozen=True, slots=True)
class SecondFlight:
    """Mean tracking error of a course before and after learning."""

    learned: Vehicle
    added: tuple[str, ...]
    """Effects of the learned model that the first model lacked."""
    before_m: float
    after_m: float
    known_m: float
    """With the true model in the controller: the best that learning can reach."""
    not_compensated: tuple[str, ...]
    """Effects of the learned model that the controller does not compensate."""


def fly_again(
    truth: Vehicle,
    believed: Vehicle,
    course: Trajectory,
    learn: Learn,
    *,
    training: Sequence[Trajectory] = (),
    gust_std_m_s: float = 0.2,
    seed: int = 0,
) -> SecondFlight:
    """Fly the course (and training flights), learn from the logs, and fly the course with the learned parameters.

    The controller is the embedded one; its estimate is noisy and 10 ms old, and every flight has gusts of its own.
    """
    before = _fly(truth, believed, course, gust_std_m_s, seed)
    lessons = [_fly(truth, believed, t, gust_std_m_s, seed + 10 + i) for i, t in enumerate(training)]
    logs = [in_the_air(flown.log, f"flight {i}") for i, flown in enumerate([before, *lessons])]
    learned = learn(logs, believed)
    after = _fly(truth, learned, course, gust_std_m_s, seed + 1)
    known = _fly(truth, truth, course, gust_std_m_s, seed + 1)
    return SecondFlight(
        learned=learned,
        added=tuple(name for name in learned.effects if name not in believed.effects),
        before_m=float(before.error_m.mean()),
        after_m=float(after.error_m.mean()),
        known_m=float(known.error_m.mean()),
        not_compensated=controller.parameters_of(learned).not_compensated,
    )


def adding(effect: str, options: sysid.Options | None = None) -> Learn:
    """A `Learn` that adds one effect and fits all identifiable parameters, or those that the options leave free."""

    def learn(logs: Sequence[FlightLog], believed: Vehicle) -> Vehicle:
        return sysid.identify(logs, believed.with_effect(effect), options).vehicle

    return learn


def diagnosing(logs: Sequence[FlightLog], believed: Vehicle) -> Vehicle:
    """A `Learn` without a given effect: the flights are diagnosed to the end, and every confirmed effect is added.

    A model in which nothing was confirmed is not flown: the missing effect may have biased its other parameters.
    """
    found = diagnose(logs, believed, auto=True)
    return found.vehicle if found.additions or found.proxies else believed


def _fly(
    truth: Vehicle, believed: Vehicle, trajectory: Trajectory, gust_std_m_s: float, seed: int
) -> closed_loop.Flown:
    start = simulate.State(trajectory.position([0.0])[0] * [1.0, 1.0, 0.0])
    wind = simulate.Wind(gust_std_m_s=gust_std_m_s)
    plant = simulate.Plant(truth, start, rng=np.random.default_rng(seed), wind=wind, ground_m=0.0)
    setup = controller.parameters_of(believed)
    return closed_loop.fly(plant, setup, trajectory, sensors=Sensors.typical(), seed=seed)
