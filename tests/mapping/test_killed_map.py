"""`goshawk map` killed at a moment of every stage: the same command goes on, to the map of an undisturbed run."""

import os
import random
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

import esdf
import mapping
from esdf.solids import Sphere
from esdf.storage import EDITS
from flight import InputError
from goshawk.rendered import world as rendered_world
from mapping import map_folder, stages
from mapping.camera import rig as rigs
from tests.waiting import until

pytestmark = pytest.mark.slow

MOMENTS = (
    "checking images",
    "looking at the images",
    "finding features",
    "matching features",
    "placing images",
    "refining",
    "trying the calibration",
    "dense depth",
    "fuse depth",
    "distance field",
)
"""What a run reports that it is doing, in order."""


@pytest.fixture(scope="module")
def images(tmp_path_factory: pytest.TempPathFactory) -> Path:
    flight = rendered_world.loop_flight(12, share=0.2)
    rig = rendered_world.default_rig(0.5)
    return rendered_world.write_rendered_sequence(tmp_path_factory.mktemp("killed") / "images", rig=rig, flight=flight)


def started(images: Path, out: Path) -> "subprocess.Popen[str]":
    words = ["-m", "goshawk", "map", str(images), "--camera", str(images / "camera.toml"), "--out", str(out)]
    temporary = out.parent / "tmp"
    temporary.mkdir(exist_ok=True)
    return subprocess.Popen(
        [sys.executable, *words, "--voxel", "0.1"],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        env={**os.environ, "TMPDIR": str(temporary)},
    )


def finished(out: Path) -> dict[str, int]:
    """Inode of each finished stage's folder: another number means that the stage was made again."""
    folders = {name: map_folder.work_folder(out) / name for name in map_folder.STAGES}
    return {name: folder.stat().st_ino for name, folder in folders.items() if (folder / "inputs").is_file()}


def killed_at(moment: str, delay_s: float, images: Path, out: Path) -> None:
    """Start the map and kill it once it reports `moment`; its children must end as well."""
    with started(images, out) as run:
        assert run.stderr is not None
        said = ""
        for line in run.stderr:
            said += line
            if moment in line:
                break
        else:
            pytest.fail(f"it never came to {moment}: {said}")
        time.sleep(delay_s)
        children = Path(f"/proc/{run.pid}/task/{run.pid}/children").read_text().split()
        os.kill(run.pid, signal.SIGKILL)
    until(lambda: not any(Path(f"/proc/{child}").exists() for child in children), "the children's end")


@pytest.mark.parametrize("seed", [None, 1])
def test_a_map_that_is_killed_again_and_again_comes_out_the_same(
    images: Path, tmp_path: Path, seed: int | None
) -> None:
    """Without a seed killed as soon as each stage reports; with one up to a second later."""
    rng = random.Random(seed)
    out = tmp_path / "map"
    before: dict[str, int] = {}
    for moment in MOMENTS:
        killed_at(moment, 0.0 if seed is None else rng.random(), images, out)
        now = finished(out)
        assert {name: now.get(name) for name in before} == before
        before = now
    with started(images, out) as run:
        _, said = run.communicate()
    assert run.returncode == 0, said
    assert sorted(p.name for p in tmp_path.iterdir()) == ["map", "tmp"]
    assert not list((tmp_path / "tmp").iterdir())
    undisturbed = tmp_path / "other" / "map"
    undisturbed.parent.mkdir()
    with started(images, undisturbed) as run:
        run.communicate()
    a, b = mapping.open_map(out), mapping.open_map(undisturbed)
    assert a.hash == b.hash
    assert a.images == b.images
    assert a.facts == b.facts


def test_a_run_that_is_killed_after_it_placed_the_map_is_finished_by_the_next(
    images: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    rig, out = rigs.load(images / "camera.toml"), tmp_path / "map"

    def killed(work: stages.Work) -> None:
        raise KeyboardInterrupt

    with monkeypatch.context() as during:
        during.setattr(stages, "finish", killed)
        with pytest.raises(KeyboardInterrupt):
            mapping.build_map(images, rig, out)
    built = mapping.open_map(out).facts
    with pytest.raises(InputError, match="exists"):
        mapping.build_map(images, rig, out, mapping.MapOptions(cap_m=1.0))
    report = mapping.build_map(images, rig, out)
    assert report.hash == built["hash"]
    assert [p.name for p in tmp_path.iterdir()] == ["map"]
    with pytest.raises(InputError, match="exists"):
        mapping.build_map(images, rig, out)


KILLED_BETWEEN = """
import os, sys
from flight import results
from goshawk.cli import main
moved_beside = results._moved_beside

def killed(*places):
    moved_beside(*places)
    os._exit(9)

results._moved_beside = killed
main(sys.argv[1:])
"""


def test_a_kill_between_moving_the_old_map_aside_and_placing_the_new_keeps_the_edits(
    images: Path, tmp_path: Path
) -> None:
    rig, out = rigs.load(images / "camera.toml"), tmp_path / "map"
    coarse = mapping.MapOptions(dense=mapping.DenseOptions(voxel_m=0.11))
    mapping.build_map(images, rig, out, coarse)
    esdf.save_edits(out / "esdf" / EDITS, [esdf.Edit("add", Sphere((0.0, 0.0, 1.0), 0.5), "the pilot's")])
    words = ["map", str(images), "--camera", str(images / "camera.toml"), "--out", str(out), "--voxel", "0.1"]
    ended = subprocess.run([sys.executable, "-c", KILLED_BETWEEN, *words, "--overwrite"], check=False)
    assert ended.returncode == 9
    assert not out.exists()
    finer = mapping.MapOptions(dense=mapping.DenseOptions(voxel_m=0.1))
    mapping.build_map(images, rig, out, finer, overwrite=True)
    assert [edit.name for edit in esdf.load_edits(out / "esdf" / EDITS)] == ["the pilot's"]
    assert sorted(p.name for p in tmp_path.iterdir()) == ["map", "map.old-1"]
