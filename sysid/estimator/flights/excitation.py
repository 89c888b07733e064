"""Is there enough motion in the flights to learn anything from? Asked before the fit, answered in a sentence."""

import numpy as np

from flight import InputError
from sysid.estimator.flights.flight_data import Flight, rates_from_attitude

LEAST_RATE_RAD_S = 0.1
"""Root mean square of the body rate below which inertias cannot show above rotor noise."""
LEAST_SPEED_SPREAD = 0.01
"""Rotor speeds that vary by less than this share (standard deviation over mean) tell no thrust law."""


def require(flights: list[Flight], names: tuple[str, ...]) -> None:
    """Refuse flights that hang still.

    Raises:
        InputError: the body hardly turns, or rotor speed is constant or zero.
    """
    if not names:
        return
    rates = np.concatenate([_slow_rates(f) for f in flights])
    rate_rms = np.sqrt((rates**2).mean(axis=0))
    speed = np.concatenate([f.rotor_speed_rad_s for f in flights])
    if np.abs(speed).max() <= 0.0:
        raise InputError("rotor speed is zero throughout; nothing drives the model")
    if (speed.std(axis=0) < LEAST_SPEED_SPREAD * np.abs(speed).mean(axis=0)).all():
        raise InputError(
            "no excitation: every rotor's speed stays within 1 % of its mean; the flights hover. Fly up and down, "
            "fast level legs, and quick roll, pitch and yaw"
        )
    if rate_rms.max() < LEAST_RATE_RAD_S and any(name.startswith("inertia_") for name in names):
        raise InputError(
            f"no excitation: the body turns at {rate_rms.max():.2f} rad/s root mean square at most, and inertias need "
            f"{LEAST_RATE_RAD_S:g}; fly quick roll, pitch and yaw, or hold the inertias"
        )


def _slow_rates(flight: Flight) -> np.ndarray:
    """Body rate over steps of about 0.1 s, so that attitude noise does not count as motion."""
    every = max(1, round(0.1 / float(np.median(flight.step_s))))
    if not flight.has_pose:
        return flight.rate_body_rad_s
    return rates_from_attitude(flight.time_s[::every], flight.q_world_sensor[::every])
