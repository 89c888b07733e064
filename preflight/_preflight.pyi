from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

DRAW: int
COMMON: int
SUMMARY: int

class Flights:
    def __init__(
        self,
        effects: list[str],
        own: list[tuple[Callable[[], None], NDArray[np.float64]]],
        hubs: NDArray[np.float64],
        spin: NDArray[np.float64],
        parameters: NDArray[np.float32],
        durations_us: NDArray[np.uint32],
        coefficients: NDArray[np.float32],
        clearance_m: float,
        common: NDArray[np.float64],
        /,
    ) -> None: ...
    def refused(self) -> tuple[int, int]: ...
    @property
    def width(self) -> int: ...
    def fly(
        self,
        values: NDArray[np.float64],
        draws: NDArray[np.float64],
        numbers: NDArray[np.uint64],
        weights: NDArray[np.float64],
        seeds: NDArray[np.uint64],
        threads: int,
        positions: NDArray[np.float32],
        errors: NDArray[np.float32],
        path_s: NDArray[np.float32],
        states: NDArray[np.uint8],
        summaries: NDArray[np.float64],
        /,
    ) -> None: ...
