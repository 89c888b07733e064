"""Finished stages survive a killed process; a changed input makes exactly what depends on it again; two never share."""

import contextlib
import errno
import os
import shutil
import signal
import subprocess
import sys
from importlib import metadata
from pathlib import Path

import numpy as np
import pytest

from flight import InputError
from mapping import stages
from mapping.dense import depth_files
from mapping.dense.stereo import DepthImage

SLOW_WORK = """
import sys, time
from pathlib import Path
from mapping import stages

def first(folder): (folder / "a").write_text("whole")
def second(folder):
    (folder / "b").write_text("half")
    print("in the middle", flush=True)
    time.sleep(60)

with stages.begin(Path(sys.argv[1])) as work:
    work = work.on("inputs")
    work.stage("first", first)
    work.on("more").stage("second", second)
"""


def count(made: list[str], name: str):
    def make(folder: Path) -> None:
        made.append(name)
        (folder / "result").write_text(name)

    return make


def test_a_finished_stage_is_not_made_again(tmp_path: Path) -> None:
    made: list[str] = []
    for _ in range(2):
        with stages.begin(tmp_path / "w") as work:
            first = work.on("a").stage("first", count(made, "first"))
            assert (first / "result").read_text() == "first"
    assert made == ["first"]


def begun(folder: Path, option: int, *, again: tuple[str, ...] = (), ends: bool = False) -> list[str]:
    """What an interrupted stage of many tasks finds of an earlier try; it leaves one more, or ends."""
    found: list[str] = []

    def make(part: Path) -> None:
        tasks = work.on(option).tasks("many")
        found.extend(sorted(file.name for file in tasks.iterdir() if file.name != "inputs"))
        (tasks / str(len(found))).touch()
        if not ends:
            raise KeyboardInterrupt

    with contextlib.suppress(KeyboardInterrupt), stages.begin(folder, again=again) as work:
        work.on(option).stage("many", make)
        assert not (folder / "many.tasks").exists()
    return found


def test_what_was_done_of_an_interrupted_stage_is_found_again_if_its_inputs_are_the_same(tmp_path: Path) -> None:
    assert begun(tmp_path / "w", 1) == []
    assert begun(tmp_path / "w", 1) == ["0"]
    assert begun(tmp_path / "w", 2) == []
    assert begun(tmp_path / "w", 2) == ["0"]
    assert begun(tmp_path / "w", 2, again=("many",)) == []
    assert begun(tmp_path / "w", 2, ends=True) == ["0"]
    assert begun(tmp_path / "w", 3) == []


@pytest.mark.parametrize("library", ["pycolmap", "open3d-cpu", "scipy"])
def test_another_version_of_a_library_makes_every_stage_again(library: str, monkeypatch: pytest.MonkeyPatch) -> None:
    version = metadata.version
    before = stages.program()
    monkeypatch.setattr(metadata, "version", lambda name: "0" if name == library else version(name))
    stages.program.cache_clear()
    assert stages.program() != before
    monkeypatch.undo()
    stages.program.cache_clear()
    assert stages.program() == before


def test_a_changed_input_makes_what_depends_on_it_again(tmp_path: Path) -> None:
    made: list[str] = []
    for option in (1, 2):
        with stages.begin(tmp_path / "w") as work:
            work.on("images").stage("first", count(made, "first"))
            work.on("images").on(option).stage("second", count(made, "second"))
    assert made == ["first", "second", "second"]


def test_inputs_do_not_run_together(tmp_path: Path) -> None:
    with stages.begin(tmp_path / "w") as work:
        assert work.on(b"ab", b"c").depends != work.on(b"a", b"bc").depends
        assert work.on("a").on("b").depends != work.on("b").on("a").depends


def test_a_failed_stage_leaves_nothing_that_counts(tmp_path: Path) -> None:
    made: list[str] = []

    def fail(folder: Path) -> None:
        (folder / "half").write_text("x")
        raise InputError("no")

    with pytest.raises(InputError), stages.begin(tmp_path / "w") as work:
        work.stage("first", fail)
    assert stages.finished(tmp_path / "w", ["first"]) == []
    with stages.begin(tmp_path / "w") as work:
        place = work.stage("first", count(made, "first"))
        assert not (place / "half").exists()
        stages.finish(work)
    assert not (tmp_path / "w").exists()


def test_a_killed_process_loses_only_the_stage_it_was_in(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(stages, "_PATIENCE_S", 0.3)
    words = [sys.executable, "-c", SLOW_WORK, str(tmp_path / "w")]
    with subprocess.Popen(words, stdout=subprocess.PIPE, text=True) as child:
        assert child.stdout is not None
        assert child.stdout.readline() == "in the middle\n"
        with pytest.raises(InputError, match="another process is at work"), stages.begin(tmp_path / "w"):
            pass
        os.kill(child.pid, signal.SIGKILL)
    assert stages.finished(tmp_path / "w", ["first", "second"]) == ["first"]
    made: list[str] = []
    with stages.begin(tmp_path / "w") as work:
        work = work.on("inputs")
        assert (work.stage("first", count(made, "first")) / "a").read_text() == "whole"
        second = work.on("more").stage("second", count(made, "second"))
    assert made == ["second"]
    assert sorted(p.name for p in second.iterdir()) == ["inputs", "result"]


@pytest.mark.parametrize("damage", ["cut off", "removed", "inputs"])
def test_a_stage_whose_file_was_damaged_since_is_made_again(tmp_path: Path, damage: str) -> None:
    made: list[str] = []
    for _ in range(2):
        with stages.begin(tmp_path / "w") as work:
            result = work.stage("first", count(made, "first")) / "result"
            (result.parent / "result-wal").touch()  # SQLite leaves such a file when its reader is killed
    assert made == ["first"]
    match damage:
        case "cut off":
            result.write_text("fir")
        case "removed":
            result.unlink()
        case _:
            (result.parent / "inputs").write_bytes(b"\xff\x00")
    with stages.begin(tmp_path / "w") as work:
        assert (work.stage("first", count(made, "first")) / "result").read_text() == "first"
    assert made == ["first", "first"]


def test_a_finished_work_leaves_nothing_and_may_be_waited_for(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    folder, unlink = tmp_path / "w", Path.unlink

    def taken_at_once(path: Path) -> None:
        unlink(path)
        if path.name == "lock":
            path.write_text("")

    with stages.begin(folder) as work:
        (folder / "notes.txt").write_text("dropped here")
        stages.finish(work)
    assert not folder.exists()
    with stages.begin(folder) as work:
        monkeypatch.setattr(Path, "unlink", taken_at_once)
        stages.finish(work)


def test_a_run_that_stops_as_asked_does_not_blame_a_full_disk(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    nothing_left = shutil.disk_usage(tmp_path)._replace(free=8192)
    monkeypatch.setattr(shutil, "disk_usage", lambda _: nothing_left)
    with pytest.raises(stages.StoppedError), stages.begin(tmp_path / "w", until="first") as work:
        work.stage("first", count([], "first"))


def test_depth_images_survive_their_files(tmp_path: Path) -> None:
    rng = np.random.default_rng(0)
    four = [rng.random((6, 8), dtype=np.float32) for _ in range(4)]
    depth = DepthImage(*four, 0.5)
    depth_files.write(tmp_path, iter([None, depth]))
    back = depth_files.DepthFiles(tmp_path)
    assert len(back) == 2
    assert back[0] is None
    again = back[1]
    assert again is not None
    assert again.scale == 0.5
    for name in ("inverse_range", "deviation", "facing", "bound"):
        np.testing.assert_array_equal(getattr(again, name), getattr(depth, name))
    assert list(back)[1] is not None


def test_a_folder_of_someone_else_is_not_taken_over(tmp_path: Path) -> None:
    mine = tmp_path / "map.work" / "notes.txt"
    mine.parent.mkdir()
    mine.write_text("keep")
    with pytest.raises(InputError, match="not of an earlier run"), stages.begin(mine.parent):
        pass
    assert mine.read_text() == "keep"


def test_a_child_process_that_may_still_write_holds_the_lock(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(stages, "_PATIENCE_S", 0.3)
    with stages.begin(tmp_path / "w") as work:
        assert work.lock is not None
        child = subprocess.Popen([sys.executable, "-c", "import time; time.sleep(60)"], pass_fds=(work.lock,))
    with pytest.raises(InputError, match="another process is at work"), stages.begin(tmp_path / "w"):
        pass
    child.kill()
    child.wait()
    with stages.begin(tmp_path / "w"):
        pass


def test_the_lock_of_a_folder_that_was_removed_is_nobodys(tmp_path: Path) -> None:
    with stages.begin(tmp_path / "w") as work, open(tmp_path / "w" / "lock") as waiting:
        stages.finish(work)
        assert not stages._taken(waiting.fileno(), tmp_path / "w" / "lock")
    with stages.begin(tmp_path / "w"):
        assert not stages._taken(os.open(tmp_path / "w" / "lock", os.O_RDONLY), tmp_path / "w" / "lock")


def test_another_version_of_the_program_makes_every_stage_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    made: list[str] = []
    for version in (b"1", b"1", b"2"):
        monkeypatch.setattr(stages, "program", lambda version=version: version)
        with stages.begin(tmp_path / "w") as work:
            work.stage("first", count(made, "first"))
    assert made == ["first", "first"]


def test_stages_are_made_again_where_asked_and_no_further_than_asked(tmp_path: Path) -> None:
    made: list[str] = []
    for again, until in (((), "first"), ((), None), (("second",), None)):
        with contextlib.suppress(stages.StoppedError), stages.begin(tmp_path / "w", again=again, until=until) as work:
            for name in ("first", "second"):
                work.stage(name, count(made, name))
    assert made == ["first", "second", "second"]


def test_what_a_killed_run_left_half_made_is_removed(tmp_path: Path) -> None:
    made: list[str] = []
    with stages.begin(tmp_path / "w") as work:
        work.stage("first", count(made, "first"))
        (tmp_path / "w" / "second.part").mkdir()
        (tmp_path / "w" / "goshawk-1234").mkdir()
    with stages.begin(tmp_path / "w"):
        assert sorted(p.name for p in (tmp_path / "w").iterdir()) == ["first", "lock"]


def test_a_full_disk_is_named_and_loses_only_the_stage_at_hand(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A disk that is really full would need the rights to mount one; that run is in docs/evidence/performance.md."""

    def fill(folder: Path) -> None:
        (folder / "half").write_text("x")
        raise OSError(errno.ENOSPC, "No space left on device")

    def two_stages() -> None:
        with stages.begin(tmp_path / "w") as work:
            work.stage("first", count([], "first"))
            work.stage("second", fill)

    nothing_left = shutil.disk_usage(tmp_path)._replace(free=8192)
    monkeypatch.setattr(shutil, "disk_usage", lambda _: nothing_left)
    with pytest.raises(InputError, match="no space is left on the disk"):
        two_stages()
    assert sorted(p.name for p in (tmp_path / "w").iterdir()) == ["first", "lock"]
