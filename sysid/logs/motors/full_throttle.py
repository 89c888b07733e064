"""Motor commands from 0 to 1 as commanded rotor speeds, for logs without rotor speed."""

import math

import numpy as np

from flight import FlightLog, InputError
from flight.flight_log import MOST_ROTORS, rotor_columns

_EVERY = tuple(f"motor_command_{i}_ratio" for i in range(MOST_ROTORS))
RATIOS = _EVERY[:4]
"""Of the first four motors."""
COMMAND = "rotor_speed_command_rad_s"
IDLE = "idle_ratio"
"""Of a log's metadata: output at a command of 0, as a share of full; rotors turn in proportion to the output."""
KEY = "full_throttle_rad_s"
"""Of a log's metadata: the speed that a command of 1 was taken for."""


def ratios(log: FlightLog) -> tuple[str, ...]:
    """The columns of as many motors as the log has, of the first four at least."""
    return _EVERY[: next((i for i in range(4, MOST_ROTORS) if _EVERY[i] not in log.columns), MOST_ROTORS)]


def has_ratios(log: FlightLog) -> bool:
    return all(name in log.columns for name in RATIOS)


def by_limit(log: FlightLog, fastest_rad_s: float) -> FlightLog:
    """A log without rotor speed whose commands from 0 to 1 become idle to the vehicle's fastest; others as they are.

    Any speed will do: what is fitted is thrust per command.
    """
    known = log.has("rotor_speed_rad_s") or log.has(COMMAND)
    return log if known or not has_ratios(log) else with_command_speeds(log, fastest_rad_s)


def with_command_speeds(log: FlightLog, full_throttle_rad_s: float) -> FlightLog:
    """The log with `rotor_speed_command_rad_s`: the share of full throttle times the speed there.

    ESCs answer almost in proportion between idle and full throttle. The thrust coefficient that is fitted holds for
    this speed only: 10 % too much of it make the coefficient 17 % too small, and nothing else wrong.

    A command of 0 becomes the share `IDLE` of that speed, where the log's metadata has it.

    Raises:
        InputError: the log has no motor commands, has commanded speeds, or the speed is not positive.
    """
    if not (math.isfinite(full_throttle_rad_s) and full_throttle_rad_s > 0.0):
        raise InputError(f"the speed at full throttle is {full_throttle_rad_s:g} rad/s; a positive number is expected")
    if not has_ratios(log):
        raise InputError("the log has no motor commands from 0 to 1 (motor_command_0_ratio ...); give no full throttle")
    if log.has(COMMAND):
        raise InputError("the log has commanded rotor speeds already; give no full throttle")
    shares = np.maximum(np.stack([log.columns[name] for name in ratios(log)], axis=1), 0.0)  # below: disarmed, at rest
    idle = float(log.metadata.get(IDLE, 0.0))
    names = rotor_columns(COMMAND, shares.shape[1])
    added = dict(zip(names, (full_throttle_rad_s * (idle + (1.0 - idle) * shares)).T, strict=True))
    return FlightLog({**log.columns, **added}, {**log.metadata, KEY: full_throttle_rad_s})
