"""Disturbances that last are found, and neither bias the estimates nor make their errors look small."""

from dataclasses import replace

import numpy as np
import pytest

import sysid
from flight import FlightLog
from sysid.estimator.blocks import gust as gust_block
from sysid.estimator.blocks.noise import Gusts

GUSTY = {"gust": 0.3, "gust_torque": 1.0}
"""m/s2 and rad/s2, half a second long: a breeze of about 1 m/s."""


def _fly(flying, seed: int, campaigns: int = 1, duration_s: float = 12.0, **truth: float) -> list[FlightLog]:
    rng = np.random.default_rng(seed)
    reference = flying.paper_flights(rng, campaigns, 0.2)
    return flying.fly(
        replace(flying.Truth(), **truth), reference, 3 * campaigns, duration_s=duration_s, rng=rng, rate_hz=100.0
    )


def test_the_rows_of_a_simulated_gust_are_white_and_of_unit_size():
    rng = np.random.default_rng(0)
    of = Gusts(np.array([0.3, 0.4, 0.5, 1.0, 2.0, 3.0]), np.array([0.2, 0.5, 1.0, 0.2, 0.5, 1.0]))
    step_s = rng.uniform(0.005, 0.02, (40000, 1))
    gust = np.zeros((40001, 6))
    for k, keeps in enumerate(of.keeps(step_s)):
        gust[k + 1] = keeps * gust[k] + of.size * np.sqrt(1.0 - keeps**2) * rng.standard_normal(6)
    rows = gust_block.rows(of, step_s, gust)
    np.testing.assert_allclose(rows.std(axis=0), 1.0, atol=0.015)  # four standard errors of 40,000 samples
    np.testing.assert_allclose((rows[1:] * rows[:-1]).mean(axis=0), 0.0, atol=0.02)
    np.testing.assert_allclose(gust.std(axis=0), of.size, rtol=0.25)


def test_derivatives_of_the_rows_match_differences():
    rng = np.random.default_rng(1)
    of = Gusts(rng.uniform(0.1, 2.0, 6), rng.uniform(0.1, 2.0, 6))
    step_s, gust = rng.uniform(0.005, 0.02, (3, 1)), rng.standard_normal((4, 6))
    before, after = gust_block.jacobians(of, step_s)
    for column in range(6):
        for node, jacobian in ((0, before[0]), (1, after[0])):
            moved = gust.copy()
            moved[node, column] += 1.0
            change = gust_block.rows(of, step_s, moved)[0] - gust_block.rows(of, step_s, gust)[0]
            np.testing.assert_allclose(jacobian[:, 12 + column], change, rtol=1e-9, atol=1e-9)
    assert not before[:, :, :12].any()
    assert not after[:, :, :12].any()


def test_calm_flights_are_fitted_with_white_noise(flying, truth):
    assert sysid.identify(_fly(flying, 3), truth).noise.gusts is None


def test_size_and_duration_of_gusts_are_estimated(flying, truth):
    result = sysid.identify(_fly(flying, 3, duration_s=20.0, **GUSTY), truth)
    found = result.noise.gusts
    assert found is not None
    # three flights hold some 120 independent gusts, less what looks like drag and thrust
    np.testing.assert_allclose(found.size, [0.3] * 3 + [1.0] * 3, rtol=0.25)
    assert ((found.lasts_s > 0.25) & (found.lasts_s < 1.2)).all()
    assert any("stay unexplained for about" in sentence for sentence in result.findings)
    assert result.as_dict()["noise"]["gusts"]["force_m_s2"] == found.size[:3].tolist()


@pytest.mark.slow
def test_errors_of_gusty_flights_are_of_the_size_of_the_standard_errors(flying, truth):
    campaigns = 6
    logs = _fly(flying, 5, campaigns, **GUSTY)
    square = {"estimate": [], "white": []}
    for i in range(campaigns):
        for noise, squares in square.items():
            options = sysid.Options(gusts=noise)
            result = sysid.identify(logs[3 * i : 3 * i + 3], truth, options)
            squares += [((e.value - truth.value(e.name)) / e.std) ** 2 for e in result.parameters if e.status == "free"]
    # some 100 scores, about half of them independent: the mean square of right ones stays below 1.6
    assert np.mean(square["estimate"]) < 1.6
    assert np.mean(square["white"]) > 2.5, "gusts taken for white noise make plain errors look small"
