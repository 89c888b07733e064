"""The lens of images that nothing is known of, on rendered images of the rig's fisheye."""

from pathlib import Path

import pycolmap
import pytest

import mapping
from flight import MapError, silent
from goshawk.rendered import world as rendered_world
from goshawk.rendered.world import RenderedFlight
from mapping import child
from mapping.camera.rig import Rig
from mapping.sparse.calibration import lens_guess
from mapping.sparse.mapper import colmap
from mapping.sparse.mapper.colmap import SparseOptions

RIG = rendered_world.default_rig(0.75)


@pytest.fixture(scope="module")
def pictures(tmp_path_factory: pytest.TempPathFactory) -> Path:
    flight = rendered_world.loop_flight(33, share=0.3)
    flight = RenderedFlight(flight.times_s[::2].copy(), flight.T_world_body[::2].copy())
    folder = tmp_path_factory.mktemp("pictures")
    return rendered_world.write_rendered_sequence(folder, rig=RIG, flight=flight, seed=1) / "front"


def test_a_lens_nothing_is_known_of_is_found_to_be_a_fisheye(pictures: Path) -> None:
    guess = lens_guess.from_pictures(pictures)
    assert guess.is_calibrated
    assert guess.camera.params[3] < 1.0 / 6.0  # of an ordinary lens: 1/3
    assert guess.camera.focal_px[0] == pytest.approx(RIG.cameras[0].focal_px[0], rel=0.03)


def test_a_self_calibration_that_fails_says_why(pictures: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def broken(*_: object, **__: object) -> None:
        raise MapError("matching features failed: disk I/O error")

    monkeypatch.setattr(child, "run", broken)
    guess = lens_guess.from_pictures(pictures)
    assert not guess.is_calibrated
    assert guess.source.endswith("self-calibration failed: matching features failed: disk I/O error")
    assert guess.focal_std == lens_guess.DEFAULT_STD


def test_images_are_matched_once_and_verified_with_each_lens(pictures: Path, tmp_path: Path) -> None:
    images = mapping.read_folder(pictures.parent, Rig(RIG.cameras[:1]))
    database, options = tmp_path / "database.db", SparseOptions(features=300, window=2, similar=0)
    signatures, _ = colmap.extract(database, images, options, silent)

    def verified() -> tuple[list[int], list[int]]:
        colmap.match(database, images, signatures, options, silent)
        with pycolmap.Database.open(database) as opened:
            counts = opened.read_two_view_geometry_num_inliers()[1], opened.read_num_matches()[1]
            opened.clear_two_view_geometries()
        return counts

    first = verified()
    assert sum(first[0]) > 100
    assert verified() == first
