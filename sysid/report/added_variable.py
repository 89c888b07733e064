"""What speaks for an effect once all else is refitted: added-variable and partial-residual plots of a linear model.

The residual of a fitted model and the trace of an effect share whatever the other parameters can mimic: a weak rotor
looks like a centre of mass, drag like a tilted sensor. Both are therefore freed of the other parameters' columns first
(Frisch and Waugh 1933; Velleman and Welsch 1981), so that what is left to see is what the fit goes by.
"""

from dataclasses import dataclass

import numpy as np

from flight.rotations import FloatArray
from sysid.diagnosis.evidence.candidates import Candidate, base_names
from sysid.diagnosis.examined import Model
from sysid.estimator.flights.sampling import means_over
from sysid.estimator.joint_problem.unknowns import SENSOR_NAMES
from sysid.estimator.motors import motor
from sysid.estimator.result import CHANNELS
from sysid.estimator.trajectory.model import slopes_along
from sysid.estimator.validation.comparison import SPAN_S, Residual, residual
from vehicle import rigid_body

SHOWN = 0.3
"""A channel in which a candidate is this much weaker than in its strongest is not drawn."""


@dataclass(frozen=True, slots=True)
class AddedVariable:
    """Of one channel, means over 0.1 s of all flights one after the other, N or N m."""

    channel: str
    trace: FloatArray
    """(m,) what the effect makes at its estimated size."""
    trace_alone: FloatArray
    """(m,) what of it no other parameter can mimic."""
    residual_alone: FloatArray
    """(m,) what is left of the residual once the other parameters are refitted beside the effect, its own part kept."""

    @property
    def partial_residual(self) -> FloatArray:
        """(m,) the whole trace, and what is left with the effect in the model."""
        return self.trace + self.residual_alone - self.trace_alone


def left_of(model: Model) -> list[Residual]:
    """What a fitted model leaves unexplained on the flights it was fitted to."""
    fit = model.fit
    both = zip(model.flights, fit.solution.point.states, strict=True)
    return [residual(flight, states, fit.vehicle, fit.noise.process) for flight, states in both]


def added_variable(model: Model, candidate: Candidate) -> AddedVariable:
    """The channel that speaks most for a candidate, with the model's other parameters taken out."""
    left = left_of(model)
    base = _free_names(model)
    columns, sigma = _columns(model, left, (*base, *candidate.parameters))
    trace = columns[:, :, len(base) :] @ model.scores[candidate.name].size
    measured = np.concatenate([one.means() for one in left])
    trace_alone, residual_alone = (_freed(values / sigma, columns[:, :, : len(base)] / sigma[:, None]) for values in (
        trace, measured))  # fmt: skip
    strength = np.sqrt(((trace / sigma) ** 2).mean(axis=0))
    said = np.where(strength >= SHOWN * strength.max(), (trace_alone * residual_alone).sum(axis=0), -np.inf)
    row = int(np.argmax(said))
    return AddedVariable(
        CHANNELS[row], trace[:, row], trace_alone[:, row] * sigma[row], residual_alone[:, row] * sigma[row]
    )


def _free_names(model: Model) -> tuple[str, ...]:
    """Fitted parameters of the vehicle, as the vehicle with all candidates calls them."""
    names = base_names(model.fit.unknowns.model, model.candidate_set.vehicle)
    return tuple(name for name in names if name not in SENSOR_NAMES)


def _columns(model: Model, left: list[Residual], names: tuple[str, ...]) -> tuple[FloatArray, FloatArray]:
    """(m, 6, p) force and torque per unit of each parameter, and (6,) the noise of each channel."""
    body, parts = rigid_body(model.fit.vehicle), []
    for one in left:
        flight = motor.driven(one.flight, model.candidate_set.vehicle)
        slopes = slopes_along(model.candidate_set.vehicle, names, flight, one.mid).parameters
        turning = np.einsum("ij,kjp->kip", body.inertia_kg_m2, slopes[:, 3:])
        wrench = np.concatenate([body.mass_kg * slopes[:, :3], turning], axis=1)
        means = means_over(wrench.reshape(len(wrench), -1), one.time_s, SPAN_S)
        parts.append(means.reshape(len(means), 6, len(names)))
    return np.concatenate(parts), left[0].sigma


def _freed(values: FloatArray, columns: FloatArray) -> FloatArray:
    """(m, 6) values less the best combination of columns (m, 6, p), all channels together."""
    if columns.shape[2] == 0:
        return values
    flat = columns.reshape(-1, columns.shape[2])
    scale = np.maximum(np.sqrt((flat**2).sum(axis=0)), 1e-300)
    size = np.linalg.lstsq(flat / scale, values.ravel(), rcond=1e-9)[0]
    return values - (flat @ (size / scale)).reshape(values.shape)
