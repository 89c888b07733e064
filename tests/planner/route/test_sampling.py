import numpy as np
import pytest

import planner
from esdf import solids
from flight import InputError
from planner import PlanOptions
from planner.request import space
from planner.route import sampling

START, GOAL = np.array([-3.0, -2.0, 1.0]), np.array([3.0, -2.0, 1.0])


def find(field, sampler: str, seed: int = 1, checks: int = 1500):
    return sampling.route(field, START, GOAL, 0.3, sampler=sampler, margin_m=6.0, checks=checks, seed=seed)


def test_every_line_of_a_sampled_way_keeps_the_clearance_and_a_seed_repeats_it(two_rooms):
    way = find(two_rooms, "RRTstar")
    assert way is not None
    assert np.array_equal(way[[0, -1]], [START, GOAL])
    assert all(line.free for line in space.check_lines(two_rooms, way[:-1], way[1:], 0.3))
    assert np.array_equal(way, find(two_rooms, "RRTstar"))


@pytest.mark.slow
@pytest.mark.parametrize("name", sampling.SAMPLERS)
def test_every_sampling_planner_finds_the_door(two_rooms, drone, through, name):
    options = PlanOptions(search=name, search_checks=4000)
    plan = planner.plan(through(START, GOAL), two_rooms, drone, options)
    assert plan.gate.passed
    assert plan.trajectory.duration_s < 1.5 * planner.plan(through(START, GOAL), two_rooms, drone).trajectory.duration_s


def test_there_is_no_sampled_way_through_a_wall():
    scene = solids.Scene([solids.Room((-5, -4, 0), (5, 4, 3)), solids.Box((-0.1, -4.1, -0.1), (0.1, 4.1, 3.1))])
    assert find(scene, "RRTstar", checks=300) is None


@pytest.mark.parametrize("wrong", [{"search": "magic"}, {"search_seed": 0}, {"search_checks": 0}])
def test_search_options_that_make_no_sense_are_refused(wrong):
    with pytest.raises(InputError):
        PlanOptions(**wrong)
