"""Reprojection errors over image, angle and time: what was planted comes back where it was planted, and only there."""

import dataclasses
from pathlib import Path

import numpy as np

from flight import FloatArray, frames
from goshawk.rendered import world as rendered_world
from mapping.camera import residual_field
from mapping.camera.rig import Camera
from mapping.sparse import reconstruction
from tests.mapping.test_map_folder import RIG, sparse_map

CAMERA = rendered_world.default_rig(0.5).cameras[0]
Observed = tuple[Camera, FloatArray, FloatArray, FloatArray]


def seen_by(camera: Camera, *, noise_px: float, count: int = 40_000) -> Observed:
    """Points all over the image of `CAMERA`, seen by another one or by itself, with noise, from the world's origin."""
    rng = np.random.default_rng(4)
    rays = CAMERA.unproject(rng.uniform([0.0, 0.0], [CAMERA.width, CAMERA.height], (count, 2)))
    points = rng.uniform(1.0, 5.0, (count, 1)) * rays
    pixels = camera.project(points) + rng.normal(0.0, noise_px, (count, 2))
    return CAMERA, np.broadcast_to(np.eye(4), (count, 4, 4)), points, pixels


def test_a_planted_pattern_is_found_in_its_cells() -> None:
    camera = rendered_world.default_rig(0.5).cameras[0]
    rng = np.random.default_rng(0)
    pixels = rng.uniform([40.0, 40.0], [camera.width - 40.0, camera.height - 40.0], (20_000, 2))
    pixels = pixels[np.isfinite(camera.unproject(pixels)).all(axis=1)]
    points = 3.0 * camera.unproject(pixels)
    T = np.broadcast_to(np.eye(4), (len(points), 4, 4))
    shifted = pixels + np.where(pixels[:, :1] < camera.width / 2, [0.3, 0.0], [0.0, -0.2])
    found = residual_field.field(camera, T, points, shifted)
    count, mean = np.array(found["count"]), np.array([[m or (np.nan, np.nan) for m in row] for row in found["mean_px"]])
    assert count.shape == (12, 16)
    assert count.sum() == len(points)
    assert (np.array(found["rms_px"], dtype=float)[count > 0] > 0.19).all()
    inner = count > 20
    np.testing.assert_allclose(
        mean[:, :7][inner[:, :7]], np.broadcast_to([0.3, 0.0], (inner[:, :7].sum(), 2)), atol=1e-6
    )
    np.testing.assert_allclose(
        mean[:, 9:][inner[:, 9:]], np.broadcast_to([0.0, -0.2], (inner[:, 9:].sum(), 2)), atol=1e-6
    )


def test_empty_cells_and_points_out_of_view_are_left_out() -> None:
    camera = rendered_world.default_rig(0.5).cameras[0]
    points = np.array([[0.0, 0.0, 2.0], [0.0, 0.0, -2.0]])  # the second is behind the camera
    found = residual_field.field(camera, np.broadcast_to(np.eye(4), (2, 4, 4)), points, camera.project(points))
    assert np.sum(found["count"]) == 1
    assert sum(cell is not None for row in found["rms_px"] for cell in row) == 1


def test_a_planted_radial_distortion_is_the_mean_along_the_radius() -> None:
    """The lens has a larger k1 than the camera file: outwards by f dk1 theta^3 (Kannala and Brandt)."""
    larger_k1 = 0.004
    params = CAMERA.params + larger_k1 * (np.arange(8) == 4)
    found = residual_field.over_radius(*seen_by(dataclasses.replace(CAMERA, params=params), noise_px=0.3))
    bounds_rad = np.array(found["angle_rad"])
    assert len(found["count"]) == residual_field.RINGS == len(bounds_rad) - 1
    np.testing.assert_allclose(np.diff(bounds_rad), bounds_rad[-1] / residual_field.RINGS)
    middle_rad = 0.5 * (bounds_rad[:-1] + bounds_rad[1:])
    formula_px = CAMERA.focal_px[0] * larger_k1 * middle_rad**3
    assert formula_px[-1] > 1.0
    # within a ring the mean of the cube is not the cube of the middle: by 3 theta width^2 / 12, and what lies unevenly
    slope_px = 3.0 * CAMERA.focal_px[0] * larger_k1 * middle_rad**2 * np.diff(bounds_rad)
    off_px = np.abs(np.array(found["mean_radial_px"]) - formula_px)
    assert (off_px < 0.3 * slope_px + 4.0 * 0.3 / np.sqrt(found["count"])).all()


def test_errors_across_the_radius_are_no_radial_mean_but_count_in_the_rms() -> None:
    camera, T, points, pixels = seen_by(CAMERA, noise_px=0.0)
    outwards = pixels - camera.principal_point_px
    across = np.stack([-outwards[:, 1], outwards[:, 0]], axis=1) / np.linalg.norm(outwards, axis=1, keepdims=True)
    found = residual_field.over_radius(camera, T, points, pixels + 0.5 * across)
    np.testing.assert_allclose(found["mean_radial_px"], 0.0, atol=1e-9)
    np.testing.assert_allclose(found["rms_px"], 0.5)


def test_the_rings_end_at_the_largest_angle_that_was_seen() -> None:
    angle_rad = np.array([0.0, 0.1, 0.25, 0.6])
    points = 2.0 * np.stack([np.sin(angle_rad), np.zeros(4), np.cos(angle_rad)], axis=1)
    points = np.vstack([points, [[0.0, 0.0, -2.0]]])  # behind the camera
    T, pixels = np.broadcast_to(np.eye(4), (5, 4, 4)), CAMERA.project(points) + np.array([0.0, 0.2])
    found = residual_field.over_radius(CAMERA, T, points, pixels)
    np.testing.assert_allclose(found["angle_rad"], np.linspace(0.0, 0.6, 13), atol=1e-12)
    assert found["count"] == [1, 0, 1, 0, 0, 1, 0, 0, 0, 0, 0, 1]
    assert [rms is None for rms in found["rms_px"]] == [count == 0 for count in found["count"]]
    nothing = residual_field.over_radius(CAMERA, T[:0], points[:0], pixels[:0])
    assert (nothing["count"], nothing["mean_radial_px"]) == ([0] * 12, [None] * 12)


def test_a_planted_shift_of_one_image_shows_in_that_image_alone() -> None:
    camera, T, points, pixels = seen_by(CAMERA, noise_px=0.3)
    image = np.arange(len(points)) % 10
    pixels = pixels + np.where(image[:, None] == 6, [0.4, -0.7], 0.0)
    found = residual_field.over_time(camera, T, points, pixels, image, 11)
    assert (found["mean_px"][10], found["rms_px"][10]) == (None, None)
    count, mean_px, rms_px = (np.array(found[name][:10]) for name in ("count", "mean_px", "rms_px"))
    std_px = 0.3 / np.sqrt(count)[:, None]
    planted_px = np.where(np.arange(10)[:, None] == 6, [0.4, -0.7], 0.0)
    assert (np.abs(mean_px - planted_px) < 4.0 * std_px).all()
    np.testing.assert_allclose(rms_px, np.sqrt(2.0 * 0.3**2 + (planted_px**2).sum(axis=1)), rtol=0.05)


def test_errors_over_time_have_the_names_and_times_of_the_placed_images(tmp_path: Path) -> None:
    placed = sparse_map(tmp_path)  # its second image has no place, its third one no time
    camera = RIG.cameras[0]
    rays = camera.unproject(np.random.default_rng(5).uniform([20.0, 20.0], [140.0, 100.0], (20, 2)))
    points = frames.apply(placed.T_world_camera(2, 0), rays)
    observations = np.stack([np.arange(20), np.full(20, 2), np.zeros(20, int)], axis=1)
    pixels = camera.project(rays) + np.array([0.5, -0.25])
    placed = dataclasses.replace(placed, points_world_m=points, observations=observations, pixels=pixels)
    (found,) = reconstruction.residuals_over_time(placed)
    assert (found["image"], found["time_s"], found["count"]) == (["a.png", "c.png"], [0.0, None], [0, 20])
    assert found["mean_px"][0] is None
    np.testing.assert_allclose(found["mean_px"][1], [0.5, -0.25], atol=1e-9)
    (rings,) = reconstruction.residuals_over_radius(placed)
    assert (rings["camera"], sum(rings["count"])) == (camera.name, 20)


def test_noise_alone_has_means_within_their_standard_error() -> None:
    observed = seen_by(CAMERA, noise_px=0.3)
    rings = residual_field.over_radius(*observed)
    images = residual_field.over_time(*observed, np.arange(len(observed[2])) % 20, 20)
    for count, mean_px in ((rings["count"], rings["mean_radial_px"]), (images["count"], np.array(images["mean_px"]).T)):
        off = np.array(mean_px) / (0.3 / np.sqrt(count))
        assert np.abs(off).max() < 4.0
        assert 0.5 < np.sqrt((off**2).mean()) < 1.5
    np.testing.assert_allclose(rings["rms_px"], 0.3 * np.sqrt(2.0), rtol=0.1)
