"""Who may be missing: every effect of the catalogue, and of the user's own, that these flights could show at all."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from flight import InputError
from sysid.estimator.flight_data import Flight
from sysid.logs.payload import PAYLOAD
from vehicle import Vehicle, effects
from vehicle.effects.base import Effect, Spec, Stage

SEPARATELY = {"weak_rotor": "weak_rotor[{}]"}
"""Effects whose parameters are suspects of their own: one rotor is weak, not a mixture of all four."""
LOAD_SHARE = 0.2
"""A usual load is this share of the vehicle's mass."""
TRACE = 1e-9
"""Share of the mass that a load at no strength weighs."""


@dataclass(frozen=True, slots=True)
class Suspect:
    """One effect that may be missing, and which of its parameters would be estimated."""

    name: str
    """The effect's name; `weak_rotor[2]` for one rotor's."""
    effect: str
    parameters: tuple[str, ...]
    """Full names, each with a column of its own."""
    one_sided: tuple[bool, ...]
    """Which of them cannot be negative."""
    usual: tuple[float, ...]
    """How large each typically is."""
    channels: tuple[str, ...]
    """Of `F_x F_y F_z M_x M_y M_z`, where it shows."""
    regressor: str
    excited_by: tuple[str, ...]
    fitted_along: tuple[str, ...] = ()
    """Further parameters, which mean nothing while those above are zero: they say where a load sits, and are fitted and
    scored with them."""

    @property
    def columns(self) -> tuple[str, ...]:
        """All it is scored by."""
        return (*self.parameters, *self.fitted_along)


@dataclass(frozen=True, slots=True)
class LineUp:
    """The vehicle with every suspect present at zero strength, and who could not be lined up."""

    vehicle: Vehicle
    suspects: tuple[Suspect, ...]
    invisible: tuple[tuple[str, str], ...]
    """Effect and reason: no flight of this kind can show it."""

    def suspect(self, name: str) -> Suspect:
        """The suspect of this name. Raises `InputError` when there is none."""
        for suspect in self.suspects:
            if suspect.name == name:
                return suspect
        raise InputError(f"{name!r} is not among the suspects: {', '.join(s.name for s in self.suspects)}")


def line_up(vehicle: Vehicle, flights: Sequence[Flight]) -> LineUp:
    """Put every effect the vehicle lacks into it, at a strength of zero, so that only its slope is felt."""
    by_command = any(f.driven_by_command for f in flights)
    invisible: list[tuple[str, str]] = []
    suspects: list[Suspect] = []
    extended = _swapped_thrust(vehicle)
    for effect in _known(vehicle):
        if effect.name in vehicle.effects:
            continue
        reason = _no_load(flights) if effect.name == PAYLOAD else _why_not(effect, vehicle, by_command)
        if reason:
            invisible.append((effect.name, reason))
            continue
        if effect.name not in extended.effects:
            extended = extended.with_effect(effect.name, source="suspect", **_at_rest(effect))
            if effect.name == PAYLOAD:  # a trace of it, so that its place has columns
                extended = extended.with_value(f"{PAYLOAD}.added_kg", TRACE * vehicle.mass_kg)
        suspects += _suspects(effect, vehicle)
    return LineUp(extended, tuple(suspects), tuple(invisible))


def _known(vehicle: Vehicle) -> list[Effect]:
    own = [effects.load_file(path) for path in vehicle.effect_files]
    return [*effects.catalogue().values(), *own]


def _at_rest(effect: Effect) -> dict[str, float]:
    """Parameters at zero; shapes (what does not vanish by default) at their default."""
    if effect.name == PAYLOAD:
        return {"added_kg": 0.0}
    return {s.name: 0.0 for s in effect.parameters if s.bounds[0] <= 0.0 <= s.bounds[1] and not s.held}


def _why_not(effect: Effect, vehicle: Vehicle, by_command: bool) -> str:
    if effect.name == "thrust_quadratic" and "thrust_bem" in vehicle.effects:
        return "thrust_bem stands for the same thrust"
    if effect.name == "ceiling_effect":
        return "no log says how far the ceiling was"
    if effect.stage in (Stage.COMMAND, Stage.DRIVE):
        if not by_command:
            return "rotor speed was measured, so what lies between command and speed cannot show"
        return "identify it from commands with `goshawk identify --add-effect`"
    if effect.stage == Stage.SENSOR and effect.name != "pose_delay":
        return "the estimator has the pose sensor's place and the gyro's bias among its unknowns already"
    return ""


def _no_load(flights: Sequence[Flight]) -> str:
    """Why a load cannot show on these flights; it shows only between flights with it and flights without."""
    said = {f.carries_payload for f in flights}
    if False in said and len(said) > 1:
        return ""
    if said == {False}:
        return "no flight carried it, as the logs say"
    if True in said:
        return "every flight carried it, as the logs say, and then it only scales thrust and inertia"
    if len({f.log_index for f in flights}) < 2:
        return "a load on all flights only scales thrust and inertia; fly with and without it"
    return ""


def _suspects(effect: Effect, vehicle: Vehicle) -> list[Suspect]:
    wanted = [s for s in effect.parameters if not s.held]
    along: list[Spec] = []
    if effect.name == "thrust_bem":
        wanted = [s for s in effect.parameters if s.name == "k2_n_s2_m"]
    if effect.name == PAYLOAD:
        wanted, along = list(effect.parameters[:1]), list(effect.parameters[1:])
    channels = tuple(word for word in effect.channel.split() if word[:2] in ("F_", "M_"))

    def make(name: str, specs: list) -> Suspect:
        return Suspect(
            name=name,
            effect=effect.name,
            parameters=tuple(f"{effect.name}.{s.name}" for s in specs),
            one_sided=tuple(s.bounds[0] == 0.0 or effect.name in SEPARATELY for s in specs),
            usual=tuple(LOAD_SHARE * vehicle.mass_kg if effect.name == PAYLOAD else s.prior for s in specs),
            channels=channels,
            regressor=effect.regressor,
            excited_by=effect.excited_by,
            fitted_along=tuple(f"{effect.name}.{s.name}" for s in along),
        )

    if effect.name in SEPARATELY:
        return [make(SEPARATELY[effect.name].format(i), [s]) for i, s in enumerate(wanted)]
    return [make(effect.name, wanted)]


def _swapped_thrust(vehicle: Vehicle) -> Vehicle:
    """Thrust k n^2 is the induced-velocity law with k2 = 0, so that law can be tried as one more column."""
    if "thrust_quadratic" not in vehicle.effects or "thrust_bem" in vehicle.effects:
        return vehicle
    k = vehicle.parameter("thrust_quadratic.k_n_s2")
    swapped = vehicle.without_effect("thrust_quadratic").with_effect("thrust_bem", k1_n_s2=k.value, k2_n_s2_m=0.0)
    return swapped.with_value("thrust_bem.k1_n_s2", k.value, std=k.std, source=k.source)


def base_names(names: Sequence[str], vehicle: Vehicle) -> tuple[str, ...]:
    """Names of the fitted parameters as the lined-up vehicle calls them."""
    if "thrust_quadratic" in vehicle.effects:
        return tuple(names)
    return tuple("thrust_bem.k1_n_s2" if name == "thrust_quadratic.k_n_s2" else name for name in names)


def added(vehicle: Vehicle, suspect: Suspect, values: Sequence[float]) -> Vehicle:
    """The vehicle with a suspect made part of it, at these values clipped to their bounds."""
    effect = effects.find(suspect.effect)
    start = {s.name: s for s in effect.parameters}
    given = {
        name.split(".")[1]: float(np.clip(value, *start[name.split(".")[1]].bounds))
        for name, value in zip(suspect.parameters, values, strict=True)
    }
    if suspect.effect == "thrust_bem":
        k1 = vehicle.value("thrust_quadratic.k_n_s2")
        vehicle = vehicle.without_effect("thrust_quadratic")
        return vehicle.with_effect("thrust_bem", source="suspect", k1_n_s2=k1, **given)
    if suspect.effect in vehicle.effects:
        for name, value in given.items():
            vehicle = vehicle.with_value(f"{suspect.effect}.{name}", value, source="suspect")
        return vehicle
    return vehicle.with_effect(suspect.effect, source="suspect", **{**_at_rest(effect), **given})
