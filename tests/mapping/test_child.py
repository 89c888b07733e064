"""A crash in the child is a message in the parent; an interrupt in the parent is the end of the child."""

import os
import pickle
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from flight import InputError, MapError, Progress
from mapping import child
from tests.waiting import until

HERE = Path(__file__).parent


def _work(name: str):
    """Functions of this file, importable in the child."""
    import importlib.util
    import sys

    if "child_work" not in sys.modules:
        sys.path.insert(0, str(HERE))
        spec = importlib.util.find_spec("child_work")
        assert spec is not None
        importlib.import_module("child_work")
    return getattr(sys.modules["child_work"], name)


def test_answer_and_progress_come_back() -> None:
    reports: list[tuple[str, float]] = []
    answer = child.run(_work("add"), 2, 3, progress=lambda stage, fraction: reports.append((stage, fraction)))
    assert answer == 5
    assert reports == [("adding", 0.5), ("adding", 1.0)]


def test_abort_names_the_step_and_the_signal() -> None:
    with pytest.raises(MapError, match=r"matching features crashed \(SIGABRT\)"):
        child.run(_work("abort"))


def test_a_segmentation_fault_gives_a_crash_message() -> None:
    with pytest.raises(MapError, match=r"placing images crashed \(SIGSEGV\)"):
        child.run(_work("segfault"))


def test_a_damaged_heap_gives_a_crash_message() -> None:
    """The C library aborts while it holds the heap: whoever allocates in answer to that waits for ever."""
    with pytest.raises(MapError, match=r"placing images crashed \(SIGABRT\): .*free"):
        child.run(_work("free_twice"))


def test_an_exit_without_result_is_an_error() -> None:
    with pytest.raises(MapError, match="exit code 0"):
        child.run(_work("vanish"))


def test_our_own_errors_keep_their_kind() -> None:
    with pytest.raises(InputError, match="too dark"):
        child.run(_work("refuse"))


def test_other_errors_name_the_step_in_one_line() -> None:
    with pytest.raises(MapError, match=r"refining failed: ValueError: first line$"):
        child.run(_work("stumble"))


def test_interrupt_kills_the_child_and_leaves_nothing(tmp_path: Path) -> None:
    mark = tmp_path / "pid"

    def interrupted(stage: str, fraction: float) -> None:
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        child.run(_work("linger"), str(mark), progress=interrupted)
    pid = int(mark.read_text())
    with pytest.raises(ProcessLookupError):
        os.kill(pid, 0)


@pytest.mark.parametrize("work", ["linger", "compute"])
def test_child_dies_with_its_parent(tmp_path: Path, work: str) -> None:
    mark = tmp_path / "pid"
    parent = os.fork()
    if parent == 0:
        child.run(_work(work), str(mark))
        os._exit(0)
    until(lambda: mark.exists() and mark.read_text(), "the child")
    os.kill(parent, signal.SIGKILL)
    os.waitpid(parent, 0)
    pid = int(mark.read_text())
    until(lambda: not Path(f"/proc/{pid}").exists(), "the child's end")


def test_a_child_whose_parent_is_gone_before_it_begins_does_no_work(tmp_path: Path) -> None:
    (tmp_path / "request").write_bytes(pickle.dumps((_work("add"), (2, 3))))
    ours, closed = os.pipe()
    os.close(closed)
    command = [sys.executable, "-m", "mapping.child", str(tmp_path)]
    paths = {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)}
    ended = subprocess.run(command, stdin=ours, env=paths, stdout=subprocess.DEVNULL, check=False)
    os.close(ours)
    assert ended.returncode != 0
    assert not (tmp_path / "answer").exists()


def test_work_without_progress_needs_no_callback() -> None:
    work: Progress = _work("add")
    assert child.run(work, 1, 1) == 2
