"""How alike candidates look on these flights, and how much prediction error each makes."""

from collections.abc import Sequence

import numpy as np

from flight.rotations import FloatArray
from sysid.diagnosis.evidence.candidates import Candidate
from sysid.diagnosis.examined import Model, reproduced
from sysid.estimator.motors import motor
from sysid.estimator.trajectory.midpoint import middle
from sysid.estimator.trajectory.model import slopes_along

HORIZON_S = 0.5
TURN_ERROR = 9.80665 * HORIZON_S**4 / 24.0
"""Metres of position error per rad/s2 of wrong angular acceleration held over the horizon, by tilting gravity."""


def confounded(model: Model, candidate: Candidate, least: float) -> tuple[tuple[str, float], ...]:
    """Others whose columns reproduce this candidate's trace, the base parameters taken out, most alike first."""
    others = [
        (o.name, reproduced(model, candidate, o)) for o in model.candidate_set.candidates if o.name != candidate.name
    ]
    return tuple(sorted((pair for pair in others if pair[1] > least), key=lambda pair: -pair[1]))


def prediction_error_m(model: Model, sized: Sequence[tuple[Candidate, FloatArray]]) -> dict[str, float]:
    """Root mean square position error after `HORIZON_S` that leaving out each candidate at its size makes.

    A wrong force pushes for the whole horizon; a wrong torque tilts the vehicle, and gravity does the rest.
    """
    from scipy.ndimage import uniform_filter1d

    names = tuple(n for candidate, _ in sized for n in candidate.parameters)
    squares, count = {candidate.name: 0.0 for candidate, _ in sized}, 0
    for flight, states in zip(model.flights, model.fit.solution.point.states, strict=True):
        flight = motor.driven(flight, model.candidate_set.vehicle)
        mid = middle(flight, states)
        slopes = slopes_along(model.candidate_set.vehicle, names, flight, mid).parameters
        window = max(1, round(HORIZON_S / float(np.median(flight.step_s))))
        count += len(slopes)
        place = 0
        for candidate, size in sized:
            six = slopes[:, :, place : place + len(size)] @ size
            place += len(size)
            force = uniform_filter1d((mid.R_world_body @ six[:, :3, None])[:, :, 0], window, axis=0)
            turn = uniform_filter1d(six[:, 3:], window, axis=0)[:, :2]
            pushed, tilted = 0.5 * HORIZON_S**2 * force, TURN_ERROR * turn
            squares[candidate.name] += float((pushed**2).sum() + (tilted**2).sum())
    return {name: float(np.sqrt(square / max(count, 1))) for name, square in squares.items()}
