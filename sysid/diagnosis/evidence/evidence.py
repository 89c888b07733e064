"""What flights say about every candidate at once: one factorisation per flight, then only small matrices.

At the fitted model each candidate is one or more further columns of the estimator's least-squares problem, and so is
every free-form curve. With the states of the flights eliminated, a stretch of flight b (a block) costs, to second
order in the border's change theta,

    C_b(theta) = C_b + u_b . theta + 1/2 theta . I_b theta

All questions (how much would the cost fall, how large, how sure, what else would do as well) are asked of u_b and I_b.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from flight.rotations import FloatArray
from sysid.diagnosis.evidence import candidates, free_form
from sysid.diagnosis.evidence.candidates import CandidateSet
from sysid.diagnosis.evidence.free_form import Curve
from sysid.estimator.blocks.motion import moved_by_acceleration
from sysid.estimator.blocks.noise import Noise
from sysid.estimator.flights.flight_data import Flight, IndexArray
from sysid.estimator.flights.parallel import each
from sysid.estimator.joint_problem import problem
from sysid.estimator.joint_problem.chain import Factor, eliminate
from sysid.estimator.joint_problem.problem import Point
from sysid.estimator.joint_problem.unknowns import SENSOR_NAMES, Unknowns
from sysid.estimator.motors import motor
from sysid.estimator.trajectory.midpoint import Middle, middle
from sysid.estimator.trajectory.states import States
from vehicle import Vehicle

Moved = Callable[[Flight, Middle, Vehicle], tuple[IndexArray, FloatArray]]
"""Which of the six accelerations columns move along one flight, and (k, r, c) by how much each does."""
BLOCK_S = 3.0
"""Errors (gusts above all) are taken as independent between blocks of this length."""


@dataclass(frozen=True, slots=True)
class Blocks:
    """Second-order cost of each block over a set of columns."""

    score: FloatArray
    """(b, p) u."""
    information: FloatArray
    """(b, p, p) I."""

    def only(self, columns: IndexArray) -> "Blocks":
        """The same for some columns."""
        return Blocks(self.score[:, columns], self.information[:, columns[:, None], columns])

    def masked(self, columns: IndexArray, where: NDArray[np.bool_]) -> "Blocks":
        """The same with some columns zero in some blocks."""
        kept = np.ones(self.score.shape)
        kept[np.ix_(where, columns)] = 0.0
        return Blocks(self.score * kept, self.information * kept[:, :, None] * kept[:, None])


class Evidence:
    """Blocks of a set of flights for the base parameters and all candidates; curves of a channel when asked for."""

    def __init__(
        self, flights: Sequence[Flight], point: Point, noise: Noise, unknowns: Unknowns, candidate_set: CandidateSet
    ) -> None:
        """Linearise where the base model stands (states at their best under it), every candidate at zero."""
        base = candidates.base_names(unknowns.model, candidate_set.vehicle)
        wanted = tuple(name for candidate in candidate_set.candidates for name in candidate.columns)
        extended = replace(
            unknowns,
            model=(*base, *(n for n in wanted if n not in SENSOR_NAMES)),
            sensor=(*unknowns.sensor, *(n for n in wanted if n in SENSOR_NAMES)),
        )
        self._vehicle = candidate_set.vehicle

        def projected(flight: Flight, states: States) -> _Projected:
            return _Projected(flight, replace(point, vehicle=candidate_set.vehicle, states=(states,)), extended, noise)

        self._projected = each(self._vehicle, projected, flights, point.states)
        fitted = [name for name in extended.names if name not in wanted]
        self._order = np.array([extended.names.index(name) for name in (*fitted, *wanted)], dtype=np.intp)
        self._free: dict[tuple[str, ...], Blocks] = {}
        self._masks: list[tuple[IndexArray, NDArray[np.bool_]]] = []
        self.names = (*fitted, *wanted)
        """(n,) of the named columns: base parameters first, then the candidates'."""
        self.base = np.arange(len(fitted), dtype=np.intp)
        """Which of them are the base's."""
        self.curves = free_form.curves(flights, point.states, candidate_set.vehicle)
        parts = [one.blocks() for one in self._projected]
        self.named = _reordered(_joined(parts), self._order)
        self.flight_of_block = np.repeat(np.arange(len(parts)), [len(p.score) for p in parts])
        """(b,)."""

    def place(self, names: Sequence[str]) -> IndexArray:
        """Columns of these names."""
        return np.array([self.names.index(name) for name in names], dtype=np.intp)

    def mask(self, names: Sequence[str], where: NDArray[np.bool_]) -> None:
        """From now on the columns of these names are zero in some blocks (b,): what they stand for was not there."""
        self._masks.append((self.place(names), where))
        self.named = self._masked(self.named)
        self._free = {channels: self._masked(blocks) for channels, blocks in self._free.items()}

    def _masked(self, blocks: Blocks) -> Blocks:
        for columns, where in self._masks:
            blocks = blocks.masked(columns, where)
        return blocks

    def with_curves(self, *channels: str) -> Blocks:
        """Blocks over the named columns followed by the curves of one channel, or of several that share their axes."""
        if channels not in self._free:
            drawn = [(channel, self._of(channel)) for channel in channels]
            parts = each(self._vehicle, lambda one: one.with_curves(drawn), self._projected)
            self._free[channels] = self._masked(_reordered(_joined(parts), self._order))
        return self._free[channels]

    def with_columns(self, moved: Moved) -> Blocks:
        """Blocks over the named columns followed by columns that move accelerations by `moved`."""
        parts = each(self._vehicle, lambda one: one.with_columns(moved), self._projected)
        return self._masked(_reordered(_joined(parts), self._order))

    def groups(self, *channels: str) -> list[tuple[str, str, IndexArray]]:
        """Channel, variable and columns of each family of curves among `with_curves`."""
        drawn = [(channel, curve) for channel in channels for curve in self._of(channel)]
        edges = len(self.names) + np.concatenate([[0], np.cumsum([curve.functions for _, curve in drawn])])
        return [(c, d.variable, np.arange(a, b)) for (c, d), a, b in zip(drawn, edges[:-1], edges[1:], strict=True)]

    def _of(self, channel: str) -> list[Curve]:
        return [c for c in self.curves if free_form.belongs(c.variable, channel)]


def _reordered(blocks: Blocks, order: IndexArray) -> Blocks:
    rest = np.arange(len(order), blocks.score.shape[1])
    return blocks.only(np.concatenate([order, rest]).astype(np.intp))


def _joined(parts: Sequence[Blocks]) -> Blocks:
    return Blocks(np.concatenate([p.score for p in parts]), np.concatenate([p.information for p in parts]))


class _Projected:
    """One flight's rows with its states eliminated."""

    def __init__(self, flight: Flight, point: Point, unknowns: Unknowns, noise: Noise) -> None:
        states = point.states[0]
        self._flight, self._noise = motor.driven(flight, point.vehicle), noise
        self._vehicle = point.vehicle
        rows = problem.linearise(flight, states, point, unknowns, noise, False)
        self._mid = middle(flight, states)
        eliminated = eliminate(rows)
        self._factor = eliminated.factor
        columns = rows.freed(eliminated.sensitivity())
        self._columns = columns[0]
        moved = rows.change(eliminated.states(np.zeros(unknowns.size))[:, :, None], np.zeros((unknowns.size, 1)))
        self._residual = (rows.defect + moved[0][:, :, 0], rows.sensor + moved[1][:, :, 0])
        nothing = (np.zeros((len(part), part.shape[1], 0)) for part in (rows.defect, rows.sensor))
        self._rows = replace(rows, **dict(zip(("defect_border", "sensor_border"), nothing, strict=True)))
        self._edges = block_edges(flight.time_s)
        self._named = self._products(columns)

    def blocks(self) -> Blocks:
        """Of the named columns."""
        return self._named

    def with_curves(self, drawn: Sequence[tuple[str, Sequence[Curve]]]) -> Blocks:
        """Of the named columns and the curves of channels that share their axes."""

        def moved(flight: Flight, mid: Middle, vehicle: Vehicle) -> tuple[IndexArray, FloatArray]:
            parts = [free_form.accelerations(channel, curves, flight, mid, vehicle) for channel, curves in drawn]
            return parts[0][0], np.concatenate([part for _, part in parts], axis=2)

        return self.with_columns(moved)

    def with_columns(self, columns: Moved) -> Blocks:
        """Of the named columns and some that move accelerations."""
        which, moved = columns(self._flight, self._mid, self._vehicle)
        rows, weight = moved_by_acceleration(which, self._flight.step_s, self._noise.process)
        named, moved = self.blocks(), weight[:, :, None] * moved
        products = self._freed_products(rows, moved)
        c, p = moved.shape[2], named.score.shape[1]
        own, cross, score = products[:, :, :c], products[:, :, c : c + p], products[:, :, -1]
        own = 0.5 * (own + np.swapaxes(own, 1, 2))
        information = np.block([[named.information, np.swapaxes(cross, 1, 2)], [cross, own]])
        return Blocks(np.concatenate([named.score, score], axis=1), information)

    def _freed_products(self, which: IndexArray, moved: FloatArray) -> FloatArray:
        """(b, c, c + p + 1) columns (k, r, c) on some rows of the defects, with the states' answer to them taken out,
        times themselves, the named columns, and the residual.

        What is left of any column, the states at their best, is at right angles to all that states can do (J^T f = 0).
        So of the product (a - J x)^T f over a block only a^T f remains, along those rows of each interval, and
        x^T J^T f at the two ends of the block, where J^T f has another part in the block beside.
        """
        rows = self._rows
        before, after = rows.defect_before[:, which], rows.defect_after[:, which]
        answer = _answer(before, after, self._factor, moved)
        freed = moved - before @ answer[:-1] - after @ answer[1:]
        other = np.concatenate([freed, self._columns[:, which], self._residual[0][:, which, None]], axis=2)
        last = np.array([end - 1 for _, end in self._edges[:-1]], dtype=np.intp)
        outward = rows.defect_after[last]
        own = -(rows.defect_before[last] @ answer[last] + outward @ answer[last + 1])
        own[:, which] += moved[last]
        left = np.concatenate([own, self._columns[last], self._residual[0][last, :, None]], axis=2)
        ends = np.swapaxes(outward @ answer[last + 1], 1, 2) @ left
        products = np.stack([_flat(moved[a:b]).T @ _flat(other[a:b]) for a, b in self._edges])
        products[:-1] -= ends
        products[1:] += ends
        return products

    def _products(self, columns: tuple[FloatArray, ...]) -> Blocks:
        """Products of columns (defects and sensor rows) with the residual and with each other."""
        p = columns[0].shape[2]
        score, information = np.zeros((len(self._edges), p)), np.zeros((len(self._edges), p, p))
        for i, (begin, end) in enumerate(self._edges):
            for a, r in zip(columns, self._residual, strict=True):
                flat = a[begin:end].reshape(-1, p)
                score[i] += r[begin:end].ravel() @ flat
                information[i] += flat.T @ flat
        return Blocks(score, information)


def _answer(before: FloatArray, after: FloatArray, factor: Factor, moved: FloatArray) -> FloatArray:
    """(n, s, c) how the best states follow columns (k, r, c) on rows with these derivatives (k, r, s)."""
    right = np.zeros((len(moved) + 1, before.shape[2], moved.shape[2]))
    for i in range(right.shape[1]):
        for j in range(moved.shape[1]):
            right[:-1, i] += before[:, j, i, None] * moved[:, j]
            right[1:, i] += after[:, j, i, None] * moved[:, j]
    return factor.solve_in_place(right)


def _flat(rows: FloatArray) -> FloatArray:
    return rows.reshape(-1, rows.shape[2])


def block_edges(time_s: FloatArray) -> list[tuple[int, int]]:
    """Node ranges of equal length, each about `BLOCK_S`."""
    count = max(1, round((time_s[-1] - time_s[0]) / BLOCK_S))
    edges = np.linspace(0, len(time_s), count + 1).astype(int)
    return list(zip(edges[:-1].tolist(), edges[1:].tolist(), strict=True))
