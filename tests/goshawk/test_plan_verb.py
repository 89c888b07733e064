"""`goshawk plan`: missions, yaw modes and batches."""

import json
import os
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pytest

import vehicle
from flight import InputError, Waypoints, mission, project, trajectory
from flight.mission import Ground, Laps, Mission, Stay
from goshawk import batch, demo
from tests.goshawk.running import answer as goshawk

LOOP = np.array([[0.8, 0.8, 1.0], [3.0, 2.0, 1.3], [5.2, 0.8, 1.0], [5.0, 3.4, 1.6]])


def run(*arguments: object, code: int = 0) -> dict:
    ended = goshawk("plan", *arguments, "--json")
    assert ended.returncode == code, ended.stderr
    return json.loads(ended.stdout)


@pytest.fixture(scope="module")
def folder(pillar_map: Path, tmp_path_factory) -> Path:
    """A project folder with a map, a vehicle, and missions of which one cannot be flown and one is damaged."""
    folder = tmp_path_factory.mktemp("plans")
    os.symlink(pillar_map, folder / "map")
    vehicle.save(folder / "vehicle.toml", demo.vehicles()[1])
    (folder / "missions").mkdir()
    for name, points in (("a", LOOP), ("b", LOOP[::-1]), ("inside", LOOP + np.array([1.2, 0.7, 0.2]))):
        project.save_waypoints(folder / "missions" / f"{name}.json", ask(points))
    (folder / "missions" / "torn.json").write_text("{")
    return folder


def ask(points: np.ndarray) -> Waypoints:
    return Waypoints(points, np.full(len(points), np.nan))


def world(folder: Path) -> tuple[object, ...]:
    return ("--map", folder / "map", "--vehicle", folder / "vehicle.toml")


def test_a_mission_in_the_file_is_planned_and_checked_again_from_its_trajectory(folder):
    asked = Mission(ask(LOOP), laps=Laps(2), stays=(Stay(1, 1.0),), take_off=Ground((0.8, 0.8, 0.1)))
    mission.save(folder / "mission.json", asked)
    facts = run(folder / "mission.json", *world(folder), "--out", folder / "flown.json", "--heading", 90)
    assert facts["check"]["passed"]
    flown = trajectory.load(folder / "flown.json").trajectory
    assert np.abs(flown.evaluate(flown.sample(0.05))[:, 3] - np.pi / 2).max() < 1e-6
    assert flown.position(np.array([0.0]))[0].tolist() == pytest.approx([0.8, 0.8, 0.1])
    checked = goshawk("check", folder / "flown.json", *world(folder), "--json")
    assert checked.returncode == 0, checked.stdout


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (("--yaw", "fixed"), "needs --heading"),
        (("--yaw", "smooth", "--heading", "10"), "contradict"),
        (("--heading", "10", "--look-at", "1", "2", "3"), "contradict"),
        (("--batch", "x"), "give either WAYPOINTS or --path or --batch"),
    ],
)
def test_options_that_contradict_each_other_are_wrong_usage(folder, options, words):
    ended = goshawk("plan", folder / "missions" / "a.json", *world(folder), "--out", folder / "x.json", *options)
    assert ended.returncode == 2
    assert words in ended.stderr


def test_a_batch_plans_what_can_be_flown_and_says_why_the_rest_cannot(folder, tmp_path):
    answer = run("--batch", folder / "missions", *world(folder), "--out", tmp_path / "out", code=1)
    rows = {row["name"]: row for row in answer["missions"]}
    assert [rows[name]["status"] for name in ("a", "b", "inside", "torn")] == ["planned"] * 2 + ["refused"] * 2
    assert "waypoint" in rows["inside"]["reason"]
    assert "JSON" in rows["torn"]["reason"]
    assert trajectory.load(batch.trajectory_path(tmp_path / "out", "a")).checked
    table = pq.read_table(tmp_path / "out" / "results.parquet").to_pylist()
    assert table == json.loads((tmp_path / "out" / "results.json").read_text())["missions"]


def test_a_batch_goes_on_where_it_was_broken_off(folder, tmp_path, monkeypatch):
    out, planned = tmp_path / "out", []
    real = batch.plan_one

    def broken_off(path, job):
        if len(planned) == 1:
            raise KeyboardInterrupt
        planned.append(path.stem)
        return real(path, job)

    monkeypatch.setattr(batch, "plan_one", broken_off)
    assert goshawk("plan", "--batch", folder / "missions", *world(folder), "--out", out).returncode == 130
    assert [row["name"] for row in json.loads((out / "results.json").read_text())["missions"]] == ["a"]
    with open(out / batch.JOURNAL, "a") as journal:
        journal.write('{"name": "b", "sta')  # and a crash in the middle of a line
    planned.append("")
    run("--batch", folder / "missions", *world(folder), "--out", out, code=1)
    assert planned == ["a", "", "b", "inside", "torn"]
    answer = run("--batch", folder / "missions", *world(folder), "--out", out, code=1)
    assert len(answer["missions"]) == 4
    assert len(planned) == 5  # nothing is planned twice
    ended = goshawk("plan", "--batch", folder / "missions", *world(folder), "--out", out, "--margin", 0.1)
    assert ended.returncode == 2
    assert "results of other inputs" in ended.stderr


@pytest.mark.slow
def test_processes_and_dask_give_the_same_answer_as_one_process(folder, tmp_path):
    distributed = pytest.importorskip("dask.distributed", reason="Dask is an optional engine")
    rows = {}
    with distributed.LocalCluster(n_workers=1, threads_per_worker=1, dashboard_address=None) as cluster:
        for name, options in (
            ("one", ()),
            ("two", ("--jobs", 2)),
            ("dask", ("--scheduler", cluster.scheduler_address)),
        ):
            answer = run("--batch", folder / "missions", *world(folder), "--out", tmp_path / name, *options, code=1)
            rows[name] = [{k: v for k, v in row.items() if k != "cpu_s"} for row in answer["missions"]]
    assert rows["one"] == rows["two"] == rows["dask"]


def die(path, job):
    os._exit(9)


@pytest.mark.slow
def test_a_process_that_dies_is_one_missions_failure(folder, tmp_path):
    files = batch.mission_files(folder / "missions")[:2]
    with batch._executor(2, None) as pool:
        job = batch.Job(folder / "map", folder / "vehicle.toml", batch.planner.PlanOptions(), tmp_path)
        assert pool is not None
        pool.submit(die, None, None)
        rows = list(batch._planned(pool, files, job))
    assert sorted(row["status"] for row in rows) == ["planned", "planned"]


def test_an_address_without_a_scheduler_is_named():
    with pytest.raises(InputError, match="--scheduler nonsense: no Dask scheduler answers there"):
        batch._executor(1, "nonsense").__enter__()
