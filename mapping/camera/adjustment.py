"""Bundle adjustment in closed form: poses and points are eliminated, and a quadratic in the calibration remains.

The reprojection errors are linearised in poses, points and every error that the calibration may have; points and poses
are eliminated from the normal equations (Schur complement; Triggs et al., "Bundle adjustment - a modern synthesis",
2000). Any set of errors is then estimated, with its covariance, by one solve with a few unknowns.
"""

import dataclasses
import functools
import operator
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from flight import FloatArray, frames, rotations
from mapping.camera import errors
from mapping.camera.errors import PLAUSIBLE, Candidate, State
from mapping.camera.normal_equations import Points, Pull, Reduced, Rows, Shifts, Sums, cells, eliminate_points, robust
from mapping.camera.rig import Rig

if TYPE_CHECKING:
    from scipy import sparse as sp

FOLDS = 5
"""Groups of points; each is judged with what the others say."""
LONGEST_STEP_S = 0.6
"""Neighbouring images further apart do not give the velocity between them."""

_MOST_ITERATIONS = 15
_SHARES = (1.0, 0.5, 0.25, 0.125, 0.0625)
"""Of a step, tried in this order."""
_CONVERGED = 0.005
_LOST_PX = 100.0
"""Residual of a point that the lens no longer shows."""
_BLOCK_ROWS = 100_000
"""Observations whose derivatives are held in memory at a time."""
_LEAST_REDUNDANCY = 0.05
_UNEVEN = 0.3
"""Standard deviation of an image's velocity, relative, where a clock counts images: nobody says that they are even."""
_LEAST_PACE = 0.1
_MOST_GROUPS = 100
"""Of images whose shared errors are carried to the positions apart."""


@dataclass(frozen=True, slots=True, eq=False)
class Observations:
    """A map, and the features in the images that it explains."""

    rig: Rig
    """The calibration on trial."""
    T_world_body: FloatArray
    """(instants, 4, 4); NaN where not placed."""
    points_world: FloatArray
    """(m, 3)."""
    index: np.ndarray
    """(o, 3) int: point, instant, camera."""
    pixels: FloatArray
    """(o, 2)."""
    time_s: FloatArray
    """(instants,); NaN where unknown."""
    is_counted: bool = False
    """Whether the clock counts images, see `counted`."""


def initial(seen: Observations) -> State:
    """The map as it was made, with the calibration on trial."""
    none = np.zeros(len(seen.rig))
    pace = np.ones(len(seen.time_s)) if seen.is_counted else None
    return State(seen.rig, seen.T_world_body, seen.points_world, np.zeros((len(seen.rig), 2)), none, none, pace)


def counted(seen: Observations) -> Observations:
    """The same with a clock that counts images, in their order: for those whose times are unknown or far apart.

    They are taken to be evenly spaced, within `_UNEVEN`, unless their times say how they are spaced.
    """
    known = np.isfinite(seen.time_s)
    steps_s = np.diff(np.sort(seen.time_s[known]))
    if known.all() and (steps_s > 0.0).any():
        time_s = seen.time_s * errors.INTERVAL_S / np.median(steps_s[steps_s > 0.0])
    else:
        time_s = errors.INTERVAL_S * np.arange(len(seen.time_s))
    return dataclasses.replace(seen, time_s=time_s, is_counted=True)


def adjust(seen: Observations, state: State, free: Sequence[Candidate]) -> tuple[State, dict[Candidate, FloatArray]]:
    """Gauss-Newton with poses, points and the errors in `free`; returns how far those moved.

    A step that does not lower the cost is halved: a lens that is wrong by a tenth is far from linear.
    """
    moved = {c: np.zeros(len(c.kind.units)) for c in free}
    for _ in range(_MOST_ITERATIONS):
        normal = Normal(seen, state, free, folds=1)
        delta, _ = normal.solve(free)
        before = robust_cost(seen, state, normal.huber_px)
        for share in _SHARES:
            changed = normal.step(state, free, share * delta, share)
            if (after := robust_cost(seen, changed, normal.huber_px)) < before:
                break
        else:
            break
        state = changed
        moved = {c: moved[c] + share * delta[normal.place(free, c)] for c in free}
        if after > (1.0 - _CONVERGED) * before:
            break
    return state, moved


def cost(seen: Observations, state: State) -> float:
    """How badly a state fits: the median residual, px."""
    return float(np.median(np.nan_to_num(np.linalg.norm(residuals(seen, state), axis=1), nan=_LOST_PX)))


def robust_cost(seen: Observations, state: State, huber_px: float) -> float:
    """Mean of Huber's cost of the residuals; a point that the lens no longer shows counts as far off."""
    length = np.nan_to_num(np.linalg.norm(residuals(seen, state), axis=1), nan=_LOST_PX)
    return float(np.where(length < huber_px, 0.5 * length**2, huber_px * (length - 0.5 * huber_px)).mean())


class Normal:
    """The normal equations at one state, points and poses eliminated, apart for each fold of points.

    `noise_px` is the standard deviation of a match in each coordinate; a guess unless `is_redundant`: without spare
    matches the unknowns explain any noise. Residuals longer than `huber_px` count linearly.

    What couples the poses stays sparse, and the rows of the observations exist for one block of points at a time:
    memory and time grow with the observations, not with the square of the instants.
    """

    def __init__(
        self,
        seen: Observations,
        state: State,
        tried: Sequence[Candidate],
        *,
        folds: int = FOLDS,
        pull: Pull | None = None,
    ) -> None:
        self.tried, self._pull = list(tried), pull
        self._placed = np.flatnonzero(np.isfinite(state.T_world_body[:, 0, 0]))
        self._pace = None if state.pace is None else state.pace[self._placed]
        self._width = 6 if self._pace is None else 7
        left = residuals(seen, state)
        used = np.flatnonzero(np.isfinite(left).all(axis=1))
        self._matched = np.isin(self._placed, seen.index[used, 1])
        unknowns = 3 * len(np.unique(seen.index[used, 0])) + 6 * len(self._placed)
        redundancy = max(1.0 - unknowns / (2 * len(used)), _LEAST_REDUNDANCY)
        self.is_redundant = redundancy > _LEAST_REDUNDANCY
        self.noise_px, self.huber_px, weight = robust(left[used], redundancy)
        whitening = np.zeros(len(left))
        whitening[used] = np.sqrt(weight) / self.noise_px
        shifts = Shifts(self.tried, seen.rig)
        cell = cells(seen.index[:, 2], seen.pixels, np.array([(c.width, c.height) for c in seen.rig]))
        count = folds * max(1, round(len(left) / (folds * _BLOCK_ROWS)))
        self._points: list[Points] = []

        def block(number: int) -> Sums:
            own = np.flatnonzero(seen.index[:, 0] % count == number)
            part = dataclasses.replace(seen, index=seen.index[own], pixels=seen.pixels[own])
            rows = linearise(part, state, tried)
            shifts.add(rows, part.index[rows.used, 2])
            numbers = np.arange(number, len(seen.points_world), count)
            index, of_rig = part.index[rows.used], (len(seen.T_world_body), len(seen.rig))
            weights, where = whitening[own][rows.used], cell[own][rows.used]
            points, sums = eliminate_points(rows, index, numbers, self._placed, weights, of_rig, where)
            if folds == 1:  # with folds there is no `step`; for a thousand instants these take most of the memory
                self._points.append(points)
            return sums

        by_fold = [functools.reduce(operator.add, map(block, range(fold, count, folds))) for fold in range(folds)]
        self._rms = shifts.mean()
        whole = functools.reduce(operator.add, by_fold)
        self._reduced = self._reduce(whole.matrix, whole.gradient)
        # residuals are smaller than the errors that made them, as the unknowns were fitted to these
        self._scores = [by_group / np.sqrt(redundancy) for by_group in (whole.scores, whole.fields)]
        if folds > 1:
            parts = [(part.matrix, part.gradient) for part in by_fold]
            self._withheld = [self._reduce(m, g).marginal for m, g in parts]
            self._training = [self._reduce(whole.matrix - m, whole.gradient - g).marginal for m, g in parts]

    def _reduce(self, matrix: "sp.csr_matrix", gradient: FloatArray) -> "Reduced":
        from scipy import sparse as sp

        count = self._width * len(self._placed)
        if self._pace is not None:  # held by what is plausible: it shows only beside an error of time
            even, pull = np.zeros(len(gradient)), np.zeros(len(gradient))
            even[6:count:7], pull[6:count:7] = _UNEVEN**-2, (1.0 - self._pace) / _UNEVEN**2
            matrix, gradient = matrix + sp.diags(even, format="csr"), gradient + pull
        if (held := self._pull) is not None:
            weight, pull = np.zeros(len(gradient)), np.zeros(len(gradient))
            weight[:count].reshape(-1, self._width)[:, :6] = held.weight
            pull[:count].reshape(-1, self._width)[:, :6] = -held.weight * held.off
            matrix, gradient = matrix + sp.diags(weight, format="csr"), gradient + pull
        return Reduced.of(matrix, gradient, count)

    def _unknowns(self, chosen: Iterable[Candidate]) -> np.ndarray:
        starts = np.cumsum([0, *(len(c.kind.units) for c in self.tried)])
        where = [np.arange(starts[k], starts[k + 1]) for k in (self.tried.index(c) for c in chosen)]
        return np.concatenate(where) if where else np.zeros(0, dtype=np.int64)

    def place(self, chosen: Sequence[Candidate], candidate: Candidate) -> slice:
        """Where the parameters of one candidate stand in the solution of `solve(chosen)`."""
        start = sum(len(c.kind.units) for c in chosen[: chosen.index(candidate)])
        return slice(start, start + len(candidate.kind.units))

    def solve(self, chosen: Sequence[Candidate]) -> tuple[FloatArray, FloatArray]:
        """Estimate and covariance of the chosen candidates, all points used."""
        matrix, gradient = self._reduced.marginal.matrix, self._reduced.marginal.gradient
        k = self._unknowns(chosen)
        covariance: FloatArray = np.asarray(np.linalg.inv(matrix[np.ix_(k, k)] + self._prior(chosen)), dtype=np.float64)
        return covariance @ gradient[k], covariance

    def gain(self, chosen: Sequence[Candidate], given: dict[Candidate, FloatArray]) -> float:
        """Fall of the withheld points' chi squared, summed over the folds.

        Args:
            chosen: the candidates that are estimated, each fold from the other folds' points.
            given: steps of other candidates.
        """
        k, g = self._unknowns(chosen), self._unknowns(given)
        both, step = np.concatenate([k, g]), np.concatenate([*given.values(), np.zeros(0)])
        total = 0.0
        for training, held in zip(self._training, self._withheld, strict=True):
            pull = training.gradient[k] - training.matrix[np.ix_(k, g)] @ step
            curvature = training.matrix[np.ix_(k, k)] + self._prior(chosen)
            delta = np.concatenate([np.linalg.solve(curvature, pull), step])
            total += float(2.0 * held.gradient[both] @ delta - delta @ held.matrix[np.ix_(both, both)] @ delta)
        return total

    def _prior(self, chosen: Sequence[Candidate]) -> FloatArray:
        """Curvature of what is plausible: it decides only where the matches say next to nothing."""
        return np.diag([1.0 / PLAUSIBLE[c.kind] ** 2 for c in chosen for _ in c.kind.units])

    def shift_px(self, candidate: Candidate, size: FloatArray) -> float:
        """RMS over the camera's observations of how far an error moves the image."""
        return float(np.sqrt(size @ self._rms[candidate] @ size))

    def spread_px(self, candidate: Candidate, covariance: FloatArray) -> float:
        """Standard deviation of that shift, in the direction in which it is largest."""
        return float(np.sqrt(max(np.linalg.eigvals(self._rms[candidate] @ covariance).real.max(), 0.0)))

    def dispersion(self, chosen: Sequence[Candidate], candidate: Candidate) -> float:
        """How many times larger the variance of one of the chosen is than independent matches make it; at least 1.

        Two kinds of shared errors make it larger, as the residuals show them (cluster-robust in two ways; Cameron,
        Gelbach and Miller, 2011). Those of all matches of one image: many times where the vehicle turns to and fro
        between its images, so that their velocities under a time offset are wrong. And those of all matches in one cell
        of a camera's image: a corridor shows its walls there at one angle in all images, and no number of images
        averages that out. Of several parameters, in the direction in which it is most.
        """
        k, own = self._unknowns(chosen), self.place(chosen, candidate)
        _, covariance = self.solve(chosen)
        more = 0.0
        for scores in self._scores:
            by_group = covariance[own] @ self._of_calibration(scores)[k]
            ratio = np.linalg.solve(covariance[own, own], by_group @ by_group.T)
            more += max(0.0, float(np.linalg.eigvals(ratio).real.max()) - 1.0)
        return 1.0 + more

    def _of_calibration(self, scores: "sp.csr_matrix") -> FloatArray:
        """(p, groups): the gradient in the calibration, poses eliminated, apart for the matches of each group."""
        split = len(self._reduced.poses)
        by_poses = scores[:split].T @ self._reduced.poses_by_calibration
        return np.asarray(scores[split:].toarray() - by_poses.T, dtype=np.float64)

    def scale_std(self, state: State, free: Sequence[Candidate]) -> float:
        """Standard deviation of the path's size, relative to it: how firmly the baseline of the rig sets the scale.

        Of independent matches, and of errors that matches share (see `dispersion`).
        """
        if len(state.rig) == 1:
            return float("inf")
        T = state.T_world_body[self._placed]
        growth = np.zeros((len(self._placed), self._width))
        outward = T[:, :3, 3] - T[:, :3, 3].mean(axis=0)
        growth[:, 3:6] = np.einsum("nji,nj->ni", T[:, :3, :3], outward)
        if not growth.any():
            return float("inf")
        growth = growth.ravel() / (growth**2).sum()
        k = self._unknowns(free)
        by_pose = self._reduced.factor.solve(growth)
        through = growth @ self._reduced.poses_by_calibration[:, k]
        by_calibration = np.linalg.solve(self._reduced.marginal.matrix[np.ix_(k, k)] + self._prior(free), through)
        alone = float(growth @ by_pose + through @ by_calibration)
        shared = [s[: len(growth)].T @ by_pose - self._of_calibration(s)[k].T @ by_calibration for s in self._scores]
        return float(np.sqrt(alone + sum(max(0.0, float(by_group @ by_group) - alone) for by_group in shared)))

    def shape_std(self, state: State) -> FloatArray:
        """(instants,) standard deviation of the positions but for place, attitude and size of the whole; NaN where no
        match says one.

        Of independent matches, and of errors that matches share (see `dispersion`), each error of the calibration
        free: a lens that bends a path a little in each image bends it much in a hundred.
        """
        k, n = self._unknowns(self.tried), self._width * len(self._placed)
        by_calibration = self._reduced.poses_by_calibration[:, k]
        _, covariance = self.solve(self.tried)
        columns = []
        for scores in self._scores:
            part = np.arange(scores.shape[1]) * _MOST_GROUPS // scores.shape[1]
            groups = np.eye(_MOST_GROUPS)[part]  # neighbours in one group: fewer, and no less shared
            moved = covariance @ (self._of_calibration(scores)[k] @ groups)
            columns.append(self._reduced.factor.solve(scores[:n] @ groups) - by_calibration @ moved)
        through, pulled, of_shared = self.shared(self.tried)
        columns = [of_group + through @ (of_shared @ (pulled.T @ of_group)) for of_group in columns]
        T = state.T_world_body[self._placed]
        outward = T[:, :3, 3] - T[self._matched, :3, 3].mean(axis=0)
        whole = np.concatenate(
            [np.tile(np.eye(3), (len(T), 1, 1)), rotations.hat(outward), outward[:, :, None]], axis=2
        )
        basis = np.linalg.qr((self._matched[:, None, None] * whole).reshape(-1, 7))[0]

        def squared(columns: FloatArray) -> FloatArray:
            own = columns.reshape(len(T), self._width, -1)[:, 3:6]
            flat = (T[:, :3, :3] @ own).reshape(3 * len(T), -1)
            left = (flat - basis @ (basis.T @ flat)).reshape(len(T), -1)
            return np.asarray((left**2).sum(axis=1))

        alone = self._shape_alone(T, basis, by_calibration, covariance)
        alone += squared(through @ np.linalg.cholesky(of_shared))
        variance = alone.copy()
        for of_group in columns:
            variance += np.maximum(squared(of_group) - alone, 0.0)
        std = np.full(len(state.T_world_body), np.nan)
        std[self._placed[self._matched]] = np.sqrt(variance[self._matched])
        return std

    def _shape_alone(
        self, T: FloatArray, basis: FloatArray, by_calibration: FloatArray, covariance: FloatArray
    ) -> FloatArray:
        """(placed,) the variance of a position in `shape_std` that independent matches make.

        Of some instants, and between them as far as their order says. In the directions off `basis` (3 placed, 7) no
        ridge holds the poses.
        """
        matched = np.flatnonzero(self._matched)
        asked = matched[np.unique(np.linspace(0, len(matched) - 1, min(len(matched), _MOST_GROUPS)).astype(int))]
        rows = (3 * asked[:, None] + np.arange(3)).ravel()
        pull = -basis @ basis[rows].T
        pull[rows, np.arange(len(rows))] += 1.0
        load = np.zeros((len(T), self._width, len(rows)))
        load[:, 3:6] = np.swapaxes(T[:, :3, :3], 1, 2) @ pull.reshape(len(T), 3, -1)
        load = load.reshape(-1, len(rows))
        through = by_calibration.T @ load
        variance = (load * self._reduced.factor.solve(load)).sum(axis=0)
        variance += (through * (covariance @ through)).sum(axis=0)
        return np.interp(np.arange(len(T)), asked, np.maximum(variance.reshape(-1, 3).sum(axis=1), 0.0))

    def shared(self, free: Sequence[Candidate]) -> tuple[FloatArray, FloatArray, FloatArray]:
        """What priors share (q unknowns) beside the poses, if the errors in `free` are not known either.

        Returns:
            By how much the poses fall per unit of each (6 instants, q), its pull at them (6 instants, q), and the
            covariance (q, q), which holds the poses' own.
        """
        n = self._width * len(self._placed)
        if self._pull is None:
            return np.zeros((n, 0)), np.zeros((n, 0)), np.zeros((0, 0))
        slopes = np.zeros((len(self._placed), self._width, self._pull.shared.shape[2]))
        slopes[:, :6] = self._pull.shared
        pulled = slopes.copy()
        pulled[:, :6] *= self._pull.weight[..., None]
        slopes, pulled = slopes.reshape(n, -1), pulled.reshape(n, -1)
        by_calibration = self._reduced.poses_by_calibration[:, self._unknowns(free)]
        _, covariance = self.solve(free)
        through = self._reduced.factor.solve(pulled) + by_calibration @ (covariance @ (by_calibration.T @ pulled))
        curvature = slopes.T @ pulled - pulled.T @ through + np.diag(self._pull.shared_std**-2)
        of_shared = np.linalg.inv(curvature)
        return through, pulled, 0.5 * (of_shared + of_shared.T)

    def shared_step(self) -> FloatArray:
        """(q,) by which what priors share moves in a step of the poses, from where it fits them best."""
        _, pulled, of_shared = self.shared([])
        return np.asarray(-of_shared @ (pulled.T @ self._reduced.poses))

    def pose_variances(self, placed: np.ndarray) -> FloatArray:
        """(n, 6) of turn and motion of the body, in its frame, of some (n,) of the placed instants."""
        unknown = (self._width * placed[:, None] + np.arange(6)).ravel()
        load = np.zeros((self._width * len(self._placed), len(unknown)))
        load[unknown, np.arange(len(unknown))] = 1.0
        return np.asarray(self._reduced.factor.solve(load)[unknown, np.arange(len(unknown))]).reshape(-1, 6)

    def step(self, state: State, free: Sequence[Candidate], delta: FloatArray, share: float) -> State:
        """The state after a share of a Gauss-Newton step; `delta` is the calibration's part of that share.

        Only of normal equations without folds: the others do not keep how the points follow.
        """
        assert self._points, "normal equations with folds do not step"
        k = self._unknowns(free)
        calibration = np.zeros(len(self._reduced.marginal.gradient))
        calibration[k] = delta
        poses = share * self._reduced.poses - self._reduced.poses_by_calibration @ calibration
        if self._pull is not None:
            assert not free, "priors hold the poses of a calibration that stays"
            poses = poses - share * self.shared([])[0] @ self.shared_step()
        T = state.T_world_body.copy()
        xi = poses.reshape(-1, self._width)
        T[self._placed] = T[self._placed] @ frames.transform(rotations.exp(xi[:, :3]), xi[:, 3:6])
        points_world = state.points_world.copy()
        for points in self._points:
            points_world[points.numbers] += points.step(np.concatenate([poses, calibration]), share)
        pace = state.pace
        if pace is not None:
            pace = pace.copy()
            pace[self._placed] = np.maximum(pace[self._placed] + xi[:, 6], _LEAST_PACE)
        changed = dataclasses.replace(state, T_world_body=T, points_world=points_world, pace=pace)
        for c in free:
            changed = errors.corrected(changed, c, delta[self.place(free, c)])
        return changed


def residuals(seen: Observations, state: State) -> FloatArray:
    """(o, 2) px, true less predicted; NaN where the lens does not show the point."""
    *_, body = _in_body(seen, state)
    left = np.full((len(body), 2), np.nan)
    for k, camera in enumerate(state.rig):
        at = np.flatnonzero(seen.index[:, 2] == k)
        inside = frames.apply(frames.invert(camera.T_body_camera), body[at])
        left[at] = seen.pixels[at] - errors.pixels(camera, state.tangential[k], inside)
    return left


def _in_body(seen: Observations, state: State) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """R_body_world (o, 3, 3), how fast the points move in the body frame (o, 3) m/s, for how long that lasts from the
    time of the instant (o,) s, and where they are then (o, 3) m."""
    point, instant, number = seen.index.T
    T = state.T_world_body[instant]
    R_body_world = np.swapaxes(T[:, :3, :3], 1, 2)
    rate = np.nan_to_num(twists(seen.time_s, state.T_world_body)[instant])
    if state.pace is not None:
        rate = rate * state.pace[instant, None]
    height = np.array([camera.height for camera in state.rig])
    lag_s = state.offset_s[number] + state.shutter_s[number] * (seen.pixels[:, 1] / height[number] - 0.5)
    still = np.einsum("oij,oj->oi", R_body_world, state.points_world[point] - T[:, :3, 3])
    drift = np.asarray(-(rate[:, 3:] + np.cross(rate[:, :3], still)), dtype=np.float64)
    return R_body_world, drift, lag_s, still + lag_s[:, None] * drift


def linearise(seen: Observations, state: State, tried: Sequence[Candidate]) -> Rows:
    point, _, number = seen.index.T
    R_body_world, drift, lag_s, body = _in_body(seen, state)
    residual = np.full((len(point), 2), np.nan)
    pose, of_point = np.zeros((len(point), 2, 6)), np.zeros((len(point), 2, 3))
    of_pace = np.zeros((len(point), 2, 0 if state.pace is None else 1))
    width = sum(len(c.kind.units) for c in tried)
    calibration = np.zeros((len(point), 2, width))
    for k, camera in enumerate(state.rig):
        at = np.flatnonzero(number == k)
        T_camera_body = frames.invert(camera.T_body_camera)
        inside = frames.apply(T_camera_body, body[at])
        predicted, slope = errors.projection(camera, state.tangential[k], inside)
        residual[at] = seen.pixels[at] - predicted
        to_body = slope @ T_camera_body[:3, :3]
        pose[at] = np.concatenate([to_body @ rotations.hat(body[at]), -to_body], axis=2)
        of_point[at] = to_body @ R_body_world[at]
        moving = np.einsum("oij,oj->oi", to_body, drift[at])
        if state.pace is not None:
            of_pace[at, :, 0] = moving * (lag_s[at] / state.pace[seen.index[at, 1]])[:, None]
        row = seen.pixels[at, 1] / camera.height - 0.5
        start = 0
        for c in tried:
            count = len(c.kind.units)
            if c.camera == camera.name:
                calibration[at, :, start : start + count] = errors.derivative(
                    c.kind, camera, state.rig.cameras[0], inside, predicted, slope, moving, row
                )
            start += count
    used = np.flatnonzero(np.isfinite(residual).all(axis=1) & np.isfinite(pose).all(axis=(1, 2)))
    pose = np.concatenate([pose, of_pace], axis=2)
    return Rows(used, residual[used], pose[used], of_point[used], calibration[used])


def twists(time_s: FloatArray, T_world_body: FloatArray) -> FloatArray:
    """(instants, 6) rate (rad/s) and velocity (m/s) of the body, in its frame; NaN where the times do not tell.

    The slope of the parabola through an instant and the two nearest to it.
    """
    twist = np.full((len(time_s), 6), np.nan)
    placed = np.flatnonzero(np.isfinite(T_world_body[:, 0, 0]) & np.isfinite(time_s))
    placed = placed[np.argsort(time_s[placed], kind="stable")]
    if len(placed) < 3:
        return twist
    here = np.arange(len(placed))
    three = np.clip(here - 1, 0, len(placed) - 3)[:, None] + np.arange(3)
    steps_s = np.diff(time_s[placed[three]], axis=1)
    near_in_time = (steps_s.min(axis=1) > 0.0) & (steps_s.max(axis=1) <= LONGEST_STEP_S)
    others = three[three != here[:, None]].reshape(-1, 2)[near_in_time]
    here, others = placed[near_in_time], placed[others]
    a_s, b_s = (time_s[others] - time_s[here, None]).T[:, :, None]
    near, far = (_step(frames.invert(T_world_body[here]) @ T_world_body[other]) for other in others.T)
    twist[here] = (near * b_s / a_s - far * a_s / b_s) / (b_s - a_s)
    return twist


def _step(T: FloatArray) -> FloatArray:
    """(n, 6) rotation vectors and translations of motions (n, 4, 4)."""
    return np.concatenate([rotations.log(rotations.from_matrix(T[:, :3, :3])), T[:, :3, 3]], axis=1)
