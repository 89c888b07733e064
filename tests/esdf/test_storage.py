"""Fields on disk: round trip, refusal of what is damaged or newer, and nothing lost when writing fails."""

import numpy as np
import pytest

from esdf import Grid, build, load, save
from flight import FormatError, InputError


@pytest.fixture
def small_field():
    rng = np.random.default_rng(0)
    state = rng.choice(3, size=(12, 9, 15), p=[0.1, 0.8, 0.1]).astype(np.uint8)
    return build(state, Grid((1.0, -2.0, 0.5), (0.1, 0.1, 0.2), state.shape), cap_m=0.7, unknown="nan")


def test_a_field_comes_back_as_it_was(tmp_path, small_field):
    save(tmp_path / "map", small_field)
    back = load(tmp_path / "map")
    assert (back.grid, back.cap_m, back.unknown) == (small_field.grid, small_field.cap_m, small_field.unknown)
    np.testing.assert_array_equal(back.state, small_field.state)
    np.testing.assert_array_equal(back.values_m, small_field.values_m)
    assert back.hash == small_field.hash


def test_a_missing_folder_is_named(tmp_path):
    with pytest.raises(InputError, match="does not exist"):
        load(tmp_path / "nothing")


def test_damaged_newer_and_tampered_fields_are_refused(tmp_path, small_field):
    save(tmp_path / "map", small_field)
    about = tmp_path / "map" / "esdf.toml"
    good = about.read_text()
    about.write_text(good.replace("version = 1", "version = 999"))
    with pytest.raises(FormatError, match="update Goshawk"):
        load(tmp_path / "map")
    about.write_text(good.replace("cap_m = 0.7", "cap_m = 0.8"))
    with pytest.raises(FormatError, match="hash"):
        load(tmp_path / "map")
    about.write_text(good[: len(good) // 2])
    with pytest.raises(FormatError):
        load(tmp_path / "map")
