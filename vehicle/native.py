"""A vehicle in the form of the compiled kernel: a list of compiled effects and one flat row of values."""

from collections.abc import Callable
from dataclasses import dataclass
from types import SimpleNamespace
from weakref import WeakKeyDictionary

import numpy as np

from flight import FloatArray
from vehicle import _vehicle
from vehicle import effects as registry
from vehicle.effects.base import Flow, Stage
from vehicle.forces import BODY_NAMES, Surroundings
from vehicle.model import Vehicle

_KNOWN = dict(_vehicle.effects())
_FLOW_STAGES = (Stage.AIR, Stage.THRUST, Stage.THRUST_FACTOR, Stage.FORCE)


@dataclass(frozen=True, slots=True)
class Compiled:
    """A vehicle ready for the kernel."""

    model: _vehicle.Model
    values: FloatArray
    """(1, p): body values, then the values of each active effect."""
    names: tuple[str, ...]
    """(p,) full parameter names of the columns of `values`."""


_cache: WeakKeyDictionary[Vehicle, Compiled | None] = WeakKeyDictionary()


def compiled(vehicle: Vehicle) -> Compiled | None:
    """The vehicle for the kernel, or None when an active effect has no compiled form (one of the user's own), nor have
    its tilted rotors."""
    if vehicle not in _cache:
        _cache[vehicle] = _compile(vehicle)
    return _cache[vehicle]


def _compile(vehicle: Vehicle) -> Compiled | None:
    if not _has_kernel(vehicle):
        return None
    active = [name for name in vehicle.effects if registry.find(name).stage != Stage.SENSOR]
    if any(_KNOWN.get(name) != len(registry.find(name).parameters) for name in active):
        return None
    names = (*BODY_NAMES, *(f"{e}.{s.name}" for e in active for s in vehicle.effect(e).parameters))
    model = _vehicle.Model(active, vehicle.hub_body_m, vehicle.spin[None], [])
    assert model.width == len(names)
    return Compiled(model, np.array([[vehicle.parameters[name].value for name in names]]), names)


def _has_kernel(vehicle: Vehicle) -> bool:
    return vehicle.rotors == 4 and vehicle.axis_body is None


def for_stepping(vehicle: Vehicle) -> Compiled | None:
    """As `compiled`, but effects of the user's own take part too, called back from the kernel; only for simulation.

    None when one of them acts on mass or motors, for which the kernel has no callback, or rotors are tilted.
    """
    parts = stepped(vehicle)
    if parts is None:
        return None
    model = _vehicle.Model(parts.marked, vehicle.hub_body_m, vehicle.spin[None], parts.own)
    return Compiled(model, np.array([[vehicle.parameters[name].value for name in parts.names]]), parts.names)


@dataclass(frozen=True, slots=True)
class Stepped:
    """What a kernel of a vehicle's effects is made of, where some are the user's own."""

    marked: list[str]
    """Names of the effects; an empty one for each of the user's own."""
    own: list[tuple[Callable[[], None], FloatArray]]
    """Of each of the user's own, a function, and the block of numbers that it works on."""
    names: tuple[str, ...]
    """Of the parameters that are the kernel's columns."""
    own_names: tuple[str, ...]
    """Of those of the user's own effects, in the order of `set_own`."""
    values: list[SimpleNamespace]
    """What the functions read."""

    def set_own(self, row: FloatArray) -> None:
        """Take other values for the user's own effects."""
        at = 0
        for one in self.values:
            for name in vars(one):
                setattr(one, name, float(row[at]))
                at += 1


def stepped(vehicle: Vehicle) -> Stepped | None:
    """The parts of `for_stepping`; None where that is None."""
    if not _has_kernel(vehicle) or without_callback(vehicle):
        return None
    active = [name for name in vehicle.effects if registry.find(name).stage != Stage.SENSOR]
    own = own_effects(vehicle)
    columns = [f"{e}.{s.name}" for e in active if e not in own for s in registry.find(e).parameters]
    values = [vehicle.values(name) for name in own]
    return Stepped(
        ["" if name in own else name for name in active],
        [_mirrored(vehicle, name, its) for name, its in zip(own, values, strict=True)],
        (*BODY_NAMES, *columns),
        tuple(f"{name}.{its}" for name, one in zip(own, values, strict=True) for its in vars(one)),
        values,
    )


def own_effects(vehicle: Vehicle) -> list[str]:
    """Names of those that move the vehicle and have no compiled form."""
    return [name for name in vehicle.effects if name not in _KNOWN and registry.find(name).stage != Stage.SENSOR]


def without_callback(vehicle: Vehicle) -> list[str]:
    """Names of the user's own effects that act on mass or motors, for which the kernel has no callback."""
    return [name for name in own_effects(vehicle) if registry.find(name).stage not in _FLOW_STAGES]


def _mirrored(vehicle: Vehicle, name: str, values: SimpleNamespace) -> tuple[Callable[[], None], FloatArray]:
    """A function that runs an effect on a flow whose arrays all lie in one block of numbers, and that block.

    The block is the kernel's Flow<double> (vehicle/src/state.hpp).
    """
    block = np.zeros(60)
    per_hub = [block[start : start + 12].reshape(4, 3).T[:, :, None] for start in (10, 42)]
    flow = Flow(
        velocity_m_s=block[0:3, None],
        rate_rad_s=block[3:6, None],
        rotor_speed_rad_s=block[6:10, None],
        hub_m=per_hub[0],
        spin=vehicle.spin[:, None],
        radius_m=vehicle.value("rotor_radius_m"),
        air_density_kg_m3=vehicle.value("air_density_kg_m3"),
        q_world_body=block[28:32, None],
        height_m=block[32:33],
        ceiling_gap_m=block[33:34],
        rotor_acceleration_rad_s2=block[34:38, None],
    )
    results = {
        "velocity_m_s": flow.velocity_m_s,
        "thrust_n": block[38:42, None],
        "hub_force_n": per_hub[1],
        "force_n": block[54:57, None],
        "torque_n_m": block[57:60, None],
    }
    effect = registry.find(name)

    def run() -> None:
        for attribute, place in results.items():
            setattr(flow, attribute, place)
        effect.apply(flow, values)
        for attribute, place in results.items():
            changed = getattr(flow, attribute)
            if changed is not place:  # the effect made a new array instead of changing the old one
                place[...] = changed

    return run, block


def surroundings_rows(surroundings: Surroundings, rotors: int = 4) -> FloatArray:
    """(n or 1, 6 + rotors): attitude, height, ceiling gap, rotor acceleration; level in the open where not given."""
    parts = (
        (surroundings.q_world_body, np.array([[1.0, 0.0, 0.0, 0.0]])),
        (surroundings.height_m, np.array([[np.inf]])),
        (surroundings.ceiling_gap_m, np.array([[np.inf]])),
        (surroundings.rotor_acceleration_rad_s2, np.zeros((1, rotors))),
    )
    columns = [
        neutral if given is None else np.asarray(given, dtype=np.float64).reshape(-1, neutral.shape[1])
        for given, neutral in parts
    ]
    n = max(len(column) for column in columns)
    return np.ascontiguousarray(np.hstack([np.broadcast_to(c, (n, c.shape[1])) for c in columns]))
