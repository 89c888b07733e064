"""The staircase on the nano-drone flights: each left out in turn, the others diagnosed, the error on the one left out.

Run by `real_logs.py staircase`; the facts of each fold go to a file of their own, so that they can be run one by one.
"""

import json
import time
from collections import defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

import sysid
from flight import FlightLog
from sysid.diagnosis import Diagnosis, diagnose
from sysid.diagnosis.evidence import load
from vehicle import Vehicle

QUANTITIES = {"position": "m", "velocity": "m/s", "attitude": "rad"}
SHOWN = 3
"""Horizons shown: 0.1, 0.2 and 0.5 s."""


def fold(training: Sequence[FlightLog], left_out: FlightLog, model: Vehicle, options: sysid.Options) -> dict[str, Any]:
    """One diagnosis, and what every effect it tried does to the prediction of the flight left out."""
    begun = time.process_time()
    found = diagnose(training, model, held_out=[left_out], auto=True, options=replace(options, gusts="white"))
    spent = time.process_time() - begun
    models, steps = {"as given": model, "fitted": found.search.models[0].fit.vehicle}, []
    now, name_now = iter(found.search.models[1:]), "fitted"
    for i, trial in enumerate(found.search.trials):
        name = f"{i} {trial.outcome}: {trial.candidate.name}"
        kept = trial.outcome in ("added", "removed")
        models[name] = next(now).fit.vehicle if kept else trial.fit.vehicle
        steps.append({"model": name, "before": name_now, "effect": trial.candidate.name, "outcome": trial.outcome})
        name_now = name if kept else name_now
    compared = sysid.compare(load.marked([left_out], found.search.unseen), models, options)
    errors = {name: {q: list(compared.errors[name][q]) for q in QUANTITIES} for name in models}
    return {"cpu_s": spent, "last": name_now, "steps": steps, "errors": errors, **_said(found)}


def _said(found: Diagnosis) -> dict[str, Any]:
    facts = found.as_dict()
    kept = ("verdict", "confidence", "additions", "attempts", "outside", "parameters", "findings", "candidates")
    return {name: facts[name] for name in kept}


def run(
    logs: Mapping[str, FlightLog],
    only: Sequence[str],
    model: Vehicle,
    options: sysid.Options,
    out: Path,
    same_kind: bool,
) -> None:
    """Every fold that has no file yet, then the tables of all that have one.

    Args:
        same_kind: learn only from flights of the same manoeuvre, which is much quicker and asks for less.
    """
    out.mkdir(parents=True, exist_ok=True)
    for name, log in logs.items():
        if (only and name not in only) or (out / f"{name}.json").exists():
            continue
        others = [n for n in logs if n != name and (not same_kind or n.split("_")[0] == name.split("_")[0])]
        facts = fold([logs[n] for n in others], log, model, options)
        (out / f"{name}.json").write_text(json.dumps(facts, indent=1, default=float))
        print(f"{name}: {facts['verdict']} ({facts['cpu_s']:.0f} CPU s)", flush=True)
    folds = {p.stem: json.loads(p.read_text()) for p in sorted(out.glob("*.json"))}
    by_flight(folds)
    by_effect(folds)


def by_flight(folds: Mapping[str, Mapping[str, Any]]) -> None:
    print(
        "\n| flight left out | model | position 0.1 / 0.2 / 0.5 s (m) | velocity 0.5 s (m/s) | attitude 0.5 s (rad) |"
    )
    print("| --- | --- | --- | --- | --- |")
    for name, facts in folds.items():
        models = {"as given": "as given", "fitted": "fitted"}
        models |= {s["model"]: f"{s['outcome']}: {s['effect']}" for s in facts["steps"]}
        for model, words in models.items():
            e = facts["errors"][model]
            position = " / ".join(f"{x:.4f}" for x in e["position"][:SHOWN])
            print(f"| {name} | {words} | {position} | {e['velocity'][2]:.3f} | {e['attitude'][2]:.3f} |")


def by_effect(folds: Mapping[str, Mapping[str, Any]]) -> None:
    """How often each effect was added or refused, and what it does to the error of the flight left out."""
    change: dict[tuple[str, str], list[list[float]]] = defaultdict(list)
    for facts in folds.values():
        for step in facts["steps"]:
            after, before = (facts["errors"][step[key]]["position"][:SHOWN] for key in ("model", "before"))
            change[step["effect"], step["outcome"]].append([a / b - 1.0 for a, b in zip(after, before, strict=True)])
    print(f"\n| effect | outcome | of {len(folds)} flights | error at 0.1 / 0.2 / 0.5 s, mean | fell at 0.5 s in |")
    print("| --- | --- | --- | --- | --- |")
    for (effect, outcome), found in sorted(change.items(), key=lambda item: (item[0][1], -len(item[1]))):
        values = np.array(found)
        mean = " / ".join(f"{x:+.1%}" for x in values.mean(axis=0))
        print(f"| {effect} | {outcome} | {len(values)} | {mean} | {int((values[:, 2] < 0.0).sum())} |")
