"""Rigs of other programs: Kalibr's camchain YAML, and COLMAP's cameras.txt with its rigs.txt.

Kalibr puts the centre of the upper left pixel at (0, 0), COLMAP and we at (0.5, 0.5). Lenses with radial and
tangential coefficients on tan(angle) (OpenCV's, "radtan") become Kannala-Brandt ones by a fit over the image.
"""

from pathlib import Path
from typing import Any

import numpy as np

from flight import FloatArray, FormatError, InputError, frames, rotations
from mapping.rig import R_BODY_CAMERA_FORWARD, Camera, Rig

LARGEST_BYTES = 2_000_000
WORST_PX = 1.0
"""A lens whose fit is further off than this somewhere in the image is refused."""
_KEPT = {"SIMPLE_PINHOLE": 3, "PINHOLE": 4, "SIMPLE_RADIAL_FISHEYE": 4, "RADIAL_FISHEYE": 5, "OPENCV_FISHEYE": 8}
_FITTED = {"SIMPLE_RADIAL": 4, "RADIAL": 5, "OPENCV": 8}


def read_kalibr(path: Path) -> Rig:
    """The cameras of a camchain file; the first looks along body x, the others are placed by it.

    Raises:
        InputError: no such file, or a lens that our models cannot hold.
        FormatError: it is not a camchain file.
    """
    from ruamel.yaml import YAML, YAMLError

    try:
        document = YAML(typ="safe", pure=True).load(_text(path))
    except (YAMLError, ValueError, RecursionError) as error:
        raise FormatError(f"{path} is not valid YAML: {' '.join(str(error).split())[:200]}") from None
    names = [f"cam{i}" for i in range(len(document))] if isinstance(document, dict) else []
    if not names or any(not isinstance(document.get(name), dict) for name in names):
        raise FormatError(f"{path} is not a camchain file of Kalibr: it has no tables cam0, cam1, ...")
    T_body = _forward()
    cameras = []
    for i, name in enumerate(names):
        entry = document[name]
        if i > 0:
            T_body = T_body @ frames.invert(_matrix(entry, "T_cn_cnm1", path, name))
        cameras.append(_kalibr_camera(entry, path, name, T_body, alone=len(names) == 1))
    return Rig(tuple(cameras))


def _kalibr_camera(entry: dict[str, Any], path: Path, name: str, T_body: FloatArray, *, alone: bool) -> Camera:
    model, distortion = entry.get("camera_model"), entry.get("distortion_model", "none")
    if model != "pinhole" or distortion not in ("equidistant", "radtan", "none"):
        raise InputError(
            f"{path}: {name} is {model} with {distortion}; known are pinhole with equidistant, radtan or none: "
            "calibrate again with pinhole-equi (fisheye) or pinhole-radtan"
        )
    width, height = (int(v) for v in _values(entry, "resolution", 2, path, name))
    fx, fy, cx, cy = _values(entry, "intrinsics", 4, path, name)
    coefficients = _values(entry, "distortion_coeffs", 4, path, name) if distortion != "none" else [0.0] * 4
    place = [fx, fy, cx + 0.5, cy + 0.5]
    if distortion == "none":
        return Camera(name, _folder(name, alone), "PINHOLE", width, height, np.array(place), T_body)
    if distortion == "radtan":
        coefficients = fitted(width, height, place, coefficients, f"{path}: {name}")
    params = np.array([*place, *coefficients])
    return Camera(name, _folder(name, alone), "OPENCV_FISHEYE", width, height, params, T_body)


def read_colmap(path: Path, rigs: Path | None = None) -> Rig:
    """The cameras of a `cameras.txt`; several need the `rigs.txt` with their poses on the rig.

    Raises:
        InputError: no such file, a lens that our models cannot hold, or several cameras and no rig.
        FormatError: it is not such a file.
    """
    rows = _rows(path)
    if not rows:
        raise FormatError(f"{path} holds no camera")
    if len(rows) > 1 and rigs is None:
        raise InputError(
            f"{path} holds {len(rows)} cameras without their poses on the rig; give COLMAP's rigs.txt with --rig, or "
            "images of one camera"
        )
    places = _places(rigs) if rigs is not None else {rows[0][0]: _forward()}
    cameras = []
    for words in rows:
        if words[0] not in places:
            raise InputError(f"{rigs} does not place camera {words[0]} of {path}")
        cameras.append(_colmap_camera(words, path, places[words[0]], alone=len(rows) == 1))
    return Rig(tuple(cameras))


def _colmap_camera(words: list[str], path: Path, T_body: FloatArray, *, alone: bool) -> Camera:
    if len(words) < 5:
        raise FormatError(f"{path}: {' '.join(words)!r} is not CAMERA_ID MODEL WIDTH HEIGHT PARAMS")
    name, model = f"camera{words[0]}", words[1]
    if model not in _KEPT and model not in _FITTED:
        raise InputError(f"{path}: camera {words[0]} is {model}; known are {', '.join([*_KEPT, *_FITTED])}")
    width, height, *params = _floats(words[2:], f"{path}: camera {words[0]}")
    expected = _KEPT.get(model) or _FITTED[model]
    if len(params) != expected:
        raise FormatError(f"{path}: camera {words[0]} has {len(params)} params; {model} takes {expected}")
    if model in _FITTED:
        place = params[:4] if model == "OPENCV" else [params[0], params[0], *params[1:3]]
        radial = params[4:] if model == "OPENCV" else [*params[3:], 0.0, 0.0, 0.0][:4]
        params = [*place, *fitted(int(width), int(height), place, radial, f"{path}: camera {words[0]}")]
        model = "OPENCV_FISHEYE"
    return Camera(name, _folder(name, alone), model, int(width), int(height), np.array(params), T_body)


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
    places, rest = {words[3]: _forward()}, words[4:]
    while rest:
        kind, camera, has_pose, *numbers = rest if len(rest) >= 3 else (*rest, "", "", "")
        if kind != "CAMERA" or has_pose != "1" or len(numbers) < 7:
            raise InputError(f"{path}: sensor {kind} {camera} has no pose; every camera of the rig must be placed")
        pose = np.array(_floats(numbers[:7], f"{path}: sensor {camera}"))
        T_camera_reference = frames.transform(rotations.normalise(pose[:4]), pose[4:])
        places[camera] = _forward() @ frames.invert(T_camera_reference)
        rest = numbers[7:]
    return places


def fitted(width: int, height: int, place: list[float], radtan: list[float], what: str) -> list[float]:
    """Kannala-Brandt k1..k4 for a lens given by OpenCV's k1, k2, p1, p2, by least squares over the image.

    Raises:
        InputError: they differ by more than a pixel somewhere in the image.
    """
    fx, fy, cx, cy = place
    k1, k2, p1, p2 = radtan
    u, v = np.meshgrid(np.linspace(0.0, width, 33), np.linspace(0.0, height, 25))
    distorted = np.stack([(u - cx) / fx, (v - cy) / fy], axis=-1).reshape(-1, 2)
    x, y = distorted.T
    for _ in range(100):  # undistort by fixed-point iteration, as OpenCV does
        r2 = x * x + y * y
        radial = 1.0 + r2 * (k1 + r2 * k2)
        with np.errstate(all="ignore"):
            x = (distorted[:, 0] - 2.0 * p1 * x * y - p2 * (r2 + 2.0 * x * x)) / radial
            y = (distorted[:, 1] - p1 * (r2 + 2.0 * y * y) - 2.0 * p2 * x * y) / radial
    r = np.hypot(x, y)
    theta, radius = np.arctan(r), np.hypot(*distorted.T)
    if not np.isfinite(theta).all():
        raise InputError(f"{what}: the lens folds over inside the image; calibrate with a fisheye model")
    powers = theta[:, None] ** np.array([3, 5, 7, 9])
    k = np.linalg.lstsq(powers, radius - theta, rcond=None)[0]
    direction = np.stack([x, y], axis=1) / np.maximum(r, 1e-12)[:, None]
    back = direction * (theta + powers @ k)[:, None]
    worst = float(np.hypot(*((back - distorted) * [fx, fy]).T).max())
    if not worst <= WORST_PX:
        raise InputError(
            f"{what}: as a Kannala-Brandt lens it is {worst:.1f} px off in the image, more than {WORST_PX:g}; "
            "calibrate with a fisheye model (Kalibr: pinhole-equi, COLMAP: OPENCV_FISHEYE)"
        )
    return k.tolist()


def _forward() -> FloatArray:
    T = np.eye(4)
    T[:3, :3] = R_BODY_CAMERA_FORWARD
    return T


def _folder(name: str, alone: bool) -> str:
    return "." if alone else name


def _text(path: Path) -> str:
    if not path.is_file():
        raise InputError(f"{path} does not exist or is not a file")
    if path.stat().st_size > LARGEST_BYTES:
        raise FormatError(f"{path} has {path.stat().st_size} bytes; a calibration has less than {LARGEST_BYTES}")
    try:
        return path.read_text(encoding="utf-8-sig")
    except UnicodeDecodeError:
        raise FormatError(f"{path} is not text; export it as text (colmap model_converter)") from None


def _rows(path: Path) -> list[list[str]]:
    return [line.split() for line in _text(path).splitlines() if line.strip() and not line.startswith("#")]


def _floats(words: list[str], what: str) -> list[float]:
    try:
        values = [float(word) for word in words]
    except ValueError:
        values = [np.nan]
    if not np.isfinite(values).all():
        raise FormatError(f"{what}: {' '.join(words)!r} is not a row of finite numbers")
    return values


def _values(entry: dict[str, Any], key: str, count: int, path: Path, name: str) -> list[float]:
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
