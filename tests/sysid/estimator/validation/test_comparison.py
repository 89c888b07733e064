"""Adding the effect that is missing lowers the prediction error on a flight that was not used; drawings are written."""

import json
from dataclasses import replace

import numpy as np
import pytest

import sysid
from flight import FlightLog, InputError
from flight.flight_log import COLUMNS
from sysid.estimator import identification
from sysid.estimator.blocks.noise import Gusts
from sysid.estimator.validation import comparison
from sysid.estimator.validation.protocol import PROTOCOLS


@pytest.fixture(scope="module")
def judged(campaign, truth):
    base = truth.without_effect("rotor_drag_thrust")
    training, held_out = [campaign[0], campaign[2]], campaign[1:2]
    before = sysid.identify(training, base)
    after = sysid.identify(training, base.with_effect("rotor_drag_thrust"))
    return sysid.compare(held_out, {"before": before.vehicle, "after": after.vehicle}), before, after


def test_adding_rotor_drag_lowers_the_error_on_the_held_out_flight(judged):
    comparison, _, _ = judged
    for quantity in ("position", "velocity"):
        for horizon in range(1, 4):
            assert comparison.errors["after"][quantity][horizon] < 0.6 * comparison.errors["before"][quantity][horizon]
    assert comparison.wrench_rms("after")[0] < 0.5 * comparison.wrench_rms("before")[0]


def test_the_truth_predicts_to_within_the_noise(campaign, truth):
    comparison = sysid.compare(campaign[1:2], {"truth": truth})
    # sqrt(3) x 2 mm of pose noise, and a little of start states and rotor noise
    assert comparison.errors["truth"]["position"][0] < 5e-3
    assert comparison.errors["truth"]["position"][2] < 2e-2


def test_progress_only_rises_and_ends_at_one(campaign, truth):
    seen = []
    cut = [campaign[1].slice(0.0, 4.0)]
    sysid.compare(cut, {"a": truth, "b": truth}, progress=lambda stage, fraction: seen.append((stage, fraction)))
    assert {stage for stage, _ in seen} == {"compare"}
    fractions = [fraction for _, fraction in seen]
    assert fractions == sorted(fractions)
    assert fractions[-1] == 1.0
    assert len(fractions) > 4


def test_levels_of_other_flights_are_where_the_states_begin_and_change_no_error(campaign, truth, judged, monkeypatch):
    cut, models, begun = [campaign[1].slice(0.0, 4.0)], {"a": truth, "b": truth}, []
    plain = sysid.compare(cut, models)
    known = replace(judged[2].noise.with_process(2.0 * judged[2].noise.process), gusts_last_s=None)

    def smooth(*given, near=None, **options):
        begun.append(near and near.noise.process)
        return identification.smooth(*given, near=near, **options)

    monkeypatch.setattr(comparison, "smooth", smooth)
    found = sysid.compare(cut, models, noise={"b": known})
    assert begun[-1] is known.process
    assert begun[-2] is not known.process
    for quantity, errors in plain.errors["b"].items():
        assert found.errors["b"][quantity] == pytest.approx(errors, rel=0.01)
    held = known.with_gusts(Gusts(np.ones(6), np.ones(6)))
    assert comparison._at(judged[1].solution, held) is judged[1].solution


def test_errors_grow_with_the_horizon(judged):
    comparison, _, _ = judged
    for errors in comparison.errors.values():
        assert np.all(np.diff(errors["position"]) > 0.0)


def test_figures_are_json(judged):
    comparison, _, _ = judged
    facts = json.loads(json.dumps(comparison.as_dict(), allow_nan=False))
    assert set(facts["models"]) == {"before", "after"}
    assert facts["horizons_s"] == [0.1, 0.2, 0.5, 1.0]
    assert len(facts["models"]["after"]["error_rms"]["position_m"]) == 4


def test_plots_are_written(judged, tmp_path):
    comparison, _, _ = judged
    files = sysid.plots.comparison(comparison, tmp_path, suffix="png")
    assert len(files) == 7
    assert {file.stem for file in files} >= {"residual_wrench", "residual_share", "residual_against", "residual_path"}
    assert all(file.read_bytes().startswith(b"\x89PNG") for file in files)


def test_states_that_did_not_converge_are_said(campaign, truth, judged):
    assert not judged[0].not_converged
    hasty = sysid.compare(campaign[:1], {"truth": truth}, sysid.Options(max_iterations=1))
    assert "the states under truth did not converge in 1 steps" in hasty.not_converged[0]
    assert hasty.not_converged[0] in hasty.as_dict()["remarks"]


def test_forces_and_protocols_say_that_clocks_are_not_settled(campaign, truth):
    models, hasty = {"truth": truth}, sysid.Options(max_iterations=1)
    wrench = sysid.wrench_errors(campaign[:1], models, hasty)
    assert "the states under truth did not converge in 1 steps" in wrench.not_converged[0]
    assert wrench.as_dict()["not_converged"] == list(wrench.not_converged)
    assert wrench.not_converged[0] in sysid.judge(campaign[:1], models, PROTOCOLS["h10"], hasty).findings
    assert not sysid.wrench_errors(campaign[:1], models).not_converged


def test_commands_without_rotor_speed_and_gyro_are_compared_too(campaign, truth):
    """Nothing is unknown but the states: a lag that is missing leaves no delay to estimate."""
    commands = FlightLog(
        {name: values for name, values in campaign[0].columns.items() if name not in COLUMNS["rotor_speed_rad_s"]},
        campaign[0].metadata,
    )
    found = sysid.compare([commands], {"no lag": truth.without_effect("motor_lag")})
    assert np.isfinite(found.wrench_rms("no lag")).all()


def test_comparing_nothing_is_refused(campaign):
    with pytest.raises(InputError, match="at least one"):
        sysid.compare(campaign, {})
