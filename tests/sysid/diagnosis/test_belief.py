"""One probability for the sentence: parts multiply, what is left unexplained counts, and all sums to one."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from sysid.diagnosis.belief import belief, curve_is_there, supported

share = st.floats(0.0, 1.0)


@given(st.lists(share, max_size=3), st.none() | share, st.floats(-50.0, 500.0), st.floats(0.5, 1.0))
def test_the_three_probabilities_sum_to_one(names, curve, left, most):
    found = belief(names, curve=curve, left=left, most=most)
    assert found.as_stated + found.something_unknown + found.otherwise == pytest.approx(1.0)
    assert min(found.as_stated, found.something_unknown) >= 0.0
    assert found.otherwise >= -1e-12
    assert found.as_stated <= most


def test_every_part_of_the_sentence_must_be_right():
    assert belief([0.9, 0.8], curve=0.5, left=0.0, most=1.0).as_stated == pytest.approx(0.36)
    assert belief([0.9], curve=None, left=0.0, most=1.0).as_stated == pytest.approx(0.9)
    assert belief([0.9], curve=None, left=0.0, most=0.5).as_stated == 0.5


def test_what_no_name_explains_speaks_for_something_unknown():
    sure, doubtful = (belief([0.95], curve=None, left=left, most=0.97) for left in (3.0, 60.0))
    assert sure.something_unknown < 0.01
    assert doubtful.something_unknown > 0.85
    assert doubtful.as_stated < 0.1


@given(st.floats(0.0, 1e3), st.floats(0.0, 1e3))
def test_more_left_over_is_never_less_suspicious(one, other):
    low, high = sorted((one, other))
    assert curve_is_there(low) <= curve_is_there(high)
    assert supported(low, 2.0) <= supported(high, 2.0)
    assert supported(low, 4.0) <= supported(low, 2.0)


def test_a_name_that_the_judging_flights_hardly_support_is_hardly_believed():
    assert supported(-5.0, 1.0) == pytest.approx(0.0)
    assert supported(6.0, 1.0) == pytest.approx(0.5)
    assert supported(17.0, 1.5) < 0.8
    assert supported(300.0, 1.5) > 0.99


@pytest.mark.parametrize(("names", "left"), [([float("nan")], 0.0), ([0.9], float("nan"))])
def test_what_is_no_number_is_not_believed(names, left):
    found = belief(names, curve=None, left=left, most=0.97)
    assert (found.as_stated, found.otherwise) == (0.0, 1.0)


def test_each_probability_is_said_with_what_it_is_of():
    found = belief([0.5], curve=None, left=0.0, most=0.97)
    assert found.sentence(named=False) == (
        "probability 50% that nothing is missing within the flown envelope, 0% that something unknown is missing, "
        "50% that a known effect is missing"
    )
    said = found.sentence(named=True)
    assert said.startswith("probability 50% that this is right and nothing else is missing within the flown envelope, ")
