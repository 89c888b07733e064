"""How alike suspects look on these flights, and how much prediction error each makes."""

from collections.abc import Sequence

import numpy as np
from scipy.ndimage import uniform_filter1d

from flight.rotations import FloatArray
from sysid import drive, dynamics
from sysid.diagnosis.score import inverse_of
from sysid.diagnosis.search import Model
from sysid.diagnosis.suspects import Suspect
from sysid.model import slopes_along

HORIZON_S = 0.5
TURN_ERROR = 9.80665 * HORIZON_S**4 / 24.0
"""Metres of position error per rad/s2 of wrong angular acceleration held over the horizon, by tilting gravity."""


def look_alikes(model: Model, suspect: Suspect, least: float) -> tuple[tuple[str, float], ...]:
    """Others whose columns reproduce this suspect's trace, the base parameters taken out, most alike first."""
    trace = _trace(model, suspect)
    found = []
    for other in model.line_up.suspects:
        if other.name != suspect.name:
            share = float(np.sqrt(max(0.0, _reproduced(model, suspect, trace, other))))
            if share > least:
                found.append((other.name, share))
    return tuple(sorted(found, key=lambda pair: -pair[1]))


def _trace(model: Model, suspect: Suspect) -> FloatArray:
    """The estimated size if it stands out, else the usual one."""
    found = model.scores[suspect.name]
    return found.size if found.significance < 0.05 else np.array(suspect.usual)


def _reproduced(model: Model, suspect: Suspect, size: FloatArray, other: Suspect) -> float:
    """Share of the trace's sum of squares that the other suspect's columns can reproduce."""
    evidence = model.evidence
    mine, its = evidence.place(suspect.parameters), evidence.place(other.parameters)
    columns = np.concatenate([evidence.base, mine, its])
    information = evidence.named.information.sum(axis=0)[columns[:, None], columns]
    b = len(evidence.base)
    schur = information[b:, b:] - information[b:, :b] @ inverse_of(information[:b, :b]) @ information[:b, b:]
    q = len(mine)
    cross = schur[q:, :q] @ size
    total = float(size @ schur[:q, :q] @ size)
    return float(cross @ inverse_of(schur[q:, q:]) @ cross) / total if total > 0.0 else 0.0


def prediction_error_m(model: Model, sized: Sequence[tuple[Suspect, FloatArray]]) -> dict[str, float]:
    """Root mean square position error after `HORIZON_S` that leaving out each suspect at its size makes.

    A wrong force pushes for the whole horizon; a wrong torque tilts the vehicle, and gravity does the rest.
    """
    names = tuple(n for suspect, _ in sized for n in suspect.parameters)
    squares, count = {suspect.name: 0.0 for suspect, _ in sized}, 0
    for flight, states in zip(model.fit.flights, model.fit.solution.point.states, strict=True):
        flight = drive.driven(flight, model.line_up.vehicle)
        mid = dynamics.middle(flight, states)
        slopes = slopes_along(model.line_up.vehicle, names, flight, mid).parameters
        window = max(1, round(HORIZON_S / float(np.median(flight.step_s))))
        count += len(slopes)
        place = 0
        for suspect, size in sized:
            six = slopes[:, :, place : place + len(size)] @ size
            place += len(size)
            force = uniform_filter1d((mid.R_world_body @ six[:, :3, None])[:, :, 0], window, axis=0)
            turn = uniform_filter1d(six[:, 3:], window, axis=0)[:, :2]
            pushed, tilted = 0.5 * HORIZON_S**2 * force, TURN_ERROR * turn
            squares[suspect.name] += float((pushed**2).sum() + (tilted**2).sum())
    return {name: float(np.sqrt(square / max(count, 1))) for name, square in squares.items()}
