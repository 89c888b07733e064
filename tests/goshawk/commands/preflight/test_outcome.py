"""What a result asks of the next plan: margins near whole segments, as far as the waypoints leave room for them."""

from dataclasses import replace

import numpy as np
import pytest

import mapping
import planner
import preflight
import vehicle
from flight import Waypoints, trajectory
from goshawk.commands.preflight import inputs, outcome, screen
from goshawk.commands.preflight.outcome import Outcome
from planner import LocalMargin
from preflight import margins

OPTIONS = preflight.Options(flights=24, risk=0.2)
NARROW_M = 0.37
"""Of the second waypoint from a wall: little more than is required."""


@pytest.fixture(scope="module")
def subject(pillar_map, tmp_path_factory) -> inputs.Subject:
    area, drone = mapping.open_map(pillar_map), vehicle.example()
    points = np.array([[0.8, 0.8, 1.0], [NARROW_M, 2.0, 1.2], [1.0, 3.2, 1.2], [3.0, 3.2, 1.2]])
    file = tmp_path_factory.mktemp("outcome") / "plan.json"
    plan = planner.plan(Waypoints(points, np.full(4, np.nan)), area.field, drone, planner.PlanOptions())
    planner.save_plan(file, plan, name="plan")
    return inputs.subject(trajectory.load(file), area, drone, OPTIONS)


@pytest.fixture(scope="module")
def result(subject) -> preflight.Result:
    return preflight.fly(subject.scenario, OPTIONS)


def needed(subject, segment: int, extra_m: float = 0.08) -> margins.Needed:
    path = subject.item.trajectory
    return margins.Needed(segment, *path.starts_s[segment : segment + 2].tolist(), True, extra_m, 5)


def test_a_margin_is_asked_for_from_end_to_end_of_its_segment(subject):
    path = subject.item.trajectory
    last = len(path.durations_s) - 1
    near = outcome._margin_near(subject, needed(subject, last))
    assert isinstance(near, LocalMargin)
    ends = path.position(path.starts_s[last : last + 2])
    assert np.array(near.polyline_world_m)[[0, -1]] == pytest.approx(ends)
    assert len(near.polyline_world_m) == 7


def test_where_a_waypoint_leaves_no_more_room_none_is_asked_for_and_it_is_named(subject, result, monkeypatch):
    path = subject.item.trajectory
    at = int(np.linalg.norm(path.position(path.starts_s) - subject.item.waypoints_world_m[1], axis=1).argmin())
    found = (needed(subject, at - 1), needed(subject, len(path.durations_s) - 1))
    lost = replace(result, risk=1e-3)
    monkeypatch.setattr(margins, "needed", lambda *_: found)
    both = Outcome(subject, lost)
    assert both.narrow_waypoints == [1]
    again = both.plan_again
    assert again is not None
    assert [each["segment"] for each in again["segments"]] == [found[1].segment]
    assert len(again["near"]) == 1
    assert "or move waypoint 2, which leaves" in screen.decides(lost, again, both.narrow_waypoints)[1]
    monkeypatch.setattr(margins, "needed", lambda *_: found[:1])
    asked = []
    monkeypatch.setattr(outcome.slower, "needed", lambda *_: asked.append(1) or ())
    assert (Outcome(subject, lost).plan_again, asked) == (None, [1])
