"""A preflight's result in words: what came out, how sure it is, what decides it, and what to do next."""

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

import preflight
from goshawk.commands.preflight.outcome import Outcome
from goshawk.terminal import console
from preflight import remedies


def show(title: str, found: Outcome) -> None:
    """What, how sure, what next, in 24 lines."""
    result = found.result
    counted = {"touches": result.touched, "leaves the map": result.left_map}  # of the first level alone
    facts: dict[str, object] = {
        "go": f"{'GO' if result.go else 'NO-GO'}: {result.reason()}",
        **({"lost": str(result.rare.risk)} if result.rare is not None else {}),
        **{words: str(chance) for words, chance in counted.items() if result.rare is None or chance.count},
        **({"may be hidden": result.hidden.describe()} if result.hidden is not None else {}),
        "to the end": f"{100.0 * result.finished:.1f} %",
    }
    others = sorted(result.endings().items(), key=lambda item: -item[1].count)
    facts |= {words: str(chance) for words, chance in others[:2]}
    if (where := place(result)) is not None:
        facts["narrowest"] = where
    facts["decides most"], remedy = decides(result, found.plan_again, found.narrow_waypoints)
    facts |= found.advice_words()
    facts["next"] = "fly it" if result.go else remedy
    if found.assumed:
        facts["assumed"] = "; ".join(found.assumed)
    console.show(title, facts, as_json=False)
    console.table("", ("", "median", "90 %", "99 %", "worst"), _spreads(result))


def place(result: preflight.Result) -> str | None:
    """Where it is narrow, in words; None without a map."""
    found = result.place()
    if found is None:
        return None
    x, y, z = found.point_world_m
    those = "of the touches" if found.touching else "of the nearest flights"
    where = f"segment {found.segment} at {found.time_s:.1f} s near ({x:.2f}, {y:.2f}, {z:.2f})"
    return f"{where}, {100.0 * found.share:.0f} % {those}"


def decides(result: preflight.Result, again: dict[str, Any] | None, narrow: Sequence[int] = ()) -> tuple[str, str]:
    """What decides most, and what to do about it: with more room where that helps and these waypoints leave it."""
    said, remedy = _remedy(result)
    if narrow:
        numbers = ", ".join(str(waypoint + 1) for waypoint in narrow)
        remedy += f"; or move waypoint {numbers}, which leaves flights that touch near it no more room"
    if result.hidden is not None and result.hides:
        return said, result.hidden.remedy()  # no margin makes that a go
    if again is None:
        return said, remedy
    near, legs = len(again["near"]), sum(leg["slowed"] for leg in again["legs"])
    more = (f", more near {near} parts of it" if near else "") + (f", slower on {legs} legs" if legs else "")
    room = f"plan with --margin {again['margin_m']:.2f}{more}, as --preflown does from the file of --out"
    return said, f"{remedy}; or {room}, which is not tried yet: {_short(again['segments'], again['slower'])}"


def _short(segments: list[dict[str, Any]], slower: list[dict[str, Any]]) -> str:
    """Which segment needs most: where flights touch, else where they overturn, else where they are given up."""
    touched = [each for each in segments if each["touching"]]
    if touched:
        worst = max(touched, key=lambda each: each["extra_m"])
        return f"segment {worst['segment']} is {100.0 * worst['extra_m']:.0f} cm short"
    if slower:
        worst = max(slower, key=lambda each: each["factor"])
        return f"flights overturn in segment {worst['segment']} unless it takes {worst['factor']:g} times as long"
    worst = max(segments, key=lambda each: each["extra_m"])
    return f"flights are given up for their tracking error in segment {worst['segment']}"


def _remedy(result: preflight.Result) -> tuple[str, str]:
    if result.dominating is None:
        next_step = "run it to the end" if result.cut_off else "preflight with more --flights"
        return f"not known from {result.flights} flights", next_step
    factor, share = result.dominating
    without = "" if result.removed is None else f"; without it {result.removed.risk}"
    of = "what loses flights" if result.rare is not None and result.loss_shares else "the variance"
    return f"{factor}: {100.0 * share:.0f} % of {of}{without}", remedies.words(factor)


def _spreads(result: preflight.Result) -> list[tuple[object, ...]]:
    """Rows of quantiles, the bad side on the right."""
    d = result.as_dict()
    high, low = ("median", "q90", "q99", "most"), ("median", "q10", "q01", "least")
    rows = (
        ("tracking error, m", d["error_m"], high, 1.0),
        ("clearance beyond the vehicle, m", d["clearance_m"], low, 1.0),
        ("tilt, deg", d["tilt_rad"], high, math.degrees(1.0)),
        ("rotor reserve, %", d["rotor_reserve"], low, 100.0),
    )
    return [
        (name, *(np.round(unit * found[at], 3).item() for at in order)) for name, found, order, unit in rows if found
    ]
