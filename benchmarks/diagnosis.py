"""How good the diagnosis is, on blind campaigns:

    python benchmarks/diagnosis.py [--count N] [--seed S] [--campaigns FOLDER] [--results FILE] [--jobs 1] [--json FILE]

Campaigns are flown first (`blind_campaigns.py`), unless FOLDER has some already. Results are kept one a line, so that
a run that was cut off goes on where it stopped. The truth of a campaign is opened after its diagnosis is finished.
"""

import argparse
import json
import os
import tempfile
from collections.abc import Iterable
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import asdict
from pathlib import Path
from typing import Any

import blind_campaigns
import numpy as np
import report
from diagnosis_run import effect_of, score

from sysid.diagnosis.families import family_of

MOST_JOBS = 2
ABOVE = 2.0
"""Singles and pairs count when their size is this many times the smallest detectable one."""

NEAR_OPTIMUM = 1.05
"""Held-out error of the model that is written over that of the same fit with the true law's form."""
MOST_LINES = 24

WAKE = "v_x v_y"
"""What the speed of the wake towards a rotor, `s`, is made of."""

Result = dict[str, Any]


def right(result: Result) -> list[str]:
    """Names that count as correct in a campaign."""
    return [*result["truth"]["hidden"], *result["truth"]["tolerated"]]


def names(result: Result) -> list[str]:
    """Effects added, in order, without those that are present in every campaign."""
    return [effect_of(n) for n in result["diagnosis"]["additions"] if effect_of(n) != "imu_errors"]


def too_small(result: Result) -> list[str]:
    """Effects that the sentence says to show, too small to matter: added, never taken out, and not named as missing."""
    if "negligible" in result["diagnosis"]:
        return [effect_of(name) for name in result["diagnosis"]["negligible"]]
    ended = {effect_of(name): outcome for name, outcome, _ in result["diagnosis"].get("attempts") or ()}
    named = {*map(effect_of, result["diagnosis"]["additions"])}
    return [name for name, outcome in ended.items() if outcome == "added" and name not in named]


def family_is_right(result: Result) -> bool:
    """Whether something is named, and every name is of a family that is hidden, or as good as one."""
    diagnosed = result["diagnosis"]
    said = {family_of(name) for name in (*names(result), *map(effect_of, diagnosed.get("undecided") or ()))}
    said |= {family_of(name) for name in too_small(result) if name in right(result)}
    said |= {diagnosed["family_of_curve"]} if diagnosed.get("family_of_curve") else set()
    return bool(said) and said <= {family_of(name) for name in right(result)}


def visible(result: Result) -> bool:
    """Whether all hidden effects are well above the smallest size detectable in these flights."""
    return all(r is not None and r >= ABOVE for r in result["ratio"].values())


def outside_is_right(result: Result) -> bool:
    """Right channel and right variable; `v_z v_z` is a matter of v_z."""
    diagnosed = result["diagnosis"]["outside"]
    if diagnosed is None:
        return False
    channel, variable = diagnosed["channel"], diagnosed["variable"].replace("|", " ")
    channels = set(result["truth"]["channels"])
    if result["kind"] == "form" and channel[0] in "TL" and "F_x" not in channels:  # what F_x shows too is drag
        channel = "F_z"
        if variable == "s" and "M_y" in channels:  # rotors that lose apart: a wake
            variable = WAKE
    return channel in channels and set(variable.split()) <= set(result["truth"]["variables"])


def sentence_is_right(result: Result) -> bool:
    """Whether names, curve and silence together tell the truth."""
    diagnosed, hidden, said = result["diagnosis"], set(result["truth"]["hidden"]), names(result)
    shows = [name for name in too_small(result) if name != "imu_errors"]
    if any(name not in right(result) for name in (*said, *shows)):
        return False
    curve_is_right = outside_is_right(result) or (result["kind"] == "foreign" and _of_drag(diagnosed["outside"]))
    if diagnosed["outside"] is not None and not curve_is_right:
        return False
    undecided = {effect_of(name) for name in diagnosed.get("undecided") or ()}
    said += shows
    if undecided and not undecided & {*right(result)}:
        return False
    if result["kind"] in ("outside", "form"):
        return bool(said) or bool(undecided) or curve_is_right
    shown = {name for name in hidden if (r := result["ratio"][name]) is None or r >= 1.0}
    return shown <= {*said, *undecided}


def _of_drag(outside: dict[str, Any] | None) -> bool:
    """A curve in place of drag of another form."""
    return outside is not None and outside["channel"][0] == "F" and outside["variable"][0] in "vs"


def rows(results: list[Result]) -> list[report.Row]:
    """The table of scores with their bars."""
    kind = {k: [r for r in results if r["kind"] == k] for k in blind_campaigns.KINDS}
    return [
        *_singles_and_pairs(kind["single"], kind["pair"]),
        *_conditions(kind["single"] + kind["pair"]),
        *_nothing_and_outside(kind["none"], kind["outside"]),
        _share("law of another form: nearest name or curve, no other", map(sentence_is_right, kind["form"]), 0.85),
        _share("effects or forms hidden: family named, no other", map(family_is_right, _hiding(kind)), 0.9),
        *_names(results, kind["foreign"]),
        *_sizes(results),
        *_written(results),
        *_belief(results),
        *_time(results),
    ]


def _hiding(kind: dict[str, list[Result]]) -> list[Result]:
    """Campaigns whose hidden physics has a name in the catalogue, and shows."""
    known = [r for r in kind["single"] + kind["pair"] if visible(r)]
    return known + [r for r in kind["form"] if r["truth"]["near"]]


def _share(name: str, flags: Iterable[bool], bar: float, *, most: bool = False, peers: Any = None) -> report.Row:
    values = list(flags)
    share = float(np.mean(values)) if values else float("nan")
    ok = None if not values else share <= bar if most else share >= bar
    sign = "<=" if most else ">="
    return report.row(f"{name} (of {len(values)})", share, "", f"{sign} {bar:g}", ok, peers)


def _mean(values: Iterable[Any]) -> float:
    kept = [float(v) for v in values]
    return float(np.mean(kept)) if kept else float("nan")


def _singles_and_pairs(single: list[Result], pair: list[Result]) -> list[report.Row]:
    first = [(r, names(r)[:1] == list(r["truth"]["hidden"])) for r in single]
    both = [(r, set(names(r)) == set(r["truth"]["hidden"]) and r["diagnosis"]["outside"] is None) for r in pair]
    return [
        _share(
            "single effects above twice the limit: first name right",
            (ok for r, ok in first if visible(r)),
            0.95,
            peers={"all singles": _mean(ok for _, ok in first), "no limit stated": _unstated(single)},
        ),
        _share(
            "pairs above twice the limit: both names and no other",
            (ok for r, ok in both if visible(r)),
            0.90,
            peers={"all pairs": _mean(ok for _, ok in both), "no limit stated": _unstated(pair)},
        ),
    ]


def _conditions(hiding: list[Result]) -> list[report.Row]:
    """Commands alone, a clock that is off, and effects too weak for these flights."""

    def all_named(chosen: list[Result]) -> list[bool]:
        return [set(r["truth"]["hidden"]) <= set(names(r)) for r in chosen if visible(r)]

    commands = [r for r in hiding if r["truth"]["commands_only"]]
    off = [r for r in hiding if r["truth"]["rotor_late_s"] != 0.0]
    weak = [
        (r, name) for r in hiding for name, ratio in r["ratio"].items() if ratio is None or ratio < 1.0
    ]  # fmt: skip
    return [
        _share("commands alone: all named that show", all_named(commands), 0.95),
        _share("clock off: all named that show", all_named(off), 0.95),
        _share(
            "too weak to tell: its size excluded all the same",
            (_excluded(r, name) for r, name in weak),
            0.05,
            most=True,
        ),
    ]


def _excluded(result: Result, effect: str) -> bool:
    """Whether an effect is called excluded, every part of it, and a size of it beyond what is excluded is there."""
    own = [s for name, s in result["diagnosis"]["candidates"].items() if effect_of(name) == effect]
    sizes = result["truth"]["hidden"][effect]
    beyond = any(
        abs(size) > max(map(abs, s["interval90"][parameter]))
        for s in own
        for parameter, size in sizes.items()
        if parameter in s["interval90"]
    )
    return beyond and all(s["verdict"] == "excluded" for s in own)


def _unstated(results: list[Result]) -> float:
    """Campaigns left out because the diagnosis gave no smallest detectable size."""
    return sum(None in r["ratio"].values() for r in results)


def _nothing_and_outside(none: list[Result], outside: list[Result]) -> list[report.Row]:
    diagnosed = {"curve drawn": _mean(r["diagnosis"]["outside"] is not None for r in none)}
    seen = {
        "outside named": _mean(r["diagnosis"]["outside"] is not None for r in outside),
        "false name": _mean(bool(names(r)) for r in outside),
    }
    return [
        _share("nothing missing: something added", (bool(names(r)) for r in none), 0.0, most=True, peers=diagnosed),
        _share("outside: channel and variable right", map(outside_is_right, outside), 0.85, peers=seen),
    ]


def _names(results: list[Result], foreign: list[Result]) -> list[report.Row]:
    def false(chosen: list[Result]) -> list[bool]:
        return [name not in right(r) for r in chosen for name in names(r)]

    own = [r for r in results if r["kind"] != "foreign"]
    with_one = _mean(any(n not in right(r) for n in names(r)) for r in foreign)
    return [
        _share("false names among all added", false(own), 0.03, most=True),
        _share("foreign base: false names", false(foreign), 0.10, most=True, peers={"campaigns with one": with_one}),
    ]


def _sizes(results: list[Result]) -> list[report.Row]:
    shares = np.array([r["share"] for r in results if r.get("share") is not None])
    flags = [ok for r in results for ok in r["inside"].values()]
    coverage = _mean(flags)
    median, low = (float(np.quantile(shares, q)) if len(shares) else float("nan") for q in (0.5, 0.1))
    what = "share of the oracle's fall of the held-out error"
    inside = 0.87 <= coverage <= 0.93 if flags else None
    return [
        report.row(
            f"{what}: median (of {len(shares)})", median, "", ">= 0.98", median >= 0.98 if len(shares) else None
        ),
        report.row(f"{what}: worst decile", low, "", ">= 0.9", low >= 0.9 if len(shares) else None),
        report.row(f"90 % intervals of added sizes that hold ({len(flags)})", coverage, "", "0.87-0.93", inside),
    ]


def _written(results: list[Result]) -> list[report.Row]:
    """What a user has besides the sentence; results of before these were kept are left out."""
    answers = [r["answer"] for r in results if "answer" in r]
    better = [a for a in answers if a["halves"]]
    lines = [a["lines"] for a in answers]
    most = max(lines, default=None)
    marked = [a["marked"] for a in answers if a["for_prediction"]]
    written = {"those for prediction alone": len(marked), "of them marked": sum(marked)}
    optima = [(_ratio(**r["optimum"]), r["equation"]) for r in results if "optimum" in r]
    over = [ratio for ratio, _ in optima]
    own = [ratio for ratio, law in optima if law]
    near = {
        "with an equation": len(own),
        "of them within": sum(ratio <= NEAR_OPTIMUM for ratio in own),
        "worst": max(over, default=float("nan")),
        "without an optimum": sum("no_optimum" in r for r in results),
    }
    return [
        _share(
            "other forms: held-out error within 5 % of the optimum", (x <= NEAR_OPTIMUM for x in over), 0.8, peers=near
        ),
        _share("held-out error halves: a model is written", (a["written"] for a in better), 1.0, peers=written),
        report.row(
            f"lines of 80 columns without --details: most (of {len(lines)})",
            most if most is not None else float("nan"),
            "",
            "<= 24",
            None if most is None else most <= MOST_LINES,
            {"median": float(np.median(lines)) if lines else float("nan")},
        ),
    ]


def _ratio(*, written: float, optimum: float, given: float) -> float:
    """Error of what is written over the least that is known to be possible; infinite where nothing is written."""
    del given
    return written / min(written, optimum) if np.isfinite(written) else float("inf")


def _belief(results: list[Result]) -> list[report.Row]:
    stated = [(r["diagnosis"]["confidence"], sentence_is_right(r)) for r in results]
    brier = _mean((p - ok) ** 2 for p, ok in stated)
    every = [
        (s["confidence"], effect_of(name) in r["truth"]["hidden"])
        for r in results
        for name, s in r["diagnosis"]["candidates"].items()
    ]
    peers = {"every candidate": _mean((p - ok) ** 2 for p, ok in every), "mean stated": _mean(p for p, _ in stated)}
    peers["share right"] = _mean(ok for _, ok in stated)
    return [report.row(f"Brier score of {len(stated)} verdicts", brier, "", "<= 0.08", brier <= 0.08, peers)]


def _time(results: list[Result]) -> list[report.Row]:
    wall, cpu = ([r["diagnosis"][key] for r in results] for key in ("wall_s", "cpu_s"))
    middle = float(np.median(wall))
    return [
        report.row("one campaign: median wall time", middle, "s", "<= 60", middle <= 60.0, {"worst": max(wall)}),
        report.row("one campaign: median CPU time", float(np.median(cpu)), "CPU s", None, None, {"worst": max(cpu)}),
    ]


def mistakes(results: list[Result]) -> list[str]:
    """One line per campaign with a wrong diagnosis."""
    lines = []
    for r in sorted(results, key=lambda r: r["campaign"]):
        hidden, diagnosed = list(r["truth"]["hidden"]), r["diagnosis"]
        fine = set(hidden) <= set(names(r)) <= set(right(r)) if r["kind"] != "outside" else outside_is_right(r)
        if not fine:
            ratios = {k: x and round(x, 1) for k, x in r["ratio"].items()}
            outside = (
                diagnosed["outside"] and f"{diagnosed['outside']['channel']} vs {diagnosed['outside']['variable']}"
            )
            lines.append(f"{r['campaign']} {r['kind']}: {r['truth']['law'] or ratios}; diagnosed {names(r)}, {outside}")
    return lines


def _read(line: str) -> Result:
    """A line of the results; earlier ones have another name for the candidates."""
    result = json.loads(line)
    if "suspects" in result["diagnosis"]:
        result["diagnosis"]["candidates"] = result["diagnosis"].pop("suspects")
    return result


def run(folder: Path, results_file: Path, jobs: int) -> tuple[list[Result], int]:
    """Score every campaign of a folder that has no line in the results yet; also returns the number of crashes."""
    results = [_read(line) for line in results_file.read_text().splitlines()] if results_file.exists() else []
    done = {r["campaign"] for r in results}
    waiting = [p for p in sorted(folder.glob("campaign_*")) if p.name not in done]
    failures = 0
    with ProcessPoolExecutor(min(jobs, MOST_JOBS)) as pool:
        futures = {pool.submit(score, p): p.name for p in waiting}
        for future in as_completed(futures):
            broken = future.exception()
            if broken is not None:
                failures += 1
                print(f"{futures[future]}: {type(broken).__name__}: {broken}", flush=True)
                continue
            results.append(future.result())
            with results_file.open("a") as file:
                file.write(json.dumps(results[-1]) + "\n")
            print(f"{futures[future]}: {names(results[-1])} ({len(results)} done)", flush=True)
    return results, failures


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--count", type=int, default=120)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--campaigns", type=Path, help="folder of campaigns; flown there if it is empty")
    parser.add_argument("--results", type=Path, help="one line per campaign (default: in the campaigns' folder)")
    parser.add_argument("--jobs", type=int, default=1)
    parser.add_argument("--json", type=Path, metavar="FILE", help="also write the rows here")
    a = parser.parse_args()
    os.environ.setdefault("OMP_NUM_THREADS", "1")
    with tempfile.TemporaryDirectory() as spare:
        folder = a.campaigns or Path(spare)
        folder.mkdir(parents=True, exist_ok=True)
        if not any(folder.glob("campaign_*")):
            kinds = blind_campaigns.mixture(a.count, np.random.default_rng(a.seed))
            blind_campaigns.generate(folder, kinds, a.seed)
        results, failures = run(folder, a.results or folder / "results.jsonl", a.jobs)
    for line in mistakes(results):
        print(line)
    measured = [*rows(results), report.row("campaigns that broke the program", failures, "", "0", failures == 0)]
    report.print_table(measured)
    if a.json:
        body = {"machine": report.machine(), "rows": [asdict(r) for r in measured]}
        a.json.write_text(json.dumps(body, indent=1) + "\n")


if __name__ == "__main__":
    main()
