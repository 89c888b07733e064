"""Recorded poses as priors of the adjustment: how far off they are is estimated from what they and the matches leave.

A prior speaks of the shape of the path only. The frame of the recording, its scale, the place and turn of the tracked
thing on the body, and a constant error of its clock are estimated beside it, so that none of them pulls at the map.
The noise of the poses is a variance component: the residuals squared, over the share of them that no unknown took up
(Förstner, 1979). Neighbouring poses of an odometry that wanders are off alike; their correlation makes each count less.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from flight import FloatArray, frames, rotations
from mapping.camera.adjustment import Normal, Observations, robust_cost
from mapping.camera.errors import Candidate, State
from mapping.camera.normal_equations import Pull

USUAL_STD = (float(np.radians(0.2)), 0.01)
"""Turn (rad) and shift (m) of poses of which nothing is known: of visual-inertial odometry over a room."""
LATE_SIGMAS = 3.0
"""From which a clock is said to be off."""

_LEAST_STD = (1e-4, 1e-4)
_ROUNDS = 15
_WHITE = 0.3
"""Correlation of neighbouring poses up to which their errors count as independent."""
_FURTHER = 2.0
"""Of its standard deviation, by which priors may move a map."""
_SETTLED = 0.02
"""Of its noise, by which 95 % of the poses move at most in the last step ..."""
_ASKED_FOR = 0.3
"""... and by which a whole step would move them, if only a part of it makes the fit better."""
_CLOCK_SPREAD = 2.25
"""Errors of a right clock over the deviation that normal equations give it: root mean square, three weak maps drawn."""
_HUBER = 1.345
_LEAST_POSES = 6
_LEAST_SPARE = 0.3
_FITS = 4
_SHARES = (1.0, 0.5, 0.25, 0.0625)
_MOST_CORRELATED = 0.95
_ASKED = 40
"""Instants whose covariance says how much of the residuals the unknowns took up."""
_NUISANCE_STD = np.array([1e1] * 7 + [0.1] * 3 + [0.3] * 3 + [0.1])
"""Known beforehand of frame and scale (turn, shift, log scale), the tracked thing (rad, m), and the clock (s)."""
_STEPS = np.array([1e-6] * 13 + [0.02])
"""Of their derivatives; a clock's is as long as the noise of neighbouring poses asks for."""


@dataclass(frozen=True, slots=True, eq=False)
class Recorded:
    """Poses that were recorded beside the images, and agree with their matches."""

    name: str
    """What they are, with their file."""
    at: Callable[[float], FloatArray]
    """Poses (instants, 4, 4) of the tracked thing, metres, if its clock is so late (s); NaN where there is none."""
    T_tracked_body: FloatArray
    """(4, 4) the body on it, to some centimetres."""
    is_dense: bool
    """Whether there are poses between the images, so that another clock can be tried."""
    std: tuple[float, float] | None = None
    """Of turn (rad) and shift (m) of a pose, if it was stated."""


@dataclass(frozen=True, slots=True)
class Judged:
    """What became of recorded poses in the adjustment."""

    name: str
    count: int
    """Instants with a pose."""
    turn_std_rad: float
    """As the residuals have it, not below what was stated ..."""
    shift_std_m: float
    """... likewise."""
    correlation: float
    """Of the turns or shifts by which neighbouring poses are off, the larger."""
    late_s: float
    """By which the recording's clock is late against the images; 0 where it cannot be tried."""
    late_std_s: float
    """Its standard deviation; 0 likewise."""
    refused: str = ""
    """Why they do not hold the map; empty: they do."""

    @property
    def text(self) -> str:
        """In words."""
        if self.refused:
            return f"{self.name}: no priors of the map: {self.refused}"
        said = (
            f"{self.name}: priors of {self.count} images, off by {100.0 * self.shift_std_m:.2g} cm and "
            f"{np.degrees(self.turn_std_rad):.2g} deg by their residuals"
        )
        if self.late_std_s > 0.0 and abs(self.late_s) > max(LATE_SIGMAS * self.late_std_s, 0.005):
            when = "late" if self.late_s > 0.0 else "early"
            said += f"; their clock is {abs(self.late_s):.3f} s {when}, which the priors allow for"
        return said


class _Fit(NamedTuple):
    """Where the recording lies in the map."""

    scale: float
    """Metres per unit of the map."""
    T_map_start: FloatArray
    """(4, 4) its shift in units of the map."""
    T_tracked_body: FloatArray
    """(4, 4) metres."""
    late_s: float = 0.0


def adjusted(
    seen: Observations, state: State, recorded: Recorded, tried: Sequence[Candidate] = ()
) -> tuple[State, Pull | None, Judged] | None:
    """A map adjusted to its matches and recorded poses, the calibration as it is; None if too few poses are known.

    Args:
        tried: errors of the calibration which the matches may leave in the map.

    Returns:
        The state, what pulls at its poses, and what the poses are worth; the state as it was where they are refused.
    """
    if np.isfinite(recorded.at(0.0) * state.T_world_body)[:, 0, 0].sum() < _LEAST_POSES:
        return None
    floor = np.maximum(recorded.std or _LEAST_STD, _LEAST_STD)
    std, correlation = np.maximum(recorded.std or USUAL_STD, _LEAST_STD), np.zeros(2)
    alone, has_settled = state, False
    fit, off = _fitted(state, recorded, _begin(state, recorded), std, correlation)
    for _ in range(_ROUNDS):
        pull = _pull(state, off, std, correlation, fit, recorded)
        normal = Normal(seen, state, [], folds=1, pull=pull)
        by = normal.shared_step()

        def off_after(moved: State, share: float, fit: _Fit = fit, by: FloatArray = by) -> FloatArray:
            return _off(moved, recorded, _moved(fit, share * by))

        asked = _far(off_after(normal.step(state, [], np.zeros(0), 1.0), 1.0) - off, _noise(std, fit.scale))
        state, share = _stepped(seen, state, normal, pull, off_after)
        before = off
        fit, off = _fitted(state, recorded, _moved(fit, share * by), std, correlation)
        std, correlation = _components(state, off, fit.scale, _spare(normal, pull), (std, floor))
        if has_settled := _far(off - before, _noise(std, fit.scale)) < _SETTLED and asked < _ASKED_FOR:
            break
    pull = _pull(state, off, std, correlation, fit, recorded)
    held = Normal(seen, state, tried, folds=1, pull=pull)
    late_std_s = _CLOCK_SPREAD * float(np.sqrt(held.shared(tried)[2][-1, -1])) if recorded.is_dense else 0.0
    refused = _refused(Normal(seen, alone, tried, folds=1).shape_std(alone), held.shape_std(state), alone, state)
    if correlation.max() > _WHITE:
        refused = "neighbouring poses are off alike, as by a jump or drift"
    if not has_settled:
        refused = f"map and poses did not settle in {_ROUNDS} rounds"
    known = int(np.isfinite(off[:, 0]).sum())
    turn_std, shift_std = std.tolist()
    judged = Judged(
        recorded.name, known, turn_std, shift_std, float(correlation.max()), fit.late_s, late_std_s, refused
    )
    return (alone, None, judged) if refused else (state, pull, judged)


def _refused(alone_std: FloatArray, held_std: FloatArray, alone: State, held: State) -> str:
    """Why the poses do not hold the map (empty: they do), by the deviations (instants,) of positions without and with.

    The move from an estimate to a better one has the difference of their covariances (Hausman, 1978).
    """
    spare = float(np.nanmean(alone_std**2) - np.nanmean(held_std**2))
    if spare <= 0.0:
        return "they make its shape no surer"
    placed = np.isfinite(alone_std)
    a, b = (T.T_world_body[placed, :3, 3] - T.T_world_body[placed, :3, 3].mean(axis=0) for T in (alone, held))
    u, s, vt = np.linalg.svd(b.T @ a)
    R = u @ np.diag([1.0, 1.0, np.linalg.det(u @ vt)]) @ vt
    moved = b - a @ R.T * (s.sum() / (a**2).sum())
    ratio = float(np.sqrt((moved**2).sum(axis=1).mean() / spare))
    return "they move it further than its matches allow, as by a jump or drift" if ratio > _FURTHER else ""


def _far(by: FloatArray, noise: FloatArray) -> float:
    """How far 95 % of the poses move at most, of their noise."""
    return float(np.nanpercentile(np.abs(by) / noise, 95.0))


def _noise(std: FloatArray, scale: float) -> FloatArray:
    """(6,) of turn (rad) and motion (units of the map)."""
    return np.repeat(std / [1.0, scale], 3)


def _begin(state: State, recorded: Recorded) -> _Fit:
    """Frame and scale by turns and spread, the tracked thing where it was said to be."""
    T, ours = recorded.at(0.0) @ recorded.T_tracked_body, state.T_world_body
    both = np.isfinite(T[:, 0, 0]) & np.isfinite(ours[:, 0, 0])
    u, _, vt = np.linalg.svd(np.einsum("nij,nkj->ik", ours[both, :3, :3], T[both, :3, :3]))  # Wahba, 1965
    R = u @ np.diag([1.0, 1.0, np.linalg.det(u @ vt)]) @ vt
    theirs, own = T[both, :3, 3] @ R.T, ours[both, :3, 3]
    scale = float(np.sqrt(theirs.var(axis=0).sum() / max(own.var(axis=0).sum(), 1e-24)))
    T_map_start = np.eye(4)
    T_map_start[:3, :3], T_map_start[:3, 3] = R, (own - theirs / scale).mean(axis=0)
    return _Fit(scale, T_map_start, recorded.T_tracked_body)


def _off(state: State, recorded: Recorded, fit: _Fit) -> FloatArray:
    """(instants, 6) turn (rad) and motion (units of the map) of the poses from the recorded ones, in the body frame."""
    T = recorded.at(fit.late_s) @ fit.T_tracked_body
    T[:, :3, 3] /= fit.scale
    T = fit.T_map_start @ T
    R, ours = T[:, :3, :3], state.T_world_body
    known = np.isfinite(R[:, 0, 0]) & np.isfinite(ours[:, 0, 0])
    off = np.full((len(R), 6), np.nan)
    turns = np.einsum("nji,njk->nik", R[known], ours[known, :3, :3])
    off[known, :3] = rotations.log(rotations.from_matrix(turns))
    off[known, 3:] = np.einsum("nji,nj->ni", ours[known, :3, :3], ours[known, :3, 3] - T[known, :3, 3])
    return off


def _moved(fit: _Fit, by: FloatArray) -> _Fit:
    """Another fit, by turn, shift and logarithm of the frame's scale, turn and shift of the thing, and its clock."""
    T_map_start = fit.T_map_start.copy()
    T_map_start[:3, :3] = rotations.matrix(rotations.exp(by[:3])) @ T_map_start[:3, :3]
    T_map_start[:3, 3] += by[3:6] / fit.scale
    T_tracked_body = fit.T_tracked_body @ frames.transform(rotations.exp(by[7:10]), by[10:13])
    return _Fit(fit.scale * float(np.exp(by[6])), T_map_start, T_tracked_body, fit.late_s + float(by[13]))


def _fitted(
    state: State, recorded: Recorded, fit: _Fit, std: FloatArray, correlation: FloatArray
) -> tuple[_Fit, FloatArray]:
    """The recording laid onto the map by robust least squares, and how far the poses are then off, see `_off`."""
    known_std = _known_std(recorded)
    for _ in range(_FITS):
        off = _off(state, recorded, fit)
        known = np.isfinite(off[:, 0])
        units = 1.0 / _noise(std, fit.scale)
        weight = _weights(off[known] * units) * units * np.sqrt(_fewer(correlation))
        rows = (_slopes(state, recorded, fit)[known] * weight[..., None]).reshape(-1, len(known_std))
        left = (off[known] * weight).ravel()
        covariance = np.linalg.inv(rows.T @ rows + np.diag(known_std**-2))
        fit = _moved(fit, -covariance @ (rows.T @ left + _away(fit, recorded) / known_std**2))
    return fit, _off(state, recorded, fit)


def _known_std(recorded: Recorded) -> FloatArray:
    known_std = _NUISANCE_STD.copy()
    if not recorded.is_dense:
        known_std[13] = 1e-6
    return known_std


def _damped_std(recorded: Recorded) -> FloatArray:
    """(14,) the same for a step beside the map's: its frame and size move as well, so that the recording's may stay."""
    damped_std = _known_std(recorded)
    damped_std[:7] = 1e-4
    return damped_std


def _slopes(state: State, recorded: Recorded, fit: _Fit) -> FloatArray:
    """(instants, 6, 14) derivatives of `_off` in what moves a fit, see `_moved`; 0 where there is no pose."""
    return np.stack(
        [
            np.nan_to_num(_off(state, recorded, _moved(fit, step)) - _off(state, recorded, _moved(fit, -step)))
            / (2.0 * step.sum())
            for step in np.diag(_STEPS)
        ],
        axis=-1,
    )


def _away(fit: _Fit, recorded: Recorded) -> FloatArray:
    """(14,) how far the thing and the clock are from where they were taken to be."""
    T = frames.invert(recorded.T_tracked_body) @ fit.T_tracked_body
    turn = rotations.log(rotations.from_matrix(T[:3, :3]))
    return np.concatenate([np.zeros(7), turn, T[:3, 3], [fit.late_s]])


def _weights(whitened: FloatArray) -> FloatArray:
    """(n, 6) roots of Huber's weights of turns and shifts (n, 6) over their noise."""
    length = np.linalg.norm(whitened.reshape(-1, 2, 3), axis=2) / np.sqrt(3.0)
    return np.repeat(np.sqrt(np.minimum(1.0, _HUBER / np.maximum(length, 1e-12))), 3, axis=1)


def _fewer(correlation: FloatArray) -> FloatArray:
    """(6,) as how many independent ones each of poses counts whose neighbours are off alike."""
    return np.repeat((1.0 - correlation) / (1.0 + correlation), 3)


def _pull(
    state: State, off: FloatArray, std: FloatArray, correlation: FloatArray, fit: _Fit, recorded: Recorded
) -> Pull:
    """What the recorded poses pull with at the placed ones; those whose neighbours are off alike pull the less."""
    placed = np.isfinite(state.T_world_body[:, 0, 0])
    of_placed = off[placed]
    known, noise = np.isfinite(of_placed[:, :1]), _noise(std, fit.scale)
    weight = known * _fewer(correlation) * (_weights(np.nan_to_num(of_placed) / noise) / noise) ** 2
    return Pull(weight, np.nan_to_num(of_placed), _slopes(state, recorded, fit)[placed], _damped_std(recorded))


def _stepped(
    seen: Observations, state: State, normal: Normal, pull: Pull, off: Callable[[State, float], FloatArray]
) -> tuple[State, float]:
    """The state after a step, halved until matches and priors together fit better, and the share of it."""
    placed = np.isfinite(state.T_world_body[:, 0, 0])

    def cost(moved: State, share: float) -> float:
        matches = len(seen.index) * robust_cost(seen, moved, normal.huber_px) / normal.noise_px**2
        return matches + 0.5 * float((pull.weight * np.nan_to_num(off(moved, share)[placed]) ** 2).sum())

    before = cost(state, 0.0)
    for share in _SHARES:
        if cost(moved := normal.step(state, [], np.zeros(0), share), share) < before:
            return moved, share
    return state, 0.0


def _spare(normal: Normal, pull: Pull) -> FloatArray:
    """(2,) share of the residuals of turns and shifts that no unknown took up."""
    known = np.flatnonzero(pull.weight[:, 0] > 0.0)
    asked = known[np.unique(np.linspace(0, len(known) - 1, min(len(known), _ASKED)).astype(int))]
    taken = (normal.pose_variances(asked) * pull.weight[asked]).reshape(-1, 2, 3).mean(axis=(0, 2))
    return np.asarray(1.0 - taken - len(_STEPS) / (6.0 * len(known)))


def _components(
    state: State, off: FloatArray, scale: float, spare: FloatArray, stds: tuple[FloatArray, FloatArray]
) -> tuple[FloatArray, FloatArray]:
    """Standard deviation of recorded turns (rad) and shifts (m), and how alike neighbours are off, (2,) each.

    Args:
        spare: see `_spare`. Where little is, the matches hardly tell, and the first of `stds` stands; the second is the
            least.
    """
    known = np.isfinite(off[:, 0])
    R = state.T_world_body[known, :3, :3]
    in_world = np.stack([R @ off[known, first : first + 3, None] for first in (0, 3)])[..., 0]
    size = 1.4826 * np.median(np.abs(in_world), axis=(1, 2)) * [1.0, scale]
    before, floor = stds
    estimated = size / np.sqrt(np.maximum(spare, _LEAST_SPARE))
    std = np.maximum(np.where(spare >= _LEAST_SPARE, estimated, np.maximum(estimated, before)), floor)
    cut = np.clip(in_world, *(sign * 3.0 * np.maximum(size / [1.0, scale], 1e-12)[:, None, None] for sign in (-1, 1)))
    alike = (cut[:, 1:] * cut[:, :-1]).sum(axis=(1, 2)) / np.maximum((cut**2).sum(axis=(1, 2)), 1e-30)
    return std, np.clip(alike, 0.0, _MOST_CORRELATED)
