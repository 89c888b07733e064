"""A CSV file that `goshawk log export` wrote comes back as the log that it was."""

import re
from pathlib import Path

import numpy as np
import pytest

import sysid
from flight import FormatError
from flight.flight_log import COLUMNS, FlightLog, from_vectors
from goshawk.commands.learn.log_exports import write_csv
from sysid.logs.reading import DRAFTED, read_log


@pytest.fixture
def recorded() -> FlightLog:
    """Every standard vector, a battery that is sampled every third row, a code, and a column of the user's."""
    rng, n = np.random.default_rng(2), 400
    vectors = {name: rng.standard_normal((n, len(columns))) for name, columns in COLUMNS.items()}
    battery = np.where(np.arange(n) % 3 == 0, 15.0 + rng.standard_normal(n), np.nan)
    codes = np.repeat([1.0, 3.0], n // 2)
    own = {"battery_v": battery, "mission_state": codes, "my_column_ratio": rng.standard_normal(n)}
    return from_vectors(7.0 + 0.01 * np.arange(n), vectors, scalars=own)


def test_an_exported_csv_comes_back_bit_for_bit_with_nothing_drafted(recorded: FlightLog, tmp_path: Path):
    write_csv(tmp_path / "flight.csv", recorded)
    again = sysid.read_log(tmp_path / "flight.csv")
    assert set(again.columns) == set(recorded.columns)
    for name, values in recorded.columns.items():
        np.testing.assert_array_equal(again.columns[name], values, err_msg=name)
    assert DRAFTED not in again.metadata


def test_a_csv_with_a_name_of_others_is_drafted(recorded: FlightLog, tmp_path: Path):
    write_csv(tmp_path / "flight.csv", recorded)
    text = (tmp_path / "flight.csv").read_text().replace("battery_v", "vbat", 1)
    (tmp_path / "other.csv").write_text(text)
    assert sysid.read_log(tmp_path / "other.csv").metadata[DRAFTED]


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ('format = "goshawk-vehicle"\nversion = 1\n', "is a goshawk-vehicle file, no flight log; give it by --vehicle"),
        ('# a remark\nformat = "goshawk-csv-map"\nversion = 1\n', "give it by --columns"),
        (
            '{\n "format": "goshawk-trajectory",\n "version": 2\n}\n',
            "is a goshawk-trajectory file, no flight log; give a log",
        ),
    ],
)
def test_a_file_of_ours_that_is_no_log_is_named_with_where_it_belongs(tmp_path, text, said):
    """`goshawk compare FLIGHT --vehicle a.toml b.toml`: the second file is no flight."""
    path = tmp_path / "b.toml"
    path.write_text(text)
    with pytest.raises(FormatError, match=f"^{re.escape(str(path))}.*{re.escape(said)}$"):
        read_log(path)
