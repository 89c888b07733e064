"""Features are moved to where the centre of their patch of surface is seen."""

import numpy as np
import pytest

from flight import FloatArray, frames
from goshawk.rendered import world as rendered_world
from mapping.camera import rig as rigs
from mapping.camera.adjustment import Observations
from mapping.camera.rig import Rig
from mapping.sparse.calibration import eccentricity
from mapping.sparse.features import features

RIG = Rig(rendered_world.default_rig(0.75).cameras[1:])
DOWN = RIG.cameras[0]
HEIGHT_M, BLOB_M, SPACING_M = 1.2, 0.04, 0.4
PIXELS = DOWN.pixel_centres()[::40, ::40].reshape(-1, 2)


def test_a_lens_without_distortion_sees_a_plane_in_front_without_eccentricity() -> None:
    camera = rigs.forward_camera("PINHOLE", 480, 360, [300.0, 300.0, 240.0, 180.0])
    shift = eccentricity.shift_px(camera, PIXELS, np.tile([0.0, 0.0, 1.0], (len(PIXELS), 1)))
    np.testing.assert_allclose(shift, 0.0, atol=1e-7)


def test_the_sign_of_the_normal_does_not_matter_and_the_edge_of_the_field_is_left_alone() -> None:
    normal = np.tile([0.2, -0.4, -1.0], (len(PIXELS), 1))
    shift = eccentricity.shift_px(DOWN, PIXELS, normal)
    np.testing.assert_allclose(eccentricity.shift_px(DOWN, PIXELS, -normal), shift, atol=1e-12)
    assert np.isfinite(shift).all()
    outside = np.array([[-500.0, -500.0]])
    np.testing.assert_array_equal(eccentricity.shift_px(DOWN, outside, normal[:1]), 0.0)


@pytest.fixture(scope="module")
def blobs() -> tuple[Observations, FloatArray, FloatArray]:
    """Features of round blobs on a floor, their sizes (px), and their errors against the images of the centres (px).

    The cameras stand round the blobs, which so face them in the mean.
    """
    centres = np.zeros((49, 3))
    centres[:, :2] = SPACING_M * (np.indices((7, 7)).reshape(2, -1).T - 3)
    T_world_body = np.tile(np.eye(4), (4, 1, 1))
    T_world_body[:, :3, 3] = [[0.5, 0.0, HEIGHT_M], [-0.5, 0.0, HEIGHT_M], [0.0, 0.5, HEIGHT_M], [0.0, -0.5, HEIGHT_M]]
    rows: list[list[float]] = []
    for instant, T in enumerate(T_world_body @ DOWN.T_body_camera):
        rays = DOWN.unproject(DOWN.pixel_centres()) @ T[:3, :3].T
        floor = T[:2, 3] - rays[..., :2] * (T[2, 3] / rays[..., 2:])
        off_m = np.linalg.norm(floor - SPACING_M * np.clip(np.round(floor / SPACING_M), -3, 3), axis=-1)
        image = np.nan_to_num(60.0 + 150.0 * np.exp(-0.5 * (off_m / BLOB_M) ** 2))
        found = features.find(np.round(image).astype(np.uint8), DOWN.lit().astype(np.uint8) * 255, 500)
        for point, pixel in enumerate(DOWN.project(frames.apply(frames.invert(T), centres))):
            off_px = found.pixels - pixel
            nearest = int(np.argmin(np.linalg.norm(off_px, axis=1)))
            if np.linalg.norm(off_px[nearest]) < 0.5:
                rows.append([point, instant, *found.pixels[nearest], found.size_px[nearest], *off_px[nearest]])
    table = np.array(rows)
    index = np.column_stack([table[:, :2], np.zeros(len(table))]).astype(np.int64)
    seen = Observations(RIG, T_world_body, centres, index, table[:, 2:4], np.arange(4.0))
    return seen, table[:, 4], table[:, 5:]


def share_explained(error_px: FloatArray, predicted_px: FloatArray) -> float:
    """Slope of the errors against the prediction."""
    return float((error_px * predicted_px).sum() / (predicted_px**2).sum())


def test_blobs_on_the_floor_are_seen_off_their_centres_as_predicted(blobs) -> None:
    seen, size_px, error_px = blobs
    floor_normal = np.tile(DOWN.T_body_camera[2, :3], (len(size_px), 1))
    predicted_px = size_px[:, None] ** 2 * eccentricity.shift_px(DOWN, seen.pixels, floor_normal)
    assert len(size_px) > 80
    assert np.sqrt((predicted_px**2).sum(axis=1).mean()) > 0.05
    assert share_explained(error_px, predicted_px) == pytest.approx(1.0, abs=0.15)  # measured .98, noise .05


def test_taking_the_blobs_to_face_their_cameras_in_the_mean_corrects_them(blobs) -> None:
    seen, size_px, error_px = blobs
    corrected_px = seen.pixels - eccentricity.corrected(seen, size_px).pixels
    assert share_explained(error_px, corrected_px) == pytest.approx(1.0, abs=0.25)  # measured 1.01
