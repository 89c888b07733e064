"""`goshawk map build` killed at moments of every stage: the same command goes on, to the map of an undisturbed run."""

import contextlib
import os
import shutil
import signal
import subprocess
import sys
from collections.abc import Iterable
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

KILLED_AT = """
import os, signal, sys
from collections import Counter
from goshawk.terminal import console
from goshawk.cli import main

FILES = ("open", "os.rename", "os.mkdir", "os.remove", "os.rmdir", "os.link", "shutil.rmtree")
within, steps, last, at = sys.argv[1], sys.argv[2].split(","), sys.argv[3], int(sys.argv[4])
step, reached, late = "start", Counter(), set(steps[steps.index(last) + 1 :]) if last else set()
report = console._LinePerStage.__call__

def moment():
    reached[step] += 1
    if step in late or (step == last and reached[step] > at):
        os.kill(os.getpid(), signal.SIGKILL)

def at_a_report(line, name, fraction):
    global step
    step = name
    moment()
    report(line, name, fraction)

def at_a_file(event, arguments):
    if event in FILES and isinstance(arguments[0], (str, os.PathLike)):
        if os.fspath(arguments[0]).startswith(within):
            moment()

console._LinePerStage.__call__ = at_a_report
sys.addaudithook(at_a_file)
try:
    main(sys.argv[5:])
finally:
    os.write(1, ",".join(f"{name}={count}" for name, count in reached.items()).encode())
"""
"""Runs `goshawk`, and kills it at a moment: a report of progress, or just before something is done to a file."""
EACH = 6
"""Moments of each step, spread evenly over all that it has."""


@pytest.fixture(scope="module")
def images(tmp_path_factory: pytest.TempPathFactory) -> Path:
    flight = rendered_world.loop_flight(8, share=0.14)
    rig = rendered_world.default_rig(0.4)
    return rendered_world.write_rendered_sequence(tmp_path_factory.mktemp("killed") / "images", rig=rig, flight=flight)


def run(images: Path, out: Path, steps: Iterable[str] = (), last: str = "", at: int = 0) -> dict[str, int]:
    """Make the map; with `last` kill the process at that step's moment `at`, or at the first one after it.

    Returns:
        How many moments each step had, in order; nothing if it was killed.
    """
    temporary = out.parent / "tmp"
    temporary.mkdir(exist_ok=True)
    words = ["map", "build", images, "--camera", images / "camera.toml", "--out", out, "--voxel", "0.1"]
    ended = subprocess.run(
        [sys.executable, "-c", KILLED_AT, str(out.parent), ",".join(steps), last, str(at), *map(str, words)],
        capture_output=True,
        text=True,
        check=False,
        env={**os.environ, "TMPDIR": str(temporary)},
    )
    until(lambda: not running_on(out), "the children's end")
    assert not list(temporary.iterdir())
    assert ended.returncode == (-signal.SIGKILL if last else 0), ended.stderr
    if last:
        return {}
    counts = (part.split("=") for part in ended.stdout.splitlines()[-1].split(","))
    return {step: int(count) for step, count in counts}


def running_on(out: Path) -> list[Path]:
    """Processes with the map's name in their command line."""
    found = []
    for process in Path("/proc").glob("[0-9]*"):
        with contextlib.suppress(OSError):  # it has ended
            if os.fsencode(out) in (process / "cmdline").read_bytes():
                found.append(process)
    return found


def finished(out: Path) -> dict[str, int]:
    """Inode of each finished stage's folder: another number means that the stage was made again."""
    folders = {name: map_folder.work_folder(out) / name for name in map_folder.STAGES}
    return {name: folder.stat().st_ino for name, folder in folders.items() if (folder / "inputs").is_file()}


def names(folder: Path) -> set[str]:
    return {path.name for path in folder.iterdir()}


def test_a_map_that_is_killed_at_fifty_moments_comes_out_the_same(images: Path, tmp_path: Path) -> None:
    """Each run but those of the last step goes on where the one before was killed; no finished stage is made again."""
    undisturbed, out, kept = tmp_path / "undisturbed" / "map", tmp_path / "killed" / "map", tmp_path / "kept"
    undisturbed.parent.mkdir()
    out.parent.mkdir()
    steps = run(images, undisturbed)
    *earlier, final = steps
    wanted = mapping.open_map(undisturbed)
    moments = {step: sorted({int((k + 0.5) * steps[step] / EACH) for k in range(EACH)}) for step in steps}
    assert sum(map(len, moments.values())) >= 50
    before: dict[str, int] = {}
    for step in earlier:
        for at in moments[step]:
            run(images, out, steps, step, at)
            now = finished(out)
            assert {name: now.get(name) for name in before} == before
            assert names(out.parent) <= {"map.work", "tmp"}
            before = now
    shutil.copytree(map_folder.work_folder(out), kept)
    for at in moments[final]:  # from here on the map may be in its place
        run(images, out, steps, final, at)
        assert names(out.parent) <= {"map", "map.work", "tmp"}
        run(images, out)
        assert names(out.parent) == {"map", "tmp"}
        made = mapping.open_map(out)
        assert (made.hash, made.images, made.facts) == (wanted.hash, wanted.images, wanted.facts)
        shutil.rmtree(out)
        shutil.copytree(kept, map_folder.work_folder(out))


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
    words = ["map", "build", str(images), "--camera", str(images / "camera.toml"), "--out", str(out), "--voxel", "0.1"]
    ended = subprocess.run([sys.executable, "-c", KILLED_BETWEEN, *words, "--overwrite"], check=False)
    assert ended.returncode == 9
    assert not out.exists()
    finer = mapping.MapOptions(dense=mapping.DenseOptions(voxel_m=0.1))
    mapping.build_map(images, rig, out, finer, overwrite=True)
    assert [edit.name for edit in esdf.load_edits(out / "esdf" / EDITS)] == ["the pilot's"]
    assert sorted(p.name for p in tmp_path.iterdir()) == ["map", "map.old-1"]
