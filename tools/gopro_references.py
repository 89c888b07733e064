"""Turn a GoPro walk (frames/ and telemetry/ as CSV) into an image folder that `goshawk map build` reads.

    python tools/gopro_references.py WALK OUT
    goshawk map build OUT --camera OUT/camera.toml --out MAP

Writes the frames, `times.csv`, `references.csv` (GPS as local east, north, up in metres; gravity in the body frame)
and a rough `camera.toml` whose lens the mapping then calibrates.
"""

import argparse
import shutil
from pathlib import Path

import numpy as np

from flight import FloatArray, file_format, rotations
from mapping.camera import rig as rigs

FRAME_S = 1001 / 30000
EARTH_RADIUS_M = 6_378_137.0
WIDTH, HEIGHT = 848, 480
GUESSED_FOCAL_PX = 370.0


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("walk", type=Path)
    parser.add_argument("out", type=Path)
    arguments = parser.parse_args()
    convert(arguments.walk, arguments.out)


def convert(walk: Path, out: Path) -> None:
    """Write the image folder `out`."""
    names = sorted(p.name for p in (walk / "frames").glob("frame_*.jpg"))
    times_s = frame_number(names) * FRAME_S
    positions_m = local_positions(_table(walk, "GPS5"), times_s)
    up_body = up_directions(walk, times_s)
    params = [GUESSED_FOCAL_PX, GUESSED_FOCAL_PX, WIDTH / 2, HEIGHT / 2, 0.0, 0.0, 0.0, 0.0]
    camera = rigs.forward_camera("OPENCV_FISHEYE", WIDTH, HEIGHT, params)
    with file_format.atomic_folder(out) as new:
        for name in names:
            shutil.copy(walk / "frames" / name, new / name)
        rigs.save(new / "camera.toml", rigs.Rig((camera,), refine_intrinsics=True))
        rows = [f"{name},{t:.6f}" for name, t in zip(names, times_s, strict=True)]
        (new / "times.csv").write_text("\n".join(["image,time_s", *rows, ""]))
        numbers = np.column_stack([positions_m, up_body])
        rows = [",".join([name, *(f"{v:.6f}" for v in row)]) for name, row in zip(names, numbers, strict=True)]
        header = "image,x_m,y_m,z_m,up_body_x,up_body_y,up_body_z"
        (new / "references.csv").write_text("\n".join([header, *rows, ""]))


def frame_number(names: list[str]) -> FloatArray:
    """`frame_0042.jpg` is video frame 42."""
    return np.array([float(Path(name).stem.split("_")[1]) for name in names])


def local_positions(gps: FloatArray, times_s: FloatArray) -> FloatArray:
    """(n, 3) east, north, up from the first fix, in metres; a few hundred metres of earth are flat."""
    latitude_deg, longitude_deg, altitude_m = gps[:, 1], gps[:, 2], gps[:, 3]
    east_m = np.radians(longitude_deg - longitude_deg[0]) * EARTH_RADIUS_M * np.cos(np.radians(latitude_deg[0]))
    north_m = np.radians(latitude_deg - latitude_deg[0]) * EARTH_RADIUS_M
    local = (east_m, north_m, altitude_m - altitude_m[0])
    return np.stack([np.interp(times_s, gps[:, 0], axis) for axis in local], axis=-1)


def up_directions(walk: Path, times_s: FloatArray) -> FloatArray:
    """(n, 3) up in the body frame (x along the optical axis).

    GRAV points down in the axes of the camera body; IORI turns those into the axes of the stabilised image. Nobody
    documents this: of all axis orders, signs and turns it is the one whose directions agree best with the map
    (0.8 degrees over the walk), and the horizon then lies level in the image.
    """
    gravity, turn = _table(walk, "GRAV"), _table(walk, "IORI")
    down_housing = np.stack([np.interp(times_s, gravity[:, 0], gravity[:, k]) for k in (1, 2, 3)], axis=-1)
    nearest = np.abs(turn[:, 0][:, None] - times_s).argmin(axis=0)
    down_camera = rotations.rotate(rotations.normalise(turn[nearest, 1:5]), down_housing)
    up = -down_camera @ rigs.R_BODY_CAMERA_FORWARD.T
    return up / np.linalg.norm(up, axis=1, keepdims=True)


def image_rotations(walk: Path, names: list[str]) -> FloatArray:
    """(n, 4) attitude of each image in the camera's own record: the transpose of IORI * CORI, chosen by fit."""
    frames = frame_number(names).astype(int)
    iori, cori = (rotations.normalise(_table(walk, name)[frames, 1:5]) for name in ("IORI", "CORI"))
    return rotations.conjugate(rotations.multiply(iori, cori))


def _table(walk: Path, name: str) -> FloatArray:
    return np.loadtxt(walk / "telemetry" / f"{name}.csv", delimiter=",", skiprows=1)


if __name__ == "__main__":
    main()
