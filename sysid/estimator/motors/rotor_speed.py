"""Rotor speed: as it most likely was, from rotor speed as it was measured. It drives the model.

Its noise is an error in a regressor: it is in the torque the model expects and
not in the motion, so a plain fit finds the motion too small for the torque and books that as inertia: 2 to 3 % too much
with 4 rad/s at 200 Hz, five times the stated error. Put in its place what the true speed is expected to be given the
whole measured signal, and what is still wrong with it is uncorrelated with what the fit sees: the bias is gone
(regression calibration; Carroll et al., Measurement Error in Nonlinear Models, 2006, chapter 4).

Telemetry of speed controllers comes late, by a time that the fit estimates; roll, pitch, yaw and thrust differ in how
much of them is noise, hence the joint smoother of all rotors.
"""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from flight.rotations import FloatArray
from sysid.estimator.flights.clocks import ROTOR_SPEED as QUANTITY
from sysid.estimator.flights.clocks import delay_of
from sysid.estimator.flights.flight_data import Flight
from sysid.estimator.motors import motor


def aligned(flight: Flight, delays: Mapping[str, float]) -> Flight:
    """The flight with mean rotor speed and acceleration, or command, of its intervals where the stream is this late."""
    if QUANTITY not in flight.streams:
        return motor.aligned(flight, delays)
    speed, acceleration = flight.streams[QUANTITY].means(flight.time_s + delay_of(QUANTITY, flight, delays))
    return replace(flight, rotor_speed_rad_s=speed, rotor_acceleration_rad_s2=acceleration)


def by_delay(flight: Flight, delays: Mapping[str, float]) -> tuple[FloatArray, FloatArray]:
    """Derivatives (k, r) of mean speed and mean acceleration by the delay of the stream that drives the model."""
    if QUANTITY not in flight.streams:
        return motor.by_delay(flight)
    signal, at_s = flight.streams[QUANTITY], flight.time_s + delay_of(QUANTITY, flight, delays)
    step_s = flight.step_s[:, None]
    return np.diff(signal.value(at_s), axis=0) / step_s, np.diff(signal.slope(at_s), axis=0) / step_s
