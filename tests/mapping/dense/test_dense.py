"""Dense depth and reconstruction against the rendered room, whose surfaces are known in closed form."""

import dataclasses
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from esdf import FREE, OCCUPIED, UNKNOWN
from flight import MapError, frames, silent
from goshawk.rendered import scene as rendered_room
from goshawk.rendered import world as rendered_world
from mapping import _mapping, placed_views, stages
from mapping.dense import stereo, surface
from mapping.dense.depth_files import DepthFiles
from mapping.dense.surface import DenseOptions, ImageView, StereoOptions
from mapping.dense.views import lens_row
from mapping.workers import Threads

SCENE = rendered_room.furnished()
RIG = rendered_world.default_rig(0.5)
FLIGHT = rendered_world.loop_flight(60)


def views_of(indices: range) -> list[ImageView]:
    return [
        ImageView(
            camera,
            FLIGHT.T_world_body[i] @ camera.T_body_camera,
            rendered_world.render(camera, FLIGHT.T_world_body[i], scene=SCENE, seed=i),
        )
        for i in indices
        for camera in RIG
    ]


def true_range(view: ImageView, scale: float) -> np.ndarray:
    rays = stereo.depth_rays(view, scale)
    directions = rays.reshape(-1, 3) @ view.T_world_camera[:3, :3].T
    return rendered_world.cast_rays(SCENE, view.position_world_m, directions).reshape(rays.shape[:2])


@pytest.fixture(scope="module")
def views() -> list[ImageView]:
    return views_of(range(14, 20))


@pytest.fixture(scope="module")
def reconstruction(views: list[ImageView]) -> surface.Reconstruction:
    return surface.reconstruct(views, DenseOptions(voxel_m=0.06))


def test_points_lie_in_one_row_of_both_rectified_images() -> None:
    """A bright ball appears in the same row of both, shifted by the angle under which it sees the baseline."""
    camera = RIG["front"]
    at = [np.eye(4), frames.transform([1.0, 0.0, 0.0, 0.0], np.array([0.15, 0.3, 0.1]))]
    ball = np.array([2.0, -0.5, 0.4])
    scene = rendered_room.RenderedScene(((rendered_room.Sphere(tuple(ball), 0.08), "metal"),))
    pair = [
        ImageView(camera, T @ camera.T_body_camera, rendered_world.render(camera, T, scene=scene, seed=0, noise=0.0))
        for T in at
    ]
    baseline = at[1][:3, 3] / np.linalg.norm(at[1][:3, 3])
    axes = stereo.axes_about(camera.T_body_camera[:3, :3].T @ baseline)
    step = 0.005
    grid = np.array([3.0, step, -1.5, step, 600.0, 600.0])
    places = []
    for view in pair:
        picture = _mapping.rectify(view.grey, lens_row(camera), axes, grid)
        places.append(np.mean(np.nonzero(picture), axis=1))
    angles = [
        np.arccos((ball - v.position_world_m) @ baseline / np.linalg.norm(ball - v.position_world_m)) for v in pair
    ]
    assert places[0][0] == pytest.approx(places[1][0], abs=0.5)
    assert places[0][1] - places[1][1] == pytest.approx((angles[1] - angles[0]) / step, abs=1.0)


@pytest.mark.parametrize("parallax_rad", [0.02, 0.3, 1.8])
def test_a_point_sees_the_baseline_under_its_parallax(parallax_rad: float) -> None:
    """And depth varies with the match as the deviation says; the bound is the depth of a match that much larger."""
    camera = RIG["front"]
    baseline_m = np.array([0.1, -0.05, 0.03])
    axes = stereo.axes_about(baseline_m / np.linalg.norm(baseline_m))
    rays = stereo.depth_rays(views_of(range(1))[0], 0.5)
    step, std_px, deviations = 1e-3, 0.5, 3.0
    grid = np.array([3.1, step, -np.pi, 0.02, 315.0, 3100.0])

    def depth(parallax: float) -> tuple[np.ndarray, ...]:
        disparity = np.full((315, 3100), round(16.0 * parallax / step), np.int16)
        to_partner = np.ascontiguousarray(frames.transform([1.0, 0.0, 0.0, 0.0], -baseline_m))
        length_m = float(np.linalg.norm(baseline_m))
        return _mapping.inverse_range(
            disparity, disparity, grid, axes, length_m, to_partner, lens_row(camera), rays, std_px, 1.0, deviations
        )

    value, deviation, bound = depth(parallax_rad)
    known = value > 0.0
    assert known.sum() > 1000
    points_m = rays[known] / value[known, None]
    there = points_m - baseline_m
    cosine = (points_m * there).sum(axis=1) / np.linalg.norm(points_m, axis=1) / np.linalg.norm(there, axis=1)
    np.testing.assert_allclose(np.arccos(cosine), parallax_rad, atol=2e-5)
    larger, smaller = depth(parallax_rad + step)[0], depth(parallax_rad - step)[0]
    both = known & (larger > 0.0) & (smaller > 0.0)
    slope = 0.5 * (larger[both] - smaller[both]) / step
    np.testing.assert_allclose(deviation[both], slope * std_px * step, rtol=0.01)
    nearest, _, _ = depth(parallax_rad + deviations * std_px * step)
    both = known & (nearest > 0.0)
    np.testing.assert_allclose(bound[both], nearest[both], rtol=1e-6)


@pytest.mark.parametrize("index", [4, 5])
def test_depth_of_the_room_is_recovered(views: list[ImageView], index: int) -> None:
    depth = stereo.depth_image(views, index, StereoOptions())
    assert depth is not None
    truth = true_range(views[index], depth.scale)
    known = depth.inverse_range > 0
    relative = np.abs(1.0 / depth.inverse_range[known] - truth[known]) / truth[known]
    assert known.mean() > 0.6
    assert np.median(relative) < 0.012
    assert (relative < 0.1).mean() > 0.95
    # the stated standard deviation is an honest one: 68 % within one, 95 % within two, give or take
    error = np.abs(depth.inverse_range[known] - 1.0 / truth[known]) / depth.deviation[known]
    assert 0.5 < np.quantile(error, 0.68) < 1.8


class Counting(Threads):
    """Threads that count the images they were given."""

    given = 0

    def each(self, work, tasks, take, stage="", progress=silent) -> None:
        chosen = list(tasks)
        self.given += len(chosen)
        super().each(work, chosen, take, stage, progress)


def test_depth_that_was_found_outlives_an_interrupt_while_its_stage_is_written(
    views: list[ImageView], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    pool = Counting(2)
    placed: Any = SimpleNamespace(images=SimpleNamespace(depths=None))  # the rest is asked only of measured depth

    def interrupt() -> None:
        raise KeyboardInterrupt

    def found() -> DepthFiles:
        with stages.begin(tmp_path / "w") as work:
            return placed_views.depth_stage(placed, views, StereoOptions(), work, pool, silent)

    with monkeypatch.context() as patch:
        patch.setattr(stages.os, "sync", interrupt)
        with pytest.raises(KeyboardInterrupt):
            found()
    assert pool.given == len(views)
    depths = found()
    assert pool.given == len(depths) == len(views)
    assert any(depth is not None and depth.inverse_range.any() for depth in depths)


def test_a_world_twice_as_large_has_twice_the_depth(views: list[ImageView]) -> None:
    def depth_at(factor: float) -> stereo.DepthImage | None:
        poses = [view.T_world_camera.copy() for view in views]
        for T in poses:
            T[:3, 3] *= factor
        scaled = [dataclasses.replace(view, T_world_camera=T) for view, T in zip(views, poses, strict=True)]
        return stereo.depth_image(scaled, 4, StereoOptions(near_m=0.4 * factor, far_m=8.0 * factor))

    small, large = depth_at(1.0), depth_at(2.0)
    assert small is not None
    assert large is not None
    np.testing.assert_allclose(large.inverse_range, 0.5 * small.inverse_range, rtol=1e-4, atol=1e-6)


def test_partners_have_a_baseline_and_a_common_view(views: list[ImageView]) -> None:
    options = StereoOptions()
    for index, view in enumerate(views):
        chosen = stereo.choose_partners(views, index, options)
        assert index not in chosen
        assert len(set(chosen)) == len(chosen) <= options.partners
        for partner in chosen:
            assert np.linalg.norm(views[partner].position_world_m - view.position_world_m) > 0.05
            assert views[partner].T_world_camera[:3, 2] @ view.T_world_camera[:3, 2] > 0.5


def test_mesh_lies_on_the_surface(reconstruction: surface.Reconstruction) -> None:
    error_m = np.abs(SCENE.distance(reconstruction.vertices_world_m))
    assert len(error_m) > 5000
    assert np.median(error_m) < 0.015
    assert (error_m < 0.06).mean() > 0.93


def test_free_space_is_air_and_seen_walls_have_no_holes(
    views: list[ImageView], reconstruction: surface.Reconstruction
) -> None:
    state, grid = reconstruction.state, reconstruction.grid
    assert {UNKNOWN, FREE, OCCUPIED} == set(np.unique(state))
    free = SCENE.distance(grid.centre(np.argwhere(state == FREE)))
    assert (free < 0.0).mean() < 0.004
    # walk from each camera to just behind the surface it sees: no observed wall is free
    view = views[4]
    rays = stereo.depth_rays(view, 0.5)[10:-10:4, 10:-10:4].reshape(-1, 3) @ view.T_world_camera[:3, :3].T
    ranges = rendered_world.cast_rays(SCENE, view.position_world_m, rays)
    stopped = np.zeros(len(rays), bool)
    for beyond in np.arange(-0.15, 0.12, 0.02):
        cells = grid.index(view.position_world_m + (ranges + beyond)[:, None] * rays)
        inside = ((cells >= 0) & (cells < state.shape)).all(axis=1)
        stopped[~inside] = True
        stopped[inside] |= state[tuple(cells[inside].T)] != FREE
    assert stopped.mean() > 0.995


def test_the_flown_path_is_free(views: list[ImageView], reconstruction: surface.Reconstruction) -> None:
    cells = reconstruction.grid.index(np.array([view.position_world_m for view in views]))
    assert (reconstruction.state[tuple(cells.T)] == FREE).all()


def test_images_without_common_view_are_refused(views: list[ImageView]) -> None:
    apart = [views[0], dataclasses.replace(views[2], T_world_camera=views[2].T_world_camera + np.eye(4, 4, 3) * 50.0)]
    with pytest.raises(MapError, match="same things from places"):
        surface.reconstruct(apart)
    with pytest.raises(MapError, match="0 images"):
        surface.reconstruct([])


def test_depth_that_makes_no_surface_is_told_by_how_much_there_is_and_from_where(views: list[ImageView]) -> None:
    shape = stereo.depth_rays(views[0], stereo.DEPTH_SCALE).shape[:2]
    few, unsure = np.zeros(shape, np.float32), np.full(shape, 0.4, np.float32)
    few[100:104, 100:104] = 0.5
    depth = stereo.DepthImage(few, unsure, np.ones(shape, np.float32), few, stereo.DEPTH_SCALE)
    with pytest.raises(MapError, match=r"no surface: 1 of 2 images have depth, in 0% of their .* 0\.081 m of each"):
        surface.reconstruct(views[:2], DenseOptions(voxel_m=0.1), depths=[depth, None])
