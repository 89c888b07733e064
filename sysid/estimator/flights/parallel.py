"""The same work for several flights at once; the kernels and NumPy leave Python free for the others meanwhile."""

import os
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import Any, TypeVar

from sysid.estimator.flights.flight_data import Flight
from vehicle import Vehicle

Result = TypeVar("Result")

MOST_NODES = 16_000
"""Nodes of all flights beyond which they are worked on one after the other: two at once would take more than 1 GiB."""


def each(vehicle: Vehicle, function: Callable[..., Result], *arguments: Sequence[Any]) -> list[Result]:
    """`function` of the first of all arguments, of the second, and so on; in threads, as many as there are cores.

    Args:
        vehicle: one with effects of the user's own is evaluated in Python, one flight after the other.
        arguments: flights first, or what was made of them; long flights are taken one after the other.
    """
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    threads = min(cores, len(arguments[0]))
    nodes = sum(len(one) for one in arguments[0] if isinstance(one, Flight))
    if threads < 2 or vehicle.effect_files or nodes > MOST_NODES:
        return [function(*one) for one in zip(*arguments, strict=True)]
    with ThreadPoolExecutor(threads) as pool:
        return list(pool.map(function, *arguments))
