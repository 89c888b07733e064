"""Tables on a terminal of 80 columns: no name is broken, whatever stands beside it."""

import contextlib
import io
import re

import pytest
from hypothesis import given
from hypothesis import strategies as st

from goshawk.terminal import console

NAME = st.text("abcdefghij_.[]0123456789", min_size=1, max_size=40)
CELL = st.lists(NAME, max_size=4).map(" ".join) | st.integers(-9, 9) | st.floats(-1e6, 1e6)


def drawn(heads: list[str], rows: list[tuple[object, ...]]) -> str:
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("COLUMNS", "80")
        patch.setenv("FORCE_COLOR", "1")
        with contextlib.redirect_stdout(io.StringIO()) as said:
            console.table("title", heads, rows)
        return re.sub(r"\x1b\[[0-9;]*m", "", said.getvalue())


@given(st.integers(1, 8).flatmap(lambda n: st.lists(st.tuples(NAME, *[CELL] * n), min_size=1, max_size=4)))
def test_every_word_of_a_table_stands_whole_at_80_columns(rows):
    heads = [f"head_{i}" for i in range(len(rows[0]))]
    said = drawn(heads, rows).split()
    for row in rows:
        for cell in row:
            assert set((f"{cell:.4g}" if isinstance(cell, float) else str(cell)).split()) <= set(said)


def test_a_table_that_fits_has_its_heads_once_and_a_wide_one_says_them_in_every_paragraph():
    narrow = drawn(["effect", "size"], [("rotor_drag_thrust", "0.0175"), ("payload", "0.1")])
    assert narrow.count("size") == 1
    wide = drawn(["effect", *"abcdefg"], [("rotor_acceleration_torque", *["weak_rotor[2]"] * 7)] * 2)
    assert wide.count("    a: weak_rotor[2]") == 2
    assert max(map(len, narrow.splitlines())) <= 80
