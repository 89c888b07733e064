"""The catalogue of effects: of each its law, its parameters with units, what shows it, what excites it, its source."""

from firmware_bridge.controller import compensated_effects
from tools.reference.markdown import code, codes, number, plain, table
from vehicle.effects import catalogue
from vehicle.effects.base import Effect, Spec

FAMILIES = {
    "thrust": "Thrust",
    "drag": "Drag",
    "torque": "Torque",
    "motors": "Motors and battery",
    "mass": "Mass and inertia",
    "surroundings": "Surroundings",
    "sensors": "Sensors",
}
"""Folders of the catalogue, in the order of the page."""


def page() -> str:
    """A list of all effects, then each by family."""
    effects = catalogue().values()
    listed = table(
        ("effect", "law", "shows in"),
        ([f"[`{e.name}`](#{e.name})", code(e.law), plain(f"{e.channel} against {e.regressor}")] for e in effects),
    )
    parts = [listed]
    for folder, title in FAMILIES.items():
        parts.append(f"## {title}")
        parts += [_section(effect) for effect in effects if family(effect) == folder]
    return "\n\n".join(parts)


def compensation() -> str:
    """Whether the controller cancels each effect, and how, or why not."""
    rows = ([code(name), "yes" if entry else "no", plain(entry.how)] for name, entry in compensated_effects().items())
    return table(("effect", "compensated", "how, or why not"), rows)


def family(effect: Effect) -> str:
    """The folder of the catalogue that has the effect's file."""
    return effect.apply.__module__.split(".")[2]


def _section(effect: Effect) -> str:
    facts = [
        plain(f"Shows in {effect.channel} against {effect.regressor}."),
        f"Excited by {codes(effect.excited_by)}.",
        f"Reads {codes(effect.needs)}." if effect.needs else "",
        "Shows only between flights with it and flights without." if effect.between_flights else "",
        f"Contains {code(effect.instead_of)}; a vehicle has one of the two." if effect.instead_of else "",
        f"Moves the vehicle as {code(effect.moves_like)} does: no candidate of a diagnosis."
        if effect.moves_like
        else "",
        plain(f"Source: {effect.source}."),
    ]
    head = f"### {effect.name}\n\n```text\n{effect.law}\n```"
    rows = [_row(spec) for spec in effect.parameters]
    listed = table(("parameter", "unit", "bounds", "default", "usual size"), rows)
    return "\n\n".join([head, listed, " ".join(fact for fact in facts if fact)])


def _row(spec: Spec) -> tuple[str, ...]:
    low, high = spec.bounds
    size = "held: a convention" if spec.held else number(spec.prior)
    return code(spec.name), spec.unit, f"{number(low)} to {number(high)}", number(spec.default), size
