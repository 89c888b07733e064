"""Relocalization without images: how certain a pose is, what neighbours in time add, and which parts have changed."""

import dataclasses
import tempfile
from pathlib import Path

import numpy as np
import pytest

import esdf
from esdf.solids import Box, Scene
from flight import FloatArray, frames, rotations, silent
from goshawk.rendered.world import default_rig
from mapping.input.images import ImageSet
from mapping.localization import changes, neighbours, pose_certainty, relocalization
from mapping.localization.pose_certainty import Match
from mapping.localization.relocalization import Localization, LocalizationOptions
from mapping.sparse import features
from mapping.sparse.feature_files import FeatureFiles
from mapping.sparse.features import Features
from mapping.sparse.localization_map import LocalizationMap

RIG = default_rig(0.5)
T_WORLD_BODY = frames.transform(rotations.exp([0.1, -0.2, 0.7]), [1.0, 2.0, 1.5])
RNG_POINTS = np.random.default_rng(4)


def matches_at(T_world_body: FloatArray, noise_px: float, rng: np.random.Generator, count: int = 200) -> list[Match]:
    """Matches of points that each camera of the rig sees at 1 to 6 m."""
    found: list[Match] = []
    for number, camera in enumerate(RIG):
        pixels = rng.uniform([40.0, 40.0], [280.0, 200.0], (count, 2))
        in_camera = camera.unproject(pixels) * rng.uniform(1.0, 6.0, (count, 1))
        points = frames.apply(T_world_body @ camera.T_body_camera, in_camera)
        found.append((number, pixels + noise_px * rng.normal(size=pixels.shape), points))
    return found


def test_the_covariance_is_that_of_many_draws_of_the_noise() -> None:
    rng, squared = np.random.default_rng(1), []
    for _ in range(60):
        answer = relocalization._answer(RIG, matches_at(T_WORLD_BODY, 0.5, rng), LocalizationOptions())
        assert answer.T_world_body is not None
        off_m = answer.T_world_body[:3, 3] - T_WORLD_BODY[:3, 3]
        off_rad = rotations.log(rotations.from_matrix(T_WORLD_BODY[:3, :3].T @ answer.T_world_body[:3, :3]))
        off = np.concatenate([off_m, off_rad])
        covariance = pose_certainty.covariance(RIG, answer.supporting, answer.T_world_body)
        squared.append(off @ np.linalg.solve(covariance, off) / 6.0)
    assert np.mean(squared) == pytest.approx(1.0, abs=0.25)  # of 360 squares: standard deviation 0.075


def test_the_covariance_turns_with_the_map() -> None:
    given = matches_at(T_WORLD_BODY, 0.5, np.random.default_rng(2))
    T = frames.transform(rotations.exp([0.0, 0.0, 1.1]), [5.0, -3.0, 0.4])
    moved = [(number, pixels, frames.apply(T, points)) for number, pixels, points in given]
    before, after = (
        pose_certainty.covariance(RIG, those, pose)
        for those, pose in ((given, T_WORLD_BODY), (moved, T @ T_WORLD_BODY))
    )
    turn = np.eye(6)
    turn[:3, :3] = T[:3, :3]
    np.testing.assert_allclose(after, turn @ before @ turn.T, rtol=1e-4, atol=1e-12)


def test_three_matches_say_nothing_of_the_certainty() -> None:
    given = [matches_at(T_WORLD_BODY, 0.5, np.random.default_rng(2), count=3)[0]]
    assert np.isnan(pose_certainty.covariance(RIG, given, T_WORLD_BODY)).all()


def test_a_refusal_says_why() -> None:
    rng, options = np.random.default_rng(3), LocalizationOptions()
    few = relocalization._answer(RIG, matches_at(T_WORLD_BODY, 0.5, rng, count=10), options)
    assert (few.T_world_body, few.refusal) == (None, "20 features look like points of the map; 30 needed")
    wrong = [(n, p, rng.permutation(x)) for n, p, x in matches_at(T_WORLD_BODY, 0.5, rng)]
    answer = relocalization._answer(RIG, wrong, options)
    assert answer.T_world_body is None
    assert answer.refusal.endswith("of 400 matches agree with one pose; 60 needed")


TIMES_S = np.arange(6.0)


def on_a_line(*x_m: float) -> FloatArray:
    return np.array([[x, 0.0, 0.0] for x in x_m])


@pytest.mark.parametrize(
    ("x_m", "kept"),
    [
        ((0, 1, 2, 3, 4, 5), (0, 1, 2, 3, 4, 5)),
        ((0, 1, 9, 3, 4, 5), (0, 1, 3, 4, 5)),
        ((9, 1, 2, 3, 4, 5), (1, 2, 3, 4, 5)),
        ((0, 1, 2, 3, 4, -9), (0, 1, 2, 3, 4)),
        ((0, np.nan, np.nan, 3, 4, 5), (0, 3, 4, 5)),
        ((0, 1, 90, 91, 92, 93), (2, 3, 4, 5)),
        ((np.nan,) * 6, ()),
    ],
)
def test_the_larger_part_that_can_be_flown_is_kept(x_m: tuple[float, ...], kept: tuple[int, ...]) -> None:
    found = neighbours.reachable(TIMES_S, on_a_line(*x_m), fastest_m_s=1.0)
    assert np.flatnonzero(found).tolist() == list(kept)


def test_a_step_may_be_as_fast_as_stated() -> None:
    for step_m, both in ((2.0 + 0.9 * neighbours.SLACK_M, True), (2.0 + 1.1 * neighbours.SLACK_M, False)):
        assert neighbours.reachable(TIMES_S[:2], on_a_line(0.0, step_m), fastest_m_s=2.0).all() == both


def test_an_instant_is_expected_between_its_neighbours_and_beside_one_alone() -> None:
    T = np.full((6, 4, 4), np.nan)
    T[1] = frames.transform(rotations.exp([0.0, 0.0, 0.0]), [0.0, 0.0, 1.0])
    T[4] = frames.transform(rotations.exp([0.0, 0.0, 0.9]), [3.0, 0.0, 1.0])
    between = neighbours.predicted(TIMES_S, T, 2, within_s=2.0)
    assert between is not None
    np.testing.assert_allclose(between, frames.transform(rotations.exp([0.0, 0.0, 0.3]), [1.0, 0.0, 1.0]), atol=1e-12)
    np.testing.assert_array_equal(neighbours.predicted(TIMES_S, T, 0, within_s=2.0), T[1])
    np.testing.assert_array_equal(neighbours.predicted(TIMES_S, T, 5, within_s=2.0), T[4])
    np.testing.assert_array_equal(neighbours.predicted(TIMES_S, T, 2, within_s=1.5), T[1])
    assert neighbours.predicted(TIMES_S, T, 5, within_s=0.5) is None


# --- three images of a place whose textures stand behind the camera a second time ---

CAMERA = dataclasses.replace(RIG.cameras[0], T_body_camera=np.eye(4))
ALONE = dataclasses.replace(RIG, cameras=(CAMERA,))
SINGLE_M, TWICE_M = (
    CAMERA.unproject(RNG_POINTS.uniform([60.0, 60.0], [260.0, 180.0], (count, 2)))
    * RNG_POINTS.uniform(3, 6, (count, 1))
    for count in (80, 120)
)
SINGLE, TWICE = (features.unit(RNG_POINTS.gamma(0.6, 1.0, (count, 128))) for count in (80, 120))
KNOWN = LocalizationMap(
    np.concatenate([SINGLE_M, TWICE_M, TWICE_M * [1.0, 1.0, -1.0]]), np.concatenate([SINGLE, TWICE, TWICE])
)
POSES = np.array([frames.transform([1.0, 0.0, 0.0, 0.0], [0.3 * k, 0.0, 0.0]) for k in range(3)])


@pytest.fixture
def three_images(monkeypatch: pytest.MonkeyPatch) -> ImageSet:
    """The first and the third show what is in the map once, the second what is in it twice."""
    shown = {"0.png": (SINGLE_M, SINGLE), "1.png": (TWICE_M, TWICE), "2.png": (SINGLE_M, SINGLE)}

    def of_set(images: ImageSet, count: int):
        for name in images.instants:
            points, descriptors = shown[name]
            pixels = CAMERA.project(frames.apply(frames.invert(POSES[int(name[0])]), points))
            noisy = features.unit(descriptors + 0.01 * np.random.default_rng(0).normal(size=descriptors.shape))
            yield Features(pixels, np.ones(len(pixels)), np.zeros(len(pixels)), noisy)

    monkeypatch.setattr(relocalization.features, "of_set", of_set)
    names = ("0.png", "1.png", "2.png")
    return ImageSet(Path("nowhere"), ALONE, names, np.ones((3, 1), dtype=bool), np.array([0.0, 0.5, 1.0]))


def localized(images: ImageSet, options: LocalizationOptions | None = None) -> Localization:
    with tempfile.TemporaryDirectory() as keep:
        return relocalization.localize_here(
            KNOWN, images, options or LocalizationOptions(), Path(keep), progress=silent
        )


def test_features_are_found_once_and_kept_as_they_were(
    three_images: ImageSet, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    first = list(features.of_set(three_images, 2000))
    searched: list[str] = []
    find = features.of_set

    def of_set(images: ImageSet, count: int):
        searched.extend(images.instants)
        return find(images, count)

    monkeypatch.setattr(relocalization.features, "of_set", of_set)
    relocalization.localize_here(KNOWN, three_images, LocalizationOptions(), tmp_path, progress=silent)
    assert searched == list(three_images.instants), "the second, looked for again beside its neighbours, as well"
    kept = FeatureFiles(tmp_path)
    assert len(kept) == len(first)
    for before, after in zip(first, kept, strict=True):
        for field in dataclasses.fields(Features):
            np.testing.assert_array_equal(getattr(after, field.name), getattr(before, field.name))
            assert getattr(after, field.name).dtype == getattr(before, field.name).dtype


def test_each_image_is_compared_by_its_own_features(three_images: ImageSet) -> None:
    grid = esdf.Grid((-8.0, -8.0, -8.0), (0.5, 0.5, 0.5), (32, 32, 32))
    field = esdf.build(np.full(grid.shape, esdf.FREE, np.uint8), grid)
    known = LocalizationMap(SINGLE_M, SINGLE)
    shown, looked_at = list(features.of_set(three_images, 2000)), []
    poses = POSES.copy()
    poses[0] = np.nan  # not found: neither it nor its features count

    def note(points: FloatArray, instant: np.ndarray, point: np.ndarray, again: np.ndarray) -> changes.Changes:
        looked_at.extend((int(k), round(float(again[instant == k].mean()), 1)) for k in np.unique(instant))
        return changes.Changes((), np.nan)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(changes, "changed", note)
        nothing = np.zeros(3, np.int64)
        answer = Localization(three_images.instants, poses, np.zeros((3, 6, 6)), nothing, nothing, {})
        changes.find(known, field, (ALONE, POSES), three_images, shown, answer)
    assert looked_at == [(1, 0.0), (2, 1.0)], "the second image shows other things"


def test_repeated_texture_is_found_beside_its_neighbours_in_time(three_images: ImageSet) -> None:
    answer = localized(three_images)
    assert answer.failed == ()
    assert answer.refused == {}
    np.testing.assert_allclose(answer.T_world_body, POSES, atol=1e-4)
    untimed = localized(dataclasses.replace(three_images, time_s=np.full(3, np.nan)))
    assert untimed.failed == ("1.png",)
    assert "features look like points of the map" in untimed.refused["1.png"]
    assert np.isnan(untimed.covariance[1]).all()
    assert localized(three_images, LocalizationOptions(neighbours_s=0.3)).failed == ("1.png",)


def test_a_pose_that_is_not_reached_in_time_is_refused(three_images: ImageSet) -> None:
    at_once = dataclasses.replace(three_images, time_s=np.array([0.0, 0.001, 0.002]))
    answer = localized(at_once, LocalizationOptions(fastest_m_s=2.0))
    assert answer.found.sum() == 1
    assert "at 2 m/s" in next(iter(answer.refused.values()))


# --- changed regions ---

CORNERS = np.array([[x, y, 0.5] for x in range(10) for y in range(10)], dtype=np.float64)
PLACES = (CORNERS[:, None] + 0.015 * np.arange(12)[:, None] * np.array([1.0, 1.0, 0.0])).reshape(-1, 3)
"""A hundred cells of twelve points."""


def looks(share: FloatArray, images: int = 10) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Every point in every image, found again with a probability of its own (1200,)."""
    point, instant = np.tile(np.arange(len(PLACES)), images), np.repeat(np.arange(images), len(PLACES))
    return instant, point, np.random.default_rng(5).random(len(point)) < share[point]


def test_a_cell_that_is_not_found_again_is_a_changed_region() -> None:
    share = np.full(len(PLACES), 0.5)
    share[12 * 42 : 12 * 43] = 0.1
    found = changes.changed(PLACES, *looks(share))
    (region,) = found.regions
    np.testing.assert_allclose(region.low_world_m, [4.0, 2.0, 0.5])
    np.testing.assert_allclose(region.high_world_m, [4.165, 2.165, 0.5])
    assert (region.points, region.looks) == (12, 120)
    assert 0.02 < region.found / region.looks < 0.17
    assert found.usual_share == pytest.approx(0.5, abs=0.02)


def test_regions_that_do_not_touch_are_apart_wherever_the_map_lies() -> None:
    share = np.full(len(PLACES), 0.5)
    share[12 * 42 : 12 * 43] = share[12 * 77 : 12 * 78] = 0.05
    far = PLACES + np.array([9000.0, -9000.0, 0.0])
    regions = changes.changed(far, *looks(share)).regions
    assert sorted(region.low_world_m for region in regions) == [(9004.0, -8998.0, 0.5), (9007.0, -8993.0, 0.5)]


def test_nothing_has_changed_where_all_is_found_alike_nor_where_a_single_image_fails() -> None:
    instant, point, again = looks(np.full(len(PLACES), 0.5))
    assert changes.changed(PLACES, instant, point, again).regions == ()
    assert changes.changed(PLACES, instant, point, again & (instant != 3)).regions == ()


def test_two_images_or_few_points_name_no_region() -> None:
    share = np.full(len(PLACES), 0.5)
    share[12 * 77 : 12 * 78] = 0.0
    instant, point, again = looks(share)
    shown_twice = ~((point // 12 == 77) & (instant > 1))
    assert changes.changed(PLACES, instant[shown_twice], point[shown_twice], again[shown_twice]).regions == ()
    nine = ~((point // 12 == 77) & (point % 12 > 8))
    assert changes.changed(PLACES, instant[nine], point[nine], again[nine]).regions == ()


def test_images_that_find_little_again_say_nothing() -> None:
    share = np.full(len(PLACES), 0.15)
    share[:12] = 0.0
    found = changes.changed(PLACES, *looks(share))
    assert found.regions == ()
    assert not found.can_tell


def test_a_wall_hides_what_is_behind_it() -> None:
    grid = esdf.Grid((0.0, 0.0, 0.0), (0.1, 0.1, 0.1), (40, 20, 20))
    field = esdf.build(esdf.rasterize(Scene([Box((2.0, 0.0, 0.0), (2.2, 1.0, 2.0))]), grid), grid)
    eye, points = (
        np.array([0.5, 0.5, 1.0]),
        np.array([[1.5, 0.5, 1.0], [2.0, 0.5, 1.0], [3.5, 0.5, 1.0], [0.5, 1.9, 1.0]]),
    )
    assert changes._in_sight(field, eye, points).tolist() == [True, True, False, True]


def test_only_what_an_image_of_the_map_saw_from_a_similar_place_is_looked_for() -> None:
    grid = esdf.Grid((-8.0, -8.0, -8.0), (0.5, 0.5, 0.5), (32, 32, 32))
    field = esdf.build(np.full(grid.shape, esdf.FREE, np.uint8), grid)
    seen = changes._Seen(SINGLE_M, ALONE, POSES[:1])
    assert len(seen.looked_at(POSES[1], CAMERA, field)) == len(SINGLE_M)
    far = frames.transform([1.0, 0.0, 0.0, 0.0], [0.0, 0.0, -6.0])
    assert len(seen.looked_at(far, CAMERA, field)) == 0, "they are less than half as large there"
    aside = frames.transform(rotations.exp([0.0, -0.9, 0.0]), [4.0, 0.0, 0.5])
    assert len(seen.looked_at(aside, CAMERA, field)) < 0.2 * len(SINGLE_M)


def test_a_point_is_found_again_by_a_feature_like_it_near_its_place() -> None:
    known = LocalizationMap(SINGLE_M, SINGLE)
    pixels, none = CAMERA.project(SINGLE_M), np.zeros(len(SINGLE))
    points = np.arange(len(SINGLE))
    for shift_px, descriptors, share in ((3.0, SINGLE, 1.0), (7.0, SINGLE, 0.0), (0.0, SINGLE[::-1], 0.0)):
        image = Features(pixels + np.array([shift_px, 0.0]), none, none, descriptors)
        found = changes._found_again(known, points, image, POSES[0], CAMERA)
        assert found.mean() == pytest.approx(share, abs=0.1)
