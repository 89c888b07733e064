"""Work on many things, such as images, by several threads. NumPy, OpenCV and the kernels run beside each other."""

import os
from collections import deque
from collections.abc import Callable, Generator, Iterable
from concurrent.futures import Future, ThreadPoolExecutor
from typing import TypeVar

Item = TypeVar("Item")
Answer = TypeVar("Answer")


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
