"""A CSV file that `goshawk log export` wrote comes back as the log that it was."""

from pathlib import Path

import numpy as np
import pytest

import sysid
from flight.flight_log import COLUMNS, FlightLog, from_vectors
from goshawk.commands.learn.log_exports import write_csv
from sysid.logs.reading import DRAFTED


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
