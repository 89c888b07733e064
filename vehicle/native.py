"""The bridge to the compiled kernel: a vehicle as a list of compiled effects and one flat row of values."""

from dataclasses import dataclass
from weakref import WeakKeyDictionary

import numpy as np

from flight import FloatArray
from vehicle import _vehicle
from vehicle import effects as registry
from vehicle.effects.base import Stage
from vehicle.forces import BODY_NAMES, Surroundings
from vehicle.model import Vehicle

_KNOWN = dict(_vehicle.effects())


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
    """The vehicle for the kernel, or None when an active effect has no compiled form (one of the user's own)."""
    if vehicle not in _cache:
        _cache[vehicle] = _compile(vehicle)
    return _cache[vehicle]


def _compile(vehicle: Vehicle) -> Compiled | None:
    active = [name for name in vehicle.effects if registry.find(name).stage != Stage.SENSOR]
    if any(_KNOWN.get(name) != len(registry.find(name).parameters) for name in active):
        return None
    names = (*BODY_NAMES, *(f"{e}.{s.name}" for e in active for s in registry.find(e).parameters))
    model = _vehicle.Model(active, vehicle.hub_body_m, vehicle.spin[None])
    assert model.width == len(names)
    return Compiled(model, np.array([[vehicle.parameters[name].value for name in names]]), names)


def surroundings_rows(surroundings: Surroundings) -> FloatArray:
    """(n or 1, 10): attitude, height, ceiling gap, rotor acceleration; level in the open where not given."""
    parts = (
        (surroundings.q_world_body, np.array([[1.0, 0.0, 0.0, 0.0]])),
        (surroundings.height_m, np.array([[np.inf]])),
        (surroundings.ceiling_gap_m, np.array([[np.inf]])),
        (surroundings.rotor_acceleration_rad_s2, np.zeros((1, 4))),
    )
    columns = [
        neutral if given is None else np.asarray(given, dtype=np.float64).reshape(-1, neutral.shape[1])
        for given, neutral in parts
    ]
    n = max(len(column) for column in columns)
    return np.ascontiguousarray(np.hstack([np.broadcast_to(c, (n, c.shape[1])) for c in columns]))
