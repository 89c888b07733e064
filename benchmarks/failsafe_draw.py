"""The random flights of failsafe.py: what goes wrong, where and over which floor, all of it from a number."""

from collections.abc import Callable
from dataclasses import dataclass, replace

import judge
import numpy as np
from scenario import (
    FROM_START,
    START,
    TABLE,
    TAKE_OFF,
    Command,
    Curve,
    Fault,
    Kind,
    Loss,
    Order,
    Policy,
    Scenario,
    State,
    circle,
    legs,
)

LOSSES = (Loss.FROZEN, Loss.NOT_VALID, Loss.NAN)
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
    must_fly: bool = True
    """It had no reason to stay on the ground."""


@dataclass(frozen=True, slots=True)
class Effect:
    """A drawn fault and how it changes the bars."""

    faults: tuple[Fault, ...] = ()
    orders: tuple[Order, ...] = ()
    world: dict = None  # type: ignore[assignment]
    sensors: dict = None  # type: ignore[assignment]
    vehicle: dict = None  # type: ignore[assignment]
    blind: bool = False
    """Vertical speed is lost: the touchdown has a bar of its own."""
    dead: bool = False
    """A rotor's death: any touchdown, and rotors may stop once it tumbles."""
    held: bool = False
    """A hand has it and lets it fall: it need not fly, and touches as it falls."""


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
    return Effect((Fault(Kind.ATTITUDE_LOST, (rng.choice(LOSSES),), **when(rng)),), blind=True)


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


def heading_jump(rng: np.random.Generator) -> Effect:
    return Effect((Fault(Kind.HEADING_JUMP, (float(rng.uniform(-3.1, 3.1)),), **when(rng)),), blind=True)


def pose_stuck(rng: np.random.Generator) -> Effect:
    lasts_s = float(rng.choice([0.0, 0.5, 2.0]))
    return Effect((Fault(Kind.STUCK, (), duration_s=lasts_s, **when(rng)),), blind=True)


def pose_old(rng: np.random.Generator) -> Effect:
    age_s = float(rng.choice([rng.uniform(0.12, 1.9), rng.uniform(-5.0, -1.1)]))
    return Effect((Fault(Kind.POSE_AGE, (age_s,), duration_s=float(rng.choice([0.0, 1.0])), **when(rng)),), blind=True)


def speed_wrong(rng: np.random.Generator) -> Effect:
    wrong = direction(rng, float(rng.uniform(0.3, 5.0)))
    return Effect((Fault(Kind.SPEED_WRONG, wrong, duration_s=float(rng.choice([0.0, 1.0])), **when(rng)),), blind=True)


def gyro_axis(rng: np.random.Generator) -> Effect:
    lost = Fault(Kind.GYRO_AXIS, (int(rng.integers(3)),), duration_s=log_uniform(rng, 0.05, 2.0), **when(rng))
    return Effect((lost,), blind=True)


def rotor_speed_wrong(rng: np.random.Generator) -> Effect:
    value = float(rng.choice([np.nan, np.inf, -np.inf, -800.0, 1e30]))
    return Effect((Fault(Kind.ROTOR_SPEED, (int(rng.integers(4)), value), **when(rng)),))


def vibration(rng: np.random.Generator) -> Effect:
    return Effect((Fault(Kind.VIBRATION, (float(rng.uniform(4.0, 12.0)),), **when(rng)),))


def bouncy(rng: np.random.Generator) -> Effect:
    return Effect(vehicle={"contact_n_s_m": float(rng.uniform(0.5, 4.0)), "contact_n_m": log_uniform(rng, 600, 3000)})


def carried(rng: np.random.Generator) -> Effect:
    """A hand has it when it is ordered to arm and to take off, and throws it soon after."""
    hand = (*direction(rng, float(rng.uniform(0.55, 2.0))), float(rng.uniform(-3.0, 3.0)))
    early = (Order(Command.ARM, 0, 0.15, FROM_START), Order(Command.TAKE_OFF, 1.5, 0.17, FROM_START))
    return Effect((Fault(Kind.CARRIED, hand, 0.0, 0.2, FROM_START),), orders=early, held=True)


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
    "heading jump": heading_jump,
    "pose stuck": pose_stuck,
    "pose old or ahead": pose_old,
    "speed wrong": speed_wrong,
    "gyro axis lost": gyro_axis,
    "rotor speed no number": rotor_speed_wrong,
    "vibration": vibration,
    "bouncy floor": bouncy,
    "carried": carried,
    "floor lower": floor_lower,
    "floor higher": floor_higher,
}


def draw_path(rng: np.random.Generator, *, away: bool) -> Curve:
    """A circle, or legs between random points; `away`: it ends at least 2 m from the take-off point."""
    policy = Policy(int(rng.integers(3)))
    clearance_m = float(rng.choice([0.0, 0.3, 0.6, 1.5]))
    if not away and rng.random() < 0.5:
        speed = float(rng.uniform(1.0, 9.0))
        curve = circle(speed, radius_m=max(2.0, speed**2 / 6.0), turns=1.0, clearance_m=clearance_m)
        return replace(curve, policy=policy)
    points = [(0.0, 0.0, 1.5)]
    highest_m = float(rng.choice([4.0, 4.0, 4.0, 15.0]))
    for _ in range(int(rng.integers(1, 4))):
        points.append((*rng.uniform(-6, 6, 2), float(rng.uniform(1.2, highest_m))))
    if away:
        angle = rng.uniform(0, 2 * np.pi)
        points[-1] = (4 * np.cos(angle), 4 * np.sin(angle), float(rng.uniform(1.2, highest_m)))
    speed, acceleration = float(rng.uniform(1.0, 9.0)), float(rng.uniform(2.0, 8.0))
    return legs(points, speed_m_s=speed, acceleration_m_s2=acceleration, clearance_m=clearance_m, policy=policy)


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
    vehicle: dict = {}
    for effect in effects:
        world |= effect.world or {}
        sensors |= effect.sensors or {}
        vehicle |= effect.vehicle or {}
    path = draw_path(rng, away="plate_m" in world)
    if "slope" in world:  # the hill must stay below the path
        steepest = 0.3 / reach_m(path)
        world["slope"] = tuple(float(np.clip(part, -steepest, steepest)) for part in world["slope"])
    land = Order(Command.LAND, 0.0, 4.1 + 0.5 + 2.0 + path.duration_s + float(rng.uniform(0, 4)), FROM_START)
    orders = (*TAKE_OFF, START, land, *(order for effect in effects for order in effect.orders))
    scenario = Scenario(
        orders=orders,
        faults=tuple(fault for effect in effects for fault in effect.faults),
        path=path,
        parameters={"battery_arm_v": 14.0, "battery_warn_v": 13.6, "battery_land_v": 13.2, "link_hold_s": 8.0},
        world=world,
        sensors=sensors,
        vehicle=vehicle,
        seed=seed,
        tick_s=float(rng.choice(TICKS_S)),
        tick_jitter=float(rng.choice([0.0, 0.2])),
        limit_s=land.after_s + 100.0,
    )
    blind = any(effect.blind for effect in effects)
    dead = any(effect.dead for effect in effects)
    bar = judge.HARDEST_BLIND_TOUCHDOWN_M_S if blind else judge.HARDEST_TOUCHDOWN_M_S
    held = any(effect.held for effect in effects)
    return Drawn(seed, tuple(names), scenario, None if dead or held else bar, dead, not held)
