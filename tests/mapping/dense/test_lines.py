"""Straight edges in space: where thin things stand, and which edges must not become obstacles."""

import dataclasses

import numpy as np
import pytest

from esdf import FREE, OCCUPIED, UNKNOWN, Grid
from esdf.solids import Box, Cylinder, Room
from flight import frames, rotations
from goshawk.rendered import world as rendered_world
from goshawk.rendered.scene import RenderedScene
from mapping import _mapping
from mapping.camera.rig import Camera
from mapping.dense import lines
from mapping.dense.lines import Edges, Lines
from mapping.dense.stereo import StereoOptions
from mapping.dense.views import ImageView

VOXEL_M, SKIN = 0.05, 0.87
GRID = Grid((-1.025, -3.025, -0.025), (VOXEL_M, VOXEL_M, VOXEL_M), (110, 121, 65))
POLE = Cylinder((2.0, 0.4, 1.5), 0.015, 3.0)
CABLE = Box((2.2, -2.0, 1.994), (2.212, 2.0, 2.006))
STRIPE = Box((2.998, -1.03, 0.0), (3.2, -1.0, 3.0))
"""Painted on the wall at x = 3: it stands 2 mm off it."""
CAMERA = dataclasses.replace(rendered_world.default_rig(0.75).cameras[0], T_body_camera=np.eye(4))
LOOKING_ALONG_X = np.array([[0.0, 0.0, 1.0], [-1.0, 0.0, 0.0], [0.0, -1.0, 0.0]])


def pose(x_m: float, y_m: float, z_m: float) -> np.ndarray:
    return frames.transform(rotations.from_matrix(LOOKING_ALONG_X), np.array([x_m, y_m, z_m]))


def views() -> list[ImageView]:
    """From places beside and above each other, of a room with a pole, a cable and a striped wall."""
    room = (Room((-1.0, -3.0, 0.0), (3.0, 3.0, 3.0)), "plaster")
    scene = RenderedScene((room, (POLE, "ink"), (CABLE, "ink"), (STRIPE, "ink")))
    places = [(0.05 * n, -0.7 + 0.2 * n, 0.9 + 0.35 * (n % 3)) for n in range(9)]
    return [
        ImageView(CAMERA, pose(*place), rendered_world.render(CAMERA, pose(*place), scene=scene, seed=n))
        for n, place in enumerate(places)
    ]


@pytest.fixture(scope="module")
def found() -> np.ndarray:
    """The voxels of a map that shows nothing yet."""
    edges = lines.sweep(views(), StereoOptions(), farthest_m=8.0)
    return lines.occupied(edges, np.full(GRID.shape, FREE, np.uint8), GRID, skin_voxels=SKIN)


def share_of(found: np.ndarray, points: np.ndarray) -> float:
    return float(found[tuple(GRID.index(points).T)].mean())


@pytest.mark.slow
def test_a_pole_and_a_cable_are_found_where_they_are(found: np.ndarray) -> None:
    heights, along = np.linspace(0.7, 1.8, 60), np.linspace(-0.6, 1.2, 60)
    assert share_of(found, np.array([[2.0, 0.4, z] for z in heights])) > 0.9
    assert share_of(found, np.array([[2.206, y, 2.0] for y in along])) > 0.7
    near = GRID.centre(np.argwhere(found))
    near = near[(np.abs(near - [1.85, 0.2, 1.5]) < [0.85, 1.5, 1.2]).all(axis=1)]  # away from the walls
    off_m = np.minimum(POLE.distance(near), CABLE.distance(near))
    assert len(near) > 50
    assert np.quantile(off_m, 0.95) < 1.25 * VOXEL_M  # centres of the voxels in the skin of a line
    assert off_m.max() < 2.5 * VOXEL_M


@pytest.mark.slow
def test_a_stripe_on_a_wall_is_no_obstacle_before_the_wall(found: np.ndarray) -> None:
    assert share_of(found, np.array([[3.0, -1.0, z] for z in np.linspace(0.8, 1.8, 40)])) > 0.7
    centres = GRID.centre(np.argwhere(found))
    before = centres[(np.abs(centres[:, 1] + 1.015) < 0.3) & (centres[:, 2] > 0.3) & (centres[:, 2] < 1.8)]
    assert before[:, 0].min() > 3.0 - 2.0 * VOXEL_M


def test_a_line_on_a_surface_that_is_in_the_map_adds_nothing() -> None:
    state = np.full(GRID.shape, UNKNOWN, np.uint8)
    wall = GRID.index(np.array([[4.0, 0.0, 0.0]]))[0, 0]
    state[wall] = OCCUPIED
    on_it = GRID.centre(np.array([[wall, 40, 10], [wall, 40, 50]]))
    assert not lines.occupied(shown_by(6, *on_it), state, GRID, skin_voxels=SKIN).any()
    before_it = on_it - [1.0, 0.0, 0.0]
    assert lines.occupied(shown_by(6, *before_it), state, GRID, skin_voxels=SKIN).sum() >= 40


def shown_by(images: int, first: np.ndarray, last: np.ndarray) -> Lines:
    return Lines(np.tile(first, (images, 1)), np.tile(last, (images, 1)), np.arange(images))


def test_a_line_counts_by_the_images_that_show_it_and_not_by_how_often_one_does() -> None:
    state, ends = np.full(GRID.shape, FREE, np.uint8), np.array([[1.0, 0.0, 0.5], [1.0, 0.0, 1.5]])
    for images in range(1, 7):
        found = lines.occupied(shown_by(images, *ends), state, GRID, skin_voxels=SKIN)
        assert found.any() == (images >= lines.LEAST_IMAGES)
    repeated = dataclasses.replace(shown_by(9, *ends), image=np.zeros(9, np.int64))
    assert not lines.occupied(repeated, state, GRID, skin_voxels=SKIN).any()


def test_every_voxel_that_a_line_crosses_is_occupied() -> None:
    rng = np.random.default_rng(4)
    state = np.full(GRID.shape, FREE, np.uint8)
    for ends in rng.uniform([-0.8, -2.8, 0.2], [4.0, 2.8, 3.0], (20, 2, 3)):
        found = lines.occupied(shown_by(4, *ends), state, GRID, skin_voxels=SKIN)
        assert share_of(found, ends[0] + np.linspace(0.0, 1.0, 2000)[:, None] * (ends[1] - ends[0])) > 0.999


def seen_from(places: np.ndarray, ends: np.ndarray) -> list[Edges]:
    """The edges of lines (n, 2, 3), as each image sees them without error."""
    images = []
    for place in places:
        rays = ends - place
        rays = rays / np.linalg.norm(rays, axis=-1, keepdims=True)
        images.append(Edges(rays[:, 0].copy(), rays[:, 1].copy(), place, 0.001))
    return images


PLACES = np.array([[0.1 * (n % 2), 0.25 * n, 1.0 + 0.1 * n] for n in range(5)])
ENDS = np.array([[2.0, 0.4, 1.0], [2.2, 0.4, 1.3]])


def test_edges_of_one_line_give_its_place() -> None:
    first, *partners = seen_from(PLACES, ENDS[None])
    range_m, std_m, sure = lines._ranges(first, partners, nearest_m=0.3, farthest_m=8.0)
    assert sure.all()
    np.testing.assert_allclose(range_m[0], np.linalg.norm(ENDS - PLACES[0], axis=1), rtol=1e-9)
    assert 0.0 < std_m[0] < 0.02


def test_an_edge_without_direction_and_an_image_from_the_same_place_change_nothing() -> None:
    first, *partners = seen_from(PLACES, ENDS[None])
    expected = lines._ranges(first, partners, nearest_m=0.3, farthest_m=8.0)
    nowhere = dataclasses.replace(partners[0], first=np.full((1, 3), np.nan))
    found = lines._ranges(first, [*partners, first, nowhere], nearest_m=0.3, farthest_m=8.0)
    for have, wanted in zip(found, expected, strict=True):
        np.testing.assert_array_equal(have, wanted)


def test_a_wrong_line_of_two_images_is_refused() -> None:
    """Two edges always meet in some line; it takes a third image to bear it out."""
    first, second, third, *_ = seen_from(PLACES, ENDS[None])
    wrong = seen_from(PLACES, ENDS[None] + [0.0, 0.0, 0.25])[1]
    for partners in ([second], [wrong], [wrong, third]):
        assert not lines._ranges(first, partners, nearest_m=0.3, farthest_m=8.0)[2].any()
    assert lines._ranges(first, [second, third], nearest_m=0.3, farthest_m=8.0)[2].all()


def test_an_edge_of_which_as_many_images_tell_another_depth_is_refused() -> None:
    near = seen_from(PLACES, ENDS[None])
    far = seen_from(PLACES, (PLACES[0] + 1.5 * (ENDS - PLACES[0]))[None])  # the same edge in the first image
    assert not lines._ranges(near[0], [*near[1:3], *far[3:5]], nearest_m=0.3, farthest_m=8.0)[2].any()
    assert lines._ranges(near[0], [*near[1:4], *far[3:5]], nearest_m=0.3, farthest_m=8.0)[2].all()


def test_an_edge_that_turns_from_light_to_dark_is_another_edge() -> None:
    first, *partners = seen_from(PLACES, ENDS[None])
    turned = [dataclasses.replace(each, first=each.last, last=each.first) for each in partners]
    assert not lines._ranges(first, turned, nearest_m=0.3, farthest_m=8.0)[2].any()


def test_an_edge_behind_the_camera_is_no_part_of_a_line_before_it() -> None:
    first, *partners = (dataclasses.replace(each, std_rad=1e-4) for each in seen_from(PLACES, ENDS[None]))
    behind = [dataclasses.replace(each, first=-_unit(each.first + each.last), last=-each.first) for each in partners]
    assert lines._ranges(first, partners, nearest_m=0.3, farthest_m=8.0)[2].all()
    assert not lines._ranges(first, behind, nearest_m=0.3, farthest_m=8.0)[2].any()


@pytest.mark.parametrize("turn_rad", np.linspace(-np.pi, np.pi, 37))
def test_edges_are_compared_all_round_the_baseline(turn_rad: float) -> None:
    """The partners show a part of the edge only, so that no end of theirs is near one of its own."""
    places = np.array([[0.25 * n, 0.0, 0.0] for n in range(4)])
    across = np.array([0.0, np.cos(turn_rad), np.sin(turn_rad)])
    middle, way = np.array([0.4, 0.0, 0.0]) + 2.0 * across, np.cross([1.0, 0.0, 0.0], across)
    whole, part = (seen_from(places, (middle + np.outer([-a, a], way))[None]) for a in (0.5, 0.2))
    range_m, _, sure = lines._ranges(whole[0], part[1:], nearest_m=0.3, farthest_m=8.0)
    assert sure.all()
    np.testing.assert_allclose(range_m, np.sqrt(0.4**2 + 2.0**2 + 0.5**2), rtol=1e-9)


@pytest.mark.parametrize(("seed", "low"), [(0, [1.0, -1.0, 0.5]), (1, [1.0, -1.0, 0.5]), (2, [-5.0, -5.0, -4.0])])
def test_the_kernel_agrees_with_its_plain_twin(seed: int, low: list[float]) -> None:
    """Of edges before the cameras, and all round them."""
    rng = np.random.default_rng(seed)
    ends = rng.uniform(low, [12.0, 2.0, 2.0], (15, 1, 3)) + rng.uniform(-0.2, 0.2, (15, 2, 3))
    edges = seen_from(PLACES, ends)
    off = [rng.normal(0.0, 0.0007, (2, 15, 3)) for _ in edges]
    first, *partners = (
        dataclasses.replace(e, first=_unit(e.first + a), last=_unit(e.last + b))
        for e, (a, b) in zip(edges, off, strict=True)
    )
    numbers = np.repeat(np.arange(4, dtype=np.int32), 15)
    theirs = np.concatenate([p.first for p in partners]), np.concatenate([p.last for p in partners])
    offsets = PLACES[1:] - PLACES[0]
    found = _mapping.sweep_lines(first.first, first.last, *theirs, numbers, offsets, 0.001, 2.5, 0.5, 8.0, 0.1, 0.3, 2)
    expected = [_twin(a, b, *theirs, numbers, offsets) for a, b in zip(first.first, first.last, strict=True)]
    for got, wanted in zip(found, zip(*expected, strict=True), strict=True):
        np.testing.assert_allclose(got, np.array(wanted), rtol=1e-9, atol=1e-12)
    assert (found[2] >= 3).sum() > 4


def _unit(rays: np.ndarray) -> np.ndarray:
    return rays / np.linalg.norm(rays, axis=-1, keepdims=True)


def _twin(
    a: np.ndarray, b: np.ndarray, firsts: np.ndarray, lasts: np.ndarray, numbers: np.ndarray, offsets: np.ndarray
) -> tuple[np.ndarray, float, int, int]:
    """One segment: inverse ranges, standard deviation, partners that agree, and that agree on another depth."""
    proposals = []
    for c, d, number in zip(firsts, lasts, numbers, strict=True):
        offset, normal = offsets[number], _unit(np.cross(c, d))
        extent = np.arccos(c @ d)
        u = np.array([normal @ a, normal @ b]) / (normal @ offset)
        towards = np.array([a - u[0] * offset, b - u[1] * offset])
        angle = np.arctan2(towards @ np.cross(normal, c), towards @ c)
        across = np.hypot(angle / extent, 1.0 - angle / extent) * np.linalg.norm(towards, axis=1)
        std = 0.001 * np.hypot(across, 1.0) / abs(normal @ offset)
        common = min(angle[1], extent) - max(angle[0], 0.0)
        near_enough = (u > -1.0 / 8.0).all() and (u < 1.0 / 0.5).all() and (std <= 0.1 * np.maximum(u, 1.0 / 8.0)).all()
        if near_enough and 0.0 < angle[1] - angle[0] < np.pi and common > 0.3 * min(angle[1] - angle[0], extent):
            proposals.append((number, u, std))
    if not proposals:
        return np.zeros(2), 0.0, 0, 0
    agree = np.array([[(abs(u - v) <= 2.5 * np.hypot(s, t)).all() for _, v, t in proposals] for _, u, s in proposals])
    counts = [len({p[0] for p, same in zip(proposals, row, strict=True) if same}) for row in agree]
    weights = np.array([1.0 / p[2] ** 2 for p in proposals])
    worse = [1.0 / np.sqrt((weights * row[:, None]).sum(axis=0).min()) for row in agree]
    best = min(range(len(proposals)), key=lambda k: (-counts[k], worse[k]))
    chosen = weights * agree[best][:, None]
    mean = (chosen * np.array([p[1] for p in proposals])).sum(axis=0) / chosen.sum(axis=0)
    rivals = max((n for n, same in zip(counts, agree[best], strict=True) if not same), default=0)
    return mean, worse[best], counts[best], rivals


def test_masked_edges_and_images_without_any_are_left_out() -> None:
    camera = Camera("forward", ".", "PINHOLE", 160, 120, np.array([120.0, 120.0, 80.0, 60.0]), np.eye(4))
    pixels = np.full((120, 160), 40, np.uint8)
    plain = ImageView(camera, np.eye(4), pixels.copy())
    assert len(lines.detect(plain).first) == 0
    assert len(lines.sweep([plain] * 5, StereoOptions(), farthest_m=8.0).image) == 0
    pixels[:, 50:], pixels[:, 110:] = 200, 40
    both = ImageView(camera, np.eye(4), pixels)
    used = np.ones((120, 160), bool)
    used[:, :80] = False
    right = lines.detect(dataclasses.replace(both, used=used))
    assert len(lines.detect(both).first) == 2 * len(right.first) > 0
    assert (right.first[:, 0] > 0.0).all()
