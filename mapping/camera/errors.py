"""What may be wrong with a camera of a rig, and what each error does to the image."""

import dataclasses
import enum
from dataclasses import dataclass

import numpy as np

from flight import FloatArray, rotations
from mapping.camera.lens import Base
from mapping.camera.rig import Camera, Rig


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
    UNTIMED_OFFSET = "time offset in image intervals"
    UNTIMED_SHUTTER = "rolling shutter in image intervals"
    BASELINE = "distance to the first camera"

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
    Kind.UNTIMED_OFFSET: ("intervals",),
    Kind.UNTIMED_SHUTTER: ("intervals",),
    Kind.BASELINE: ("",),
}
PLAUSIBLE = {
    Kind.FOCAL: 0.1,
    Kind.CENTRE: 20.0,
    Kind.RADIAL: 0.2,
    Kind.HIGHER: 0.2,
    Kind.TANGENTIAL: 0.02,
    Kind.ROTATION: 0.2,
    Kind.TRANSLATION: 0.3,
    Kind.OFFSET: 0.1,
    Kind.SHUTTER: 0.1,
    Kind.UNTIMED_OFFSET: 0.5,
    Kind.UNTIMED_SHUTTER: 0.5,
    Kind.BASELINE: 10.0,
}
"""Standard deviation of each kind of error among camera files, in its unit."""
BEYOND_THESE_IMAGES = frozenset(Kind) - {Kind.RADIAL, Kind.HIGHER, Kind.TANGENTIAL}
"""Errors that matter in other images even if they do not move these: a rolling shutter, while the vehicle stands."""
OF_THE_LENS = (Kind.FOCAL, Kind.CENTRE, Kind.RADIAL, Kind.HIGHER, Kind.TANGENTIAL)
OF_TIME = (Kind.OFFSET, Kind.SHUTTER)
UNTIMED = {Kind.OFFSET: Kind.UNTIMED_OFFSET, Kind.SHUTTER: Kind.UNTIMED_SHUTTER}
"""What the errors of time are where the clock counts images, see `INTERVAL_S`."""
INEXPRESSIBLE = (Kind.TANGENTIAL, *OF_TIME, *UNTIMED.values())
"""Errors that no camera file can state."""
INTERVAL_S = 0.25
"""Between two images on the clock of `adjustment.counted`, which counts images: a convention, no image's true time."""
_OF_THE_FIRST = (*OF_THE_LENS, Kind.SHUTTER, Kind.UNTIMED_SHUTTER)
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
class State:
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
    pace: FloatArray | None = None
    """(instants,) the body's velocity over that of a clock that counts images; None where the times are known."""


def candidates(rig: Rig, *, timed: bool) -> list[Candidate]:
    """Every error that can be tried on a rig.

    Args:
        timed: whether times of the images give their velocities; else errors of time are in intervals between images.
    """
    left_out = (Kind.BASELINE, *(UNTIMED.values() if timed else OF_TIME))  # the map's scale rests on the baseline
    kinds = [kind for kind in Kind if kind not in left_out]
    return [
        Candidate(camera.name, kind)
        for number, camera in enumerate(rig)
        for kind in kinds
        if number > 0 or kind in _OF_THE_FIRST
    ]


def projection(camera: Camera, tangential: FloatArray, inside: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Pixels (o, 2) of points in the camera frame, and their slope (o, 2, 3) by central differences."""
    step = 1e-5 * np.linalg.norm(inside, axis=1)
    slope = np.empty((len(inside), 2, 3))
    for axis in range(3):
        shift = np.zeros_like(inside)
        shift[:, axis] = step
        ahead, behind = (pixels(camera, tangential, inside + sign * shift) for sign in (1.0, -1.0))
        slope[:, :, axis] = (ahead - behind) / (2.0 * step[:, None])
    return pixels(camera, tangential, inside), slope


def pixels(camera: Camera, tangential: FloatArray, inside: FloatArray) -> FloatArray:
    """(o, 2) of points (o, 3) in the camera frame; NaN where the lens does not show them."""
    ideal = camera.project(inside)
    return ideal + _decentring(camera, ideal) @ tangential


def _decentring(camera: Camera, pixels: FloatArray) -> FloatArray:
    """(o, 2, 2) pixels per unit of Brown's tangential coefficients p1, p2."""
    x, y = np.moveaxis((pixels - camera.principal_point_px) / camera.focal_px, -1, 0)
    square = x * x + y * y
    rows = np.array([[2.0 * x * y, square + 2.0 * x * x], [square + 2.0 * y * y, 2.0 * x * y]])
    return np.moveaxis(rows, -1, 0) * np.array(camera.focal_px)[:, None]


def derivative(
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
        case Kind.BASELINE:
            return lever(camera, first, slope)[:, :, None]
        case Kind.OFFSET:
            return moving[:, :, None]
        case Kind.SHUTTER:
            return (moving * row[:, None])[:, :, None]
        case Kind.UNTIMED_OFFSET:
            return INTERVAL_S * moving[:, :, None]
        case Kind.UNTIMED_SHUTTER:
            return INTERVAL_S * (moving * row[:, None])[:, :, None]


def _radial(camera: Camera, inside: FloatArray, powers: tuple[int, ...]) -> FloatArray:
    across = np.linalg.norm(inside[:, :2], axis=1)
    theta = np.arctan2(across, inside[:, 2])
    direction = inside[:, :2] / np.maximum(across, 1e-12)[:, None] * camera.focal_px
    return direction[:, :, None] * theta[:, None, None] ** np.array(powers)


def _perpendicular(camera: Camera, first: Camera) -> FloatArray:
    """(3, 2) motions of a camera on the body (m) per radian of the direction from the first camera to it."""
    line = camera.T_body_camera[:3, 3] - first.T_body_camera[:3, 3]
    length_m = float(np.linalg.norm(line))
    if length_m == 0.0:
        return np.zeros((3, 2))
    # the coordinate axis must not change with a small step: the steps of an adjustment are summed in this basis
    size = np.abs(line)
    aside = np.eye(3)[(int(np.argmax(size > 0.4 * size.max())) + 1) % 3]
    across = np.cross(line, aside)
    across *= length_m / float(np.linalg.norm(across))
    return np.asarray(np.column_stack([across, np.cross(line, across) / length_m]), dtype=np.float64)


def lever(camera: Camera, first: Camera, slope: FloatArray) -> FloatArray:
    """(o, 2) derivative of the pixels by the logarithm of the distance between a camera and the first one."""
    line = camera.T_body_camera[:3, 3] - first.T_body_camera[:3, 3]
    return -slope @ (camera.T_body_camera[:3, :3].T @ line)


def corrected(state: State, candidate: Candidate, delta: FloatArray) -> State:
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
        case Kind.BASELINE:
            origin, T = state.rig.cameras[0].T_body_camera[:3, 3], camera.T_body_camera.copy()
            T[:3, 3] += delta[0] * (T[:3, 3] - origin)
            camera = dataclasses.replace(camera, T_body_camera=T)
        case Kind.TANGENTIAL:
            return dataclasses.replace(state, tangential=_added(state.tangential, number, delta))
        case Kind.OFFSET:
            return dataclasses.replace(state, offset_s=_added(state.offset_s, number, delta[0]))
        case Kind.SHUTTER:
            return dataclasses.replace(state, shutter_s=_added(state.shutter_s, number, delta[0]))
        case Kind.UNTIMED_OFFSET:
            return dataclasses.replace(state, offset_s=_added(state.offset_s, number, INTERVAL_S * delta[0]))
        case Kind.UNTIMED_SHUTTER:
            return dataclasses.replace(state, shutter_s=_added(state.shutter_s, number, INTERVAL_S * delta[0]))
    cameras = list(state.rig.cameras)
    cameras[number] = camera
    return dataclasses.replace(state, rig=dataclasses.replace(state.rig, cameras=tuple(cameras)))


def _added(values: FloatArray, index: int, delta: FloatArray | float) -> FloatArray:
    changed = values.copy()
    changed[index] += delta
    return changed


def _other_lens(camera: Camera, kind: Kind, delta: FloatArray) -> Camera:
    """The camera with another focal length or centre, or as Kannala-Brandt with all its terms and other distortion."""
    named = camera.parameters
    match kind:
        case Kind.FOCAL:
            named |= {name: value * (1.0 + delta[0]) for name, value in named.items() if name in ("f", "fx", "fy")}
            return dataclasses.replace(camera, params=np.array(list(named.values())))
        case Kind.CENTRE:
            named |= {"cx": named["cx"] + delta[0], "cy": named["cy"] + delta[1]}
            return dataclasses.replace(camera, params=np.array(list(named.values())))
        case Kind.RADIAL:
            added = np.array([delta[0], 0.0, 0.0, 0.0])
        case _:
            added = np.array([0.0, *delta])
    terms = [name for name in named if name.startswith("k")][:4]
    if camera.lens.base is Base.ANGLE and len(terms) == len(added):
        named |= {name: named[name] + more for name, more in zip(terms, added.tolist(), strict=True)}
        return dataclasses.replace(camera, params=np.array(list(named.values())))
    place, radial = [*camera.focal_px, *camera.principal_point_px], _kannala_brandt(camera) + added
    if camera.lens.is_radial:
        return dataclasses.replace(camera, model="OPENCV_FISHEYE", params=np.array([*place, *radial]))
    params = np.array([*place, *radial[:2], *camera.lens.tangential, *radial[2:], 0.0, 0.0])
    return dataclasses.replace(camera, model="THIN_PRISM_FISHEYE", params=params)


def _kannala_brandt(camera: Camera) -> FloatArray:
    """(4,) k1 to k4 that come nearest to the camera's radius, up to the corners."""
    if camera.lens.base is Base.ANGLE:
        return np.array(camera.lens.radial[:4])
    corners = camera.unproject([[x, y] for x in (0.0, camera.width) for y in (0.0, camera.height)])
    farthest_rad = np.nanmax(np.arccos(corners[:, 2])) if np.isfinite(corners).any() else camera.half_field_rad
    theta = np.linspace(0.0, float(farthest_rad), 200)
    powers = theta[:, None] ** np.array([3, 5, 7, 9])
    fitted = np.linalg.lstsq(powers, camera.lens.radius(theta) - theta, rcond=None)[0]
    return np.asarray(fitted, dtype=np.float64)
