"""Maximum likelihood of flights without a pose: Gauss-Newton on prediction errors, the noise fitted anew each step."""

import logging
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from flight import Progress
from flight.rotations import FloatArray
from sysid.estimator.blocks.catalogue import BLOCKS, acting, places
from sysid.estimator.blocks.motion import Motion
from sysid.estimator.blocks.noise import Noise
from sysid.estimator.flights.flight_data import Flight
from sysid.estimator.flights.sampling import means_over
from sysid.estimator.joint_problem.problem import Point, Residuals
from sysid.estimator.joint_problem.solver import (
    CONVERGED_SIGMA,
    Iteration,
    Prior,
    Score,
    Solution,
    covariance_of,
    parameter_step,
    step_room,
)
from sysid.estimator.joint_problem.unknowns import Unknowns
from sysid.estimator.options import Options
from sysid.estimator.uncertainty import sampled_commands
from sysid.estimator.without_pose import coloured, left_out
from sysid.estimator.without_pose.anchors import Beside
from sysid.estimator.without_pose.coloured import Coloured
from sysid.estimator.without_pose.sensing import Shown, left, shown

logger = logging.getLogger(__name__)

BALANCE_M_S2 = 0.1
"""Thrust carries the weight on the whole of a flight, but for this much: the noise model hardly looks at a mean."""
MOST_PLAIN = 6
"""Steps with white noise, before disturbances and noise are distinguished from the misfit of the start."""
FORCE_Z = 2
"""Of the six channels."""
SPAN_S = 0.1
"""What is left unexplained is told as means over this long (`sysid.estimator.result`)."""


@dataclass(frozen=True, slots=True, eq=False)
class _Sums:
    """Normal equations of all flights."""

    information: FloatArray
    gradient: FloatArray


def solve(
    flights: Sequence[Flight],
    point: Point,
    unknowns: Unknowns,
    prior: Prior,
    options: Options,
    progress: Progress,
    known: Beside,
    *,
    near: bool = False,
) -> Solution:
    """The maximum of the likelihood over parameters and noise.

    Args:
        known: what was measured beside the flights.
        near: whether the start is near the optimum already.
        point: where to start; its states are what the IMU alone shows, and stay as they are.
    """
    order = _order(flights)
    states, point = point.states, replace(point, states=())
    record: list[Iteration] = []
    noise_of, converged = coloured.fitted if near else coloured.plain, False
    while not converged and len(record) < options.max_iterations:
        parts = [shown(f, point.vehicle, unknowns.names, unknowns.model, point.sensors) for f in flights]
        noise = noise_of([part.left for part in parts], order)
        sums = _sums(parts, noise)
        border = point.shared(unknowns)
        error, slopes = _beside(known, point, unknowns)
        hessian = prior.information + sums.information + slopes.T @ slopes
        gradient = prior.information @ (border - prior.mean) + sums.gradient + slopes.T @ error
        step = parameter_step(hessian, gradient, step_room(point, unknowns))
        before = _cost([part.left for part in parts], noise, prior, border) + 0.5 * float(error @ error)
        point, taken = _take(flights, point, unknowns, noise, prior, known, step, before)
        sigma = np.sqrt(np.diag(covariance_of(hessian)))
        judged = slice(len(unknowns.model) or None)
        moved = float(np.max(np.abs(taken * step / sigma)[judged], initial=0.0))
        record.append(Iteration(before, moved, taken, tuple(point.shared(unknowns)), 0.0))
        if noise_of is coloured.plain:
            if len(record) >= MOST_PLAIN or moved < 1.0:
                noise_of = coloured.fitted
        else:
            still = [i.step_sigma < CONVERGED_SIGMA for i in record[-2:]]
            converged = still == [True, True] or taken == 0.0
        progress("identify", min(0.95, len(record) / 12.0))
        logger.info("iteration %d: cost %.6g, step %.3g sigma", len(record), before, moved)
    point = replace(point, states=states)
    return _solution(flights, point, unknowns, prior, known, order, tuple(record), converged, options)


def _beside(known: Beside, point: Point, unknowns: Unknowns) -> tuple[FloatArray, FloatArray]:
    """Errors (r,) of what was measured beside the flights, and (r, p) their derivatives."""
    error = known.errors(point.vehicle)
    slopes = np.zeros((len(error), unknowns.size))
    slopes[:, : len(unknowns.model)] = known.slopes(point.vehicle, unknowns.model)
    return error, slopes


def _sums(parts: Sequence[Shown], noise: Coloured) -> _Sums:
    information, gradient = 0.0, 0.0
    for part in parts:
        error, by = noise.white(part.left), noise.white(part.by)
        more = _normal(error.reshape(-1), by.reshape(-1, by.shape[2]))
        mean, slope = part.left[:, FORCE_Z].mean() / BALANCE_M_S2, part.by[:, FORCE_Z].mean(axis=0) / BALANCE_M_S2
        information = information + more[0] + np.outer(slope, slope)
        gradient = gradient + more[1] - slope * mean
    return _Sums(np.asarray(information), np.asarray(gradient))


def _normal(error: FloatArray, by: FloatArray) -> Score:
    """Information and gradient of the cost of errors whose derivative is minus `by`."""
    return by.T @ by, -by.T @ error


def _cost(left_over: Sequence[FloatArray], noise: Coloured, prior: Prior, border: FloatArray) -> float:
    own = sum(float((noise.white(one) ** 2).sum() + (one[:, FORCE_Z].mean() / BALANCE_M_S2) ** 2) for one in left_over)
    return 0.5 * (own + float((((border - prior.mean) / prior.std) ** 2).sum()))


def _take(
    flights: Sequence[Flight],
    point: Point,
    unknowns: Unknowns,
    noise: Coloured,
    prior: Prior,
    known: Beside,
    step: FloatArray,
    before: float,
) -> tuple[Point, float]:
    """The point after the largest share of the step that does not raise the cost, and that share; 0: none does."""
    share = 1.0
    while share > 1e-3:
        there = point.moved(unknowns, share * step, ())
        found = _cost([left(f, there.vehicle, there.sensors) for f in flights], noise, prior, there.shared(unknowns))
        found += 0.5 * float((known.errors(there.vehicle) ** 2).sum())
        if np.isfinite(found) and found <= before * (1.0 + 1e-9):
            return there, share
        share *= 0.5
    return point, 0.0


def _solution(
    flights: Sequence[Flight],
    point: Point,
    unknowns: Unknowns,
    prior: Prior,
    known: Beside,
    order: int,
    record: tuple[Iteration, ...],
    converged: bool,
    options: Options,
) -> Solution:
    """What statistics and reports need of the point where the iterations ended."""
    parts = [shown(f, point.vehicle, unknowns.names, unknowns.model, point.sensors) for f in flights]
    noise = coloured.fitted([part.left for part in parts], order)
    causes = [left_out.with_causes(f, part, point, s) for f, part, s in zip(flights, parts, point.states, strict=True)]
    count = causes[0].by.shape[2] - unknowns.size
    _, beside = _beside(known, point, unknowns)
    balance = np.stack([part.by[:, FORCE_Z].mean(axis=0) / BALANCE_M_S2 for part in causes])
    carried = balance.T @ balance
    carried[count:, count:] += prior.information + beside.T @ beside
    extended = [_scores(f, part, noise, options.block_s) for f, part in zip(flights, causes, strict=True)]
    scores = tuple(tuple((i[count:, count:], g[count:]) for i, g in of_flight) for of_flight in extended)
    levels = _levels(flights, parts)
    residuals = tuple(_residuals(f, part, noise, levels) for f, part in zip(flights, parts, strict=True))
    solution = Solution(
        point=point,
        noise=levels,
        residuals=residuals,
        scores=scores,
        information=tuple(np.sum([one for one, _ in of_flight], axis=0) for of_flight in scores),
        prior_information=carried[count:, count:],
        record=record,
        converged=converged,
    )
    shown_by = np.sum([one for of_flight in extended for one, _ in of_flight], axis=0)
    moved = left_out.moves(solution, carried + shown_by)
    sizes = left_out.possible(solution, extended, carried, len(unknowns.bias) + len(unknowns.delay))
    shifts = [moved @ left_out.root(sizes), _by_late_commands(solution, flights, unknowns)]
    return replace(solution, shifts=np.column_stack(shifts))


def _by_late_commands(solution: Solution, flights: Sequence[Flight], unknowns: Unknowns) -> FloatArray:
    """(p, 1) by how much the other unknowns go with lags that are off by what a command's sample hides."""
    hidden = sampled_commands.variances(flights, unknowns, solution.point.vehicle)
    lags = np.flatnonzero(hidden)
    moved = np.zeros((unknowns.size, 1))
    if len(lags):
        covariance = solution.covariance()
        along = np.linalg.solve(covariance[np.ix_(lags, lags)], np.sqrt(hidden[lags]))
        moved[:, 0] = covariance[:, lags] @ along
        moved[lags] = 0.0  # stated with the lags themselves (`uncertainty.errors`)
    return moved


def block_scores(flights: Sequence[Flight], point: Point, unknowns: Unknowns, block_s: float) -> tuple[Score, ...]:
    """Of each block of time of all flights, with the noise that a vehicle leaves at this point.

    The unknowns may be more than what was fitted: what a candidate would explain shows in its columns.
    """
    parts = [shown(f, point.vehicle, unknowns.names, unknowns.model, point.sensors) for f in flights]
    noise = coloured.fitted([part.left for part in parts], _order(flights))
    return tuple(one for f, part in zip(flights, parts, strict=True) for one in _scores(f, part, noise, block_s))


def concentrated_cost(flights: Sequence[Flight], point: Point) -> float:
    """Negative log-likelihood of the flights with the noise at its best for this point, but for a constant."""
    series = [left(f, point.vehicle, point.sensors) for f in flights]
    order = _order(flights)
    noise = coloured.fitted(series, order)
    return float(np.log(noise.std).sum()) * sum(len(s) - order for s in series)


def _order(flights: Sequence[Flight]) -> int:
    return coloured.order_for(float(np.median(np.concatenate([f.step_s for f in flights]))))


def _scores(flight: Flight, part: Shown, noise: Coloured, block_s: float) -> tuple[Score, ...]:
    """Of each block of time of a flight."""
    error, by = noise.white(part.left), noise.white(part.by)
    time_s = flight.time_s[noise.order : -1]
    edges = np.searchsorted(time_s, np.arange(time_s[0], time_s[-1], block_s))
    return tuple(
        _normal(error[a:b].reshape(-1), by[a:b].reshape(-1, by.shape[2]))
        for a, b in zip(edges, [*edges[1:], len(time_s)], strict=True)
    )


def _levels(flights: Sequence[Flight], parts: Sequence[Shown]) -> Noise:
    """Noise levels as reports tell them: densities of what is left over `SPAN_S`."""
    means = [means_over(part.left, f.time_s[:-1], SPAN_S) for f, part in zip(flights, parts, strict=True)]
    size = np.sqrt((np.concatenate(means) ** 2).mean(axis=0))
    usual = Noise({block.name: np.array(block.usual) for block in BLOCKS if block.usual})
    return usual.with_process(np.sqrt(SPAN_S) * size)


def _residuals(flight: Flight, part: Shown, noise: Coloured, levels: Noise) -> Residuals:
    """Prediction errors, in the rows of the motion's forces and torques; the sensors have none of their own here."""
    k = len(flight) - 1
    between, at_nodes = (acting(flight, levels, between=so) for so in (True, False))
    rows = [sum(len(block.level_of_row) for block in blocks) for blocks in (between, at_nodes)]
    defect, sensor = np.zeros((k, rows[0])), np.zeros((k + 1, rows[1]))
    white = noise.white(part.left)
    for block, place in zip(between, places(between), strict=True):
        if isinstance(block, Motion):
            for c, channel in enumerate(block.channels):
                defect[noise.order :, place.start + channel.rows[0]] = white[:, c]
    return defect, sensor
