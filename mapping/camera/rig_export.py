"""Rigs and poses for other programs: COLMAP's cameras.txt and rigs.txt, TUM's trajectories."""

from pathlib import Path

import numpy as np

from flight import FloatArray, InputError, file_format, frames, rotations
from mapping.camera.rig import Rig

CAMERA_NAME = "# name of camera "
"""Beginning of a comment in `cameras.txt`."""


def write_colmap(folder: Path, rig: Rig) -> None:
    """Write `cameras.txt` and `rigs.txt` into a folder; cameras are numbered from 1 in the rig's order.

    COLMAP's cameras have no names: ours are in comments, which COLMAP skips and `rig_import.read_colmap` reads.
    """
    names = [f"{CAMERA_NAME}{number}: {' '.join(camera.name.split())}" for number, camera in enumerate(rig, start=1)]
    cameras = [
        " ".join([str(number), camera.model, str(camera.width), str(camera.height), *_numbers(camera.params)])
        for number, camera in enumerate(rig, start=1)
    ]
    words = ["1", str(len(rig)), "CAMERA", "1"]
    for number, camera in enumerate(rig.cameras[1:], start=2):
        T = frames.invert(camera.T_body_camera) @ rig.cameras[0].T_body_camera
        pose = [*rotations.from_matrix(T[:3, :3]), *T[:3, 3]]
        words += ["CAMERA", str(number), "1", *_numbers(np.array(pose))]
    _write(folder / "cameras.txt", ["# CAMERA_ID MODEL WIDTH HEIGHT PARAMS[]", *names, *cameras])
    _write(folder / "rigs.txt", ["# RIG_ID NUM_SENSORS REF_SENSOR_TYPE REF_SENSOR_ID SENSORS[]", " ".join(words)])


def write_tum(path: Path, time_s: FloatArray, T_world_body: FloatArray) -> None:
    """Write poses as TUM does: `time x y z qx qy qz qw`, z up, the body's axes.

    Args:
        time_s: (n,); T_world_body: (n, 4, 4).

    Raises:
        InputError: a time is not known.
    """
    if not np.isfinite(time_s).all():
        raise InputError(f"{path}: the images have no times, which TUM's format asks for; give times.csv and map again")
    q = rotations.from_matrix(T_world_body[:, :3, :3])
    rows = np.column_stack([time_s, T_world_body[:, :3, 3], q[:, 1:], q[:, :1]])
    _write(path, ["# time_s x_m y_m z_m qx qy qz qw", *(" ".join(_numbers(row)) for row in rows)])


def _numbers(values: FloatArray) -> list[str]:
    return [f"{value:.17g}" for value in values]


def _write(path: Path, lines: list[str]) -> None:
    file_format.write_bytes(path, ("\n".join(lines) + "\n").encode())
