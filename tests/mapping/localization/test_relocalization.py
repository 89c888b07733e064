"""Relocalization without images: how certain a pose is, what neighbours in time add, and which parts have changed."""

import dataclasses
import tempfile
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import esdf
from esdf.solids import Box, Scene
from flight import FloatArray, frames, rotations, silent
from goshawk.rendered.world import default_rig
from mapping.input.images import ImageSet
from mapping.localization import changes, neighbours, pose_certainty, relocalization
from mapping.localization.pose_certainty import Match
from mapping.localization.relocalization import Localization, LocalizationOptions
from mapping.sparse.features import features
from mapping.sparse.features.feature_files import FeatureFiles
from mapping.sparse.features.features import Features
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
        answer = relocalization._answer(RIG, matches_at(T_WORLD_BODY, 0.5, rng))
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


def pixel_errors(T_world_body: FloatArray, matches: list[Match]) -> FloatArray:
    """(2 n,) reprojection errors."""
    return np.concatenate(
        [
            (
                RIG.cameras[number].project(
                    frames.apply(frames.invert(T_world_body @ RIG.cameras[number].T_body_camera), points)
                )
                - pixels
            ).ravel()
            for number, pixels, points in matches
        ]
    )


def test_the_covariance_propagates_the_errors_through_the_derivative_after_the_pose() -> None:
    given, step = matches_at(T_WORLD_BODY, 0.5, np.random.default_rng(2)), 1e-6
    J = np.empty((len(pixel_errors(T_WORLD_BODY, given)), 6))
    for column, change in enumerate(step * np.eye(6)):
        ahead, behind = (
            frames.transform([1.0, 0.0, 0.0, 0.0], sign * change[:3])
            @ T_WORLD_BODY
            @ frames.transform(rotations.exp(sign * change[3:]), np.zeros(3))
            for sign in (1.0, -1.0)
        )
        J[:, column] = (pixel_errors(ahead, given) - pixel_errors(behind, given)) / (2.0 * step)
    e = pixel_errors(T_WORLD_BODY, given)
    expected = np.linalg.inv(J.T @ J) * (e @ e) / (len(e) - 6)
    np.testing.assert_allclose(pose_certainty.covariance(RIG, given, T_WORLD_BODY), expected, rtol=1e-4, atol=1e-12)


def test_four_matches_tell_how_certain_a_pose_is_and_three_do_not() -> None:
    three, four = (matches_at(T_WORLD_BODY, 0.5, np.random.default_rng(2), count=n)[:1] for n in (3, 4))
    assert np.isnan(pose_certainty.covariance(RIG, three, T_WORLD_BODY)).all()
    assert np.isfinite(pose_certainty.covariance(RIG, four, T_WORLD_BODY)).all()


def test_a_refusal_says_why() -> None:
    rng = np.random.default_rng(3)
    few = relocalization._answer(RIG, matches_at(T_WORLD_BODY, 0.5, rng, count=10))
    assert (few.T_world_body, few.refusal) == (None, "20 features look like points of the map; 30 needed")
    wrong = [(n, p, rng.permutation(x)) for n, p, x in matches_at(T_WORLD_BODY, 0.5, rng)]
    answer = relocalization._answer(RIG, wrong)
    assert answer.T_world_body is None
    assert answer.refusal.endswith("of 400 matches agree with one pose; 60 needed")
    right, rest = matches_at(T_WORLD_BODY, 0.5, rng, count=10), matches_at(T_WORLD_BODY, 0.5, rng, count=50)
    mixed = [
        (n, np.concatenate([p, q]), np.concatenate([x, rng.permutation(y)]))
        for (n, p, x), (_, q, y) in zip(right, rest, strict=True)
    ]
    assert relocalization._answer(RIG, mixed).refusal.endswith("of 120 matches agree with one pose; 30 needed")


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
        ((0, 1.15, np.nan, np.nan, np.nan, np.nan), (0, 1)),
        ((0, 2, 1.1, np.nan, np.nan, np.nan), (1, 2)),
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


def test_an_instant_is_expected_beside_the_nearest_of_its_neighbours() -> None:
    T = np.array([frames.transform([1.0, 0.0, 0.0, 0.0], [x_m, 0.0, 0.0]) for x_m in (0.0, 1.0, 2.0, 5.0, 7.0, 20.0)])
    for kept, expected_x_m in (([0, 1, 4, 5], 3.0), ([0, 1], 1.0), ([4, 5], 7.0)):
        known = np.full_like(T, np.nan)
        known[kept] = T[kept]
        found = neighbours.predicted(TIMES_S, known, 2, within_s=3.0)
        assert found is not None
        np.testing.assert_allclose(found[:3, 3], [expected_x_m, 0.0, 0.0])


# --- matches ---


@settings(max_examples=50, deadline=None)
@given(seed=st.integers(0, 2**32 - 1), queries=st.integers(0, 12), known=st.integers(0, 12), rows=st.integers(1, 5))
def test_a_match_is_clear_mutual_and_near_its_direction(seed: int, queries: int, known: int, rows: int) -> None:
    rng = np.random.default_rng(seed)
    of_query, of_known = (features.unit(rng.gamma(0.6, 1.0, (n, 128))) for n in (queries, known))
    near = rng.random((queries, known)) < 0.8
    same = min(queries, known) // 2
    of_query[:same] = features.unit(of_known[:same] + 0.3 * rng.random((same, 128)))
    of_query[same : 2 * same] = features.unit(of_known[:same] + 0.3 * rng.random((same, 128)))
    cosine = np.where(near, of_query @ of_known.T, -1.0)
    expected = []
    for k, row in enumerate(cosine if known >= 2 else ()):
        best, second = np.argsort(-row)[:2]
        clear = 1.0 - row[best] < 0.85**2 * (1.0 - row[second])
        if clear and cosine[:, best].argmax() == k:
            expected.append((k, best))
    # rays whose angle is small for exactly the pairs that are near: each known point has an axis of its own
    rays_known = np.eye(max(known, 1))[:known]
    beside = relocalization.Beside(near.astype(float), rays_known, 0.5)
    with pytest.MonkeyPatch.context() as patched:
        patched.setattr(relocalization, "_ROWS", rows)
        found = relocalization.match(of_query, of_known, 0.85, beside)
    assert list(zip(*(part.tolist() for part in found), strict=True)) == expected


# --- images of a place whose textures stand behind the camera a second time ---

CAMERA = RIG.cameras[0]
ALONE = dataclasses.replace(RIG, cameras=(CAMERA,))


def seen_first(count: int) -> FloatArray:
    """(count, 3) points that the camera sees from the first pose."""
    pixels = RNG_POINTS.uniform([60.0, 60.0], [260.0, 180.0], (count, 2))
    return frames.apply(CAMERA.T_body_camera, CAMERA.unproject(pixels) * RNG_POINTS.uniform(3, 6, (count, 1)))


def textures(count: int) -> FloatArray:
    return features.unit(RNG_POINTS.gamma(0.6, 1.0, (count, 128)))


BEHIND, FAR_AWAY_M = np.array([-1.0, 1.0, 1.0]), np.array([50.0, 0.0, 0.0])
SINGLE_M, TWICE_M, MOVED_M = seen_first(80), seen_first(120), seen_first(120)
SINGLE, TWICE, MOVED = textures(80), textures(120), textures(120)
FADED = features.unit(MOVED + 0.4 * MOVED.mean() * RNG_POINTS.gamma(0.6, 1.0, MOVED.shape))
KNOWN = LocalizationMap(
    np.concatenate([SINGLE_M, TWICE_M, TWICE_M * BEHIND, MOVED_M, MOVED_M + FAR_AWAY_M]),
    np.concatenate([SINGLE, TWICE, TWICE, FADED, MOVED]),
)
POSES = np.array([frames.transform([1.0, 0.0, 0.0, 0.0], [0.3 * k, 0.0, 0.0]) for k in range(3)])


@pytest.fixture
def shown(monkeypatch: pytest.MonkeyPatch) -> dict[str, tuple[FloatArray, FloatArray]]:
    """What each image shows: the first and the third what is in the map once, the second what is in it twice."""
    of_image = {"0.png": (SINGLE_M, SINGLE), "1.png": (TWICE_M, TWICE), "2.png": (SINGLE_M, SINGLE)}

    def of_set(images: ImageSet, count: int):
        for name in images.instants:
            points, descriptors = of_image[name]
            pixels = CAMERA.project(frames.apply(frames.invert(POSES[int(name[0])] @ CAMERA.T_body_camera), points))
            noisy = features.unit(descriptors + 0.01 * np.random.default_rng(0).normal(size=descriptors.shape))
            yield Features(pixels, np.ones(len(pixels)), np.zeros(len(pixels)), noisy)

    monkeypatch.setattr(relocalization.features, "of_set", of_set)
    return of_image


@pytest.fixture
def three_images(shown: dict[str, tuple[FloatArray, FloatArray]]) -> ImageSet:
    return ImageSet(Path("nowhere"), ALONE, tuple(shown), np.ones((3, 1), dtype=bool), np.array([0.0, 0.5, 1.0]))


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
    for time_s in (np.full(3, np.nan), np.array([0.0, np.nan, 1.0]), np.zeros(3)):  # nothing is known of neighbours
        untimed = localized(dataclasses.replace(three_images, time_s=time_s))
        assert untimed.failed == ("1.png",)
        assert "features look like points of the map" in untimed.refused["1.png"]
        assert np.isnan(untimed.covariance[1]).all()
    assert localized(three_images, LocalizationOptions(neighbours_s=0.3)).failed == ("1.png",)


def test_a_pose_that_is_not_reached_in_time_is_refused(three_images: ImageSet) -> None:
    at_once = dataclasses.replace(three_images, time_s=np.array([0.0, 0.001, 0.002]))
    answer = localized(at_once, LocalizationOptions(fastest_m_s=2.0))
    assert answer.found.sum() == 1
    assert "at 2 m/s" in next(iter(answer.refused.values()))


def test_an_image_with_a_wrong_pose_is_looked_for_again_beside_its_neighbours(
    three_images: ImageSet, shown: dict[str, tuple[FloatArray, FloatArray]]
) -> None:
    shown["1.png"] = (MOVED_M, MOVED)
    alone = localized(dataclasses.replace(three_images, time_s=np.full(3, np.nan)))
    assert alone.T_world_body[1, 0, 3] == pytest.approx(50.3, abs=0.01)
    np.testing.assert_allclose(localized(three_images).T_world_body, POSES, atol=1e-3)


# --- changed regions ---

CORNERS = np.array([[x, y, 0.5] for x in range(10) for y in range(10)], dtype=np.float64)
POINTS = 24
PLACES = (CORNERS[:, None] + 0.007 * np.arange(POINTS)[:, None] * np.array([1.0, 1.0, 0.0])).reshape(-1, 3)
"""A hundred cells of 24 points."""


def looks(share: FloatArray, images: int = 10) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Every point in every image, found again with a probability of its own (2400,)."""
    point, instant = np.tile(np.arange(len(PLACES)), images), np.repeat(np.arange(images), len(PLACES))
    return instant, point, np.random.default_rng(5).random(len(point)) < share[point]


def test_a_cell_that_is_not_found_again_is_a_changed_region() -> None:
    share = np.full(len(PLACES), 0.5)
    share[POINTS * 42 : POINTS * 43] = 0.1
    found = changes.changed(PLACES, *looks(share))
    (region,) = found.regions
    np.testing.assert_allclose(region.low_world_m, [4.0, 2.0, 0.5])
    np.testing.assert_allclose(region.high_world_m, [4.161, 2.161, 0.5])
    assert (region.points, region.looks) == (POINTS, 10 * POINTS)
    assert 0.02 < region.found / region.looks < 0.17
    assert found.usual_share == pytest.approx(0.5, abs=0.02)


def test_regions_that_do_not_touch_are_apart_wherever_the_map_lies() -> None:
    share = np.full(len(PLACES), 0.5)
    share[POINTS * 42 : POINTS * 43] = share[POINTS * 77 : POINTS * 78] = 0.05
    far = PLACES + np.array([9000.0, -9000.0, 0.0])
    regions = changes.changed(far, *looks(share)).regions
    assert sorted(region.low_world_m for region in regions) == [(9004.0, -8998.0, 0.5), (9007.0, -8993.0, 0.5)]


def test_nothing_has_changed_where_all_is_found_alike_nor_where_a_single_image_fails() -> None:
    instant, point, again = looks(np.full(len(PLACES), 0.5))
    assert changes.changed(PLACES, instant, point, again).regions == ()
    assert changes.changed(PLACES, instant, point, again & (instant != 3)).regions == ()


def test_two_images_or_few_points_name_no_region() -> None:
    share = np.full(len(PLACES), 0.5)
    share[POINTS * 77 : POINTS * 78] = 0.0
    instant, point, again = looks(share)
    shown_twice = ~((point // POINTS == 77) & (instant > 1))
    assert changes.changed(PLACES, instant[shown_twice], point[shown_twice], again[shown_twice]).regions == ()
    for kept, count in ((19, 0), (20, 1)):
        few = ~((point // POINTS == 77) & (point % POINTS >= kept))
        assert len(changes.changed(PLACES, instant[few], point[few], again[few]).regions) == count


def test_images_that_find_little_again_say_nothing() -> None:
    share = np.full(len(PLACES), 0.15)
    share[:POINTS] = 0.0
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
    assert len(seen.looked_at(POSES[1] @ CAMERA.T_body_camera, CAMERA, field)) == len(SINGLE_M)
    far = frames.transform([1.0, 0.0, 0.0, 0.0], [-6.0, 0.0, 0.0])
    assert len(seen.looked_at(far @ CAMERA.T_body_camera, CAMERA, field)) == 0, "they are less than half as large there"
    near = frames.transform([1.0, 0.0, 0.0, 0.0], [2.5, 0.0, 0.0])
    assert len(seen.looked_at(near @ CAMERA.T_body_camera, CAMERA, field)) == 0, "they are more than half larger there"
    aside = frames.transform(rotations.exp([0.0, 0.0, 0.9]), [0.5, -4.0, 0.0])
    assert len(seen.looked_at(aside @ CAMERA.T_body_camera, CAMERA, field)) < 0.2 * len(SINGLE_M)


def test_points_that_a_camera_of_the_map_was_much_nearer_to_are_not_looked_for() -> None:
    grid = esdf.Grid((-8.0, -8.0, -8.0), (0.5, 0.5, 0.5), (32, 32, 32))
    field = esdf.build(np.full(grid.shape, esdf.FREE, np.uint8), grid)
    here = POSES[1] @ CAMERA.T_body_camera
    for nearer_m, least, most in ((0.2, 1.0, 1.0), (2.5, 0.0, 0.2)):
        turned_away = frames.transform(rotations.exp([0.0, 0.0, np.pi]), [nearer_m, 0.0, 0.0])
        seen = changes._Seen(SINGLE_M, ALONE, np.stack([POSES[0], turned_away]))
        assert least <= len(seen.looked_at(here, CAMERA, field)) / len(SINGLE_M) <= most


def test_a_point_is_found_again_by_a_feature_like_it_near_its_place() -> None:
    known = LocalizationMap(SINGLE_M, SINGLE)
    T_world_camera, none = POSES[0] @ CAMERA.T_body_camera, np.zeros(len(SINGLE))
    pixels = CAMERA.project(frames.apply(frames.invert(T_world_camera), SINGLE_M))
    points = np.arange(len(SINGLE))
    for shift_px, descriptors, share in ((3.0, SINGLE, 1.0), (7.0, SINGLE, 0.0), (0.0, SINGLE[::-1], 0.0)):
        image = Features(pixels + np.array([shift_px, 0.0]), none, none, descriptors)
        found = changes._found_again(known, points, image, T_world_camera, CAMERA)
        assert found.mean() == pytest.approx(share, abs=0.1)
