"""`params`, `upload`, `fly` and `log` as programs, against a SITL vehicle that is a program too; Ctrl-C included."""

import json
import re
import signal
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

import firmware_bridge
import vehicle
from firmware_bridge import controller
from firmware_bridge.controller import State
from flight import Trajectory, TrajectoryFile, flight_log, trajectory
from goshawk.demo.sitl_process import sitl_vehicle
from tests.waiting import PATIENCE_S, until
from tests.waiting import goshawk as program


def goshawk(*arguments: object, code: int = 0) -> subprocess.CompletedProcess[str]:
    answer = program(*arguments)
    assert answer.returncode == code, answer.stderr
    assert "Traceback" not in answer.stderr
    return answer


@pytest.fixture(scope="module")
def folder(tmp_path_factory) -> Path:
    """A vehicle file, and two checked trajectories: twelve hops at 1 m height, and 200."""
    folder = tmp_path_factory.mktemp("verbs")
    vehicle.save(folder / "vehicle.toml", vehicle.example("rigter2019"))
    for name, segments in (("hops", 12), ("many", 200)):
        save_hops(folder / f"{name}.json", segments)
    return folder


def save_hops(path: Path, segments: int) -> None:
    rng = np.random.default_rng(segments)
    pieces, here = np.zeros((segments, 4, 8)), np.array([0.0, 0.0, 1.0, 0.0])
    for piece in pieces:
        there = np.array([*rng.uniform(-0.4, 0.4, 2), 1.0, 0.0])
        piece[:, 0] = here
        piece[:, 4:] = (there - here)[:, None] * np.array([35.0, -84.0, 70.0, -20.0]) / 1.2 ** np.arange(4, 8)
        here = there
    curve = Trajectory(np.full(segments, 1.2), pieces)
    check = {"passed": True, "trajectory_hash": trajectory.fingerprint(curve)}
    trajectory.save(path, trajectory.sealed(TrajectoryFile(curve, path.stem, "", "", np.zeros((2, 3)), check)))


@pytest.fixture
def link(folder: Path) -> Iterator[tuple[object, ...]]:
    """Options that reach a SITL vehicle on the floor."""
    key = folder / "link.key"
    with sitl_vehicle("--vehicle", folder / "vehicle.toml", "--time-factor", 2, key_file=key) as url:
        yield ("--url", url, "--key", key)


@pytest.fixture(scope="module")
def standing(folder: Path) -> Iterator[tuple[object, ...]]:
    """The same for the tests that change nothing, which share it."""
    with sitl_vehicle("--vehicle", folder / "vehicle.toml", key_file=folder / "link.key") as url:
        yield ("--url", url, "--key", folder / "link.key")


def parameters(link: tuple[object, ...]) -> dict[str, float]:
    with firmware_bridge.connect(str(link[1]), key=Path(str(link[3])), system_id=200) as station:
        return {name: float(str(np.float32(value))) for name, value in station.parameters().items()}


def test_parameters_are_listed_read_and_set_after_showing_what_changes(link):
    before = parameters(link)
    assert list(before) == list(controller.PARAMETERS)
    assert before["mass_kg"] == 0.7  # as written, not 0.699999988
    assert "only disarmed" in goshawk("params", "list", *link).stdout
    assert json.loads(goshawk("params", "list", "--json", *link).stdout) == before
    read = goshawk("params", "get", "mass_kg", "kp_z_1_s2", "--json", *link).stdout
    assert json.loads(read) == {"mass_kg": 0.7, "kp_z_1_s2": before["kp_z_1_s2"]}
    looked = goshawk("params", "set", "mass_kg=0.72", "kp_xy_1_s2=8", "--dry-run", *link)
    assert "nothing was changed" in looked.stderr
    assert "0.72" in looked.stdout
    assert parameters(link) == before
    unasked = goshawk("params", "set", "mass_kg=0.72", *link, code=2)
    assert "--yes" in unasked.stderr
    assert parameters(link) == before
    done = goshawk("params", "set", "mass_kg=0.72", "kp_xy_1_s2=8", "--yes", *link)
    assert "confirmed by checksum: 2 parameters" in done.stderr
    assert parameters(link) == before | {"mass_kg": 0.72, "kp_xy_1_s2": 8.0}
    again = goshawk("params", "set", "mass_kg=0.72", *link)
    assert "no change: the vehicle has these values" in again.stderr


def test_parameters_follow_a_vehicle_file_and_single_values_override_it(link, folder, tmp_path):
    heavier = vehicle.load(folder / "vehicle.toml").with_value("mass_kg", 0.81)
    vehicle.save(tmp_path / "heavier.toml", heavier)
    answer = goshawk("params", "set", "--vehicle", tmp_path / "heavier.toml", "kp_xy_1_s2=8", "--yes", "--json", *link)
    document = json.loads(answer.stdout)
    assert document["set"]
    assert document["changes"]["mass_kg"] == {"before": 0.7, "after": 0.81, "unit": "kg"}
    assert document["changes"]["kp_xy_1_s2"]["after"] == 8.0
    assert parameters(link)["mass_kg"] == 0.81
    once_more = goshawk("params", "set", "--vehicle", tmp_path / "heavier.toml", "--json", *link)
    assert not json.loads(once_more.stdout)["set"]


def test_a_model_for_prediction_is_flown_with_only_where_its_mark_is_accepted(link, folder, tmp_path):
    fitted = vehicle.load(folder / "vehicle.toml").with_value("mass_kg", 0.74, std=0.01, source="identified from lap")
    file = tmp_path / "marked.toml"
    vehicle.save(file, vehicle.purpose.marked(fitted, {"mass_kg": ""}))
    before = parameters(link)
    refused = goshawk("params", "set", "--vehicle", file, "--yes", *link, code=2)
    assert "for prediction, not for design: mass_kg" in refused.stderr
    assert "--accept-mark" in refused.stderr
    assert parameters(link) == before
    done = goshawk("params", "set", "--vehicle", file, "--accept-mark", "--yes", *link)
    assert "for prediction, not for design" in done.stderr
    assert parameters(link)["mass_kg"] == 0.74


@pytest.mark.parametrize(
    ("arguments", "code", "words"),
    [
        (["set", "masss=1"], 2, "no parameter 'masss'"),
        (["set", "mass_kg=heavy"], 2, "is not NAME=VALUE with a number"),
        (["set", "mass_kg=nan"], 2, "it must be 0.01 to 50"),
        (["set", "kp_z_1_s2=-5"], 2, "it must be 0 to 100"),
        (["set"], 2, "nothing to set"),
        (["get", "masss"], 2, "did you mean mass_kg"),
        (["set", "mass_kg=40", "kp_z_1_s2=1", "--yes"], 1, "rotors cannot carry the mass; nothing was changed"),
    ],
)
def test_a_refused_set_names_its_reason_and_changes_nothing(standing, arguments, code, words):
    before = parameters(standing)
    assert words in goshawk("params", *arguments, *standing, code=code).stderr
    assert parameters(standing) == before


def until_said(process: subprocess.Popen[str], words: str) -> None:
    """Read the program's stderr until it says so."""
    assert process.stderr is not None
    for line in process.stderr:
        if words in line:
            return
    raise AssertionError(f"it ended ({process.wait()}) without saying {words!r}")


def start(*arguments: object) -> subprocess.Popen[str]:
    command = [sys.executable, "-m", "goshawk", *map(str, arguments)]
    return subprocess.Popen(command, stderr=subprocess.PIPE, stdout=subprocess.DEVNULL, text=True)


def mission(watcher: firmware_bridge.Link) -> State | None:
    return None if watcher.state is None else watcher.state.mission


def test_ctrl_c_in_flight_lands_the_vehicle_and_writes_its_log(link, folder, tmp_path):
    goshawk("upload", folder / "hops.json", *link)
    url, key = link[1], link[3]
    with firmware_bridge.connect(str(url), key=Path(str(key)), system_id=200) as watcher:
        flying = start("fly", "--out", tmp_path / "flight.parquet", *link)
        until(lambda: mission(watcher) is State.TRAJECTORY or flying.poll() is not None, "the trajectory")
        flying.send_signal(signal.SIGINT)
        said = flying.communicate(timeout=PATIENCE_S)[1]
        assert flying.returncode == 130, said
        assert "flight cancelled; the vehicle brakes along its path and lands" in said
        assert "wrote the log as far as it goes" in said
        until(lambda: mission(watcher) in (State.ARMED, State.DISARMED), "the landing")
        assert watcher.state is not None
        assert watcher.state.position_world_m[2] < 0.1
    goshawk("log", "download", "--out", tmp_path / "fetched.parquet", *link)
    for name in ("flight", "fetched"):
        flown = set(flight_log.load(tmp_path / f"{name}.parquet").columns["mission_state"])
        assert {State.TRAJECTORY, State.ABORTING, State.LANDING} <= flown
        assert State.FAULT not in flown


def test_a_flight_that_wind_slowed_down_says_how_far_and_why(folder, tmp_path):
    save_hops(tmp_path / "hops.json", 3)
    wind = ("--wind", "9,0,0", "--observer", "off")  # steady: whether gusts end the flight depends on when it starts
    with sitl_vehicle(
        "--vehicle", folder / "vehicle.toml", "--time-factor", 0, *wind, key_file=folder / "link.key"
    ) as url:
        link = ("--url", url, "--key", folder / "link.key")
        goshawk("upload", tmp_path / "hops.json", *link)
        said = goshawk("fly", "--out", tmp_path / "flight.parquet", *link).stdout
    assert re.search(r"note: slowed by its tracking error, to \d+% of the planned speed", said)


def test_ctrl_c_during_an_upload_names_the_active_trajectory(folder):
    key = folder / "link.key"
    with sitl_vehicle("--vehicle", folder / "vehicle.toml", "--delay", 0.15, "--loss", 0.3, key_file=key) as url:
        link = ("--url", url, "--key", key)
        sending = start("upload", folder / "many.json", *link)
        until_said(sending, "] upload")
        sending.send_signal(signal.SIGINT)
        said = sending.communicate(timeout=PATIENCE_S)[1]
    assert sending.returncode == 130
    assert "upload cancelled; the vehicle holds no plan" in said


def test_a_log_that_the_vehicle_does_not_have_is_refused(standing, tmp_path):
    answer = goshawk("log", "download", "--out", tmp_path / "none.parquet", *standing, code=1)
    assert "the vehicle has no log of a flight" in answer.stderr
    assert not (tmp_path / "none.parquet").exists()
