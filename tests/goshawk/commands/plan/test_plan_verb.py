"""`goshawk plan`: missions, yaw modes and batches."""

import fcntl
import itertools
import json
import os
import re
import shutil
import threading
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pyarrow.parquet as pq
import pytest

import esdf
import mapping
import vehicle
from esdf.visibility import Visibility, save_visibility
from flight import Waypoints, mission, project, trajectory
from flight.mission import Gate, Ground, KeepIn, Laps, LegJerk, Mission, Stay
from goshawk.commands.plan import batch, batch_mission
from goshawk.demo import chain
from mapping import confidence_layer, free_space
from mapping.dense import mesh_file
from mapping.dense.confidence import SurfaceConfidence
from planner import PlanOptions
from tests.goshawk.running import answer as goshawk
from tests.waiting import PATIENCE_S

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
    vehicle.save(folder / "vehicle.toml", chain.vehicles()[1])
    (folder / "missions").mkdir()
    for name, points in (("a", LOOP), ("b", LOOP[::-1]), ("inside", LOOP + np.array([1.2, 0.7, 0.2]))):
        project.save_waypoints(folder / "missions" / f"{name}.json", ask(points))
    (folder / "missions" / "torn.json").write_text("{")
    return folder


def ask(points: np.ndarray) -> Waypoints:
    return Waypoints(points, np.full(len(points), np.nan))


def world(folder: Path) -> tuple[object, ...]:
    return ("--map", folder / "map", "--vehicle", folder / "vehicle.toml")


def test_the_table_says_whether_the_optimiser_converged(folder, tmp_path):
    file = folder / "missions" / "a.json"
    found = run(file, *world(folder), "--out", tmp_path / "found.json")
    assert found["converged"] is True
    shown = goshawk("plan", file, *world(folder), "--starts", 2, "--out", tmp_path / "shown.json").stdout
    assert re.search(r"converged +yes \(residual \de-\d+ of the flight time; starts end within", shown)


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


def test_gates_and_a_tube_are_planned_and_checked_again_from_the_file(folder, tmp_path):
    asked = Mission(ask(LOOP), gates=(Gate(1, 0.6, 0.4, 0.5),), keep_in=KeepIn(1.0))
    mission.save(tmp_path / "m.json", asked)
    facts = run(tmp_path / "m.json", *world(folder), "--out", tmp_path / "flown.json")
    assert {"gates", "keep-in"} <= {check["name"] for check in facts["check"]["checks"]}
    answer = goshawk("check", tmp_path / "flown.json", *world(folder))
    assert answer.returncode == 0, answer.stderr
    assert "gates" in answer.stdout
    assert "keep-in" in answer.stdout
    document = json.loads((tmp_path / "flown.json").read_text())
    document["check"]["conditions"]["keep_in_radius_m"] = 0.06
    (tmp_path / "flown.json").write_text(json.dumps(document))
    assert goshawk("check", tmp_path / "flown.json", *world(folder)).returncode == 1


def test_jerk_is_limited_by_an_option_and_on_legs_shown_and_checked_again_from_the_file(folder, tmp_path):
    mission.save(tmp_path / "m.json", Mission(ask(LOOP), leg_jerks=(LegJerk(1, 2, 6.0),)))
    out = tmp_path / "flown.json"
    shown = goshawk("plan", tmp_path / "m.json", *world(folder), "--out", out, "--jerk", 20)
    assert shown.returncode == 0, shown.stderr
    for row, bound in (("jerk", 20), ("jerk of legs", 6)):
        found = re.search(rf"^ *{row} +([0-9.]+) of {bound} m/s3 *$", shown.stdout, re.MULTILINE)
        assert found, shown.stdout
        assert 0.95 * bound < float(found[1]) <= bound
    checked = json.loads(goshawk("check", out, *world(folder), "--json").stdout)
    assert checked["passed"]
    bounds = {check["name"]: check["bound"] for check in checked["checks"]}
    assert (bounds["jerk"], bounds["jerk of legs"]) == (20.0, 6.0)


def test_no_jerk_is_mentioned_where_none_is_limited_and_a_limit_far_away_changes_nothing(folder, tmp_path):
    file = folder / "missions" / "a.json"
    free = run(file, *world(folder), "--out", tmp_path / "free.json")
    far = run(file, *world(folder), "--out", tmp_path / "far.json", "--jerk", 1e30)
    assert far["check"]["trajectory_hash"] == free["check"]["trajectory_hash"]
    names = [[check["name"] for check in facts["check"]["checks"]] for facts in (free, far)]
    assert names[0] == [name for name in names[1] if name != "jerk"]
    assert "jerk" in names[1]
    shown = goshawk("plan", file, *world(folder), "--out", tmp_path / "shown.json").stdout
    assert "m/s3" not in shown


def test_more_jerk_than_the_vehicles_limit_is_refused_with_where_to_raise_it(folder, tmp_path):
    vehicle.save(tmp_path / "careful.toml", chain.vehicles()[1].with_limits(jerk_m_s3=30.0))
    call = ("--map", folder / "map", "--vehicle", tmp_path / "careful.toml", "--out", tmp_path / "out.json")
    ended = goshawk("plan", folder / "missions" / "a.json", *call, "--jerk", 31)
    assert ended.returncode == 2
    assert "--jerk 31 must be above 0 and at most 30 m/s3, the vehicle's limit; raise jerk_m_s3" in ended.stderr
    facts = run(folder / "missions" / "a.json", *call)
    assert next(check["bound"] for check in facts["check"]["checks"] if check["name"] == "jerk") == 30.0


def test_the_path_stays_within_the_tube_round_a_recorded_walk(folder, tmp_path):
    walk = np.concatenate([np.linspace(a, b, 40) for a, b in itertools.pairwise(LOOP)])
    rows = "\n".join(",".join(f"{x:.4f}" for x in point) for point in walk)
    (tmp_path / "walk.csv").write_text("x_m,y_m,z_m\n" + rows + "\n")
    call = ("--path", tmp_path / "walk.csv", *world(folder), "--out", tmp_path / "flown.json", "--keep-in", 0.9)
    run(*call)
    flown = trajectory.load(tmp_path / "flown.json").trajectory
    points = flown.position(flown.sample(0.01))
    nearest = np.linalg.norm(points[:, None] - walk, axis=2).min(axis=1)
    assert nearest.max() <= 0.9 + 0.06  # to the recorded points, which lie up to 12 cm apart
    for wrong in ("-1", "nan"):
        ended = goshawk("plan", *call[:-2], "--keep-in", wrong, "--overwrite")
        assert ended.returncode == 2
        assert "keep-in" in ended.stderr


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (("--yaw", "fixed"), "needs --heading"),
        (("--yaw", "smooth", "--heading", "10"), "contradict"),
        (("--heading", "10", "--look-at", "1", "2", "3"), "contradict"),
        (("--path", "x"), "give either WAYPOINTS or --path"),
    ],
)
def test_options_that_contradict_each_other_are_wrong_usage(folder, options, words):
    ended = goshawk("plan", folder / "missions" / "a.json", *world(folder), "--out", folder / "x.json", *options)
    assert ended.returncode == 2
    assert words in ended.stderr


def test_a_batch_plans_what_can_be_flown_and_says_why_the_rest_cannot(folder, tmp_path):
    ended = goshawk("plan", "batch", folder / "missions", *world(folder), "--out", tmp_path / "out", "--json")
    assert ended.returncode == 1
    where = tmp_path / "out" / "results.json"
    assert f"goshawk: 2 of 4 missions have no plan; {where} gives the reason of each" in ended.stderr.splitlines()[-1]
    rows = {row["name"]: row for row in json.loads(ended.stdout)["missions"]}
    assert [rows[name]["status"] for name in ("a", "b", "inside", "torn")] == ["planned"] * 2 + ["refused"] * 2
    assert "waypoint" in rows["inside"]["reason"]
    assert "JSON" in rows["torn"]["reason"]
    assert trajectory.load(batch_mission.trajectory_path(tmp_path / "out", "a")).checked
    table = pq.read_table(tmp_path / "out" / "results.parquet").to_pylist()
    assert table == json.loads(where.read_text())["missions"]


def test_a_batch_with_a_model_that_is_not_for_design_says_and_records_it(folder, tmp_path):
    missions, model = tmp_path / "missions", tmp_path / "marked.toml"
    missions.mkdir()
    (missions / "torn.json").write_text("{")
    fitted = vehicle.load(folder / "vehicle.toml").with_value("inertia_zz_kg_m2", 0.03, source="identified from a")
    vehicle.save(model, vehicle.purpose.marked(fitted, {"inertia_zz_kg_m2": ""}))
    asked = ("plan", "batch", missions, "--map", folder / "map", "--vehicle", model, "--out", tmp_path / "out")
    ended = goshawk(*asked)
    assert "the rotor margins rest on a model for prediction, not for design: inertia_zz_kg_m2" in ended.stderr
    written, printed = (tmp_path / "out" / "results.json").read_text(), goshawk(*asked, "--json").stdout
    assert json.loads(written)["not_for_design"] == json.loads(printed)["not_for_design"] == {"inertia_zz_kg_m2": ""}


def test_a_batch_goes_on_where_it_was_broken_off(folder, tmp_path, monkeypatch):
    out, planned = tmp_path / "out", []
    real = batch_mission.plan_one

    def broken_off(path, job):
        if len(planned) == 1:
            raise KeyboardInterrupt
        planned.append(path.stem)
        return real(path, job)

    monkeypatch.setattr(batch_mission, "plan_one", broken_off)
    assert goshawk("plan", "batch", folder / "missions", *world(folder), "--out", out).returncode == 130
    assert [row["name"] for row in json.loads((out / "results.json").read_text())["missions"]] == ["a"]
    with open(out / batch.JOURNAL, "a") as journal:
        journal.write('{"name": "b", "sta')  # and a crash in the middle of a line
    planned.append("")
    run("batch", folder / "missions", *world(folder), "--out", out, code=1)
    assert planned == ["a", "", "b", "inside", "torn"]
    answer = run("batch", folder / "missions", *world(folder), "--out", out, code=1)
    assert len(answer["missions"]) == 4
    assert len(planned) == 5  # nothing is planned twice
    ended = goshawk("plan", "batch", folder / "missions", *world(folder), "--out", out, "--margin", 0.1)
    assert ended.returncode == 2
    assert "results of other inputs" in ended.stderr


def die(path, job):
    os._exit(9)


@pytest.mark.slow
def test_a_process_that_dies_is_one_missions_failure(folder, tmp_path):
    files = batch.mission_files(folder / "missions")[:2]
    with batch._executor(2) as pool:
        job = batch_mission.Job(folder / "map", folder / "vehicle.toml", PlanOptions(), tmp_path)
        assert pool is not None
        pool.submit(die, None, None)
        rows = []
        batch._work_on_all(pool, files, job, rows.append)
    assert sorted(row["status"] for row in rows) == ["planned", "planned"]


def test_a_batch_does_not_take_a_changed_trajectory_for_its_own(folder, tmp_path):
    (tmp_path / "in").mkdir()
    os.symlink(folder / "missions" / "a.json", tmp_path / "in" / "a.json")
    call = ("batch", tmp_path / "in", *world(folder), "--out", tmp_path / "out")
    first = run(*call)
    path = batch_mission.trajectory_path(tmp_path / "out", "a")
    document = json.loads(path.read_text())
    document["segments"][0]["duration_s"] *= 0.5
    path.write_text(json.dumps(document))
    ended = goshawk("plan", *call)
    assert ended.returncode == 2
    assert "was changed since it was planned" in ended.stderr
    again = run(*call, "--overwrite")
    assert [row["trajectory_hash"] for row in again["missions"]] == [
        row["trajectory_hash"] for row in first["missions"]
    ]
    assert trajectory.load(path).as_checked


@pytest.mark.parametrize(
    "line",
    [
        '{"name": "a"}',
        '{"name": "a", "key": "x", "status": 3}',
        '{"name": ["a"], "status": "planned"}',
        '"a"',
        "5",
        "\x00\x00",
        b"\xff\xfe".decode("latin-1"),
    ],
)
def test_a_damaged_line_of_the_journal_is_passed_over(folder, tmp_path, line):
    row = batch_mission.row_of(Path("a.json"), "infeasible", "no way") | {"key": "of a"}
    job = batch_mission.Job(folder / "map", folder / "vehicle.toml", PlanOptions(), tmp_path)
    good = json.dumps(row).encode()
    (tmp_path / batch.JOURNAL).write_bytes(b"\n".join([good, line.encode("latin-1"), good[:-9]]))
    assert batch._done(job, {"a": "of a"}) == {"a": row}


def test_two_batches_do_not_write_to_one_folder(folder, tmp_path):
    call = ("batch", folder / "missions", *world(folder), "--out", tmp_path)
    with open(tmp_path / batch.JOURNAL, "a") as other:
        fcntl.flock(other, fcntl.LOCK_EX)
        ended = goshawk("plan", *call)
    assert ended.returncode == 2
    assert "another batch is writing to" in ended.stderr


def test_a_mission_that_changes_between_runs_or_during_one_is_noticed(folder, tmp_path, monkeypatch):
    file, out, real = tmp_path / "in" / "a.json", tmp_path / "out", batch_mission.plan_one
    file.parent.mkdir()
    call = ("batch", file.parent, *world(folder), "--out", out)

    def changed_meanwhile(path, job):
        row = real(path, job)
        project.save_waypoints(file, ask(LOOP[:3]))
        return row

    project.save_waypoints(file, ask(LOOP))
    with monkeypatch.context() as patch:
        patch.setattr(batch_mission, "plan_one", changed_meanwhile)
        (row,) = run(*call, code=1)["missions"]
    assert (row["status"], row["reason"]) == ("failed", "the mission's file was changed during the batch; run it again")
    assert not batch_mission.trajectory_path(out, "a").exists()
    assert run(*call)["missions"][0]["status"] == "planned"
    project.save_waypoints(file, ask(LOOP))
    ended = goshawk("plan", *call)
    assert ended.returncode == 2
    assert "results of other inputs (first: a)" in ended.stderr
    assert run(*call, "--overwrite")["missions"][0]["status"] == "planned"


def test_what_is_finished_after_ctrl_c_is_recorded_too():
    begun, interrupted, rows = threading.Event(), threading.Event(), []

    def work_on(path):
        if path.stem == "slow":
            begun.set()
            assert interrupted.wait(PATIENCE_S)
        else:
            assert begun.wait(PATIENCE_S)
        return {"name": path.stem}

    def record(row):
        rows.append(row["name"])
        if not interrupted.is_set():
            interrupted.set()
            raise KeyboardInterrupt

    job = cast("Any", SimpleNamespace(work_on=work_on))
    with ThreadPoolExecutor(2) as threads, pytest.raises(KeyboardInterrupt):
        batch._work_on_all(threads, [Path("slow.json"), Path("quick.json")], job, record)
    assert rows[0] == "quick"
    assert rows[-1] == "slow"


@pytest.fixture(scope="module")
def patchy(folder: Path, pillar_map: Path, tmp_path_factory) -> Path:
    """The same room, as images resolve it that show 20 mm everywhere but on the way between the pillars: 80 mm."""
    made = tmp_path_factory.mktemp("patchy")
    shutil.copytree(pillar_map, made / "map")
    grid = mapping.open_map(pillar_map).field.grid
    coarse = esdf.Grid(grid.origin_world_m, (0.2,) * 3, tuple(-(-n // 4) for n in grid.shape))
    finest = np.full(coarse.shape, 0.02, np.float32)
    x, y, _ = np.moveaxis(coarse.centres(), -1, 0)
    finest[(np.abs(x - 3.0) < 0.4) & (y < 2.4)] = 0.08
    save_visibility(made / "map" / "visibility.npz", Visibility(coarse, finest))
    shutil.copy(folder / "vehicle.toml", made)
    project.save_waypoints(made / "across.json", ask(np.array([[0.8, 0.8, 1.0], [5.2, 0.8, 1.0]])))
    return made


def test_a_plan_says_how_thin_an_obstacle_could_hide_and_keeps_out_of_that_space_when_asked(patchy, tmp_path):
    call = (patchy / "across.json", *world(patchy))
    straight = goshawk("plan", *call, "--out", tmp_path / "straight.json")
    assert straight.returncode == 0, straight.stderr
    assert "80 mm thick could hide" in straight.stdout
    assert "--thinnest 0.03" in straight.stderr
    round_it = run(*call, "--out", tmp_path / "round.json", "--thinnest", 0.03)
    assert round_it["could_hide"]["thickness_m"] == pytest.approx(0.02)
    assert round_it["could_hide"]["length_share"] == 0.0
    assert round_it["check"]["map_hash"] == mapping.open_map(patchy / "map").hash
    first = json.loads((tmp_path / "straight.json").read_text())["check"]["could_hide"]
    assert first["thickness_m"] == pytest.approx(0.08)
    assert 0.2 < first["length_share"] < 0.6
    assert round_it["duration_s"] > trajectory.load(tmp_path / "straight.json").trajectory.duration_s
    # What a plan was to rule out is asked again when it is checked, and of any other plan if --thinnest asks.
    for name, options, code in (("round", (), 0), ("straight", (), 0), ("straight", ("--thinnest", 0.03), 1)):
        checked = goshawk("check", tmp_path / f"{name}.json", *world(patchy), *options)
        assert checked.returncode == code, checked.stderr
        assert ("thinnest obstacle" in checked.stdout) == (name == "round" or bool(options))
        assert "could hide" in checked.stdout
    worse = mapping.open_map(patchy / "map").visibility()
    shutil.copytree(patchy / "map", tmp_path / "worse")
    save_visibility(tmp_path / "worse" / "visibility.npz", Visibility(worse.grid, np.full_like(worse.finest_m, 0.04)))
    again = goshawk("check", tmp_path / "round.json", "--map", tmp_path / "worse", *world(patchy)[2:])
    assert again.returncode == 1
    assert "thinnest obstacle" in again.stderr
    page = tmp_path / "round.html"
    assert goshawk("export", tmp_path / "round.json", "--report", page, *world(patchy)).returncode == 0
    assert "20 mm thick could hide" in page.read_text()


def test_a_price_on_hidden_space_buys_a_detour_and_the_plan_says_what_it_paid(patchy, tmp_path):
    call = (patchy / "across.json", *world(patchy))
    free = run(*call, "--out", tmp_path / "free.json")
    assert "hidden_price_paid_m" not in free
    low = run(*call, "--out", tmp_path / "low.json", "--hidden-price", 0.01)
    share = (0.08 - free_space.THRESHOLD_M) / (free_space.PLAIN_M - free_space.THRESHOLD_M)
    assert low["hidden_price_paid_m"] == pytest.approx(0.01 * share * 0.8, rel=0.3)  # 0.8 m of the way lead through it
    high = run(*call, "--out", tmp_path / "high.json", "--hidden-price", 20)
    assert high["hidden_price_paid_m"] < 0.1
    in_files = [json.loads((tmp_path / f"{name}.json").read_text())["check"] for name in ("free", "low", "high")]
    assert "hidden_price" not in in_files[0]
    assert [check["hidden_price"] for check in in_files[1:]] == [0.01, 20]
    assert in_files[1]["hidden_price_paid_m"] == low["hidden_price_paid_m"]
    assert goshawk("check", tmp_path / "low.json", *world(patchy), "--renew").returncode == 0
    renewed = trajectory.load(tmp_path / "low.json").check
    assert {name: renewed[name] for name in renewed if "hidden" in name} == {
        name: in_files[1][name] for name in in_files[1] if "hidden" in name
    }
    assert high["could_hide"]["length_share"] < low["could_hide"]["length_share"]
    assert goshawk("plan", *call, "--out", tmp_path / "x.json", "--hidden-price", 0).returncode == 2


def test_a_thinner_obstacle_asked_for_is_refused_where_nothing_resolves_it_and_wrong_units_at_once(patchy, tmp_path):
    call = ("plan", patchy / "across.json", *world(patchy), "--out", tmp_path / "x.json", "--thinnest")
    for thickness, code in ((0.01, 2), (30, 2), (-1, 2), ("nan", 2)):
        ended = goshawk(*call, thickness)
        assert ended.returncode == code, ended.stderr
        assert not (tmp_path / "x.json").exists()


def test_a_batch_plans_anew_for_another_price_of_hidden_space(patchy, tmp_path):
    (tmp_path / "missions").mkdir()
    shutil.copy(patchy / "across.json", tmp_path / "missions")
    call = ("batch", tmp_path / "missions", *world(patchy), "--out", tmp_path / "plans")
    for price in (None, 0.01, 20):
        asked = () if price is None else ("--hidden-price", price)
        if price is not None:
            assert "results of other inputs" in goshawk("plan", *call, *asked).stderr
        run(*call, *asked, "--overwrite")
        check = json.loads((tmp_path / "plans" / "trajectories" / "across.json").read_text())["check"]
        assert check.get("hidden_price") == price
        row = json.loads((tmp_path / "plans" / "results.json").read_text())["missions"][0]
        assert row["hidden_price_paid_m"] == check.get("hidden_price_paid_m")


def test_a_batch_tells_what_could_hide_near_each_plan(patchy, tmp_path):
    (tmp_path / "missions").mkdir()
    shutil.copy(patchy / "across.json", tmp_path / "missions")
    call = ("batch", tmp_path / "missions", *world(patchy))
    row = run(*call, "--out", tmp_path / "plain")["missions"][0]
    assert row["could_hide_m"] == pytest.approx(0.08)
    row = run(*call, "--out", tmp_path / "careful", "--thinnest", 0.03)["missions"][0]
    assert (row["could_hide_m"], row["could_hide_share"]) == (pytest.approx(0.02), 0.0)
    journal = tmp_path / "plain" / "journal.jsonl"
    written = json.loads(journal.read_text())
    journal.write_text(json.dumps({name: value for name, value in written.items() if "could_hide" not in name}) + "\n")
    again = run(*call, "--out", tmp_path / "plain")["missions"][0]  # as an earlier version left it: not planned again
    assert again["could_hide_share"] is None
    assert again["cpu_s"] == written["cpu_s"]


def test_a_damaged_record_of_what_was_to_be_ruled_out_is_refused(patchy, tmp_path):
    run(patchy / "across.json", *world(patchy), "--out", tmp_path / "x.json")
    document = json.loads((tmp_path / "x.json").read_text())
    for wrong in ("thin", -1.0, [0.03]):
        document["check"]["thinnest_m"] = wrong
        (tmp_path / "x.json").write_text(json.dumps(document))
        ended = goshawk("check", tmp_path / "x.json", *world(patchy))
        assert ended.returncode == 2
        assert "thinnest obstacle" in ended.stderr


def test_in_a_map_without_images_it_is_not_known_what_could_hide(patchy, tmp_path):
    shutil.copytree(patchy / "map", tmp_path / "map", ignore=shutil.ignore_patterns("visibility.npz"))
    (tmp_path / "map" / "poses.csv").write_text("image,time_s,x_m,y_m,z_m,qw,qx,qy,qz\n")
    call = ("plan", patchy / "across.json", "--map", tmp_path / "map", *world(patchy)[2:])
    ended = goshawk(*call, "--out", tmp_path / "x.json")
    assert ended.returncode == 0, ended.stderr
    assert "not known" in ended.stdout
    assert json.loads((tmp_path / "x.json").read_text())["check"]["could_hide"] is None
    for option in ("--thinnest", "--hidden-price"):
        refused = goshawk(*call, "--out", tmp_path / "y.json", option, 0.03)
        assert refused.returncode == 2
        assert "no images" in refused.stderr
        assert option in refused.stderr


def test_a_plan_says_how_well_the_surface_is_known_where_its_clearance_is_least(folder, tmp_path):
    """Vertices on a pillar beside the path, and some farther away that are known worse."""
    shutil.copytree(folder / "map", tmp_path / "map")
    angle = np.linspace(0.0, 2.0 * np.pi, 60)
    pillar = np.column_stack([4.0 + 0.35 * np.cos(angle), 2.6 + 0.35 * np.sin(angle), np.full(60, 1.3)])
    vertices = np.concatenate([pillar, pillar + np.array([0.0, 0.0, 40.0])])
    faces = np.array([[0, 1, 2]], np.int32)
    mesh_file.save(tmp_path / "map" / "mesh.ply", vertices, faces, np.full((120, 3), 90, np.uint8))
    known = SurfaceConfidence(np.repeat(np.float32([0.012, 0.05]), 60), np.repeat(np.uint8([9, 1]), 60))
    confidence_layer.save(tmp_path / "map" / "confidence.npz", known)
    project.save_waypoints(tmp_path / "asked.json", ask(np.array([[3.0, 1.6, 1.3], [5.2, 2.0, 1.3]])))
    where = ("--map", tmp_path / "map", "--vehicle", folder / "vehicle.toml")
    facts = run(tmp_path / "asked.json", *where, "--out", tmp_path / "flown.json")
    found = facts["nearest_surface"]
    assert found["deviation_m"] == pytest.approx(0.012, rel=1e-3)
    assert found["images"] == 9
    point = np.array(facts["check"]["clearance_point_world_m"])
    assert found["distance_m"] == pytest.approx(np.linalg.norm(vertices - point, axis=1).min())
    assert found["point_world_m"] == pytest.approx(vertices[np.linalg.norm(vertices - point, axis=1).argmin()])
    shown = " ".join(goshawk("plan", tmp_path / "asked.json", *where, "--out", tmp_path / "again.json").stdout.split())
    assert "from where the clearance is least, standard deviation 12 mm, measured by 9 images" in shown
    assert f"clearance {facts['clearance_m']:.2f} m, to the measured surface" in shown
    (tmp_path / "map" / "confidence.npz").unlink()
    shown = goshawk("plan", tmp_path / "asked.json", *where, "--out", tmp_path / "third.json").stdout
    assert "its standard deviation is not known" in " ".join(shown.split())
    assert "nearest_surface" not in run(tmp_path / "asked.json", *world(folder), "--out", tmp_path / "fourth.json")
