"""Calibrations in YAML: Kalibr's camchain, EuRoC's sensor.yaml, ROS' camera_info, and OpenCV's (VINS, camodocal).

All put the centre of the upper left pixel at (0, 0), we at (0.5, 0.5).
"""

from pathlib import Path
from typing import Any

import numpy as np

from flight import FloatArray, FormatError, InputError
from mapping.camera import rig_import
from mapping.camera.rig import Camera, Rig

_LENSES = {
    "radial-tangential": "OPENCV",
    "radtan": "OPENCV",
    "plumb_bob": "OPENCV",
    "rational_polynomial": "OPENCV",
    "PINHOLE": "OPENCV",
    "none": "PINHOLE",
    "equidistant": "OPENCV_FISHEYE",
    "fisheye": "OPENCV_FISHEYE",
    "KANNALA_BRANDT": "OPENCV_FISHEYE",
}
"""Names of lens models to COLMAP's."""
_KEYS = {"OPENCV": ("k1", "k2", "p1", "p2"), "OPENCV_FISHEYE": ("k2", "k3", "k4", "k5"), "PINHOLE": ()}
"""Names of their coefficients in camodocal's files; a Kannala-Brandt lens has no k1 there."""


def read(path: Path) -> tuple[Rig, tuple[str, ...]]:
    """The cameras, and what else the file says that matters to a map; the first camera looks along body x.

    Raises:
        InputError: no such file, or a lens that is none of ours.
        FormatError: it is no calibration.
    """
    document = parsed(path)
    tables = [table for table in document.values() if isinstance(table, dict)] if isinstance(document, dict) else []
    notes = tuple(note for table in tables for note in _notes(table))
    if not isinstance(document, dict):
        return rig_import.read_kalibr(path, document), ()
    if document.get("sensor_type") == "camera":
        return _euroc(path, document), ("T_BS is in the IMU's axes and was left out: see T_body_camera",)
    if "image_width" in document:
        return _opencv(path, document), ()
    return rig_import.read_kalibr(path, document), notes


def parsed(path: Path) -> Any:
    """What the YAML holds; OpenCV writes a header and tags of its own.

    Raises:
        InputError: no such file.
        FormatError: it is too large, or no YAML.
    """
    from ruamel.yaml import YAML, YAMLError

    lines = rig_import.text(path).replace("!!opencv-matrix", "").splitlines()
    begin = next((i for i, line in enumerate(lines) if not line.startswith(("%", "---"))), 0)
    try:
        return YAML(typ="safe", pure=True).load("\n".join(lines[begin:]))
    except (YAMLError, ValueError, RecursionError) as error:
        raise FormatError(f"{path} is not valid YAML: {' '.join(str(error).split())[:200]}") from None


def _notes(table: dict[str, Any]) -> list[str]:
    """Of a camera of Kalibr: what a camera file has no place for."""
    found = []
    line_s, late_s = table.get("line_delay"), table.get("timeshift_cam_imu")
    if isinstance(line_s, int | float) and line_s:
        found.append(f"line_delay = {line_s:g} s, a rolling shutter: a map allows for it in the poses, and is doubtful")
    if isinstance(late_s, int | float) and late_s:
        found.append(f"timeshift_cam_imu = {late_s:g} s: add it to the times of the images (times.csv) beside --poses")
    return found


def _euroc(path: Path, document: dict[str, Any]) -> Rig:
    focal = rig_import.values(document, "intrinsics", 4, path, "camera")
    size = rig_import.values(document, "resolution", 2, path, "camera")
    given = document.get("distortion_coefficients", document.get("distortion_coeffs", []))
    return _camera(path, str(document.get("distortion_model", "none")), size, focal, _numbers(path, given))


def _opencv(path: Path, document: dict[str, Any]) -> Rig:
    """ROS' camera_info, OpenCV's calibration sample, or camodocal's file, as VINS has it."""
    size = [_number(path, document, name) for name in ("image_width", "image_height")]
    kind = str(document.get("distortion_model", document.get("model_type", "plumb_bob")))
    places = document.get("projection_parameters")
    if isinstance(places, dict):
        names = ("mu", "mv", "u0", "v0") if kind == "KANNALA_BRANDT" else ("fx", "fy", "cx", "cy")
        focal = [_number(path, places, name) for name in names]
        terms = places if kind == "KANNALA_BRANDT" else document.get("distortion_parameters", {})
        coefficients = [_number(path, terms, name) for name in _KEYS[_LENSES[kind]]] if kind in _LENSES else []
        return _camera(path, kind, size, focal, np.array(coefficients))
    matrix = _data(path, document, "camera_matrix", "Camera_Matrix")
    if len(matrix) != 9:
        raise FormatError(f"{path}: camera_matrix holds {len(matrix)} numbers; 9 are expected")
    terms = _data(path, document, "distortion_coefficients", "Distortion_Coefficients")
    return _camera(path, kind, size, matrix[[0, 4, 2, 5]].tolist(), terms)


def _camera(path: Path, kind: str, size: list[float], focal: list[float], terms: FloatArray) -> Rig:
    model = _LENSES.get(kind)
    if model is None:
        raise InputError(f"{path} is {kind}; known are {', '.join(_LENSES)}: calibrate again with one of them")
    count = len(_KEYS[model])
    if terms[count:].any():
        raise InputError(
            f"{path}: coefficients beyond the first {count} are {terms[count:].tolist()}, which no lens of ours has; "
            "calibrate again without them (OpenCV: CALIB_FIX_K3), or as a fisheye"
        )
    if len(terms) < count and len(terms):
        raise FormatError(f"{path} has {len(terms)} distortion coefficients; {kind} takes {count}")
    fx, fy, cx, cy = focal
    params = np.array([fx, fy, cx + 0.5, cy + 0.5, *np.resize(terms if len(terms) else np.zeros(4), count)])
    width, height = (int(v) for v in size)
    camera = Camera("cam0", ".", model, width, height, params, rig_import.forward())
    return Rig((rig_import.unfolded(camera, str(path)),))


def _data(path: Path, document: dict[str, Any], *keys: str) -> FloatArray:
    table = next((document[key] for key in keys if key in document), None)
    if not isinstance(table, dict):
        raise FormatError(f"{path} has no {keys[0]}")
    return _numbers(path, table.get("data"))


def _numbers(path: Path, given: Any) -> FloatArray:
    try:
        values = np.array(given, dtype=np.float64)
    except (TypeError, ValueError):
        values = np.array([np.nan])
    if values.ndim != 1 or not np.isfinite(values).all():
        raise FormatError(f"{path}: {str(given)[:60]} is not a list of finite numbers")
    return values


def _number(path: Path, table: Any, name: str) -> float:
    value = table.get(name) if isinstance(table, dict) else None
    if isinstance(value, bool) or not isinstance(value, int | float) or not np.isfinite(value):
        raise FormatError(f"{path}: {name} is {value!r}; a finite number is expected")
    return float(value)
