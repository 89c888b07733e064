"""A model that predicts and is not physical carries a mark, and the mark is of the fitted values alone."""

from pathlib import Path

import vehicle
from vehicle import purpose

YAW = "inertia_zz_kg_m2"
KNOWN = "c_q / I_zz = 7.03e-06 ± 1.2 % is known"
FITTED = vehicle.example().with_value(YAW, 0.08, std=0.01, source="identified from lap")


def test_a_mark_survives_the_file_and_leaves_the_hash_alone(tmp_path: Path):
    marked = purpose.marked(FITTED, {YAW: KNOWN})
    vehicle.save(tmp_path / "v.toml", marked)
    read = vehicle.load(tmp_path / "v.toml")
    assert purpose.not_for_design(read) == {YAW: KNOWN}
    assert purpose.mark_sentence(read) == f"for prediction, not for design: {YAW} ({KNOWN})"
    assert vehicle.vehicle_hash(read) == vehicle.vehicle_hash(FITTED)


def test_a_mark_ends_with_the_fitted_value_that_it_is_of():
    marked = purpose.marked(FITTED, {YAW: KNOWN})
    assert purpose.not_for_design(marked.with_value(YAW, 4.4e-3)) == {}
    assert purpose.mark_sentence(marked.with_value(YAW, 4.4e-3)) == ""
    assert purpose.not_for_design(marked.with_value("mass_kg", 0.8)) == {YAW: KNOWN}


def test_a_later_fit_without_doubt_takes_the_mark_away():
    marked = purpose.marked(FITTED, {purpose.EVERY: "not converged after 30 iterations"})
    assert "not converged" in purpose.mark_sentence(marked)
    assert purpose.mark_sentence(purpose.marked(marked, {})) == purpose.mark_sentence(FITTED) == ""
