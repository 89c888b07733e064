"""The way home: from the plan's own motion, proved clear, back to where it began."""

from dataclasses import replace

import numpy as np
import pytest

import esdf
import mapping
import planner
import preflight
import vehicle
from flight import Waypoints, silent, trajectory
from goshawk.commands.preflight import home, inputs
from goshawk.commands.preflight import preflight as verb
from goshawk.commands.preflight.home import WayHome
from goshawk.commands.preflight.outcome import RESERVE, Outcome
from preflight import core

OPTIONS = preflight.Options(flights=24, risk=0.2)


@pytest.fixture(scope="module")
def subject(pillar_map, tmp_path_factory) -> inputs.Subject:
    area, drone = mapping.open_map(pillar_map), vehicle.example()
    points = np.array([[0.8, 0.8, 1.0], [1.0, 3.0, 1.3], [3.0, 3.2, 1.2]])
    file = tmp_path_factory.mktemp("home") / "plan.json"
    limits = {"speed_m_s": 2.0, "acceleration_m_s2": 3.0}
    options = planner.PlanOptions(limits=vehicle.Limits(**drone.limits.as_dict() | limits))
    plan = planner.plan(Waypoints(points, np.full(3, np.nan)), area.field, drone, options)
    planner.save_plan(file, plan, name="plan")
    return inputs.subject(trajectory.load(file), area, drone, OPTIONS)


def test_it_goes_on_from_the_plans_motion_and_ends_at_rest_where_that_began(subject):
    joins, path = home._joins(subject.item.trajectory), subject.item.trajectory
    assert 2 <= len(joins) <= home.MOMENTS
    for join in joins:
        way = home._planned(subject, join).trajectory
        for order in range(4):
            there = path.evaluate([path.starts_s[join]], order)
            assert way.evaluate([0.0], order) == pytest.approx(there, abs=1e-5)
        end = [way.duration_s]
        assert way.position(end) == pytest.approx(path.position([0.0]), abs=1e-6)
        assert way.position(end, 1) == pytest.approx(np.zeros((1, 3)), abs=1e-6)
        required_m = subject.item.check["required_clearance_m"]
        assert esdf.certify(subject.area.field, way, required_m).passed


def test_it_is_flown_after_the_plan_up_to_there_and_needs_more_energy_the_later(subject):
    ways = tuple(home.ways_home(subject, progress=silent))
    assert all(way.go for way in ways)
    assert [way.from_s for way in ways] == sorted(way.from_s for way in ways)
    energies = [way.energy_j or np.nan for way in ways]
    assert energies == sorted(energies)
    result = preflight.fly(subject.scenario, OPTIONS)
    outcome = Outcome(subject, result, advice=preflight.Advice(3.0, 1.0), ways_home=ways)
    assert outcome.battery_j is not None
    assert outcome.battery_j * (1.0 - RESERVE) == pytest.approx(
        max(energies[-1], float(np.quantile(result.record.energy_j, 0.99)))
    )
    told = outcome.as_dict()["advice"]
    assert told["wind_m_s"] == 3.0
    assert [way["from_s"] for way in told["ways_home"]] == [way.from_s for way in ways]


def test_it_is_flown_with_no_more_room_stated_than_all_of_it_has(subject, monkeypatch):
    """The controller allows as much tracking error, and the way home may be narrower than the plan."""
    flown, fly = [], preflight.fly
    monkeypatch.setattr(preflight, "fly", lambda scenario, *a, **k: flown.append(scenario) or fly(scenario, *a, **k))
    assert list(home.ways_home(subject, progress=silent))
    assert len(flown) >= 2
    for scenario in flown:
        path = scenario.trajectory
        room_m = subject.area.field.distance(path.position(path.sample(0.002))).min() - subject.radius_m
        assert 0.0 < scenario.clearance_m <= room_m + 1e-3


@pytest.mark.parametrize(
    ("usable_j", "last_s", "said"),
    [
        (40.0, None, "none: it brings home from every moment looked at, and to the end"),
        (22.0, 2.2, "2.2 s: later it brings nobody home, nor to the end"),
        (5.0, 1.0, "before 1.0 s: it is too small for any way home"),
    ],
)
def test_no_return_is_where_the_energy_so_far_and_home_is_the_batterys(usable_j, last_s, said):
    ways = tuple(replace(way(float(t)), energy_j=10.0 * t) for t in (1, 2, 3))
    assert home.no_return_s(ways, usable_j) == last_s
    assert home.no_return(ways, usable_j, 35.0) == said
    assert home.no_return((replace(way(1.0), energy_j=None),), usable_j, 35.0).startswith("not known")


def test_a_moment_without_a_way_home_is_the_point_of_no_return():
    one, two, three = (replace(way(float(t)), energy_j=10.0 * t) for t in (1, 2, 3))
    for nothing in (replace(two, energy_j=None), replace(two, go=False)):
        assert home.no_return_s((one, nothing, three), 40.0) == 1.0
        assert "every moment" not in home.no_return((one, nothing, three), 40.0, 35.0)
    lost = replace(one, go=False)
    assert home.no_return((lost, two), 40.0, 35.0) == "before 1.0 s: from there no way home is a go"
    assert home.no_return_s((lost,), 40.0) is None


def test_a_smaller_battery_brings_home_from_fewer_moments_and_more_moments_are_looked_at_if_asked(subject):
    ways = tuple(home.ways_home(subject, 100, progress=silent))
    assert len(ways) >= len(home._joins(subject.item.trajectory))
    result = preflight.fly(subject.scenario, OPTIONS)
    most_j = max(way.energy_j or 0.0 for way in ways)
    told = []
    for share in (1.01, 0.97, 0.94):
        found = Outcome(subject, result, ways_home=ways, carried_j=share * most_j / (1.0 - RESERVE))
        told.append(found.as_dict()["advice"]["no_return_s"])
        assert f"{found.carried_j / 3600.0:.2f} Wh" in found.advice_words()["no return"]
    assert told[0] is None
    assert told[1] > told[2] >= ways[0].from_s


def way(from_s, duration_s=1.0, *, go=True) -> WayHome:
    return WayHome(from_s, 4.5 - from_s, duration_s, 1.0, go, "2 of 60")


@pytest.mark.parametrize(
    ("ways", "last_s", "said"),
    [
        ([way(1.0), way(2.0), way(3.0)], 3.0, "a go from 1.0, 2.0, 3.0 s"),
        ([way(1.0), way(2.0), way(3.0, 2.0)], 3.0, "a go from 1.0, 2.0, 3.0 s; the end is nearer from 3.0 s"),
        ([way(1.0, go=False), way(2.0)], 2.0, "a go from 2.0 s; not from 1.0 s (2 of 60)"),
        (
            [way(1.0), way(2.0, go=False), way(3.0, 2.0, go=False)],
            1.0,
            "a go from 1.0 s; not from 2.0, 3.0 s (2 of 60); the last that is a go is from 1.0 s; the end is nearer "
            "from 3.0 s",
        ),
        (
            [way(1.0, go=False), WayHome(2.0, 2.5, None, None, False, "no path")],
            None,
            "from no moment a go; not from 1.0, 2.0 s (no path)",
        ),
        ([], None, "home all along"),
    ],
)
def test_the_last_way_home_that_is_a_go_is_told_apart_from_where_the_end_is_nearer(ways, last_s, said):
    assert home.last_s(tuple(ways)) == last_s
    assert home.sentence(tuple(ways)) == said


def test_of_a_plan_that_begins_on_the_ground_none_is_looked_for(subject):
    path = subject.item.trajectory
    assert home.looked_for(subject)
    for ground, looked_for in ((path.position([0.0]), False), (path.position([path.duration_s]), True)):
        asked = subject.item.check["conditions"] | {"ground_world_m": ground.tolist()}
        item = replace(subject.item, check=subject.item.check | {"conditions": asked})
        assert home.looked_for(replace(subject, item=item)) is looked_for
    result = preflight.fly(subject.scenario, OPTIONS)
    none = Outcome(subject, result, advice=preflight.Advice(3.0, 1.0))
    assert none.as_dict()["advice"]["ways_home"] is None
    assert none.advice_words()["way home"] == home.GROUNDED


def test_where_too_few_come_to_the_end_no_battery_is_told(subject):
    result = preflight.fly(subject.scenario, OPTIONS)
    most_j = float(np.quantile(result.record.energy_j, 0.99))
    assert home.energy_j(result) == most_j
    given_up = replace(result.record, ending=np.where(np.arange(24) < 3, core.FAILSAFE, core.FINISHED))
    found = Outcome(subject, replace(result, record=given_up), advice=preflight.Advice(3.0, 1.0), ways_home=())
    assert found.battery_j is None
    assert found.advice_words()["battery"] == "not known: only 88 % of flights come to the end"


def test_ctrl_c_keeps_the_ways_home_that_were_found(subject, monkeypatch):
    found = home._way_home

    def interrupted(subject, join, progress):
        if join > home._joins(subject.item.trajectory)[0]:
            raise KeyboardInterrupt
        return found(subject, join, progress)

    monkeypatch.setattr(home, "_way_home", interrupted)
    outcome = verb._flown(subject, silent, advise=True, bundle=0)
    assert outcome.advice is None
    assert len(outcome.ways_home or ()) == 1
    assert outcome.advice_words()["way home"].startswith("a go from")
    assert len(outcome.as_dict()["advice"]["ways_home"]) == 1


def test_a_moment_from_which_there_is_no_way_says_why(subject, monkeypatch):
    def none(*_):
        raise planner.PlanInfeasibleError("no room", "go on")

    monkeypatch.setattr(home, "_planned", none)
    (first, *_) = home.ways_home(subject, progress=silent)
    assert (first.go, first.duration_s, first.energy_j) == (False, None, None)
    assert first.reason == "no room; go on"
