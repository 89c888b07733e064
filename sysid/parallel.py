"""The same work for several flights at once; the kernels and NumPy leave Python free for the others meanwhile."""

import os
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import Any, TypeVar

from vehicle import Vehicle

Result = TypeVar("Result")


def each(vehicle: Vehicle, function: Callable[..., Result], *arguments: Sequence[Any]) -> list[Result]:
    """`function` of the first of all arguments, of the second, and so on; in threads, as many as there are cores.

    Args:
        vehicle: one with effects of the user's own is evaluated in Python, one flight after the other.
    """
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    threads = min(cores, len(arguments[0]))
    if threads < 2 or vehicle.effect_files:
        return [function(*one) for one in zip(*arguments, strict=True)]
    with ThreadPoolExecutor(threads) as pool:
        return list(pool.map(function, *arguments))
