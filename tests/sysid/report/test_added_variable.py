"""Added-variable plots: what is drawn is what the fit goes by, with the other parameters taken out."""

import numpy as np
import pytest

import vehicle
from sysid import Options, identify
from sysid.diagnosis.examined import Model, examine
from sysid.report.added_variable import _freed, added_variable
from tests.sysid import flying

DAMPING = 0.0015


def damping(velocity: np.ndarray, rate: np.ndarray, speed: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    return 0.0 * velocity, -DAMPING * rate


@pytest.fixture(scope="module")
def lacking() -> Model:
    """A model without the damping that its flights have."""
    rng = np.random.default_rng(3)
    logs = flying.fly(
        flying.Truth(gust=0.05, extra=damping), flying.paper_flights(rng), 3, duration_s=8.0, rng=rng, rate_hz=100.0
    )
    return examine(identify(logs, vehicle.example("rigter2019"), Options(node_rate_hz=100.0, gusts="white")))


def test_the_slope_of_an_added_variable_plot_is_the_size(lacking):
    shown = added_variable(lacking, lacking.candidate_set.candidate("angular_damping"))
    assert shown.channel[0] == "M"
    slope = float(shown.trace_alone @ shown.residual_alone) / float(shown.trace_alone @ shown.trace_alone)
    assert slope == pytest.approx(1.0, abs=0.2)
    assert np.corrcoef(shown.trace_alone, shown.residual_alone)[0, 1] > 0.7


def test_what_other_parameters_mimic_is_not_shown(lacking):
    shown = added_variable(lacking, lacking.candidate_set.candidate("angular_damping"))
    assert np.linalg.norm(shown.trace_alone) <= np.linalg.norm(shown.trace)
    assert len(shown.partial_residual) == len(shown.trace)


def test_freed_values_are_at_right_angles_to_every_column():
    rng = np.random.default_rng(0)
    columns, values = rng.standard_normal((40, 6, 3)), rng.standard_normal((40, 6))
    columns[:, :, 2] = columns[:, :, 0]  # collinear columns are one
    freed = _freed(values, columns)
    np.testing.assert_allclose(np.einsum("mc,mcp->p", freed, columns), 0.0, atol=1e-9)
    mimicked = np.einsum("mcp,p->mc", columns, [1.0, -2.0, 0.5])
    np.testing.assert_allclose(_freed(mimicked, columns), 0.0, atol=1e-9)
    assert _freed(values, columns[:, :, :0]) is values
