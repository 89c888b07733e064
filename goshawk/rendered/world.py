"""A rendered flight: a rig's images of a room of textured solids, with ground truth of poses and surfaces.

The demo, the examples and the accuracy tests use it.
"""

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.interpolate import CubicSpline

from flight import FloatArray, InputError, Progress, file_format, frames, rotations, silent
from goshawk import _rendering
from goshawk.rendered import scene as rendered_room
from goshawk.rendered.scene import RenderedScene
from mapping.camera import rig as rigs
from mapping.camera.rig import Camera, Rig

NOISE_GREY_LEVELS = 1.6
VIGNETTE = 0.35
GAIN = 230.0
RATE_HZ = 4.0
UP_NOISE_RAD = 0.005
THREADS = 2

# Through both doorways and round the furniture; x, y, z of a closed loop
_LOOP_WORLD_M = np.array(
    [
        [-1.0, -2.05, 1.25],
        [0.0, -2.0, 1.30],
        [1.3, -2.1, 1.45],
        [2.9, -1.7, 1.35],
        [3.4, 0.2, 1.20],
        [2.4, 1.6, 1.40],
        [1.1, 2.05, 1.50],
        [0.0, 2.0, 1.40],
        [-1.4, 1.9, 1.30],
        [-3.2, 1.7, 1.50],
        [-3.9, 0.3, 1.60],
        [-3.5, -1.3, 1.45],
        [-2.4, -1.55, 1.30],
    ]
)

Picture = Callable[[int, int], np.ndarray]
"""The image (height, width) uint8 of an instant and a camera, both by number."""


@dataclass(frozen=True, slots=True, eq=False)
class RenderedFlight:
    """Ground truth of a rendered sequence."""

    times_s: FloatArray
    """(n,) from the first image."""
    T_world_body: FloatArray
    """(n, 4, 4)."""


def default_rig(scale: float = 1.0) -> Rig:
    """Two fisheye cameras of 165 degrees (corner to corner), front and down, 8 cm apart.

    Args:
        scale: 1 gives 640x480; tests use less.
    """
    width, height = round(640 * scale), round(480 * scale)
    focal = 284.0 * width / 640
    params = np.array([focal, focal, width / 2, height / 2, -0.012, 0.002, -0.0008, 0.0001])
    R_body_down = np.array([[0.0, -1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])  # image top is forward
    placed = [
        ("front", rigs.R_BODY_CAMERA_FORWARD, [0.05, 0.0, 0.02]),
        ("down", R_body_down, [-0.01, 0.0, -0.035]),
    ]
    cameras = []
    for name, R_body_camera, t_m in placed:
        T = np.eye(4)
        T[:3, :3], T[:3, 3] = R_body_camera, t_m
        cameras.append(Camera(name, name, "OPENCV_FISHEYE", width, height, params, T, float(np.radians(166.0))))
    return Rig(tuple(cameras))


def loop_flight(count: int, *, share: float = 1.0, through_world_m: FloatArray = _LOOP_WORLD_M) -> RenderedFlight:
    """`count` poses at equal distances along a closed loop (or the first `share` of it), nose along the path.

    The body leans a little, as a quadrotor does when it accelerates.

    Args:
        through_world_m: (k, 3) points of the loop; those of the furnished room by default.
    """
    if count < 2 or not 0.0 < share <= 1.0:
        raise InputError(f"a flight of {count} poses over {share:g} of the loop; at least 2 poses and 0 < share <= 1")
    knots = np.vstack([through_world_m, through_world_m[:1]])
    spline = CubicSpline(np.arange(len(knots)), knots, bc_type="periodic")
    fine = np.linspace(0.0, len(knots) - 1, 4001)
    length = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(spline(fine), axis=0), axis=1))])
    at = np.interp(np.arange(count) / count * share * length[-1], length, fine)
    velocity, bend = spline(at, 1), spline(at, 2)
    yaw = np.arctan2(velocity[:, 1], velocity[:, 0])
    sideways = (velocity[:, 0] * bend[:, 1] - velocity[:, 1] * bend[:, 0]) / np.linalg.norm(velocity, axis=1) ** 2
    roll = -0.10 * np.tanh(sideways)  # into the turn
    pitch = 0.05 + 0.03 * np.sin(2.0 * np.pi * np.arange(count) / 17.0)  # nose down
    lean = np.stack([roll, pitch, np.zeros(count)], axis=1)
    q_world_body = rotations.multiply(rotations.from_yaw(yaw), rotations.exp(lean))
    return RenderedFlight(np.arange(count) / RATE_HZ, frames.transform(q_world_body, spline(at)))


def render(
    camera: Camera,
    T_world_body: FloatArray,
    *,
    scene: RenderedScene,
    seed: int,
    gain: float = GAIN,
    noise: float = NOISE_GREY_LEVELS,
) -> np.ndarray:
    """The image of one camera at one body pose (4, 4): (height, width) uint8; black outside the field of view.

    The same arguments give the same picture, bit for bit, whatever the number of threads.
    """
    return _rendering.render(
        scene.solid_table(),
        scene.material_table(),
        rendered_room.LAMPS_WORLD_M,
        np.ascontiguousarray(camera.unproject(camera.pixel_centres())),
        np.ascontiguousarray(T_world_body @ camera.T_body_camera),
        gain,
        noise,
        VIGNETTE,
        seed,
        THREADS,
    )


def cast_rays(scene: RenderedScene, origin_world_m: FloatArray, directions_world: FloatArray) -> FloatArray:
    """Metres along each unit direction (n, 3) from one origin to the first surface; inf where there is none."""
    directions = np.ascontiguousarray(directions_world, dtype=np.float64)
    ranges, _ = _rendering.cast_rays(scene.solid_table(), np.array(origin_world_m)[None], directions, THREADS)
    return ranges


def write_rendered_sequence(
    folder: Path,
    *,
    rig: Rig | None = None,
    flight: RenderedFlight | None = None,
    scene: RenderedScene | None = None,
    picture: Picture | None = None,
    seed: int = 1,
    progress: Progress = silent,
) -> Path:
    """Render a flight into an image folder that `goshawk map build` reads; 60 pairs of the furnished room by default.

    Writes `CAMERA/0000.png`..., `times.csv`, `references.csv` (the direction of up, as the flight controller of a real
    vehicle knows it), `camera.toml`, and, apart from what a mapper reads, `truth/poses.csv`.

    Args:
        picture: makes the images, instead of `pictures` of `scene`.
    """
    import cv2

    rig = rig or default_rig()
    flight = flight or loop_flight(60)
    picture = picture or pictures(rig, flight, scene or rendered_room.furnished(), seed)
    names = [f"{i:04d}.png" for i in range(len(flight.times_s))]
    with file_format.atomic_folder(Path(folder)) as new:
        for number, camera in enumerate(rig):
            (new / camera.folder).mkdir(parents=True, exist_ok=True)
            for i, name in enumerate(names):
                cv2.imwrite(str(new / camera.folder / name), picture(i, number), [cv2.IMWRITE_PNG_COMPRESSION, 1])
                progress(f"render {camera.name}", (i + 1) / len(names))
        rigs.save(new / "camera.toml", rig)
        rows = (f"{name},{t:.6f}" for name, t in zip(names, flight.times_s, strict=True))
        file_format.write_bytes(new / "times.csv", _csv("image,time_s", rows))
        file_format.write_bytes(new / "references.csv", _up_csv(names, flight, seed))
        file_format.write_bytes(new / "truth" / "poses.csv", _poses_csv(names, flight))
    return Path(folder)


def pictures(rig: Rig, flight: RenderedFlight, scene: RenderedScene, seed: int) -> Picture:
    """The images of a flight, with noise of their own and the camera's slow automatic exposure."""

    def picture(instant: int, number: int) -> np.ndarray:
        gain = GAIN * exposure_change(instant, number)
        noise_seed = seed * 1_000_003 + instant * len(rig) + number
        return render(rig.cameras[number], flight.T_world_body[instant], scene=scene, seed=noise_seed, gain=gain)

    return picture


def exposure_change(index: int, camera_number: int) -> float:
    """The camera's slow automatic exposure: within +-18 %, different for each camera."""
    return 1.0 + 0.18 * float(np.sin(2.0 * np.pi * index / 23.0 + 1.3 * camera_number))


def _poses_csv(names: list[str], flight: RenderedFlight) -> bytes:
    positions = flight.T_world_body[:, :3, 3]
    q = rotations.from_matrix(flight.T_world_body[:, :3, :3])
    rows = (
        ",".join([name, f"{t:.6f}", *(f"{v:.9f}" for v in (*p, *a))])
        for name, t, p, a in zip(names, flight.times_s, positions, q, strict=True)
    )
    return _csv("image,time_s,x_m,y_m,z_m,qw,qx,qy,qz", rows)


def _up_csv(names: list[str], flight: RenderedFlight, seed: int) -> bytes:
    up = flight.T_world_body[:, 2, :3] + UP_NOISE_RAD * np.random.default_rng(seed).normal(size=(len(names), 3))
    rows = (",".join([name, *(f"{v:.6f}" for v in u)]) for name, u in zip(names, up, strict=True))
    return _csv("image,up_body_x,up_body_y,up_body_z", rows)


def _csv(header: str, rows: Iterable[str]) -> bytes:
    return "\n".join([header, *rows, ""]).encode()
