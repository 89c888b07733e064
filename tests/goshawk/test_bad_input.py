"""Bad input as a stranger meets it: one sentence, an exit code that is not 0, earlier results as they were."""

import hashlib
import json
import os
import shutil
import signal
import subprocess
import sys
import threading
from pathlib import Path

import numpy as np
import pytest

import vehicle
from flight import FlightLog, flight_log
from goshawk.rendered.world import default_rig, loop_flight, write_rendered_sequence
from tests.goshawk.running import answer
from tests.waiting import PATIENCE_S
from tests.waiting import goshawk as program

PROGRAM = [sys.executable, "-m", "goshawk"]


def refused(*arguments: object, code: int = 2) -> str:
    """Run `goshawk`, see that it refuses in one sentence, and return that.

    Mapping runs as a program of its own: what its libraries write past Python must be nothing, too.
    """
    ended = (program if arguments[0] == "map" else answer)(*arguments)
    said = [line for line in ended.stderr.splitlines() if line.strip() and not line.startswith("  [")]
    assert ended.returncode == code, ended.stderr
    assert len(said) == 1, ended.stderr
    assert said[0].startswith("goshawk: ")
    return said[0]


def hashes(folder: Path) -> dict[str, str]:
    files = sorted(p for p in folder.rglob("*") if p.is_file())
    return {str(p.relative_to(folder)): hashlib.sha256(p.read_bytes()).hexdigest() for p in files}


@pytest.fixture(scope="module")
def images(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("rendered") / "images"
    return write_rendered_sequence(folder, rig=default_rig(0.4), flight=loop_flight(10, share=0.2))


@pytest.fixture
def earlier(tmp_path: Path) -> Path:
    """What counts as an earlier map: whatever is in it must stay."""
    folder = tmp_path / "out" / "map"
    folder.mkdir(parents=True)
    (folder / "map.toml").write_text('format = "goshawk-map"\nversion = 1\n')
    (folder / "poses.csv").write_text("precious")
    return folder


def test_one_broken_image_is_named_and_the_earlier_map_stays(images: Path, earlier: Path, tmp_path: Path):
    shutil.copytree(images, tmp_path / "broken")
    broken = tmp_path / "broken" / "front" / "0004.png"
    broken.write_bytes(broken.read_bytes()[:3000])
    before = hashes(earlier)
    words = ("map", "build", tmp_path / "broken", "--camera", images / "camera.toml", "--out", earlier)
    assert "--overwrite" in refused(*words)
    assert "front/0004.png" in refused(*words, "--overwrite")
    assert hashes(earlier) == before


def test_an_output_that_is_no_map_is_refused(images: Path, tmp_path: Path):
    precious = tmp_path / "folder" / "precious.txt"
    precious.parent.mkdir()
    precious.write_text("precious")
    for out in (precious, precious.parent):
        assert str(out) in refused("map", "build", images, "--camera", images / "camera.toml", "--out", out)
    assert precious.read_text() == "precious"


def test_a_camera_file_of_wrong_types_is_refused(images: Path, tmp_path: Path):
    (tmp_path / "camera.toml").write_text('format = "goshawk-camera"\nversion = 1\ncamera = [3]\n')
    assert "[[camera]]" in refused(
        "map", "build", images, "--camera", tmp_path / "camera.toml", "--out", tmp_path / "map"
    )


def test_wrong_usage_is_one_sentence(images: Path):
    assert "--out" in refused("map", "build", images, "--camera", images / "camera.toml")


@pytest.mark.parametrize(
    "stage", ["finding features", pytest.param("placing images", marks=pytest.mark.slow), "dense depth"]
)
def test_ctrl_c_leaves_the_earlier_map_and_nothing_else(images: Path, earlier: Path, tmp_path: Path, stage: str):
    before = hashes(earlier)
    code, said, _ = interrupted(images, earlier, tmp_path / "tmp", stage)
    assert code == 130
    assert said[-1].startswith("goshawk: stopped")
    assert hashes(earlier) == before
    assert {p.name for p in earlier.parent.iterdir()} == {"map", "map.work"}  # finished stages, for the next try
    assert not list((tmp_path / "tmp").iterdir())


@pytest.mark.skipif(not Path("/proc/self/task").is_dir(), reason="finds the child process through /proc")
def test_a_crash_of_the_child_is_a_sentence(images: Path, earlier: Path, tmp_path: Path):
    before = hashes(earlier)
    code, said, child = interrupted(images, earlier, tmp_path / "tmp", "placing images", crash_child=True)
    assert code == 1
    assert said[-1].startswith("goshawk: ")
    assert "crashed (SIGABRT)" in said[-1]
    assert not Path(f"/proc/{child}").exists()
    assert hashes(earlier) == before
    assert not list((tmp_path / "tmp").iterdir())


def interrupted(
    images: Path, out: Path, temporary: Path, stage: str, *, crash_child: bool = False
) -> tuple[int, list[str], int]:
    """Interrupt `goshawk map` (or abort its child) at a stage: exit code, words after it, process id."""
    temporary.mkdir()
    arguments = ["map", "build", str(images), "--camera", str(images / "camera.toml"), "--out", str(out), "--overwrite"]
    process = subprocess.Popen(
        [*PROGRAM, *arguments],
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        text=True,
        env={**os.environ, "TMPDIR": str(temporary)},
        start_new_session=True,
    )
    assert process.stderr is not None
    patience = threading.Timer(PATIENCE_S, process.kill)
    patience.daemon = True
    patience.start()
    assert any(stage in line for line in process.stderr), f"never came to {stage}"
    victim = process.pid
    if crash_child:
        victim = next(int(pid) for pid in children(process.pid) if b"mapping.child" in command_line(pid))
    os.kill(victim, signal.SIGABRT if crash_child else signal.SIGINT)
    said = process.stderr.read().splitlines()
    patience.cancel()
    process.stderr.close()
    return process.wait(timeout=PATIENCE_S), said, victim


def children(pid: int) -> list[str]:
    return [c for task in Path(f"/proc/{pid}/task").iterdir() for c in (task / "children").read_text().split()]


def command_line(pid: str) -> bytes:
    return Path(f"/proc/{pid}/cmdline").read_bytes()


def test_a_lost_link_ends_with_exit_code_1(tmp_path: Path):
    key = tmp_path / "link.key"
    key.write_text("5a" * 32)
    key.chmod(0o600)
    words = refused("fly", "--out", tmp_path / "f.parquet", "--url", "udp://127.0.0.1:9", "--key", key, code=1)
    assert "no vehicle answers" in words
    assert not (tmp_path / "f.parquet").exists()


def test_an_impossible_port_is_refused(tmp_path: Path):
    assert "--port" in refused("gcs", tmp_path, "--port", 99999)


@pytest.mark.parametrize("header", ['{"format"', "[1]", '{"format": "goshawk-flight-log"}'])
def test_a_damaged_log_is_named(tmp_path: Path, header: str):
    from pyarrow import parquet

    path = tmp_path / "flight.parquet"
    flight_log.save(path, FlightLog({"time_s": np.arange(3.0)}, {}))
    parquet.write_table(parquet.read_table(path).replace_schema_metadata({"goshawk": header}), path)
    assert str(path) in refused("log", "show", path)


def test_a_missing_map_and_a_cut_off_trajectory_are_named(tmp_path: Path):
    (tmp_path / "cut.json").write_text(json.dumps({"format": "goshawk-trajectory", "version": 1})[:20])
    vehicle.save(tmp_path / "v.toml", vehicle.example())
    rest = ("--map", tmp_path / "none", "--vehicle", tmp_path / "v.toml")
    assert "cut.json" in refused("check", tmp_path / "cut.json", *rest)
    assert "not a map" in refused("plan", tmp_path / "w.json", *rest, "--out", tmp_path / "t.json")
