"""Growth of the sparse map on made-up matches: what is placed, which map is returned, when everything is adjusted."""

from collections.abc import Callable
from itertools import combinations, pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pycolmap
import pytest

from mapping.sparse.mapper import colmap, growth
from mapping.sparse.mapper.colmap import SparseOptions

Matched = Callable[[int, int], bool]


def database_of(
    folder: Path, instants: int, *, points: int = 200, cameras: int = 2, matched: Matched = lambda a, b: True
) -> tuple[Path, pycolmap.Reconstruction]:
    """Matches of every image with those of the other instants that `matched` tells, and the true map.

    Instants are counted from 1, as COLMAP does.
    """
    options = pycolmap.SyntheticDatasetOptions()
    options.num_rigs, options.num_cameras_per_rig, options.num_frames_per_rig = 1, cameras, instants
    options.num_points3D, options.camera_has_prior_focal_length = points, True
    pycolmap.set_random_seed(1)
    database = folder / "database.db"
    with pycolmap.Database.open(database) as opened:
        true = pycolmap.synthesize_dataset(options, opened)
        for a, b in combinations(sorted(true.images), 2):
            if not matched(true.image(a).frame_id, true.image(b).frame_id):
                opened.delete_inlier_matches(a, b)
                opened.delete_two_view_geometry(a, b)
    return database, true


def mapping_options() -> Any:
    return colmap._mapping_options(SparseOptions())


def grown(database: Path, start: Any = None, options: Any = None) -> tuple[Any, int]:
    """The map, and how many instants were said to be placed."""
    placed: list[int] = []
    model = growth.largest_model(database, options or mapping_options(), start, lambda: placed.append(1))
    return model, len(placed)


def positions(model: pycolmap.Reconstruction) -> np.ndarray:
    return np.array([model.frame(k).rig_from_world.inverse().translation for k in sorted(model.reg_frame_ids())])


def distances(model: pycolmap.Reconstruction) -> np.ndarray:
    found = positions(model)
    return np.linalg.norm(found[:, None] - found, axis=2)


def median_angle_deg(true: pycolmap.Reconstruction, a: int, b: int) -> float:
    """Between the rays of two images to the points that both see, or less where the rays meet head-on."""
    places = [true.image(k).projection_center() for k in (a, b)]
    seen = set.intersection(*({p.point3D_id for p in true.image(k).get_observation_points2D()} for k in (a, b)))
    rays = [np.array([true.point3D(k).xyz - place for k in sorted(seen)]) for place in places]
    rays = [each / np.linalg.norm(each, axis=1, keepdims=True) for each in rays]
    return float(np.degrees(np.median(np.arccos(np.abs((rays[0] * rays[1]).sum(axis=1)).clip(max=1.0)))))


def placed_in(model: pycolmap.Reconstruction) -> set[int]:
    return set(model.reg_frame_ids())


def part_of(model: pycolmap.Reconstruction, instants: set[int]) -> pycolmap.Reconstruction:
    """The model without the points and without the poses of other instants."""
    for k in model.point3D_ids():
        model.delete_point3D(k)
    for k in placed_in(model) - instants:
        model.deregister_frame(k)
    return model


@pytest.mark.parametrize("cameras", [2, 4])
def test_a_rig_gives_every_instant_in_true_size(tmp_path: Path, cameras: int) -> None:
    database, true = database_of(tmp_path, 9, cameras=cameras)
    model, placed = grown(database)
    assert (model.num_reg_images(), placed) == (9 * cameras, 7)  # two begin the map
    np.testing.assert_allclose(distances(model), distances(true), atol=1e-4)


def test_one_camera_gives_every_instant_in_some_size(tmp_path: Path) -> None:
    database, true = database_of(tmp_path, 9, cameras=1)
    model, _ = grown(database)
    ratio = distances(model)[np.triu_indices(9, 1)] / distances(true)[np.triu_indices(9, 1)]
    np.testing.assert_allclose(ratio, ratio.mean(), rtol=1e-4)


def test_images_without_matches_give_no_map(tmp_path: Path) -> None:
    database, _ = database_of(tmp_path, 4, matched=lambda a, b: False)
    assert grown(database) == (None, 0)


def test_of_two_places_the_larger_is_returned_though_the_map_of_the_smaller_is_begun_first(tmp_path: Path) -> None:
    # the images of the smaller have more matches each, and COLMAP begins with those that have most
    database, _ = database_of(
        tmp_path, 14, matched=lambda a, b: (a <= 6) == (b <= 6) and (a <= 6 or b <= 6 or abs(a - b) <= 1)
    )
    model, placed = grown(database)
    assert placed_in(model) == set(range(7, 15))
    assert placed == 4 + 6


def test_a_place_that_cannot_be_the_larger_is_not_mapped(tmp_path: Path) -> None:
    database, _ = database_of(tmp_path, 14, matched=lambda a, b: (a <= 7) == (b <= 7))
    model, placed = grown(database)
    assert model.num_reg_frames() == 7
    assert placed == 5


def test_a_map_grows_on_from_where_instants_were_taken_out(tmp_path: Path) -> None:
    database, true = database_of(tmp_path, 9)
    start, _ = grown(database)
    names = {true.image(image.id).name for k in (2, 5, 6) for image in true.frame(k).image_ids}
    colmap._take_out(start, names)
    assert placed_in(start) == {1, 3, 4, 7, 8, 9}
    model, placed = grown(database, start)
    assert model is start
    assert placed == 3
    np.testing.assert_allclose(distances(model), distances(true), atol=1e-4)


def test_an_instant_that_sees_no_point_is_placed_again(tmp_path: Path) -> None:
    database, start = database_of(tmp_path, 21, points=60, matched=lambda a, b: b - a <= 3)
    true, lost = distances(start), start.frame(21)
    for image in lost.image_ids:
        for feature in start.image(image.id).get_observation_point2D_idxs():
            start.delete_observation(image.id, feature)
    lost.rig_from_world = pycolmap.Rigid3d(lost.rig_from_world.rotation, [9.0, 9.0, 9.0])
    model, placed = grown(database, start)
    assert placed == 1
    np.testing.assert_allclose(distances(model), true, atol=1e-4)


def test_another_map_is_returned_where_it_is_larger_than_that_to_start_with(tmp_path: Path) -> None:
    database, true = database_of(tmp_path, 8, matched=lambda a, b: (a <= 2) == (b <= 2))
    start = part_of(true, {1, 2})
    model, placed = grown(database, start)
    assert placed_in(start) == {1, 2}
    assert placed_in(model) == set(range(3, 9))
    assert placed == 4


@pytest.mark.parametrize(("most_images", "shared"), [(20, {1, 2}), (1, {1}), (2, {1})])
def test_a_map_grows_into_another_only_so_far(tmp_path: Path, most_images: int, shared: set[int]) -> None:
    """Into one of two instants with two images each, which have no points and thus does not grow itself."""
    database, true = database_of(tmp_path, 8, matched=lambda a, b: (a, b) != (1, 2))
    start = part_of(true, {1, 2})
    options = mapping_options()
    options.max_model_overlap = most_images
    model, _ = grown(database, start, options)
    assert placed_in(model) & {1, 2} == shared


def test_few_matches_begin_a_map_where_no_images_have_more(tmp_path: Path) -> None:
    database, true = database_of(tmp_path, 6, points=40)  # COLMAP asks for 100, then for 50 and for 25
    model, _ = grown(database)
    np.testing.assert_allclose(distances(model), distances(true), atol=1e-4)


@pytest.mark.parametrize(("matches", "angle_deg"), [(100, 16.0), (195, 16.0), (100, 60.0), (100, 0.01)])
def test_likely_pairs_are_of_two_instants_with_enough_matches_and_parallax(
    tmp_path: Path, matches: int, angle_deg: float
) -> None:
    database, true = database_of(tmp_path, 6)
    with pycolmap.Database.open(database) as opened:  # some pairs have fewer matches
        for a, b in combinations(sorted(true.images), 2):
            geometry = opened.read_two_view_geometry(a, b)
            geometry.inlier_matches = geometry.inlier_matches[: 180 + 4 * a]
            opened.update_two_view_geometry(a, b, geometry)
    starting = mapping_options().get_mapper()
    starting.init_min_num_inliers, starting.init_min_tri_angle = matches, angle_deg
    expected, totals = [], dict.fromkeys(true.images, 0)
    with pycolmap.Database.open(database) as opened:
        for a, b in combinations(sorted(true.images), 2):
            count = len(opened.read_two_view_geometry(a, b).inlier_matches)
            totals[a], totals[b] = totals[a] + count, totals[b] + count
            if count >= matches and true.image(a).frame_id != true.image(b).frame_id:
                expected += [(a, b)] * (median_angle_deg(true, a, b) > angle_deg)
    pairs = list(growth._likely_pairs(database, starting))
    assert pairs
    assert sorted(pairs) == expected
    best = [max(totals[a], totals[b]) for a, b in pairs]
    assert best == sorted(best, reverse=True)


def test_a_map_begins_with_a_likely_pair_or_where_colmap_refuses_it_with_one_that_colmap_finds(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    database, true = database_of(tmp_path, 6)
    asked: list[tuple[int, int]] = []
    begin = pycolmap.IncrementalPipeline.initialize_reconstruction

    def noted(self: Any, *arguments: Any) -> Any:
        asked.append((self.options.init_image_id1, self.options.init_image_id2))
        return begin(self, *arguments)

    monkeypatch.setattr(pycolmap.IncrementalPipeline, "initialize_reconstruction", noted)
    first = next(growth._likely_pairs(database, mapping_options().get_mapper()))
    model, _ = grown(database)
    assert asked == [first]
    np.testing.assert_allclose(distances(model), distances(true), atol=1e-4)
    of_one_instant = (1, 2)
    monkeypatch.setattr(growth, "_likely_pairs", lambda *_: iter([of_one_instant]))
    asked.clear()
    model, _ = grown(database)
    assert asked == [of_one_instant, (-1, -1)]
    np.testing.assert_allclose(distances(model), distances(true), atol=1e-4)


def test_what_begins_a_map_is_relaxed_step_by_step() -> None:
    options = mapping_options()
    asked = [(each.init_min_num_inliers, each.init_min_tri_angle) for each in growth._relaxed(options)]
    assert asked == [(100, 16.0), (50, 16.0), (50, 8.0), (25, 8.0), (25, 4.0)]


@pytest.fixture
def adjusted(monkeypatch: pytest.MonkeyPatch) -> list[tuple[int, Any]]:
    """Instants and options of each adjustment of everything."""
    seen: list[tuple[int, Any]] = []
    whole = pycolmap.IncrementalMapper.iterative_global_refinement

    def noted(self: Any, refinements: int, change: float, mapper: Any, ba: Any, points: Any, **more: Any) -> None:
        seen.append((self.reconstruction.num_reg_frames(), ba))
        whole(self, refinements, change, mapper, ba, points, **more)

    monkeypatch.setattr(pycolmap.IncrementalMapper, "iterative_global_refinement", noted)
    return seen


def test_everything_is_adjusted_as_the_map_grows_and_once_in_the_end(tmp_path: Path, adjusted) -> None:
    grown(database_of(tmp_path, 16)[0])
    sizes = [size for size, _ in adjusted]
    assert sizes == [3, 4, 6, 8, 11, 15, 16]
    assert all(later >= 1.3 * size for size, later in pairwise(sizes[:-1]))


def test_a_map_that_was_just_adjusted_is_not_adjusted_again_in_the_end(tmp_path: Path, adjusted) -> None:
    grown(database_of(tmp_path, 15)[0])
    assert [size for size, _ in adjusted] == [3, 4, 6, 8, 11, 15]


def test_more_than_a_thousand_images_are_adjusted_by_factoring(tmp_path: Path, adjusted) -> None:
    grown(database_of(tmp_path, 3)[0])
    assert {ba.ceres.max_num_images_direct_sparse_cpu_solver for _, ba in adjusted} == {20_000}


@pytest.mark.parametrize(("size", "is_grown"), [((12, 129), False), ((13, 100), True), ((10, 130), True)])
def test_instants_or_points_tell_that_a_map_has_grown(size: tuple[int, int], is_grown: bool) -> None:
    assert growth._has_grown(size, (10, 100)) == is_grown
