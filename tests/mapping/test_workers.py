"""Work on many things by several threads: their order, what is made ahead, and how it ends."""

import signal
import threading
import time
from pathlib import Path

import cv2
import numpy as np
import pytest

from flight import silent
from mapping import workers


def test_answers_come_in_the_order_of_the_items() -> None:
    def work(number: int) -> int:
        time.sleep(0.02 * (number % 3 == 0))  # the first of three is the last to be ready
        return number * number

    assert list(workers.in_order(work, range(20), threads=3)) == [k * k for k in range(20)]
    assert list(workers.in_order(work, [], threads=3)) == []


def test_opencv_does_not_divide_one_item_among_threads_of_its_own() -> None:
    before = cv2.getNumThreads()
    try:
        cv2.setNumThreads(2)
        assert list(workers.in_order(lambda _: cv2.getNumThreads(), range(3), threads=2)) == [1, 1, 1]
    finally:
        cv2.setNumThreads(before)


def test_as_many_items_are_worked_on_at_once_as_there_are_threads() -> None:
    together = threading.Barrier(3)
    assert list(workers.in_order(lambda _: together.wait(timeout=10.0) >= 0, range(6), threads=3)) == [True] * 6


def test_few_answers_are_made_ahead_and_nothing_is_begun_after_the_last_was_taken() -> None:
    begun: list[int] = []
    before = threading.active_count()

    def work(number: int) -> int:
        begun.append(number)
        return number

    answers = workers.in_order(work, range(100), threads=2)
    assert [next(answers) for _ in range(5)] == [0, 1, 2, 3, 4]
    time.sleep(0.05)
    answers.close()
    assert begun == list(range(7))
    assert threading.active_count() == before


def test_an_error_is_that_of_its_item() -> None:
    def work(number: int) -> int:
        if number == 3:
            raise ValueError("three")
        return number

    answers = workers.in_order(work, range(10), threads=2)
    assert [next(answers) for _ in range(3)] == [0, 1, 2]
    with pytest.raises(ValueError, match="three"):
        next(answers)


def test_an_interrupt_waits_only_for_what_is_being_worked_on() -> None:
    begun: list[int] = []
    main = threading.get_ident()

    def work(number: int) -> None:
        begun.append(number)
        time.sleep(0.2)  # until the next one is waiting for its turn
        signal.pthread_kill(main, signal.SIGINT)
        time.sleep(0.2)

    with pytest.raises(KeyboardInterrupt):
        list(workers.in_order(work, range(10), threads=1))
    assert begun == [0]


def halved(number: int) -> dict[str, np.ndarray]:
    return {"half": np.array([0.5 * number])} if number else {}


class Counting(workers.Threads):
    """Threads that note which tasks they were given."""

    def __init__(self) -> None:
        super().__init__(2)
        self.given: list[int] = []
        self.asked = 0

    def each(self, work, tasks, take, stage="", progress=silent) -> None:
        self.asked += 1
        chosen = list(tasks)
        self.given += [number for number, _ in chosen]
        super().each(work, chosen, take, stage, progress)


def files(folder: Path, count: int = 5) -> tuple[list[float], list[int]]:
    """The answers of tasks, and which were given to threads."""
    pool = Counting()
    found = workers.files_of(halved, count, lambda k: (k,), folder=folder, pool=pool, stage="halving", progress=silent)
    assert pool.asked == bool(pool.given)  # workers that have nothing to do need not be there
    return [float(workers.arrays(file).get("half", [0.0])[0]) for file in found], pool.given


def test_tasks_that_are_done_are_not_done_again_and_files_that_are_damaged_are(tmp_path: Path) -> None:
    (tmp_path / "inputs").touch()
    whole = [0.0, 0.5, 1.0, 1.5, 2.0]
    assert files(tmp_path) == (whole, [0, 1, 2, 3, 4])
    assert files(tmp_path) == (whole, [])
    (tmp_path / "000001.npz").unlink()
    cut = tmp_path / "000003.npz"
    cut.write_bytes(cut.read_bytes()[:30])
    assert files(tmp_path) == (whole, [1, 3])
    hole = bytearray(cut.read_bytes())
    value = hole.index(np.float64(1.5).tobytes())
    hole[value : value + 8] = bytes(8)  # as a power cut leaves it; the archive's directory is whole
    cut.write_bytes(hole)
    assert files(tmp_path) == (whole, [3])
    assert cut.stat().st_mode & 0o044 == (tmp_path / "inputs").stat().st_mode & 0o044
    (tmp_path / "inputs").unlink()
    assert sorted(file.name for file in tmp_path.iterdir()) == [f"{k:06d}.npz" for k in range(5)]


def test_no_tasks_are_no_files(tmp_path: Path) -> None:
    assert files(tmp_path, 0) == ([], [])
