"""Who is named: one uncertainty is planted so that it dominates, and a preflight is asked which one does.

    python benchmarks/preflight_causes.py --draws 30 --json build/bench/preflight_causes.json

Every flight is simulated. A draw is a room, a way there and back in it, a size of the planted uncertainty, and how much
larger its variance is than that of all else together (2 to 8 times), to which all else is scaled. That is told without
the decomposition that is judged: by flights of the planted one alone, and of all else alone; as many as are judged,
as a variance of few hangs on one wild flight.
"""

import sys
from dataclasses import dataclass, fields, replace
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

import report

import preflight
from flight import FloatArray, Trajectory
from preflight.draws import LOCALIZATION_STD_M, Uncertainty
from preflight.result import Result, spread
from tests.preflight import conftest
from vehicle import Vehicle

RADIUS_M, CLEARANCE_M, RATE_HZ = 0.2, 1.0, 400
FLIGHTS, TRUE_SEED = 300, 999
RATIOS = (2.0, 8.0)
LEAST_REST = 0.03
"""Of its usual size, to which all that is not planted may be scaled: a pose to half a millimetre, as by cameras on a
laboratory's walls. The controller's observer leaves little more of drag."""
ALONE = 1e-6
"""The same, to fly what is planted alone."""
MOST_TRIES = 10
MODEL = {
    "mass_kg": 0.005, "thrust_bem.k1_n_s2": 0.01, "motor_lag.rise_s": 0.1, "rotor_drag_thrust.drag_s_m": 0.1,
    "parasitic_drag.drag_xy_kg_m": 0.1, "centre_of_mass.x_m": 0.4, "centre_of_mass.y_m": 3.0,
}  # fmt: skip
"""Relative standard deviations of a well identified model; a centre of mass is known to half a millimetre."""
WORLD = Uncertainty(wind_m_s=0.5, gust_std_m_s=0.2, pose_delay_std_s=0.003, localization_std_m=LOCALIZATION_STD_M)


@dataclass(frozen=True, slots=True)
class Cause:
    """What is planted."""

    factors: tuple[str, ...]
    """Any of which a draw plants, by its name in a preflight."""
    sizes: tuple[float, float]
    """Standard deviations: relative ones of the model's, else in SI."""
    field: str | None = None
    """Of `Uncertainty`; None: a parameter of the model."""


CAUSES = {
    "drag": Cause(("parasitic_drag.drag_xy_kg_m", "rotor_drag_thrust.drag_s_m"), (0.3, 0.9)),
    "mass": Cause(("mass_kg",), (0.02, 0.08)),
    "delay": Cause(("pose delay",), (0.004, 0.015), "pose_delay_std_s"),
    "wind": Cause(("wind",), (1.5, 4.0), "wind_m_s"),
    "map scale": Cause(("map scale",), (0.015, 0.06), "map_scale_std_ratio"),
    "centre of mass": Cause(("centre_of_mass.x_m",), (2.0, 8.0)),
}


class Room:
    """A box, in the world's axes."""

    def __init__(self, low_m: FloatArray, high_m: FloatArray) -> None:
        self.low_m, self.high_m = low_m, high_m

    def distance(self, points_world_m):
        points = np.asarray(points_world_m)
        return np.minimum(points - self.low_m, self.high_m - points).min(axis=1)


@dataclass(frozen=True, slots=True)
class Scene:
    """A way and its room."""

    path: Trajectory
    room: Room
    pose_of_map: bool

    @staticmethod
    def drawn(rng: np.random.Generator) -> "Scene":
        """4 to 10 m there and back, at most 5 to 9 m/s2, in any direction and to another height; walls within 0.8 m,
        floor and ceiling within 1.2 m of the vehicle."""
        length_m, most_m_s2, turned = rng.uniform(4.0, 10.0), rng.uniform(5.0, 9.0), rng.uniform(0.0, 2.0 * np.pi)
        one = conftest.there_and_back(length_m, float(np.sqrt(10.0 / np.sqrt(3.0) * length_m / most_m_s2)))
        coefficients, along = one.coefficients.copy(), one.coefficients[:, 0]
        coefficients[:, 0], coefficients[:, 1] = np.cos(turned) * along, np.sin(turned) * along
        coefficients[:, 2] += rng.uniform(-0.15, 0.15) * along
        path = Trajectory(one.durations_s, coefficients)
        ways = path.position(np.linspace(0.0, path.duration_s, 50))
        away = [RADIUS_M + rng.uniform([0.3, 0.3, 0.6], [0.8, 0.8, 1.2]) for _ in range(2)]
        return Scene(path, Room(ways.min(axis=0) - away[0], ways.max(axis=0) + away[1]), bool(rng.integers(2)))

    def fly(self, drone: Vehicle, uncertainty: Uncertainty, flights: int, seed: int) -> Result:
        options = preflight.Options(
            flights=flights, seed=seed, uncertainty=replace(uncertainty, pose_of_map=self.pose_of_map), rate_hz=RATE_HZ,
            rare=False, explain=False, decide_only=seed == TRUE_SEED, risk=0.5,
        )  # fmt: skip
        return preflight.fly(
            preflight.Scenario(drone, self.path, self.room, radius_m=RADIUS_M, clearance_m=CLEARANCE_M), options
        )

    def variance(self, drone: Vehicle, uncertainty: Uncertainty) -> float:
        return float(np.nanvar(spread(self.fly(drone, uncertainty, FLIGHTS, TRUE_SEED).record)))


def background(size: float) -> tuple[Vehicle, Uncertainty]:
    """All but what is planted, so many times its usual size."""
    drone = conftest.exact_vehicle()
    for name, ratio in MODEL.items():
        drone = drone.with_value(name, drone.value(name), std=size * ratio * abs(drone.value(name)))
    scaled = {
        f.name: size * getattr(WORLD, f.name)
        for f in fields(Uncertainty)
        if f.name == "noise_ratio" or "_std_" in f.name or f.name in ("wind_m_s", "rotor_wear_ratio")
    }
    return drone, replace(WORLD, **scaled)


def planted(cause: Cause, factor: str, size: float, rest: float) -> tuple[Vehicle, Uncertainty]:
    drone, world = background(rest)
    if cause.field is not None:
        return drone, replace(world, **{cause.field: size})
    value = drone.value(factor)
    return drone.with_value(factor, value, std=size * abs(value)), world


@dataclass(frozen=True, slots=True)
class Draw:
    """What was planted where."""

    scene: Scene
    factor: str
    drone: Vehicle
    world: Uncertainty
    rest: float
    """Of its usual size, that all else has."""


def drawn(what: str, number: int) -> Draw | None:
    """A draw in which the cause dominates; None where it does in none of several rooms."""
    cause, rng = CAUSES[what], np.random.default_rng((number, list(CAUSES).index(what)))
    for _ in range(MOST_TRIES):
        scene, factor = Scene.drawn(rng), str(rng.choice(cause.factors))
        size, ratio = (float(np.exp(rng.uniform(*np.log(ends)))) for ends in (cause.sizes, RATIOS))
        alone = scene.variance(*planted(cause, factor, size, ALONE))
        rest = min(float(np.sqrt(alone / (ratio * scene.variance(*background(1.0))))), 1.0)
        if rest >= LEAST_REST:
            return Draw(scene, factor, *planted(cause, factor, size, rest), rest)
    return None


def named(draw: Draw, number: int) -> tuple[bool, str]:
    """Whether a preflight names what was planted first, and a sentence on it."""
    found = draw.scene.fly(draw.drone, draw.world, FLIGHTS, 2000 + number)
    good = found.dominating is not None and draw.factor in found.dominating[0].split(" with ")
    deviation_mm = 1e3 * float(np.nanstd(spread(found.record)))
    shares, lost = ({k: round(v, 2) for k, v in list(each.items())[:3]} for each in (found.shares, found.loss_shares))
    return good, (
        f"draw {number}, {draw.factor}: {deviation_mm:.1f} mm, the rest {draw.rest:.2f} of its usual size; named "
        f"{found.dominating and found.dominating[0]}; {shares}; {found.lost.count} lost, {lost}"
    )


def rows(draws: int, first: int) -> list[report.Row]:
    """Plant each cause in as many rooms; 30 draws take about an hour of processor time.

    A draw in which the cause dominates in no room is left out, and said so. `first`: number of the first draw.
    """
    hits: dict[str, list[bool]] = {what: [] for what in CAUSES}
    for number in range(first, first + draws):
        for what in CAUSES:
            draw = drawn(what, number)
            if draw is None:
                print(f"left out draw {number}, {what}: it dominates nowhere", file=sys.stderr, flush=True)
                continue
            good, sentence = named(draw, number)
            hits[what].append(good)
            print("named" if good else "MISSED", sentence, file=sys.stderr, flush=True)
    return [
        report.row(
            f"planted {what}: named first, of {len(found)}", np.mean(found), "", ">= .95", np.mean(found) >= 0.95
        )
        for what, found in hits.items()
    ]


if __name__ == "__main__":
    report.main(rows, draws=5, first=0)
