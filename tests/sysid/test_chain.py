"""The compiled chain solver against plain LAPACK and against dense algebra."""

import numpy as np
import pytest

from flight import InputError
from sysid import chain


def _random_chain(nodes: int, seed: int, size: int = 12) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    rng = np.random.default_rng(seed)
    dense = np.zeros((size * nodes, size * nodes))
    for k in range(nodes):
        rows = rng.standard_normal((size, 2 * size if k + 1 < nodes else size))
        place = slice(size * k, size * k + rows.shape[1])
        dense[place, place] += rows.T @ rows
        dense[size * k : size * k + size, size * k : size * k + size] += np.eye(size)
    blocks = dense.reshape(nodes, size, nodes, size)
    diagonal = np.stack([blocks[k, :, k] for k in range(nodes)])
    coupling = np.stack([blocks[k + 1, :, k] for k in range(nodes - 1)]) if nodes > 1 else np.zeros((0, size, size))
    return dense, diagonal, coupling


@pytest.mark.parametrize("size", [12, 18])
@pytest.mark.parametrize("nodes", [1, 2, 7])
def test_compiled_solve_equals_lapack_and_dense_solve(nodes, size):
    dense, diagonal, coupling = _random_chain(nodes, nodes, size)
    columns = np.random.default_rng(0).standard_normal((nodes, size, 5))
    expected = np.linalg.solve(dense, columns.reshape(size * nodes, 5)).reshape(nodes, size, 5)
    np.testing.assert_allclose(chain.Factor(diagonal, coupling).solve(columns), expected, rtol=1e-9, atol=1e-10)
    np.testing.assert_allclose(chain.solve_numpy(diagonal, coupling, columns), expected, rtol=1e-9, atol=1e-10)


@pytest.mark.parametrize("size", [12, 18])
def test_covariance_blocks_are_those_of_the_dense_inverse(size):
    dense, diagonal, coupling = _random_chain(6, 3, size)
    inverse = np.linalg.inv(dense).reshape(6, size, 6, size)
    own, next_ = chain.Factor(diagonal, coupling).covariance()
    for k in range(6):
        np.testing.assert_allclose(own[k], inverse[k, :, k], rtol=1e-8, atol=1e-10)
    for k in range(5):
        np.testing.assert_allclose(next_[k], inverse[k, :, k + 1], rtol=1e-8, atol=1e-10)


def test_an_undetermined_chain_is_refused():
    _, diagonal, coupling = _random_chain(4, 5)
    with pytest.raises(InputError, match="not determined"):
        chain.Factor(0.0 * diagonal, coupling)


def test_leverage_adds_up_to_the_number_of_unknowns():
    rng = np.random.default_rng(2)
    rows = chain.Rows(
        defect=np.zeros((4, 12)),
        defect_before=rng.standard_normal((4, 12, 12)),
        defect_after=rng.standard_normal((4, 12, 12)),
        defect_border=np.zeros((4, 12, 0)),
        sensor=np.zeros((5, 9)),
        sensor_state=rng.standard_normal((5, 9, 12)),
        sensor_border=np.zeros((5, 9, 0)),
    )
    normal = chain.normal_equations(rows)
    defect, sensor = chain.leverage(rows, chain.Factor(normal.diagonal, normal.coupling).covariance())
    # the projection onto the states' columns has a trace of 5 nodes x 12
    assert defect.sum() + sensor.sum() == pytest.approx(60.0, rel=1e-8)
