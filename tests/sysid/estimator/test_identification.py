"""Truth is recovered from an independent simulator, errors can be believed, and bad input is refused."""

import json
import tracemalloc
from dataclasses import replace

import numpy as np
import pytest

import sysid
import vehicle as vehicles
from flight import FlightLog, InputError
from flight.flight_log import from_vectors
from sysid.estimator.uncertainty.errors import NORMAL_90, standard_errors


@pytest.fixture(scope="module")
def fitted(campaign, wrong_start):
    return sysid.identify(campaign, wrong_start)


def test_the_fitted_vehicles_file_keeps_how_its_errors_go_together(fitted, tmp_path):
    vehicles.save(tmp_path / "fitted.toml", fitted.vehicle)
    told = vehicles.load(tmp_path / "fitted.toml").provenance["correlation"]
    assert told["names"] == list(fitted.free_names)
    assert np.array(told["matrix"]) == pytest.approx(fitted.correlation, abs=1e-4)
    assert np.abs(fitted.correlation - np.eye(len(fitted.free_names))).max() > 0.1


@pytest.mark.parametrize("scatter", [0.0, 1e3])
def test_only_scatter_among_few_blocks_makes_an_interval_wider_than_a_normal_one(fitted, scatter):
    blocks = [[(information, scatter * pull) for information, pull in flight] for flight in fitted.solution.scores]
    solution = replace(fitted.solution, scores=tuple(map(tuple, blocks)))
    found = standard_errors(fitted.flights, fitted.unknowns, solution, ())
    if scatter == 0.0:
        assert found.robust == pytest.approx(found.plain)
        assert found.interval90 == pytest.approx(NORMAL_90 * found.plain)
    else:
        assert (found.robust > found.plain).all()
        assert (found.interval90 > 1.01 * NORMAL_90 * found.robust).all()


def test_parameters_are_recovered_from_a_start_far_off(fitted, truth):
    tolerance = {"inertia_": 0.006, "thrust_bem.k1": 0.004, "rotor_yaw": 0.01, "rotor_drag_thrust": 0.02}
    checked = 0
    for estimate in fitted.parameters:
        for prefix, relative in tolerance.items():
            if estimate.name.startswith(prefix):
                assert estimate.value == pytest.approx(truth.value(estimate.name), rel=relative), estimate.name
                checked += 1
    assert checked == 6


def test_a_flight_more_takes_little_more_memory(campaign, truth):
    """What a flight takes while it is linearised is free again for the next: six took three times what two take."""
    pieces = [log.slice(start_s, start_s + 4.0) for start_s in (2.0, 8.0) for log in campaign]

    def peak(logs: list[FlightLog]) -> int:
        tracemalloc.start()
        sysid.identify(logs, truth, sysid.Options(gusts="white", max_iterations=2))
        found = tracemalloc.get_traced_memory()[1]
        tracemalloc.stop()
        return found

    assert peak(pieces) < 2.3 * peak(pieces[1:3])


def test_thrust_is_in_proportion_to_the_vehicles_gravity(campaign, truth):
    simple = truth.without_effect("thrust_bem").with_effect("thrust_quadratic", k_n_s2=2.1e-6)
    name, given = "thrust_quadratic.k_n_s2", (9.77, 9.83)
    low, high = (
        sysid.identify(campaign[:1], simple.with_gravity(g), sysid.Options(free=(name,), gusts="white")) for g in given
    )
    ratio = high.estimate(name).value / low.estimate(name).value
    assert ratio - 1.0 == pytest.approx(given[1] / given[0] - 1.0, rel=0.2)  # turning, by a held inertia, says 0
    assert any("gravity is 9.77 m/s2" in finding for finding in low.findings)
    assert low.vehicle.gravity_m_s2 == 9.77, "what follows uses the same"
    with pytest.raises(InputError, match=r"gravity is 9\.77 m/s2 for \w+ and 9\.83 for \w+"):
        sysid.compare(campaign[:1], {"low": low.vehicle, "high": high.vehicle})
    with pytest.raises(InputError, match=r"a flight has one"):
        sysid.identify(campaign[:1], high.vehicle, near=low)


def test_pose_sensor_and_centre_of_mass_are_found(fitted, truth):
    for axis in "xyz":
        found = fitted.estimate(f"pose_sensor_{axis}_m").value
        assert found == pytest.approx(truth.value(f"pose_sensor_{axis}_m"), abs=1e-3)
    for axis in "xy":
        found = fitted.estimate(f"centre_of_mass.{axis}_m").value
        assert found == pytest.approx(truth.value(f"centre_of_mass.{axis}_m"), abs=1e-4)


def test_a_pose_that_comes_late_is_found_and_spoils_nothing(campaign, truth):
    """Two samples late: with the effect that is read to a millisecond, without it the other clocks are early."""
    late = [_with_late_pose(log, 2) for log in campaign]
    found = sysid.identify(late, truth.with_effect("pose_delay"))
    assert found.estimate("pose_delay.delay_s").value == pytest.approx(0.02, abs=1e-3)
    assert found.vehicle.value("pose_delay.delay_s") == found.estimate("pose_delay.delay_s").value
    assert found.clocks == ()  # rotor speed, all there is besides, is the reference
    without = sysid.identify(late, truth)
    assert [clock.against for clock in without.clocks] == ["pose"] * 3
    for clock in without.clocks[1:]:  # the vertical flight hardly shows it
        assert clock.delay_s == pytest.approx(-0.02, abs=1e-3)
        assert any(clock.sentence == finding for finding in without.findings)
    for result in (found, without):
        off = abs(result.estimate("inertia_yy_kg_m2").value / truth.value("inertia_yy_kg_m2") - 1.0)
        assert off < 0.005
    held = sysid.identify(late, found.vehicle, sysid.Options(held=("pose_delay.delay_s",)))
    assert held.estimate("pose_delay.delay_s").status == "held"


def _with_late_pose(log: FlightLog, rows: int) -> FlightLog:
    pose = tuple(name for name in log.columns if name.startswith(("position_world", "q_world_body")))
    shifted = {name: v[:-rows] if name in pose else v[rows:] for name, v in log.columns.items()}
    return FlightLog(shifted, log.metadata)


def test_errors_are_of_the_size_of_the_standard_errors(fitted, truth):
    free = [e for e in fitted.parameters if e.status == "free"]
    score = np.array([(e.value - truth.value(e.name)) / e.std_robust for e in free])
    # 17 nearly Gaussian scores: their mean square lies within 0.4 and 2.2 except once in a thousand
    assert 0.25 < (score**2).mean() < 2.5
    assert np.abs(score).max() < 4.0


def test_no_error_is_smaller_than_white_noise_alone_makes_it(fitted):
    assert all(e.std_robust >= e.std for e in fitted.parameters)


def test_noise_levels_are_estimated(fitted):
    assert fitted.noise.levels["pose"] == pytest.approx([2e-3, 2e-3], rel=0.05)


def test_the_fit_converges_and_reports_itself(fitted):
    assert fitted.converged
    facts = json.loads(json.dumps(fitted.as_dict(), allow_nan=False))
    assert facts["parameters"]["mass_kg"]["status"] == "held"
    assert facts["parameters"]["inertia_xx_kg_m2"]["std_robust"] > 0.0
    assert any("only ratios" in sentence for sentence in facts["findings"])
    shares = facts["parameters"]["inertia_xx_kg_m2"]["information"]
    assert sum(shares) == pytest.approx(1.0, abs=1e-6)
    assert shares[2] == max(shares), "the rotation flight tells most about inertia"


def test_the_identified_vehicle_carries_values_errors_and_source(fitted):
    parameter = fitted.vehicle.parameter("inertia_xx_kg_m2")
    estimate = fitted.estimate("inertia_xx_kg_m2")
    assert parameter.value == estimate.value
    assert parameter.std == estimate.std_robust
    assert "identified from flight 1" in parameter.source


def test_twice_the_mass_doubles_forces_and_inertias_and_nothing_else(campaign, truth):
    # the quadratic law is proportional to its coefficient; the blade-element law is not, as air density is held
    simple = truth.without_effect("thrust_bem").with_effect("thrust_quadratic")
    once = sysid.identify(campaign[2:], simple)
    twice = sysid.identify(campaign[2:], simple.with_value("mass_kg", 1.4))
    for name in ("thrust_quadratic.k_n_s2", "inertia_xx_kg_m2", "rotor_yaw_torque.torque_n_m_s2"):
        assert twice.estimate(name).value == pytest.approx(2.0 * once.estimate(name).value, rel=2e-3)
    assert twice.estimate("pose_sensor_x_m").value == pytest.approx(once.estimate("pose_sensor_x_m").value, abs=1e-4)


def test_held_parameters_stay_where_they_are(campaign, truth):
    options = sysid.Options(held=("inertia_zz_kg_m2",), pose_sensor=False)
    result = sysid.identify(campaign[2:], truth, options)
    assert result.estimate("inertia_zz_kg_m2").status == "held"
    assert result.vehicle.value("inertia_zz_kg_m2") == truth.value("inertia_zz_kg_m2")
    assert "pose_sensor_x_m" not in result.free_names


def test_a_prior_pulls_the_estimate(campaign, truth):
    wrong = truth.with_value("inertia_xx_kg_m2", 0.004)
    tight = sysid.Options(prior_std={"inertia_xx_kg_m2": 1e-9})
    assert sysid.identify(campaign[2:], wrong, tight).estimate("inertia_xx_kg_m2").value == pytest.approx(
        0.004, rel=1e-3
    )


def test_a_parameter_that_flights_do_not_show_is_held_and_named(campaign, truth):
    short = [campaign[0].slice(0.0, 2.0)]
    result = sysid.identify(short, truth)
    unseen = [e.name for e in result.parameters if e.status == "not identifiable"]
    assert "parasitic_drag.drag_xy_kg_m" in unseen
    for name in unseen:
        assert any(name in sentence for sentence in result.findings)
        assert result.vehicle.value(name) == truth.value(name)
    with pytest.raises(InputError, match="not identifiable"):
        sysid.identify(short, truth, sysid.Options(unseen="refuse"))


def _changed(log: FlightLog, **columns: np.ndarray) -> FlightLog:
    return FlightLog({**log.columns, **columns}, log.metadata)


def test_a_log_without_rotor_speed_is_refused(campaign, truth):
    log = campaign[0]
    bare = FlightLog({k: v for k, v in log.columns.items() if not k.startswith("rotor_speed")}, log.metadata)
    with pytest.raises(InputError, match="has no rotor_speed_rad_s"):
        sysid.identify([bare], truth)


def test_a_gap_is_refused_with_its_place_and_can_be_split(campaign, truth):
    log = campaign[2]
    keep = (log.time_s < 6.0) | (log.time_s > 6.5)
    holed = FlightLog({k: v[keep] for k, v in log.columns.items()}, log.metadata)
    with pytest.raises(InputError, match=r"no pose from 5\.99\d s to 6\.5"):
        sysid.identify([holed], truth)
    split = sysid.identify([holed], truth, sysid.Options(gaps="split"))
    assert len(split.flights) == 2
    assert split.estimate("inertia_xx_kg_m2").value == pytest.approx(0.00306, rel=0.01)


def test_a_partly_missing_pose_is_refused_with_its_row(campaign, truth):
    x = campaign[0].columns["position_world_x_m"].copy()
    x[17] = np.nan
    with pytest.raises(InputError, match="the first is row 17"):
        sysid.identify([_changed(campaign[0], position_world_x_m=x)], truth)


def test_hovering_is_refused_as_no_excitation(truth):
    rng = np.random.default_rng(0)
    n = 1000
    hover = from_vectors(
        np.arange(n) / 100.0,
        {
            "position_world_m": 1e-3 * rng.standard_normal((n, 3)),
            "q_world_body": np.tile([1.0, 0.0, 0.0, 0.0], (n, 1)),
            "rotor_speed_rad_s": 951.0 + rng.standard_normal((n, 4)),
        },
    )
    with pytest.raises(InputError, match="no excitation"):
        sysid.identify([hover], truth)


def test_mass_cannot_be_asked_for(campaign, truth):
    with pytest.raises(InputError, match="only ratios"):
        sysid.identify(campaign, truth, sysid.Options(free=("mass_kg",)))


def test_an_unknown_name_is_refused(campaign, truth):
    with pytest.raises(InputError, match="no parameter"):
        sysid.identify(campaign, truth, sysid.Options(held=("inertia_xz",)))


def test_no_flight_is_refused(truth):
    with pytest.raises(InputError, match="no flight"):
        sysid.identify([], truth)


def test_flights_that_disagree_make_the_error_larger(flying, truth):
    """Drag 15 % more and less in two of three flights: no stretch of a flight shows that, but the flights do."""
    rng = np.random.default_rng(0)
    drag = np.repeat([0.0175, 0.0175, 0.0175, 0.0150, 0.0175, 0.0200], 3)[:, None]  # six campaigns of three flights
    reference = flying.paper_flights(rng, 6, 0.2)
    level = flying.fly(flying.Truth(rotor_drag=drag), reference, 18, duration_s=8.0, rng=rng, rate_hz=100.0)[1::3]
    alike, apart = level[:3], level[3:]
    only = sysid.Options(free=("rotor_drag_thrust.drag_s_m",), gusts="white")
    one, other = (sysid.identify(logs, truth, only).estimate("rotor_drag_thrust.drag_s_m") for logs in (alike, apart))
    scatter = 0.0025 / np.sqrt(3.0)
    assert one.std_robust < 0.1 * scatter
    assert 0.5 * scatter < other.std_robust < 2.0 * scatter
