"""Whether a fitted model predicts clearly better than the given one: by the ratio of errors and its interval."""

from dataclasses import replace

import numpy as np
import pytest

from sysid.estimator.predicts import Predicts
from sysid.estimator.validation.better import ratio90
from sysid.estimator.verdict import Use, Verdict

HALVED = Predicts(0.5, 2.0, 1.0, (0.4, 0.6), "held-out flights")
BAD = Verdict(against=("inertia_zz_kg_m2 came out 0.06",), unphysical=("inertia_zz_kg_m2",))


@pytest.mark.parametrize("ratio", [0.3, 1.0, 2.5])
def test_the_interval_holds_the_true_ratio_nine_times_in_ten(ratio: float):
    rng = np.random.default_rng(7)
    held = 0
    for _ in range(400):
        given = rng.chisquare(6, 14)
        fitted = ratio**2 * rng.chisquare(6, 14)
        low, high = ratio90(np.stack([given, fitted], axis=1))
        held += low < ratio < high
    assert 0.85 <= held / 400 <= 0.95


def test_too_few_stretches_tell_nothing():
    assert ratio90(np.array([[4.0, 1.0], [4.0, 1.0]])) == (0.0, np.inf)


def test_a_model_without_error_is_better_and_one_beside_a_perfect_model_is_not():
    exact = np.stack([np.full(6, 4.0), np.zeros(6)], axis=1)
    assert ratio90(exact)[1] < 1e-3
    assert ratio90(exact[:, ::-1])[0] > 1e3


def test_a_fit_that_predicts_is_for_prediction_whatever_forbids_to_design_by_it():
    assert BAD.use is Use.REJECTED
    assert replace(BAD, predicts=HALVED).use is Use.PREDICTION
    assert not replace(BAD, predicts=HALVED).physical
    assert Verdict().beside(replace(BAD, predicts=HALVED)).use is Use.PREDICTION
    assert replace(BAD, predicts=replace(HALVED, ratio90=(0.4, 1.1))).use is Use.REJECTED
    assert replace(Verdict(), predicts=replace(HALVED, ratio90=(0.9, 1.3))).use is Use.USABLE


def test_no_prediction_speaks_for_a_fit_to_logs_that_contradict_themselves():
    assert replace(BAD, predicts=HALVED, misread=True).use is Use.REJECTED
