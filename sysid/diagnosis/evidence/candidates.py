"""Who may be missing: every effect of the catalogue, and of the user's own, that these flights could show at all."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from flight import InputError
from sysid.estimator.flights import clocks
from sysid.estimator.flights.flight_data import Flight
from sysid.estimator.joint_problem.unknowns import SENSOR_NAMES
from sysid.estimator.motors import battery
from sysid.estimator.options import Reference
from vehicle import Vehicle, effects, sizes, wrench
from vehicle.effects.base import Effect, Spec, Stage

POSE_DELAY = "pose_delay"
DRIVEN = ("F_z", "M_x", "M_y", "M_z")
"""Where rotor speeds other than those expected show."""
NO_VOLTAGE = "the logs have no battery_v, and commands alone do not show how it fell; log it"
NO_WITNESS = "commands are early on every vehicle: without gyro or rotor speed no other clock shows a late pose"
LOAD_SHARE = 0.2
"""A usual load is this share of the vehicle's mass."""
TRACE = 1e-9
"""Share of the mass that a load at no strength weighs."""


@dataclass(frozen=True, slots=True)
class Candidate:
    """One effect that may be missing, and which of its parameters would be estimated."""

    name: str
    """The effect's name; `weak_rotor[2]` for one rotor's."""
    effect: str
    parameters: tuple[str, ...]
    """Full names, each with a column of its own."""
    one_sided: tuple[bool, ...]
    """Which of them cannot be negative."""
    usual: tuple[float, ...]
    """How large each typically is on this vehicle."""
    channels: tuple[str, ...]
    """Of `F_x F_y F_z M_x M_y M_z`, where it shows."""
    regressor: str
    excited_by: tuple[str, ...]
    fitted_along: tuple[str, ...] = ()
    """Further parameters, which mean nothing while those above are zero: they say where a load sits, and are fitted and
    scored with them."""

    between_flights: bool = False
    """Whether it shows only between flights with it and flights without."""

    @property
    def columns(self) -> tuple[str, ...]:
        """All it is scored by."""
        return (*self.parameters, *self.fitted_along)


@dataclass(frozen=True, slots=True)
class CandidateSet:
    """The vehicle with every candidate present at zero strength, and who could not be lined up."""

    vehicle: Vehicle
    candidates: tuple[Candidate, ...]
    invisible: tuple[tuple[str, str], ...]
    """Effect and reason: no flight of this kind can show it."""

    @property
    def all_heard(self) -> bool:
        """Whether no known effect is missing from the candidates for want of a reading that would have shown it."""
        return all(reason != NO_VOLTAGE for _, reason in self.invisible)

    def candidate(self, name: str) -> Candidate:
        """The candidate of this name. Raises `InputError` when there is none."""
        for candidate in self.candidates:
            if candidate.name == name:
                return candidate
        raise InputError(f"{name!r} is not among the candidates: {', '.join(s.name for s in self.candidates)}")


def candidate_set(vehicle: Vehicle, flights: Sequence[Flight], clock: Reference = "pose") -> CandidateSet:
    """Put every effect the vehicle lacks into it, at a strength of zero, so that only its slope is felt.

    Args:
        clock: against which delays of the streams are estimated.
    """
    invisible: list[tuple[str, str]] = []
    candidates: list[Candidate] = []
    extended = _swapped(vehicle)
    hover_rad_s = float(np.sqrt(np.nanmean(np.concatenate([f.rotor_speed_rad_s for f in flights]) ** 2)))
    for effect in _known(vehicle):
        if effect.name in vehicle.effects:
            continue
        reason = _no_load(flights) if effect.between_flights else _why_not(effect, vehicle, flights, clock)
        if reason:
            invisible.append((effect.name, reason))
            continue
        if effect.name not in extended.effects:
            extended = extended.with_effect(effect.name, source="candidate", **_at_rest(effect))
            if effect.between_flights:  # a trace of it, so that its place has columns
                for name in effect.strength:
                    extended = extended.with_value(f"{effect.name}.{name}", TRACE * vehicle.mass_kg)
        candidates += _candidates(effect, vehicle, hover_rad_s)
    return CandidateSet(extended, tuple(candidates), tuple(invisible))


def require_missing(name: str, vehicle: Vehicle) -> None:
    """Check, without any flight, the name of a candidate (an effect's, or `weak_rotor[2]`) that the vehicle may lack.

    Raises:
        InputError: there is no such effect, or the vehicle has it already.
    """
    effect = vehicle.effect(name.split("[")[0])
    if name not in (effect.name, *_names(effect)):
        raise InputError(f"{name!r} is not among the candidates of {effect.name}: {', '.join(_names(effect))}")
    if effect.name in vehicle.effects:
        raise InputError(f"the model has {effect.name} already; its size and error are in the vehicle file")


def _known(vehicle: Vehicle) -> list[Effect]:
    own = [effects.load_file(path) for path in vehicle.effect_files]
    return [*(vehicle.effect(name) for name in effects.catalogue()), *own]


def _at_rest(effect: Effect) -> dict[str, float]:
    """Parameters at zero; shapes (what does not vanish by default) at their default."""
    if effect.between_flights:
        return dict.fromkeys(effect.strength, 0.0)
    if effect.stage is Stage.DRIVE:  # a lag so short that it does nothing; none at all is no lag's value
        return {s.name: s.bounds[0] for s in effect.parameters}
    return {s.name: 0.0 for s in effect.parameters if s.bounds[0] <= 0.0 <= s.bounds[1] and not s.held}


def _why_not(effect: Effect, vehicle: Vehicle, flights: Sequence[Flight], clock: Reference) -> str:
    by_command = any(f.driven_by_command for f in flights)
    for other in vehicle.effects:
        if effect.name in _contained(other):
            return f"{other} describes the same thrust"
    if effect.moves_like:
        return f"it moves the vehicle as {effect.moves_like} does: no flight can tell the two apart"
    if "ceiling_gap_m" in effect.needs:
        return "no log has the distance to the ceiling"
    if effect.stage in (Stage.COMMAND, Stage.DRIVE):
        if not by_command:
            return "rotor speed was measured, so effects between command and rotor speed do not act on the fit"
        if effect.name == battery.SAG and not all(np.isfinite(f.battery_v).all() for f in flights):
            return NO_VOLTAGE
    if effect.stage == Stage.SENSOR and not {f"{effect.name}.{s.name}" for s in effect.parameters} <= set(SENSOR_NAMES):
        return "the estimator has the pose sensor's place and the gyro's bias among its unknowns already"
    if effect.name == POSE_DELAY and clock == "pose":
        if all(f.streams.keys() <= {clocks.COMMAND} for f in flights):
            return NO_WITNESS
        return "the delay of every stream against the pose is estimated already; see the clocks of the report"
    return ""


def _contained(name: str) -> list[str]:
    """The effects that one contains: that which it is in place of, what that is in place of, and so on."""
    within = effects.find(name).instead_of
    return [within, *_contained(within)] if within else []


def _no_load(flights: Sequence[Flight]) -> str:
    """Why a load cannot show on these flights; it shows only between flights with it and flights without."""
    said = {f.carries_payload for f in flights}
    if False in said and len(said) > 1:
        return ""
    if said == {False}:
        return "according to the logs no flight carried it"
    if True in said:
        return "according to the logs every flight carried it, and then it only scales thrust and inertia"
    if len({f.log_index for f in flights}) < 2:
        return "a load on all flights only scales thrust and inertia; fly with and without it"
    return ""


def _wanted(effect: Effect) -> list[Spec]:
    """The parameters that say how strong an effect is."""
    return [s for s in effect.parameters if not s.held and (s.name in effect.strength or not effect.strength)]


def _names(effect: Effect) -> list[str]:
    """The names of an effect's candidates: one for each rotor where they are separated."""
    return [f"{effect.name}[{i}]" for i in range(len(_wanted(effect)))] if effect.separate else [effect.name]


def _candidates(effect: Effect, vehicle: Vehicle, hover_rad_s: float) -> list[Candidate]:
    wanted = _wanted(effect)
    along = [s for s in effect.parameters if s not in wanted] if effect.between_flights else []
    channels = tuple(word for word in effect.channel.split() if word[:2] in ("F_", "M_"))
    between_command_and_speed = effect.stage in (Stage.COMMAND, Stage.DRIVE)
    if between_command_and_speed:
        channels = DRIVEN

    def make(name: str, specs: list) -> Candidate:
        return Candidate(
            name=name,
            effect=effect.name,
            parameters=tuple(f"{effect.name}.{s.name}" for s in specs),
            one_sided=tuple(s.bounds[0] == 0.0 or effect.separate or between_command_and_speed for s in specs),
            usual=tuple(
                LOAD_SHARE * vehicle.mass_kg if effect.between_flights else sizes.usual(s, vehicle, hover_rad_s)
                for s in specs
            ),
            channels=channels,
            regressor=effect.regressor,
            excited_by=effect.excited_by,
            fitted_along=tuple(f"{effect.name}.{s.name}" for s in along),
            between_flights=effect.between_flights,
        )

    each = [[s] for s in wanted] if effect.separate else [wanted]
    return [make(name, specs) for name, specs in zip(_names(effect), each, strict=True)]


def _swapped(vehicle: Vehicle) -> Vehicle:
    """The vehicle with every law that another one contains written as that one at no strength.

    Thrust k n^2 is the induced-velocity law with k2 = 0, so that law can be tried as one more column.
    """
    for effect in _known(vehicle):
        if effect.instead_of in vehicle.effects and effect.name not in vehicle.effects and not effect.moves_like:
            vehicle = _instead(vehicle, effect, dict.fromkeys(effect.strength, 0.0), "assumed")
    return vehicle


def _instead(vehicle: Vehicle, effect: Effect, strength: Mapping[str, float], source: str) -> Vehicle:
    """The vehicle with an effect in place of the one that it contains."""
    theirs, ours = effect.takes_over
    old = vehicle.parameter(f"{effect.instead_of}.{theirs}")
    bare = vehicle.without_effect(effect.instead_of)
    swapped = bare.with_effect(effect.name, source=source, **{ours: old.value}, **strength)
    return swapped.with_value(f"{effect.name}.{ours}", old.value, std=old.std, source=old.source)


def taken_out(vehicle: Vehicle, effect: str) -> Vehicle:
    """The vehicle without an effect; with the law that this one contains in its place, if there is one.

    Thrust by the induced-velocity law gone, thrust is k n^2 again: without any law of thrust nothing would carry it.
    What the two laws share keeps its value, and in hover they lift the same.

    Raises:
        InputError: the effect is not active.
    """
    bare = vehicle.without_effect(effect)
    contains = vehicle.effect(effect)
    if not contains.instead_of or contains.instead_of in bare.effects:
        return bare
    theirs, ours = contains.takes_over
    old = vehicle.parameter(f"{effect}.{ours}")
    name = f"{contains.instead_of}.{theirs}"
    shared = {s.name for s in bare.effect(contains.instead_of).parameters} & {s.name for s in contains.parameters}
    kept = {s: vehicle.value(f"{effect}.{s}") for s in shared}
    back = bare.with_effect(contains.instead_of, source=old.source, **{**kept, theirs: old.value})
    share = _lift_n(vehicle, effect, old.value) / _lift_n(back, contains.instead_of, old.value) if old.value else 1.0
    return back.with_value(name, share * old.value, std=share * old.std, source=old.source)


def _lift_n(vehicle: Vehicle, law: str, k_n_s2: float) -> float:
    """Force of one law of thrust alone, in still air, at the rotor speed at which k n^2 carries the vehicle."""
    for other in vehicle.effects:
        vehicle = vehicle.without_effect(other) if other != law else vehicle
    still, speed = np.zeros((1, 3)), np.sqrt(vehicle.mass_kg * vehicle.gravity_m_s2 / (vehicle.rotors * k_n_s2))
    return float(np.linalg.norm(wrench(vehicle, still, still, np.full((1, vehicle.rotors), speed))[0]))


def base_names(names: Sequence[str], vehicle: Vehicle) -> tuple[str, ...]:
    """Names of the fitted parameters as the vehicle with all candidates calls them."""
    containing = [effects.find(name) for name in vehicle.effects if effects.find(name).instead_of]
    renamed = {f"{e.instead_of}.{e.takes_over[0]}": f"{e.name}.{e.takes_over[1]}" for e in containing}
    return tuple(renamed.get(name, name) for name in names)


def added(vehicle: Vehicle, candidate: Candidate, values: Sequence[float]) -> Vehicle:
    """The vehicle with a candidate made part of it, at these values clipped to their bounds."""
    effect = vehicle.effect(candidate.effect)
    start = {s.name: s for s in effect.parameters}
    given = {
        name.split(".")[1]: float(np.clip(value, *start[name.split(".")[1]].bounds))
        for name, value in zip(candidate.parameters, values, strict=True)
    }
    if effect.instead_of in vehicle.effects:
        return _instead(vehicle, effect, given, "candidate")
    if candidate.effect in vehicle.effects:
        for name, value in given.items():
            vehicle = vehicle.with_value(f"{candidate.effect}.{name}", value, source="candidate")
        return vehicle
    return vehicle.with_effect(candidate.effect, source="candidate", **{**_at_rest(effect), **given})
