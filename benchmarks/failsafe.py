"""Thousands of random flights with one or two faults each, flown by a simulated body that shares no code.

    python benchmarks/failsafe.py --flights 2000 --json failsafe.json
    python benchmarks/failsafe.py --only 1234 --trace flight.png      # one of them again, drawn

A flight is all in its number: `--seed 1000 --flights 2000` are the flights 1000 .. 2999. Bars: no rotor stops above
0.15 m unless killed or the attitude is lost; no touchdown above 1.5 m/s (without vertical speed or attitude 2.5 m/s,
after a rotor's death any); at rest at the end; every reaction has its reason in the log.
"""

import argparse
import json
import sys
from collections.abc import Iterable
from concurrent.futures import ProcessPoolExecutor
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np
import report

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "tests" / "firmware_bridge" / "failsafe"))

import harness
import judge
from failsafe_draw import DRAWS, draw
from scenario import Command, Kind, Reason, Scenario, State

GYRO_HOLD_S = 5.0
GYRO_AXIS_S = 0.5
"""Without an attitude the torque tells an axis that the gyro does not give for this long."""
LOST_TILT_RAD = 1.0
"""Of the true attitude: after a rotor's death a vehicle beyond this is tumbling."""


@dataclass(frozen=True, slots=True)
class Flown:
    """What is kept of a flight."""

    seed: int
    classes: tuple[str, ...]
    touchdown_bar_m_s: float | None
    touchdown_m_s: float
    stop_m: float
    may_stop_in_air: bool
    violations: tuple[str, ...]
    rotors_on_ground_s: float
    finished: bool
    """The path was flown to its end."""
    end_tilt_rad: float
    story: str


def story(result: harness.Result) -> str:
    return " ".join(f"{c.time_s:.1f} {c.after.name}({Reason(c.reason).name})" for c in result.changes[2:])


def fly(seed: int) -> Flown:
    drawn = draw(seed)
    result = harness.load().fly(drawn.scenario)
    stopped_high = result.stop_clearance_m > judge.LARGEST_STOP_M
    tumbling = drawn.may_tumble and result.stop_tilt_rad > LOST_TILT_RAD
    may_stop = result.stop_s >= may_stop_from_s(drawn.scenario, result)
    killed = result.stop_state == State.FAULT and result.stop_reason == Reason.COMMANDED  # it may fall from any height
    excused = killed or (stopped_high and (tumbling or may_stop))
    must_fly = drawn.must_fly and Reason.MOVING not in result.order_reasons  # a bouncy floor, on which it still rocked
    found = judge.violations(result, touchdown_m_s=drawn.touchdown_m_s, may_stop_in_air=excused, must_fly=must_fly)
    found += (
        unordered(result, drawn.scenario.tick_s)
        + groundless(drawn.scenario, result)
        + slow_kill(drawn.scenario, result)
    )
    found += unsafe_end(drawn.scenario, result)
    return Flown(
        seed,
        drawn.classes,
        None if excused else drawn.touchdown_m_s,
        judge.flown_touchdown_m_s(result),
        result.stop_clearance_m,
        excused,
        tuple(found),
        result.stop_s - result.last_airborne_s if result.touchdowns else 0.0,
        any(change.reason == Reason.FINISHED for change in result.changes),
        result.end_tilt_rad,
        story(result),
    )


LONGEST_ON_GROUND_S = 5.0
FURTHEST_M = 20.0


def unsafe_end(scenario: Scenario, result: harness.Result) -> list[str]:
    """Rotors that go on turning on the ground, a flight away from its path, an order taken that must not be."""
    found = []
    stopped_s = result.stop_s if result.at_rest else result.end_s
    on_ground_s = stopped_s - max(result.last_airborne_s, result.first_touchdown_s)
    if result.touchdowns and on_ground_s > LONGEST_ON_GROUND_S:
        found.append(f"rotors turned {on_ground_s:.1f} s on the ground")
    reach_m = max(float(np.abs(scenario.path.coefficients[:, axis]).sum(axis=-1).max()) for axis in (0, 1))
    if max(abs(x) for x in result.end_position_m[:2]) > reach_m + FURTHEST_M:
        found.append(f"ended {max(abs(x) for x in result.end_position_m[:2]):.0f} m off, path reaches {reach_m:.0f} m")
    for order, at, reason in zip(scenario.orders, result.order_times_s, result.order_reasons, strict=True):
        hands = (f for f in scenario.faults if f.kind == Kind.CARRIED and 0 < at < f.after_s + f.duration_s)
        if any(hands) and reason == 0 and order.command in (Command.ARM, Command.TAKE_OFF):
            found.append(f"{order.command.name} was accepted while it was carried")
    return found


def may_stop_from_s(scenario: Scenario, result: harness.Result) -> float:
    """From when on rotors may stop in the air: KILL, everything lost, attitude lost longer than the gyro holds."""
    moments = [
        at
        for order, at in zip(scenario.orders, result.order_times_s, strict=True)
        if order.command == Command.KILL and at
    ]
    for fault, at in zip(scenario.faults, result.fault_times_s, strict=True):
        if at and fault.duration_s == 0.0 and fault.kind in (Kind.ALL_LOST, Kind.ATTITUDE_LOST):
            moments.append(at + (0.9 * GYRO_HOLD_S if fault.kind == Kind.ATTITUDE_LOST else 0.0))
    return min((*moments, *turns_unknown_from_s(scenario, result)), default=float("inf"))


def turns_unknown_from_s(scenario: Scenario, result: harness.Result) -> list[float]:
    """When neither gyro nor attitude has told an axis for longer than the torque can: the gyro does not live."""
    spans = {
        fault.kind: (at, at + (fault.duration_s or float("inf")))
        for fault, at in zip(scenario.faults, result.fault_times_s, strict=True)
        if at
    }
    never = (float("inf"), float("-inf"))
    attitude, axis = spans.get(Kind.ATTITUDE_LOST, never), spans.get(Kind.GYRO_AXIS, never)
    start_s = max(attitude[0], axis[0] + GYRO_AXIS_S)
    return [start_s] if start_s < min(attitude[1], axis[1]) else []


def slow_kill(scenario: Scenario, result: harness.Result) -> list[str]:
    """KILL in flight stops the rotors at the next tick."""
    return [
        f"KILL took {result.stop_s - at:.3f} s"
        for order, at in zip(scenario.orders, result.order_times_s, strict=True)
        if order.command == Command.KILL and at > 0 and result.stop_s > at + 1.5 * scenario.tick_s
    ]


CAUSES = {
    Reason.LINK_LOST: {Kind.LINK_LOST},
    Reason.BATTERY_LOW: {Kind.BATTERY},
    Reason.RELOCALIZED: {
        Kind.RELOCALIZED, Kind.RESET_MISSED, Kind.JUMP, Kind.KICK, Kind.STUCK, Kind.POSE_AGE, Kind.SPEED_WRONG,
        Kind.HEADING_JUMP,
    },
}  # fmt: skip
"""Faults that explain these reasons in the log. A pose that was not believed for a while, and is again, has moved its
frame for the controller: a kick is a velocity that jumps against the accelerometer."""


def groundless(scenario: Scenario, result: harness.Result) -> list[str]:
    """A failsafe that has nothing to do with the fault."""
    kinds = {fault.kind for fault in scenario.faults}
    return [
        f"{change.after.name} is logged as {Reason(change.reason).name}, of which there was none"
        for change in result.changes
        if change.reason in CAUSES and not kinds & CAUSES[Reason(change.reason)]
    ]


def unordered(result: harness.Result, tick_s: float) -> list[str]:
    """A transition that the log calls commanded must follow an order at once."""
    return [
        f"{change.after.name} is logged as commanded, but was not"
        for change in result.changes
        if change.reason == Reason.COMMANDED
        and not any(0 < at <= change.time_s <= at + 2.5 * tick_s for at in result.order_times_s)
    ]


def fly_all(seeds: Iterable[int], processes: int) -> list[Flown]:
    harness.load()
    if processes == 1:
        return [fly(seed) for seed in seeds]
    with ProcessPoolExecutor(processes) as pool:
        return list(pool.map(fly, seeds, chunksize=20))


def count(flown: list[Flown], text: str) -> int:
    return sum(any(text in violation for violation in flight.violations) for flight in flown)


def rows(flown: list[Flown]) -> list[report.Row]:
    total = len(flown)
    normal = [f.touchdown_m_s for f in flown if f.touchdown_bar_m_s == judge.HARDEST_TOUCHDOWN_M_S]
    blind = [f.touchdown_m_s for f in flown if f.touchdown_bar_m_s == judge.HARDEST_BLIND_TOUCHDOWN_M_S]
    stops = [f.stop_m for f in flown if not f.may_stop_in_air]
    on_ground = [f.rotors_on_ground_s for f in flown if f.rotors_on_ground_s > 0 and not f.may_stop_in_air]
    wrong = sum(bool(f.violations) for f in flown)
    table = [
        report.row("flights", total, "", ">= 2000", total >= 2000),
        report.row("flights with any violation", wrong, "", "0", wrong == 0),
    ]
    for name, text in (
        ("rotors stopped above 0.15 m", "rotors stopped"),
        ("touchdowns above their bar", "touched down"),
        ("not at rest at the end", "not at rest"),
        ("reactions without a reason", "reason"),
        ("transitions without a command", "commanded"),
        ("failsafes without their cause", "there was none"),
        ("outputs not finite or out of range", "outputs"),
        ("KILL later than the next tick", "KILL took"),
        ("never flew", "never flew"),
        ("rotors on for more than 5 s on the ground", "on the ground"),
        ("ended more than 20 m away", " m off, path"),
        ("orders accepted while carried", "while it was carried"),
    ):
        number = count(flown, text)
        table.append(report.row(name, number, "flights", "0", number == 0))
    worst = max(stops, default=0.0)
    table.append(report.row("highest stop of a rotor", worst, "m", "<= 0.15", worst <= judge.LARGEST_STOP_M))
    for name, speeds, bar in (
        ("hardest touchdown", normal, judge.HARDEST_TOUCHDOWN_M_S),
        ("hardest without vertical speed", blind, judge.HARDEST_BLIND_TOUCHDOWN_M_S),
    ):
        hardest = max(speeds, default=0.0)
        table.append(report.row(name, hardest, "m/s", f"<= {bar:g}", hardest <= bar))
        table.append(report.row(f"{name}, median", float(np.median(speeds or [0.0])), "m/s"))
    table.append(report.row("touch to rotors off, median", float(np.median(on_ground or [0.0])), "s"))
    table.append(report.row("touch to rotors off, longest", max(on_ground, default=0.0), "s"))
    table.append(report.row("more than 5 s on the ground with rotors on", sum(s > 5 for s in on_ground), "flights"))
    tipped = sum(f.end_tilt_rad > 1.0 and not f.may_stop_in_air for f in flown)
    table.append(report.row("ended on its side or back", tipped, "flights"))
    for name in DRAWS:
        of_class = [f for f in flown if name in f.classes]
        bad = sum(bool(f.violations) for f in of_class)
        table.append(report.row(f"violations: {name}", bad, f"of {len(of_class)}", "0", bad == 0))
    for name in DRAWS:
        of_class = [f for f in flown if name in f.classes]
        table.append(report.row(f"path finished: {name}", sum(f.finished for f in of_class), f"of {len(of_class)}"))
    return table


def draw_trace(seed: int, file: Path) -> None:
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    drawn = draw(seed)
    result = harness.load().fly(drawn.scenario, trace_every=5)
    t = result.trace
    figure, axes = plt.subplots(5, 1, figsize=(12, 14), sharex=True)
    time = t["time_s"]
    axes[0].plot(time, t["z"], label="height")
    axes[0].plot(time, t["estimate_z"], "--", label="estimate")
    axes[0].plot(time, t["setpoint_z"], ":", label="set-point")
    axes[0].plot(time, t["clearance_m"], label="clearance")
    axes[1].plot(time, np.hypot(t["vx"], t["vy"]), label="horizontal speed")
    axes[1].plot(time, t["vz"], label="vertical speed")
    axes[1].plot(time, t["tilt_rad"], label="tilt, rad")
    for axis in "xy":
        axes[2].plot(time, t[axis], label=axis)
        axes[2].plot(time, t[f"setpoint_{axis}"], ":", label=f"set-point {axis}")
    axes[3].step(time, t["state"], label="state")
    axes[3].step(time, t["landing_stage"], label="landing stage")
    axes[3].plot(time, 10 * t["path_rate"], label="10 x path rate")
    axes[3].plot(time, 10 * t["path_limit"], "--", label="10 x path limit")
    axes[4].plot(time, t["thrust_n"], label="thrust demanded, N")
    for i in range(4):
        axes[4].plot(time, t[f"command{i}"] / 100, lw=0.6, label=f"rotor {i}, 100 rad/s")
    for axis in axes:
        for start in result.fault_times_s:
            if start > 0:
                axis.axvline(start, color="r", lw=0.8)
        axis.legend(loc="upper right", fontsize=7)
        axis.grid(alpha=0.3)
    axes[0].set_title(f"flight {seed}: {', '.join(drawn.classes)}\n{story(result)}", fontsize=7)
    axes[4].set_xlabel("s")
    figure.tight_layout()
    figure.savefig(file, dpi=80)


def describe(flight: Flown) -> None:
    print(f"{flight.seed}  [{', '.join(flight.classes)}]  {'; '.join(flight.violations) or 'fine'}\n    {flight.story}")


def tell_worst(flown: list[Flown]) -> None:
    """Extremes, by the number to fly them again with."""
    rated = [f for f in flown if not f.may_stop_in_air]
    for name, of in (
        (
            "hardest touchdown",
            [(f.touchdown_m_s, f) for f in rated if f.touchdown_bar_m_s == judge.HARDEST_TOUCHDOWN_M_S],
        ),
        (
            "hardest without vertical speed",
            [(f.touchdown_m_s, f) for f in rated if f.touchdown_bar_m_s == judge.HARDEST_BLIND_TOUCHDOWN_M_S],
        ),
        ("highest stop", [(f.stop_m, f) for f in rated]),
        ("longest on the ground with rotors on", [(f.rotors_on_ground_s, f) for f in rated]),
    ):
        if of:
            value, flight = max(of, key=lambda pair: pair[0])
            print(f"{name}: {value:.2f}, flight {flight.seed} [{', '.join(flight.classes)}]")


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--flights", type=int, default=2000)
    parser.add_argument("--seed", type=int, default=0, help="number of the first flight")
    parser.add_argument("--processes", type=int, default=2)
    parser.add_argument("--json", type=Path, metavar="FILE", help="also write the rows here")
    parser.add_argument("--only", type=int, metavar="SEED", help="fly this one alone and describe it")
    parser.add_argument("--trace", type=Path, metavar="PNG", help="with --only: draw it")
    parser.add_argument("--most", type=int, default=20, help="violating flights to list")
    arguments = parser.parse_args()
    if arguments.only is not None:
        for fault in draw(arguments.only).scenario.faults:
            print(fault)
        describe(fly(arguments.only))
        if arguments.trace:
            draw_trace(arguments.only, arguments.trace)
        return 0
    flown = fly_all(range(arguments.seed, arguments.seed + arguments.flights), arguments.processes)
    measured = rows(flown)
    report.print_table(measured)
    tell_worst(flown)
    for flight in [f for f in flown if f.violations][: arguments.most]:
        describe(flight)
    if arguments.json:
        worst = [asdict(f) for f in flown if f.violations]
        body = {"machine": report.machine(), "rows": [asdict(r) for r in measured], "violations": worst}
        arguments.json.write_text(json.dumps(body, indent=1) + "\n")
    return 0 if all(row.ok is not False for row in measured) else 1


if __name__ == "__main__":
    sys.exit(main())
