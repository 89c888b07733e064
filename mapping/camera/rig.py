"""The cameras on the vehicle: their lenses and their poses on the body, read from `camera.toml`.

    format = "goshawk-camera"
    version = 1
    intrinsics = "fixed"            # or "refine": the lens below is a first guess, the images improve it
    [[camera]]
    name = "front"
    folder = "front"                # sub-folder with this camera's images; "." is the image folder itself
    model = "OPENCV_FISHEYE"        # COLMAP's names and parameter order
    width = 640
    height = 480
    params = [fx, fy, cx, cy, k1, k2, k3, k4]
    field_of_view_deg = 165.0       # optional: full angle of the usable cone (a lens darker at the rim)
    T_body_camera = { q = [w, x, y, z], t = [x, y, z] }   # optional; metres; else looking along body x

Pixel coordinates are COLMAP's: the centre of the upper left pixel is (0.5, 0.5).
"""

import dataclasses
import json
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from flight import FloatArray, FormatError, InputError, file_format, frames, rotations
from mapping.camera import lens as lenses
from mapping.camera.lens import Lens

FORMAT = "goshawk-camera"
VERSION = 1
_FILE_FIELDS = ("format", "version", "intrinsics", "camera")
_CAMERA_FIELDS = ("name", "folder", "model", "width", "height", "params", "field_of_view_deg", "T_body_camera")

R_BODY_CAMERA_FORWARD = np.array([[0.0, 0.0, 1.0], [-1.0, 0.0, 0.0], [0.0, -1.0, 0.0]])
"""A camera (x right, y down, z forward) that looks along body x (x forward, y left, z up)."""

LARGEST_PX = 65_535
"""Longest side of an image, as JPEG has it."""
FARTHEST_M = 10.0
"""Of a camera from the body's origin; one farther away is in another unit than metres."""
FOCAL_WIDTHS = (0.05, 100.0)
"""Shortest and longest focal length of a camera, in widths of its image."""


@dataclass(frozen=True, slots=True, eq=False)
class Camera:
    """One camera: its lens and its pose on the body."""

    name: str
    """Unique in the rig."""
    folder: str
    """Sub-folder of the image folder; "." is the image folder itself."""
    model: str
    """One of COLMAP's model names, see `lens.PARAMETERS`."""
    width: int
    """Pixels."""
    height: int
    """Pixels."""
    params: FloatArray
    """In COLMAP's order for `model`."""
    T_body_camera: FloatArray
    """(4, 4), metres."""
    field_of_view_rad: float = 2.0 * np.pi
    """Full angle of the cone that reaches the sensor."""

    def __post_init__(self) -> None:
        names = lenses.PARAMETERS.get(self.model)
        if names is None:
            raise InputError(f"camera {self.name}: model {self.model!r} is not one of {', '.join(lenses.PARAMETERS)}")
        params = np.array(self.params, dtype=np.float64)
        if params.shape != (len(names),) or not np.isfinite(params).all():
            raise InputError(
                f"camera {self.name}: {self.model} takes {len(names)} finite params "
                f"({', '.join(names)}), not {params.tolist()}"
            )
        if self.width < 8 or self.height < 8:
            raise InputError(f"camera {self.name}: an image of {self.width}x{self.height} pixels is too small")
        if max(self.width, self.height) > LARGEST_PX:
            raise InputError(
                f"camera {self.name}: an image of {self.width}x{self.height} pixels; at most {LARGEST_PX} a side"
            )
        object.__setattr__(self, "params", params)
        object.__setattr__(self, "T_body_camera", np.array(self.T_body_camera, dtype=np.float64))
        if (away_m := float(np.linalg.norm(self.T_body_camera[:3, 3]))) > FARTHEST_M:
            raise InputError(
                f"camera {self.name} lies {away_m:.4g} m from the body's origin, or the first camera; at most "
                f"{FARTHEST_M:g} m may be: give its position in metres, not in millimetres"
            )
        named = self.parameters
        shortest_px, longest_px = (ratio * self.width for ratio in FOCAL_WIDTHS)
        for focal_px in self.focal_px:
            if not shortest_px <= focal_px <= longest_px:
                raise InputError(
                    f"camera {self.name}: a focal length of {focal_px:g} px; for an image {self.width} px wide it must "
                    f"be from {shortest_px:g} to {longest_px:g} px"
                )
        if not self.contains(self.principal_point_px):
            raise InputError(
                f"camera {self.name}: the principal point ({named['cx']:g}, {named['cy']:g}) px lies outside of the "
                f"image of {self.width}x{self.height} pixels"
            )
        if self.model == "EUCM" and not (0.0 <= named["alpha"] <= 1.0 and named["beta"] > 0.0):
            raise InputError(
                f"camera {self.name}: EUCM takes alpha from 0 to 1 and beta above 0, "
                f"not {named['alpha']:g} and {named['beta']:g}"
            )
        if not 0.0 < self.field_of_view_rad <= 2.0 * np.pi:
            raise InputError(
                f"camera {self.name}: a field of view of {np.degrees(self.field_of_view_rad):g} degrees; it must be "
                "above 0 and at most 360 degrees"
            )

    @property
    def parameters(self) -> dict[str, float]:
        return dict(zip(lenses.PARAMETERS[self.model], self.params.tolist(), strict=True))

    @property
    def focal_px(self) -> tuple[float, float]:
        named = self.parameters
        return (named["f"], named["f"]) if "f" in named else (named["fx"], named["fy"])

    @property
    def principal_point_px(self) -> tuple[float, float]:
        return self.parameters["cx"], self.parameters["cy"]

    @property
    def lens(self) -> Lens:
        """The lens, of focal length 1."""
        return lenses.of_model(self.model, self.parameters)

    @property
    def half_field_rad(self) -> float:
        """Angle from the optical axis up to which the lens model holds and light arrives."""
        return min(0.5 * self.field_of_view_rad, self.lens.limit_rad)

    def project(self, points_camera: ArrayLike) -> FloatArray:
        """(..., 3) points in the camera frame to (..., 2) pixels; NaN outside `half_field_rad`.

        The pixel may lie outside the image: see `contains`.
        """
        points = np.asarray(points_camera, dtype=np.float64)
        shown = _angles(points) <= self.half_field_rad
        pixels = self.lens.place(points) * self.focal_px + self.principal_point_px
        return np.asarray(np.where(shown[..., None], pixels, np.nan), dtype=np.float64)

    def unproject(self, pixels: ArrayLike) -> FloatArray:
        """(..., 2) pixels to (..., 3) unit rays in the camera frame; NaN outside `half_field_rad`."""
        place = (np.asarray(pixels, dtype=np.float64) - self.principal_point_px) / self.focal_px
        rays = self.lens.ray(place)
        return np.asarray(np.where(_angles(rays)[..., None] <= self.half_field_rad, rays, np.nan), dtype=np.float64)

    def contains(self, pixels: ArrayLike) -> np.ndarray:
        """(..., 2) to (...,) bool: whether the pixel lies on the image (NaN does not)."""
        u, v = np.moveaxis(np.asarray(pixels, dtype=np.float64), -1, 0)
        return (u >= 0.0) & (u < self.width) & (v >= 0.0) & (v < self.height)

    def pixel_centres(self) -> FloatArray:
        """(height, width, 2)."""
        u, v = np.meshgrid(np.arange(self.width) + 0.5, np.arange(self.height) + 0.5)
        return np.asarray(np.stack([u, v], axis=-1), dtype=np.float64)

    def lit(self) -> np.ndarray:
        """(height, width) bool: pixels inside the field of view."""
        return np.isfinite(self.unproject(self.pixel_centres())[..., 2])


def _angles(rays: FloatArray) -> FloatArray:
    """(...,) angles of (..., 3) rays from the optical axis."""
    return np.asarray(np.arctan2(np.hypot(rays[..., 0], rays[..., 1]), rays[..., 2]))


@dataclass(frozen=True, slots=True, eq=False)
class Rig:
    """All cameras of the vehicle; images of equal name were taken at the same instant."""

    cameras: tuple[Camera, ...]
    """The first is the reference camera; none in a map that was not made of images."""
    refine_intrinsics: bool = False
    """Whether the lens parameters are a first guess that the images may improve."""

    def __post_init__(self) -> None:
        names = [camera.name for camera in self.cameras]
        folders = [str(Path(camera.folder)) for camera in self.cameras]  # "./front" is "front"
        for what, values in (("name", names), ("folder", folders)):
            if len(set(values)) < len(values):
                raise InputError(f"two cameras of the rig share the {what}: {values}")
        if len(self.cameras) > 1 and any(Path(c.folder) == Path(".") for c in self.cameras):
            raise InputError("with several cameras each one needs its own sub-folder of images")

    def __iter__(self) -> Iterator[Camera]:
        return iter(self.cameras)

    def __len__(self) -> int:
        return len(self.cameras)

    def __getitem__(self, name: str) -> Camera:
        for camera in self.cameras:
            if camera.name == name:
                return camera
        raise InputError(f"the rig has no camera {name!r}; it has {', '.join(c.name for c in self.cameras)}")

    @property
    def baseline_m(self) -> float:
        """Largest distance between two cameras: what gives a map its scale."""
        t = np.array([camera.T_body_camera[:3, 3] for camera in self.cameras])
        return float(np.linalg.norm(t[:, None] - t[None], axis=-1).max())

    def with_params(self, params: dict[str, FloatArray]) -> "Rig":
        """The same rig with other lens parameters for the cameras named."""
        changed = (dataclasses.replace(c, params=params.get(c.name, c.params)) for c in self.cameras)
        return dataclasses.replace(self, cameras=tuple(changed))


def forward_camera(model: str, width: int, height: int, params: ArrayLike, *, name: str = "camera") -> Camera:
    """A single camera at the body's origin, looking along body x, with its images in the image folder itself."""
    T = np.eye(4)
    T[:3, :3] = R_BODY_CAMERA_FORWARD
    return Camera(name, ".", model, width, height, np.asarray(params, dtype=np.float64), T)


def load(path: Path) -> Rig:
    """Read a `camera.toml`.

    Raises:
        InputError: no such file, or a value that no camera can have.
        FormatError: not a camera file, or a field is missing or of the wrong kind.
    """
    document = file_format.read_toml(path, format=FORMAT, version=VERSION)
    intrinsics = document.get("intrinsics", "fixed")
    if intrinsics not in ("fixed", "refine"):
        raise FormatError(f'{path}: intrinsics is {intrinsics!r}; it must be "fixed" or "refine"')
    tables = document.get("camera", [])
    if not isinstance(tables, list) or not tables or not all(isinstance(table, dict) for table in tables):
        raise FormatError(f"{path} has no [[camera]] table")
    _require_known(path, document, _FILE_FIELDS)
    for table in tables:
        _require_known(path, table, _CAMERA_FIELDS)
    try:
        return Rig(tuple(_camera(table, len(tables) == 1) for table in tables), intrinsics == "refine")
    except KeyError as error:
        raise FormatError(f"{path}: a [[camera]] lacks {error.args[0]!r}") from None
    except (TypeError, ValueError) as error:
        raise FormatError(f"{path}: a [[camera]] is damaged: {file_format.damage_text(error)}") from error
    except InputError as error:
        raise InputError(f"{path}: {error}") from None


def _require_known(path: Path, fields: dict[str, Any], known: tuple[str, ...]) -> None:
    """Refuse a misspelled field: one that may be left out would be left out without a word."""
    for name in fields:
        if name not in known:
            raise FormatError(f"{path}: {name!r} is not one of {', '.join(known)}")


def _camera(table: dict[str, Any], alone: bool) -> Camera:
    for field, kinds in (("width", int), ("height", int), ("field_of_view_deg", int | float)):
        if not isinstance(value := table.get(field, 1), kinds) or isinstance(value, bool):
            raise TypeError(f"{field} is {value!r}; a {'whole ' if kinds is int else ''}number is expected")
    name, pose = str(table["name"]), table.get("T_body_camera")
    if pose is None:
        T_body_camera = np.eye(4)
        T_body_camera[:3, :3] = R_BODY_CAMERA_FORWARD
    else:
        T_body_camera = frames.transform(_unit_quaternion(name, pose["q"]), _vector(name, pose["t"]))
    return Camera(
        name=name,
        folder=str(table.get("folder", "." if alone else name)),
        model=str(table["model"]),
        width=int(table["width"]),
        height=int(table["height"]),
        params=np.array(table["params"], dtype=np.float64),
        T_body_camera=T_body_camera,
        field_of_view_rad=float(np.radians(table.get("field_of_view_deg", 360.0))),
    )


def _unit_quaternion(name: str, values: ArrayLike) -> FloatArray:
    q = np.asarray(values, dtype=np.float64)
    if q.shape != (4,) or not abs(np.linalg.norm(q) - 1.0) < 1e-3:
        raise InputError(f"camera {name}: T_body_camera: q (w, x, y, z) is not a unit quaternion: {q.tolist()}")
    return rotations.normalise(q)


def _vector(name: str, values: ArrayLike) -> FloatArray:
    t = np.asarray(values, dtype=np.float64)
    if t.shape != (3,) or not np.isfinite(t).all():
        raise InputError(f"camera {name}: T_body_camera: t is not three finite numbers: {t.tolist()}")
    return t


def save(path: Path, rig: Rig) -> None:
    """Write a `camera.toml` that `load` reads back."""
    body = {"intrinsics": "refine" if rig.refine_intrinsics else "fixed", "camera": [_table(c) for c in rig.cameras]}
    file_format.write_toml(path, format=FORMAT, version=VERSION, body=body)


def fingerprint(rig: Rig) -> bytes:
    """All of a rig, as bytes that differ where any number does."""
    return json.dumps([rig.refine_intrinsics, *(_table(camera) for camera in rig.cameras)]).encode()


def _table(camera: Camera) -> dict[str, Any]:
    q = rotations.from_matrix(camera.T_body_camera[:3, :3]).tolist()
    return {
        "name": camera.name,
        "folder": camera.folder,
        "model": camera.model,
        "width": camera.width,
        "height": camera.height,
        "params": camera.params.tolist(),
        "field_of_view_deg": float(np.degrees(camera.field_of_view_rad)),
        "T_body_camera": {"q": q, "t": camera.T_body_camera[:3, 3].tolist()},
    }
