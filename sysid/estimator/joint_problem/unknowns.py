"""Which parameters are estimated: the vehicle's that flights can show, the sensors', biases and delays of each log."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from flight import InputError
from flight.rotations import FloatArray
from sysid.estimator.blocks.catalogue import BLOCKS
from sysid.estimator.flights.clocks import estimated
from sysid.estimator.flights.flight_data import Flight
from sysid.estimator.motors import motor
from sysid.estimator.options import Reference
from vehicle import Vehicle, effects

SENSOR_NAMES = tuple(name for block in BLOCKS for name in block.parameters)
"""Parameters that only a sensor shows."""
ALWAYS_HELD = ("mass_kg", "rotor_radius_m", "air_density_kg_m3")
"""Pose and rotor speed show forces only per mass, and thrust only per air density and disk area."""


def model_parameters(vehicle: Vehicle, by_command: bool = False) -> tuple[str, ...]:
    """Parameters that act on the motion and can be told from it; the motors' only when driven by commands."""
    names = [name for name in vehicle.parameters if name.startswith("inertia_")]
    for effect in vehicle.effects:
        if effects.find(effect).stage.name not in (*motor.STAGES, "SENSOR"):
            names += [f"{effect}.{spec.name}" for spec in vehicle.effect(effect).parameters]
    return (*names, *motor.parameters(vehicle)) if by_command else tuple(names)


def chosen_names(
    vehicle: Vehicle, free: tuple[str, ...] | None, held: tuple[str, ...], by_command: bool = False
) -> tuple[str, ...]:
    """Names of the model's parameters to estimate.

    Raises:
        InputError: a name is not a parameter of the vehicle, or cannot be told from flights.
    """
    possible = model_parameters(vehicle, by_command)
    for name in (*(free or ()), *held):
        vehicle.parameter(name)
    for name in free or ():
        if name in ALWAYS_HELD:
            raise InputError(
                f"{name} cannot be estimated from pose and rotor speed: only ratios to it show; weigh or measure it"
            )
        if name not in possible and name not in SENSOR_NAMES:
            raise InputError(f"{name} does not act on the motion when rotor speed is measured; hold it")
    wanted = possible if free is None else tuple(name for name in possible if name in free)
    return tuple(name for name in wanted if name not in held)


def has_thrust(names: Iterable[str]) -> bool:
    """Whether a parameter of an effect that makes or scales thrust is among them."""
    acting = [effects.find(name.split(".")[0]).stage.name for name in names if "." in name]
    return any(stage in ("THRUST", "THRUST_FACTOR") for stage in acting)


def sensor_values(vehicle: Vehicle) -> dict[str, float]:
    """The sensors' parameters as the vehicle file says; zero for those it does not have."""
    known = vehicle.parameters
    return {name: known[name].value if name in known else 0.0 for name in SENSOR_NAMES}


def biases(flights: Sequence[Flight]) -> dict[str, float]:
    """Names of the biases of every log, block by block, and the width of the weak prior on each."""
    found: dict[str, float] = {}
    for block in BLOCKS:
        for log in sorted({f.log_index for f in flights if block.measured(f)}):
            found |= dict.fromkeys(block.bias_names(log), block.bias_std)
    return found


def nuisances(flights: Sequence[Flight], reference: Reference, vehicle: Vehicle) -> "tuple[Unknowns, FloatArray]":
    """Unknowns that every log has of its own, biases and delays, and (p,) the widths of the weak priors on them."""
    bias, delay = biases(flights), estimated(flights, reference, with_lag=motor.lags(vehicle))
    return Unknowns((), (), tuple(bias), tuple(delay)), np.array([*bias.values(), *delay.values()])


@dataclass(frozen=True, slots=True)
class Unknowns:
    """The shared parameters, in this order."""

    model: tuple[str, ...]
    """Parameters of the vehicle's motion."""
    sensor: tuple[str, ...]
    """Parameters that only a sensor shows, of `SENSOR_NAMES`."""
    bias: tuple[str, ...] = ()
    """Constant errors of the sensors in each log."""
    delay: tuple[str, ...] = ()
    """How late streams are in each log, see `sysid.estimator.flights.clocks`."""

    @property
    def names(self) -> tuple[str, ...]:
        return (*self.model, *self.sensor, *self.bias, *self.delay)

    @property
    def size(self) -> int:
        return len(self.names)

    def without(self, name: str) -> "Unknowns":
        """The unknowns less one."""
        model, sensor = (tuple(n for n in part if n != name) for part in (self.model, self.sensor))
        return Unknowns(model, sensor, self.bias, self.delay)
