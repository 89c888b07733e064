"""Of an inertia that no vehicle has, its ratio to the coefficient that turns about its axis may be known."""

import numpy as np
import pytest

from sysid.estimator.known_ratio import doubtful
from sysid.estimator.verdict import THRUST, Verdict
from vehicle.purpose import EVERY

NAMES = ("inertia_zz_kg_m2", "rotor_yaw_torque.torque_n_m_s2", "thrust_quadratic.k_n_s2")
VALUES = {NAMES[0]: (0.02, 0.004), NAMES[1]: (2e-7, 4e-8), NAMES[2]: (3e-6, 1e-8)}
REJECTED = Verdict(against=("inertia_zz_kg_m2 came out 0.02",), unphysical=(NAMES[0],))


def correlated(r: float) -> np.ndarray:
    return np.array([[1.0, r, 0.0], [r, 1.0, 0.0], [0.0, 0.0, 1.0]])


@pytest.mark.parametrize(("correlation", "known"), [(0.9999, True), (0.0, False), (-0.9, False)])
def test_the_ratio_is_known_where_numerator_and_denominator_err_together(correlation: float, known: bool):
    found = doubtful(REJECTED, NAMES, VALUES, correlated(correlation))
    assert list(found) == [NAMES[0]]
    assert found[NAMES[0]].startswith("c_q / I_zz = 1e-05 ±") == known


def test_what_forbids_a_fit_for_no_single_parameter_marks_all_of_them():
    assert doubtful(Verdict(), NAMES, VALUES, correlated(0.0)) == {}
    assert doubtful(Verdict(doubts=("odd",)), NAMES, VALUES, correlated(0.0)) == {}
    left = Verdict(against=("the model leaves 8.9 m/s2 unexplained",))
    assert doubtful(left, NAMES, VALUES, correlated(0.0)) == {EVERY: left.against[0]}


def test_an_absurd_thrust_marks_the_parameters_of_the_thrust_curve():
    found = doubtful(Verdict(against=("thrust",), unphysical=(THRUST,)), NAMES, VALUES, correlated(0.0))
    assert found == {NAMES[2]: "thrust / mass"}


def test_a_parameter_that_was_held_is_not_the_fits_to_mark():
    assert list(doubtful(REJECTED, NAMES[1:], VALUES, correlated(0.0)[1:, 1:])) == [EVERY]
