"""Scale and world frame: a known similarity is recovered, outliers have no influence, no map without a scale."""

from pathlib import Path

import numpy as np
import pytest

from flight import FloatArray, FormatError, InputError, MapError, frames, rotations
from mapping.camera.rig import Rig, forward_camera
from mapping.input.images import ImageSet
from mapping.sparse import alignment, reconstruction
from mapping.sparse.alignment import Length, References

COUNT = 40
RIG = Rig((forward_camera("SIMPLE_RADIAL_FISHEYE", 64, 48, [40.0, 32.0, 24.0, 0.0]),))


def image_set(folder: Path = Path("images")) -> ImageSet:
    names = tuple(f"{k:03d}.jpg" for k in range(COUNT))
    return ImageSet(folder, RIG, names, np.ones((COUNT, 1), dtype=bool), np.full(COUNT, np.nan))


@pytest.fixture
def truth() -> FloatArray:
    """Poses of a climbing turn, (n, 4, 4)."""
    angle = np.linspace(0.0, 4.0, COUNT)
    positions = np.stack([3.0 * np.sin(angle), 2.0 - 2.0 * np.cos(angle), 0.4 * angle], axis=-1)
    tilt = rotations.exp(np.stack([0.1 * np.sin(angle), 0.2 + 0.0 * angle, 0.0 * angle], axis=-1))
    return frames.transform(rotations.multiply(rotations.from_yaw(angle), tilt), positions)


def as_colmap_gives_it(truth: FloatArray, scale: float) -> FloatArray:
    T_old_world = frames.transform(rotations.exp([0.4, -1.1, 2.0]), [5.0, -3.0, 1.0])
    old = T_old_world @ truth
    old[:, :3, 3] /= scale
    return old


def nothing() -> References:
    return References(np.full((COUNT, 3), np.nan), np.full((COUNT, 3), np.nan))


def up_of(truth: FloatArray) -> FloatArray:
    return truth[:, 2, :3].copy()  # R_world_body^T z


def test_recorded_positions_and_gravity_undo_any_similarity(truth: FloatArray) -> None:
    references = References(truth[:, :3, 3].copy(), up_of(truth))
    found = alignment.align(image_set(), as_colmap_gives_it(truth, 0.37), references, baseline_std=None, length=None)
    assert found.scale == pytest.approx(0.37)
    assert (found.scale_source, found.up_source) == ("recorded positions", "recorded gravity")
    np.testing.assert_allclose(found.poses(as_colmap_gives_it(truth, 0.37)), truth, atol=1e-9)
    assert found.position_residual_m == pytest.approx(0.0, abs=1e-9)


def test_a_third_of_outliers_in_positions_and_some_in_gravity_have_no_influence(truth: FloatArray) -> None:
    rng = np.random.default_rng(5)
    positions = truth[:, :3, 3] + 0.01 * rng.normal(size=(COUNT, 3))
    liars = rng.choice(COUNT, COUNT // 3, replace=False)
    positions[liars] += rng.normal(size=(len(liars), 3)) * 8.0
    up = up_of(truth)
    up[::7] = [1.0, 0.0, 0.0]
    old = as_colmap_gives_it(truth, 2.5)
    found = alignment.align(image_set(), old, References(positions, up), baseline_std=None, length=None)
    assert found.scale == pytest.approx(2.5, rel=0.005)
    np.testing.assert_allclose(found.poses(old)[:, :3, 3], truth[:, :3, 3], atol=0.03)
    assert found.positions_used >= COUNT - COUNT // 3 - 3
    assert found.up_spread_rad == pytest.approx(0.0, abs=1e-4)


def test_the_baseline_gives_the_scale_and_positions_only_the_pose_and_a_check(truth: FloatArray) -> None:
    off = truth[:, :3, 3] * 1.1
    references = References(off, up_of(truth))
    old = as_colmap_gives_it(truth, 1.0)
    found = alignment.align(image_set(), old, references, baseline_std=0.001, length=None)
    assert found.scale == 1.0
    assert found.scale_source == "rig baseline"
    assert found.scale_ratio_to_positions == pytest.approx(1 / 1.1)


@pytest.mark.parametrize(
    ("axes", "words"),
    [
        ([[0, 1, 0], [1, 0, 0], [0, 0, -1]], "their z points down"),
        ([[1, 0, 0], [0, 0, 1], [0, -1, 0]], "their y points up"),
        ([[0, 1, 0], [1, 0, 0], [0, 0, 1]], "they are left-handed"),
    ],
)
def test_positions_in_other_axes_beside_gravity_name_the_axes_in_which_they_fit(
    truth: FloatArray, axes: list[list[int]], words: str
) -> None:
    given = References(truth[:, :3, 3] @ np.array(axes, float).T, up_of(truth))
    found = alignment.align(image_set(), as_colmap_gives_it(truth, 1.0), given, baseline_std=0.001, length=None)
    assert found.better_axes.startswith(words)
    assert found.position_residual_m is not None
    assert found.position_residual_m > alignment.LARGE_RESIDUAL * found.position_extent_m


@pytest.mark.parametrize("between", [None, ("003.jpg", "021.jpg")])
def test_a_given_length_overrides_every_other_scale(truth: FloatArray, between: tuple[str, str] | None) -> None:
    p = truth[:, :3, 3]
    metres = np.linalg.norm(np.diff(p, axis=0), axis=1).sum() if between is None else np.linalg.norm(p[21] - p[3])
    length = Length(float(metres), between)
    old = as_colmap_gives_it(truth, 0.02)
    found = alignment.align(image_set(), old, nothing(), baseline_std=0.001, length=length)
    assert found.scale == pytest.approx(0.02)
    assert found.scale_source == "given length"


def test_without_records_the_world_starts_level_at_the_first_image(truth: FloatArray) -> None:
    old = as_colmap_gives_it(truth, 1.0)
    old[0] = np.nan  # not registered: the second image is then the first
    found = alignment.align(image_set(), old, nothing(), baseline_std=0.001, length=None)
    assert found.up_source == "first image taken as level"
    poses = found.poses(old)
    np.testing.assert_allclose(poses[1], np.eye(4), atol=1e-9)
    expected = frames.invert(truth[1]) @ truth[1:]
    np.testing.assert_allclose(poses[1:], expected, atol=1e-9)


def test_points_move_with_the_poses(truth: FloatArray) -> None:
    old = as_colmap_gives_it(truth, 0.5)
    found = alignment.align(image_set(), old, nothing(), baseline_std=None, length=Length(7.0))
    np.testing.assert_allclose(found.points(old[:, :3, 3]), found.poses(old)[:, :3, 3], atol=1e-12)


def test_a_single_camera_without_any_length_is_refused(truth: FloatArray) -> None:
    with pytest.raises(MapError, match="no metric scale"):
        alignment.align(image_set(), truth, nothing(), baseline_std=None, length=None)


@pytest.mark.parametrize(("registered", "seen"), [([[1, 0], [0, 1]], False), ([[1, 1], [0, 1]], True)])
def test_a_rig_gives_a_scale_only_where_two_cameras_look_at_once(registered: list[list[int]], seen: bool) -> None:
    assert reconstruction._rig_seen(np.array(registered, dtype=bool)) is seen


def test_a_length_between_images_that_are_not_there_is_refused(truth: FloatArray) -> None:
    with pytest.raises(InputError, match=r"no .x\.jpg.; its .* images go from 000\.jpg to "):
        alignment.require_ends(image_set(), Length(1.0, ("001.jpg", "x.jpg")))
    with pytest.raises(InputError, match="to itself; name two images"):
        alignment.require_ends(image_set(), Length(1.0, ("001.jpg", "001.jpg")))
    alignment.require_ends(image_set(), Length(1.0, ("001.jpg", "000.jpg")))
    with pytest.raises(InputError, match="above 0 and at most 100000 m"):
        Length(0.0)


def test_references_are_read_with_empty_cells(tmp_path: Path) -> None:
    (tmp_path / "references.csv").write_text("image,x_m,y_m,z_m\n003.jpg,1,2,3\n004.jpg,,,\n")
    references = alignment.read_references(image_set(tmp_path))
    assert references.position_m[3].tolist() == [1.0, 2.0, 3.0]
    assert int(np.isfinite(references.position_m).all(axis=1).sum()) == 1
    assert np.isnan(references.up_body).all()


def test_references_of_a_spreadsheet_are_read(tmp_path: Path) -> None:
    """It begins with a byte order mark; a space may follow each comma."""
    path = tmp_path / "references.csv"
    path.write_text("\ufeffx_m, y_m, z_m, image\n1, 2, 3, 003.jpg\n")
    assert alignment.read_references(image_set(tmp_path)).position_m[3].tolist() == [1.0, 2.0, 3.0]


def test_references_that_match_no_image_or_lie_far_away_are_refused(tmp_path: Path) -> None:
    path = tmp_path / "references.csv"
    path.write_text("image,lat,lon\n003.jpg,1,2\n")
    with pytest.raises(FormatError, match="neither"):
        alignment.read_references(image_set(tmp_path))
    path.write_text("image,x_m,y_m,z_m\n003.jpg,1,5400000,3\n")
    with pytest.raises(InputError, match="5,400 km from the origin"):
        alignment.read_references(image_set(tmp_path))
    path.write_text("image,x_m,y_m,z_m\nother.jpg,1,2,3\n")
    with pytest.raises(InputError, match="names none"):
        alignment.read_references(image_set(tmp_path))
    with pytest.raises(InputError, match="does not exist"):
        alignment.read_references(image_set(tmp_path), tmp_path / "absent.csv")
