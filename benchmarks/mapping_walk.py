"""A recorded walk beside a house (gopro_max_walk): poses against the camera's own record, the house wall, the lens.

The recording has no scan of the house. Its wall is the upright plane along the path, left of it, that holds most of
the map's points, moved to where the images agree best on its paint (a plane sweep: Collins, "A space-sweep approach to
true multi-image matching", 1996); windows, which are set back and reflect, are left out by their colour.
"""

import importlib.util
import json
from pathlib import Path
from types import ModuleType

import mapping_whole
import numpy as np
import report
from report import Row, row
from scipy.spatial.transform import Rotation

import mapping
from esdf import FREE, OCCUPIED
from flight import FloatArray, frames, rotations
from mapping.camera import rig as rigs
from mapping.sparse import reconstruction

CARRIER_M = 0.45
BEHIND_M = 0.10
NEAR_M, STEP_M, LEAST_VIEWS = 6.0, 0.05, 3
PLANE_M = 0.04
"""Points this near to a plane are of it."""
TURNS_RAD, SHIFTS_M = np.radians(np.arange(-1.5, 1.6, 0.25)), np.arange(-0.2, 0.21, 0.05)
"""Of the plane sweep: a wall holds few points, and these leave the plane uncertain by as much."""
SWEPT_BLUR_PX = 8.0
"""The sweep compares what differs from the mean over so many pixels: exposure and sky light play no part."""
HEIGHTS_M = (-0.2, 1.5)
"""Of the wall, over the path's mean: above the bushes."""
LEAST_RED_OVER_BLUE, LEAST_GREY = 10.0, 90.0
"""Of the wall's paint, in grey levels; panes of glass are blue or dark."""
FISHEYE_BELOW = 1.0 / 6.0
"""First coefficient of RADIAL_FISHEYE: 0 of a fisheye, 1/3 of an ordinary lens."""


def walk(work: Path, data: Path) -> list[Row]:
    """The map with a rough lens given, and with none."""
    tool = _converter()
    images = work / "images"
    work.mkdir(parents=True)
    tool.convert(data, images)
    cost = mapping_whole.command(
        "map", "build", images, "--camera", images / "camera.toml", "--out", work / "map", "--carrier-radius", CARRIER_M
    )
    made, figures = mapping.open_map(work / "map"), json.loads((work / "map" / "report.json").read_text())
    recorded = tool.image_rotations(data, list(made.images))
    rows = [
        *_poses("walk", made.T_world_body, recorded, float(figures["reprojection_error_px"])),
        *wall(made, images),
        row("walk: CPU", cost.cpu_s, "s"),
        row("walk: memory, largest process", cost.largest_mib, "MiB"),
    ]
    report.print_table(rows)
    rows += untold(tool, data, work, images)
    return rows


def untold(tool: ModuleType, data: Path, work: Path, images: Path) -> list[Row]:
    """The lens from the images alone (`goshawk camera new`), and the poses with it."""
    cost = mapping_whole.command("camera", "new", images, "--out", work / "guessed.toml")
    lens = rigs.load(work / "guessed.toml").cameras[0]
    placed = reconstruction.reconstruct(mapping.read_folder(images, rigs.load(work / "guessed.toml")))
    T_found = placed.T_world_body[placed.placed]
    names = [name for name, is_placed in zip(placed.images.instants, placed.placed, strict=True) if is_placed]
    rows = [
        row("lens untold: is a fisheye", lens.params[3] < FISHEYE_BELOW, "0 or 1", "1", lens.params[3] < FISHEYE_BELOW),
        row("lens untold: focal length", lens.focal_px[0], "px"),
        row("lens untold: CPU of the guess", cost.cpu_s, "s"),
        *_poses("lens untold", T_found, tool.image_rotations(data, names), placed.reprojection_error_px),
    ]
    report.print_table(rows)
    return rows


def _poses(name: str, T_world_body: FloatArray, q_recorded: FloatArray, left_px: float) -> list[Row]:
    off_rad, count = attitude_errors(T_world_body, q_recorded), len(T_world_body)
    rms_deg = float(np.degrees(np.sqrt(np.mean(off_rad[1:] ** 2))))
    return [
        row(f"{name}: placed", count, "images", "53", count == 53),
        row(f"{name}: reprojection error", left_px, "px", "<= 0.62", left_px <= 0.62),
        row(f"{name}: attitude, RMS", rms_deg, "deg", "<= 0.3", rms_deg <= 0.3),
    ]


def attitude_errors(T_world_body: FloatArray, q_recorded: FloatArray) -> FloatArray:
    """(n,) rad, of the rotation since the first image, after one constant alignment of axes."""
    q = rotations.from_matrix(T_world_body[:, :3, :3])
    ours, theirs = (rotations.log(rotations.multiply(rotations.conjugate(a[0]), a)) for a in (q, q_recorded))
    axes, _ = Rotation.align_vectors(theirs, ours)
    return rotations.angle_between(rotations.exp(axes.apply(ours)), rotations.exp(theirs))


def wall(placed: mapping.Map, images: Path) -> list[Row]:
    """What the map says of the house wall, and of what is behind it."""
    face, outward = wall_face(placed, images)
    occupied, inferred, marked = np.zeros(len(face), bool), np.zeros(len(face), bool), placed.inferred()
    for shift_m in (-1.0, 0.0, 1.0):  # a voxel to each side: the plane is known to some centimetres
        shifted = face + shift_m * STEP_M * outward
        occupied |= _state(placed, shifted) == OCCUPIED
        inside = placed.field.grid.contains(shifted)
        inferred[inside] |= marked[tuple(placed.field.grid.index(shifted[inside]).T)]
    on_face, behind = _state(placed, face), _state(placed, face - BEHIND_M * outward)
    shown, free = float((occupied | inferred).mean()), float((behind == FREE).mean())
    return [
        row("walk, wall: scored", len(face) * STEP_M**2, "m2"),
        row("walk, wall: occupied within 5 cm", float(occupied.mean()), "share"),
        row("walk, wall: occupied or inferred within 5 cm", shown, "share", ">= 0.7", shown >= 0.7),
        row("walk, wall: free", float((on_face == FREE).mean()), "share"),
        row("walk, wall: free 10 cm behind", free, "share", "<= 0.01", free <= 0.01),
    ]


def _state(placed: mapping.Map, points: FloatArray) -> np.ndarray:
    """(n,) voxel states; unknown outside of the map."""
    grid, state = placed.field.grid, placed.field.state
    found = np.full(len(points), 255, np.uint8)
    inside = grid.contains(points)
    found[inside] = state[tuple(grid.index(points[inside]).T)]
    return found


def wall_face(placed: mapping.Map, images: Path) -> tuple[FloatArray, FloatArray]:
    """(n, 3) points on the painted wall that at least three near images show, and its normal towards the path."""
    track = placed.T_world_body[:, :3, 3]
    middle = track.mean(axis=0)
    forward = track[-1, :2] - track[0, :2]
    heading = float(np.arctan2(forward[1], forward[0]))
    points = placed.localization_map().points_world_m - middle
    points = points[(points[:, 2] > -1.0) & (points[:, 2] < 3.0)]
    best, offset_m, normal = 0, 0.0, np.zeros(3)
    for turn_deg in np.arange(-10.0, 10.1, 0.25):
        angle = heading + np.radians(90.0 + turn_deg)
        left = np.array([np.cos(angle), np.sin(angle), 0.0])
        distance_m = np.sort(points @ left)
        distance_m = distance_m[distance_m > 1.0]
        inside = np.searchsorted(distance_m, distance_m + 2.0 * PLANE_M) - np.arange(len(distance_m))
        if inside.max() > best:
            best, normal = int(inside.max()), left
            first = int(inside.argmax())
            offset_m = float(np.median(distance_m[first : first + best]))
    ahead = np.array([normal[1], -normal[0], 0.0])
    along_m = (track - middle) @ ahead
    x, z = np.meshgrid(np.arange(along_m.min(), along_m.max() + NEAR_M, STEP_M), np.arange(*HEIGHTS_M, STEP_M))
    face = middle + offset_m * normal + x.reshape(-1, 1) * ahead + z.reshape(-1, 1) * [0.0, 0.0, 1.0]
    shift_m, turn_rad = _agreed(placed, images, face[_is_painted(placed, images, face)], -normal)
    face, outward = _moved(face, -normal, shift_m, turn_rad)
    return face[_is_painted(placed, images, face)], outward


def _moved(face: FloatArray, outward: FloatArray, shift_m: float, turn_rad: float) -> tuple[FloatArray, FloatArray]:
    """A plane's points (n, 3) and its normal, turned about the vertical through their mean and shifted outwards."""
    R, centre = rotations.matrix(rotations.from_yaw(turn_rad)), face.mean(axis=0)
    return centre + (face - centre) @ R.T + shift_m * R @ outward, R @ outward


def _agreed(placed: mapping.Map, images: Path, face: FloatArray, outward: FloatArray) -> tuple[float, float]:
    """The shift in metres and the turn in radians of the plane on which the images agree best."""
    import cv2

    camera, detail = placed.rig.cameras[0], []
    for name in placed.images:
        image = np.asarray(cv2.imread(str(images / name), cv2.IMREAD_GRAYSCALE), np.float32)
        detail.append(image - cv2.GaussianBlur(image, (0, 0), SWEPT_BLUR_PX))

    def agreement(moved: FloatArray) -> float:
        """Share of the images' variance at all points that is not between images of the same point."""
        count, total, square = np.zeros((3, len(moved)))
        for image, T in zip(detail, placed.T_world_body, strict=True):
            points = frames.apply(frames.invert(T @ camera.T_body_camera), moved)
            pixels = camera.project(points)
            shown = np.flatnonzero(camera.contains(pixels) & (np.linalg.norm(points, axis=1) < NEAR_M))
            if len(shown):
                column, line = (pixels[shown].T - 0.5).astype(np.float32)
                value = np.ravel(cv2.remap(image, column, line, cv2.INTER_LINEAR))
                count[shown] += 1
                total[shown] += value
                square[shown] += value**2
        used = count >= LEAST_VIEWS
        return float((total[used] ** 2 / count[used]).sum() / square[used].sum())

    tried = [(shift_m, turn_rad) for shift_m in SHIFTS_M for turn_rad in TURNS_RAD]
    return max(tried, key=lambda change: agreement(_moved(face, outward, *change)[0]))


def _is_painted(placed: mapping.Map, images: Path, face: FloatArray) -> np.ndarray:
    """(n,) whether enough images show a point near by, and most of them in the colour of paint."""
    import cv2

    camera = placed.rig.cameras[0]
    seen, painted = np.zeros(len(face), int), np.zeros(len(face), int)
    for name, T in zip(placed.images, placed.T_world_body, strict=True):
        image = cv2.imread(str(images / name)).astype(float)
        points = frames.apply(frames.invert(T @ camera.T_body_camera), face)
        pixels = camera.project(points)
        shown = np.flatnonzero(camera.contains(pixels) & (np.linalg.norm(points, axis=1) < NEAR_M))
        column, line = np.floor(pixels[shown]).astype(int).T
        blue, _, red = image[line, column].T
        seen[shown] += 1
        painted[shown] += (red - blue > LEAST_RED_OVER_BLUE) & (image[line, column].mean(axis=1) > LEAST_GREY)
    return (seen >= LEAST_VIEWS) & (painted > 0.5 * seen)


def _converter() -> ModuleType:
    path = Path(__file__).parents[1] / "tools" / "gopro_references.py"
    spec = importlib.util.spec_from_file_location("gopro_references", path)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module
