"""The vehicle model: parameters, effects, forces, flatness, simulation."""

from vehicle import commented, draft, effects, flatness, history, invert, presets, purpose, sizes
from vehicle.dynamics import Jacobian, acceleration, acceleration_jacobian, wrench, wrench_jacobian
from vehicle.files import effect_files, example, examples, load, save, vehicle_hash
from vehicle.forces import Surroundings
from vehicle.model import Vehicle, rigid_body, specs
from vehicle.parameters import Limits, Parameter
from vehicle.simulation import flights, manoeuvres, self_test, simulate, tracking

__all__ = [
    "Jacobian",
    "Limits",
    "Parameter",
    "Surroundings",
    "Vehicle",
    "acceleration",
    "acceleration_jacobian",
    "commented",
    "draft",
    "effect_files",
    "effects",
    "example",
    "examples",
    "flatness",
    "flights",
    "history",
    "invert",
    "load",
    "manoeuvres",
    "presets",
    "purpose",
    "rigid_body",
    "save",
    "self_test",
    "simulate",
    "sizes",
    "specs",
    "tracking",
    "vehicle_hash",
    "wrench",
    "wrench_jacobian",
]
