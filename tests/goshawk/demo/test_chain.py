"""Plan, check, upload, fly, identify, compare: the verbs as a user runs them, on a mapped room with two pillars."""

import json
import os
from pathlib import Path

import numpy as np
import pytest

import vehicle
from firmware_bridge.airborne import in_the_air
from flight import Waypoints, flight_log, project, trajectory
from goshawk.demo import chain
from goshawk.demo.sitl_process import sitl_vehicle
from tests.goshawk.running import answer as goshawk

LOOP = np.array([[0.8, 0.8, 1.0], [3.0, 2.0, 1.3], [5.2, 0.8, 1.0], [5.0, 3.4, 1.6], [1.0, 3.2, 1.2], [0.8, 0.8, 1.0]])


def run(*arguments: object, code: int = 0) -> dict:
    """Run a verb with --json and read what it says."""
    answer = goshawk(*arguments, "--json")
    assert answer.returncode == code, answer.stderr
    assert "Traceback" not in answer.stderr
    return json.loads(answer.stdout)


@pytest.fixture(scope="module")
def folder(pillar_map: Path, tmp_path_factory) -> Path:
    """A project folder with map, vehicle files, waypoints and a planned loop."""
    folder = tmp_path_factory.mktemp("chain")
    os.symlink(pillar_map, folder / "map")
    truth, believed = chain.vehicles()
    vehicle.save(folder / "truth.toml", truth)
    vehicle.save(folder / "vehicle.toml", believed)
    project.save_waypoints(folder / "loop-waypoints.json", Waypoints(LOOP, np.full(len(LOOP), np.nan)))
    run("plan", folder / "loop-waypoints.json", *world(folder), "--out", folder / "loop.json")
    return folder


def world(folder: Path) -> tuple[object, ...]:
    return ("--map", folder / "map", "--vehicle", folder / "vehicle.toml")


def test_a_planned_file_is_checked_and_passes_the_gate_again(folder):
    item = trajectory.load(folder / "loop.json")
    assert item.checked
    report = run("check", folder / "loop.json", *world(folder))
    assert report["passed"]
    assert report["clearance_m"] >= 0.3


def test_the_gate_refuses_more_clearance_than_there_is(folder):
    report = run("check", folder / "loop.json", *world(folder), "--margin", "0.9", code=1)
    assert not report["passed"]
    assert any(not c["passed"] and c["name"] == "clearance" for c in report["checks"])


def test_the_gate_refuses_a_trajectory_for_another_vehicle(folder):
    report = run("check", folder / "loop.json", "--map", folder / "map", "--vehicle", folder / "truth.toml", code=1)
    assert "vehicle" in [c["name"] for c in report["checks"] if not c["passed"]]


def test_a_recorded_path_is_planned_along(folder):
    s = np.linspace(0.0, 1.0, 60)[:, None]
    path = np.array([0.8, 0.8, 1.0]) * (1 - s) + np.array([0.8, 3.2, 1.4]) * s
    rows = "\n".join(f"{x},{y},{z}" for x, y, z in path)
    (folder / "walk.csv").write_text(f"x_m,y_m,z_m\n{rows}\n")
    facts = run("plan", "--path", folder / "walk.csv", *world(folder), "--out", folder / "walk.json")
    assert facts["waypoints"] == 2
    assert facts["clearance_m"] >= 0.3


@pytest.mark.parametrize(
    ("waypoints", "code", "words"),
    [
        ([[0.8, 0.8, 1.0], [2.0, 1.5, 1.2]], 2, "waypoint 2"),
        ([[0.8, 0.8, 1.0], [80.0, 1.5, 1.2]], 2, "waypoint 2"),
        ([[0.8, 0.8, 1.0], [None, 1.5, 1.2]], 2, "waypoint"),
        ([[0.8, 0.8, 1.0]], 2, "waypoint"),
    ],
)
def test_a_bad_waypoint_is_named_and_the_old_file_stays(folder, tmp_path, waypoints, code, words):
    points = [{"position_world_m": p, "yaw_rad": None} for p in waypoints]
    document = {"format": "goshawk-waypoints", "version": 1, "waypoints": points}
    (tmp_path / "w.json").write_text(json.dumps(document))
    out = tmp_path / "out.json"
    out.write_text("earlier")
    error = run("plan", tmp_path / "w.json", *world(folder), "--out", out, "--overwrite", code=code)["error"]
    assert words in error["message"]
    assert out.read_text() == "earlier"


@pytest.fixture(scope="module")
def flown(folder: Path) -> Path:
    """The loop flown in the SITL vehicle by the verbs."""
    key = folder / "link.key"
    options = ("--vehicle", folder / "truth.toml", "--believed", folder / "vehicle.toml")
    start = ("--start-of", folder / "loop.json", "--time-factor", 0)
    with sitl_vehicle(*options, *start, key_file=key) as url:
        link = ("--url", url, "--key", key)
        sent = run("upload", folder / "loop.json", *link, *world(folder))
        assert sent["read_back_equal"]
        facts = run("fly", "--trajectory", folder / "loop.json", "--out", folder / "loop.parquet", *link)
    assert facts["tracking_worst_m"] < 0.25
    assert "slowed" in facts
    return folder / "loop.parquet"


def test_the_flown_loop_is_logged_with_rotor_speeds(flown):
    document = run("log", "show", flown)
    assert document["gaps"] == 0
    assert run("log", "check", flown)["check"]["worst"] != "error"
    assert document["rate_hz"] == pytest.approx(200.0, rel=0.01)
    assert document["columns"]["rotor_speed_0_rad_s"]["missing"] == 0


def test_a_trajectory_for_another_map_is_not_uploaded(folder, flown, tmp_path):
    item = trajectory.load(folder / "loop.json")
    from dataclasses import replace

    trajectory.save(tmp_path / "other.json", replace(item, map_hash="0" * 64))
    trajectory.save(tmp_path / "unchecked.json", replace(item, check={}))
    key = folder / "link.key"
    with sitl_vehicle("--vehicle", folder / "truth.toml", key_file=key) as url:
        link = ("--url", url, "--key", key)
        refused = run("upload", tmp_path / "other.json", *link, *world(folder), code=2)
        assert "map" in refused["error"]["message"]
        assert "final gate" in run("upload", tmp_path / "unchecked.json", *link, code=2)["error"]["message"]


def test_a_lost_link_is_reported_in_one_sentence(folder, flown):
    link = ("--url", "udp://127.0.0.1:9", "--key", folder / "link.key")
    error = run("upload", folder / "loop.json", *link, code=1)["error"]
    assert error["kind"] == "LinkError"


@pytest.mark.slow  # test_model_verbs.py holds the same law on a shorter flight
def test_adding_rotor_drag_lowers_the_prediction_error(folder, flown, tmp_path):
    """The same flight fits and judges here (speed); the demo judges on a held-out one."""
    fit = ("identify", flown, "--vehicle", folder / "vehicle.toml", "--hold-unidentifiable")
    run(*fit, "--out", tmp_path / "without.toml")
    found = run(
        *fit, "--add-effect", "rotor_drag_thrust", "--out", tmp_path / "with.toml", "--plots", tmp_path / "figures"
    )
    drag = found["parameters"]["rotor_drag_thrust.drag_s_m"]
    assert abs(drag["value"] - 0.0175) < 5 * drag["std_robust"] + 2e-4
    assert found["figures"]
    compared = run(
        "compare",
        flown,
        "--vehicle",
        tmp_path / "without.toml",
        "--vehicle",
        tmp_path / "with.toml",
        "--plots",
        tmp_path / "compared",
    )
    error = {name: model["error_rms"]["position_m"] for name, model in compared["models"].items()}
    assert error["with"][-1] < error["without"][-1]
    assert all(Path(figure).stat().st_size > 1000 for figure in compared["figures"])


def test_a_log_with_a_gap_or_without_rotor_speed_is_refused_with_the_reason(folder, flown, tmp_path):
    log = in_the_air(flight_log.load(flown), "loop")
    keep = (log.time_s < log.time_s[300]) | (log.time_s > log.time_s[500])
    gap = flight_log.FlightLog({name: values[keep] for name, values in log.columns.items()}, log.metadata)
    flight_log.save(tmp_path / "gap.parquet", gap)
    blind = {name: values for name, values in log.columns.items() if not name.startswith("rotor_speed")}
    flight_log.save(tmp_path / "blind.parquet", flight_log.FlightLog(blind, log.metadata))
    base = ("--vehicle", folder / "vehicle.toml", "--out", tmp_path / "out.toml")
    assert "gap" in run("identify", tmp_path / "gap.parquet", *base, code=2)["error"]["message"]
    assert "rotor_speed" in run("identify", tmp_path / "blind.parquet", *base, code=2)["error"]["message"]
    assert not (tmp_path / "out.toml").exists()
