"""Telemetry frames to a flight log, with the vehicle's own time stamps."""

from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np

from firmware_bridge.dialect.generated.messages import State
from flight import FlightLog, InputError
from flight.flight_log import COLUMNS, from_vectors

_VECTORS = tuple(name for name in COLUMNS if name in State.__annotations__)
_SCALARS = {
    "battery_v": "battery_v",
    "mission_state": "mission_state",
    "mission_reason": "reason",
    "saturation": "saturation",
    "trajectory_time_s": "trajectory_time_s",
    "path_rate_ratio": "path_rate",
    "path_limit_ratio": "path_limit",
    "limit_reason": "limit_reason",
    "reckoning_s": "reckoning_s",
    "reckoning_std_m": "reckoning_std_m",
    "warnings": "warnings",
    "landing_stage": "landing_stage",
    "estimate_valid": "estimate_valid",
    "estimate_faults": "estimate_faults",
    "observer_state": "observer_state",
    "disturbance_force_std_n": "disturbance_force_std_n",
}
"""Column to field of the message."""


def flight_log(states: Iterable[State], metadata: Mapping[str, Any]) -> FlightLog:
    """A log of GOSHAWK_STATE messages: sorted by vehicle time, doubles dropped.

    Raises:
        InputError: there are none.
    """
    ordered = sorted({state.time_us: state for state in states}.values(), key=lambda state: state.time_us)
    if not ordered:
        raise InputError("no telemetry was received: there is nothing to log")
    time_s = np.array([state.time_us for state in ordered], dtype=np.float64) * 1e-6
    vectors = {name: np.array([getattr(state, name) for state in ordered], dtype=np.float64) for name in _VECTORS}
    scalars = {
        column: np.array([getattr(state, name) for state in ordered], dtype=np.float64)
        for column, name in _SCALARS.items()
    }
    scalars["position_delay_s"], scalars["attitude_delay_s"] = np.array([state.pose_delay_s for state in ordered]).T
    scalars["battery_v"][scalars["battery_v"] <= 0.0] = np.nan  # 0: the vehicle does not measure it
    scalars["trajectory_time_s"][scalars["trajectory_time_s"] < 0.0] = np.nan
    return from_vectors(time_s, vectors, scalars=scalars, metadata=metadata)


def lost_ratio(states: Iterable[State]) -> float:
    """Share of the messages that were sent between the first and the last one received, and did not arrive."""
    sequence = np.unwrap(np.array([state.sequence for state in states], dtype=np.float64), period=65536)
    if len(sequence) < 2:
        return 0.0
    return float(1.0 - len(np.unique(sequence)) / (sequence.max() - sequence.min() + 1.0))
