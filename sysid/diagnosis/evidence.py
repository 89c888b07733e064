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
from sysid.result import CHANNELS
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
            parts = each(self._vehicle, lambda one: one.with_curves(channel, self.curves), self._projected)
            self._free[channel] = _reordered(_joined(parts), self._order)
        return self._free[channel]

    def groups(self, channel: str) -> list[tuple[str, IndexArray]]:
        """Variables of one channel's curves, and their columns among `with_curves`."""
        edges = len(self.names) + np.concatenate([[0], np.cumsum([c.functions for c in self.curves])])
        return [(c.variable, np.arange(a, b)) for c, a, b in zip(self.curves, edges[:-1], edges[1:], strict=True)]


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
        self._drawn: FloatArray | None = None

    def blocks(self) -> Blocks:
        """Of the named columns."""
        return self._named

    def with_curves(self, channel: str, curves: Sequence[Curve]) -> Blocks:
        """Of the named columns and the curves of one channel."""
        if self._drawn is None:
            self._drawn = free_form.columns(curves, self._flight, self._mid)
        named, column = self.blocks(), self._whitened(self._drawn, channel)
        products = self._freed_products(column, _row(channel))
        c, p = column.shape[1], named.score.shape[1]
        own, cross, score = products[:, :, :c], products[:, :, c : c + p], products[:, :, -1]
        own = 0.5 * (own + np.swapaxes(own, 1, 2))
        information = np.block([[named.information, np.swapaxes(cross, 1, 2)], [cross, own]])
        return Blocks(np.concatenate([named.score, score], axis=1), information)

    def _freed_products(self, column: FloatArray, row: int) -> FloatArray:
        """(b, c, c + p + 1) columns that act on one row of each defect, with the states' answer to them taken out,
        times themselves, the named columns, and the residual.

        What is left of any column, the states at their best, is at right angles to all that states can do (J^T f = 0).
        So of the product (a - J x)^T f over a block only a^T f remains, one row per interval, and x^T J^T f at the two
        ends of the block, where J^T f has another part in the block beside.
        """
        rows, answer = self._rows, _answer(self._rows, self._factor, column, row)
        before, after = rows.defect_before[:, row, None], rows.defect_after[:, row, None]
        freed = column[:, None] - before @ answer[:-1] - after @ answer[1:]
        other = np.concatenate([freed[:, 0], self._columns[:, row], self._residual[0][:, row, None]], axis=1)
        last = np.array([end - 1 for _, end in self._edges[:-1]], dtype=np.intp)
        outward = rows.defect_after[last]
        own = -(rows.defect_before[last] @ answer[last] + outward @ answer[last + 1])
        own[:, row] += column[last]
        left = np.concatenate([own, self._columns[last], self._residual[0][last, :, None]], axis=2)
        ends = np.swapaxes(outward @ answer[last + 1], 1, 2) @ left
        products = np.stack([column[begin:end].T @ other[begin:end] for begin, end in self._edges])
        products[:-1] -= ends
        products[1:] += ends
        return products

    def _whitened(self, values: FloatArray, channel: str) -> FloatArray:
        """What a unit of acceleration in one channel adds to that channel's whitened defect."""
        std = self._noise.process[CHANNELS.index(channel)]
        return -2.0 * np.sqrt(self._flight.step_s)[:, None] * values / std

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


def _row(channel: str) -> int:
    """Place of a channel's velocity or rate among the 12 rows of a defect."""
    return (3 if channel[0] == "F" else 9) + "xyz".index(channel[2])


def _answer(rows: Rows, factor: Factor, column: FloatArray, row: int) -> FloatArray:
    """(n, s, c) how the best states follow columns that act on one row of each defect."""
    right = np.zeros((len(rows.sensor), rows.sensor_state.shape[2], column.shape[1]))
    for i in range(right.shape[1]):
        right[:-1, i] = rows.defect_before[:, row, i, None] * column
        right[1:, i] += rows.defect_after[:, row, i, None] * column
    return factor.solve_in_place(right)


def block_edges(time_s: FloatArray) -> list[tuple[int, int]]:
    """Node ranges of equal length, each about `BLOCK_S`."""
    count = max(1, round((time_s[-1] - time_s[0]) / BLOCK_S))
    edges = np.linspace(0, len(time_s), count + 1).astype(int)
    return list(zip(edges[:-1].tolist(), edges[1:].tolist(), strict=True))
