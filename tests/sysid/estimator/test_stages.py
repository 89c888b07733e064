"""The paper's three stages, the quick regression, and the report page."""

from pathlib import Path

import pytest

import sysid
from flight import InputError
from sysid.estimator.stages import stage_of
from sysid.report import drawing


def test_three_stages_reach_the_truth_nearly(campaign, truth, wrong_start):
    logs = {stage: [log] for stage, log in zip(("vertical", "horizontal", "rotation"), campaign, strict=True)}
    start = wrong_start
    for name in ("centre_of_mass.x_m", "centre_of_mass.y_m"):
        start = start.with_value(name, truth.value(name))
    found = sysid.identify_in_stages(logs, start)["rotation"].vehicle
    for name, relative in {
        "inertia_xx_kg_m2": 0.05,
        "rotor_drag_thrust.drag_s_m": 0.1,
        "inertia_yy_kg_m2": 0.05,
    }.items():
        assert found.value(name) == pytest.approx(truth.value(name), rel=relative)


def test_each_parameter_has_a_stage():
    assert stage_of("thrust_bem.k1_n_s2") == "vertical"
    assert stage_of("parasitic_drag.drag_z_kg_m") == "vertical"
    assert stage_of("parasitic_drag.drag_xy_kg_m") == "horizontal"
    assert stage_of("rotor_yaw_torque.torque_n_m_s2") == stage_of("inertia_zz_kg_m2") == "rotation"


def test_a_stage_without_flights_is_refused(campaign, truth):
    with pytest.raises(InputError, match="no flight for horizontal, rotation"):
        sysid.identify_in_stages({"vertical": campaign}, truth)


def test_the_regression_comes_near_enough_to_start_from(campaign, truth, wrong_start):
    guess = sysid.regress(campaign, wrong_start)
    for name, relative in {"inertia_xx_kg_m2": 0.25, "inertia_yy_kg_m2": 0.25, "thrust_bem.k1_n_s2": 0.2}.items():
        assert guess.value(name) == pytest.approx(truth.value(name), rel=relative)


def test_the_report_is_one_page_with_its_pictures_inside(campaign, truth, tmp_path):
    result = sysid.identify(campaign[2:], truth)
    comparison = sysid.compare(campaign[2:], {"fit": result.vehicle})
    path = sysid.report.write(
        tmp_path / "fit.html", result, comparison=comparison, logs=[sysid.check_log(campaign[2], truth)]
    )
    page = path.read_text()
    assert page.count("data:image/svg+xml;base64,") == 12  # five of the fit, seven of the comparison
    assert "inertia_xx_kg_m2" in page
    assert "only ratios" in page
    assert "http" not in page.replace("http-equiv", "").split("<body>")[0]


def undrawn(_: object, path: Path) -> Path:
    """Pictures take seconds, and only words are asked for."""
    path.parent.mkdir(exist_ok=True)
    path.write_text("<svg/>")
    return path


def test_the_report_of_stages_says_which_did_not_converge(campaign, truth, tmp_path, monkeypatch):
    monkeypatch.setattr(drawing, "written", undrawn)
    results = {
        stage: sysid.identify(campaign[2:], truth, sysid.Options(max_iterations=steps))
        for stage, steps in (("vertical", 30), ("rotation", 1))
    }
    page = sysid.report.write(tmp_path / "fit.html", results).read_text()
    assert "Stage: vertical" in page
    vertical, rotation = page.split("Stage: rotation")
    assert "not converged" not in vertical.split("Stage: vertical")[1]
    assert "<li>not converged after 1 iterations</li>" in rotation


def test_repeated_trials_are_drawn(campaign, truth, tmp_path):
    results = [sysid.identify([log.slice(start, start + 7.0)], truth) for log in campaign[2:] for start in (0.0, 8.0)]
    path = sysid.plots.repeated(results, ["inertia_xx_kg_m2", "thrust_bem.k1_n_s2"], tmp_path / "trials.svg")
    assert "<svg" in path.read_text()
