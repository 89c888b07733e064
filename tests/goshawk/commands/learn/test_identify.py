"""`goshawk identify` as a user runs it: stages, trials, held and free names, report, JSON, gaps, Ctrl-C."""

import importlib.util
import json
import os
import signal
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import vehicle
from flight import FlightLog, flight_log
from goshawk.commands.learn import identify
from sysid.logs.check import LogReport
from sysid.logs.checks.finding import error, warning
from sysid.logs.events.repair import Repair
from tests.goshawk.running import run
from tests.waiting import PATIENCE_S

STAGES = ("vertical", "horizontal", "rotation")


@pytest.fixture(scope="module")
def folder(tmp_path_factory) -> Path:
    """Two trials of three short flights of the paper's vehicle, and a vehicle file that is somewhat wrong."""
    path = Path(__file__).parents[3] / "sysid" / "flying.py"
    spec = importlib.util.spec_from_file_location("identify_test_flying", path)
    flying = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = flying
    spec.loader.exec_module(flying)
    folder = tmp_path_factory.mktemp("identify")
    rng = np.random.default_rng(8)
    logs = flying.fly(flying.Truth(), flying.paper_flights(rng, 2, 0.1), 6, duration_s=6.0, rng=rng, rate_hz=100.0)
    for i, log in enumerate(logs):
        flight_log.save(folder / f"trial{i // 3 + 1}-{STAGES[i % 3]}.parquet", log)
    believed = vehicle.example("rigter2019").with_value("inertia_xx_kg_m2", 0.004)
    vehicle.save(folder / "vehicle.toml", believed)
    return folder


def first_trial(folder: Path) -> list[Path]:
    return [folder / f"trial1-{stage}.parquet" for stage in STAGES]


def base_of(folder: Path, out: Path) -> list[object]:
    return ["identify", *first_trial(folder), "--vehicle", folder / "vehicle.toml", "--out", out / "f.toml"]


def test_a_copy_of_a_flight_on_another_clock_is_refused_before_the_fit(folder, tmp_path):
    log = flight_log.load(first_trial(folder)[0])
    flight_log.save(tmp_path / "late.parquet", FlightLog({**log.columns, "time_s": log.time_s + 7.0}, log.metadata))
    for given in ((tmp_path / "late.parquet",), ("--held-out", tmp_path / "late.parquet")):
        assert "hold the same flight" in run(*base_of(folder, tmp_path), *given, code=2)


def test_report_and_json_are_written(folder, tmp_path):
    base = ("identify", *first_trial(folder)[1:], "--vehicle", folder / "vehicle.toml", "--out", tmp_path / "f.toml")
    said = run(*base, "--report", tmp_path / "r.html")
    assert "inertia_xx_kg_m2" in said
    document = json.loads(run(*base, "--overwrite", "--json"))  # what the first call kept
    assert document["schema"] == "goshawk-identification"
    found = document["parameters"]["inertia_xx_kg_m2"]
    assert set(found) >= {"value", "unit", "std", "std_robust", "status", "information"}
    assert found["value"] == pytest.approx(0.00306, rel=0.02)
    assert found["status"] == "free"
    assert sum(found["information"]) == pytest.approx(1.0)
    assert document["parameters"]["mass_kg"]["status"] == "held"
    assert document["converged"]
    assert document["iterations"]
    assert set(document["residuals"]) >= {"F_x", "M_z", "position", "attitude"}
    assert {log["worst"] for log in document["logs"].values()} == {"fine"}
    assert vehicle.load(tmp_path / "f.toml").value("inertia_xx_kg_m2") == found["value"]
    page = (tmp_path / "r.html").read_text()
    assert page.count("data:image/svg+xml") == 3 + 2 * 2  # parameters, convergence, correlation; two of each flight
    assert "src='http" not in page


def test_held_free_and_prior_names(folder, tmp_path):
    base = (*base_of(folder, tmp_path), "--overwrite")
    document = json.loads(run(*base, "--hold", "inertia_*", "--hold", "pose_sensor_rotation_x_rad", "--json"))
    status = {name: p["status"] for name, p in document["parameters"].items()}
    assert {status[f"inertia_{axis}_kg_m2"] for axis in ("xx", "yy", "zz")} == {"held"}
    assert status["pose_sensor_rotation_x_rad"] == "held"
    document = json.loads(run(*base, "--free", "thrust_bem", "--free", "centre_of_mass.x_m", "--json"))
    free = {name for name in document["free"] if not name.startswith("pose_sensor")}
    assert free == {"thrust_bem.k1_n_s2", "thrust_bem.k2_n_s2_m", "centre_of_mass.x_m"}
    document = json.loads(run(*base, "--prior", "inertia_xx_kg_m2=1e-9", "--json"))
    assert document["parameters"]["inertia_xx_kg_m2"]["value"] == pytest.approx(0.004, rel=1e-3)
    assert "no parameter 'wings'" in run(*base, "--hold", "wings", code=2)
    assert "NAME=STD" in run(*base, "--prior", "inertia_xx_kg_m2", code=2)


def test_three_stages(folder, tmp_path):
    flights = [argument for stage in STAGES for argument in (f"--{stage}", folder / f"trial1-{stage}.parquet")]
    base = ("--vehicle", folder / "vehicle.toml", "--out", tmp_path / "f.toml", "--overwrite")
    said = run("identify", *flights, *base, "--hold-unidentifiable", "--json")
    document = json.loads(said)
    assert document["schema"] == "goshawk-identification-stages"
    assert tuple(document["stages"]) == STAGES
    assert "thrust_bem.k1_n_s2" in document["stages"]["vertical"]["free"]
    assert "inertia_xx_kg_m2" in document["stages"]["rotation"]["free"]
    assert "horizontal" in run("identify", *flights[:2], *base, code=2)
    assert "FLIGHTS" in run("identify", *first_trial(folder), *flights, *base, code=2)
    assert "FLIGHTS" in run("identify", *base, code=2)


def test_repeated_trials_are_drawn(folder, tmp_path):
    flights = sorted(folder.glob("trial*-rotation.parquet"))
    files = ("--out", tmp_path / "f.toml", "--plots", tmp_path / "p")
    base = ("--vehicle", folder / "vehicle.toml", *files, "--hold-unidentifiable")
    document = json.loads(run("identify", *flights, "--trials", 2, *base, "--json"))
    assert len(document["trials"]) == 2
    names = {path.name for path in (tmp_path / "p").iterdir()}
    assert names >= {"parameters.svg", "convergence.svg", "correlation.svg", "overlay_2.svg", "residuals_1.svg"}
    assert "inertia_xx_kg_m2" in (tmp_path / "p" / "repeated.svg").read_text()
    assert "equally many" in run("identify", *flights, "--trials", 3, *base, "--overwrite", code=2)


def test_a_gap_is_refused_with_the_option_of_the_command(folder, tmp_path):
    log = flight_log.load(first_trial(folder)[2])
    keep = (log.time_s < 4.0) | (log.time_s > 4.5)
    flight_log.save(tmp_path / "gap.parquet", FlightLog({k: v[keep] for k, v in log.columns.items()}, log.metadata))
    base = ("identify", tmp_path / "gap.parquet", "--vehicle", folder / "vehicle.toml", "--out", tmp_path / "f.toml")
    said = run(*base, code=2)
    assert "--split-gaps" in said
    assert "gaps=" not in said
    assert not (tmp_path / "f.toml").exists()
    document = json.loads(run(*base, "--split-gaps", "--hold-unidentifiable", "--json"))
    assert len(document["flights"]) == 2


def test_ctrl_c_leaves_the_earlier_results_and_nothing_else(folder, tmp_path):
    out = tmp_path / "out"
    out.mkdir()
    (out / "f.toml").write_text("earlier")
    flights = [str(path) for path in sorted(folder.glob("trial*.parquet"))]
    files = ["--out", str(out / "f.toml"), "--report", str(out / "r.html")]
    command = [sys.executable, "-m", "goshawk", "identify", *flights, "--vehicle", str(folder / "vehicle.toml"), *files]
    command.append("--overwrite")
    process = subprocess.Popen(command, stderr=subprocess.PIPE, text=True, start_new_session=True)
    assert process.stderr is not None
    assert any("identify" in line for line in process.stderr), "the fit never began"
    os.kill(process.pid, signal.SIGINT)
    said = process.stderr.read()
    process.stderr.close()
    assert process.wait(timeout=PATIENCE_S) == 130
    assert "nothing half-written" in said
    assert [path.name for path in out.iterdir()] == ["f.toml"]
    assert (out / "f.toml").read_text() == "earlier"


def test_into_a_vehicle_file_a_fit_is_its_next_version_and_undo_returns(folder, tmp_path):
    mine = tmp_path / "vehicle.toml"
    mine.write_bytes((folder / "vehicle.toml").read_bytes())
    run("vehicle", "effect", "add", mine, "flapping_moment")
    with_effect = mine.read_bytes()
    words = ("identify", *first_trial(folder), "--vehicle", folder / "vehicle.toml", "--out", mine)
    assert "--overwrite" in run(*words, code=2)
    assert mine.read_bytes() == with_effect
    said = run(*words, "--overwrite")
    assert said.startswith("verdict: usable\n")
    steps = json.loads(run("vehicle", "history", mine, "--json"))["steps"]
    assert [step["action"] for step in steps] == ["start", "add-effect", "identify"]
    run("vehicle", "undo", mine, "--yes")
    assert mine.read_bytes() == with_effect
    run("vehicle", "undo", mine, "--yes")
    assert mine.read_bytes() == (folder / "vehicle.toml").read_bytes()


def test_the_model_of_another_vehicle_gets_a_warning(folder):
    vehicle.save(folder / "hummingbird.toml", vehicle.example("hummingbird"))
    words = ("compare", first_trial(folder)[2], "--vehicle", folder / "vehicle.toml")
    assert json.loads(run(*words, "--json"))["remarks"] == []
    remarks = json.loads(run(*words, "--vehicle", folder / "hummingbird.toml", "--json"))["remarks"]
    assert [remark for remark in remarks if remark.startswith("hummingbird leaves")]
    assert all("hummingbird" in remark for remark in remarks)


@pytest.mark.parametrize(
    ("found", "offered"),
    [
        (error("rotor order", "s", "f", repair=Repair("rotor order", (), order=(2, 1, 3, 0))), True),
        (error("rotor order", "s", "f"), False),  # no change of the log that was tried mends it
        (error("frozen", "s", "f", repair=Repair("blank", ())), False),  # the fit leaves that out by itself
        (warning("clock", "s", "f", repair=Repair("shift", ())), False),
    ],
)
def test_for_a_log_that_was_misread_the_command_that_mends_it_is_offered(found, offered):
    logs = {"my a.csv": LogReport("my a.csv", 9.0, 100.0, (found,))}
    mended = "goshawk log fix 'my a.csv' --columns c.toml --vehicle v.toml --out NEW.parquet"
    assert identify._mends(logs, Path("v.toml"), Path("c.toml")) == ([mended] if offered else [])
