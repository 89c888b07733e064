"""A map as COLMAP's sparse model in text: cameras, the rig, frames, images with what they see, points with colours.

For nerfstudio, Gaussian splatting and COLMAP itself; older readers take `cameras.txt`, `images.txt` and `points3D.txt`.
Metres and the map's world, z up. Images are named relative to the folder that the map was made of.
"""

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from flight import FloatArray, file_format, frames, rotations
from mapping.camera import rig_export
from mapping.camera.rig import Rig
from mapping.sparse.tracks import Tracks

FILES = ("cameras.txt", "rigs.txt", "frames.txt", "images.txt", "points3D.txt")


def write(
    folder: Path,
    rig: Rig,
    images: tuple[str, ...],
    T_world_body: FloatArray,
    shown: NDArray[np.bool_],
    points_world_m: FloatArray,
    colours: NDArray[np.uint8],
    tracks: Tracks,
) -> None:
    """Write the model into a folder.

    Args:
        images: (n,) names of the instants; T_world_body: (n, 4, 4).
        shown: (n, cameras) which images there are.
        points_world_m: (m, 3); colours: (m, 3) RGB.
    """
    rig_export.write_colmap(folder, rig)
    number = np.where(shown, np.cumsum(shown.ravel()).reshape(shown.shape), 0)
    """Of each image, from 1."""
    seen, place = _in_images(tracks, number)
    _write(folder / "frames.txt", "# FRAME_ID RIG_ID RIG_FROM_WORLD NUM_DATA DATA", _frames(rig, T_world_body, number))
    names = [(image, camera.folder) for image in images for camera in rig]
    lines: list[str] = []
    for k, (instant, camera) in enumerate(np.argwhere(shown)):
        T = frames.invert(T_world_body[instant] @ rig.cameras[camera].T_body_camera)
        image, under = names[instant * len(rig) + camera]
        lines += [f"{k + 1} {_pose(T)} {camera + 1} {image if under == '.' else f'{under}/{image}'}", seen[k]]
    _write(folder / "images.txt", "# IMAGE_ID QW QX QY QZ TX TY TZ CAMERA_ID NAME, then X Y POINT3D_ID of each", lines)
    _write(
        folder / "points3D.txt",
        "# POINT3D_ID X Y Z R G B ERROR TRACK (IMAGE_ID, POINT2D_IDX)",
        _points(points_world_m, colours, tracks, number, place),
    )


def _in_images(tracks: Tracks, number: NDArray[np.int64]) -> tuple[list[str], NDArray[np.int64]]:
    """The line of each image with what it sees, and the place of each observation (o,) in its line."""
    image = number[tracks.index[:, 1], tracks.index[:, 2]] - 1
    order = np.argsort(image, kind="stable")
    counts = np.bincount(image, minlength=number.max(initial=0))
    starts = np.cumsum(counts) - counts
    place = np.empty(len(order), np.int64)
    place[order] = np.arange(len(order)) - starts[image[order]]
    words = [f"{x:.3f} {y:.3f} {point + 1}" for (x, y), point in zip(tracks.pixels, tracks.index[:, 0], strict=True)]
    lines = [" ".join(words[k] for k in order[start : start + n]) for start, n in zip(starts, counts, strict=True)]
    return lines, place


def _frames(rig: Rig, T_world_body: FloatArray, number: NDArray[np.int64]) -> list[str]:
    lines = []
    for instant, own in enumerate(number):
        data = [f"CAMERA {camera + 1} {image}" for camera, image in enumerate(own) if image]
        T = frames.invert(T_world_body[instant] @ rig.cameras[0].T_body_camera)
        lines.append(f"{instant + 1} 1 {_pose(T)} {len(data)} {' '.join(data)}")
    return lines


def _points(
    points_world_m: FloatArray,
    colours: NDArray[np.uint8],
    tracks: Tracks,
    number: NDArray[np.int64],
    place: NDArray[np.int64],
) -> list[str]:
    seen_by: list[list[str]] = [[] for _ in points_world_m]
    for (point, instant, camera), k in zip(tracks.index, place, strict=True):
        seen_by[point].append(f"{number[instant, camera]} {k}")
    return [
        " ".join([str(k + 1), *(f"{v:.6f}" for v in xyz), *(str(int(c)) for c in rgb), "0", *seen])
        for k, (xyz, rgb, seen) in enumerate(zip(points_world_m, colours, seen_by, strict=True))
    ]


def _pose(T: FloatArray) -> str:
    return " ".join(f"{value:.17g}" for value in (*rotations.from_matrix(T[:3, :3]), *T[:3, 3]))


def _write(path: Path, head: str, lines: list[str]) -> None:
    file_format.write_bytes(path, ("\n".join([head, *lines]) + "\n").encode())
