"""Do flights without a pose show enough? Asked before the fit; each refusal says what to fly, or what to record."""

from collections.abc import Sequence

import numpy as np

from flight import FlightLog, InputError
from flight.rotations import FloatArray
from sysid.estimator.flights.flight_data import Flight
from sysid.estimator.flights.sampling import means_over
from sysid.logs.manoeuvres import SLOWEST_HZ

NEVER = 0.01
"""Share of their mean within which motors count as not varying."""
LEAST_COMMAND_STEP = 0.02
"""Standard deviation of what drives the rotors together over its mean: a hover has less."""
LEAST_TURN_RAD_S2 = 2.0
"""Root mean square of the angular acceleration over 20 ms: a hover has less."""
CLIPPED, REPEATS = 0.005, 3
"""Share of the samples in which a gyro may repeat its extreme, so many times in a row."""
LIVELY, ANSWERED = 0.1, 0.2
"""Commands whose squares vary by this share, and the least part of that which flying rotors make felt."""


def require(flights: Sequence[Flight]) -> None:
    """Refuse flights that say nothing.

    Raises:
        InputError: samples are too far apart, the rotors do not vary or are not felt, or the vehicle only hovers.
    """
    for flight in flights:
        rate_hz = 1.0 / float(np.median(flight.step_s))
        if rate_hz < SLOWEST_HZ:
            raise InputError(
                f"{flight.name} has gyro and accelerometer at {rate_hz:.0f} Hz and no pose, where lag and inertia "
                f"are one number. Log the IMU at {SLOWEST_HZ:g} Hz or more (1 kHz is best), or record a pose"
            )
    speed = [flight.rotor_speed_rad_s for flight in flights]
    if max(float(s.max()) for s in speed) <= 0.0:
        raise InputError("what drives the rotors is zero throughout: log the motors' commands of a flight")
    if all(float((s.std(axis=0) / s.mean(axis=0).clip(1e-12)).max()) < NEVER for s in speed):
        raise InputError(
            "the motors never vary: every command stays within 1 % of its mean. Are these the outputs to the motors? "
            "Log those, and fly throttle steps and quick rolls, pitches and yaws"
        )
    unfelt = [f.name for f in flights if _unfelt(f)]
    if len(unfelt) == len(flights):
        raise InputError(
            f"the accelerometer of {unfelt[0]} does not feel what is commanded: propellers off, a vehicle held fast, "
            "or another's outputs; record a free flight"
        )
    together = max(float(s.sum(axis=1).std() / max(s.sum(axis=1).mean(), 1e-12)) for s in speed)
    turned = max(_turned(flight) for flight in flights)
    if together < LEAST_COMMAND_STEP and turned < LEAST_TURN_RAD_S2:
        raise InputError(
            f"these flights only hover: what drives the rotors varies by {together:.1%} and the body turns with "
            f"{turned:.1f} rad/s2. Fly for a minute: throttle up and down in steps, then quick rolls, pitches and yaws"
        )


def require_range(log: FlightLog, name: str) -> None:
    """Refuse a log whose gyro was at the end of its range. Raises `InputError`."""
    for axis, values in zip("xyz", log.vector("rate_body_rad_s").T, strict=True):
        known = values[np.isfinite(values)]
        if len(known) and (share := _clipped(known)) > CLIPPED:
            raise InputError(
                f"the gyro of {name} sits at its extremes about {axis}, {np.abs(known).max():.3g} rad/s, in "
                f"{share:.1%} of the samples: the end of its range, and inertias would be a third off. Roll, pitch and "
                "yaw with less stick, or raise the gyro's range"
            )


def _clipped(values: FloatArray) -> float:
    """Share of the samples that repeat the largest or the smallest."""
    share = 0.0
    for extreme in (values.max(), values.min()):
        at = (values == extreme).astype(np.int8)
        edges = np.flatnonzero(np.diff(np.concatenate([[0], at, [0]])))
        lengths = edges[1::2] - edges[::2]
        share += float(lengths[lengths >= REPEATS].sum()) / len(values) if extreme != 0.0 else 0.0
    return share


def _unfelt(flight: Flight) -> bool:
    """Whether commands vary, and the force along the thrust hardly does, over a tenth of a second."""
    squares = (flight.rotor_speed_rad_s**2).sum(axis=1, keepdims=True)
    both = np.concatenate([squares, flight.specific_force_body_m_s2[:, 2:]], axis=1)
    means = means_over(both, flight.time_s[:-1], 0.1)
    commanded, felt = means.std(axis=0) / np.maximum(np.abs(means.mean(axis=0)), 1e-12)
    return bool(commanded > LIVELY and felt < ANSWERED * commanded)


def _turned(flight: Flight) -> float:
    """Root mean square of the angular acceleration about the liveliest axis, rad/s2."""
    every = max(1, round(0.02 / float(np.median(flight.step_s))))
    rate, time_s = flight.rate_body_rad_s[::every], flight.time_s[::every]
    turning = np.diff(rate, axis=0) / np.diff(time_s)[:, None]
    return float(np.sqrt((turning**2).mean(axis=0)).max())
