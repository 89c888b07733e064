"""Motor: rotor speed from commands. When a log has no measured rotor speed, the motors become part of the model."""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np

from flight.rotations import FloatArray
from sysid.estimator.blocks import battery
from sysid.estimator.flight_data import Flight
from sysid.estimator.sampling import Stretch, held_means
from vehicle import Vehicle, effects
from vehicle.effects.base import Drive

STEP = 1e-6
"""Relative step of the finite differences by the motors' parameters; their speeds are smooth in them."""

STAGES = ("COMMAND", "DRIVE")
"""Stages of effects between command and rotor speed."""

QUANTITY = "rotor_speed_command_rad_s"


def read(stretch: Stretch) -> FloatArray:
    """(n - 1, 4) mean command over each interval, each held until the next."""
    return held_means(*stretch.samples(QUANTITY), stretch.time_s)


def parameters(vehicle: Vehicle) -> tuple[str, ...]:
    """Parameters between command and rotor speed, when only commands are known."""
    names = []
    for effect in vehicle.effects:
        if effects.find(effect).stage.name in STAGES:
            names += [f"{effect}.{spec.name}" for spec in effects.find(effect).parameters if not spec.held]
    return tuple(names)


def driven(flight: Flight, vehicle: Vehicle) -> Flight:
    """The flight with mean rotor speed and acceleration from its commands; as it is when rotor speed was measured."""
    if not flight.driven_by_command:
        return flight
    speed, acceleration = _simulate(flight, vehicle, {})
    return replace(flight, rotor_speed_rad_s=speed[..., 0], rotor_acceleration_rad_s2=acceleration[..., 0])


def slopes(flight: Flight, vehicle: Vehicle, names: tuple[str, ...]) -> tuple[FloatArray, FloatArray]:
    """Derivatives (k, 4, p) of mean rotor speed and mean rotor acceleration by the named parameters."""
    result = np.zeros((2, len(flight) - 1, 4, len(names)))
    own = [i for i, name in enumerate(names) if name in parameters(vehicle)]
    if not flight.driven_by_command or not own:
        return result[0], result[1]
    steps = np.array([STEP * max(abs(vehicle.value(names[i])), 1e-3) for i in own])
    moved = {}
    for column, i in enumerate(own):
        values = np.full(len(own) + 1, vehicle.value(names[i]))
        values[column + 1] += steps[column]
        moved[names[i]] = values
    for kind, values in enumerate(_simulate(flight, vehicle, moved)):
        result[kind][:, :, own] = (values[..., 1:] - values[..., :1]) / steps
    return result[0], result[1]


def _simulate(flight: Flight, vehicle: Vehicle, moved: dict[str, FloatArray]) -> tuple[FloatArray, FloatArray]:
    """(k, 4, m) mean speed and acceleration over each interval, for m variants of the motors at once."""
    variants = len(next(iter(moved.values()))) if moved else 1
    active = [effects.find(e) for e in vehicle.effects if effects.find(e).stage.name in STAGES]
    battery.require(flight, active)
    values = []
    for effect in active:
        own = vehicle.values(effect.name)
        for spec in effect.parameters:
            setattr(own, spec.name, moved.get(f"{effect.name}.{spec.name}", getattr(own, spec.name)))
        values.append(own)

    def reached(command: FloatArray, speed: FloatArray, battery_v: float) -> Drive:
        drive = Drive(command, speed, battery_v)
        for effect, own in zip(active, values, strict=True):
            effect.apply(drive, own)
        return drive

    before = flight.lead_in
    steps, commands, volts = flight.step_s, flight.rotor_command_rad_s, flight.battery_v
    if before is not None:
        steps = np.concatenate([before.step_s, steps])
        commands = np.concatenate([before.rotor_command_rad_s, commands])
        volts = np.concatenate([before.battery_v, volts])
    skipped = len(steps) - len(flight.step_s)
    speed = np.repeat(commands[0][:, None], variants, axis=1)
    mean = np.empty((len(steps), 4, variants))
    change = np.empty_like(mean)
    for k, (h, command, volt) in enumerate(zip(steps, commands, volts, strict=True)):
        column = np.repeat(command[:, None], variants, axis=1)
        first = reached(column, speed, volt)
        if first.acceleration_rad_s2 is None:  # no lag in the model: the rotors follow at once
            after = first.command_rad_s
            mean[k] = after
        else:
            after, mean[k] = _interval(lambda s, c=column, v=volt: reached(c, s, v).acceleration_rad_s2, speed, h)
        change[k] = (after - speed) / h
        speed = after
    return mean[skipped:], change[skipped:]


def _interval(slope: Callable[[FloatArray], Any], start: FloatArray, h: float) -> tuple[FloatArray, FloatArray]:
    """Value after h and mean over it: Runge-Kutta of fourth order, and the integral of the cubic through the ends."""
    a = slope(start)
    b = slope(start + 0.5 * h * a)
    c = slope(start + 0.5 * h * b)
    after = start + h / 6.0 * (a + 2.0 * b + 2.0 * c + slope(start + h * c))
    return after, 0.5 * (start + after) + h / 12.0 * (a - slope(after))
