"""Whether an effect is identifiable: plant it, fly the manoeuvres that excite it, and recover its values.

Every entry of the catalogue, and every effect of the user's own, must pass. The test is easier than
identification: all other parameters are known, and accelerations are measured directly.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from flight import FloatArray
from vehicle import dynamics, files, flatness
from vehicle.effects.base import Effect, Stage
from vehicle.forces import Surroundings
from vehicle.model import Vehicle
from vehicle.simulation import flights, manoeuvres

ACCELERATION_NOISE_M_S2 = 0.1
TURN_NOISE_RAD_S2 = 1.0
ROTOR_SPEED_NOISE_RAD_S = 4.0
_SAMPLE_S = 0.02
_ITERATIONS = 8

Model = Callable[[Vehicle], FloatArray]
"""Sensor readings of a candidate vehicle, each divided by its noise."""


@dataclass(frozen=True, slots=True)
class Recovery:
    """Planted values and recovered ones."""

    names: tuple[str, ...]
    planted: FloatArray
    found: FloatArray
    std: FloatArray
    """Standard deviations of `found`."""

    @property
    def passed(self) -> bool:
        """Every value within four standard deviations, and the largest planted one found at five or more."""
        close = (np.abs(self.found - self.planted) < 4.0 * self.std).all()
        return bool(close and (np.abs(self.planted) / self.std).max() > 5.0)


def run(name: str, *, rng: np.random.Generator, base: Vehicle | None = None) -> Recovery:
    """Plant an effect (by name) on a vehicle and recover it from noisy measurements.

    Args:
        base: the vehicle the effect is added to; the paper's if not given.
    """
    base = base or files.example()
    effect = base.effect(name)
    truth = base.with_effect(name, source="planted", **{s.name: s.planted for s in effect.parameters})
    model = _model(effect, truth)
    reading = model(truth)
    return _recover(effect, truth, model, reading + rng.normal(0.0, 1.0, reading.shape))


def _recover(effect: Effect, truth: Vehicle, model: Model, measured: FloatArray) -> Recovery:
    """Gauss-Newton with numeric slopes, from the default values; the prior only bounds the first steps."""
    free = [s for s in effect.parameters if not s.held]
    prior, planted = np.array([s.prior for s in free]), np.array([s.planted for s in free])

    def at(values: FloatArray) -> FloatArray:
        named = {s.name: float(value) for s, value in zip(free, values, strict=True)}
        return model(truth.with_effect(effect.name, source="candidate", **held, **named))

    held = {s.name: s.planted for s in effect.parameters if s.held}
    low, high = np.array([s.bounds for s in free]).T
    found = np.minimum(np.maximum([s.default + 0.3 * s.prior for s in free], low), high)
    precision = np.zeros((len(free), len(free)))
    for _ in range(_ITERATIONS):
        slopes = np.stack([_slope(at, found, i, 1e-4 * prior[i]) for i in range(len(free))], axis=1)
        precision = slopes.T @ slopes
        step = np.linalg.solve(precision + np.diag(1e-2 / prior**2), slopes.T @ (measured - at(found)))
        found = np.minimum(np.maximum(found + step, low), high)
    std = np.sqrt(np.diag(np.linalg.inv(precision + np.diag(1e-2 / prior**2))))
    return Recovery(tuple(s.name for s in free), planted, found, std)


def _slope(at: Callable[[FloatArray], FloatArray], values: FloatArray, i: int, step: float) -> FloatArray:
    up, down = values.copy(), values.copy()
    up[i] += step
    down[i] -= step
    return (at(up) - at(down)) / (2.0 * step)


def _model(effect: Effect, truth: Vehicle) -> Model:
    if effect.stage in (Stage.COMMAND, Stage.DRIVE):
        return _rotor_speeds
    if effect.stage == Stage.SENSOR:
        return _sensor_model(effect, truth)
    return _acceleration_model(effect, truth)


def _acceleration_model(effect: Effect, truth: Vehicle) -> Model:
    """Specific force and angular acceleration along the exciting manoeuvres, flown by the true vehicle."""
    motions, surroundings = zip(*(_motion(truth, name) for name in effect.excited_by), strict=True)
    motion = np.concatenate(motions)
    around = Surroundings(
        *(np.concatenate([getattr(s, name) for s in surroundings]) for name in Surroundings.__slots__)
    )

    def model(candidate: Vehicle) -> FloatArray:
        force, turn = dynamics.acceleration(candidate, motion[:, :3], motion[:, 3:6], motion[:, 6:], around)
        return np.concatenate([(force / ACCELERATION_NOISE_M_S2).ravel(), (turn / TURN_NOISE_RAD_S2).ravel()])

    return model


def _motion(truth: Vehicle, name: str) -> tuple[FloatArray, Surroundings]:
    """Air speed, body rate and rotor speed (n, 6 + r) along a manoeuvre, with its surroundings."""
    trajectory = manoeuvres.make(name)
    flat = flatness.state(truth, trajectory, trajectory.sample(_SAMPLE_S)[:-1], ground_m=0.0)
    flyable = np.isfinite(flat.rotor_speed_rad_s).all(axis=1)
    velocity = flatness.air_velocity_body(flat)
    spin_up = np.gradient(flat.rotor_speed_rad_s, flat.time_s, axis=0)
    flyable &= np.isfinite(spin_up).all(axis=1)
    height = flat.position_world_m[:, 2]
    around = Surroundings(
        flat.q_world_body[flyable],
        height[flyable],
        np.maximum(manoeuvres.CEILING_M - height, 0.01)[flyable],
        spin_up[flyable],
    )
    return np.hstack([velocity, flat.rate_body_rad_s, flat.rotor_speed_rad_s])[flyable], around


def _rotor_speeds(candidate: Vehicle) -> FloatArray:
    """Rotor speeds under a square wave of commands while the battery empties; steps exact for a first-order lag."""
    step_s, count = 0.01, 240
    time_s = step_s * np.arange(count)
    wave = 850.0 + 150.0 * np.sign(np.sin(2.0 * np.pi * time_s / 0.6))
    volts = np.linspace(16.6, 14.0, count)
    speed, history = np.full((1, candidate.rotors), 850.0), np.empty((count, candidate.rotors))
    for k in range(count):
        for _ in range(5):
            reached, spin_up = dynamics.motor_response(candidate, np.full(speed.shape, wave[k]), speed, volts[k])
            speed = np.broadcast_to(reached, speed.shape) if spin_up is None else speed + spin_up * (step_s / 5)
        history[k] = speed[0]
    return history.ravel() / ROTOR_SPEED_NOISE_RAD_S


def _sensor_model(effect: Effect, truth: Vehicle) -> Model:
    """Readings of flights along the exciting manoeuvres; the flights themselves do not depend on the sensors."""
    rides = [
        flights.fly_trajectory(truth, manoeuvres.make(name), period_s=_SAMPLE_S / 4, ground_m=0.0)
        for name in effect.excited_by
    ]

    def model(candidate: Vehicle) -> FloatArray:
        return np.concatenate([flights.noiseless_readings(ride, candidate) for ride in rides])

    return model
