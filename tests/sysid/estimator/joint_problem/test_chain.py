"""The compiled chain solver against dense algebra."""

import numpy as np
import pytest

from flight import InputError
from sysid.estimator.joint_problem import chain


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
@pytest.mark.parametrize("nodes", [1, 2, 7, 40])
def test_compiled_solve_equals_a_dense_solve(nodes, size):
    dense, diagonal, coupling = _random_chain(nodes, nodes, size)
    columns = np.random.default_rng(0).standard_normal((nodes, size, 5))
    expected = np.linalg.solve(dense, columns.reshape(size * nodes, 5)).reshape(nodes, size, 5)
    np.testing.assert_allclose(chain.factored(diagonal, coupling).solve(columns), expected, rtol=1e-9, atol=1e-10)


def test_an_undetermined_chain_is_refused():
    _, diagonal, coupling = _random_chain(4, 5)
    with pytest.raises(InputError, match="not determined"):
        chain.factored(0.0 * diagonal, coupling)


def _random_rows(size: int, defects: int, parameters: int, nodes: int = 5) -> chain.Rows:
    rng = np.random.default_rng(2)
    border = rng.standard_normal((nodes - 1, defects, parameters))
    border[:, :3] = 0.0  # as with positions, whose defects no parameter changes
    return chain.Rows(
        defect=rng.standard_normal((nodes - 1, defects)),
        defect_before=rng.standard_normal((nodes - 1, defects, size)),
        defect_after=rng.standard_normal((nodes - 1, defects, size)),
        defect_border=border,
        sensor=rng.standard_normal((nodes, 9)),
        sensor_state=rng.standard_normal((nodes, 9, size)),
        sensor_border=rng.standard_normal((nodes, 9, parameters)),
    )


def _dense(rows: chain.Rows) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Derivatives by states and by border, and residual, of all rows one below the other."""
    nodes, size = len(rows.sensor), rows.sensor_state.shape[2]
    states, d, m = np.zeros((0, nodes * size)), rows.defect.shape[1], rows.sensor.shape[1]
    for k in range(nodes - 1):
        part = np.zeros((d, nodes, size))
        part[:, k], part[:, k + 1] = rows.defect_before[k], rows.defect_after[k]
        states = np.vstack([states, part.reshape(d, -1)])
    for k in range(nodes):
        part = np.zeros((m, nodes, size))
        part[:, k] = rows.sensor_state[k]
        states = np.vstack([states, part.reshape(m, -1)])
    p = rows.sensor_border.shape[2]
    border = np.vstack(
        [
            rows.defect_border.reshape(-1 if p else d * (nodes - 1), p),
            rows.sensor_border.reshape(-1 if p else m * nodes, p),
        ]
    )
    return states, border, np.concatenate([rows.defect.ravel(), rows.sensor.ravel()])


KINDS = [(12, 12, 4), (12, 15, 9), (18, 18, 0), (18, 21, 17)]
"""State size, defect rows, parameters: with and without disturbances and accelerometer."""


@pytest.mark.parametrize(("size", "defects", "parameters"), KINDS)
def test_elimination_equals_dense_least_squares(size, defects, parameters):
    nodes = 20
    rows = _random_rows(size, defects, parameters, nodes)
    states, border, residual = _dense(rows)
    found = chain.eliminate(rows)
    project = np.eye(len(states)) - states @ np.linalg.pinv(states)
    np.testing.assert_allclose(found.information, border.T @ project @ border, rtol=1e-8, atol=1e-8)
    np.testing.assert_allclose(found.gradient, border.T @ project @ residual, rtol=1e-8, atol=1e-8)
    step = np.random.default_rng(3).standard_normal(parameters)
    best = np.linalg.lstsq(states, -residual - border @ step, rcond=None)[0]
    np.testing.assert_allclose(found.states(step).ravel(), best, rtol=1e-7, atol=1e-8)
    followed = np.linalg.lstsq(states, border, rcond=None)[0] if parameters else np.zeros((nodes * size, 0))
    np.testing.assert_allclose(found.sensitivity().reshape(followed.shape), followed, rtol=1e-7, atol=1e-8)


@pytest.mark.parametrize(("size", "defects", "parameters"), KINDS)
def test_leverage_is_the_diagonal_of_the_projection_onto_the_states(size, defects, parameters):
    rows = _random_rows(size, defects, parameters)
    states = _dense(rows)[0]
    expected = np.diag(states @ np.linalg.pinv(states))
    defect, sensor = chain.eliminate(rows).factor.leverage(rows)
    np.testing.assert_allclose(np.concatenate([defect.ravel(), sensor.ravel()]), expected, rtol=1e-8, atol=1e-10)


@pytest.mark.parametrize(("size", "defects", "parameters"), KINDS)
def test_change_of_rows_is_their_derivative_times_the_step(size, defects, parameters):
    rows, rng = _random_rows(size, defects, parameters), np.random.default_rng(4)
    states, border, _ = _dense(rows)
    for columns in (1, 11):
        moved, step = rng.standard_normal((5, size, columns)), rng.standard_normal((parameters, columns))
        defect, sensor = rows.change(moved, step)
        expected = states @ moved.reshape(5 * size, columns) + border @ step
        np.testing.assert_allclose(np.concatenate([defect.ravel(), sensor.ravel()]), expected.ravel(), atol=1e-12)
