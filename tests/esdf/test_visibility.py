"""Visibility: the finest resolved thickness grows with distance and is infinite where occluded."""

import numpy as np
import pytest

from esdf import Grid, rasterize, solids
from esdf.visibility import CouldHide, Stretch, View, load_visibility, look, percent, save_visibility
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


def test_a_probability_is_never_told_in_powers_of_ten_nor_as_certain():
    told = {1.0: "over 99 %", 0.996: "over 99 %", 0.994: "about 99 %", 0.0266: "about 2.7 %", 1e-4: "about 0.01 %"}
    assert {value: percent(value) for value in told} == told
    assert percent(0.0) == percent(1e-9) == "none"


def test_how_likely_and_how_thick_are_said_in_one_line_with_one_stretch_and_thickness_alone_for_a_check():
    stretch = Stretch(0.5, 1.0, 0.999, 0.08, (1.0, 2.0, 3.0), "left/7.png")
    found = CouldHide(0.34, 0.083, 1.5, (1.0, 2.0, 3.0), 0.03, 0.45, 1.0, (stretch,) * 5)
    assert found.describe() == (
        "an obstacle up to 83 mm thick could hide within 0.34 m; more than 30 mm along 45 % of the way. Chance that a "
        "thicker pole, cable or net (not glass) is missing there: over 99 %. Most: over 99 % at 0.5 to 1.0 s, near "
        "(1.00, 2.00, 3.00) m, look at left/7.png; 4 more stretches"
    )
    assert found.describe_thickness() == (
        "an obstacle up to 83 mm thick could hide within 0.34 m at 1.50 s, at (1.00, 2.00, 3.00) m; more than 30 mm "
        "along 45 % of the way"
    )
