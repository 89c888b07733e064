"""Motor: rotor speed from commands. When a log has no measured rotor speed, the motors become part of the model."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from flight.rotations import FloatArray
from sysid import _sysid
from sysid.estimator.flights.clocks import COMMAND as QUANTITY
from sysid.estimator.flights.clocks import delay_of
from sysid.estimator.flights.flight_data import Flight
from sysid.estimator.flights.sampling import Signal, Stretch
from sysid.estimator.motors import battery
from vehicle import Vehicle, effects
from vehicle.effects.base import Drive

STEP = 1e-6
"""Relative step of the finite differences by the motors' parameters; their speeds are smooth in them."""

STAGES = ("COMMAND", "DRIVE")
"""Stages of effects between command and rotor speed."""

COMPILED = ("motor_lag", battery.SAG)
"""Effects of these stages that the compiled loop knows."""
SAG, RISE, FALL = PARAMETERS = ("battery_sag.sag_per_v", "motor_lag.rise_s", "motor_lag.fall_s")
"""Theirs, in the order of its derivatives."""


def read(stretch: Stretch) -> Signal:
    """Commands, each held until the next."""
    return Signal.held(*stretch.samples(QUANTITY))


def aligned(flight: Flight, delays: Mapping[str, float]) -> Flight:
    """The flight with mean commands of its intervals where the stream is this late; early (negative) as a rule."""
    if QUANTITY not in flight.streams or flight.commands_on_time:
        return flight
    before, skipped, node_s = flight.lead_in, 0, flight.time_s
    if before is not None:
        skipped = len(before.step_s)
        node_s = np.concatenate([node_s[0] - np.cumsum(before.step_s[::-1])[::-1], node_s])
    command = flight.streams[QUANTITY].means(node_s + delay_of(QUANTITY, flight, delays))[0]
    if before is not None:
        before = replace(before, rotor_command_rad_s=command[:skipped])
    own = command[skipped:]
    return replace(flight, rotor_command_rad_s=own, rotor_speed_rad_s=own, lead_in=before)


def by_delay(flight: Flight) -> tuple[FloatArray, FloatArray]:
    """Derivatives (k, r) of mean speed and mean acceleration of a driven flight by the delay of its commands: motors
    are the same at all times, so that a command read later is a speed read later."""
    change = np.gradient(flight.rotor_acceleration_rad_s2, axis=0) / flight.step_s[:, None]
    return flight.rotor_acceleration_rad_s2, change


def parameters(vehicle: Vehicle) -> tuple[str, ...]:
    """Parameters between command and rotor speed, when only commands are known."""
    names = []
    for effect in vehicle.effects:
        if effects.find(effect).stage.name in STAGES:
            names += [f"{effect}.{spec.name}" for spec in effects.find(effect).parameters if not spec.held]
    return tuple(names)


def lags(vehicle: Vehicle) -> bool:
    """Whether its rotors take time to reach what is commanded."""
    return any(effects.find(effect).stage.name == "DRIVE" for effect in vehicle.effects)


def driven(flight: Flight, vehicle: Vehicle) -> Flight:
    """The flight with mean rotor speed and acceleration from its commands; as it is when rotor speed was measured."""
    if not flight.driven_by_command:
        return flight
    if _own_effects(vehicle):
        speed, acceleration = (values[..., 0] for values in simulated(flight, vehicle, {}))
    else:
        speed, acceleration, _, _ = lagged(flight, vehicle)
    return replace(flight, rotor_speed_rad_s=speed, rotor_acceleration_rad_s2=acceleration)


def slopes(flight: Flight, vehicle: Vehicle, names: tuple[str, ...]) -> tuple[FloatArray, FloatArray]:
    """Derivatives (k, r, p) of mean rotor speed and mean rotor acceleration by the named parameters."""
    own = [name for name in names if name in parameters(vehicle)]
    if not flight.driven_by_command or not own:
        by_speed, by_acceleration = np.zeros((2, len(flight) - 1, flight.rotor_speed_rad_s.shape[1], len(names)))
        return by_speed, by_acceleration
    if _own_effects(vehicle):
        return _among(names, own, _differences(flight, vehicle, own))
    return _among(names, own, _of_catalogue(lagged(flight, vehicle)[2:], own))


def driven_with_slopes(
    flight: Flight, vehicle: Vehicle, names: tuple[str, ...]
) -> tuple[Flight, FloatArray, FloatArray]:
    """`driven` and `slopes` of a flight that commands drive: of the catalogue's motors by one run."""
    own = [name for name in names if name in parameters(vehicle)]
    if not own or _own_effects(vehicle):
        return driven(flight, vehicle), *slopes(flight, vehicle, names)
    speed, acceleration, *by = lagged(flight, vehicle)
    turned = replace(flight, rotor_speed_rad_s=speed, rotor_acceleration_rad_s2=acceleration)
    return turned, *_among(names, own, _of_catalogue(by, own))


def _of_catalogue(by: Sequence[FloatArray], own: Sequence[str]) -> list[FloatArray]:
    columns = [PARAMETERS.index(name) for name in own]
    return [values[:, :, columns] for values in by]


def _among(names: Sequence[str], own: Sequence[str], by_own: Sequence[FloatArray]) -> tuple[FloatArray, FloatArray]:
    """Derivatives (k, r, len(own)) of speed and acceleration in their places among all names."""
    by_speed, by_acceleration = np.zeros((2, *by_own[0].shape[:2], len(names)))
    places = [names.index(name) for name in own]
    by_speed[:, :, places], by_acceleration[:, :, places] = by_own
    return by_speed, by_acceleration


def lagged(flight: Flight, vehicle: Vehicle) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Mean rotor speed and acceleration (k, r) of the catalogue's motors, and derivatives (k, r, 3) by `PARAMETERS`."""
    steps, commands, volts, skipped = _commanded(flight)
    known = vehicle.parameters
    reached, by_sag = commands, np.zeros((*commands.shape, 1))
    if battery.SAG in vehicle.effects:
        battery.require(flight, [effects.find(battery.SAG)])
        below_v = (vehicle.value(f"{battery.SAG}.reference_v") - volts)[:, None]
        reached, by_sag = commands * (1.0 - vehicle.value(SAG) * below_v), -(commands * below_v)[:, :, None]
    rise_s, fall_s = (known[name].value if name in known else 0.0 for name in (RISE, FALL))
    values, by = np.empty((2, *commands.shape)), np.empty((2, *commands.shape, len(PARAMETERS)))
    fed = np.ascontiguousarray(reached), np.ascontiguousarray(by_sag)
    _sysid.drive(steps, *fed, rise_s, fall_s, values[0], values[1], by[0], by[1])
    return values[0, skipped:], values[1, skipped:], by[0, skipped:], by[1, skipped:]


def _own_effects(vehicle: Vehicle) -> bool:
    """Whether the user's own effects act between command and rotor speed; these are simulated step by step."""
    return any(effects.find(e).stage.name in STAGES for e in vehicle.effects if e not in COMPILED)


def _commanded(flight: Flight) -> tuple[FloatArray, FloatArray, FloatArray, int]:
    """Steps (m,), commands (m, r) and voltage (m,) with the lead-in, and how many of them that is."""
    steps, commands, volts = flight.step_s, flight.rotor_command_rad_s, flight.battery_v
    before = flight.lead_in
    if before is None:
        return steps, commands, volts, 0
    joined = [(before.step_s, steps), (before.rotor_command_rad_s, commands), (before.battery_v, volts)]
    steps, commands, volts = (np.concatenate(pair) for pair in joined)
    return steps, commands, volts, len(before.step_s)


def _differences(flight: Flight, vehicle: Vehicle, names: Sequence[str]) -> list[FloatArray]:
    """The same as `slopes` for any effects, by finite differences."""
    steps = np.array([STEP * max(abs(vehicle.value(name)), 1e-3) for name in names])
    moved = {name: np.full(len(names) + 1, vehicle.value(name)) for name in names}
    for column, name in enumerate(names):
        moved[name][column + 1] += steps[column]
    return [(values[..., 1:] - values[..., :1]) / steps for values in simulated(flight, vehicle, moved)]


def simulated(flight: Flight, vehicle: Vehicle, moved: Mapping[str, FloatArray]) -> tuple[FloatArray, FloatArray]:
    """(k, r, m) mean speed and acceleration over each interval, for m variants of the motors at once.

    For any effects, in plain steps: the twin of `lagged`.
    """
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

    steps, commands, volts, skipped = _commanded(flight)
    settled = np.repeat(commands[0][:, None], variants, axis=1)
    speed = reached(settled, settled, volts[0]).command_rad_s
    mean = np.empty((*commands.shape, variants))
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
