"""Images of a rig whose motion was recorded by odometry: are they placed by it, and is the map the truer for that?

    python benchmarks/mapping_known_poses.py                     24 instants along a tenth of the room's loop
    python benchmarks/mapping_known_poses.py --instants 9 --share .006    a few close together, as of glasses

Four fisheyes as on Project Aria's second glasses; odometry of 1 cm and .2 deg at each image.
"""

import argparse
import dataclasses
import tempfile
from pathlib import Path

import mapping_whole
import numpy as np
import report
from report import Row, row

import mapping
from flight import FloatArray, frames, rotations
from goshawk.demo import map_accuracy
from goshawk.rendered import accuracy
from goshawk.rendered import scene as rendered_room
from goshawk.rendered import world as rendered_world
from goshawk.rendered.world import RenderedFlight
from mapping.camera import rig as rigs
from mapping.camera.rig import Camera, Rig
from mapping.sparse.recorded_motion import motion

SIDE_PX, FOCAL_PX = 512, 245.0
SHIFT_M, TURN_RAD = 0.01, float(np.radians(0.2))
"""Standard deviations of the odometry, along each axis."""
LOOKS = {
    "front-left": (0.06, 20.0, 0.0),
    "front-right": (-0.06, -20.0, 0.0),
    "side-left": (0.07, 80.0, 0.0),
    "side-right": (-0.07, -80.0, 0.0),
}
"""Metres to the left, and degrees to the left and down, of each camera."""


def glasses() -> Rig:
    cameras = []
    for name, (left_m, left_deg, down_deg) in LOOKS.items():
        turn = rotations.multiply(rotations.from_yaw(np.radians(left_deg)), rotations.exp([0, np.radians(down_deg), 0]))
        T = frames.transform(turn, np.array([0.02, left_m, 0.0]))
        T[:3, :3] = T[:3, :3] @ rigs.R_BODY_CAMERA_FORWARD
        params = np.array([FOCAL_PX, FOCAL_PX, SIDE_PX / 2, SIDE_PX / 2, 0.03, -0.03, 0.04, -0.05])
        field_rad = float(np.radians(160.0))
        cameras.append(Camera(name, name, "OPENCV_FISHEYE", SIDE_PX, SIDE_PX, params, T, field_rad))
    return Rig(tuple(cameras))


def odometry(path: Path, flight: RenderedFlight, rng: np.random.Generator) -> None:
    """A TUM file of the true poses with noise, in a frame of its own."""
    count = len(flight.times_s)
    noise = frames.transform(
        rotations.exp(TURN_RAD * rng.normal(size=(count, 3))), SHIFT_M * rng.normal(size=(count, 3))
    )
    T = frames.transform(rotations.from_yaw(0.7), np.array([3.0, -1.0, 0.5])) @ flight.T_world_body @ noise
    q = rotations.from_matrix(T[:, :3, :3])
    rows = np.column_stack([flight.times_s, T[:, :3, 3], q[:, 1:], q[:, :1]])
    path.write_text("".join(" ".join(f"{value:.9f}" for value in line) + "\n" for line in rows))


def aligned(T_found: FloatArray, T_true: FloatArray) -> FloatArray:
    """The rigid motion (4, 4) that fits found poses (n, 4, 4) to true ones: the rotation by their attitudes."""
    product = np.einsum("nij,nkj->ik", T_true[:, :3, :3], T_found[:, :3, :3])
    T = np.eye(4)
    T[:3, :3] = motion.nearest_rotation(product)
    T[:3, 3] = T_true[:, :3, 3].mean(axis=0) - T[:3, :3] @ T_found[:, :3, 3].mean(axis=0)
    return T


def made(work: Path, flight: RenderedFlight, name: str, *options: object) -> list[Row]:
    """One map, against the truth."""
    images, out = work / "images", work / name
    try:
        cost = mapping_whole.command("map", "build", images, "--camera", images / "camera.toml", "--out", out, *options)
    except RuntimeError:
        return [row(f"{name}: placed", 0, "instants", f"{len(flight.times_s)}", ok=False)]
    area, scene = mapping.open_map(out), rendered_room.furnished()
    T_true = flight.T_world_body[[int(Path(image).stem) for image in area.images]]
    T_world_map = aligned(area.T_world_body, T_true)
    T = T_world_map @ area.T_world_body
    off_m = np.linalg.norm(T[:, :3, 3] - T_true[:, :3, 3], axis=1)
    turned = rotations.from_matrix(frames.invert(T_true)[:, :3, :3] @ T[:, :3, :3])
    shots = [(camera, each @ camera.T_body_camera) for each in T_true for camera in glasses()]
    seen = accuracy.seen_surface(scene, shots, rng=np.random.default_rng(1))
    score = accuracy.compare(
        scene, seen, map_accuracy.mesh_vertices(area), area.field.state, area.field.grid, T_world_map=T_world_map
    )
    count = len(flight.times_s)
    return [
        row(f"{name}: placed", len(area.images), "instants", f"{count}", len(area.images) == count),
        row(f"{name}: position, RMS", 1000 * float(np.sqrt((off_m**2).mean())), "mm"),
        row(
            f"{name}: attitude, RMS", float(np.degrees(np.sqrt((rotations.log(turned) ** 2).sum(axis=1).mean()))), "deg"
        ),
        row(
            f"{name}: mesh within 5 cm of the truth",
            score.share_within_5cm,
            "share",
            ">= 0.95",
            score.share_within_5cm >= 0.95,
        ),
        row(f"{name}: seen surface within 10 cm of the mesh", score.seen_share_within_10cm, "share"),
        row(f"{name}: free voxels inside matter", score.free_share_in_matter, "share"),
        row(f"{name}: CPU", cost.cpu_s, "s"),
    ]


def main() -> None:
    arguments = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    arguments.add_argument("--instants", type=int, default=24)
    arguments.add_argument("--share", type=float, default=0.1, help="of the room's loop of 22 m")
    arguments.add_argument("--seed", type=int, default=1)
    arguments.add_argument("--json", type=Path)
    given = arguments.parse_args()
    with tempfile.TemporaryDirectory() as name:
        work = Path(name)
        flight = rendered_world.loop_flight(given.instants, share=given.share)
        flight = dataclasses.replace(flight, times_s=flight.times_s / 4.0)
        rendered_world.write_rendered_sequence(work / "images", rig=glasses(), flight=flight, seed=given.seed)
        odometry(work / "vio.tum", flight, np.random.default_rng(given.seed))
        rows = [*made(work, flight, "alone"), *made(work, flight, "odometry", "--odometry", work / "vio.tum")]
        rows += made(work, flight, "poses", "--poses", work / "vio.tum")
    report.print_table(rows)
    if given.json:
        report.write(rows, given.json)


if __name__ == "__main__":
    main()
