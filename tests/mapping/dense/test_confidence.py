"""How well the measured surface is known: the stated deviation is what the surface is off by."""

from pathlib import Path

import numpy as np
import pytest

from esdf import Grid
from flight import FormatError
from goshawk.rendered import scene as rendered_room
from goshawk.rendered import world as rendered_world
from mapping import confidence_layer
from mapping.camera.rig import Camera
from mapping.dense import confidence, stereo, surface
from mapping.dense.confidence import MeasuredSurface, SurfaceConfidence
from mapping.dense.surface import DenseOptions, ImageView
from tests.mapping.dense.volumes import filled, in_bricks, whole_volume

VOXEL_M = 0.05
CAMERA = Camera("front", ".", "PINHOLE", 64, 48, np.array([40.0, 40.0, 32.0, 24.0]), np.eye(4))
VIEW = ImageView(CAMERA, np.eye(4), np.zeros((48, 64), np.uint8))
"""Looks along z of the world."""


def wall(*ranges_m: float, relative_std: float = 0.01) -> SurfaceConfidence:
    """Of the middle of a wall that one image after the other measured that far away, about 2 m."""
    volume = whole_volume(Grid.covering([-0.5, -0.5, 1.7], [0.5, 0.5, 2.3], VOXEL_M), truncation_m=0.125)
    for range_m in ranges_m:
        depth = stereo.depth_from_sensor(VIEW, np.full((48, 64), range_m), relative_std=relative_std)
        volume.integrate(VIEW, depth.inverse_range, depth.deviation, depth.facing, farthest_m=8.0)
    vertices, _, _, known = volume.surface(least_weight=0.01)
    return known.part((np.linalg.norm(vertices[:, :2], axis=1) < 0.1) & (vertices[:, 2] < 2.06))


def variance_m2(range_m: float, relative_std: float = 0.01) -> float:
    """Of one measurement, not better than a fifth of a voxel."""
    return (relative_std * range_m) ** 2 + (0.2 * VOXEL_M) ** 2


def test_images_that_agree_leave_a_quarter_of_the_variance_that_independent_ones_would_have() -> None:
    one, many = wall(2.0), wall(*[2.0] * 10)
    assert (one.images == 1).all()
    assert (many.images == 10).all()
    # weights fade behind the surface, by 0.9 at the truncation
    np.testing.assert_allclose(one.deviation_m, np.sqrt(1.25 * variance_m2(2.0)), rtol=0.1)
    np.testing.assert_allclose(many.deviation_m, np.sqrt(0.26 * variance_m2(2.0) / 10.0), rtol=0.1)


def test_a_less_certain_depth_makes_a_less_certain_surface() -> None:
    ratio = wall(2.0, relative_std=0.04).deviation_m / wall(2.0, relative_std=0.01).deviation_m
    np.testing.assert_allclose(ratio, np.sqrt(variance_m2(2.0, 0.04) / variance_m2(2.0, 0.01)), rtol=0.02)


def test_images_that_contradict_each_other_count_by_their_scatter_however_many_they_are() -> None:
    for count in (10, 60):
        known = wall(*[1.98, 2.02] * (count // 2))
        expected = 0.25 * 0.02**2 + (0.25 + 1.0 / count**2) * variance_m2(2.0) / count
        np.testing.assert_allclose(known.deviation_m, np.sqrt(expected), rtol=0.1)


def test_no_more_than_a_byte_of_images_is_counted() -> None:
    assert (wall(*[2.0] * 300).images == 255).all()


def test_an_image_that_looks_past_the_surface_is_none_that_measured_it() -> None:
    for past_m in (2.24, 6.0):  # by less than twice the truncation, and by more
        assert (wall(*[2.0] * 6, past_m).images == 6).all()


def test_a_vertex_has_what_was_fused_at_the_voxels_beside_it_in_proportion() -> None:
    """A surface three quarters of the way from the voxels 5 to the voxels 6."""
    along = np.broadcast_to(np.arange(12.0)[:, None, None], (12, 12, 12))
    volume = filled(0.1 * (5.75 - along))
    for values, (before, behind) in (
        (volume.weight, (2.0, 6.0)),
        (volume.scatter, (0.001, 0.003)),
        (volume.images, (4, 9)),
    ):
        values[...] = in_bricks(np.where(along < 5.5, before, behind))
    known = volume.surface(least_weight=0.5)[3]
    expected = np.sqrt(0.01 / 5.0 * (0.25 + 1.0 / 81.0) + 0.25 * 0.0025 / 5.0)
    np.testing.assert_allclose(known.deviation_m, expected, rtol=1e-5)
    assert (known.images == 9).all()


def errors(scene: rendered_room.RenderedScene, share: float) -> tuple[np.ndarray, np.ndarray]:
    """Of the vertices of a rendered map with its true poses: error (v,) and its stated standard deviation (v,)."""
    rig, flight = rendered_world.default_rig(), rendered_world.loop_flight(16, share=share)
    picture = rendered_world.pictures(rig, flight, scene, 11)
    views = [
        ImageView(camera, T @ camera.T_body_camera, picture(i, number))
        for i, T in enumerate(flight.T_world_body)
        for number, camera in enumerate(rig)
    ]
    made = surface.reconstruct(views)
    return scene.distance(made.vertices_world_m), made.confidence.deviation_m.astype(np.float64)


@pytest.mark.slow
def test_the_stated_deviation_of_a_rendered_map_is_what_its_surface_is_off_by() -> None:
    error_m, deviation_m = errors(rendered_room.hazardous(), 0.26)
    ratio = error_m / deviation_m
    assert 0.9 < np.sqrt(np.mean(ratio**2)) < 1.15
    assert (np.abs(ratio) < 2.0).mean() > 0.93
    order = np.argsort(deviation_m)
    for part in np.array_split(order, 4):  # it tells the good surface from the bad
        assert 0.75 < np.sqrt(np.mean(ratio[part] ** 2)) < 1.2
    worst, best = order[-len(order) // 4 :], order[: len(order) // 4]
    assert np.abs(error_m[worst]).mean() > 3.0 * np.abs(error_m[best]).mean()


@pytest.mark.slow
def test_a_map_of_measured_depth_states_it_too() -> None:
    """Depth with 1 % of noise, which half of the images share."""
    scene, rng = rendered_room.furnished(), np.random.default_rng(2)
    flight = rendered_world.loop_flight(12, share=0.2)
    T_body_camera = rendered_world.default_rig()["front"].T_body_camera
    camera = Camera("kinect", ".", "PINHOLE", 160, 120, np.array([100.0, 100.0, 80.0, 60.0]), np.eye(4))
    views = [ImageView(camera, T @ T_body_camera, np.zeros((120, 160), np.uint8)) for T in flight.T_world_body]
    rays = stereo.depth_rays(views[0], 1.0)
    depths = []
    for view in views:
        ranges = rendered_world.cast_rays(
            scene, view.position_world_m, rays.reshape(-1, 3) @ view.T_world_camera[:3, :3].T
        )
        noise = 1.0 + 0.01 * (rng.normal() + rng.normal(size=(120, 160))) / np.sqrt(2.0)
        depths.append(stereo.depth_from_sensor(view, ranges.reshape(120, 160) * rays[..., 2] * noise))
    made = surface.reconstruct(views, DenseOptions(), depths=depths)
    ratio = scene.distance(made.vertices_world_m) / made.confidence.deviation_m
    assert 0.5 < np.sqrt(np.mean(ratio**2)) < 1.2


def layer(count: int = 50) -> SurfaceConfidence:
    rng = np.random.default_rng(4)
    deviation_m = rng.uniform(0.001, 0.2, count).astype(np.float32)
    deviation_m[3] = np.nan
    return SurfaceConfidence(deviation_m, rng.integers(0, 256, count, dtype=np.uint8))


def test_it_is_read_as_it_was_written_and_unknown_in_a_map_without_it(tmp_path: Path) -> None:
    given = layer()
    confidence_layer.save(tmp_path / "confidence.npz", given)
    back = confidence_layer.load(tmp_path / "confidence.npz", 50)
    np.testing.assert_allclose(back.deviation_m, given.deviation_m, rtol=1e-3)
    np.testing.assert_array_equal(back.images, given.images)
    none = confidence_layer.load(tmp_path / "none.npz", 7)
    assert np.isnan(none.deviation_m).all()
    assert (none.deviation_m.shape, none.images.tolist()) == ((7,), [0] * 7)


def test_a_damaged_newer_or_other_layer_is_refused(tmp_path: Path) -> None:
    path, given = tmp_path / "confidence.npz", layer()
    confidence_layer.save(path, given)
    whole = path.read_bytes()
    with pytest.raises(FormatError, match=r"float16 of shape \(50,\).* expected .* of \(51,\)"):
        confidence_layer.load(path, 51)
    for broken in (b"", b"text", whole[:40], whole[:-30]):
        path.write_bytes(broken)
        with pytest.raises(FormatError, match="damaged"):
            confidence_layer.load(path, 50)
    half = given.deviation_m.astype(np.float16)
    np.savez(path, version=2, deviation_m=half, images=given.images)
    with pytest.raises(FormatError, match="newer"):
        confidence_layer.load(path, 50)
    for deviation_m, images in (
        (given.deviation_m, given.images),
        (half, given.images.astype(np.int64)),
        (half, given.images[:-1]),
        (half[:-1], given.images),
        (np.array([None]), given.images),
    ):
        np.savez(path, version=1, deviation_m=deviation_m, images=images)
        with pytest.raises(FormatError):
            confidence_layer.load(path, 50)
    for wrong in (0.0, -0.01):
        half[5] = wrong
        np.savez(path, version=1, deviation_m=half, images=given.images)
        with pytest.raises(FormatError, match="not positive"):
            confidence_layer.load(path, 50)


def test_the_figures_are_those_of_what_is_known() -> None:
    deviation_m = np.array([np.nan, *np.linspace(0.0105, 0.1105, 101)], np.float32)
    found = confidence.figures(SurfaceConfidence(deviation_m, np.ones(102, np.uint8)), VOXEL_M)
    assert list(found.values()) == pytest.approx([0.0605, 0.1005, 61 / 101])
    assert confidence.describe({"hash": "", **found}) == (
        "standard deviation 60 mm at the median, 101 mm at the 90th percentile; 60.4 % of it above one voxel"
    )
    assert confidence.figures(confidence.unknown(3), VOXEL_M) == {}
    assert confidence.describe({}) == ""


def test_the_nearest_surface_is_found_with_its_deviation() -> None:
    vertices = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [3.0, 4.0, 0.0]])
    known = SurfaceConfidence(np.array([0.01, np.nan, 0.03], np.float32), np.array([5, 0, 7], np.uint8))
    shown = MeasuredSurface(vertices, known)
    found = shown.nearest(np.array([3.0, 4.0, 2.0]))
    assert found.deviation_m == pytest.approx(0.03)
    assert (found.point_world_m, found.distance_m, found.images) == ((3.0, 4.0, 0.0), 2.0, 7)
    assert shown.nearest(np.array([1.2, 0.0, 0.0])).deviation_m is None


def test_points_have_the_deviation_of_the_nearest_vertex_within_a_range() -> None:
    vertices = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [3.0, 4.0, 0.0]])
    known = SurfaceConfidence(np.array([0.01, np.nan, 0.03], np.float32), np.array([5, 0, 7], np.uint8))
    points = np.array([[0.0, 0.1, 0.0], [1.0, 0.1, 0.0], [3.0, 4.1, 0.0], [3.0, 4.3, 0.0]])
    expected = [0.01, np.nan, 0.03, np.nan]  # not known at its vertex; too far from any
    np.testing.assert_allclose(MeasuredSurface(vertices, known).deviations_m(points, 0.2), expected, rtol=1e-6)
