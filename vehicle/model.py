"""The vehicle model: a rigid body, four to eight rotors, and an ordered list of effects."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from math import isfinite
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np

from flight import FloatArray, InputError
from flight.frames import GRAVITY_M_S2
from vehicle import effects as registry
from vehicle.effects.base import Effect, RigidBody, Spec, Stage, Values
from vehicle.parameters import Limits, Parameter

BODY = (
    Spec("mass_kg", "kg", prior=0.1, bounds=(1e-3, 1e3), default=1.0),
    Spec("inertia_xx_kg_m2", "kg m2", prior=1e-3, bounds=(1e-9, 1e3), default=1e-2),
    Spec("inertia_yy_kg_m2", "kg m2", prior=1e-3, bounds=(1e-9, 1e3), default=1e-2),
    Spec("inertia_zz_kg_m2", "kg m2", prior=1e-3, bounds=(1e-9, 1e3), default=1e-2),
    Spec("rotor_radius_m", "m", prior=1e-2, bounds=(1e-3, 10.0), default=0.1),
    Spec("air_density_kg_m3", "kg/m3", prior=0.05, bounds=(0.0, 10.0), default=1.225),
    Spec("pose_sensor_x_m", "m", prior=0.05, bounds=(-10.0, 10.0)),
    Spec("pose_sensor_y_m", "m", prior=0.05, bounds=(-10.0, 10.0)),
    Spec("pose_sensor_z_m", "m", prior=0.05, bounds=(-10.0, 10.0)),
    Spec("pose_sensor_rotation_x_rad", "rad", prior=0.05, bounds=(-3.2, 3.2)),
    Spec("pose_sensor_rotation_y_rad", "rad", prior=0.05, bounds=(-3.2, 3.2)),
    Spec("pose_sensor_rotation_z_rad", "rad", prior=0.05, bounds=(-3.2, 3.2)),
)
"""Parameters every vehicle has. The pose sensor's place is given from the centre of mass, its rotation vector
turns sensor axes into body axes."""


ROTORS = (4, 8)
"""Fewest and most."""
UPRIGHT = 0.5
"""Least share of a rotor's thrust along body z: an axis tilted by 60 degrees."""

GRAVITY_ON_EARTH_M_S2 = (9.76, 9.84)
"""Least (a high mountain at the equator) and most (a pole)."""

ValueMap = Mapping[str, Any]
"""Full parameter name to value: a number, or (n,) with one per instant; complex while a derivative is taken."""


@dataclass(frozen=True, slots=True, eq=False, weakref_slot=True)
class Vehicle:
    """The model of one vehicle. Change it with the `with_...` methods, which return copies."""

    name: str
    parameters: Mapping[str, Parameter]
    """Body parameters by name (`mass_kg`), effects' parameters by `effect.parameter`."""
    hub_body_m: FloatArray
    """(r, 3) rotor hubs in body axes. Our own files start front left and go counter-clockwise seen from above,
    but no code depends on that order: all read it from here."""
    spin: FloatArray
    """(r,) +1 turns counter-clockwise seen from above, -1 clockwise."""
    effects: tuple[str, ...]
    """Names of the active effects, in the order they act."""
    limits: Limits = field(default_factory=Limits)
    provenance: Mapping[str, Any] = field(default_factory=dict)
    """Where the model came from: flights, hashes, program version; TOML-able values."""
    effect_files: tuple[Path, ...] = ()
    """Python files of the user's own effects, absolute."""
    gravity_m_s2: float = GRAVITY_M_S2
    """Where it flies: 9.780 at the equator, 9.832 at the poles, 3e-6 less for every metre up. Identified thrust is in
    proportion to it, so the two are kept together."""
    axis_body: FloatArray | None = None
    """(r, 3) unit vectors along which the rotors thrust, body axes; None: all along z."""

    def __post_init__(self) -> None:
        object.__setattr__(self, "hub_body_m", np.ascontiguousarray(self.hub_body_m, dtype=np.float64))
        object.__setattr__(self, "spin", np.ascontiguousarray(self.spin, dtype=np.float64))
        if self.axis_body is not None:
            object.__setattr__(self, "axis_body", np.ascontiguousarray(self.axis_body, dtype=np.float64))
        _check_gravity(self)
        _check_rotors(self)
        _check_effects(self)
        _check_parameters(self)

    @property
    def rotors(self) -> int:
        """How many there are."""
        return len(self.spin)

    @property
    def reach_m(self) -> float:
        """Distance from the centre of mass to the farthest propeller tip."""
        return float(np.linalg.norm(self.hub_body_m, axis=1).max()) + self.value("rotor_radius_m")

    def value(self, name: str) -> float:
        """Value of `mass_kg` or `effect.parameter`.

        Raises:
            InputError: the vehicle has no such parameter.
        """
        return self.parameter(name).value

    def parameter(self, name: str) -> Parameter:
        """As `value`, with std, unit and source."""
        if name not in self.parameters:
            way_out = registry.hint(name, self.parameters, "goshawk vehicle show")
            raise InputError(f"vehicle {self.name} has no parameter {name!r}; {way_out}")
        return self.parameters[name]

    def values(self, effect: str) -> SimpleNamespace:
        """All values of one active effect, in the form that its `apply` takes."""
        return SimpleNamespace(
            **{s.name: self.parameters[f"{effect}.{s.name}"].value for s in self.effect(effect).parameters}
        )

    def effect(self, name: str) -> Effect:
        """An effect of the catalogue or the user's own, with the parameters that it has on this vehicle."""
        return registry.find(name, self.rotors)

    def with_value(self, name: str, value: float, *, std: float = 0.0, source: str = "set by hand") -> "Vehicle":
        """A copy with one parameter changed. Raises `InputError` for an unknown name or a value out of bounds."""
        old = self.parameter(name)
        if not isfinite(value):
            raise InputError(f"{name} is {value} {old.unit}; it must be a finite number")
        return replace(self, parameters={**self.parameters, name: Parameter(float(value), std, old.unit, source)})

    def with_effect(self, name: str, *, source: str = "assumed", **values: float) -> "Vehicle":
        """A copy with one more active effect (or the same one with other values).

        Args:
            values: the effect's parameters; one that is not given takes its default and its prior's width.
        """
        effect = self.effect(name)
        unknown = set(values) - {s.name for s in effect.parameters}
        if unknown:
            known = ", ".join(s.name for s in effect.parameters)
            raise InputError(f"effect {name} has no parameter {', '.join(sorted(unknown))}; it has {known}")
        added = {
            f"{name}.{s.name}": Parameter(
                float(values.get(s.name, s.default)), 0.0 if s.name in values else s.prior, s.unit, source
            )
            for s in effect.parameters
        }
        return replace(self, effects=_inserted(self.effects, effect), parameters={**self.parameters, **added})

    def with_effect_file(self, path: str | Path, *, source: str = "assumed", **values: float) -> "Vehicle":
        """A copy with an effect of your own, read from a Python file; a saved vehicle file will name that file."""
        file = Path(path).resolve()
        effect = registry.load_file(file)
        files = self.effect_files if file in self.effect_files else (*self.effect_files, file)
        return replace(self, effect_files=files).with_effect(effect.name, source=source, **values)

    def without_effect(self, name: str) -> "Vehicle":
        """A copy without that effect, nor the file it came from. Raises `InputError` if it is not active."""
        if name not in self.effects:
            raise InputError(f"effect {name} is not active in {self.name}; active are {', '.join(self.effects)}")
        kept = {key: p for key, p in self.parameters.items() if not key.startswith(name + ".")}
        effects = tuple(e for e in self.effects if e != name)
        still_needed = {registry.origin(e) for e in effects}
        unneeded = registry.origin(name)
        files = tuple(f for f in self.effect_files if f != unneeded or f in still_needed)
        return replace(self, effects=effects, parameters=kept, effect_files=files)

    def with_gravity(self, gravity_m_s2: float) -> "Vehicle":
        """A copy that flies at another place. Raises `InputError` for what is found nowhere on Earth."""
        return replace(self, gravity_m_s2=float(gravity_m_s2))

    def with_limits(self, **limits: float) -> "Vehicle":
        """A copy with other limits."""
        return replace(self, limits=replace(self.limits, **limits))

    @property
    def mass_kg(self) -> float:
        """The base mass; effects of stage MASS may add to it, see `body`."""
        return self.parameters["mass_kg"].value

    @property
    def body(self) -> RigidBody:
        """Mass, inertia (3, 3) and centre of mass (3,) with the effects of stage MASS included."""
        return rigid_body(self)


def body_parameters(**values: Parameter) -> dict[str, Parameter]:
    """The full set of body parameters; those not given take their defaults."""
    return {s.name: values.get(s.name, Parameter(s.default, 0.0, s.unit, "default")) for s in BODY}


def specs(vehicle: Vehicle) -> dict[str, Spec]:
    """Unit, prior scale and bounds of every parameter of a vehicle, by full name."""
    named = {s.name: s for s in BODY}
    for effect in vehicle.effects:
        named |= {f"{effect}.{s.name}": s for s in vehicle.effect(effect).parameters}
    return named


def values_of(vehicle: Vehicle) -> dict[str, Any]:
    return {name: parameter.value for name, parameter in vehicle.parameters.items()}


def namespace(values: ValueMap, effect: str, rotors: int = 4) -> Values:
    return Values(**{s.name: values[f"{effect}.{s.name}"] for s in registry.find(effect, rotors).parameters})


def active(vehicle: Vehicle, *stages: Stage) -> list[str]:
    """Names of the active effects of these stages, in order."""
    return [name for name in vehicle.effects if registry.find(name).stage in stages]


def rigid_body(vehicle: Vehicle, values: ValueMap | None = None) -> RigidBody:
    """Mass, inertia (3, 3) and centre of mass (3,) with the effects of stage MASS included."""
    values = values_of(vehicle) if values is None else values
    diagonal = [values[f"inertia_{axis}_kg_m2"] for axis in ("xx", "yy", "zz")]
    shape = np.broadcast_shapes(*(np.shape(i) for i in diagonal))
    inertia = np.zeros((3, 3, *shape), np.result_type(*diagonal))
    for i in range(3):
        inertia[i, i] = diagonal[i]
    body = RigidBody(values["mass_kg"], inertia, np.zeros(3))
    for name in active(vehicle, Stage.MASS):
        registry.find(name).apply(body, namespace(values, name))
    return body


def _inserted(active: tuple[str, ...], effect: Effect) -> tuple[str, ...]:
    """Behind the last effect of the same or an earlier stage."""
    if effect.name in active:
        return active
    place = sum(registry.find(name).stage <= effect.stage for name in active)
    return (*active[:place], effect.name, *active[place:])


def _check_gravity(vehicle: Vehicle) -> None:
    low, high = GRAVITY_ON_EARTH_M_S2
    if not low <= vehicle.gravity_m_s2 <= high:
        raise InputError(f"gravity_m_s2 is {vehicle.gravity_m_s2}; on Earth it is between {low} and {high} m/s2")


def _check_rotors(vehicle: Vehicle) -> None:
    hub, spin, axis = vehicle.hub_body_m, vehicle.spin, vehicle.axis_body
    if hub.ndim != 2 or hub.shape[1] != 3 or not ROTORS[0] <= len(hub) <= ROTORS[1] or not np.isfinite(hub).all():
        raise InputError(
            f"rotor positions of {vehicle.name}: expected {ROTORS[0]} to {ROTORS[1]} finite rows of x, y, z, got shape "
            f"{hub.shape}"
        )
    if spin.shape != hub.shape[:1] or not np.isin(spin, (-1.0, 1.0)).all():
        raise InputError(f"rotor spins of {vehicle.name}: expected {len(hub)} of +1 and -1, one for each position")
    if axis is not None and (axis.shape != hub.shape or not (np.abs(np.linalg.norm(axis, axis=1) - 1.0) < 1e-6).all()):
        raise InputError(f"thrust axes of {vehicle.name}: expected {len(hub)} unit vectors, one for each position")
    if axis is not None and axis[:, 2].min() < UPRIGHT:
        raise InputError(
            f"a thrust axis of {vehicle.name} has {axis[:, 2].min():.2f} along body z; it must have {UPRIGHT:g} or more"
        )


def _check_effects(vehicle: Vehicle) -> None:
    stages = [registry.find(name).stage for name in vehicle.effects]
    if len(set(vehicle.effects)) != len(vehicle.effects):
        raise InputError(f"an effect is listed twice in {vehicle.name}: {', '.join(vehicle.effects)}")
    if stages != sorted(stages):
        in_order = sorted(vehicle.effects, key=lambda name: registry.find(name).stage)
        raise InputError(f"effects of {vehicle.name} are out of order; list them as {', '.join(in_order)}")


def _check_parameters(vehicle: Vehicle) -> None:
    expected = specs(vehicle)
    missing, surplus = set(expected) - set(vehicle.parameters), set(vehicle.parameters) - set(expected)
    if missing:
        raise InputError(f"vehicle {vehicle.name} lacks {', '.join(sorted(missing))}")
    if surplus:
        raise InputError(f"vehicle {vehicle.name} gives {', '.join(sorted(surplus))}, which no active effect uses")
    for name, spec in expected.items():
        parameter, (low, high) = vehicle.parameters[name], spec.bounds
        if not low <= parameter.value <= high:
            raise InputError(f"{name} is {parameter.value:g} {spec.unit}; it must be from {low:g} to {high:g}")
        if parameter.unit != spec.unit:
            raise InputError(f"{name} is given in {parameter.unit!r}; it must be in {spec.unit!r}")
