"""A misplaced image disagrees with its matches and is removed, as is what lies beyond a break; the others stay."""

from contextlib import nullcontext
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pycolmap
import pytest

import mapping
from flight import frames, rotations, silent
from goshawk.rendered import world as rendered_world
from goshawk.rendered.world import default_rig
from mapping.input.images import ImageSet
from mapping.sparse.mapper import agreement, colmap, colmap_model

INSTANTS = 6


@pytest.fixture
def images() -> ImageSet:
    names = tuple(f"{i:04d}.png" for i in range(INSTANTS))
    rig = default_rig()
    return ImageSet(Path("images"), rig, names, np.ones((INSTANTS, len(rig.cameras)), bool), np.full(INSTANTS, np.nan))


@pytest.fixture
def poses() -> np.ndarray:
    """A walk along x with small turns."""
    q = rotations.exp(np.random.default_rng(2).normal(0.0, 0.1, (INSTANTS, 3)))
    return frames.transform(q, np.arange(INSTANTS)[:, None] * np.array([0.3, 0.05, 0.0]))


@pytest.fixture
def database(images: ImageSet, poses: np.ndarray, monkeypatch) -> Path:
    """What COLMAP's would hold: points that each camera saw, matched between all instants of the same camera."""
    rng = np.random.default_rng(3)
    points = rng.uniform(-4.0, 4.0, (80, 3))
    points = points[np.linalg.norm(points[:, 1:], axis=1) > 1.0]
    shots, keypoints = [], {}
    for number, (i, c) in enumerate(images.pairs()):
        camera = images.rig.cameras[c]
        seen = frames.apply(frames.invert(poses[i] @ camera.T_body_camera), points)
        keypoints[number] = seen / np.linalg.norm(seen, axis=1, keepdims=True)
        shots.append(SimpleNamespace(image_id=number, name=images.relative(i, c)))
    same = np.stack([np.arange(len(points))] * 2, axis=1)
    numbers = {pair: n for n, pair in enumerate(images.pairs())}
    pairs = [(numbers[i, c], numbers[k, c]) for i, c in numbers for k in range(i + 1, INSTANTS)]
    opened = SimpleNamespace(
        read_all_images=lambda: shots,
        read_two_view_geometries=lambda: (
            [pycolmap.image_pair_to_pair_id(a, b) for a, b in pairs],
            [SimpleNamespace(inlier_matches=same)] * len(pairs),
        ),
    )
    monkeypatch.setattr(pycolmap.Database, "open", lambda _: nullcontext(opened))
    monkeypatch.setattr(agreement, "_rays_camera", lambda _opened, number, _rig, _camera: keypoints[number])
    return Path("database.db")


def displaced(poses: np.ndarray, i: int) -> np.ndarray:
    """As a second copy of the scene would place it: beside the walk and turned."""
    wrong = poses.copy()
    wrong[i] = frames.transform(rotations.exp([0.0, 0.0, 0.4]), [0.5, 1.5, 0.3]) @ wrong[i]
    return wrong


def test_matches_of_correctly_placed_images_agree_with_the_map(database, images, poses):
    assert np.all(agreement.of_pairs(database, images, images.rig, poses).of_instants() > 0.99)


@pytest.mark.parametrize("i", range(INSTANTS))
def test_a_misplaced_image_is_removed_and_no_other(database, images, poses, monkeypatch, i: int):
    wrong = displaced(poses, i)
    agreed = agreement.of_pairs(database, images, images.rig, wrong).of_instants()
    assert agreed[i] < agreement.LEAST
    assert int(np.argmin(agreed)) == i
    monkeypatch.setattr(colmap_model, "poses", lambda _model, _images: (wrong, images.present, images.rig))
    assert colmap._wrong_instants(database, images, None) == {
        images.relative(i, c) for c in range(len(images.rig.cameras))
    }


def test_an_image_that_looks_the_other_way_sees_its_points_behind_it(database, images, poses):
    wrong = poses.copy()
    wrong[:, :3, 3] *= -1.0  # a mirrored walk has the same epipolar planes
    assert np.all(agreement.of_pairs(database, images, images.rig, wrong).of_instants() < agreement.LEAST)


def test_an_image_that_is_not_placed_has_no_agreement(database, images, poses):
    poses[2] = np.nan
    agreed = agreement.of_pairs(database, images, images.rig, poses).of_instants()
    assert np.isnan(agreed[2])
    assert np.all(np.delete(agreed, 2) > 0.99)


def turned_from(poses: np.ndarray, first: int, angle_rad: float) -> np.ndarray:
    """A map broken before `first`: the images from there on are turned about that place."""
    wrong, pivot = poses.copy(), poses[first, :3, 3]
    turn = frames.transform(rotations.exp([0.0, 0.0, angle_rad]), np.zeros(3))
    turn[:3, 3] = pivot - turn[:3, :3] @ pivot
    wrong[first:] = turn @ wrong[first:]
    return wrong


@pytest.mark.parametrize("first", range(1, INSTANTS))
@pytest.mark.parametrize("angle_rad", np.radians([-10.0, 5.0, 19.7]))
def test_a_broken_map_is_told_where_it_is_broken(database, images, poses, monkeypatch, first: int, angle_rad: float):
    wrong = turned_from(poses, first, angle_rad)
    pairs = agreement.of_pairs(database, images, images.rig, wrong)
    assert pairs.breaks().tolist() == [[first - 1, first]]
    monkeypatch.setattr(colmap_model, "poses", lambda _model, _images: (wrong, images.present, images.rig))
    taken = {name.split("/")[-1] for name in colmap._wrong_instants(database, images, None)}
    smaller = range(first) if first < INSTANTS - first else range(first, INSTANTS)
    if 2 * first != INSTANTS:
        assert taken == {images.instants[k] for k in smaller}


def test_a_map_in_one_piece_has_no_break(database, images, poses):
    pairs = agreement.of_pairs(database, images, images.rig, poses)
    assert pairs.breaks().tolist() == []
    assert (pairs.part() == 0).all()


@pytest.fixture(scope="module")
def rendered(tmp_path_factory: pytest.TempPathFactory) -> tuple[ImageSet, np.ndarray, Path]:
    """Images of the furnished room, their true poses, and the matches that COLMAP verified between them."""
    folder, flight, rig = tmp_path_factory.mktemp("broken"), rendered_world.loop_flight(10, share=0.2), default_rig(0.4)
    rendered_world.write_rendered_sequence(folder / "images", rig=rig, flight=flight)
    images, options = mapping.read_folder(folder / "images", rig), colmap.SparseOptions(features=800)
    signatures, _ = colmap.extract(folder / "database.db", images, options, silent)
    colmap.match(folder / "database.db", images, signatures, options, silent)
    return images, flight.T_world_body, folder / "database.db"


@pytest.mark.slow
def test_matches_of_rendered_images_agree_with_their_true_poses(rendered) -> None:
    images, true, found = rendered
    pairs = agreement.of_pairs(found, images, images.rig, true)
    assert pairs.breaks().tolist() == []
    assert pairs.of_instants().min() > 0.95


@pytest.mark.slow
# with 480x360 images a turn of 5 degrees is found, with these of 256x192 one of 9: 4 pixels are 2 degrees there
@pytest.mark.parametrize("first", [4, 7])
@pytest.mark.parametrize(("angle_deg", "aside_m"), [(9.0, 0.0), (-9.0, 0.0), (0.0, 0.3)])
def test_a_jump_between_two_rendered_images_is_found_there(rendered, first: int, angle_deg: float, aside_m: float):
    images, true, found = rendered
    broken = turned_from(true, first, np.radians(angle_deg))
    broken[first:, :3, 3] += [0.0, 0.0, aside_m]
    assert agreement.of_pairs(found, images, images.rig, broken).breaks().tolist() == [[first - 1, first]]
