"""Laws of one variable as columns beside a fitted model: what each adds to force, torque or thrust along an axis."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from flight.rotations import FloatArray
from sysid.diagnosis.evidence import free_form
from sysid.diagnosis.evidence.evidence import Moved
from sysid.diagnosis.evidence.forms import Form
from sysid.diagnosis.evidence.free_form import GAIN, LIFT, ROTORS_OWN, THRUST, VARIABLE, Curve, losses, of_thrust
from sysid.estimator.flights.flight_data import Flight, IndexArray
from sysid.estimator.motors import motor
from sysid.estimator.result import CHANNELS
from sysid.estimator.trajectory.midpoint import Middle, middle
from sysid.estimator.trajectory.model import slopes_along
from sysid.estimator.trajectory.states import States
from vehicle import Vehicle


@dataclass(frozen=True, slots=True)
class Axis:
    """A channel, the variable that it follows there, and the sign of the law along it."""

    channel: str
    variable: str
    sign: float = 1.0


@dataclass(frozen=True, slots=True)
class Law:
    """A form with its shape."""

    form: Form
    shape: float
    reach: float
    """Largest |variable| that was flown."""


def read(axis: Axis, flight: Flight, mid: Middle, vehicle: Vehicle) -> FloatArray:
    """(k,), or (k, r) where each rotor has its own, the variable in the middle of each interval."""
    if axis.variable in ROTORS_OWN:
        return ROTORS_OWN[axis.variable].read(flight, mid, vehicle)
    return VARIABLE[axis.variable].read(flight, mid)


def largest(axis: Axis, flights: Sequence[Flight], states: Sequence[States], vehicle: Vehicle) -> float:
    """Of |variable|, all but the last half per cent."""
    driven = [motor.driven(f, vehicle) for f in flights]
    values = [read(axis, f, middle(f, s), vehicle).ravel() for f, s in zip(driven, states, strict=True)]
    return float(np.quantile(np.abs(np.concatenate(values)), 0.995))


def moved(axes: Sequence[Axis], laws: Sequence[Law], curve: Curve) -> Moved:
    """Columns: of each law along every axis in turn, then those of a free curve along the first axis."""

    def columns(flight: Flight, mid: Middle, vehicle: Vehicle) -> tuple[IndexArray, FloatArray]:
        parts: list[FloatArray] = []
        along = [(_Along.of(axis, flight, mid, vehicle), axis) for axis in axes]
        for law in laws:
            parts += [axis.sign * one.accelerations(_values(law, one.x, flight, mid)) for one, axis in along]
        first = along[0][0]
        basis = curve.basis(first.x.ravel()).reshape(*first.x.shape, -1)
        parts += [first.accelerations(basis[..., i]) for i in range(basis.shape[-1])]
        used = sorted({i for one, _ in along for i in one.rows})
        return np.array(used, np.intp), np.stack(parts, axis=2)[:, used]

    return columns


def _values(law: Law, x: FloatArray, flight: Flight, mid: Middle) -> FloatArray:
    f = law.form.values(x, law.shape)
    if law.form.carrier == "":
        return f
    carrier = (
        flight.rotor_speed_rad_s.mean(axis=1)
        if law.form.carrier == "n"
        else np.linalg.norm(mid.velocity_body_m_s, axis=1)
    )
    return carrier * f if f.ndim == 1 else carrier[:, None] * f


@dataclass(frozen=True, slots=True)
class _Along:
    """One axis along one flight."""

    channel: str
    x: FloatArray
    by: FloatArray
    """Of thrust: (k, 6) or (k, 6, r) accelerations by lift or by the share of each rotor; else nothing."""

    @classmethod
    def of(cls, axis: Axis, flight: Flight, mid: Middle, vehicle: Vehicle) -> "_Along":
        x = read(axis, flight, mid, vehicle)
        if not of_thrust(axis.channel):
            return cls(axis.channel, x, np.zeros(0))
        if axis.channel == LIFT:
            return cls(axis.channel, x, slopes_along(vehicle, (GAIN,), flight, mid).parameters[:, :, 0])
        return cls(axis.channel, x, -slopes_along(vehicle, losses(vehicle), flight, mid).parameters)

    @property
    def rows(self) -> tuple[int, ...]:
        """Which of the six accelerations it moves."""
        if of_thrust(self.channel):
            return tuple(CHANNELS.index(name) for name in free_form.SHOWN_BY_THRUST)
        return (CHANNELS.index(self.channel),)

    def accelerations(self, values: FloatArray) -> FloatArray:
        """(k, 6) by values (k,), or (k, r) for each rotor."""
        moved = np.zeros((len(values), 6))
        rows = list(self.rows)
        if self.channel == LIFT:
            moved[:, rows] = self.by[:, rows] * values[:, None]
        elif self.channel == THRUST:
            each = values if values.ndim == 2 else np.repeat(values[:, None], self.by.shape[2], axis=1)
            moved[:, rows] = np.einsum("krj,kj->kr", self.by[:, rows], each)
        elif of_thrust(self.channel):
            moved[:, rows] = self.by[:, rows, int(self.channel[2])] * values[:, None]
        else:
            moved[:, rows[0]] = values
        return moved
