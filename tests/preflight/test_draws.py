"""Draws: the model's whole covariance within physical limits, and the same luck for every plan."""

import hashlib
from dataclasses import replace

import numpy as np
import pytest

import preflight
from flight import InputError
from preflight import core, draws, remedies
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


def test_a_later_fit_of_a_few_leaves_the_others_independent_and_says_so(form):
    """Of three identified errors the correlation of two is told."""
    value = form.value("mass_kg")
    third = uncertain(form, 0.5).with_value("mass_kg", value, std=0.01 * value, source="identified from a test")
    said = drawn(third)[1].assumed[0]
    assert "1 of 3" in said
    assert "mass_kg" in said


def lagging(form, source):
    for name, value in zip(draws.LAGS, (0.03, 0.04), strict=True):
        form = form.with_value(name, value, std=value / 3.0, source=source)
    return form


def test_lags_that_no_flight_told_are_one_ignorance(form):
    for source, correlation in (("assumed, typical", 1.0), ("identified from a test", 0.0)):
        names, found = drawn(lagging(form, source))
        rise, fall = (found.values[:, names.index(name)] for name in draws.LAGS)
        assert np.corrcoef(rise, fall)[0, 1] == pytest.approx(correlation, abs=0.04)
        assert rise.std() / rise.mean() == pytest.approx(1.0 / 3.0, rel=0.05)
        assert (" with ".join(draws.LAGS) in found.factors) == (correlation == 1.0)


def test_what_was_assumed_is_named_also_beside_what_was_fitted(form):
    said = drawn(lagging(uncertain(form, 0.5), "assumed, typical"), count=10)[1].assumed
    assert len(said) == 1
    assert "motor_lag.rise_s ±33 %, motor_lag.fall_s ±33 %" in said[0]
    assert "thrust_bem" not in said[0]
    unknown = form.with_value("thrust_bem.k1_n_s2", form.value("thrust_bem.k1_n_s2"), std=1e-7)
    lost = unknown.with_value("weak_rotor.loss_1", 0.0, std=0.03)
    assert "weak_rotor.loss_1 ±0.03, thrust_bem.k1_n_s2 ±3.2 %" in drawn(lost, count=10)[1].assumed[-1]


def test_an_identified_loss_of_a_rotor_is_drawn_with_its_own_error(form):
    weak = form.with_value("weak_rotor.loss_1", 0.05, std=0.03, source="identified from a test")
    names, found = drawn(weak)
    losses = found.values[:, [names.index(f"weak_rotor.loss_{i}") for i in (0, 1)]]
    assert losses.mean(axis=0) == pytest.approx([0.0, 0.05], abs=2e-3)
    assert losses.std(axis=0) == pytest.approx([0.01, np.hypot(0.03, 0.01)], rel=0.05)
    assert "weak_rotor.loss_1" in found.factors


def test_the_models_delay_is_flown_unless_another_error_of_it_is_given(form):
    late = form.with_effect("pose_delay", delay_s=0.03)
    late = late.with_value("pose_delay.delay_s", 0.03, std=0.005)
    column = core.DRAW_COLUMNS.index("pose_delay_s")
    told, given = (drawn(late, u)[1].rows[:, column] for u in (None, preflight.Uncertainty(pose_delay_std_s=0.001)))
    assert told.mean() == pytest.approx(0.04, abs=5e-4)
    assert told.std() == pytest.approx(0.005, rel=0.05)
    assert given.std() == pytest.approx(0.001, rel=0.05)
    assert drawn(form)[1].rows[:, column].std() == pytest.approx(draws.DELAY_STD_S, rel=0.05)


def test_effects_that_are_not_flown_are_named(form):
    more = form.with_effect("imu_errors").with_effect("ground_effect", strength=1.0)
    said = " ".join(drawn(more)[1].assumed)
    assert "without imu_errors:" in said
    assert "flown without" not in " ".join(drawn(form)[1].assumed)


def test_a_battery_is_drawn_between_its_lowest_and_full(form):
    more = form.with_effect("battery_sag", sag_per_v=0.04, reference_v=16.8)
    _, found = drawn(more, preflight.Uncertainty(battery_v=14.8))
    volts = found.rows[:, core.DRAW_COLUMNS.index("battery_v")]
    assert np.quantile(volts, (0.0, 0.5, 1.0)) == pytest.approx([14.8, 15.8, 16.8], abs=0.05)
    assert draws.BATTERY in found.factors
    assert "full battery" in " ".join(drawn(more)[1].assumed)
    assert "full battery" not in " ".join(found.assumed)


def test_a_battery_that_the_model_does_not_know_or_that_is_more_than_full_is_refused(form):
    with pytest.raises(InputError, match="has no effect battery_sag"):
        drawn(form, preflight.Uncertainty(battery_v=14.8))
    four, one = (form.with_effect("battery_sag", reference_v=volts) for volts in (16.8, 4.2))
    for model, volts, told in (
        (four, 17.0, r"from 13\.2 to 16\.8 V"),
        (four, 13.1, "13"),
        (one, 3.2, r"from 3\.3 to 4\.2"),
    ):
        with pytest.raises(InputError, match=told):
            drawn(model, preflight.Uncertainty(battery_v=volts))


def test_a_battery_of_fewer_cells_falls_as_much_of_its_voltage_and_says_so(form):
    four, one = (
        drawn(form.with_effect("battery_sag", reference_v=volts), preflight.Uncertainty(battery_v=volts))[1]
        for volts in (16.8, 4.2)
    )
    for name in ("battery_fall_v_j", "battery_empty_v"):
        at = core.DRAW_COLUMNS.index(name)
        assert one.rows[0, at] == pytest.approx(four.rows[0, at] / 4.0)
    assert "a battery of 80 kJ at the rotors from 4.2 to 3.3 V" in one.assumed


def test_thermals_are_drawn_up_and_down_and_can_be_taken_away(form):
    _, found = drawn(form, preflight.Uncertainty(thermal_std_m_s=2.0))
    assert found.rows[:, core.DRAW_COLUMNS.index("updraft_m_s")].std() == pytest.approx(2.0, rel=0.05)
    assert draws.THERMALS in found.factors
    _, left = remedies.without(form, preflight.Uncertainty(thermal_std_m_s=2.0), draws.THERMALS)
    assert left == preflight.Uncertainty()
    assert "identify again" not in remedies.words(draws.THERMALS)


def test_a_fault_strikes_each_rotor_as_often_and_at_any_moment(form):
    _, found = drawn(form, preflight.Uncertainty(motor_fault_ratio=0.3, pose_jump_std_m=0.1))
    column = {name: found.rows[:, i] for i, name in enumerate(core.DRAW_COLUMNS)}
    assert np.bincount(column["fault_rotor"].astype(int)) == pytest.approx(1000, rel=0.12)
    for name in ("fault_at", "jump_at"):
        assert np.quantile(column[name], (0.0, 0.5, 1.0)) == pytest.approx([0.0, 0.5, 1.0], abs=0.03)
    assert column["jump_x_m"].std() == pytest.approx(0.1, rel=0.05)
    assert {draws.MOTOR_FAULT, draws.POSE_JUMP} <= set(found.factors)
    assert not {draws.MOTOR_FAULT, draws.POSE_JUMP} & set(drawn(form)[1].factors)


def test_neighbouring_large_seeds_are_other_luck():
    name = next(n for n in "abcdefgh" if int(hashlib.sha256(n.encode()).hexdigest()[14:16], 16) >= 128)
    one, other = (draws._stream(2**53 + i, 3, name, 1) for i in (0, 1))
    assert not np.array_equal(one, other)


def test_a_map_of_unknown_scale_has_no_negative_one(form):
    _, found = drawn(form, preflight.Uncertainty(map_scale_std_ratio=0.5))
    assert found.map_scale.min() > 0.0
    assert np.log(found.map_scale).std() == pytest.approx(0.5, rel=0.05)


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


@pytest.mark.parametrize(
    "given",
    [
        {"motor_fault_ratio": 1.2},
        {"pose_delay_s": 0.3},
        {"wind_direction": (0.0, 0.0, 0.0)},
        {"wind_direction": (1.0, np.nan, 0.0)},
    ],
)
def test_a_pose_too_old_and_a_wind_to_nowhere_are_refused(given):
    with pytest.raises(InputError, match=next(iter(given))):
        preflight.Uncertainty(**given)


def test_a_hover_in_wind_tilts_against_it_until_the_rotors_end(drone):
    calm, breeze, storm = (draws.hover_in_wind(drone, wind) for wind in (0.0, 5.0, 60.0))
    assert calm[0] == pytest.approx(0.0, abs=1e-2)
    assert breeze[0] > calm[0] + 0.05
    assert not storm[1] > 0.0
