"""Calibration on trial: which error of a camera file the matches of a map show, how large it is, and how sure that is.

Bundle adjustment in closed form. At the poses and points of the map the reprojection errors are linearised in them and
in every calibration error that a rig may have; points and poses are then eliminated from the normal equations (Schur
complement; Triggs et al., "Bundle adjustment - a modern synthesis", 2000). What remains is a small quadratic in the
calibration alone: any set of candidates is estimated, with its covariance, by one solve with a few unknowns.

A reprojection error that falls proves nothing, since every freed parameter lowers it. A candidate is therefore
estimated from some of the points and judged by the others (cross-validation).
"""

import dataclasses
import enum
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy import sparse as sp

from flight import FloatArray, frames, rotations
from mapping.rig import Camera, Rig

FOLDS = 5
"""Groups of points; each is judged with what the others say."""
LEAST_GAIN = 30.0
"""Fall of the withheld points' chi squared from which a candidate is present."""
NOTICEABLE_PX = 0.10
"""RMS shift of the image below which an error does not matter: matching itself has systematic errors of this size."""
SIGMAS90 = 1.645
"""Half width of a 90 % interval, in standard deviations."""
LONGEST_STEP_S = 0.6
"""Neighbouring images further apart do not give the velocity between them."""

_MOST_ROUNDS = 4
_MOST_ITERATIONS = 10
_CONVERGED = 0.995
_HUBER = 1.345
_RIDGE = 1e-9


class Verdict(enum.StrEnum):
    """What the matches say of a candidate error."""

    PRESENT = "present"
    EXCLUDED = "excluded"
    UNKNOWN = "cannot tell"


class Kind(enum.StrEnum):
    """What may be wrong with a camera of the rig."""

    FOCAL = "focal length"
    CENTRE = "principal point"
    RADIAL = "radial distortion"
    HIGHER = "higher radial terms"
    TANGENTIAL = "tangential distortion"
    ROTATION = "rotation on the body"
    TRANSLATION = "direction to the first camera"
    OFFSET = "time offset"
    SHUTTER = "rolling shutter"

    @property
    def units(self) -> tuple[str, ...]:
        """Of each parameter: the focal length is relative; radial is Kannala-Brandt's k1, higher are k2, k3, k4."""
        return _UNITS[self]


_UNITS = {
    Kind.FOCAL: ("",),
    Kind.CENTRE: ("px", "px"),
    Kind.RADIAL: ("",),
    Kind.HIGHER: ("", "", ""),
    Kind.TANGENTIAL: ("", ""),
    Kind.ROTATION: ("rad", "rad", "rad"),
    Kind.TRANSLATION: ("rad", "rad"),
    Kind.OFFSET: ("s",),
    Kind.SHUTTER: ("s",),
}
_PLAUSIBLE = {
    Kind.FOCAL: 0.1,
    Kind.CENTRE: 20.0,
    Kind.RADIAL: 0.2,
    Kind.HIGHER: 0.2,
    Kind.TANGENTIAL: 0.02,
    Kind.ROTATION: 0.2,
    Kind.TRANSLATION: 0.3,
    Kind.OFFSET: 0.1,
    Kind.SHUTTER: 0.1,
}
"""Standard deviation of each kind of error among camera files, in its unit."""
_OF_THE_FIRST = (Kind.FOCAL, Kind.CENTRE, Kind.RADIAL, Kind.HIGHER, Kind.TANGENTIAL, Kind.SHUTTER)
"""The first camera defines the body's pose and clock: no match can show it turned, moved or late."""


@dataclass(frozen=True, slots=True)
class Candidate:
    """One error that a calibration may have."""

    camera: str
    """The camera's name in the rig."""
    kind: Kind
    """What may be wrong with it."""

    def __str__(self) -> str:
        return f"{self.camera}: {self.kind}"


@dataclass(frozen=True, slots=True, eq=False)
class Finding:
    """What the matches say of one candidate, once the errors that are present were corrected."""

    candidate: Candidate
    """The error on trial."""
    verdict: Verdict
    """Whether it is there."""
    size: FloatArray
    """(n,) the true value less the camera file's, in `Kind.units`."""
    std: FloatArray
    """(n,) of `size`."""
    shift_px: float
    """How far the error moves the image, RMS over all observations of the camera."""
    largest_shift_px: float
    """The same at the far end of the 90 % interval: no larger error is likely."""
    gain: float
    """Fall of the withheld points' chi squared when it is corrected."""

    def as_dict(self) -> dict[str, Any]:
        """Numbers and words for a report file."""
        return {
            "camera": self.candidate.camera,
            "error": str(self.candidate.kind),
            "verdict": str(self.verdict),
            "size": self.size.tolist(),
            "std": self.std.tolist(),
            "units": list(self.candidate.kind.units),
            "shift_px": self.shift_px,
            "largest_shift_px": self.largest_shift_px,
            "gain": self.gain,
        }


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


@dataclass(frozen=True, slots=True, eq=False)
class Trial:
    """The outcome of a trial."""

    findings: tuple[Finding, ...]
    """One for each candidate; those that are present come first, in the order in which they were found."""
    rig: Rig
    """The rig, corrected by what is present as far as a camera file can express it."""
    T_world_body: FloatArray
    """(instants, 4, 4) adjusted together with everything that is present; NaN where not placed."""
    points_world: FloatArray
    """(m, 3), likewise."""
    noise_px: float
    """Standard deviation of a match in each pixel coordinate, with what is present corrected."""
    scale_std: float
    """Relative standard deviation of the scale that the distance between the cameras gives; infinite for one camera."""

    @property
    def present(self) -> tuple[Finding, ...]:
        return tuple(f for f in self.findings if f.verdict is Verdict.PRESENT)

    @property
    def inexpressible(self) -> tuple[Finding, ...]:
        """What is present and no camera file can state; only `T_world_body` and `points_world` allow for it."""
        return tuple(f for f in self.present if f.candidate.kind in (Kind.TANGENTIAL, Kind.OFFSET, Kind.SHUTTER))


@dataclass(frozen=True, slots=True, eq=False)
class _State:
    """All unknowns of the adjustment."""

    rig: Rig
    T_world_body: FloatArray
    points_world: FloatArray
    tangential: FloatArray
    """(cameras, 2)."""
    offset_s: FloatArray
    """(cameras,) by which a camera's images are later than the first's."""
    shutter_s: FloatArray
    """(cameras,) from the first row to the last."""


def candidates(rig: Rig, *, timed: bool) -> list[Candidate]:
    """Every error that can be tried on a rig; those of time only where the time of the images is known."""
    kinds = [kind for kind in Kind if timed or kind not in (Kind.OFFSET, Kind.SHUTTER)]
    return [
        Candidate(camera.name, kind)
        for number, camera in enumerate(rig)
        for kind in kinds
        if number > 0 or kind in _OF_THE_FIRST
    ]


def hold(seen: Observations) -> Trial:
    """Try every calibration error on the matches of a map.

    All errors are estimated together and then given up one by one, the least missed first, until each that is left is
    missed by the withheld points (backward elimination: two errors that only explain the matches together, such as
    focal length and radial distortion, are not overlooked). The adjustment is linearised anew with what is left, until
    the same errors are left twice.
    """
    twist = _twists(seen)
    tried = candidates(seen.rig, timed=bool(np.isfinite(twist).any()))
    none = np.zeros(len(seen.rig))
    start = _State(seen.rig, seen.T_world_body, seen.points_world, np.zeros((len(seen.rig), 2)), none, none)
    present: list[Candidate] = []
    state, sizes = _adjust(seen, start, twist, present)
    for _ in range(_MOST_ROUNDS):
        normal = _Normal(seen, state, twist, tried)
        left = _eliminate(normal, sizes)
        if set(left) == set(present):
            break
        present = left
        state, sizes = _adjust(seen, start, twist, present)
    else:
        normal = _Normal(seen, state, twist, tried)
    findings = [_finding(normal, present, sizes, c) for c in tried]
    findings.sort(key=lambda f: (f.verdict is not Verdict.PRESENT, -f.shift_px if f.candidate in present else 0.0))
    return Trial(
        tuple(findings),
        state.rig,
        state.T_world_body,
        state.points_world,
        normal.noise_px,
        normal.scale_std(state, present),
    )


def _eliminate(normal: "_Normal", sizes: dict[Candidate, FloatArray]) -> list[Candidate]:
    """The candidates that withheld points miss, and that move the image noticeably.

    Args:
        sizes: what the state of `normal` already allows for; giving such a candidate up takes that away again.
    """
    left = list(normal.tried)
    given_up: dict[Candidate, FloatArray] = {}
    while left:
        whole = normal.gain(left, given_up)
        delta, _ = normal.solve(left)
        missed: dict[Candidate, float] = {}
        for c in left:
            size = delta[normal.place(left, c)] + sizes.get(c, 0.0)
            without = [other for other in left if other != c]
            loss = whole - normal.gain(without, given_up | _undone(sizes, c))
            missed[c] = loss if normal.shift_px(c, size) > NOTICEABLE_PX else min(loss, 0.0)
        least = min(left, key=lambda c: missed[c])
        if missed[least] > LEAST_GAIN:
            break
        left.remove(least)
        given_up |= _undone(sizes, least)
    return left


def _undone(sizes: dict[Candidate, FloatArray], candidate: Candidate) -> dict[Candidate, FloatArray]:
    return {candidate: -sizes[candidate]} if candidate in sizes else {}


def _finding(
    normal: "_Normal", present: Sequence[Candidate], sizes: dict[Candidate, FloatArray], c: Candidate
) -> Finding:
    chosen = list(present) if c in present else [*present, c]
    delta, covariance = normal.solve(chosen)
    own = normal.place(chosen, c)
    size = sizes.get(c, delta[own])
    shift_px = normal.shift_px(c, size)
    largest_px = shift_px + SIGMAS90 * normal.spread_px(c, covariance[own, own])
    without = [other for other in chosen if other != c]
    gain = normal.gain(chosen, {}) - normal.gain(without, _undone(sizes, c))
    acquitted = Verdict.EXCLUDED if largest_px < NOTICEABLE_PX else Verdict.UNKNOWN
    verdict = Verdict.PRESENT if c in present else acquitted
    return Finding(c, verdict, size, np.sqrt(np.diag(covariance)[own]), shift_px, largest_px, gain)


# -- the adjustment ---------------------------------------------------------------------------------------------------


def _adjust(
    seen: Observations, state: _State, twist: FloatArray, free: Sequence[Candidate]
) -> tuple[_State, dict[Candidate, FloatArray]]:
    """Gauss-Newton with poses, points and the errors in `free`; returns how far those moved."""
    moved = {c: np.zeros(len(c.kind.units)) for c in free}
    noise_px = np.inf
    for _ in range(_MOST_ITERATIONS):
        normal = _Normal(seen, state, twist, free, folds=1)
        if normal.noise_px > _CONVERGED * noise_px:
            break
        noise_px = normal.noise_px
        delta, _ = normal.solve(free)
        for c in free:
            moved[c] += delta[normal.place(free, c)]
        state = normal.step(state, free, delta)
    return state, moved


class _Normal:
    """The normal equations at one state, the points eliminated, apart for each fold of points."""

    def __init__(
        self,
        seen: Observations,
        state: _State,
        twist: FloatArray,
        tried: Sequence[Candidate],
        *,
        folds: int = FOLDS,
    ) -> None:
        self.tried = list(tried)
        self._placed = np.flatnonzero(np.isfinite(state.T_world_body[:, 0, 0]))
        rows = _linearise(seen, state, twist, tried)
        point, instant = seen.index[rows.used, 0], np.searchsorted(self._placed, seen.index[rows.used, 1])
        self.noise_px, weight = _robust(rows.residual)
        root = np.sqrt(weight)[:, None] / self.noise_px
        self._rms = _shift_matrices(rows, self.tried, seen.index[rows.used, 2], seen.rig)
        residual = (rows.residual * root).ravel()
        shared = sp.hstack(
            [
                _blocks(rows.pose * root[..., None], instant, len(self._placed)),
                _columns(rows.calibration * root[..., None]),
            ],
            format="csr",
        )
        own = _blocks(rows.point * root[..., None], point, len(seen.points_world))
        curvature = np.zeros((len(seen.points_world), 3, 3))
        np.add.at(
            curvature, point, np.einsum("oki,okj->oij", rows.point * root[..., None], rows.point * root[..., None])
        )
        scale = np.trace(curvature, axis1=1, axis2=2)[:, None, None]
        inverse = np.linalg.inv(curvature + (_RIDGE * scale + 1e-12) * np.eye(3))
        self._inverse = _block_diagonal(inverse)
        self._coupling = (own.T @ shared).tocsr()
        self._own_gradient = own.T @ residual
        eliminated = self._inverse @ self._coupling
        fold = np.arange(len(seen.points_world)) % folds
        parts: list[tuple[FloatArray, FloatArray]] = []
        for number in range(folds):
            of_rows = np.repeat(fold[point] == number, 2)
            of_points = np.repeat(fold == number, 3)
            part, coupled = shared[of_rows], self._coupling[of_points]
            matrix = (part.T @ part - coupled.T @ eliminated[of_points]).toarray()
            gradient = part.T @ residual[of_rows] - eliminated[of_points].T @ self._own_gradient[of_points]
            parts.append((matrix, gradient))
        self._whole = (sum((m for m, _ in parts), np.zeros(())), sum((g for _, g in parts), np.zeros(())))
        if folds > 1:
            self._withheld = [self._reduce(m, g) for m, g in parts]
            self._training = [self._reduce(self._whole[0] - m, self._whole[1] - g) for m, g in parts]

    @property
    def _poses(self) -> int:
        return 6 * len(self._placed)

    def _reduce(self, matrix: FloatArray, gradient: FloatArray) -> tuple[FloatArray, FloatArray]:
        """The poses eliminated; the six directions that move the whole map are held by a small ridge."""
        n = self._poses
        pose = matrix[:n, :n] + _RIDGE * np.trace(matrix[:n, :n]) * np.eye(n)
        solved = np.linalg.solve(pose, np.column_stack([matrix[:n, n:], gradient[:n]]))
        return matrix[n:, n:] - matrix[n:, :n] @ solved[:, :-1], gradient[n:] - matrix[n:, :n] @ solved[:, -1]

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
        matrix, gradient = self._reduce(*self._whole)
        k = self._unknowns(chosen)
        covariance = np.linalg.inv(matrix[np.ix_(k, k)] + self._prior(chosen))
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
        for (matrix, gradient), (held_matrix, held_gradient) in zip(self._training, self._withheld, strict=True):
            pull = gradient[k] - matrix[np.ix_(k, g)] @ step
            delta = np.concatenate([np.linalg.solve(matrix[np.ix_(k, k)] + self._prior(chosen), pull), step])
            total += float(2.0 * held_gradient[both] @ delta - delta @ held_matrix[np.ix_(both, both)] @ delta)
        return total

    def _prior(self, chosen: Sequence[Candidate]) -> FloatArray:
        """Curvature of what is plausible: it decides only where the matches say next to nothing."""
        return np.diag([1.0 / _PLAUSIBLE[c.kind] ** 2 for c in chosen for _ in c.kind.units])

    def shift_px(self, candidate: Candidate, size: FloatArray) -> float:
        """RMS over the camera's observations of how far an error moves the image."""
        return float(np.sqrt(size @ self._rms[candidate] @ size))

    def spread_px(self, candidate: Candidate, covariance: FloatArray) -> float:
        """Standard deviation of that shift, in the direction in which it is largest."""
        return float(np.sqrt(np.linalg.eigvals(self._rms[candidate] @ covariance).real.max()))

    def scale_std(self, state: _State, free: Sequence[Candidate]) -> float:
        """Standard deviation of the path's size, relative to it: how firmly the baseline of the rig sets the scale."""
        if len(state.rig) == 1:
            return float("inf")
        n = self._poses
        k = np.concatenate([np.arange(n), n + self._unknowns(free)])
        matrix = self._whole[0][np.ix_(k, k)]
        matrix[:n, :n] += _RIDGE * np.trace(matrix[:n, :n]) * np.eye(n)
        T = state.T_world_body[self._placed]
        growth = np.zeros((len(k),))
        outward = T[:, :3, 3] - T[:, :3, 3].mean(axis=0)
        growth[:n].reshape(-1, 6)[:, 3:] = np.einsum("nji,nj->ni", T[:, :3, :3], outward)
        growth /= growth @ growth
        return float(np.sqrt(growth @ np.linalg.solve(matrix, growth)))

    def step(self, state: _State, free: Sequence[Candidate], delta: FloatArray) -> _State:
        """The state after a Gauss-Newton step whose calibration part is `delta`."""
        n = self._poses
        matrix, gradient = self._whole
        shared = np.zeros(len(gradient))
        k = n + self._unknowns(free)
        shared[k] = delta
        pose = matrix[:n, :n] + _RIDGE * np.trace(matrix[:n, :n]) * np.eye(n)
        shared[:n] = np.linalg.solve(pose, gradient[:n] - matrix[:n, k] @ delta)
        own = self._inverse @ (self._own_gradient - self._coupling @ shared)
        T = state.T_world_body.copy()
        xi = shared[:n].reshape(-1, 6)
        T[self._placed] = T[self._placed] @ frames.transform(rotations.exp(xi[:, :3]), xi[:, 3:])
        changed = dataclasses.replace(state, T_world_body=T, points_world=state.points_world + own.reshape(-1, 3))
        for c in free:
            changed = _corrected(changed, c, delta[self.place(free, c)])
        return changed


@dataclass(frozen=True, slots=True, eq=False)
class _Rows:
    """Residuals (true less predicted) of the observations in use, and their derivatives."""

    used: np.ndarray
    """(o,) indices of the observations."""
    residual: FloatArray
    """(o, 2) px."""
    pose: FloatArray
    """(o, 2, 6): turn (rad) and motion (m) of the body, in its frame."""
    point: FloatArray
    """(o, 2, 3)."""
    calibration: FloatArray
    """(o, 2, p) for all candidates, in order."""


def _linearise(seen: Observations, state: _State, twist: FloatArray, tried: Sequence[Candidate]) -> _Rows:
    point, instant, number = seen.index.T
    T = state.T_world_body[instant]
    R_body_world = np.swapaxes(T[:, :3, :3], 1, 2)
    rate = np.nan_to_num(twist[instant])
    height = np.array([camera.height for camera in state.rig])
    lag_s = state.offset_s[number] + state.shutter_s[number] * (seen.pixels[:, 1] / height[number] - 0.5)
    still = np.einsum("oij,oj->oi", R_body_world, state.points_world[point] - T[:, :3, 3])
    drift = -(rate[:, 3:] + np.cross(rate[:, :3], still))
    body = still + lag_s[:, None] * drift
    residual = np.full((len(point), 2), np.nan)
    pose, of_point = np.zeros((len(point), 2, 6)), np.zeros((len(point), 2, 3))
    width = sum(len(c.kind.units) for c in tried)
    calibration = np.zeros((len(point), 2, width))
    for k, camera in enumerate(state.rig):
        at = np.flatnonzero(number == k)
        T_camera_body = frames.invert(camera.T_body_camera)
        inside = frames.apply(T_camera_body, body[at])
        predicted, slope = _projection(camera, state.tangential[k], inside)
        residual[at] = seen.pixels[at] - predicted
        to_body = slope @ T_camera_body[:3, :3]
        pose[at] = np.concatenate([to_body @ rotations.hat(body[at]), -to_body], axis=2)
        of_point[at] = to_body @ R_body_world[at]
        moving = np.einsum("oij,oj->oi", to_body, drift[at])
        row = seen.pixels[at, 1] / camera.height - 0.5
        start = 0
        for c in tried:
            count = len(c.kind.units)
            if c.camera == camera.name:
                calibration[at, :, start : start + count] = _derivative(
                    c.kind, camera, state.rig.cameras[0], inside, predicted, slope, moving, row
                )
            start += count
    used = np.flatnonzero(np.isfinite(residual).all(axis=1) & np.isfinite(pose).all(axis=(1, 2)))
    return _Rows(used, residual[used], pose[used], of_point[used], calibration[used])


def _projection(camera: Camera, tangential: FloatArray, inside: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Pixels (o, 2) of points in the camera frame, and their slope (o, 2, 3) by central differences."""
    step = 1e-5 * np.linalg.norm(inside, axis=1)
    slope = np.empty((len(inside), 2, 3))
    for axis in range(3):
        shift = np.zeros_like(inside)
        shift[:, axis] = step
        ahead, behind = (_pixels(camera, tangential, inside + sign * shift) for sign in (1.0, -1.0))
        slope[:, :, axis] = (ahead - behind) / (2.0 * step[:, None])
    return _pixels(camera, tangential, inside), slope


def _pixels(camera: Camera, tangential: FloatArray, inside: FloatArray) -> FloatArray:
    pixels = camera.project(inside)
    return pixels + _decentring(camera, pixels) @ tangential


def _decentring(camera: Camera, pixels: FloatArray) -> FloatArray:
    """(o, 2, 2) pixels per unit of Brown's tangential coefficients p1, p2."""
    x, y = np.moveaxis((pixels - camera.principal_point_px) / camera.focal_px, -1, 0)
    square = x * x + y * y
    rows = np.array([[2.0 * x * y, square + 2.0 * x * x], [square + 2.0 * y * y, 2.0 * x * y]])
    return np.moveaxis(rows, -1, 0) * np.array(camera.focal_px)[:, None]


def _derivative(
    kind: Kind,
    camera: Camera,
    first: Camera,
    inside: FloatArray,
    pixels: FloatArray,
    slope: FloatArray,
    moving: FloatArray,
    row: FloatArray,
) -> FloatArray:
    """(o, 2, n) derivative of the pixels by one kind of error.

    Args:
        inside: (o, 3) points in the camera frame; pixels: (o, 2); slope: (o, 2, 3) of the pixels by the points.
        moving: (o, 2) px/s, the motion of the pixels; row: (o,) of the image, -0.5 to 0.5.
    """
    match kind:
        case Kind.FOCAL:
            return (pixels - camera.principal_point_px)[:, :, None]
        case Kind.CENTRE:
            return np.broadcast_to(np.eye(2), (len(inside), 2, 2))
        case Kind.RADIAL:
            return _radial(camera, inside, (3,))
        case Kind.HIGHER:
            return _radial(camera, inside, (5, 7, 9))
        case Kind.TANGENTIAL:
            return _decentring(camera, pixels)
        case Kind.ROTATION:  # T_body_camera turned in the camera's own frame
            return slope @ rotations.hat(inside)
        case Kind.TRANSLATION:
            return -slope @ camera.T_body_camera[:3, :3].T @ _perpendicular(camera, first)
        case Kind.OFFSET:
            return moving[:, :, None]
        case Kind.SHUTTER:
            return (moving * row[:, None])[:, :, None]


def _radial(camera: Camera, inside: FloatArray, powers: tuple[int, ...]) -> FloatArray:
    across = np.linalg.norm(inside[:, :2], axis=1)
    theta = np.arctan2(across, inside[:, 2])
    direction = inside[:, :2] / np.maximum(across, 1e-12)[:, None] * camera.focal_px
    return direction[:, :, None] * theta[:, None, None] ** np.array(powers)


def _perpendicular(camera: Camera, first: Camera) -> FloatArray:
    """(3, 2) motions of a camera on the body (m) per radian of the direction from the first camera to it."""
    line = camera.T_body_camera[:3, 3] - first.T_body_camera[:3, 3]
    basis = np.linalg.svd(line[None])[2][1:].T
    return float(np.linalg.norm(line)) * basis


def _corrected(state: _State, candidate: Candidate, delta: FloatArray) -> _State:
    """The state with one error's parameters moved by `delta`."""
    number = [camera.name for camera in state.rig].index(candidate.camera)
    camera = state.rig.cameras[number]
    match candidate.kind:
        case Kind.FOCAL | Kind.CENTRE | Kind.RADIAL | Kind.HIGHER:
            camera = _other_lens(camera, candidate.kind, delta)
        case Kind.ROTATION:
            T = camera.T_body_camera.copy()
            T[:3, :3] = T[:3, :3] @ rotations.matrix(rotations.exp(delta))
            camera = dataclasses.replace(camera, T_body_camera=T)
        case Kind.TRANSLATION:
            origin = state.rig.cameras[0].T_body_camera[:3, 3]
            line = camera.T_body_camera[:3, 3] - origin
            moved = line + _perpendicular(camera, state.rig.cameras[0]) @ delta
            T = camera.T_body_camera.copy()
            T[:3, 3] = origin + moved * np.linalg.norm(line) / np.linalg.norm(moved)
            camera = dataclasses.replace(camera, T_body_camera=T)
        case Kind.TANGENTIAL:
            return dataclasses.replace(state, tangential=_added(state.tangential, number, delta))
        case Kind.OFFSET:
            return dataclasses.replace(state, offset_s=_added(state.offset_s, number, delta[0]))
        case Kind.SHUTTER:
            return dataclasses.replace(state, shutter_s=_added(state.shutter_s, number, delta[0]))
    cameras = list(state.rig.cameras)
    cameras[number] = camera
    return dataclasses.replace(state, rig=dataclasses.replace(state.rig, cameras=tuple(cameras)))


def _added(values: FloatArray, index: int, delta: FloatArray | float) -> FloatArray:
    changed = values.copy()
    changed[index] += delta
    return changed


def _other_lens(camera: Camera, kind: Kind, delta: FloatArray) -> Camera:
    """The camera with another focal length, centre or distortion, as Kannala-Brandt with all its terms."""
    fx, fy = camera.focal_px
    cx, cy = camera.principal_point_px
    k = camera.distortion.copy()
    match kind:
        case Kind.FOCAL:
            fx, fy = fx * (1.0 + delta[0]), fy * (1.0 + delta[0])
        case Kind.CENTRE:
            cx, cy = cx + delta[0], cy + delta[1]
        case Kind.RADIAL:
            k[0] += delta[0]
        case _:
            k[1:] += delta
    return dataclasses.replace(camera, model="OPENCV_FISHEYE", params=np.array([fx, fy, cx, cy, *k]))


def _twists(seen: Observations) -> FloatArray:
    """(instants, 6) rate (rad/s) and velocity (m/s) of the body, in its frame; NaN where the times do not tell.

    The slope of the parabola through an instant and the two nearest to it.
    """
    twist = np.full((len(seen.time_s), 6), np.nan)
    placed = np.flatnonzero(np.isfinite(seen.T_world_body[:, 0, 0]) & np.isfinite(seen.time_s))
    for k, here in enumerate(placed):
        first = min(max(k - 1, 0), len(placed) - 3)
        others = [i for i in placed[max(first, 0) : first + 3] if i != here]
        lags_s = seen.time_s[others] - seen.time_s[here]
        if len(others) < 2 or np.abs(lags_s).min() == 0.0 or np.abs(np.diff(lags_s)).max() > 2.0 * LONGEST_STEP_S:
            continue
        to_body = frames.invert(seen.T_world_body[here])
        near, far = (_step(to_body @ seen.T_world_body[i]) for i in others)
        a_s, b_s = lags_s
        twist[here] = (near * b_s / a_s - far * a_s / b_s) / (b_s - a_s)
    return twist


def _step(T: FloatArray) -> FloatArray:
    """(6,) rotation vector and translation of a motion."""
    return np.concatenate([rotations.log(rotations.from_matrix(T[:3, :3])), T[:3, 3]])


# -- linear algebra ---------------------------------------------------------------------------------------------------


def _robust(residual: FloatArray) -> tuple[float, FloatArray]:
    """Standard deviation of a coordinate (from the median of the lengths) and Huber's weight of each observation."""
    length = np.linalg.norm(residual, axis=1)
    noise_px = max(float(np.median(length)) / 1.1774, 1e-6)  # Rayleigh: median 1.1774 sigma
    return noise_px, np.minimum(1.0, 2.0 * _HUBER * noise_px / np.maximum(length, 1e-12))


def _shift_matrices(
    rows: _Rows, tried: Sequence[Candidate], number: np.ndarray, rig: Rig
) -> dict[Candidate, FloatArray]:
    """For each candidate (n, n): the mean square shift per unit of its parameters, over the camera's observations."""
    names = [camera.name for camera in rig]
    found: dict[Candidate, FloatArray] = {}
    start = 0
    for c in tried:
        stop = start + len(c.kind.units)
        own = rows.calibration[number == names.index(c.camera), :, start:stop]
        found[c] = np.einsum("oki,okj->ij", own, own) / max(len(own), 1)
        start = stop
    return found


def _blocks(values: FloatArray, column: np.ndarray, count: int) -> sp.csr_matrix:
    """(o, 2, w) blocks as rows (2o) of a sparse matrix with `count` blocks of w columns."""
    rows, height, width = values.shape
    columns = np.repeat(column[:, None] * width + np.arange(width), height, axis=0)
    starts = np.arange(0, rows * height * width + 1, width)
    return sp.csr_matrix((values.reshape(-1), columns.reshape(-1), starts), shape=(rows * height, count * width))


def _columns(values: FloatArray) -> sp.csr_matrix:
    rows, height, width = values.shape
    return sp.csr_matrix(values.reshape(rows * height, width))


def _block_diagonal(blocks: FloatArray) -> sp.csr_matrix:
    count, size, _ = blocks.shape
    columns = (np.arange(count)[:, None, None] * size + np.arange(size)).repeat(size, axis=1)
    starts = np.arange(0, count * size * size + 1, size)
    return sp.csr_matrix((blocks.reshape(-1), columns.reshape(-1), starts), shape=(count * size,) * 2)
