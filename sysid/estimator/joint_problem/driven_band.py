"""Roll and pitch inertia from the band in which the rotors turn the body: a start for the joint fit.

Slower than 3 Hz the rotors answer moments that the model may lack, faster than 20 Hz is noise. In between torque and
turning are in proportion, and inertia is their ratio, whatever the model lacks below. A fit that starts far off there
takes the answer of the rotors for a heavy body, and needs many steps to find out.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from flight.rotations import FloatArray
from sysid.estimator.flights.flight_data import Flight
from sysid.estimator.joint_problem.problem import with_values
from sysid.estimator.trajectory.midpoint import middle
from sysid.estimator.trajectory.model import along
from sysid.estimator.trajectory.states import States
from vehicle import Vehicle

BAND_HZ = (3.0, 20.0)
"""Of turning that is the rotors' doing (`sysid.logs.checks.consistency` judges clocks by the same)."""
LEAST_CORRELATION = 0.7
"""Between torque and turning; with less, something else turns the body, or the clocks are off."""
FAR = 1.2
"""Factor from which on a value is exchanged: nearer, the joint fit knows better."""
AXES = ("inertia_xx_kg_m2", "inertia_yy_kg_m2")
"""Yaw is not among them: rotor torque about it is weak, and its coefficient is as little known as the inertia."""


def started(vehicle: Vehicle, flights: Sequence[Flight], states: Sequence[States], names: Sequence[str]) -> Vehicle:
    """The vehicle with those of the named inertias exchanged that the band puts elsewhere by more than `FAR`.

    Args:
        states: of each flight; only their slow parts matter.
        names: parameters that are estimated; others are left alone.
    """
    usable = [(f, s) for f, s in zip(flights, states, strict=True) if _usable(f)]
    if not usable:
        return vehicle
    torque, turning, together = np.sum([_powers(f, s, vehicle) for f, s in usable], axis=0)
    both = np.sqrt(np.maximum(torque * turning, 1e-300))
    for axis, name in enumerate(AXES):
        if name in names and together[axis] > LEAST_CORRELATION * both[axis]:
            factor = float(np.sqrt(torque[axis] / turning[axis]))
            if not 1.0 / FAR < factor < FAR:
                vehicle = with_values(vehicle, (name,), np.array([factor * vehicle.value(name)]))
    return vehicle


def _usable(flight: Flight) -> bool:
    """Whether both rotor speed and body rate were measured, often enough for the band."""
    often = float(np.median(flight.step_s)) < 0.5 / BAND_HZ[1]
    return often and not flight.driven_by_command and bool(np.isfinite(flight.rate_body_rad_s).all())


def _powers(flight: Flight, states: States, vehicle: Vehicle) -> FloatArray:
    """(3, 2) in the band, about roll and pitch: of the model's angular acceleration, of the gyro's, and of both."""
    model = _in_band(along(vehicle, flight, middle(flight, states))[:, 3:5], flight)
    gyro = _in_band(np.diff(flight.rate_body_rad_s[:, :2], axis=0) / flight.step_s[:, None], flight)
    return np.array(
        [(np.abs(model) ** 2).sum(axis=0), (np.abs(gyro) ** 2).sum(axis=0), (model.conj() * gyro).real.sum(axis=0)]
    )


def _in_band(values: FloatArray, flight: Flight) -> NDArray[np.complex128]:
    """Spectrum of columns within the band."""
    hz = np.fft.rfftfreq(len(values), float(np.median(flight.step_s)))
    inside = (hz > BAND_HZ[0]) & (hz < BAND_HZ[1])
    return np.fft.rfft((values - values.mean(axis=0)) * np.hanning(len(values))[:, None], axis=0)[inside]
