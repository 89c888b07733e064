"""Draws: the model's whole covariance within physical limits, and the same luck for every plan."""

from dataclasses import replace

import numpy as np
import pytest

import preflight
from flight import InputError
from preflight import core, draws
from vehicle import specs

NAMES = ("thrust_bem.k1_n_s2", "parasitic_drag.drag_xy_kg_m")


def uncertain(drone, correlation: float):
    for name in NAMES:
        value = drone.value(name)
        drone = drone.with_value(name, value, std=0.05 * value, source="identified from a test")
    told = {"names": list(NAMES), "matrix": [[1.0, correlation], [correlation, 1.0]]}
    return replace(drone, provenance={**drone.provenance, draws.CORRELATION: told})


def drawn(vehicle, uncertainty=None, count=4000, seed=0):
    names = core.native.compiled(vehicle).names
    return names, draws.draw(vehicle, names, uncertainty or preflight.Uncertainty(), count, seed)


@pytest.mark.parametrize("correlation", [-0.7, 0.0, 0.6])
def test_parameters_are_drawn_with_the_covariance_that_the_model_tells(form, correlation):
    names, found = drawn(uncertain(form, correlation))
    chosen = found.values[:, [names.index(name) for name in NAMES]]
    assert np.corrcoef(chosen.T)[0, 1] == pytest.approx(correlation, abs=0.04)
    assert chosen.std(axis=0) / chosen.mean(axis=0) == pytest.approx(0.05, rel=0.05)
    assert found.assumed == ()


def test_parameters_that_are_told_together_only_are_one_factor(form):
    _, found = drawn(uncertain(form, 0.95))
    assert " with ".join(sorted(NAMES, reverse=True)) in found.factors or " with ".join(NAMES) in found.factors


def test_a_model_without_covariance_says_what_is_assumed(form):
    _, found = drawn(form)
    assert "states no uncertainty" in found.assumed[0]
    alone = form.with_value(NAMES[0], form.value(NAMES[0]), std=1e-7)
    assert "drawn independently" in drawn(alone)[1].assumed[0]


@pytest.mark.parametrize(
    "damaged",
    ["text", {"names": 3}, {"names": list(NAMES), "matrix": [[1.0], [1.0, 2.0]]}, {"names": list(NAMES), "matrix": "x"},
     {"names": list(NAMES), "matrix": [[1.0, 7.0], [7.0, 1.0]]}],
)  # fmt: skip
def test_a_damaged_correlation_counts_as_none(form, damaged):
    broken = replace(uncertain(form, 0.5), provenance={draws.CORRELATION: damaged})
    assert "drawn independently" in drawn(broken, count=10)[1].assumed[0]


def test_wild_errors_stay_within_physical_limits(form):
    wild = form
    for name in ("mass_kg", "inertia_xx_kg_m2", "inertia_zz_kg_m2", NAMES[1]):
        wild = wild.with_value(name, form.value(name), std=2.0 * form.value(name))
    names, found = drawn(wild)
    for name, spec in specs(wild).items():
        if name in names:
            column = found.values[:, names.index(name)]
            assert (column >= spec.bounds[0]).all()
            assert (column <= spec.bounds[1]).all()
    xx, yy, zz = (found.values[:, names.index(f"inertia_{a}_kg_m2")] for a in ("xx", "yy", "zz"))
    assert (zz <= xx + yy + 1e-15).all()
    assert (xx <= yy + zz + 1e-15).all()


def test_more_flights_and_another_uncertainty_leave_a_flights_luck_alone(form):
    few, many = drawn(form, count=10)[1], drawn(form, count=100)[1]
    assert np.array_equal(few.rows, many.rows[:10])
    windy = drawn(uncertain(form, 0.5), replace(preflight.Uncertainty(), wind_m_s=4.0), count=10)[1]
    bias = [core.DRAW_COLUMNS.index(f"bias_{axis}_m") for axis in "xyz"]
    assert np.array_equal(windy.rows[:, bias], few.rows[:, bias])
    assert not np.array_equal(drawn(form, count=10, seed=1)[1].rows[:, bias], few.rows[:, bias])


def test_a_wind_from_anywhere_is_horizontal_and_of_its_size(form):
    _, found = drawn(form, replace(preflight.Uncertainty(), wind_m_s=4.0))
    wind = found.rows[:, :3]
    assert not wind[:, 2].any()
    size = np.linalg.norm(wind, axis=1)
    assert size.mean() == pytest.approx(4.0, rel=0.02)
    assert size.std() == pytest.approx(0.8, rel=0.05)
    assert np.abs(wind.mean(axis=0)).max() < 0.2


def test_an_uncertainty_below_zero_is_refused():
    with pytest.raises(InputError, match="gust_std_m_s"):
        preflight.Uncertainty(gust_std_m_s=-1.0)


def test_a_hover_in_wind_tilts_against_it_until_the_rotors_end(drone):
    calm, breeze, storm = (draws.hover_in_wind(drone, wind) for wind in (0.0, 5.0, 60.0))
    assert calm[0] == pytest.approx(0.0, abs=1e-2)
    assert breeze[0] > calm[0] + 0.05
    assert not storm[1] > 0.0
