"""The planning process: the newest request is answered, a crash is told and survived, nothing is left behind."""

import os
import queue
import shutil
import signal
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import planner
import vehicle
from flight import Waypoints, project
from gcs_web import inputs, planning
from gcs_web.document import Content
from tests.waiting import PATIENCE_S, until

POINTS = np.array([[0.8, 0.8, 1.0], [3.0, 2.0, 1.2], [5.2, 0.8, 1.2]])


@pytest.fixture(scope="module")
def folder(pillar_map: Path, tmp_path_factory) -> Path:
    opened = project.create(tmp_path_factory.mktemp("planning") / "project", "two pillars")
    shutil.copytree(pillar_map, opened.map)
    vehicle.save(opened.vehicle, vehicle.example("rigter2019"))
    return opened.folder


@pytest.fixture(scope="module")
def running(folder: Path):
    answers: queue.Queue[planning.Answer] = queue.Queue()
    process = planning.PlanningProcess(folder, planner.PlanOptions(), answers.put)
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
        np.testing.assert_allclose(curve.position([passing.time_s])[0], point, atol=0.03)
    assert [s.start_s for s in shown.segments] == [p.time_s for p in shown.passings[:-1]]


def test_a_waypoint_in_a_pillar_is_refused_in_words(folder, running):
    process, answers = running
    process.request(request(folder, 2, np.array([[0.8, 0.8, 1.0], [2.0, 1.5, 1.2], [5.2, 0.8, 1.2]])))
    answer = answers.get(timeout=PATIENCE_S)
    assert answer.file is None
    assert answer.shown.state == "refused"
    assert "waypoint 1" in answer.shown.sentence


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
from gcs_web import planning
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
