"""A real walk with a self-calibrated fisheye, against the camera's own record of its attitude and its GPS."""

import importlib.util
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import mapping
from flight import rotations
from mapping.camera import rig as rigs
from mapping.sparse import reconstruction
from mapping.sparse.reconstruction import SparseMap

ROOT = Path(__file__).parents[3]
WALK = ROOT.parent / "shared" / "data" / "imagery" / "gopro_max_walk"

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(not WALK.is_dir(), reason="the recorded walk is not on this machine (../shared is absent)"),
]


@pytest.fixture(scope="module")
def converter() -> ModuleType:
    spec = importlib.util.spec_from_file_location("gopro_references", ROOT / "tools" / "gopro_references.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.fixture(scope="module")
def placed(converter: ModuleType, tmp_path_factory: pytest.TempPathFactory) -> SparseMap:
    folder = tmp_path_factory.mktemp("walk") / "images"
    converter.convert(WALK, folder)
    return reconstruction.reconstruct(mapping.read_folder(folder, rigs.load(folder / "camera.toml")))


def test_every_frame_is_placed_and_fits(placed: SparseMap) -> None:
    assert int(placed.registered.sum()) == 53
    assert placed.reprojection_error_px <= 0.65
    assert placed.least_agreement > 0.9
    assert len(placed.breaks) == 0


def test_attitudes_follow_the_cameras_own_record(placed: SparseMap, converter: ModuleType) -> None:
    q = rotations.from_matrix(placed.T_world_body[:, :3, :3])
    recorded = converter.image_rotations(WALK, list(placed.images.instants))
    ours, theirs = (rotations.log(rotations.multiply(rotations.conjugate(a[0]), a)) for a in (q, recorded))
    axes, _ = Rotation.align_vectors(theirs, ours)
    off_rad = rotations.angle_between(rotations.exp(axes.apply(ours)), rotations.exp(theirs))
    assert np.degrees(np.sqrt(np.mean(off_rad[1:] ** 2))) < 0.3


def test_scale_and_up_come_from_the_record(placed: SparseMap) -> None:
    aligned = placed.alignment
    assert (aligned.scale_source, aligned.up_source) == ("recorded positions", "recorded gravity")
    track = placed.T_world_body[:, :3, 3]
    length_m = np.linalg.norm(np.diff(track, axis=0), axis=1).sum()
    assert 11.0 < length_m < 16.0  # 10.4 s of walking; GPS says 13.2 m net and is good to some 10 %
    assert np.ptp(track[:, 2]) < 1.5  # a garden path, not a stairway: up is up
    # the camera is carried level to some 10 degrees, and lowered at the end
    assert np.median(np.degrees(np.arccos(placed.T_world_body[:, 2, 2]))) < 12.0


def test_lens_is_calibrated_from_a_rough_guess(placed: SparseMap) -> None:
    lens = placed.rig.cameras[0]
    assert lens.focal_px == pytest.approx((376.0, 377.0), rel=0.015)
    assert lens.principal_point_px == (424.0, 240.0)
