"""Recorded poses place images where the matches agree with them, whatever thing was tracked; else they say why not."""

import dataclasses
from pathlib import Path

import numpy as np
import pycolmap
import pytest

from flight import FloatArray, MapError, frames, rotations, silent
from goshawk.rendered import world as rendered_world
from mapping.camera import trial
from mapping.camera.pose_priors import Recorded
from mapping.input.depth_images import DepthFolder
from mapping.input.images import ImageSet
from mapping.input.trajectory import Motion, MotionKind, Trajectory
from mapping.sparse.calibration import calibration
from mapping.sparse.mapper import colmap, colmap_model, known_poses
from mapping.sparse.mapper.colmap import PlacedImages, SparseOptions
from mapping.sparse.mapper.known_poses import KnownPoses

COUNT, WINDOW, NOISE_PX = 16, 3, 0.3
RIG = rendered_world.default_rig()
TIME_S = 10.0 + np.arange(COUNT) / 4.0
FINE_S = np.linspace(9.0, 15.0, 241)
T_TRACKED_BODY = frames.transform(rotations.exp([0.4, -1.2, 2.3]), [0.02, -0.03, 0.01])


def flown(time_s: FloatArray) -> FloatArray:
    """(n, 4, 4) of the body: once round a loop, with turns about all axes."""
    t = np.asarray(time_s) - TIME_S[0]
    angle = 2.0 * np.pi * t / 4.0
    turns = np.stack([0.2 * np.sin(2.3 * t), 0.2 * np.cos(1.9 * t), 0.5 * np.sin(angle)], axis=-1)
    path = np.stack([1.2 * np.cos(angle), 1.2 * np.sin(angle), 1.5 + 0.2 * np.sin(2.0 * t)], axis=-1)
    return frames.transform(rotations.exp(turns), path)


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, ImageSet]:
    """Features of points on the walls of a room, matched and verified by COLMAP, as `colmap.match` leaves them."""
    folder = tmp_path_factory.mktemp("known")
    names = tuple(f"{i:04d}.png" for i in range(COUNT))
    images = ImageSet(folder, RIG, names, np.ones((COUNT, len(RIG)), bool), TIME_S)
    return database_of(folder / "database.db", images, flown(TIME_S)), images


def database_of(path: Path, images: ImageSet, T_world_body: FloatArray, points: int = 900) -> Path:
    rng = np.random.default_rng(0)
    places = rng.uniform(-1.0, 1.0, (points, 3))
    places /= np.abs(places).max(axis=1, keepdims=True)  # on a cube
    places = places * [4.0, 4.0, 2.0] + [0.0, 0.0, 1.5]
    seen: dict[int, dict[int, int]] = {}
    with pycolmap.Database.open(path) as opened:
        colmap._write_rig(opened, images.rig)
        instants = [pycolmap.Frame(rig_id=1) for _ in images.instants]
        for i, c in images.pairs():
            camera = images.rig.cameras[c]
            pixels = camera.project(frames.apply(frames.invert(T_world_body[i] @ camera.T_body_camera), places))
            shown = np.flatnonzero(camera.contains(pixels))
            keypoints = pixels[shown] + NOISE_PX * rng.normal(size=(len(shown), 2))
            image = pycolmap.Image(name=images.relative(i, c), keypoints=np.zeros((0, 2)), camera_id=c + 1)
            image_id = opened.write_image(image)
            opened.write_keypoints(image_id, np.column_stack([keypoints, np.ones((len(shown), 2))]).astype(np.float32))
            instants[i].add_data_id(pycolmap.data_t(pycolmap.sensor_t(pycolmap.SensorType.CAMERA, c + 1), image_id))
            seen[image_id] = {int(point): k for k, point in enumerate(shown)}
        for frame in instants:
            opened.write_frame(frame)
        pairs = [(a, b) for a in seen for b in seen if a < b]
        named = {row.image_id: row.name for row in opened.read_all_images()}
        for a, b in pairs:
            both = sorted(seen[a].keys() & seen[b].keys())
            opened.write_matches(a, b, np.array([[seen[a][p], seen[b][p]] for p in both], np.uint32).reshape(-1, 2))
    (path.parent / "pairs.txt").write_text("".join(f"{named[a]} {named[b]}\n" for a, b in pairs))
    pycolmap.verify_matches(path, path.parent / "pairs.txt", pycolmap.TwoViewGeometryOptions())
    return path


def recorded(
    images: ImageSet, T: FloatArray, time_s: FloatArray = FINE_S, kind: MotionKind = MotionKind.POSES
) -> ImageSet:
    return dataclasses.replace(images, motions=(Motion(kind, Trajectory(Path("vio.tum"), time_s, T)),))


def find(
    made: tuple[Path, ImageSet], T: FloatArray, time_s: FloatArray = FINE_S
) -> tuple[KnownPoses | None, list[str]]:
    database, images = made
    return known_poses.find(database, recorded(images, T, time_s), WINDOW)


def noisy(T: FloatArray, turn_rad: float = np.radians(0.2), shift_m: float = 0.01) -> FloatArray:
    rng = np.random.default_rng(1)
    turns, shifts = (std * rng.normal(size=(len(T), 3)) for std in (turn_rad, shift_m))
    return T @ frames.transform(rotations.exp(turns), shifts)


@pytest.mark.parametrize(
    ("of", "T_body_tracked"),
    [
        ("the body", np.eye(4)),
        ("camera down", RIG["down"].T_body_camera),
        ("a thing turned against the body", frames.invert(T_TRACKED_BODY)),
    ],
)
def test_poses_of_whatever_was_tracked_place_all_images(made, of: str, T_body_tracked: FloatArray) -> None:
    T_start_world = frames.transform(rotations.from_yaw(1.0), [5.0, 2.0, 1.0])
    known, notes = find(made, noisy(T_start_world @ flown(FINE_S) @ T_body_tracked))
    assert known is not None, notes
    assert known.of == of
    off = frames.invert(known.T_world_body) @ T_start_world @ flown(TIME_S)
    assert np.linalg.norm(rotations.log(rotations.from_matrix(off[:, :3, :3])), axis=1).max() < np.radians(2.0)
    assert np.linalg.norm(off[:, :3, 3], axis=1).max() < 0.08  # with the centimetres between the two
    assert f"placed {COUNT} of {COUNT}" in known_poses.placed_text(known)


def test_an_instant_whose_matches_contradict_its_pose_is_left_to_the_matches(made) -> None:
    T = flown(TIME_S)
    T[5] = T[5] @ frames.transform(rotations.exp([0.0, 0.3, 0.3]), [0.5, -0.4, 0.0])
    known, _ = find(made, T, TIME_S)
    assert known is not None
    assert np.flatnonzero(np.isnan(known.T_world_body[:, 0, 0])).tolist() == [5]


@pytest.mark.parametrize(
    ("wrong", "said"),
    [
        (lambda T: frames.invert(T), "world to body"),
        (lambda T: reordered(T, [3, 0, 1, 2]), "scalar stands last"),
        (lambda T: reordered(T, [1, 2, 3, 0]), "scalar stands first"),
        (lambda T: other_axes(T, np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])), "north, east, down"),
        (lambda T: mirrored(T, np.diag([1.0, -1.0, 1.0])), "left-handed"),
    ],
)
def test_poses_that_are_misread_place_none_and_say_how_they_would_fit(made, wrong, said: str) -> None:
    known, (note,) = find(made, wrong(flown(FINE_S)))
    assert known is None
    assert "recorded poses (vio.tum) place no image: only" in note
    assert said in note


def reordered(T: FloatArray, order: list[int]) -> FloatArray:
    other = T.copy()
    other[:, :3, :3] = rotations.matrix(rotations.from_matrix(T[:, :3, :3])[:, order])
    return other


def other_axes(T: FloatArray, M: FloatArray) -> FloatArray:
    """Positions in axes of their own."""
    other = T.copy()
    other[:, :3, 3] = T[:, :3, 3] @ M.T
    return other


def mirrored(T: FloatArray, M: FloatArray) -> FloatArray:
    other = other_axes(T, M)
    other[:, :3, :3] = M @ T[:, :3, :3] @ M
    return other


@pytest.mark.parametrize("late_s", [0.2, -0.5])
def test_a_clock_that_is_off_is_named_with_its_sign(made, late_s: float) -> None:
    known, (note,) = find(made, flown(FINE_S), FINE_S + late_s)
    assert known is None
    assert f"about {abs(late_s):g} s {'late' if late_s > 0.0 else 'early'}" in note


def test_another_flight_places_none_and_nothing_is_guessed(made) -> None:
    other = frames.transform(
        rotations.exp(np.stack([0.0 * FINE_S, 0.3 * FINE_S, 0.9 * FINE_S], 1)), flown(FINE_S)[:, :3, 3]
    )
    known, (note,) = find(made, other)
    assert known is None
    assert "they fit if" not in note


def test_poses_that_drift_do_not_hold_the_two_ends_of_a_loop_apart(made) -> None:
    T = flown(TIME_S)
    T[:, 2, 3] += 0.03 * np.arange(COUNT)
    known, (note,) = find(made, T, TIME_S)
    assert known is None
    assert "they drift" in note


def test_a_recording_of_other_times_says_that_it_covers_no_matches(made) -> None:
    known, (note,) = find(made, flown(FINE_S), FINE_S + 100.0)
    assert known is None
    assert "no two consecutive images that they cover" in note


def test_the_points_are_triangulated_at_the_poses_and_adjusted_to_the_truth(made) -> None:
    database, images = made
    beside = recorded(images, noisy(flown(FINE_S)))
    model, known, notes = colmap.place_beside(database, beside, SparseOptions(window=WINDOW), silent)
    assert known is not None, notes
    assert "vio.tum" in notes[-1]
    colmap.refine(database, model, RIG, SparseOptions(), silent)
    adjusted = trial.hold(colmap_model.observations(model, images))
    assert colmap_model.poses(model, images)[1].all()
    assert not adjusted.present
    moved = frames.invert(adjusted.T_world_body[:1]) @ adjusted.T_world_body
    true = frames.invert(flown(TIME_S)[:1]) @ flown(TIME_S)
    length = np.linalg.norm(moved[:, :3, 3], axis=1).sum() / np.linalg.norm(true[:, :3, 3], axis=1).sum()
    assert abs(length - 1.0) < 3.0 * adjusted.scale_std  # by the rig's 8 cm, whatever the poses say
    assert np.linalg.norm(moved[:, :3, 3] / length - true[:, :3, 3], axis=1).max() < 0.004


def test_where_neither_matches_nor_poses_place_images_both_reasons_are_said(tmp_path: Path) -> None:
    names = tuple(f"{i:04d}.png" for i in range(4))
    images = ImageSet(tmp_path, RIG, names, np.ones((4, len(RIG)), bool), TIME_S[:4])
    turning = frames.transform(rotations.from_yaw(0.05 * np.arange(4.0)), np.zeros((4, 3)))
    database = database_of(tmp_path / "database.db", images, turning, points=60)
    with pytest.raises(MapError, match=r"(?s)no two of these images could be placed.*vio\.tum\) place no image"):
        colmap.place_beside(database, recorded(images, frames.invert(flown(FINE_S))), SparseOptions(), silent)


def test_only_poses_that_placed_images_without_depth_are_priors(made) -> None:
    _, images = made
    T_tracked_body = frames.invert(RIG["down"].T_body_camera)
    body = {MotionKind.POSES: T_tracked_body, MotionKind.ODOMETRY: T_tracked_body}

    agreeing = list(range(len(TIME_S)))

    def priors(images: ImageSet, tracked_body: dict[str, FloatArray]) -> Recorded | None:
        placed = PlacedImages(Path("db"), Path("model"), 0.0, [], [], tracked_body, {}, {MotionKind.POSES: agreeing})
        return calibration._recorded(images, placed)

    beside = recorded(images, flown(FINE_S + 0.05))
    found = priors(beside, body)
    assert found is not None
    assert found.is_dense
    np.testing.assert_array_equal(found.T_tracked_body, T_tracked_body)
    np.testing.assert_allclose(found.at(-0.05), flown(TIME_S), atol=2e-3)
    agreeing.remove(2)  # as beyond a jump
    masked = priors(beside, body)
    assert masked is not None
    assert np.flatnonzero(np.isnan(masked.at(-0.05)[:, 0, 0])).tolist() == [2]
    assert priors(beside, {}) is None
    assert priors(recorded(images, flown(FINE_S), kind=MotionKind.ODOMETRY), body) is None
    assert priors(dataclasses.replace(beside, depths=DepthFolder(Path("depth"))), body) is None
    sparse = priors(recorded(images, flown(TIME_S), TIME_S), body)
    assert sparse is not None
    assert not sparse.is_dense
