"""Every standard column of a flight log has words and a unit."""

import pytest

from flight.flight_log import COLUMNS
from goshawk.terminal import words

UNITS = {"_m": "m", "_m_s": "m/s", "_rad_s": "rad/s", "_m_s2": "m/s2", "_n": "N", "_n_m": "N m"}


@pytest.mark.parametrize(("quantity", "column"), [(q, c) for q, columns in COLUMNS.items() for c in columns])
def test_a_standard_column_has_words_and_the_unit_of_its_name(quantity, column):
    said, unit = words.named(column)
    assert said.endswith(words.component(column))
    assert "_" not in said
    ends = [end for end in UNITS if column.endswith(end)]
    assert unit == (UNITS[max(ends, key=len)] if ends else "")
