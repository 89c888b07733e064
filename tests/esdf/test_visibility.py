"""Visibility: the finest resolved thickness grows with distance and is infinite where occluded."""

import numpy as np
import pytest

from esdf import Grid, rasterize, solids
from esdf.visibility import View, load_visibility, look, save_visibility
from flight import FormatError, InputError

GRID = Grid((0, 0, 0), 0.1, (80, 40, 24))
WALL = solids.Box((4.0, 0.0, 0.0), (4.3, 2.5, 2.4))
EYE = View((0.5, 1.0, 1.2), (1.0, 0.0, 0.0), 1.2, 1 / 250)


def test_the_finest_resolved_thickness_grows_with_distance_and_is_infinite_where_occluded():
    seen = look(rasterize(WALL, GRID), GRID, [EYE])
    near, far, hidden, behind = [1.5, 1.0, 1.2], [3.5, 1.0, 1.2], [6.0, 1.0, 1.2], [0.1, 1.0, 1.2]
    finest = seen.finest([near, far, hidden, behind, [50, 0, 0]])
    assert finest[0] == pytest.approx(2 / 250 * 1.0, rel=0.5)
    assert finest[0] < finest[1] < 0.04
    assert np.isinf(finest[2:]).all()
    assert seen.could_hide([near, far, hidden], 0.012).tolist() == [False, True, True]


def test_more_views_never_hide_more():
    state = rasterize(WALL, GRID)
    other = View((7.5, 1.0, 1.2), (-1.0, 0.0, 0.0), 1.2, 1 / 250)
    one, two = look(state, GRID, [EYE]), look(state, GRID, [EYE, other])
    assert (two.finest_m <= one.finest_m).all()
    np.testing.assert_array_equal(two.finest_m, np.minimum(one.finest_m, look(state, GRID, [other]).finest_m))


def test_the_mask_survives_the_disk(tmp_path):
    seen = look(rasterize(WALL, GRID), GRID, [EYE])
    save_visibility(tmp_path / "seen.npz", seen)
    back = load_visibility(tmp_path / "seen.npz")
    assert back.grid == seen.grid
    np.testing.assert_array_equal(back.finest_m, seen.finest_m)
    (tmp_path / "seen.npz").write_bytes((tmp_path / "seen.npz").read_bytes()[:100])
    with pytest.raises(FormatError):
        load_visibility(tmp_path / "seen.npz")
    with pytest.raises(InputError):
        load_visibility(tmp_path / "none.npz")
    with pytest.raises(InputError):
        look(rasterize(WALL, GRID), GRID, [])
