"""The map from above, at one height."""

import base64
import io

import numpy as np
import pytest
from PIL import Image

import mapping
from gcs_web.map import section, slices
from gcs_web.protocol.map import Slice


def picture(pillar_map, height_m: float, required_m: float = 0.3):
    found = section.of(mapping.open_map(pillar_map), height_m, required_m)
    return found, np.asarray(Image.open(io.BytesIO(base64.b64decode(found.image))))


def at(found, rgba, x_m: float, y_m: float) -> int:
    """Opacity there."""
    share = (np.array([x_m, y_m]) - found.low_m) / (np.array(found.high_m) - found.low_m)
    row, column = int((1.0 - share[1]) * rgba.shape[0]), int(share[0] * rgba.shape[1])
    return int(rgba[row, column, 3])


def test_a_pillar_is_filled_shaded_around_and_clear_where_there_is_room(pillar_map):
    found, rgba = picture(pillar_map, 1.0)
    assert at(found, rgba, 2.0, 1.5) == 255
    assert 0 < at(found, rgba, 2.4, 1.5) < 255
    assert at(found, rgba, 3.0, 0.9) == 0


def test_more_is_shaded_where_more_clearance_is_asked_for(pillar_map):
    shaded = [np.count_nonzero(picture(pillar_map, 1.0, required_m)[1][..., 3]) for required_m in (0.0, 0.3, 0.6)]
    assert shaded == sorted(set(shaded))


@pytest.mark.parametrize("height_m", [-50.0, 0.6, 50.0])
def test_a_height_outside_the_map_is_cut_at_its_nearest(pillar_map, height_m):
    found, _ = picture(pillar_map, height_m)
    assert -0.2 <= found.at_m <= 2.7
    assert abs(found.at_m - np.clip(height_m, -0.2, 2.7)) <= 0.05


def test_a_large_map_makes_a_small_picture(pillar_map, monkeypatch):
    monkeypatch.setattr(section, "MOST_PIXELS", 40)
    found, rgba = picture(pillar_map, 1.0)
    assert max(rgba.shape[:2]) <= 40
    assert at(found, rgba, 2.0, 1.5) == 255


@pytest.mark.parametrize("of", ["distance", "unknown", "could_hide"])
def test_a_level_slice_is_the_picture_of_the_3d_view_where_it_is_in_the_world(pillar_map, of):
    area, wanted = mapping.open_map(pillar_map), Slice("z", 1.0, of)
    found = section.of_slice(slices.draw(area, area.field, wanted, 0.3), wanted)
    grid = area.field.grid
    np.testing.assert_allclose([found.low_m, found.high_m], [grid.low_world_m[:2], grid.high_world_m[:2]], atol=1e-9)
    rgba = np.asarray(Image.open(io.BytesIO(base64.b64decode(found.image))))
    assert (found.at_m, found.of) == (1.0, of)
    assert at(found, rgba, 2.0, 1.5) != at(found, rgba, 3.0, 0.9)
