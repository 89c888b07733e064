"""Losses too rare to count: as counted flights say where those can be flown, honest where not."""

from dataclasses import replace

import numpy as np
import pytest

import preflight
from firmware_bridge.controller import parameters_of
from flight import InputError
from preflight import core, draws, rare, remedies
from preflight.luck import Luck
from preflight.record import Record
from tests.preflight.conftest import EXACT, Wall, there_and_back

SHORT = there_and_back(1.0, 1.0)
AIR = replace(EXACT, wind_m_s=2.0, gust_std_m_s=1.5, localization_std_m=0.02, start_std_m=0.02)


def flown(drone, wall_m, *, flights=200, risk=1e-3, uncertainty=AIR, progress=lambda stage, fraction: None, **options):
    asked = preflight.Options(
        flights=flights, risk=risk, uncertainty=uncertainty, explain=False, rate_hz=400, **({"rare": True} | options)
    )
    return preflight.fly(preflight.Scenario(drone, SHORT, Wall(0.0), radius_m=-wall_m), asked, progress=progress)


def records(drone, wall_m, flights, **options) -> Record:
    """Of so many counted flights, and no shares of factors, for which many are flown again."""
    asked = preflight.Options(flights=flights, risk=1e-3, uncertainty=AIR, rate_hz=400, rare=False, **options)
    scenario = preflight.Scenario(drone, SHORT, Wall(0.0), radius_m=-wall_m)
    return preflight.study.records(scenario, np.arange(flights), asked)


@pytest.fixture(scope="module")
def counted(drone) -> np.ndarray:
    """Clearance of flights beside a wall of no distance."""
    return records(drone, 0.0, 400, seed=9).clearance_m


@pytest.fixture(scope="module")
def found(drone, counted) -> preflight.Result:
    return flown(drone, -float(np.quantile(counted, 0.02)), threads=1, decide_only=True)


def test_a_risk_that_can_be_counted_is_the_same_by_levels(found):
    assert found.rare is not None
    assert found.rare.risk.reached
    assert 0.02 / 2.5 < found.lost.estimate < 0.02 * 2.5
    assert found.lost.upper > 0.02
    assert found.lost.flights == 380


@pytest.mark.slow
def test_one_in_a_hundred_and_one_in_a_thousand_are_as_counted(drone):
    clearance = flown(drone, 0.0, flights=12000, rare=False, seed=9).record.clearance_m
    for chance in (1e-2, 1e-3):
        runs = [flown(drone, -float(np.quantile(clearance, chance)), flights=400, seed=seed) for seed in range(4)]
        assert np.mean([run.lost.estimate for run in runs]) == pytest.approx(chance, rel=0.6)
        assert sum(run.lost.upper >= 0.8 * chance for run in runs) >= 3


def test_one_and_two_threads_find_the_same_bits(drone, counted, found):
    again = flown(drone, -float(np.quantile(counted, 0.02)), threads=2, decide_only=True)
    assert again.lost == found.lost
    assert np.array_equal(again.rare.worst.clearance_m, found.rare.worst.clearance_m)
    assert again.steps == found.steps


def test_the_first_level_is_the_flights_that_counting_flies(drone, found, counted):
    few = records(drone, -float(np.quantile(counted, 0.02)), 200)
    assert np.array_equal(few.clearance_m, found.record.clearance_m)


def test_it_says_where_and_by_how_many_flights_the_rare_ones_are_lost(found):
    place = found.place()
    assert place is not None
    assert place.touching
    document = found.as_dict()
    assert document["method"] == "subset simulation"
    assert document["risk"]["levels"] == 2
    assert document["risk"]["flights"] == 380
    assert "by 2 levels, 380 flights" in found.reason()
    assert not found.go


def test_a_wall_out_of_reach_is_a_go_that_counting_would_need_more_flights_for(drone):
    found = flown(drone, 3.0, risk=2e-3, decide_only=True)
    assert found.go
    assert not found.rare.risk.reached
    assert found.lost.upper <= 2e-3
    assert found.lost.flights < preflight.Options(risk=2e-3, rare=False).count
    assert "about" not in str(found.lost)


def test_what_was_planted_is_named_of_the_flights_that_are_lost(drone):
    found = flown(drone, 0.14, uncertainty=replace(EXACT, localization_std_m=0.05))
    assert found.rare.risk.reached
    assert found.lost.estimate < 0.01
    assert found.dominating[0] == "localization"
    assert found.loss_shares["localization"] > 0.5


def test_gusts_of_which_no_number_tells_are_followed_and_named(drone):
    found = flown(drone, 0.06, risk=1e-5, uncertainty=replace(EXACT, gust_std_m_s=1.5))
    assert found.rare.risk.reached
    assert found.lost.estimate < 0.05
    assert found.dominating[0] == "gusts or sensor noise"  # which of them the lost flights' numbers do not tell


def test_what_comes_anew_is_told_apart_only_where_enough_flights_of_the_first_level_are_lost(found, drone):
    told = replace(found.rare, shares={"wind": 0.3})
    clearance = {core.GUSTS: 0.6, "wind": 0.2, core.NOISE: 0.1, core.DROP_OUTS: 0.0}
    assert told.with_luck(clearance, {"wind": 0.4, core.NOISE: 0.3}) == {"wind": 0.4, core.NOISE: 0.3}
    shares = told.with_luck(clearance, {})
    assert list(shares.items()) == [("gusts or sensor noise", pytest.approx(0.7)), ("wind", 0.3)]
    assert told.with_luck({core.GUSTS: 0.6, core.NOISE: 0.01}, {})[core.GUSTS] == pytest.approx(0.7)
    given = replace(AIR, noise_ratio=1.0)
    _, known = remedies.without(drone, given, "gusts or sensor noise")
    assert (known.gust_std_m_s, known.noise_ratio, known.wind_m_s) == (0.0, 0.0, given.wind_m_s)
    assert "less wind" in remedies.words("gusts or sensor noise")
    assert "estimate" in remedies.words("gusts or sensor noise")


def test_it_says_what_the_levels_do_not_look_for_and_what_counting_shows_of_that(found):
    assert any("less clearance, more tilt or more strain" in sentence for sentence in found.assumed)
    counted = found.as_dict()["risk"]["counted"]
    assert counted["count"] == np.count_nonzero(found.record.lost)
    assert counted["flights"] == 200
    assert counted["upper95"] > counted["estimate"]
    assert any(f"200 flights, at most {counted['upper95']:.1e}" in sentence for sentence in found.assumed)


def test_levels_are_not_flown_where_too_few_come_to_the_end(drone):
    told = []
    blind = replace(EXACT, drop_outs_per_s=10.0, drop_out_s=5.0)
    told_of = {"progress": lambda stage, fraction: told.append(stage)}
    found = flown(drone, 3.0, uncertainty=blind, decide_only=True, **told_of)
    assert found.finished < 0.9
    assert not any(stage.startswith("level") for stage in told)
    assert found.rare is None
    assert not found.cut_off
    assert "come to the end" in found.reason()


def test_what_the_levels_did_not_show_has_a_next_step_that_can_be_taken(found):
    below = replace(found.rare, risk=replace(found.rare.risk, reached=False, upper=0.01))
    assert "fly --rare --flights 400 with another --seed" in replace(found, rare=below).reason()
    near = replace(found.rare, risk=replace(found.rare.risk, chance=1e-4, upper=0.01))
    many = replace(found, rare=near, record=found.record[np.zeros(60_000, int)], wanted=60_000)
    assert "fly --flights 2995 with another --seed" in many.reason()
    assert "fly" not in replace(found, rare=replace(below, cut_off=True)).reason()


def test_ctrl_c_keeps_the_levels_that_were_flown_and_no_bound_below_theirs(drone):
    told = []

    def stop_in_the_third(stage, fraction):
        told.append(stage)
        if stage == "level 3":
            raise KeyboardInterrupt

    found = flown(drone, 1.0, risk=1e-5, progress=stop_in_the_third)
    assert told[0] == "flights"
    assert found.cut_off
    assert not found.go
    assert found.rare.risk.levels == 2
    assert found.lost.upper > found.lost.estimate >= 0.01
    assert found.lost.flights <= 380
    assert found.shares == {}


def test_levels_are_flown_where_counting_takes_too_many_flights_unless_they_are_asked_for():
    assert preflight.Options(risk=1e-4).by_levels
    assert preflight.Options(risk=1e-4).count == rare.FLIGHTS
    assert not preflight.Options(risk=1e-3).by_levels
    assert not preflight.Options(risk=1e-4, flights=500).by_levels
    assert not preflight.Options(risk=1e-4, rare=False).by_levels
    assert preflight.Options(risk=1e-2, flights=205, rare=True).count == 210
    with pytest.raises(InputError, match="from 200 to"):
        preflight.Options(flights=50, rare=True)


def test_a_margin_is_below_zero_for_the_lost_and_no_others(found):
    record = found.record
    fell = np.arange(len(record)) % 7 == 0
    told = replace(record, fell=fell, clearance_m=np.where(fell, np.inf, record.clearance_m))
    margin = rare.Margin.of(told)(told)
    assert np.array_equal(margin < 0.0, told.lost)
    assert 0.5 < np.median(margin[~told.lost]) < 1.3


def test_a_flight_that_the_controller_gave_up_or_almost_did_counts_as_nearer_to_a_loss(found):
    record = found.record[~found.record.lost]
    usual = rare.Margin.of(record)
    given_up = replace(record, ending=np.full(len(record), core.FAILSAFE))
    strained = replace(record, strain=np.full(len(record), 0.97))
    plain = usual(record)
    assert (plain > 0.0).all()
    assert (usual(given_up) < np.minimum(plain, 0.1)).all()
    assert np.array_equal(np.argsort(usual(given_up)), np.argsort(np.minimum(
        record.clearance_m / usual.clearance_m, (np.pi / 2 - record.tilt_rad) / usual.tilt_rad)))  # fmt: skip
    assert (usual(strained) <= plain).all()
    assert usual(strained).max() < 0.1


def test_the_numbers_that_flights_are_made_of_make_them_again(form):
    names = core.native.compiled(form).names
    drawn = draws.draw(form, names, AIR, 5, 3)
    again = draws.made_of(form, names, AIR, drawn.inputs)
    assert np.array_equal(drawn.rows, again.rows)
    assert np.array_equal(drawn.values, again.values)
    assert np.array_equal(drawn.map_error_m, again.map_error_m)


def test_gusts_of_two_numbers_are_neither_ones_and_of_one_are_its_own(form, drone):
    loop = core.Loop(form, SHORT, parameters_of(drone), rate_hz=400)
    drawn = draws.draw(form, loop.names, replace(EXACT, gust_std_m_s=2.0), 3, 1)
    one = Luck.of(np.array([4, 4, 5]))
    two = Luck.joined([one[:1], one[1:2].moved(np.array([5]), 0.6, np.zeros((1, 2), bool)), one[2:]])
    rows = np.zeros(3, int)
    ends = loop.fly(drawn.values[rows], drawn.rows[rows], seed=1, numbers=two).error_m
    alone = loop.fly(drawn.values[rows], drawn.rows[rows], seed=1, numbers=np.array([4, 4, 5])).error_m
    assert np.array_equal(ends[[0, 2]], alone[[0, 2]], equal_nan=True)
    assert not np.array_equal(ends[1], alone[1], equal_nan=True)


def test_records_are_taken_by_row(found):
    rows = np.array([3, 3, 1])
    part: Record = found.record[rows]
    assert len(part) == 3
    assert part.clearance_m[0] == part.clearance_m[1] == found.record.clearance_m[3]
