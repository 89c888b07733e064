"""The planning process: the newest request is answered, a crash is told and survived, nothing is left behind."""

import os
import queue
import re
import shutil
import signal
import subprocess
import sys
from dataclasses import fields, is_dataclass, replace
from pathlib import Path

import numpy as np
import pytest

import mapping
import planner
import vehicle
from flight import Trajectory, TrajectoryFile, Waypoints, file_format, project
from flight.mission import Ground, Laps, Mission, Stay
from flight.trajectory import fingerprint
from gcs_web.document import missions
from gcs_web.document.document import Content, Settings
from gcs_web.planning import inputs, planning, replanning
from gcs_web.protocol.plan import Plan
from tests.waiting import PATIENCE_S, until

POINTS = np.array([[0.8, 0.8, 1.0], [3.0, 2.0, 1.2], [5.2, 0.8, 1.2]])


@pytest.fixture(scope="module")
def folder(pillar_map: Path, tmp_path_factory) -> Path:
    opened = project.create(tmp_path_factory.mktemp("planning") / "project", "two pillars")
    shutil.copytree(pillar_map, opened.map)
    vehicle.save(opened.vehicle, vehicle.example("rigter2019"))
    return opened.folder


@pytest.fixture(scope="module")
def drafts() -> queue.Queue[planning.Draft]:
    return queue.Queue()


@pytest.fixture(scope="module")
def running(folder: Path, drafts):
    answers: queue.Queue[planning.Answer] = queue.Queue()
    process = planning.PlanningProcess(folder, planner.PlanOptions(), answers.put, drafts.put)
    yield process, answers
    process.close()


def request(folder: Path, revision: int, points: np.ndarray = POINTS) -> planning.Request:
    content = Content().with_waypoints(Waypoints(points, np.full(len(points), np.nan)))
    return planning.Request(revision, content, inputs.signature(folder))


def test_a_plan_is_checked_and_shown_with_its_limits(folder, running):
    process, answers = running
    process.request(request(folder, 1))
    answer = answers.get(timeout=PATIENCE_S)
    shown = answer.shown
    assert answer.file is not None
    assert answer.file.checked
    assert (shown.state, shown.revision) == ("checked", 1)
    assert shown.limits[0].share == max(limit.share for limit in shown.limits) <= 1.0
    assert {limit.name for limit in shown.limits} >= {"speed", "acceleration", "tilt", "slowest rotor", "clearance"}
    assert shown.series is not None
    path = np.stack([shown.series.x_m, shown.series.y_m, shown.series.z_m], axis=1)
    curve = answer.file.trajectory
    times = np.minimum(shown.series.time_s, curve.duration_s)  # they are rounded
    np.testing.assert_allclose(path, curve.position(times), atol=1e-4)
    for passing, point in zip(shown.passings, POINTS, strict=True):
        at_s = min(passing.time_s, curve.duration_s)
        np.testing.assert_allclose(curve.position([at_s])[0], point, atol=0.03)
    assert [s.start_s for s in shown.segments] == [p.time_s for p in shown.passings[:-1]]


def test_a_plan_in_a_doubtful_map_says_so(folder, tmp_path):
    shutil.copytree(folder, tmp_path / "project")
    path = tmp_path / "project" / "map" / "map.toml"
    facts = file_format.read_toml(path, format="goshawk-map", version=1)
    body = facts | {"verdict": "doubtful", "reasons": ["the walk is short"]}
    file_format.write_toml(path, format="goshawk-map", version=1, body=body)
    asked, replanner = request(tmp_path / "project", 1), replanning.Replanner()
    replanner.begin()
    answer = planning.answer(asked, inputs.Parts(tmp_path / "project"), planner.PlanOptions(), replanner)
    assert answer.file is not None
    assert answer.shown.sentence.endswith(" The map is doubtful: the walk is short.")


@pytest.mark.parametrize(("most", "said"), [(150, False), (1, True)])
def test_a_plan_whose_optimiser_did_not_converge_says_so(folder, monkeypatch, most, said):
    monkeypatch.setattr(planner.optimise.descents, "_MOST", most)
    asked, replanner = request(folder, 1), replanning.Replanner()
    replanner.begin()
    answer = planning.answer(asked, inputs.Parts(folder), planner.PlanOptions(), replanner)
    assert answer.file is not None
    assert ("did not converge: a faster flight may exist" in answer.shown.sentence) == said


def test_a_plan_says_how_thin_an_obstacle_could_hide_near_it(folder):
    asked, replanner = request(folder, 1), replanning.Replanner()
    replanner.begin()
    answer = planning.answer(asked, inputs.Parts(folder), planner.PlanOptions(), replanner)
    assert answer.file is not None
    assert answer.file.check["could_hide"]["unobserved"]  # the room's one image does not show all of it
    assert "is needed. An obstacle of any thickness could hide within 0.34 m" in answer.shown.sentence
    assert "(Import images) with 0.03 m as the thinnest obstacle" in answer.shown.sentence
    assert "goshawk" not in answer.shown.sentence


def test_a_waypoint_in_a_pillar_is_refused_in_words(folder, running):
    process, answers = running
    process.request(request(folder, 2, np.array([[0.8, 0.8, 1.0], [2.0, 1.5, 1.2], [5.2, 0.8, 1.2]])))
    answer = answers.get(timeout=PATIENCE_S)
    assert answer.file is None
    assert answer.shown.state == "refused"
    assert "waypoint 2" in answer.shown.sentence


def test_a_draft_is_answered_beside_the_plans(folder, running, drafts):
    process, answers = running
    process.request(request(folder, 90))
    assert answers.get(timeout=PATIENCE_S).shown.state == "checked"
    target = POINTS[1] + [0.0, 0.1, 0.1]
    process.draft(1, target)
    draft = drafts.get(timeout=PATIENCE_S)
    assert np.linalg.norm(draft.path_world_m - target, axis=1).min() < 1e-6
    assert draft.shown.state == "clear"
    assert "Not checked" in draft.shown.sentence
    assert drafts.get(timeout=PATIENCE_S).shown.state == "checked"  # it was held still
    process.draft(99, target)
    gone = drafts.get(timeout=PATIENCE_S)
    assert (gone.path_world_m, gone.shown) == (None, None)
    process.draft(1, np.array([2.0, 1.5, 1.2]))
    refused = drafts.get(timeout=PATIENCE_S)
    assert (refused.path_world_m, refused.shown.state) == (None, "refused")
    assert re.match(r"Waypoint 2 .* inside an obstacle", refused.shown.sentence)
    assert answers.empty()


def test_of_drafts_that_wait_only_the_newest_is_answered(folder, running, drafts):
    process, answers = running
    process.request(request(folder, 91))
    assert answers.get(timeout=PATIENCE_S).shown.state == "checked"
    for k in range(200):
        process.draft(1, POINTS[1] + [0.0, 0.001 * k, 0.0])
    answered = 0
    while True:
        draft = drafts.get(timeout=PATIENCE_S)
        answered += 1
        if draft.shown.state == "checked":
            break
    np.testing.assert_array_equal(draft.position_world_m, POINTS[1] + [0.0, 0.001 * 199, 0.0])
    assert answered < 100


def test_the_plan_follows_the_draft_of_a_waypoint_that_is_held_still_and_is_the_one_on_letting_go(
    folder, running, drafts
):
    process, answers = running
    process.request(request(folder, 92))
    assert answers.get(timeout=PATIENCE_S).shown.state == "checked"
    target = POINTS[1] + [0.1, 0.15, 0.05]
    process.draft(1, target)
    assert drafts.get(timeout=PATIENCE_S).shown.state == "clear"
    held = drafts.get(timeout=PATIENCE_S)
    assert held.shown.state == "checked"
    assert answers.empty()
    process.request(request(folder, 93, np.array([POINTS[0], target, POINTS[2]])))
    answer = answers.get(timeout=PATIENCE_S)
    assert answer.shown.state == "checked"
    path = answer.file.trajectory
    drawn = path.position(np.linspace(0.0, path.duration_s, len(held.path_world_m)))
    np.testing.assert_array_equal(drawn, held.path_world_m)


def test_a_draft_carries_no_trajectory_out_of_the_planner(folder):
    asked, replanner, parts = request(folder, 1), replanning.Replanner(), inputs.Parts(folder)
    replanner.begin()
    before = planning.answer(asked, parts, planner.PlanOptions(), replanner)
    draft = planning.drafted(planning.Draft(1, POINTS[1] + [0.0, 0.1, 0.1]), replanner)
    held = [getattr(part, name) for part in (draft, draft.shown) for name in names(part)]
    assert not any(isinstance(value, TrajectoryFile | Trajectory | planner.Plan) for value in held)
    replanner.begin()
    after = planning.answer(asked, parts, planner.PlanOptions(), replanner)
    assert fingerprint(after.file.trajectory) == fingerprint(before.file.trajectory)


def names(part) -> list[str]:
    return [field.name for field in fields(part)] if is_dataclass(part) else list(part.__struct_fields__)


def test_the_newest_of_many_requests_is_answered(folder, running):
    process, answers = running
    for revision in range(100, 130):
        shift = [0.0, 0.0, 0.01 * (revision % 7)]
        process.request(request(folder, revision, POINTS + shift))
    while (answer := answers.get(timeout=PATIENCE_S)).request.revision != 129:
        pass
    assert answer.shown.state == "checked"
    assert answers.empty()


def test_the_answer_to_an_older_request_of_the_same_revision_leaves_the_newer_one_open(folder, running):
    """As when the map changed meanwhile: a planner that dies on the newer one must still be told of."""
    process, answers = running
    older, newer = request(folder, 150), request(folder, 150)
    process.request(newer)
    process._take(planning.Answer(older, None, Plan(150, "refused", "of the older map")))
    assert answers.get(timeout=PATIENCE_S).request == older
    assert process._newest == newer
    assert answers.get(timeout=PATIENCE_S).request == newer
    assert process._newest is None


def test_a_mission_is_planned_with_laps_stay_and_landing(folder, running):
    process, answers = running
    asked = Mission(
        Waypoints(POINTS, np.full(3, np.nan)),
        laps=Laps(2),
        stays=(Stay(1, 1.5),),
        landing=Ground((5.2, 1.2, 0.1)),
    )
    content = missions.with_mission(Content(), asked)
    process.request(planning.Request(200, content, inputs.signature(folder)))
    answer = answers.get(timeout=PATIENCE_S)
    shown = answer.shown
    assert shown.state == "checked", shown.sentence
    assert "2 laps" in shown.sentence
    assert [passing.waypoint for passing in shown.passings] == [0, 1, 2, 0, 1, 2, 0, None]
    assert [(s.start, s.end) for s in shown.segments[-2:]] == [(2, 0), (0, None)]
    times = [passing.time_s for passing in shown.passings]
    assert times == sorted(times)
    for segment in shown.segments:
        assert segment.start_s <= segment.worst_s <= segment.end_s
        assert segment.share <= 1.001  # of what the gate allows, also near the ground of the landing
    curve = answer.file.trajectory
    for passing, number in zip(shown.passings, [0, 1, 2, 0, 1, 2, 0], strict=False):
        np.testing.assert_allclose(curve.position([passing.time_s])[0], POINTS[number], atol=0.03)


def test_the_parts_of_the_rotor_margin_are_shares_of_what_is_left(folder, running):
    process, answers = running
    process.request(request(folder, 201))
    series = answers.get(timeout=PATIENCE_S).shown.series
    assert 0.0 <= min(series.rotor_margin_percent) <= max(series.rotor_margin_percent) <= 50.0
    weight_n = vehicle.example("rigter2019").mass_kg * 9.81
    assert series.thrust_n[0] == pytest.approx(weight_n, rel=0.02)  # at rest


def test_a_planner_that_is_killed_is_told_and_started_again(folder, running):
    process, answers = running
    process.request(request(folder, 3))
    os.kill(process._process.pid, signal.SIGKILL)
    killed = answers.get(timeout=PATIENCE_S)
    if killed.shown.state == "checked":  # it was quicker than the signal: the next request finds nobody
        process.request(request(folder, 3))
        killed = answers.get(timeout=PATIENCE_S)
    assert "ended unexpectedly" in killed.shown.sentence
    process.request(request(folder, 4))
    assert answers.get(timeout=PATIENCE_S).shown.state == "checked"


def test_the_planner_ends_with_a_station_that_is_killed(folder):
    script = f"""
import time
from pathlib import Path
import planner
from gcs_web.planning import planning
if __name__ == "__main__":
    process = planning.PlanningProcess(Path({str(folder)!r}), planner.PlanOptions(), print)
    print(process._process.pid, flush=True)
    time.sleep({PATIENCE_S})
"""
    path = folder / "station.py"
    path.write_text(script)
    station = subprocess.Popen([sys.executable, path], stdout=subprocess.PIPE, text=True)
    assert station.stdout is not None
    planner_pid = int(station.stdout.readline())
    station.kill()
    station.wait()
    until(lambda: not Path(f"/proc/{planner_pid}").exists(), "the planner's end")


@pytest.mark.parametrize(
    ("asked", "own", "most"), [(None, None, None), (None, 40.0, 40.0), (30.0, None, 30.0), (50.0, 40.0, 40.0)]
)
def test_the_stricter_jerk_of_page_and_vehicle_holds(folder, asked, own, most):
    believed = vehicle.load(folder / "vehicle.toml")
    believed = replace(believed, limits=replace(believed.limits, jerk_m_s3=own))
    content = Content(settings=Settings(jerk_m_s3=asked))
    assert planning.options(content, believed, planner.PlanOptions()).limits.jerk_m_s3 == most


@pytest.fixture(scope="module")
def slow(folder: Path) -> TrajectoryFile:
    """A saved trajectory that is slower than the document asks, and looks elsewhere."""
    opened = project.open_project(folder)
    area, believed = mapping.open_map(opened.map), vehicle.load(opened.vehicle)
    asked = planner.PlanOptions(yaw="fixed", heading_rad=1.0, limits=replace(believed.limits, speed_m_s=1.0))
    plan = planner.plan(Waypoints(POINTS, np.full(3, np.nan)), area.field, believed, asked)
    return planner.trajectory_file(plan, name="slow")


def test_a_saved_trajectory_is_the_plan_of_its_waypoints_as_it_is(folder, slow):
    asked = replace(request(folder, 1), saved=slow)
    found = planning.answer(asked, inputs.Parts(folder), planner.PlanOptions(), replanning.Replanner())
    assert found.file is slow
    assert found.shown.sentence.startswith("slow as it was saved.")
    assert found.shown.top_speed_m_s < 1.01
    assert [p.waypoint for p in found.shown.passings] == [point.id for point in asked.content.points]
    assert found.shown.passings[-1].time_s == pytest.approx(slow.trajectory.duration_s, abs=0.02)


def test_a_saved_trajectory_of_another_vehicle_is_planned_again_and_that_is_said(folder, slow):
    other = replace(slow, vehicle_hash="0" * 64)
    asked = replace(request(folder, 1), saved=other)
    found = planning.answer(asked, inputs.Parts(folder), planner.PlanOptions(), replanning.Replanner())
    assert "does not pass any more" in found.shown.sentence
    assert "vehicle" in found.shown.sentence
    assert found.file is not None
    assert found.file.checked
    assert found.shown.top_speed_m_s > 2.0


def test_a_saved_trajectory_that_is_nearer_to_obstacles_than_is_asked_for_now_is_planned_again(folder):
    area, believed = mapping.open_map(folder / "map"), vehicle.load(folder / "vehicle.toml")
    through = Waypoints(POINTS, np.full(3, np.nan))
    plan = planner.plan(through, area.field, believed, planner.PlanOptions(radius_m=0.2, margin_m=0.0))
    near = planner.trajectory_file(plan, name="near")
    asked = replace(request(folder, 1), saved=near)
    found = planning.answer(asked, inputs.Parts(folder), planner.PlanOptions(), replanning.Replanner())
    assert "is asked for now: planned again" in found.shown.sentence
    assert found.file is not None
    assert found.file is not near
    assert found.shown.clearance_m is not None
    assert found.shown.required_clearance_m is not None
    assert found.shown.clearance_m >= found.shown.required_clearance_m > 0.2
