"""Work on many things, such as images, by several threads. NumPy, OpenCV and the kernels run beside each other.

Long work is cut into tasks, functions of their arguments alone: threads do them, or other machines, with the same
answers. Each answer is a file, so that an interrupted work goes on with the tasks that have none.
"""

import os
from collections import deque
from collections.abc import Callable, Generator, Iterable, Mapping
from concurrent.futures import Future, ThreadPoolExecutor
from pathlib import Path
from typing import Any, Protocol, TypeVar
from zipfile import BadZipFile

import numpy as np

from flight import Progress, silent

Item = TypeVar("Item")
Answer = TypeVar("Answer")
Arrays = Mapping[str, np.ndarray]
"""What a task gives, by name."""
Task = tuple[Any, ...]
"""The arguments of one; pickled where another process does it."""


def in_order(work: Callable[[Item], Answer], items: Iterable[Item], *, threads: int | None = None) -> Generator[Answer]:
    """`work` of each item, in the order of the items.

    No more than `threads` answers are made ahead, so a long sequence takes no more memory than a short one, and an
    interrupt waits for no more than the items that are being worked on.

    OpenCV's own threads are turned off for the process: those of one image mostly wait for each other.

    Args:
        threads: as many as the machine has processors by default.
    """
    import cv2

    cv2.setNumThreads(1)
    threads = threads or os.cpu_count() or 1
    ahead: deque[Future[Answer]] = deque()
    pool = ThreadPoolExecutor(threads)
    try:
        for item in items:
            ahead.append(pool.submit(work, item))
            if len(ahead) > threads:
                yield ahead.popleft().result()
        while ahead:
            yield ahead.popleft().result()
    finally:
        pool.shutdown(cancel_futures=True)


class Pool(Protocol):
    """Who does tasks. Itself pickled, as images are matched in a child process."""

    def each(
        self,
        work: Callable[..., Arrays],
        tasks: Iterable[tuple[int, Task]],
        take: Callable[[int, Arrays], None],
        stage: str,
        progress: Progress,
    ) -> None:
        """Do all tasks.

        Args:
            work: a module's function; what it raises ends the whole work.
            tasks: by number; those of some tasks only are asked for ahead.
            take: is given the number and the answer of each task as it comes, in any order.
            stage: what they are tasks of, for messages.
        """
        ...


class Threads:
    """Threads of this process."""

    def __init__(self, count: int | None = None) -> None:
        self.count = count
        """As many as the machine has processors by default."""

    def each(
        self,
        work: Callable[..., Arrays],
        tasks: Iterable[tuple[int, Task]],
        take: Callable[[int, Arrays], None],
        stage: str = "",
        progress: Progress = silent,
    ) -> None:
        for number, answer in in_order(lambda task: (task[0], work(*task[1])), tasks, threads=self.count):
            take(number, answer)


def files_of(
    work: Callable[..., Arrays],
    count: int,
    task: Callable[[int], Task],
    *,
    folder: Path,
    pool: Pool,
    stage: str,
    progress: Progress,
) -> list[Path]:
    """A file of arrays (`.npz`) of each of `count` tasks, in their order; those that `folder` holds are not done again.

    Args:
        task: arguments of `work` by the task's number.
        folder: of these tasks alone; it exists.
    """
    files = [folder / f"{number:06d}.npz" for number in range(count)]
    asked = [number for number, file in enumerate(files) if not _is_whole(file)]
    done = count - len(asked)

    def take(number: int, answer: Arrays) -> None:
        nonlocal done
        _write(files[number], answer)
        done += 1
        progress(stage, done / count)

    progress(stage, done / max(count, 1))
    if asked:  # else nobody need be there
        pool.each(work, ((number, task(number)) for number in asked), take, stage, progress)
    return files


def arrays(file: Path) -> dict[str, np.ndarray]:
    """What a task gave."""
    with np.load(file, allow_pickle=False) as kept:
        return {name: kept[name] for name in kept.files}


def _is_whole(file: Path) -> bool:
    """Whether the file of a task is there, and all of it as it was written: a power cut may leave holes."""
    try:
        arrays(file)
        return True
    except (OSError, ValueError, EOFError, BadZipFile):
        return False


def _write(file: Path, answer: Arrays) -> None:
    part = file.with_name(f"{file.name}.part")
    try:
        with open(part, "wb") as opened:
            np.savez(opened, allow_pickle=False, **answer)
            opened.flush()
            os.fsync(opened.fileno())
    except BaseException:  # no space is left, say: what is there of it would take the more
        part.unlink(missing_ok=True)
        raise
    part.replace(file)
