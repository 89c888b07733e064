"""A plan on PX4 or ArduPilot: the parameters read back, the checks, and the flight."""

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from firmware_bridge import controller
from firmware_bridge.arming import ArmingCheck, required
from firmware_bridge.autopilot import checks, line, loop_limits, settings, thrust
from firmware_bridge.autopilot.flavour import PX4
from firmware_bridge.autopilot.setup import AutopilotSetup
from firmware_bridge.offboard.guard_process import GuardProcess
from firmware_bridge.offboard.procedure import Flight, Hints
from firmware_bridge.offboard.tracker import TARGETS_FROM_M_S, Tracker
from flight import FlightLog, Progress, TrajectoryFile
from goshawk.commands.fly import many_rotors, offboard
from vehicle import Vehicle, flatness

GUARD = "firmware_bridge.autopilot.guard"
_SAMPLE_S = 0.01
IDLE = 0.0
"""Output at no thrust: neither autopilot tells where its rotors begin to turn."""


def fly(
    model: Vehicle, item: TrajectoryFile, where: offboard.Where, *, arms: bool, progress: Progress,
    cancel: Callable[[], bool], tracker: offboard.NewTracker = Tracker,
    guard: Callable[..., GuardProcess] = GuardProcess,
) -> tuple[FlightLog, str]:  # fmt: skip
    """Read the parameters back, check them and the plan, and fly it.

    Args:
        arms: ask for the mode and to arm; else the pilot does both.
        tracker: what follows the plan.
        guard: starts what guards.

    Returns:
        The log, and why the flight ended early: empty if it did not.

    Raises:
        InputError: the plan cannot be followed.
        LinkError: a parameter is wrong, nothing answers, or it does not arm.
    """
    found = read(where)
    by_file, weight_n = _thrust(model, found), model.mass_kg * model.gravity_m_s2
    required(arming_checks(model, found, where, arms=arms))
    anchored = by_file.through(found.parameters[found.flavour.hover], weight_n)
    rates = checks.largest_rad_s(found)
    offboard.require_followable(
        model, item.trajectory, rates, (anchored.force_n(0.0), anchored.force_n(1.0)),
        remedy=lambda axis, deg_s: f"set {found.flavour.rates[axis]} to {deg_s:.0f}",
    )  # fmt: skip
    if line.parsed(where.address).position:
        _require_loops_follow(model, found, item, progress)
    progress(checks.when_we_die(found), 0.0)
    setup = AutopilotSetup(
        where.address, found.system, checks.own_system(found), found.flavour.custom_mode,
        found.flavour.custom_mode >> (16 if found.flavour is PX4 else 0), arms, anchored, model.mass_kg,
        model.gravity_m_s2, where.pose_host, where.pose_port, where.pose_delay_s, clock_port=where.clock_port,
    )  # fmt: skip
    configuration = controller.parameters_of(many_rotors.as_four(model))
    with guard(setup.to_json(), module=GUARD) as guarding:
        flight = Flight(
            guarding, lambda poses: tracker(configuration, poses), item.trajectory, progress=progress, cancel=cancel,
            motor_of_rotor=_in_order(model), hints=_hints(found, arms=arms),
        )  # fmt: skip
        flight.tracker.gives_targets = line.parsed(where.address).position
        log = flight.fly()
    told = {"firmware": found.firmware, "failsafe": checks.when_we_die(found)}
    return replace(log, metadata={**log.metadata, **told}), flight.ended_early


def _require_loops_follow(model: Vehicle, found: settings.Settings, item: TrajectoryFile, progress: Progress) -> None:
    times = item.trajectory.sample(_SAMPLE_S)
    flat = flatness.state(model, item.trajectory, times)
    acceleration = item.trajectory.position(times, 2)
    loop_limits.require_within(found, loop_limits.Asked(times, flat.velocity_world_m_s, acceleration, flat.tilt_rad))
    fastest_m_s = float(np.linalg.norm(flat.velocity_world_m_s, axis=1).max())
    if not fastest_m_s > TARGETS_FROM_M_S:
        progress(f"flown by rates and thrust alone: position targets are for above {TARGETS_FROM_M_S} m/s", 0.0)


def read(where: offboard.Where) -> settings.Settings:
    """What it says of itself. Raises `LinkError` where no autopilot answers."""
    address = line.parsed(where.address)
    opened = line.MavlinkLine(address)
    try:
        return settings.read(opened, address)
    finally:
        opened.close()


def arming_checks(
    model: Vehicle, found: settings.Settings, where: offboard.Where, *, arms: bool
) -> tuple[ArmingCheck, ...]:
    """Every condition of its parameters, for this vehicle file."""
    weight_n, has_origin = model.mass_kg * model.gravity_m_s2, line.parsed(where.address).origin is not None
    own = checks.checks(found, weight_n=weight_n, thrust=_thrust(model, found), arms=arms, origin=has_origin)
    return checks.as_many_rotors(found, model.rotors), *own


def _thrust(model: Vehicle, found: settings.Settings) -> thrust.AutopilotThrust:
    return thrust.of(found.flavour, found.parameters, offboard.thrust_map(model, idle=IDLE))


def _hints(found: settings.Settings, *, arms: bool) -> Hints:
    mode = found.flavour.mode
    return Hints(
        silent="does it send MAVLink 2 to that port, and attitudes when asked for them?",
        not_ours=f"it is not in mode {mode}; switch to it, then arm",
        arm="" if arms else f"switch to {mode}, then arm",
    )


def _in_order(model: Vehicle) -> tuple[int, ...]:
    """Both number motors as Quad X: front right, rear left, front left, rear right; none of more than four."""
    if model.rotors != 4:
        return ()
    places = [tuple(math.copysign(1.0, v) for v in hub[:2]) for hub in np.asarray(model.hub_body_m)]
    quad_x = ((1.0, -1.0), (-1.0, 1.0), (1.0, 1.0), (-1.0, -1.0))
    return tuple(quad_x.index((x, y)) for x, y in places) if sorted(places) == sorted(quad_x) else (0, 1, 2, 3)
