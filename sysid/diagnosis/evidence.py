"""What flights say about every suspect at once: one factorisation per flight, then only small matrices.

At the fitted model each suspect is one or more further columns of the estimator's least-squares problem, and so is
every free-form curve. With the states of the flights eliminated, a stretch of flight b (a block) costs, to second
order in the border's change theta,

    C_b(theta) = C_b + u_b . theta + 1/2 theta . I_b theta

All questions (how far would the cost fall, how large, how sure, what else would do as well) are asked of u_b and I_b.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from flight.rotations import FloatArray
from sysid import drive, dynamics, problem
from sysid.chain import Factor, Rows, eliminate
from sysid.diagnosis import free_form, suspects
from sysid.diagnosis.free_form import Curve
from sysid.diagnosis.suspects import LineUp
from sysid.flight_data import Flight, IndexArray
from sysid.parallel import each
from sysid.problem import Noise, Point, Unknowns
from sysid.sensors import SENSOR_NAMES
from sysid.states import States

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


class Evidence:
    """Blocks of a set of flights for the base parameters and all suspects; curves of a channel when asked for."""

    def __init__(
        self, flights: Sequence[Flight], point: Point, noise: Noise, unknowns: Unknowns, line_up: LineUp
    ) -> None:
        """Linearise where the base model stands (states at their best under it), every suspect at zero."""
        base = suspects.base_names(unknowns.model, line_up.vehicle)
        wanted = tuple(name for suspect in line_up.suspects for name in suspect.parameters)
        extended = replace(
            unknowns,
            model=(*base, *(n for n in wanted if n not in SENSOR_NAMES)),
            sensor=(*unknowns.sensor, *(n for n in wanted if n in SENSOR_NAMES)),
        )
        self._vehicle = line_up.vehicle

        def projected(flight: Flight, states: States) -> _Projected:
            return _Projected(flight, replace(point, vehicle=line_up.vehicle, states=(states,)), extended, noise)

        self._projected = each(self._vehicle, projected, flights, point.states)
        fitted = [name for name in extended.names if name not in wanted]
        self._order = np.array([extended.names.index(name) for name in (*fitted, *wanted)], dtype=np.intp)
        self._free: dict[str, Blocks] = {}
        self.names = (*fitted, *wanted)
        """(n,) of the named columns: base parameters first, then the suspects'."""
        self.base = np.arange(len(fitted), dtype=np.intp)
        """Which of them are the base's."""
        self.curves = free_form.curves(flights, point.states, line_up.vehicle)
        parts = [one.blocks() for one in self._projected]
        self.named = _reordered(_joined(parts), self._order)
        self.flight_of_block = np.repeat(np.arange(len(parts)), [len(p.score) for p in parts])
        """(b,)."""

    def place(self, names: Sequence[str]) -> IndexArray:
        """Columns of these names."""
        return np.array([self.names.index(name) for name in names], dtype=np.intp)

    def with_curves(self, channel: str) -> Blocks:
        """Blocks over the named columns followed by the curves of one channel."""
        if channel not in self._free:
            drawn = self._of(channel)
            parts = each(self._vehicle, lambda one: one.with_curves(channel, drawn), self._projected)
            self._free[channel] = _reordered(_joined(parts), self._order)
        return self._free[channel]

    def groups(self, channel: str) -> list[tuple[str, IndexArray]]:
        """Variables of one channel's curves, and their columns among `with_curves`."""
        drawn = self._of(channel)
        edges = len(self.names) + np.concatenate([[0], np.cumsum([c.functions for c in drawn])])
        return [(c.variable, np.arange(a, b)) for c, a, b in zip(drawn, edges[:-1], edges[1:], strict=True)]

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
        self._flight, self._noise = drive.driven(flight, point.vehicle), noise
        rows = problem.linearise(flight, states, point, unknowns, noise, False)
        self._mid = dynamics.middle(flight, states)
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

    def with_curves(self, channel: str, curves: Sequence[Curve]) -> Blocks:
        """Of the named columns and the curves of one channel."""
        named, column = self.blocks(), free_form.columns(curves, self._flight, self._mid)
        products = self._freed_products(column, channel)
        c, p = column.shape[1], named.score.shape[1]
        own, cross, score = products[:, :, :c], products[:, :, c : c + p], products[:, :, -1]
        own = 0.5 * (own + np.swapaxes(own, 1, 2))
        information = np.block([[named.information, np.swapaxes(cross, 1, 2)], [cross, own]])
        return Blocks(np.concatenate([named.score, score], axis=1), information)

    def _freed_products(self, column: FloatArray, channel: str) -> FloatArray:
        """(b, c, c + p + 1) accelerations in one channel, with the states' answer to them taken out, times themselves,
        the named columns, and the residual.

        What is left of any column, the states at their best, is at right angles to all that states can do (J^T f = 0).
        So of the product (a - J x)^T f over a block only a^T f remains, along the rows of each interval that the
        channel acts on, and x^T J^T f at the two ends of the block, where J^T f has another part in the block beside.
        """
        rows, (which, weight) = self._rows, self._whitened(channel)
        along = _Along(which, weight)
        before, after = along.of(rows.defect_before)[:, None], along.of(rows.defect_after)[:, None]
        answer = _answer(rows, self._factor, column, before[:, 0], after[:, 0])
        freed = along.squared * column - (before @ answer[:-1] + after @ answer[1:])[:, 0]
        other = np.concatenate([freed, along.of(self._columns), along.of(self._residual[0][:, :, None])], axis=1)
        last = np.array([end - 1 for _, end in self._edges[:-1]], dtype=np.intp)
        outward = rows.defect_after[last]
        own = -(rows.defect_before[last] @ answer[last] + outward @ answer[last + 1])
        own[:, which] += weight[last][:, :, None] * column[last][:, None]
        left = np.concatenate([own, self._columns[last], self._residual[0][last, :, None]], axis=2)
        ends = np.swapaxes(outward @ answer[last + 1], 1, 2) @ left
        products = np.stack([column[begin:end].T @ other[begin:end] for begin, end in self._edges])
        products[:-1] -= ends
        products[1:] += ends
        return products

    def _whitened(self, channel: str) -> tuple[slice, FloatArray]:
        """Rows of each defect that a unit of acceleration in one channel moves, and (k, r) by how much, whitened."""
        which, share = free_form.along_axes(channel, self._mid)
        rows = slice(3 + which.start, 3 + which.stop) if which.start < 3 else slice(6 + which.start, 6 + which.stop)
        return rows, -2.0 * np.sqrt(self._flight.step_s)[:, None] * share / self._noise.process[which]

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


@dataclass(frozen=True, slots=True)
class _Along:
    """Rows of a defect taken together, as a channel acts on them."""

    rows: slice
    """Of the 12: velocity 3 to 5, rate 9 to 11."""
    weight: FloatArray
    """(k, r)."""

    def of(self, defects: FloatArray) -> FloatArray:
        """(k, m) from (k, 12, m)."""
        return np.einsum("kr,krm->km", self.weight, defects[:, self.rows])

    @property
    def squared(self) -> FloatArray:
        """(k, 1)."""
        return (self.weight**2).sum(axis=1, keepdims=True)


def _answer(rows: Rows, factor: Factor, column: FloatArray, before: FloatArray, after: FloatArray) -> FloatArray:
    """(n, s, c) how the best states follow columns (k, c) that act on rows (k, s) of the states before and after."""
    right = np.zeros((len(rows.sensor), rows.sensor_state.shape[2], column.shape[1]))
    for i in range(right.shape[1]):
        right[:-1, i] = before[:, i, None] * column
        right[1:, i] += after[:, i, None] * column
    return factor.solve_in_place(right)


def block_edges(time_s: FloatArray) -> list[tuple[int, int]]:
    """Node ranges of equal length, each about `BLOCK_S`."""
    count = max(1, round((time_s[-1] - time_s[0]) / BLOCK_S))
    edges = np.linspace(0, len(time_s), count + 1).astype(int)
    return list(zip(edges[:-1].tolist(), edges[1:].tolist(), strict=True))
