"""Portable functions: right to 2 units in the last place, and algebra that solves what it is given."""

from decimal import Decimal, localcontext

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays

from flight import portable

LONG = np.longdouble
"""Of the C library, with 64 bits: eleven more than a double."""
finite = st.floats(-1e5, 1e5)


def off(found: float, exact: np.longdouble) -> float:
    """Error in units in the last place."""
    return float(abs(LONG(found) - exact) / LONG(np.spacing(abs(float(exact)))))


@given(finite)
def test_sine_and_cosine_are_right(x):
    sine, cosine = portable.sine_cosine(x)
    assert off(float(sine), np.sin(LONG(x))) < 2.0
    assert off(float(cosine), np.cos(LONG(x))) < 2.0


def test_sine_is_right_next_to_a_multiple_of_pi_where_all_digits_cancel():
    """The double nearest to n pi, less n pi itself."""
    pi = Decimal("3.14159265358979323846264338327950288419716939937510582097494459")
    for n in (1, 2, 3, 22, 355, 10_000, 123_456):
        with localcontext() as context:
            context.prec = 60
            left = Decimal(float(pi * n)) - pi * n
        assert off(float(portable.sine_cosine(float(pi * n))[0]), LONG(float(left if n % 2 == 0 else -left))) < 2.0


@given(st.floats(-745.0, 709.0))
def test_the_exponential_is_right(x):
    assert off(float(portable.exponential(x)), np.exp(LONG(x))) < 2.0


@given(st.floats(min_value=0.0, exclude_min=True, allow_infinity=False))
def test_the_logarithm_is_right_of_the_smallest_number_and_the_largest(x):
    assert off(float(portable.logarithm(x)), np.log(LONG(x))) < 2.0


@given(finite, finite)
@example(5e-324, 5e-324)
@example(-5e-324, 1e-323)
def test_the_angle_of_a_vector_is_right_in_every_quadrant(y, x):
    assert off(float(portable.arctangent2(y, x)), np.arctan2(LONG(y), LONG(x))) < 2.0


@given(st.floats(-1.0, 1.0))
def test_inverse_sine_and_cosine_are_right(x):
    assert abs(float(portable.arcsine(x)) - float(np.arcsin(LONG(x)))) < 1e-15
    assert abs(float(portable.arccosine(x)) - float(np.arccos(LONG(x)))) < 1e-15


def test_limits_and_impossible_arguments_are_answered_like_numpy_does():
    inf, nan = np.inf, np.nan
    odd = np.array([0.0, -0.0, inf, -inf, nan, -1.0, 1.0])
    with np.errstate(all="ignore"):
        assert np.array_equal(portable.logarithm(odd), np.log(odd), equal_nan=True)
        assert np.allclose(portable.exponential(odd), np.exp(odd), rtol=1e-15, equal_nan=True)
        assert np.allclose(portable.sine_cosine(odd), [np.sin(odd), np.cos(odd)], rtol=1e-15, equal_nan=True)
        y, x = np.meshgrid(odd, odd)
        found, known = portable.arctangent2(y, x), np.arctan2(y, x)
    assert np.allclose(found, known, rtol=1e-15, equal_nan=True)
    assert np.array_equal(np.signbit(found[np.isfinite(found)]), np.signbit(known[np.isfinite(known)]))
    assert portable.sine_cosine(np.zeros((2, 0, 3)))[0].shape == (2, 0, 3)


@given(arrays.arrays(np.float64, (3, 4, 4), elements=st.floats(-1.0, 1.0)))
def test_a_solution_fulfils_its_equations(matrix):
    matrix += 5.0 * np.eye(4)[[1, 0, 3, 2]]  # rows must be exchanged
    right = np.arange(24.0).reshape(3, 4, 2)
    found = portable.solve(matrix, right)
    assert np.allclose(portable.product(matrix, found), right, atol=1e-11)


def test_no_solution_is_invented_for_a_singular_matrix():
    assert np.isnan(portable.solve(np.array([[1.0, 2.0], [2.0, 4.0]]), np.eye(2))).all()
    assert portable.solve_banded(np.array([[1.0, 1.0], [2.0, 0.0]]), np.ones(2)) is None


@pytest.mark.parametrize("size", [1, 2, 7, 30])
def test_a_banded_solution_is_that_of_the_full_matrix(size):
    rng = np.random.default_rng(size)
    width = min(4, size)
    band = rng.uniform(-1.0, 1.0, (width, size))
    band[0] += 2.0 * width
    full = sum(np.diag(band[d, : size - d], -d) for d in range(width))
    full = np.tril(full) + np.tril(full, -1).T
    right = rng.normal(size=size)
    found = portable.solve_banded(band, right)
    assert found is not None
    assert np.allclose(full @ found, right, atol=1e-12)


@given(arrays.arrays(np.float64, st.integers(1, 6).map(lambda n: (n, n)), elements=st.floats(-10.0, 10.0)))
def test_eigenvectors_of_a_symmetric_matrix_are_orthogonal_and_make_it_up(half):
    matrix = half + half.T
    values, vectors = portable.symmetric_eigen(matrix)
    assert np.abs(vectors.T @ vectors - np.eye(len(matrix))).max() < 1e-13
    assert np.abs(vectors * values @ vectors.T - matrix).max() < 1e-12 * max(1.0, float(np.abs(matrix).max()))
    assert np.sort(values) == pytest.approx(np.linalg.eigvalsh(matrix), abs=1e-12 * max(1.0, np.abs(matrix).max()))


@pytest.mark.parametrize("wrong", [np.nan, np.inf, -np.inf])
def test_a_matrix_that_is_not_finite_has_no_eigenvalues(wrong):
    for i, j in ((0, 0), (0, 1)):
        matrix = np.eye(3)
        matrix[i, j] = matrix[j, i] = wrong
        values, vectors = portable.symmetric_eigen(matrix)
        assert np.isnan(values).all()
        assert np.isnan(vectors).all()


def test_rotations_that_do_not_end_give_no_eigenvalues(monkeypatch):
    monkeypatch.setattr(portable, "_MOST_SWEEPS", 1)
    values, vectors = portable.symmetric_eigen(np.corrcoef(np.random.default_rng(1).standard_normal((8, 20))))
    assert np.isnan(values).all()
    assert np.isnan(vectors).all()


def test_the_share_of_normal_numbers_below_is_scipys_to_rounding():
    from scipy.special import ndtr

    x = np.linspace(-12.0, 12.0, 4801)
    assert np.abs(portable.normal_share(x) - ndtr(x)).max() < 2e-15
    assert (np.diff(portable.normal_share(x)) >= -5e-15).all()
