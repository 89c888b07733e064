"""What cameras see of points in fast flight, by formula, with errors of theirs planted; and their trial on it."""

import dataclasses

import numpy as np

from flight import FloatArray, frames, rotations
from goshawk.rendered import world as rendered_world
from mapping.camera import trial as trials
from mapping.camera.adjustment import Observations
from mapping.camera.rig import Camera, Rig
from mapping.camera.trial import Trial

RIG = rendered_world.default_rig(0.75)
FOCAL_PX = RIG.cameras[0].focal_px[0]
NOISE_PX = 0.2
RATE_HZ, SHAKE_HZ = 10.0, 11.8


def pose(t_s: FloatArray, shake_rad: float = 0.0) -> FloatArray:
    """(n, 4, 4) of a fast, curved flight at the times (n,): 4 m/s with turns, so that time and shutter show.

    Args:
        shake_rad: amplitude in pitch of a vibration faster than the images.
    """
    positions = np.stack([4.0 * t_s, 1.5 * np.sin(1.5 * t_s), 1.5 + 0.4 * np.cos(2.0 * t_s)], axis=1)
    pitch = 0.15 * np.cos(1.3 * t_s) + shake_rad * np.sin(2.0 * np.pi * SHAKE_HZ * t_s)
    turns = np.stack([0.2 * np.sin(2.0 * t_s), pitch, 0.6 * np.sin(1.1 * t_s)], axis=1)
    return frames.transform(rotations.exp(turns), positions)


TIMES_S = np.arange(24) / RATE_HZ


def observed(
    rig: Rig,
    *,
    offset_s: float = 0.0,
    shutter_s: float = 0.0,
    tangential: float = 0.0,
    shake_rad: float = 0.0,
    unevenly: float = 0.0,
    seed: int = 0,
    at_s: FloatArray = TIMES_S,
) -> tuple[FloatArray, FloatArray, np.ndarray, FloatArray]:
    """Poses, points, (point, instant, camera) and pixels that the true rig sees, with noise."""
    rng = np.random.default_rng(seed)
    points = rng.uniform([-1.0, -5.0, -1.0], [12.0, 5.0, 5.0], (600, 3))
    times_s = at_s + unevenly / RATE_HZ * np.random.default_rng(seed + 1).uniform(-0.5, 0.5, len(at_s))
    index, pixels = [], []
    for number, camera in enumerate(rig):
        for i, t_s in enumerate(times_s):
            seen = image(camera, t_s + (offset_s if number else 0.0), points, shutter_s, tangential, shake_rad)
            inside = np.flatnonzero(camera.contains(seen))
            index.append(np.column_stack([inside, np.full((len(inside), 2), [i, number])]))
            pixels.append(seen[inside] + NOISE_PX * rng.normal(size=(len(inside), 2)))
    return pose(times_s, shake_rad), points, np.concatenate(index), np.concatenate(pixels)


def image(
    camera: Camera, t_s: float, points: FloatArray, shutter_s: float, tangential: float, shake_rad: float = 0.0
) -> FloatArray:
    """(n, 2) pixels of points; each row is read at a time of its own, found by iteration."""
    row_s = np.zeros(len(points))
    for _ in range(4):
        T = pose(t_s + row_s, shake_rad) @ camera.T_body_camera
        inside = np.einsum("nji,nj->ni", T[:, :3, :3], points - T[:, :3, 3])
        flat = camera.project(inside)
        x, y = np.moveaxis((flat - camera.principal_point_px) / camera.focal_px, -1, 0)
        seen = flat + tangential * np.stack([2.0 * x * y, x * x + 3.0 * y * y], axis=-1) * camera.focal_px
        row_s = shutter_s * (np.nan_to_num(seen[:, 1]) / camera.height - 0.5)
    return seen


def tried(true: Rig, told: Rig, **how: float) -> Trial:
    """The trial of the rig that the camera file states, on what the true rig saw."""
    T, points, index, pixels = observed(true, **how)
    rng = np.random.default_rng(9)
    near = points + 0.01 * rng.normal(size=points.shape)
    return trials.hold(Observations(told, T, near, index, pixels, np.arange(len(T)) / RATE_HZ))


def changed(rig: Rig, number: int, **what: object) -> Rig:
    cameras = list(rig.cameras)
    cameras[number] = dataclasses.replace(cameras[number], **what)
    return dataclasses.replace(rig, cameras=tuple(cameras))


def turned(rig: Rig, turn_rad: FloatArray) -> Rig:
    T = rig.cameras[1].T_body_camera.copy()
    T[:3, :3] = T[:3, :3] @ rotations.matrix(rotations.exp(turn_rad))
    return changed(rig, 1, T_body_camera=T)


def lens(rig: Rig, number: int, **added: float) -> Rig:
    names = ("fx", "fy", "cx", "cy", "k1", "k2", "k3", "k4")
    return changed(rig, number, params=rig.cameras[number].params + [added.get(name, 0.0) for name in names])


def scale_error(found: Trial, true: FloatArray) -> float:
    """Relative error of the extent of the path."""
    off = [T[:, :3, 3] - T[:, :3, 3].mean(axis=0) for T in (found.T_world_body, true)]
    return float(np.linalg.norm(off[0]) / np.linalg.norm(off[1]) - 1.0)
