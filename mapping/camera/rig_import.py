"""Rigs of other programs: Kalibr's camchain YAML, Basalt's calibration JSON, COLMAP's cameras.txt with its rigs.txt.

Kalibr and Basalt put the centre of the upper left pixel at (0, 0), COLMAP and we at (0.5, 0.5).
"""

import json
from pathlib import Path
from typing import Any

import numpy as np

from flight import FloatArray, FormatError, InputError, errors, file_format, frames, rotations
from mapping.camera.lens import PARAMETERS, Base
from mapping.camera.rig import R_BODY_CAMERA_FORWARD, Camera, Rig
from mapping.camera.rig_export import CAMERA_NAME

LARGEST_BYTES = 2_000_000
_KALIBR = {
    ("pinhole", "none"): "PINHOLE",
    ("pinhole", "radtan"): "OPENCV",
    ("pinhole", "equidistant"): "OPENCV_FISHEYE",
    ("eucm", "none"): "EUCM",
}
"""Kalibr's camera and distortion model to COLMAP's."""
_BASALT = {
    "pinhole": ("PINHOLE", ("fx", "fy", "cx", "cy")),
    "kb4": ("OPENCV_FISHEYE", ("fx", "fy", "cx", "cy", "k1", "k2", "k3", "k4")),
    "eucm": ("EUCM", ("fx", "fy", "cx", "cy", "alpha", "beta")),
}
"""Basalt's camera types to COLMAP's models, and the names of their parameters there."""


def read_kalibr(path: Path, document: Any) -> Rig:
    """The cameras of a camchain file; the first looks along body x, the others are placed by it.

    Args:
        document: what its YAML holds.

    Raises:
        InputError: a lens that is none of ours.
        FormatError: it is not a camchain file.
    """
    names = [f"cam{i}" for i in range(len(document))] if isinstance(document, dict) else []
    if not names or any(not isinstance(document.get(name), dict) for name in names):
        raise FormatError(
            f"{path} is no calibration of Kalibr (cam0, cam1, ...), EuRoC (sensor.yaml), ROS (camera_info) or OpenCV"
        )
    T_body = forward()
    cameras = []
    for i, name in enumerate(names):
        entry = document[name]
        if i > 0:
            T_body = T_body @ frames.invert(_matrix(entry, "T_cn_cnm1", path, name))
        cameras.append(_kalibr_camera(entry, path, name, T_body, alone=len(names) == 1))
    return Rig(tuple(cameras))


def _kalibr_camera(entry: dict[str, Any], path: Path, name: str, T_body: FloatArray, *, alone: bool) -> Camera:
    model, distortion = str(entry.get("camera_model")), str(entry.get("distortion_model", "none"))
    kind = _KALIBR.get((model, distortion))
    if kind is None:
        known = ", ".join(f"{a} with {b}" for a, b in _KALIBR)
        raise InputError(
            f"{path}: {name} is {model} with {distortion}; known are {known}: "
            "calibrate again with pinhole-equi (fisheye), eucm-none or pinhole-radtan"
        )
    width, height = (int(v) for v in values(entry, "resolution", 2, path, name))
    intrinsics = values(entry, "intrinsics", 6 if model == "eucm" else 4, path, name)
    ahead, (fx, fy, cx, cy) = intrinsics[:-4], intrinsics[-4:]  # EUCM's alpha and beta come first
    coefficients = values(entry, "distortion_coeffs", 4, path, name) if distortion != "none" else []
    params = np.array([fx, fy, cx + 0.5, cy + 0.5, *ahead, *coefficients])
    return unfolded(Camera(name, _folder(name, alone), kind, width, height, params, T_body), f"{path}: {name}")


def read_basalt(path: Path) -> Rig:
    """The cameras of a Basalt calibration; the first looks along body x, the others are placed by it.

    Raises:
        InputError: no such file, or a lens that is none of ours.
        FormatError: it is not a Basalt calibration.
    """
    try:
        body = json.loads(text(path))["value0"]
        entries = list(zip(body["T_imu_cam"], body["intrinsics"], body["resolution"], strict=True))
        T_imu_camera = [_basalt_pose(pose, path) for pose, _, _ in entries]
        cameras = []
        for number, (_, lens, resolution) in enumerate(entries):
            kind = str(lens["camera_type"])
            if kind not in _BASALT:
                raise InputError(
                    f"{path}: cam{number} is {kind}; known are {', '.join(_BASALT)}: calibrate again with kb4 or eucm"
                )
            model, names = _BASALT[kind]
            values = [float(lens["intrinsics"][name]) for name in names]
            params = np.array([*values[:2], values[2] + 0.5, values[3] + 0.5, *values[4:]])
            T_body = forward() @ frames.invert(T_imu_camera[0]) @ T_imu_camera[number]
            name, (width, height) = f"cam{number}", (int(v) for v in resolution)
            cameras.append(Camera(name, _folder(name, len(entries) == 1), model, width, height, params, T_body))
    except (KeyError, TypeError, ValueError, OverflowError, RecursionError) as error:
        raise FormatError(f"{path} is not a calibration of Basalt: {file_format.damage_text(error)}") from None
    return Rig(tuple(cameras))


def _basalt_pose(pose: dict[str, float], path: Path) -> FloatArray:
    q = np.array([float(pose[name]) for name in ("qw", "qx", "qy", "qz")])
    t = np.array([float(pose[name]) for name in ("px", "py", "pz")])
    return _transform(q, t, f"{path}: T_imu_cam")


def _transform(q: FloatArray, t: FloatArray, what: str) -> FloatArray:
    if not abs(np.linalg.norm(q) - 1.0) < 1e-3 or not np.isfinite(t).all():
        raise FormatError(f"{what} is not a unit quaternion and three finite numbers: {q.tolist()}, {t.tolist()}")
    return frames.transform(rotations.normalise(q), t)


def read_colmap(path: Path, rigs: Path | None = None) -> Rig:
    """The cameras of a `cameras.txt`; several need the `rigs.txt` with their poses on the rig.

    Raises:
        InputError: no such file, a lens that is none of ours, or several cameras and no rig.
        FormatError: it is not such a file.
    """
    rows = _rows(path)
    if not rows:
        raise FormatError(f"{path} holds no camera")
    for words in rows:
        _require_camera(words, path)
    if len(rows) > 1 and rigs is None:
        raise InputError(
            f"{path} holds {len(rows)} cameras without their poses on the rig; give COLMAP's rigs.txt with --rig, or "
            "images of one camera"
        )
    names = _names(path)
    places = _places(rigs) if rigs is not None else {rows[0][0]: forward()}
    cameras = []
    for words in rows:
        if words[0] not in places:
            raise InputError(f"{rigs} does not place camera {words[0]} of {path}")
        name = names.get(words[0], f"camera{words[0]}")
        cameras.append(_colmap_camera(words, path, name, places[words[0]], alone=len(rows) == 1))
    return Rig(tuple(cameras))


def _require_camera(words: list[str], path: Path) -> None:
    if len(words) < 5 or not words[0].isdigit():
        raise FormatError(f"{path}: {' '.join(words)[:60]!r} is not CAMERA_ID MODEL WIDTH HEIGHT PARAMS")
    if words[1] not in PARAMETERS:
        raise InputError(f"{path}: camera {words[0]} is {words[1]}; known are {', '.join(PARAMETERS)}")


def _names(path: Path) -> dict[str, str]:
    """Camera id to name, where `rig_export.write_colmap` wrote the file."""
    lines = [line.removeprefix(CAMERA_NAME) for line in text(path).splitlines() if line.startswith(CAMERA_NAME)]
    return {camera: name for camera, colon, name in (line.partition(": ") for line in lines) if colon and name}


def _colmap_camera(words: list[str], path: Path, name: str, T_body: FloatArray, *, alone: bool) -> Camera:
    model = words[1]
    width, height, *params = _floats(words[2:], f"{path}: camera {words[0]}")
    if len(params) != len(PARAMETERS[model]):
        raise FormatError(f"{path}: camera {words[0]} has {len(params)} params; {model} takes {len(PARAMETERS[model])}")
    camera = Camera(name, _folder(name, alone), model, int(width), int(height), np.array(params), T_body)
    return unfolded(camera, f"{path}: camera {words[0]}")


def _places(path: Path) -> dict[str, FloatArray]:
    """Camera id to T_body_camera, from a rigs.txt of one rig; its reference sensor looks along body x."""
    rows = _rows(path)
    if len(rows) != 1:
        raise InputError(f"{path} holds {len(rows)} rigs; one is expected")
    words = rows[0]
    if len(words) < 4 or words[2] != "CAMERA":
        raise FormatError(
            f"{path} is not RIG_ID NUM_SENSORS REF_SENSOR_TYPE REF_SENSOR_ID SENSORS[], with cameras only"
        )
    places, rest = {words[3]: forward()}, words[4:]
    while rest:
        kind, camera, has_pose, *numbers = rest if len(rest) >= 3 else (*rest, "", "", "")
        if kind != "CAMERA" or has_pose != "1" or len(numbers) < 7:
            raise InputError(f"{path}: sensor {kind} {camera} has no pose; every camera of the rig must be placed")
        pose = np.array(_floats(numbers[:7], f"{path}: sensor {camera}"))
        T_camera_reference = _transform(pose[:4], pose[4:], f"{path}: sensor {camera}")
        places[camera] = forward() @ frames.invert(T_camera_reference)
        rest = numbers[7:]
    return places


def unfolded(camera: Camera, what: str) -> Camera:
    """The camera itself.

    Raises:
        InputError: it is a perspective lens whose model shows no direction at a corner of the image.
    """
    corners = camera.unproject([[x, y] for x in (0.5, camera.width - 0.5) for y in (0.5, camera.height - 0.5)])
    if camera.lens.base is Base.PERSPECTIVE and not np.isfinite(corners).all():
        raise InputError(f"{what}: the lens folds over inside the image; calibrate with a fisheye model")
    return camera


def forward() -> FloatArray:
    """T_body_camera of a camera that looks along body x."""
    T = np.eye(4)
    T[:3, :3] = R_BODY_CAMERA_FORWARD
    return T


def _folder(name: str, alone: bool) -> str:
    return "." if alone else name


def text(path: Path) -> str:
    """
    Raises:
        InputError: no such file.
        FormatError: it is too large, or no text.
    """
    if not path.is_file():
        raise errors.missing(path)
    if path.stat().st_size > LARGEST_BYTES:
        size = path.stat().st_size
        raise FormatError(f"{path} has {size:,} bytes, at most {LARGEST_BYTES:,} are read: is it another file?")
    try:
        return path.read_text(encoding="utf-8-sig")
    except UnicodeDecodeError:
        raise FormatError(f"{path} is not text; export it as text (colmap model_converter)") from None


def _rows(path: Path) -> list[list[str]]:
    return [line.split() for line in text(path).splitlines() if line.strip() and not line.startswith("#")]


def _floats(words: list[str], what: str) -> list[float]:
    try:
        values = [float(word) for word in words]
    except ValueError:
        values = [np.nan]
    if not np.isfinite(values).all():
        raise FormatError(f"{what}: {' '.join(words)!r} is not a row of finite numbers")
    return values


def values(entry: dict[str, Any], key: str, count: int, path: Path, name: str) -> list[float]:
    """
    Raises:
        FormatError: `key` does not hold so many finite numbers.
    """
    given = entry.get(key)
    if not isinstance(given, list) or len(given) != count or not all(_is_number(v) for v in given):
        raise FormatError(f"{path}: {name}.{key} is {given!r}; {count} finite numbers are expected")
    return [float(v) for v in given]


def _is_number(value: object) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and bool(np.isfinite(value))


def _matrix(entry: dict[str, Any], key: str, path: Path, name: str) -> FloatArray:
    try:
        matrix = np.array(entry.get(key), dtype=np.float64)
    except (TypeError, ValueError):
        matrix = np.empty(0)
    rigid = matrix.shape == (4, 4) and np.allclose(matrix[:3, :3] @ matrix[:3, :3].T, np.eye(3), atol=1e-3)
    if not rigid or np.linalg.det(matrix[:3, :3]) < 0.0:
        raise FormatError(f"{path}: {name}.{key} is not a rigid 4x4 transform")
    return matrix
