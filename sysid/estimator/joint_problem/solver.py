"""Gauss-Newton on the joint problem: eliminate the states, step the parameters, re-estimate the noise, repeat."""

import logging
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from flight import InputError, Progress
from flight.rotations import FloatArray
from sysid.estimator.blocks.catalogue import BLOCKS, acting, places
from sysid.estimator.blocks.noise import Noise
from sysid.estimator.flights.clocks import LONGEST_STEP_S
from sysid.estimator.flights.flight_data import Flight
from sysid.estimator.flights.parallel import each
from sysid.estimator.joint_problem import weight
from sysid.estimator.joint_problem.chain import Eliminated, Rows, eliminate
from sysid.estimator.joint_problem.problem import Point, Residuals, cost_of, curvature_of, linearise, residuals_of
from sysid.estimator.joint_problem.unknowns import Unknowns
from sysid.estimator.options import Options
from sysid.estimator.trajectory.states import States
from vehicle import specs

logger = logging.getLogger(__name__)

CONVERGED_SIGMA = 0.05
"""Stop when no parameter moves by more than this part of its standard error.

Delays of streams do not count beside others: one that the flights hardly show creeps, and nothing else follows it."""
CONVERGED_NOISE = 0.05
"""... and no noise level changes by more than this share."""


@dataclass(frozen=True, slots=True)
class Iteration:
    """One line of the convergence record."""

    cost: float
    """Half the sum of squares before the step."""
    step_sigma: float
    """Largest step of a parameter in standard errors; of delays only where nothing else is estimated."""
    damping: float
    """Share of the Gauss-Newton step that was taken."""
    values: tuple[float, ...]
    """Parameters after the step."""
    noise_change: float
    """Largest relative change of a noise level after the step."""


Score = tuple[FloatArray, FloatArray]
"""Information (p, p) of a stretch of time and its pull on the parameters (p,), the states eliminated."""


@dataclass(frozen=True, slots=True)
class Solution:
    """The converged problem, ready for statistics."""

    point: Point
    noise: Noise
    residuals: tuple[Residuals, ...]
    """Per flight, at the solution."""
    scores: tuple[tuple[Score, ...], ...]
    """Of the blocks of each flight."""
    information: tuple[FloatArray, ...]
    """Per flight (p, p): information on the parameters with the states eliminated."""
    prior_information: FloatArray
    """(p, p) of the prior; the weight balance is a bound, and no measurement."""
    record: tuple[Iteration, ...]
    converged: bool
    shifts: FloatArray | None = None
    """(p, causes) by how much causes of usual size that are not in the model may have moved the parameters."""

    @property
    def hessian(self) -> FloatArray:
        """(p, p) information of all flights and the prior."""
        return self.prior_information + np.sum(self.information, axis=0)

    def covariance(self) -> FloatArray:
        """(p, p) of the parameters, from the likelihood's curvature alone."""
        return covariance_of(self.hessian)


@dataclass(frozen=True, slots=True)
class Prior:
    """A Gaussian prior on the border; infinite standard deviation where nothing is known."""

    mean: FloatArray
    std: FloatArray

    @property
    def information(self) -> FloatArray:
        return np.diag(1.0 / self.std**2)


def solve(
    flights: list[Flight],
    point: Point,
    noise: Noise,
    unknowns: Unknowns,
    prior: Prior,
    options: Options,
    progress: Progress,
) -> Solution:
    """Iterate to the joint maximum of the likelihood over states, parameters and noise levels.

    Args:
        options: robust loss, most steps, length of the blocks whose scores the solution has.
    """
    record: list[Iteration] = []
    converged = False
    while not converged and len(record) < options.max_iterations:
        parts = linearised(flights, point, unknowns, noise, options.robust)
        border = point.shared(unknowns)
        carried = weight.balance(flights, point, unknowns, noise)
        hessian = prior.information + carried.information + sum(p.eliminated.information for p in parts)
        pulls = sum(p.eliminated.gradient for p in parts)
        gradient = prior.information @ (border - prior.mean) + carried.gradient + pulls
        # For the step alone: with it, at the optimum, errors of delays in gusts change by 5 %, others by 1 %.
        left_out = np.diag(np.maximum(sum(p.curvature for p in parts), 0.0))
        step = parameter_step(hessian + left_out, gradient, step_room(point, unknowns))
        sigma = np.sqrt(np.diag(covariance_of(hessian)))
        judged = slice(unknowns.size - len(unknowns.delay) if unknowns.model else None)
        changes = [p.eliminated.states(step) for p in parts]
        rows_left, before = [p.rows_left for p in parts], sum(p.cost for p in parts)
        del parts  # they are large, and the next ones are made before this name is given anew
        lowered = _take(flights, point, unknowns, noise, prior, step, changes, options.robust, before)
        if lowered is None and not record:
            raise InputError(
                "the fit does not get better in any direction; the start values may be of another vehicle, "
                "or the rotor order, spin or units of the log may be wrong"
            )
        if lowered is None:
            break  # some parameter that hardly shows has gone where slopes say nothing; the caller may hold it
        point, taken, found = lowered
        old, noise = noise, _updated_noise(flights, found, rows_left, noise)
        record.append(
            Iteration(
                cost=before,
                step_sigma=float(np.max(np.abs(step / sigma)[judged], initial=0.0)),
                damping=taken,
                values=tuple(point.shared(unknowns)),
                noise_change=_relative_change(old, noise),
            )
        )
        converged = _settled(record, unknowns)
        progress("identify", min(0.95, len(record) / 12.0))
        last = record[-1]
        logger.info("iteration %d: cost %.6g, step %.3g sigma", len(record), last.cost, last.step_sigma)
        logger.debug("values %s, noise %s", dict(zip(unknowns.names, last.values, strict=True)), noise)
    return _solution(flights, point, noise, unknowns, prior, tuple(record), converged, options)


def _settled(record: Sequence[Iteration], unknowns: Unknowns) -> bool:
    """Whether the last step was small, and so was what it changed the noise by.

    A noise level without influence on the parameters may creep for long; two small steps in a row are enough.
    """
    still = [i.step_sigma < CONVERGED_SIGMA and i.damping > 0.99 for i in record[-2:]]
    crept = bool(unknowns.model) and still == [True, True]
    return still[-1] and (record[-1].noise_change < CONVERGED_NOISE or crept)


@dataclass(frozen=True, slots=True, eq=False)
class Part:
    """What one flight says at a point. Its linearised rows, which are large, go once its states are eliminated."""

    residuals: Residuals
    eliminated: Eliminated
    rows_left: dict[str, FloatArray]
    """(levels,) of each block: rows that are left to judge the level by, the states having taken their share."""
    curvature: FloatArray
    """(p,) of the cost beyond what Gauss-Newton takes it for."""

    @property
    def cost(self) -> float:
        """Half the sum of squares."""
        return cost_of(self.residuals)


def linearised(
    flights: Sequence[Flight], point: Point, unknowns: Unknowns, noise: Noise, robust: bool = False
) -> list[Part]:
    """What each flight says of the parameters at a point."""

    def one(flight: Flight, states: States) -> Part:
        rows = linearise(flight, states, point, unknowns, noise, robust)
        eliminated = eliminate(rows)
        defect_leverage, sensor_leverage = eliminated.factor.leverage(rows)
        measured = (rows.sensor_state != 0.0).any(axis=2)
        left = (1.0 - defect_leverage).sum(axis=0), (measured * (1.0 - sensor_leverage)).sum(axis=0)
        curvature = curvature_of(flight, states, point, unknowns, noise)
        return Part((rows.defect, rows.sensor), eliminated, _by_level(flight, noise, left), curvature)

    return each(point.vehicle, one, flights, point.states)


def _solution(
    flights: list[Flight],
    point: Point,
    noise: Noise,
    unknowns: Unknowns,
    prior: Prior,
    record: tuple[Iteration, ...],
    converged: bool,
    options: Options,
) -> Solution:
    """What statistics need of the point where the iterations ended."""

    def one(flight: Flight, states: States) -> tuple[Residuals, tuple[Score, ...], FloatArray]:
        rows = linearise(flight, states, point, unknowns, noise, options.robust)
        eliminated = eliminate(rows)
        scores = _block_scores(rows, eliminated.sensitivity(), flight.time_s, options.block_s)
        return (rows.defect, rows.sensor), scores, eliminated.information

    residuals, scores, information = zip(*each(point.vehicle, one, flights, point.states), strict=True)
    return Solution(
        point=point,
        noise=noise,
        residuals=residuals,
        scores=scores,
        information=information,
        prior_information=prior.information,
        record=record,
        converged=converged,
    )


def all_residuals(flights: Sequence[Flight], point: Point, noise: Noise, robust: bool = False) -> list[Residuals]:
    """Of each flight, without derivatives."""

    def one(flight: Flight, states: States) -> Residuals:
        return residuals_of(flight, states, point, noise, robust)

    return each(point.vehicle, one, flights, point.states)


def parameter_step(hessian: FloatArray, gradient: FloatArray, room: tuple[FloatArray, FloatArray]) -> FloatArray:
    """Newton step (p,) that stays within `room` (lowest and highest step).

    A parameter that would leave its bounds goes to the bound, and the others are solved for again with it there.
    """
    step, stopped = np.zeros(len(gradient)), np.zeros(len(gradient), dtype=bool)
    while True:
        left = ~stopped
        pull = gradient[left] + hessian[np.ix_(left, stopped)] @ step[stopped]
        step[left] = -_solve_scaled(hessian[np.ix_(left, left)], pull)
        beyond = left & ((step < room[0]) | (step > room[1]))
        if not beyond.any():
            return step
        step = np.where(beyond, np.clip(step, *room), step)
        stopped |= beyond


def _solve_scaled(hessian: FloatArray, right: FloatArray) -> FloatArray:
    """Directions that carry no information at all (below 1e-12 of the scaled matrix) are left where they are."""
    scale = np.sqrt(np.maximum(np.diag(hessian), 1e-300))
    values, vectors = np.linalg.eigh(hessian / np.outer(scale, scale))
    inverse = np.where(values > 1e-12, 1.0 / np.maximum(values, 1e-12), 0.0)
    return (vectors @ (inverse * (vectors.T @ (right / scale)))) / scale


def covariance_of(hessian: FloatArray) -> FloatArray:
    """Inverse of an information matrix with rows of any size; what is unknown comes out huge, not infinite."""
    scale = np.sqrt(np.maximum(np.diag(hessian), 1e-200))
    values, vectors = np.linalg.eigh(hessian / np.outer(scale, scale))
    return (vectors / np.maximum(values, 1e-24)) @ vectors.T / np.outer(scale, scale)


def step_room(point: Point, unknowns: Unknowns) -> tuple[FloatArray, FloatArray]:
    """How far each parameter may step down and up; inertias and time constants at most to a third or threefold, delays
    no further than slopes tell."""
    bounds = specs(point.vehicle)
    low, high = np.full(unknowns.size, -np.inf), np.full(unknowns.size, np.inf)
    for i, name in enumerate(unknowns.model):
        value = point.value(name)
        low[i], high[i] = bounds[name].bounds[0] - value, bounds[name].bounds[1] - value
        if name.startswith(("inertia_", "motor_lag.")):
            low[i], high[i] = max(low[i], -2.0 / 3.0 * value), min(high[i], 2.0 * value)
    delays = [i for i, name in enumerate(unknowns.names) if name in unknowns.delay]
    low[delays], high[delays] = -LONGEST_STEP_S, LONGEST_STEP_S
    return low, high


def _take(
    flights: list[Flight],
    point: Point,
    unknowns: Unknowns,
    noise: Noise,
    prior: Prior,
    step: FloatArray,
    changes: list[FloatArray],
    robust: bool,
    before: float,
) -> tuple[Point, float, list[Residuals]] | None:
    """The point after the largest share of the step that lowers the cost, that share, and the residuals there.

    None where no share of it does.
    """

    def beside(candidate: Point) -> float:
        border = candidate.shared(unknowns)
        return weight.cost(flights, candidate, unknowns) + 0.5 * float((((border - prior.mean) / prior.std) ** 2).sum())

    # a step may cost as much more as the weight balance does, whose slopes leave out what the states do to it
    start = before + beside(point) + weight.cost(flights, point, unknowns)
    share = 1.0
    while share > 1e-3:
        candidate = point.moved(unknowns, share * step, [share * c for c in changes])
        found = all_residuals(flights, candidate, noise, robust)
        after = beside(candidate) + sum(map(cost_of, found))
        # rounding of sums over 1e5 rows is allowed for; at the optimum the cost no longer falls
        if np.isfinite(after) and after <= start * (1.0 + 1e-6) + 1e-3:
            return candidate, share, found
        share *= 0.5
    return None


def _updated_noise(
    flights: Sequence[Flight],
    found: Sequence[Residuals],
    rows_left: Sequence[dict[str, FloatArray]],
    noise: Noise,
) -> Noise:
    """Noise levels that match the residuals: squares over the rows left after the states took their share."""
    squares = [
        _by_level(flight, noise, ((defect**2).sum(axis=0), (sensor**2).sum(axis=0)))
        for flight, (defect, sensor) in zip(flights, found, strict=True)
    ]
    levels = {}
    for block in (b for b in BLOCKS if b.name in noise.levels):
        zero = np.zeros(len(block.levels))
        total, left = (sum((one.get(block.name, zero) for one in all_), zero) for all_ in (squares, rows_left))
        ratio = np.where(left > 1.0, np.sqrt(np.clip(total / np.maximum(left, 1.0), 0.01, 100.0)), 1.0)
        levels[block.name] = block.updated(noise.levels[block.name], ratio, flights)
    return replace(noise, levels=levels)


def _by_level(flight: Flight, noise: Noise, of_rows: tuple[FloatArray, FloatArray]) -> dict[str, FloatArray]:
    """Sums (levels,) of each block from those of the rows, (d,) between nodes and (m,) at nodes."""
    found = {}
    for between, sums in zip((True, False), of_rows, strict=True):
        blocks = acting(flight, noise, between=between)
        for block, place in zip(blocks, places(blocks), strict=True):
            if block.levels:
                found[block.name] = np.bincount(block.level_of_row, sums[place], len(block.levels))
    return found


def _relative_change(old: Noise, new: Noise) -> float:
    return max(float(np.abs(new.levels[name] / level - 1.0).max()) for name, level in old.levels.items())


def robust_covariance(solution: Solution, own: int = 0) -> tuple[FloatArray, FloatArray]:
    """(p, p) sandwich covariance: errors may be correlated within blocks, and forms slightly wrong.

    What is wrong for as long as a whole flight (a manoeuvre the form fits badly, a controller that answers gusts)
    shows in no block, only between flights. So variances are a mean of what blocks say and what whole flights say; both
    are right for a right model. Flights count for a half where three or more show a parameter in effect, for less
    where fewer do, and not at all where one does: it has none to disagree with. The second result (p,) is how many
    blocks each variance rests on in effect
    (Satterthwaite): a drag that shows in a dozen fast blocks has errors known no better than from a dozen samples.

    Args:
        own: how many of the parameters, the last ones, belong to single logs (biases, delays).
    """
    bread = solution.covariance()
    blocks, freedom = _sandwich([one for flight in solution.scores for one in flight], bread)
    shared = len(bread) - own
    if len(solution.scores) == 1 or shared == 0:
        return blocks, freedom
    own_prior = solution.prior_information[shared:, shared:]
    whole = [_own_taken_out(*_summed(flight), own_prior) for flight in solution.scores]
    flights, shown_by = _sandwich(whole, bread[:shared, :shared])
    more = np.diag(flights) / np.maximum(np.diag(blocks)[:shared], 1e-300)
    weight = np.minimum(0.5, 0.25 * (shown_by - 1.0))
    scale = np.ones(len(bread))
    scale[:shared] = np.sqrt(1.0 + weight * (more - 1.0))
    return blocks * np.outer(scale, scale), freedom


def _summed(scores: Sequence[Score]) -> Score:
    """Of several stretches of time together."""
    information, pulls = zip(*scores, strict=True)
    return np.sum(information, axis=0), np.sum(pulls, axis=0)


def _own_taken_out(information: FloatArray, pull: FloatArray, prior: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Information and pull of one flight on the shared parameters, its own ones (q, the last) at their best."""
    s = len(pull) - len(prior)
    if len(prior) == 0:
        return information, pull
    taken = np.linalg.solve(information[s:, s:] + prior, np.column_stack([information[s:, :s], pull[s:]]))
    cross = information[:s, s:]
    return information[:s, :s] - cross @ taken[:, :-1], pull[:s] - cross @ taken[:, -1]


def _sandwich(scores: list[tuple[FloatArray, FloatArray]], bread: FloatArray) -> tuple[FloatArray, FloatArray]:
    """(p, p) covariance from the scatter of blocks, and (p,) how many it rests on in effect.

    Each block's score is freed of the block's own pull on the estimate (jackknife, CR3), or few blocks that fit
    themselves would look too good.
    """
    sigma = np.sqrt(np.diag(bread))  # in units of these all numbers are near one: least squares drops what is tiny
    bread = bread / np.outer(sigma, sigma)
    pulls: list[FloatArray] = []
    shares: list[FloatArray] = []
    for information, pull in scores:
        information, pull = information * np.outer(sigma, sigma), pull * sigma
        score = np.linalg.lstsq(np.eye(len(pull)) - information @ bread, pull)[0]
        shares.append(np.einsum("ip,ij,jp->p", bread, information, bread))
        pulls.append(bread @ score)
    blocks, moved = len(scores), np.array(pulls)  # no variance of such squares is below zero, however rounded
    freedom = np.sum(shares, axis=0) ** 2 / np.maximum(np.sum(np.square(shares), axis=0), 1e-300)
    covariance = moved.T @ moved * ((blocks - 1) / blocks) * np.outer(sigma, sigma)
    return covariance, np.maximum(freedom, 1.0)


def _block_scores(rows: Rows, sensitivity: FloatArray, time_s: FloatArray, block_s: float) -> tuple[Score, ...]:
    """Of each block of a flight, from its linearised rows."""
    p = sensitivity.shape[2]
    defect, sensor = rows.freed(sensitivity)
    edges = np.searchsorted(time_s, np.arange(time_s[0], time_s[-1], block_s))
    found = []
    for begin, end in zip(edges, [*edges[1:], len(time_s)], strict=True):
        residual = np.concatenate([rows.defect[begin:end].ravel(), rows.sensor[begin:end].ravel()])
        columns = np.concatenate([defect[begin:end].ravel(), sensor[begin:end].ravel()]).reshape(len(residual), p)
        found.append((columns.T @ columns, columns.T @ residual))
    return tuple(found)
