"""A plan on a Crazyflie: as polynomials that its memory holds, read back, and flown by its own commander."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from firmware_bridge.crazyflie import crtp, flight, pieces, process
from flight import FlightLog, InputError, Progress, TrajectoryFile
from goshawk.commands.fly import offboard
from goshawk.commands.plan import poly4d
from vehicle import Vehicle

PREFIX = crtp.PREFIX
_PLACES = ((1, -1), (-1, -1), (-1, 1), (1, 1))
"""Signs of x and y of motors 1 to 4: front right, rear right, rear left, front left."""


def fly(
    model: Vehicle, item: TrajectoryFile, address: str, *, arms: bool, progress: Progress, cancel: Callable[[], bool],
    stop: Callable[[], bool] = lambda: False, told: Callable[[flight.Seen], None] = lambda _: None,
) -> tuple[FlightLog, str]:  # fmt: skip
    """Refit the plan, upload it, and fly it.

    Args:
        arms: ask it to arm, where it does not by itself.
        stop, told: as `process.fly` takes them.

    Returns:
        The log, and why the flight ended early: empty if it did not.

    Raises:
        InputError: it has not four rotors, or the plan does not fit into its memory, near enough, or cannot be flown.
        LinkError: a check failed, nothing answers, or it does not arm.
    """
    if model.rotors != 4:
        raise InputError(f"{model.name} has {model.rotors} rotors; a Crazyflie has four: give its vehicle file")
    crtp.endpoint(address)
    _require_followable(model, item)
    refitted = poly4d.refit(item.trajectory).trajectory
    held = poly4d.compared(item.trajectory, pieces.unpacked(pieces.packed(refitted)))
    poly4d.require_near(held)
    progress(flight.ALONE, 0.0)
    order = process.Order(address, refitted, arms, _motor_of_rotor(model))
    log, early = process.fly(order, progress=progress, cancel=cancel, stop=stop, told=told)
    noted = {"failsafe": flight.ALONE, "pieces": str(len(refitted.durations_s)), "refit_m": f"{held.largest_m:.4f}"}
    return replace(log, metadata={**log.metadata, **noted}), early


def _require_followable(model: Vehicle, item: TrajectoryFile) -> None:
    """By the vehicle file: the firmware tells no largest rates."""
    limits, thrust = model.limits, offboard.thrust_map(model, idle=0.0)
    offboard.require_followable(
        model, item.trajectory, (limits.rate_rad_s, limits.rate_rad_s, limits.yaw_rate_rad_s),
        (thrust.force_n(0.0), thrust.force_n(1.0)),
        remedy=lambda _, deg_s: f"if it turns at {deg_s:.0f} deg/s, say so in the limits of the vehicle file",
    )  # fmt: skip


def _motor_of_rotor(model: Vehicle) -> tuple[int, ...]:
    quarters = [(int(np.sign(x)), int(np.sign(y))) for x, y, _ in model.hub_body_m]
    return tuple(map(_PLACES.index, quarters)) if sorted(quarters) == sorted(_PLACES) else (0, 1, 2, 3)
