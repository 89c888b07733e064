"""A JSON schema of the vehicle file, for editors that complete and check TOML (Even Better TOML, taplo)."""

from dataclasses import fields
from typing import Any

from vehicle import effects as registry
from vehicle.effects.base import Effect, Spec
from vehicle.files import AXES, FORMAT, VERSION
from vehicle.model import BODY, GRAVITY_ON_EARTH_M_S2, ROTORS
from vehicle.parameters import Limits


def schema() -> dict[str, Any]:
    """The schema, with every effect of the catalogue; effects of the user's own are accepted unchecked."""
    effects = {name: _effect(effect) for name, effect in registry.catalogue().items()}
    position = {"type": "array", "minItems": 3, "maxItems": 3, "items": {"type": "number"}}
    rotors = {
        "position_body_m": {
            "description": "Hubs from the centre of mass, body axes: x forward, y left, z up; metres.",
            **_each(position),
        },
        "spin": {"description": "1 counter-clockwise seen from above, -1 clockwise.", **_each({"enum": [1, -1]})},
        AXES: {
            "description": "Unit vectors along which the rotors thrust, body axes; left out: all along z.",
            **_each(position),
        },
    }
    body = _table({s.name: _parameter(s) for s in BODY}, "What every vehicle has.") | {"required": ["mass_kg"]}
    return {
        "$schema": "http://json-schema.org/draft-07/schema#",
        "title": "Goshawk vehicle file",
        "type": "object",
        "required": ["format", "version", "name", "effects", "rotors", "body"],
        "properties": {
            "format": {"const": FORMAT},
            "version": {"type": "integer", "minimum": 1, "maximum": VERSION},
            "name": {"type": "string", "minLength": 1},
            "effects": {
                "description": "The laws the model is made of, in the order in which they act.",
                "type": "array",
                "uniqueItems": True,
                "items": {"anyOf": [{"enum": sorted(effects)}, {"type": "string"}]},
            },
            "gravity_m_s2": {
                "description": "Gravity where it flies, m/s2; standard gravity where it is not given.",
                "type": "number",
                "minimum": GRAVITY_ON_EARTH_M_S2[0],
                "maximum": GRAVITY_ON_EARTH_M_S2[1],
            },
            "effect_files": {"type": "array", "items": {"type": "string"}},
            "rotors": _table(rotors, "Four to eight rotors.") | {"required": ["position_body_m", "spin"]},
            "body": body,
            "effect": {"type": "object", "properties": effects},
            "limits": _table(
                {f.name: {"type": "number", "minimum": 0.0} for f in fields(Limits)},
                "Limits that a plan must keep.",
            ),
            "provenance": {"type": "object"},
        },
    }


def _effect(effect: Effect) -> dict[str, Any]:
    """With a parameter for each rotor: those of eight are known, those of four required."""
    most = effect if effect.each_rotor is None else registry.find(effect.name, ROTORS[1])
    table = _table({s.name: _parameter(s) for s in most.parameters}, effect.law)
    return table | {"required": [s.name for s in effect.parameters]}


def _parameter(spec: Spec) -> dict[str, Any]:
    low, high = spec.bounds
    return {
        "type": "object",
        "required": ["value", "unit"],
        "additionalProperties": False,
        "description": f"in {spec.unit}, from {low:g} to {high:g}",
        "properties": {
            "value": {"type": "number", "minimum": low, "maximum": high},
            "std": {"type": "number", "minimum": 0.0, "description": "standard deviation; 0 = taken as exact"},
            "unit": {"const": spec.unit},
            "source": {"type": "string", "description": "where the value came from"},
        },
    }


def _table(properties: dict[str, Any], description: str) -> dict[str, Any]:
    return {"type": "object", "description": description, "additionalProperties": False, "properties": properties}


def _each(item: dict[str, Any]) -> dict[str, Any]:
    return {"type": "array", "minItems": ROTORS[0], "maxItems": ROTORS[1], "items": item}
