"""One blind campaign: diagnose it from its logs and vehicle file alone, then score the result by ground truth."""

import json
import time
from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path
from typing import Any

import diagnosis_written
from blind_campaigns import LOADED

import sysid
import vehicle
from flight import FlightLog, InputError, file_format, flight_log
from sysid.diagnosis.procedure import while_searching
from sysid.estimator.validation.comparison import HORIZONS_S

HORIZON = HORIZONS_S.index(0.5)
SAME = while_searching(sysid.Options())
"""Base and oracle are fitted as the diagnosis fits, so that only the effects differ."""
LEAST_FALL = 0.01
"""The oracle must lower the held-out error by this share before a share of its fall means anything."""
MASSLESS = frozenset(
    {
        "weak_rotor",
        "ground_effect",
        "descent_loss",
        "pose_delay",
        "rotor_drag_thrust",
        "rotor_interaction",
        "centre_of_mass",
        "constant_wind",
        "motor_lag",
        "battery_sag",
    }
)
"""Effects whose parameters are ratios, times or lengths; all others scale with the mass, slightly wrong in the file."""
TOLD = (
    *("hidden", "channels", "variables", "law", "tolerated", "real_drag", "near"),
    *("gust_m_s", "rotor_late_s", "commands_only"),
)
"""What of the truth is kept beside a result."""
NOT_SIZED = frozenset({"payload", "thrust_bem"})
"""Effects whose parameters mean something else in the truth: no coverage is counted."""


def score(folder: Path) -> dict[str, Any]:
    """Diagnose, then score against the truth file; plain JSON values."""
    from sysid.diagnosis import diagnose

    name = folder.name
    training, held_out, given = load(folder)
    wall, cpu = time.perf_counter(), time.process_time()
    found = diagnose(training, given, held_out=held_out, auto=True)
    diagnosed = {"wall_s": time.perf_counter() - wall, "cpu_s": time.process_time() - cpu, **stated(found)}
    truth = json.loads((folder.parent / "truth" / f"{name}.json").read_text())
    return {
        "campaign": name,
        "kind": truth["kind"],
        "diagnosis": diagnosed,
        "truth": {k: truth[k] for k in TOLD},
        "ratio": {effect: ratio(effect, sizes, diagnosed["candidates"]) for effect, sizes in truth["hidden"].items()},
        "inside": inside(diagnosed, truth),
        "answer": diagnosis_written.answer(found),
        **errors(training, held_out, given, found, truth),
        **(
            diagnosis_written.beside_optimum(training, held_out, given, found, truth) if truth["kind"] == "form" else {}
        ),
    }


def load(folder: Path) -> tuple[list[FlightLog], list[FlightLog], vehicle.Vehicle]:
    """The inputs of the diagnosis."""
    manifest = file_format.read_toml(folder / "manifest.toml", format="goshawk-blind-campaign", version=1)
    training, held_out = (
        [flight_log.load(folder / file) for file in manifest[part]] for part in ("training", "held_out")
    )
    return training, held_out, vehicle.load(folder / manifest["vehicle"])


def stated(found: Any) -> dict[str, Any]:
    """A diagnosis as plain values."""
    outside = found.outside
    return {
        "additions": list(found.additions),
        "negligible": list(found.negligible),
        "proxies": list(found.proxies),
        "undecided": list(found.undecided),
        "doubts": list(found.doubts),
        "families": [one.as_dict() for one in found.families],
        "family_of_curve": found.family_of_curve and found.family_of_curve.name,
        "attempts": [[a.name, a.outcome, a.sentence] for a in found.attempts],
        "confidence": float(found.confidence),
        "probabilities": found.belief.as_dict(),
        "outside": outside
        and {"channel": outside.channel, "variable": outside.variable, "confidence": float(outside.confidence)},
        "candidates": {
            s.name: {
                "verdict": s.verdict,
                "confidence": float(s.confidence),
                "size": _short(s.size),
                "smallest_visible": _short(s.smallest_visible),
                "usual": _short({size.parameter: size.usual for size in s.sizes}),
                "interval90": {size.parameter.split(".")[-1]: list(size.interval90) for size in s.sizes},
            }
            for s in found.candidates
        },
    }


def _short(values: dict[str, float]) -> dict[str, float]:
    return {name.split(".")[-1]: float(value) for name, value in values.items()}


def effect_of(name: str) -> str:
    """`weak_rotor[2]` is the effect `weak_rotor`."""
    return name.split("[")[0]


def ratio(effect: str, sizes: dict[str, float], candidates: dict[str, Any]) -> float | None:
    """True size over the smallest detectable one; the largest ratio of its parameters counts. None: not claimed."""
    found = []
    for name, candidate in candidates.items():
        if effect_of(name) == effect:
            visible = candidate["smallest_visible"]
            found += [abs(sizes[p]) / x for p, x in visible.items() if p in sizes and x > 0.0]
    return max(found, default=None)


def inside(diagnosed: dict[str, Any], truth: dict[str, Any]) -> dict[str, bool]:
    """Whether the stated 90 % interval of each size of a rightly added effect holds the truth."""
    flags = {}
    for name in diagnosed["additions"]:
        effect = effect_of(name)
        if effect not in truth["hidden"] or effect in NOT_SIZED:
            continue
        scale = 1.0 if effect in MASSLESS else truth["file_mass_kg"] / truth["mass_kg"]
        for parameter, (low, high) in diagnosed["candidates"][name]["interval90"].items():
            true = scale * truth["hidden"][effect].get(parameter, 0.0)
            blamed = effect != "weak_rotor" or true != 0.0  # another rotor is counted as a name, not as a size
            if blamed and high > low:
                flags[f"{effect}.{parameter}"] = bool(low <= true <= high)
    return flags


def errors(
    training: list[FlightLog],
    held_out: list[FlightLog],
    given: vehicle.Vehicle,
    diagnosis: Any,
    truth: dict[str, Any],
) -> dict[str, Any]:
    """Held-out position errors after 0.5 s: base refitted, diagnosis, and an oracle that has the true structure.

    The oracle has the marks of flights with the payload; the diagnosis found its own.
    """
    if not truth["hidden"] and not truth["real_drag"]:
        return {}
    informed = given
    for believed in truth["believed_drag"]:
        informed = informed.without_effect(believed)
    for effect in (*truth["hidden"], *truth["real_drag"]):
        informed = informed.with_effect(effect, **truth["hidden"].get(effect, {}))
    try:
        base = sysid.identify(training, given, SAME).vehicle
        learnt = loaded(training, [i in LOADED for i in range(len(training))])
        oracle = sysid.identify(learnt, informed, _oracle_options(informed, truth)).vehicle
    except InputError as error:
        return {"no_oracle": str(error)}
    truly = loaded(held_out, [len(training) + i in LOADED for i in range(len(held_out))])
    supposed = loaded(held_out, diagnosis.payload_carried[len(training) :])
    found = position_errors(truly, {"base": base, "oracle": oracle})
    found |= position_errors(supposed, {"diagnosed": diagnosis.vehicle})
    fall = found["base"] - found["oracle"]
    share = (found["base"] - found["diagnosed"]) / fall if fall > LEAST_FALL * found["base"] else None
    return {"error_m": found, "share": share}


def position_errors(logs: list[FlightLog], models: dict[str, vehicle.Vehicle]) -> dict[str, float]:
    """By model, after 0.5 s."""
    compared = sysid.compare(logs, models, SAME)
    return {name: compared.errors[name]["position"][HORIZON] for name in models}


def loaded(logs: list[FlightLog], carried: Iterable[bool]) -> list[FlightLog]:
    """Logs marked with or without the payload; unmarked where the campaign does not state it."""
    marks = list(carried) or [None] * len(logs)
    return [FlightLog(log.columns, {**log.metadata, "payload_carried": c}) for log, c in zip(logs, marks, strict=True)]


def _oracle_options(informed: vehicle.Vehicle, truth: dict[str, Any]) -> sysid.Options:
    """The oracle has the index of the weak rotor: the losses of the others are held at zero."""
    losses = truth["hidden"].get("weak_rotor", {})
    return replace(SAME, held=tuple(f"weak_rotor.{p}" for p, x in losses.items() if x == 0.0))
