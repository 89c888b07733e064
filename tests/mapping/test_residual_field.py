"""Reprojection errors over the image: a planted pattern comes back, cell by cell."""

import numpy as np

from goshawk.rendered import world as rendered_world
from mapping.camera import residual_field


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
