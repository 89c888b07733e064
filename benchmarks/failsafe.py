"""Thousands of random flights with one or two faults each, flown by a simulated body that shares no code.

    python benchmarks/failsafe.py --flights 2000 --json failsafe.json
    python benchmarks/failsafe.py --only 1234 --trace flight.png      # one of them again, drawn

A flight is all in its number: `--seed 1000 --flights 2000` are the flights 1000 .. 2999. Bars: no rotor stops above
0.15 m unless killed or the attitude is lost; no touchdown above 1.5 m/s (without vertical speed 2.5 m/s, after a
rotor's death any); at rest at the end; every reaction has its reason in the log.
"""

import argparse
import json
import sys
from collections.abc import Callable, Iterable
from concurrent.futures import ProcessPoolExecutor
from dataclasses import asdict, dataclass, replace
from pathlib import Path

import numpy as np
import report

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "tests" / "firmware_bridge" / "failsafe"))

import harness
import judge
from harness import FROM_START, START, TABLE, Command, Curve, Fault, Kind, Loss, Order, Policy, Reason, Scenario, State

LOSSES = (Loss.FROZEN, Loss.NOT_VALID, Loss.NAN)
GYRO_HOLD_S = 5.0
LOST_TILT_RAD = 1.0
"""Of the true attitude: after a rotor's death a vehicle beyond this is tumbling."""
NEAREST_FLOOR_M = 0.3
TICKS_S = (0.002, 0.004)


@dataclass(frozen=True, slots=True)
class Drawn:
    """A flight and what it may do."""

    seed: int
    classes: tuple[str, ...]
    scenario: Scenario
    touchdown_m_s: float | None
    may_tumble: bool
    """After a rotor's death."""


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


@dataclass(frozen=True, slots=True)
class Effect:
    """A drawn fault and how it changes the bars."""

    faults: tuple[Fault, ...] = ()
    orders: tuple[Order, ...] = ()
    world: dict = None  # type: ignore[assignment]
    sensors: dict = None  # type: ignore[assignment]
    blind: bool = False
    """Vertical speed is lost: the touchdown has a bar of its own."""
    dead: bool = False
    """A rotor's death: any touchdown, and rotors may stop once it tumbles."""


Draw = Callable[[np.random.Generator], Effect]


def when(rng: np.random.Generator) -> dict:
    """Some moment of some phase: taking off, hovering, flying the path, landing."""
    since = rng.choice([State.TAKE_OFF, State.HOLD, State.TRAJECTORY, State.TRAJECTORY, State.LANDING])
    longest = {State.TAKE_OFF: 3.0, State.HOLD: 2.0, State.TRAJECTORY: 8.0, State.LANDING: 2.0}[State(since)]
    return {"since": int(since), "after_s": float(rng.uniform(0.0, longest))}


def direction(rng: np.random.Generator, size: float, *, level: bool = False) -> tuple[float, float, float]:
    vector = rng.normal(size=3) * (1.0, 1.0, 0.0 if level else 0.4)
    x, y, z = vector / np.linalg.norm(vector) * size
    return float(x), float(y), float(z)


def log_uniform(rng: np.random.Generator, low: float, high: float) -> float:
    return float(np.exp(rng.uniform(np.log(low), np.log(high))))


def jump(rng: np.random.Generator) -> Effect:
    return Effect((Fault(Kind.JUMP, direction(rng, log_uniform(rng, 0.05, 5.0)), **when(rng)),))


def relocalized(rng: np.random.Generator) -> Effect:
    moved = (*direction(rng, log_uniform(rng, 0.05, 5.0)), float(rng.normal(0, 0.2)))
    return Effect((Fault(Kind.RELOCALIZED, moved, **when(rng)),))


def reset_missed(rng: np.random.Generator) -> Effect:
    return Effect((Fault(Kind.RESET_MISSED, direction(rng, log_uniform(rng, 0.05, 2.0)), **when(rng)),))


def drift(rng: np.random.Generator) -> Effect:
    speed = direction(rng, float(rng.uniform(0.02, 0.4)))
    return Effect((Fault(Kind.DRIFT, speed, duration_s=float(rng.uniform(1, 20)), **when(rng)),))


def position_gap(rng: np.random.Generator) -> Effect:
    gap = Fault(Kind.POSITION_LOST, (rng.choice(LOSSES),), duration_s=log_uniform(rng, 0.02, 4.0), **when(rng))
    return Effect((gap,), blind=gap.duration_s > 0.1)


def position_lost(rng: np.random.Generator) -> Effect:
    return Effect((Fault(Kind.POSITION_LOST, (rng.choice(LOSSES),), **when(rng)),), blind=True)


def horizontal_lost(rng: np.random.Generator) -> Effect:
    return Effect((Fault(Kind.POSITION_LOST, (Loss.NO_XY,), **when(rng)),))


def attitude_gap(rng: np.random.Generator) -> Effect:
    gap_s = log_uniform(rng, 0.02, 3.0)
    return Effect((Fault(Kind.ATTITUDE_LOST, (rng.choice(LOSSES),), duration_s=gap_s, **when(rng)),))


def attitude_lost(rng: np.random.Generator) -> Effect:
    return Effect((Fault(Kind.ATTITUDE_LOST, (rng.choice(LOSSES),), **when(rng)),))


def all_gap(rng: np.random.Generator) -> Effect:
    gap_s = float(rng.uniform(0.005, 0.06))
    return Effect((Fault(Kind.ALL_LOST, (rng.choice(LOSSES),), duration_s=gap_s, **when(rng)),))


def all_lost(rng: np.random.Generator) -> Effect:
    return Effect((Fault(Kind.ALL_LOST, (rng.choice(LOSSES),), **when(rng)),), blind=True)


def large_std(rng: np.random.Generator) -> Effect:
    told = (float(rng.uniform(0.2, 5.0)), float(rng.uniform(0.05, 2.0)))
    poor = Fault(Kind.LARGE_STD, told, duration_s=float(rng.choice([0.0, 0.5, 3.0])), **when(rng))
    return Effect((poor,), blind=True)


def velocity_bias(rng: np.random.Generator) -> Effect:
    bias = float(rng.normal(0, 0.2))
    faults = [Fault(Kind.VELOCITY_BIAS, (bias,), since=State.TAKE_OFF)]
    if rng.random() < 0.5:
        faults.append(Fault(Kind.DRIFT, (0.0, 0.0, bias), since=State.TAKE_OFF))
    return Effect(tuple(faults))


def clock_step(rng: np.random.Generator) -> Effect:
    step = float(rng.choice([-5.0, -0.5, 0.5, 60.0, 3600.0])) if rng.random() < 0.5 else float(rng.normal(0, 0.05))
    return Effect((Fault(Kind.CLOCK_STEP, (step,), **when(rng)),))


def clock_jitter(rng: np.random.Generator) -> Effect:
    jitter = log_uniform(rng, 0.0002, 0.002)
    return Effect((Fault(Kind.CLOCK_JITTER, (jitter,), duration_s=float(rng.choice([0.0, 2.0])), **when(rng)),))


def clock_stuck(rng: np.random.Generator) -> Effect:
    return Effect((Fault(Kind.CLOCK_STUCK, (), duration_s=log_uniform(rng, 0.004, 0.08), **when(rng)),))


def hang(rng: np.random.Generator) -> Effect:
    return Effect((Fault(Kind.HANG, (), duration_s=log_uniform(rng, 0.005, 0.06), **when(rng)),))


def rotor_weak(rng: np.random.Generator) -> Effect:
    return Effect((Fault(Kind.ROTOR_HEALTH, (int(rng.integers(4)), float(rng.uniform(0.7, 0.95))), **when(rng)),))


def rotor_dead(rng: np.random.Generator) -> Effect:
    return Effect((Fault(Kind.ROTOR_HEALTH, (int(rng.integers(4)), 0.0), **when(rng)),), dead=True)


def gust(rng: np.random.Generator) -> Effect:
    wind = direction(rng, float(rng.uniform(2.0, 9.0)))
    return Effect((Fault(Kind.GUST, wind, duration_s=float(rng.uniform(0.3, 3.0)), **when(rng)),))


def push(rng: np.random.Generator) -> Effect:
    hit = (*direction(rng, float(rng.uniform(0.5, 3.0)), level=True), float(rng.normal(0, 3.0)))
    return Effect((Fault(Kind.KICK, hit, **when(rng)),))


def blocked(rng: np.random.Generator) -> Effect:
    held = Fault(Kind.BLOCKED, (), float(rng.uniform(0.5, 6)), float(rng.choice([0.3, 1.5, 0.0])), State.TRAJECTORY)
    return Effect((held,))


def link_lost(rng: np.random.Generator) -> Effect:
    return Effect((Fault(Kind.LINK_LOST, (), duration_s=float(rng.choice([1.0, 5.0, 0.0])), **when(rng)),))


def battery_low(rng: np.random.Generator) -> Effect:
    volts = Fault(Kind.BATTERY, (float(rng.uniform(12.0, 14.5)),), **when(rng))
    return Effect((volts,), sensors={"battery_v": 15.5})


def killed(rng: np.random.Generator) -> Effect:
    moment = when(rng)
    return Effect(orders=(Order(Command.KILL, 0.0, moment["after_s"], moment["since"]),))


def parameter(rng: np.random.Generator) -> Effect:
    name, low, high = (
        ("mass_kg", 0.2, 3.0), ("kp_xy_1_s2", 4.0, 14.0), ("landing_m_s", 0.3, 1.0), ("rotor0_x_m", 0.02, 0.2),
        ("kd_z_1_s", 4.0, 10.0), ("clearance_m", 0.1, 2.0), ("brake_m_s2", 1.0, 8.0), ("path_speed_m_s", 1.0, 20.0),
        ("fence_max_x_m", 0.5, 30.0), ("rotor_max_rad_s", 500.0, 1700.0),
    )[rng.integers(10)]  # fmt: skip
    value = float(rng.uniform(low, high))
    return Effect((Fault(Kind.PARAMETER, (value,), parameter=name, **when(rng)),))


def no_specific_force(rng: np.random.Generator) -> Effect:
    return Effect((Fault(Kind.NO_SPECIFIC_FORCE, **when(rng)),))


def no_vertical_velocity(rng: np.random.Generator) -> Effect:
    return Effect((Fault(Kind.NO_VERTICAL_VELOCITY, **when(rng)),), blind=True)


def floor_lower(rng: np.random.Generator) -> Effect:
    return Effect(world=TABLE | {"floor_m": -log_uniform(rng, 0.3, 20.0)})


def floor_higher(rng: np.random.Generator) -> Effect:
    """The floor rises beneath a hovering vehicle, as over a crate or a roof's edge."""
    return Effect((Fault(Kind.FLOOR, (float(rng.uniform(0.1, 0.9)),), 0.2),))


DRAWS: dict[str, Draw] = {
    "estimate jump": jump,
    "relocalization": relocalized,
    "missed reset": reset_missed,
    "estimate drift": drift,
    "position gap": position_gap,
    "position lost": position_lost,
    "horizontal position lost": horizontal_lost,
    "attitude gap": attitude_gap,
    "attitude lost": attitude_lost,
    "gap of everything": all_gap,
    "everything lost": all_lost,
    "large standard deviation": large_std,
    "vertical speed biased": velocity_bias,
    "clock step": clock_step,
    "clock jitter": clock_jitter,
    "clock stuck": clock_stuck,
    "module hangs": hang,
    "rotor weak": rotor_weak,
    "rotor dead": rotor_dead,
    "gust": gust,
    "push": push,
    "blocked": blocked,
    "link lost": link_lost,
    "battery low": battery_low,
    "killed": killed,
    "parameter change": parameter,
    "no specific force": no_specific_force,
    "no vertical velocity": no_vertical_velocity,
    "floor lower": floor_lower,
    "floor higher": floor_higher,
}


def draw_path(rng: np.random.Generator, *, away: bool) -> Curve:
    """A circle, or legs between random points; `away`: it ends at least 2 m from the take-off point."""
    policy = Policy(int(rng.integers(3)))
    clearance_m = float(rng.choice([0.0, 0.3, 0.6, 1.5]))
    if not away and rng.random() < 0.5:
        speed = float(rng.uniform(1.0, 9.0))
        curve = harness.circle(speed, radius_m=max(2.0, speed**2 / 6.0), turns=1.0, clearance_m=clearance_m)
        return replace(curve, policy=policy)
    points = [(0.0, 0.0, 1.5)]
    highest_m = float(rng.choice([4.0, 4.0, 4.0, 15.0]))
    for _ in range(int(rng.integers(1, 4))):
        points.append((*rng.uniform(-6, 6, 2), float(rng.uniform(1.2, highest_m))))
    if away:
        angle = rng.uniform(0, 2 * np.pi)
        points[-1] = (4 * np.cos(angle), 4 * np.sin(angle), float(rng.uniform(1.2, highest_m)))
    speed, acceleration = float(rng.uniform(1.0, 9.0)), float(rng.uniform(2.0, 8.0))
    return harness.legs(points, speed_m_s=speed, acceleration_m_s2=acceleration, clearance_m=clearance_m, policy=policy)


def reach_m(path: Curve) -> float:
    """Furthest that a path can get from the take-off point along x or y."""
    return float(np.abs(path.coefficients[:, :2]).sum(axis=-1).max())


def draw(seed: int) -> Drawn:
    """All of a flight from its number."""
    rng = np.random.default_rng(seed)
    names = sorted(rng.choice(list(DRAWS), size=int(rng.integers(1, 3)), replace=False).tolist())
    effects = [DRAWS[name](rng) for name in names]
    world: dict = {
        "gust_std_m_s": float(rng.choice([0.0, 0.3, 0.8])),
        "wind_m_s": direction(rng, rng.uniform(0, 3), level=True),
    }
    if rng.random() < 0.3:
        world["slope"] = (float(rng.normal(0, 0.06)), float(rng.normal(0, 0.06)))
    sensors: dict = {
        "height_wander_m": float(rng.uniform(0, 0.15)),
        "vertical_bias_m_s": float(rng.normal(0, 0.04)),
        "tilt_error_rad": (float(rng.normal(0, 0.008)), float(rng.normal(0, 0.008))),
        "accelerometer_bias_m_s2": tuple(float(x) for x in rng.normal(0, 0.08, 3)),
        "gyro_bias_rad_s": tuple(float(x) for x in rng.normal(0, 0.004, 3)),
        "pose_rate_hz": float(rng.choice([50.0, 100.0, 200.0])),
        "delay_s": float(rng.uniform(0, 0.02)),
        "vibration_m_s2": float(rng.uniform(0, 3)),
    }
    for effect in effects:
        world |= effect.world or {}
        sensors |= effect.sensors or {}
    path = draw_path(rng, away="plate_m" in world)
    if "slope" in world:  # the hill must stay below the path
        steepest = 0.3 / reach_m(path)
        world["slope"] = tuple(float(np.clip(part, -steepest, steepest)) for part in world["slope"])
    land = Order(Command.LAND, 0.0, 4.1 + 0.5 + 2.0 + path.duration_s + float(rng.uniform(0, 4)), FROM_START)
    orders = (*harness.TAKE_OFF, START, land, *(order for effect in effects for order in effect.orders))
    scenario = Scenario(
        orders=orders,
        faults=tuple(fault for effect in effects for fault in effect.faults),
        path=path,
        parameters={"battery_arm_v": 14.0, "battery_warn_v": 13.6, "battery_land_v": 13.2, "link_hold_s": 8.0},
        world=world,
        sensors=sensors,
        seed=seed,
        tick_s=float(rng.choice(TICKS_S)),
        tick_jitter=float(rng.choice([0.0, 0.2])),
        limit_s=land.after_s + 100.0,
    )
    blind = any(effect.blind for effect in effects)
    dead = any(effect.dead for effect in effects)
    bar = judge.HARDEST_BLIND_TOUCHDOWN_M_S if blind else judge.HARDEST_TOUCHDOWN_M_S
    return Drawn(seed, tuple(names), scenario, None if dead else bar, dead)


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
    found = judge.violations(result, touchdown_m_s=drawn.touchdown_m_s, may_stop_in_air=excused)
    found += (
        unordered(result, drawn.scenario.tick_s)
        + groundless(drawn.scenario, result)
        + slow_kill(drawn.scenario, result)
    )
    return Flown(
        seed,
        drawn.classes,
        None if excused else drawn.touchdown_m_s,
        result.hardest_touchdown_m_s,
        result.stop_clearance_m,
        excused,
        tuple(found),
        result.stop_s - result.last_airborne_s if result.touchdowns else 0.0,
        any(change.reason == Reason.FINISHED for change in result.changes),
        result.end_tilt_rad,
        story(result),
    )


def may_stop_from_s(scenario: Scenario, result: harness.Result) -> float:
    """From when on rotors may stop in the air: KILL, everything lost, attitude lost for as long as the gyro holds."""
    moments = [
        at
        for order, at in zip(scenario.orders, result.order_times_s, strict=True)
        if order.command == Command.KILL and at
    ]
    for fault, at in zip(scenario.faults, result.fault_times_s, strict=True):
        if at and fault.duration_s == 0.0 and fault.kind in (Kind.ALL_LOST, Kind.ATTITUDE_LOST):
            moments.append(at + (0.9 * GYRO_HOLD_S if fault.kind == Kind.ATTITUDE_LOST else 0.0))
    return min(moments, default=float("inf"))


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
    Reason.RELOCALIZED: {Kind.RELOCALIZED, Kind.RESET_MISSED},
}
"""Faults that explain these reasons in the log."""


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
