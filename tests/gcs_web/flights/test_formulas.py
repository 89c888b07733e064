"""Streams that people write: formulas of a log's columns, and what is refused in them."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from flight import FlightLog, InputError, flight_log, project
from gcs_web.flights import formulas
from gcs_web.flights.recorded import Recorded

THERE = ("time_s", "a_m", "b_m")


def value(text: str, a: float = 3.0, b: float = 4.0) -> float:
    (curve,) = formulas.quantity(formulas.PREFIX + text, THERE).curves
    columns = {"a_m": np.array([a]), "b_m": np.array([b])}
    return float(curve.values({name: columns[name] for name in curve.needs})[0])


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("hypot(a_m, b_m)", 5.0),
        ("-a_m + 2*b_m", 5.0),
        ("sqrt(a_m**2 + b_m**2) - 5", 0.0),
        ("deg(atan2(a_m, a_m))", 45.0),
        ("max(a_m, min(b_m, 3.5))", 3.5),
        ("a_m * pi", 3.0 * math.pi),
        ("a_m / b_m / 2", 0.375),
    ],
)
def test_a_formula_is_what_it_says(text, expected):
    assert value(text) == pytest.approx(expected)


@given(st.floats(-1e3, 1e3), st.floats(-1e3, 1e3))
def test_it_agrees_with_python_and_has_no_value_where_there_is_none(a, b):
    assert value("(a_m - b_m) * (a_m + b_m)", a, b) == pytest.approx((a - b) * (a + b), abs=1e-9)
    found = value("sqrt(a_m)", a, b)
    assert found == pytest.approx(math.sqrt(a)) if a >= 0 else math.isnan(found)
    assert math.isnan(value("a_m / (b_m - b_m)", a, b))


@pytest.mark.parametrize(
    "text",
    [
        "__import__('os').system('true')", "a_m.__class__", "a_m[0]", "(lambda: a_m)()", "open('x')", "c_m", "3 + 4",
        "a_m if b_m else 0", "[a_m]", "'a'", "a_m < b_m", "a_m and b_m", "sqrt(a_m, b_m)", "sqrt(x=a_m)", "a_m +",
        "", "True * a_m", "1j * a_m", "a_m @ b_m", "f'{a_m}'", "a_m := 3", "a_m" + "+a_m" * 100, "(" * 150 + "a_m",
        "-" * 190 + "a_m",
    ],
)  # fmt: skip
def test_what_is_no_formula_is_refused_with_the_way_out(text):
    with pytest.raises(InputError, match=r"may stand in it|shorter|takes 1 argument|the functions are"):
        formulas.quantity(formulas.PREFIX + text, THERE)


def test_a_formula_is_read_like_a_stream_and_only_where_its_columns_are(tmp_path):
    opened = project.create(tmp_path / "p", "p")
    time_s = np.arange(200) / 100.0
    log = FlightLog({"time_s": time_s, "battery_v": 12.0 - time_s}, {})
    opened.flight("one").parent.mkdir(parents=True, exist_ok=True)
    flight_log.save(opened.flight("one"), log)
    recorded, key = Recorded(opened), f"{formulas.PREFIX}12 - battery_v"
    assert key in {stream.key for stream in recorded.open("one", [key]).streams}
    (part,) = recorded.read("one", [key], 0.0, 1.0, 4000)
    np.testing.assert_allclose(part.curves[0].values, part.time_s, atol=1e-5)
    without = recorded.open("one", [f"{formulas.PREFIX}rotor_speed_0_rad_s", key])
    assert key in {stream.key for stream in without.streams}
    (why,) = without.left_out
    assert "no column of this log" in why
