"""Battery: its voltage over each interval, which the motors may need. An input, taken as exact."""

from collections.abc import Sequence

import numpy as np

from flight import InputError
from flight.rotations import FloatArray
from sysid.estimator.flights.flight_data import Flight
from sysid.estimator.flights.sampling import Stretch
from vehicle.effects.base import Effect

QUANTITY = "battery_v"
SAG = "battery_sag"
"""The effect that needs it."""


def read(stretch: Stretch) -> FloatArray:
    """(n - 1,) in the middle of each interval; NaN where it was not logged."""
    node_s, columns = stretch.time_s, stretch.log.columns
    middle = 0.5 * (node_s[1:] + node_s[:-1])
    if QUANTITY not in columns:
        return np.full(len(middle), np.nan)
    rows = stretch.inside & np.isfinite(columns[QUANTITY])
    times, values = stretch.log.time_s[rows], columns[QUANTITY][rows]
    return np.interp(middle, times, values) if len(times) else np.full(len(middle), np.nan)


def require(flight: Flight, active: Sequence[Effect]) -> None:
    """Refuse a flight without voltage where an effect needs it."""
    if any(effect.name == SAG for effect in active) and not np.isfinite(flight.battery_v).all():
        raise InputError(f"{flight.name} has no {QUANTITY}, which {SAG} needs; log it, or take the effect out")
