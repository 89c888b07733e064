"""The way home: from the plan's own motion, proved clear, back to where it began; and from when on there is none."""

import numpy as np
import pytest

import esdf
import mapping
import planner
import preflight
import vehicle
from flight import Waypoints, silent, trajectory
from goshawk.commands.preflight import home, inputs
from goshawk.commands.preflight.home import WayHome
from goshawk.commands.preflight.outcome import RESERVE, Outcome

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
    ways = home.ways_home(subject, progress=silent)
    assert all(way.go for way in ways)
    assert [way.from_s for way in ways] == sorted(way.from_s for way in ways)
    energies = [way.energy_j or np.nan for way in ways]
    assert energies == sorted(energies)
    result = preflight.fly(subject.scenario, OPTIONS)
    outcome = Outcome(subject, result, advice=preflight.Advice(3.0, 1.0), ways_home=ways)
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
    home.ways_home(subject, progress=silent)
    assert len(flown) >= 2
    for scenario in flown:
        path = scenario.trajectory
        room_m = subject.area.field.distance(path.position(path.sample(0.002))).min() - subject.radius_m
        assert 0.0 < scenario.clearance_m <= room_m + 1e-3


def way(from_s, duration_s=1.0, *, go=True) -> WayHome:
    return WayHome(from_s, duration_s, 1.0, go, "2 of 60")


@pytest.mark.parametrize(
    ("ways", "from_s", "said"),
    [
        ([way(1.0), way(2.0), way(3.0)], None, "a go from 1.0, 2.0, 3.0 s"),
        ([way(1.0), way(2.0), way(3.0, 2.0)], 3.0, "a go from 1.0, 2.0 s; from 3.0 s on the end is nearer"),
        (
            [way(1.0, go=False), way(2.0), way(3.0, 2.0)],
            3.0,
            "a go from 2.0 s; not from 1.0 s; from 3.0 s on the end is",
        ),
        ([way(1.0), way(2.0, go=False), way(3.0, go=False)], 2.0, "a go from 1.0 s; from 2.0 s on none is (2 of 60)"),
        ([way(1.0, go=False), WayHome(2.0, None, None, False, "no path")], 1.0, "from 1.0 s on none is (2 of 60)"),
        ([], None, "home all along"),
    ],
)
def test_there_is_no_return_once_no_later_way_is_a_go_and_nearer_than_the_end(ways, from_s, said):
    assert home.point_of_no_return_s(tuple(ways), 4.5) == from_s
    assert home.sentence(tuple(ways), 4.5).startswith(said)


def test_a_moment_from_which_there_is_no_way_says_why(subject, monkeypatch):
    def none(*_):
        raise planner.PlanInfeasibleError("no room", "go on")

    monkeypatch.setattr(home, "_planned", none)
    (first, *_) = home.ways_home(subject, progress=silent)
    assert (first.go, first.duration_s, first.energy_j) == (False, None, None)
    assert first.reason == "no room; go on"
