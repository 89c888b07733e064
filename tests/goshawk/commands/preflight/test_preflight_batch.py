"""`goshawk preflight batch`: plans, vehicles and winds; the same by any workers, and after a kill."""

import json
import os
import shutil
import signal
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import pyarrow.parquet as pq
import pytest

import preflight
import vehicle
from flight import InputError, file_format
from goshawk.commands.preflight import batch as verb
from goshawk.commands.preflight import case as work
from mapping.map_folder import REPORT_FORMAT, VERSION
from preflight import study
from tests import waiting
from tests.goshawk.dask_cluster import cluster
from tests.goshawk.running import answer

FLOWN = ("--flights", 24, "--risk", 0.2)


@pytest.fixture(scope="module")
def folder(pillar_map: Path, tmp_path_factory) -> Path:
    """Two vehicles, two plans for one of them and one for the other."""
    folder = tmp_path_factory.mktemp("preflights")
    os.symlink(pillar_map, folder / "map")
    vehicle.save(folder / "light.toml", vehicle.example())
    vehicle.save(folder / "heavy.toml", vehicle.example().with_value("mass_kg", 0.8))
    ways = {"a": "0.8,0.8,1.0\n1.0,3.0,1.3\n", "b": "1.0,3.0,1.3\n3.0,3.2,1.2\n"}
    for kind, names in (("light", "ab"), ("heavy", "a")):
        (folder / f"missions-{kind}").mkdir()
        for name in names:
            (folder / f"missions-{kind}" / f"{name}.csv").write_text(f"x,y,z\n{ways[name]}")
        ended = answer(
            "plan", "batch", folder / f"missions-{kind}", "--map", folder / "map", "--vehicle",
            folder / f"{kind}.toml", "--speed", 3, "--out", folder / f"plans-{kind}", "-q",
        )  # fmt: skip
        assert ended.returncode == 0, ended.stderr
    return folder


def call(folder: Path, out: Path, *options: object) -> tuple[object, ...]:
    vehicles = ("--vehicle", folder / "light.toml", "--vehicle", folder / "heavy.toml")
    plans = (folder / "plans-light", folder / "plans-heavy")
    return ("preflight", "batch", *plans, "--map", folder / "map", *vehicles, "--out", out, *FLOWN, *options)


def rows_of(out: Path) -> list[dict]:
    """The rows, without what differs from run to run."""
    rows = json.loads((out / "results.json").read_text())["preflights"]
    return [{name: cell for name, cell in row.items() if name != "cpu_s"} for row in rows]


def results(out: Path) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in (out / "preflights").iterdir()}


@pytest.fixture(scope="module")
def one(folder) -> Path:
    """Flown by this process, in two winds."""
    out = folder / "one"
    ended = answer(*call(folder, out, "--wind", 0, "--wind", "2,0,0"))
    assert ended.returncode == 0, ended.stderr
    assert "light" in ended.stdout
    return out


def test_every_plan_is_flown_for_its_vehicle_in_each_wind(one):
    rows = rows_of(one)
    assert [(row["plan"], row["vehicle"], row["wind"]) for row in rows] == [
        (plan, drone, wind)
        for plan, drone in (("a", "light"), ("b", "light"), ("a", "heavy"))
        for wind in ("0", "2,0,0")
    ]
    assert {row["status"] for row in rows} == {"go"}
    assert {row["flights"] for row in rows} == {24}
    table = pq.read_table(one / "results.parquet").to_pylist()
    assert [{name: cell for name, cell in row.items() if name != "cpu_s"} for row in table] == rows


def test_a_case_is_what_the_verb_alone_finds(folder, one, tmp_path):
    plan = folder / "plans-light" / "trajectories" / "b.json"
    world = ("--map", folder / "map", "--vehicle", folder / "light.toml")
    alone = answer("preflight", plan, *world, *FLOWN, "--wind", "2,0,0", "--out", tmp_path / "b.json", "-q")
    assert alone.returncode == 0, alone.stderr
    assert (tmp_path / "b.json").read_bytes() == results(one)["b_light_wind2_0_0.json"]


def test_what_is_flown_is_not_flown_again_and_other_options_are_refused(folder, one, monkeypatch):
    begun: list[str] = []
    real = work.fly_one

    def counted(case, job):
        begun.append(case.stem)
        return real(case, job)

    monkeypatch.setattr(work, "fly_one", counted)
    ended = answer(*call(folder, one, "--wind", 0, "--wind", "2,0,0"))
    assert (ended.returncode, begun) == (0, [])
    ended = answer(*call(folder, one, "--wind", 0, "--wind", "2,0,0", "--seed", 3))
    assert ended.returncode == 2
    assert "results of other inputs" in ended.stderr
    changed = one / "preflights" / "a_light_wind0.json"
    before = changed.read_bytes()
    changed.write_text("{}")
    ended = answer(*call(folder, one, "--wind", 0, "--wind", "2,0,0"))
    assert ended.returncode == 2
    assert "was changed since it was flown" in ended.stderr
    ended = answer(*call(folder, one, "--wind", 0, "--wind", "2,0,0", "--overwrite"))
    assert (ended.returncode, begun) == (0, ["a_light_wind0"])
    assert changed.read_bytes() == before


def test_what_cannot_be_flown_is_a_row_that_says_why(folder, tmp_path):
    (tmp_path / "plans").mkdir()
    (tmp_path / "plans" / "torn.json").write_text("{")
    os.symlink(folder / "plans-heavy" / "trajectories" / "a.json", tmp_path / "plans" / "a.json")
    ended = answer(
        "preflight", "batch", tmp_path / "plans", "--map", folder / "map", "--vehicle", folder / "light.toml", "--wind",
        40, "--wind", 0, "--out", tmp_path / "out", *FLOWN,
    )  # fmt: skip
    assert ended.returncode == 1
    assert "goshawk: 4 of 4 are no go" in ended.stderr
    reasons = [row["reason"] for row in rows_of(tmp_path / "out")]
    assert "was checked for vehicle" in reasons[0]
    assert "JSON" in reasons[2]


@pytest.mark.parametrize("when", ["while it flies", "while it is told what decides"])
def test_a_case_that_ctrl_c_cuts_off_is_no_row_and_is_flown_wholly_afterwards(folder, one, tmp_path, monkeypatch, when):
    fly, decide = preflight.fly, study.statistics.decomposable

    def pressed(*_: object) -> None:
        if len(begun) == 2:
            signal.raise_signal(signal.SIGINT)

    def after_the_first_batch(_: str, fraction: float) -> None:
        if 0.0 < fraction < 1.0:
            pressed()

    def flown(*arguments, **options):
        begun.append(1)
        told = {"progress": after_the_first_batch} if when == "while it flies" else {}
        return fly(*arguments, **options, **told)

    def told(*arguments):
        pressed()
        return decide(*arguments)

    begun: list[int] = []
    winds = ("--wind", 0, "--wind", "2,0,0")
    with monkeypatch.context() as patched:
        patched.setattr(study, "_BATCH", 4)
        patched.setattr(work.preflight, "fly", flown)
        if when != "while it flies":
            patched.setattr(study.statistics, "decomposable", told)
        ended = answer(*call(folder, tmp_path / "out", *winds))
    assert ended.returncode == 130, ended.stderr
    assert [row["name"] for row in rows_of(tmp_path / "out")] == ["a_light_wind0"]
    assert not (tmp_path / "out" / "preflights" / "a_light_wind2_0_0.json").exists()
    assert answer(*call(folder, tmp_path / "out", *winds)).returncode == 0
    assert rows_of(tmp_path / "out") == rows_of(one)
    assert results(tmp_path / "out") == results(one)


def test_a_map_that_says_another_scale_is_another_input(folder, tmp_path):
    shutil.copytree((folder / "map").resolve(), tmp_path / "map")
    options = preflight.Options(24, 0.2)
    before = work.Job(tmp_path / "map", options, tmp_path).inputs_hash()
    assert before == work.Job(tmp_path / "map", replace(options, threads=1), tmp_path).inputs_hash()
    said = {"scale_witnesses": [{"source": "length", "ratio": 1.0, "std": 0.03}]}
    file_format.write_json(tmp_path / "map" / "report.json", format=REPORT_FORMAT, version=VERSION, body=said)
    assert work.Job(tmp_path / "map", options, tmp_path).inputs_hash() != before


def test_plans_and_preflights_do_not_write_to_one_folder(folder, one):
    plans, world = folder / "plans-light", ("--map", folder / "map", "--vehicle", folder / "light.toml", "--overwrite")
    for out, arguments in (
        (plans, ("preflight", "batch", plans, *world, *FLOWN)),
        (one, ("plan", "batch", folder / "missions-light", *world)),
    ):
        before = (out / "results.json").read_bytes(), (out / "results.parquet").read_bytes()
        ended = answer(*arguments, "--out", out)
        assert ended.returncode == 2
        assert "give another --out" in ended.stderr
        assert ((out / "results.json").read_bytes(), (out / "results.parquet").read_bytes()) == before


def test_a_batch_in_which_nothing_could_be_planned_is_no_folder_of_plans(tmp_path):
    for name in ("journal.jsonl", "results.json"):
        (tmp_path / name).write_text("{}")
    with pytest.raises(InputError, match=r"a batch without a plan; its results\.json gives the reason"):
        work.cases_of([tmp_path], [], ["0"])


@pytest.mark.parametrize(
    ("killed", "said"),
    [
        (("results.json",), "cut off (it has no results.json): run its command again, or give"),
        (
            ("results.json", "trajectories/a.json", "trajectories/b.json"),
            "cut off (it has no results.json): run its co",
        ),
        ((), "cut off (its results.json does not tell of c.json): run its command again, or give"),
    ],
)
def test_a_batch_of_plans_that_was_killed_is_refused_with_the_way_out(folder, tmp_path, killed, said):
    """Without tables, without any plan, or with a plan that the tables of an earlier end do not hold."""
    plans = tmp_path / "plans"
    shutil.copytree(folder / "plans-light", plans)
    for name in killed:
        (plans / name).unlink()
    if not killed:
        shutil.copy(plans / "trajectories" / "a.json", plans / "trajectories" / "c.json")
    world = ("--map", folder / "map", "--vehicle", folder / "light.toml")
    ended = answer("preflight", "batch", plans, *world, *FLOWN, "--out", tmp_path / "out")
    assert ended.returncode == 2
    assert said in ended.stderr
    assert ("or give" in ended.stderr) == (plans / "trajectories" / "a.json").exists()
    if killed:  # the way out
        missions = folder / "missions-light"
        ended = answer("plan", "batch", missions, *world, "--speed", 3, "--out", plans, "-q")
        assert ended.returncode == 0, ended.stderr
    assert len(work.cases_of([plans if killed else plans / "trajectories"], [folder / "light.toml"], ["0"])) in (2, 3)


def test_a_vehicle_that_no_plan_was_checked_for_is_refused(folder):
    with pytest.raises(InputError, match=r"no plan was checked for .*heavy\.toml; leave it out"):
        work.cases_of([folder / "plans-light"], [folder / "light.toml", folder / "heavy.toml"], ["0"])


def test_sentences_of_a_batch_speak_of_preflights(folder, one):
    ended = answer(*call(folder, one, "--wind", 0, "--wind", "2,0,0", "--seed", 3))
    assert "plan, map, vehicle or options changed; give another --out" in ended.stderr
    assert "--overwrite to fly these again" in ended.stderr
    (case,) = work.cases_of([folder / "plans-heavy"], [folder / "heavy.toml"], ["0"])
    assert str(case) == f"{case.trajectory_file} or {case.vehicle_file}"


def test_a_model_that_is_not_for_design_is_marked(folder, tmp_path):
    drone = vehicle.load(folder / "heavy.toml")
    doubtful = {vehicle.purpose.KEY: {vehicle.purpose.EVERY: "few flights"}}
    vehicle.save(tmp_path / "heavy.toml", replace(drone, provenance=doubtful))
    world = ("--map", folder / "map", "--vehicle", tmp_path / "heavy.toml")
    ended = answer("preflight", "batch", folder / "plans-heavy", *world, "--out", tmp_path / "out", *FLOWN)
    assert "note: heavy.toml is a model for prediction, not for design" in ended.stderr


def test_losses_by_levels_are_not_counted_among_all_flights(folder, tmp_path):
    by_levels = preflight.Options(200, 0.1, rare=True)
    (tmp_path / "out").mkdir()
    (case,) = work.cases_of([folder / "plans-heavy"], [folder / "heavy.toml"], ["0"])
    row = work.fly_one(case, work.Job(folder / "map", by_levels, tmp_path / "out"))
    assert row["status"] == "go", row["reason"]
    assert row["lost"] is None
    assert verb._line(row)[4] == "by levels"


@pytest.mark.parametrize(
    ("plans", "options", "said"),
    [
        ("plans-light", ("--wind", "x"), "--wind"),
        ("map/esdf", (), "holds no plans"),
        ("none", (), "is not a folder of plans"),
        ("plans-light", ("--risk", 0), "no number of flights"),
    ],
)
def test_what_cannot_be_asked_is_refused_before_anything_is_flown(folder, tmp_path, plans, options, said):
    world = ("--map", folder / "map", "--vehicle", folder / "light.toml", "--out", tmp_path / "out")
    ended = answer("preflight", "batch", folder / plans, *world, *options)
    assert ended.returncode == 2, ended.stderr
    assert said in ended.stderr


def test_a_batch_that_is_killed_goes_on_and_is_the_same(folder, one, tmp_path):
    out = tmp_path / "out"
    line = [sys.executable, "-m", "goshawk", *map(str, call(folder, out, "--wind", 0, "--wind", "2,0,0"))]
    journal = out / "journal.jsonl"
    with subprocess.Popen(line, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL) as program:
        waiting.until(lambda: journal.is_file() and journal.read_bytes().count(b"\n") >= 2, "two cases")
        program.send_signal(signal.SIGKILL)
    done = journal.read_bytes().count(b"\n")
    assert answer(*call(folder, out, "--wind", 0, "--wind", "2,0,0")).returncode == 0
    assert journal.read_bytes().count(b'"name"') == 6, done
    assert rows_of(out) == rows_of(one)
    assert results(out) == results(one)


@pytest.mark.slow
def test_two_processes_fly_what_one_flies(folder, one, tmp_path):
    ended = answer(*call(folder, tmp_path / "two", "--wind", 0, "--wind", "2,0,0", "--jobs", 2))
    assert ended.returncode == 0, ended.stderr
    assert rows_of(tmp_path / "two") == rows_of(one)
    assert results(tmp_path / "two") == results(one)


def test_a_cluster_flies_what_one_process_flies(folder, one, tmp_path):
    pytest.importorskip("distributed", reason="Dask is an optional engine")
    (tmp_path / "dask").mkdir()
    with cluster(tmp_path / "dask", 1, "--no-nanny") as made:
        ended = answer(*call(folder, tmp_path / "out", "--wind", 0, "--wind", "2,0,0", "--scheduler", made.address))
    assert ended.returncode == 0, ended.stderr
    assert rows_of(tmp_path / "out") == rows_of(one)
    assert results(tmp_path / "out") == results(one)


def test_what_a_map_may_have_missed_and_an_effect_file_are_inputs(folder, tmp_path):
    """An edit "clear" over free voxels changes what may be hidden there, and no voxel's state."""
    shutil.copytree((folder / "map").resolve(), tmp_path / "map")
    job = work.Job(tmp_path / "map", preflight.Options(24, 0.2), tmp_path)
    before = job.inputs_hash()
    (tmp_path / "map" / "visibility.npz").write_bytes(b"of another recording")
    assert job.inputs_hash() != before
    own = (folder / "light.toml").read_text().replace("effect_files = []", 'effect_files = ["law.py"]')
    (tmp_path / "own.toml").write_text(own)
    case = work.Case(folder / "plans-light" / "a.json", tmp_path / "own.toml", "0")
    keys = set[str]()
    for factor in (1, 5):
        (tmp_path / "law.py").write_text(f"FACTOR = {factor}\n")
        keys.add(job.key_of(case))
    assert len(keys) == 2
