"""A rendered rig of two fisheye cameras: metric poses from its 8 cm baseline alone, and new images found in the map."""

import dataclasses
from pathlib import Path

import numpy as np
import pytest

import mapping
from flight import FloatArray, frames, rotations
from goshawk.rendered import world as rendered_world
from goshawk.rendered.world import RenderedFlight
from mapping.camera import rig as rigs
from mapping.localization import relocalization
from mapping.sparse import reconstruction
from mapping.sparse.features import features
from mapping.sparse.mapper.colmap import SparseOptions
from mapping.sparse.reconstruction import SparseMap

pytestmark = pytest.mark.slow

SHARE = 0.3
SCALE = 0.75


def render(folder: Path, flight: RenderedFlight, seed: int) -> Path:
    return rendered_world.write_rendered_sequence(
        folder, rig=rendered_world.default_rig(SCALE), flight=flight, seed=seed
    )


@pytest.fixture(scope="module")
def folders(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path, RenderedFlight, RenderedFlight]:
    """Twice the instants are flown; every other one makes the map, those between are looked up in it."""
    base = tmp_path_factory.mktemp("rendered")
    flight = rendered_world.loop_flight(33, share=SHARE)
    known, asked = (RenderedFlight(flight.times_s[k::2].copy(), flight.T_world_body[k::2].copy()) for k in (0, 1))
    return render(base / "known", known, 1), render(base / "asked", asked, 2), known, asked


@pytest.fixture(scope="module")
def placed(folders: tuple[Path, Path, RenderedFlight, RenderedFlight]) -> SparseMap:
    folder = folders[0]
    return reconstruction.reconstruct(mapping.read_folder(folder, rigs.load(folder / "camera.toml")))


def onto(truth: FloatArray, found: FloatArray) -> FloatArray:
    """The rigid motion (4, 4), no scale, that brings the found poses' positions closest to the truth."""
    a, b = found[:, :3, 3], truth[:, :3, 3]
    U, _, Vt = np.linalg.svd((b - b.mean(0)).T @ (a - a.mean(0)))
    T = np.eye(4)
    T[:3, :3] = U @ np.diag([1.0, 1.0, np.linalg.det(U @ Vt)]) @ Vt
    T[:3, 3] = b.mean(0) - T[:3, :3] @ a.mean(0)
    return T


def errors(truth: FloatArray, found: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Metres and radians."""
    off_m = np.linalg.norm(truth[:, :3, 3] - found[:, :3, 3], axis=1)
    q_truth, q_found = (rotations.from_matrix(T[:, :3, :3]) for T in (truth, found))
    return off_m, rotations.angle_between(q_truth, q_found)


def test_rig_baseline_gives_metres(placed: SparseMap, folders) -> None:
    truth = folders[2].T_world_body
    assert placed.registered.all()
    assert placed.alignment.scale_source == "rig baseline"
    ours, true = (np.linalg.norm(np.diff(T[:, :3, 3], axis=0), axis=1).sum() for T in (placed.T_world_body, truth))
    assert ours / true == pytest.approx(1.0, abs=0.002)
    assert placed.reprojection_error_px < 0.5


def test_the_reprojection_error_is_of_the_features_as_the_adjustment_moved_them(placed: SparseMap) -> None:
    point, instant, number = placed.observations.T
    error_px = np.zeros(len(point))
    for k, camera in enumerate(placed.rig):
        own = number == k
        T_camera_world = frames.invert(placed.T_world_body[instant[own]] @ camera.T_body_camera)
        seen = camera.project(frames.apply(T_camera_world, placed.points_world_m[point[own]]))
        error_px[own] = np.linalg.norm(placed.pixels[own] - seen, axis=1)
    of_points = np.bincount(point, error_px) / np.bincount(point)
    assert placed.reprojection_error_px == pytest.approx(of_points.mean(), rel=1e-6)
    first = (instant == 0) & (number == 0)
    lit = placed.rig.cameras[0].lit().astype(np.uint8) * 255
    corners = features.find(placed.images.gray(0, 0), lit, SparseOptions().features).pixels
    moved_px = np.linalg.norm(placed.pixels[first, None] - corners, axis=2).min(axis=1)
    assert 0.001 < np.median(moved_px) < 0.2


def test_poses_are_true(placed: SparseMap, folders) -> None:
    truth = folders[2].T_world_body
    off_m, off_rad = errors(truth, onto(truth, placed.T_world_body) @ placed.T_world_body)
    assert off_m.max() < 0.02
    assert np.degrees(off_rad).max() < 0.1


def test_world_is_upright(placed: SparseMap, folders) -> None:
    assert placed.alignment.up_source == "recorded gravity"
    up_true, up_ours = folders[2].T_world_body[:, 2, :3], placed.T_world_body[:, 2, :3]
    assert np.degrees(np.arccos((up_true * up_ours).sum(axis=1))).max() < 0.5


def test_images_taken_between_are_found_in_the_map(placed: SparseMap, folders) -> None:
    _, folder, known, asked = folders
    images = mapping.read_folder(folder, rigs.load(folder / "camera.toml"))
    answer = relocalization.localize(placed.localization_map(), images)
    assert answer.failed == ()
    T = onto(known.T_world_body, placed.T_world_body)
    off_m, off_rad = errors(asked.T_world_body, T @ answer.T_world_body)
    assert off_m.max() < 0.05
    assert np.degrees(off_rad).max() < 2.0


def test_a_camera_file_is_corrected_by_the_matches_of_the_corrected_map(folders) -> None:
    """The down camera is turned by 1 deg, which makes the first map a fifth too large, of matches that fit it."""
    folder, truth = folders[0], folders[2].T_world_body
    right, turn_rad = rigs.load(folder / "camera.toml"), np.radians([0.6, 0.6, -0.5])
    T = right.cameras[1].T_body_camera.copy()
    T[:3, :3] = T[:3, :3] @ rotations.matrix(rotations.exp(-turn_rad))
    told = dataclasses.replace(
        right, cameras=(right.cameras[0], dataclasses.replace(right.cameras[1], T_body_camera=T))
    )
    made = reconstruction.reconstruct(mapping.read_folder(folder, told))
    (finding,) = made.trial.present
    assert str(finding.candidate) == "down: rotation on the body"
    np.testing.assert_array_less(np.abs(finding.size - turn_rad), 4.0 * finding.std)
    ours, true = (np.linalg.norm(np.diff(T[:, :3, 3], axis=0), axis=1).sum() for T in (made.T_world_body, truth))
    assert ours / true == pytest.approx(1.0, abs=4.0 * made.trial.scale_std)
    # the trial is of the map as it is now, so its certainty is that of these poses
    steps, tried = (frames.invert(T[0]) @ T for T in (made.T_world_body, made.trial.T_world_body))
    np.testing.assert_allclose(steps, tried, atol=1e-9)


def test_one_camera_of_the_rig_is_enough_to_be_found(placed: SparseMap, folders) -> None:
    _, folder, known, asked = folders
    rig = rigs.load(folder / "camera.toml")
    images = mapping.read_folder(folder, dataclasses.replace(rig, cameras=rig.cameras[:1]))
    answer = relocalization.localize(placed.localization_map(), images)
    off_m, off_rad = errors(asked.T_world_body, onto(known.T_world_body, placed.T_world_body) @ answer.T_world_body)
    assert (off_m < 0.05).mean() > 0.9
    assert (np.degrees(off_rad) < 2.0).mean() > 0.9


def test_images_of_noise_are_not_found(placed: SparseMap, tmp_path: Path) -> None:
    import cv2

    rng = np.random.default_rng(8)
    rig = dataclasses.replace(placed.rig, cameras=placed.rig.cameras[:1])
    (tmp_path / "front").mkdir()
    for k in range(2):
        noise = cv2.GaussianBlur(
            rng.integers(0, 255, (rig.cameras[0].height, rig.cameras[0].width)).astype(np.uint8), (9, 9), 2.0
        )
        cv2.imwrite(str(tmp_path / "front" / f"{k}.png"), noise)
    answer = relocalization.localize(placed.localization_map(), mapping.read_folder(tmp_path, rig))
    assert answer.failed == ("0.png", "1.png")
    assert np.isnan(answer.T_world_body).all()
