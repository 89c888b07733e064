"""Repeated texture is measured in the images, and COLMAP's own errors never reach the user."""

import numpy as np
import pytest

from flight import MapError
from goshawk.rendered import scene as rendered_room
from goshawk.rendered import world as rendered_world
from goshawk.rendered.scene import RenderedScene
from mapping.sparse.features import features, repetition
from mapping.sparse.features.features import Features

RIG = rendered_world.default_rig(0.5)


@pytest.mark.parametrize(
    ("scene", "low", "high"),
    [
        (rendered_room.furnished(), 0.0, 0.1),
        (rendered_room.tiled(0.5), 0.3, 1.0),
        (rendered_room.tiled(1.0), 0.25, 1.0),
    ],
)
def test_copies_of_features_are_counted(scene: RenderedScene, low: float, high: float) -> None:
    T_world_body = rendered_world.loop_flight(20).T_world_body[3]
    shares = []
    for camera in RIG:
        image = rendered_world.render(camera, T_world_body, scene=scene, seed=1)
        mask = camera.lit().astype(np.uint8) * 255
        shares.append(repetition.share(features.find(image, mask, 1500)))
    assert low <= min(shares) <= max(shares) <= high


def test_an_image_without_features_repeats_nothing() -> None:
    empty = np.zeros(0)
    assert repetition.share(Features(np.zeros((0, 2)), empty, empty, np.zeros((0, 128), np.uint8))) == 0.0


@pytest.mark.parametrize(
    "error", [IndexError("Rig with ID 1 does not exist"), RuntimeError("Check failed"), MapError("no map")]
)
@pytest.mark.parametrize(("repeated", "named"), [(0.6, True), (0.1, False)])
def test_failures_are_told_in_plain_words(error: Exception, repeated: float, named: bool) -> None:
    with pytest.raises(MapError, match="no map") as raised, repetition.explained(repeated):
        raise error
    assert ("repeated texture" in str(raised.value)) == named
    assert "Rig with ID" not in str(raised.value)
    assert "Check failed" not in str(raised.value)


@pytest.mark.parametrize(
    "error",
    [
        RuntimeError("SQLite error: database or disk is full"),
        MapError("placing images failed: OSError: [Errno 28] No space left on device"),
    ],
)
def test_a_full_disk_is_blamed_on_no_camera_file_and_no_texture(error: Exception) -> None:
    with pytest.raises(MapError, match="make room") as raised, repetition.explained(0.9):
        raise error
    assert "camera file" not in str(raised.value)
    assert "repeated texture" not in str(raised.value)


def test_the_share_does_not_depend_on_how_many_are_compared_at_once() -> None:
    rng = np.random.default_rng(2)
    descriptors = np.repeat(rng.gamma(0.6, 1.0, (600, 128)), 2, axis=0)[:1100]
    pixels = rng.uniform(0.0, 640.0, (1100, 2))
    size = np.ones(1100)
    shuffled = rng.permutation(1100)
    share = repetition.share(Features(pixels, size, size, descriptors))
    assert share == pytest.approx(1.0, abs=0.01)
    assert repetition.share(Features(pixels[shuffled], size, size, descriptors[shuffled])) == share
    halved = np.arange(0, 1100, 2)
    assert repetition.share(Features(pixels[halved], size[:550], size[:550], descriptors[halved])) == 0.0
