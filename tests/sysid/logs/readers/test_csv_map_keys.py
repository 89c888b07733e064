"""Column maps: separator, scale, sign and shift of every stream, and what they refuse."""

import numpy as np
import pytest

from flight import FormatError, InputError
from sysid.logs.reading import read_log

HEAD = 'format = "goshawk-csv-map"\nversion = 1\n'
T = np.arange(200) / 100.0


def read(tmp_path, entries: str, *, separator: str = ","):
    rows = np.column_stack([T, np.sin(T), np.cos(T), T])
    lines = [separator.join(f"{v:.12g}" for v in row) for row in rows]
    (tmp_path / "log.csv").write_text("\n".join([separator.join("txyz"), *lines]))
    head = HEAD + (f"separator = '{separator}'\n" if separator != "," else "")
    (tmp_path / "map.toml").write_text(head + "[time]\ncolumn = 't'\n" + entries)
    return read_log(tmp_path / "log.csv", tmp_path / "map.toml")


POSITION = "[quantity.position_world_m]\ncolumns = ['x', 'y', 'z']\n"


def test_scale_and_sign_are_one_number_or_one_for_each_column(tmp_path):
    log = read(tmp_path, POSITION + "scale = [2, 3, 4]\nsign = [1, -1, 1]\noffset = 0.5\n")
    expected = np.column_stack([2 * np.sin(T), -3 * np.cos(T), 4 * T]) + 0.5
    np.testing.assert_allclose(log.vector("position_world_m"), expected, atol=1e-9)
    assert np.allclose(read(tmp_path, POSITION + "sign = -1\n").vector("position_world_m")[:, 2], -T)


@pytest.mark.parametrize("shift_s", [0.05, -0.05])
def test_a_shift_moves_the_stream_s_time_stamps_and_drops_what_is_not_known_at_the_ends(tmp_path, shift_s):
    entries = POSITION + f"shift_s = {shift_s}\n[scalar.battery_v]\ncolumn = 'z'\n"
    log = read(tmp_path, entries)
    at = log.time_s - shift_s
    assert len(log) == 195
    np.testing.assert_allclose(log.vector("position_world_m")[:, 0], np.sin(at), atol=1e-4)
    np.testing.assert_allclose(log.columns["battery_v"], log.time_s, atol=1e-9)  # the other clock is not moved


def test_scalars_take_the_same_keys(tmp_path):
    log = read(tmp_path, "[scalar.battery_v]\ncolumn = 'z'\nscale = 2\nsign = -1\noffset = 1\nunit = 'mV'\n")
    np.testing.assert_allclose(log.columns["battery_v"], 1.0 - 2e-3 * T, atol=1e-12)


def test_other_separators(tmp_path):
    assert len(read(tmp_path, POSITION, separator=";")) == 200


@pytest.mark.parametrize(
    ("line", "words"),
    [
        ("sign = 2", "1 or -1 is expected"),
        ("sign = 'up'", "finite number"),
        ("scale = nan", "finite number"),
        ("scale = [1, 2]", "2 numbers for 3 columns"),
        ("shift_s = [1, 2, 3]", "finite number of seconds"),
        ("shfit_s = 1", "'shfit_s'; known are"),
        ("shift_s = 100", "longer than the log"),
        ("shift = 1", "known are"),
    ],
)
def test_a_key_that_cannot_be_is_refused_with_its_place(tmp_path, line, words):
    with pytest.raises((FormatError, InputError), match=words):
        read(tmp_path, POSITION + line + "\n")


def test_an_unknown_separator_is_refused(tmp_path):
    with pytest.raises(InputError, match="separator"):
        read(tmp_path, POSITION, separator="#")
