from collections.abc import Callable
from typing import Annotated

import numpy as np
from numpy.typing import NDArray

def search(
    distance: Annotated[NDArray[np.float32], "(nx, ny, nz)"],
    start: int,
    goal: int,
    required: float,
    comfort: float,
    price: float,
    greed: float,
    dearer: Annotated[NDArray[np.float32], "(nx, ny, nz)"] | None = None,
) -> NDArray[np.int64]:
    """Cells (flat indices) of the cheapest way from start to goal; empty if there is none.

    A step into a cell costs its length, that times a price near obstacles, and that times `dearer` of the cell.
    """

def bottleneck(distance: Annotated[NDArray[np.float32], "(nx, ny, nz)"], start: int, goal: int) -> int:
    """Cell of the least distance on the way from start to goal that has most room; -1 if there is no way."""

def snap_states(
    states: Annotated[NDArray[np.float64], "(k + 1, 4, axes)"],
    durations: NDArray[np.float64],
    held: Annotated[NDArray[np.uint8], "(k + 1,)"],
) -> None:
    """Fills in the interior velocities, accelerations and jerks of the minimum-snap spline; held velocities stay."""

def snap_coefficients(
    states: Annotated[NDArray[np.float64], "(k + 1, 4, axes)"],
    durations: NDArray[np.float64],
    coefficients: Annotated[NDArray[np.float64], "(k, axes, 8)"],
) -> None:
    """Fills in ascending coefficients in seconds."""

class StopFlag:
    """Set it from any thread to end an optimisation within one iteration."""

    def __init__(self) -> None: ...
    def set(self) -> None: ...
    def is_set(self) -> bool: ...

class Problem:
    """The cost of a minimum-snap spline by its durations (k,) and knots (k + 1, 4); see `optimise.time_allocation`."""

    def __init__(
        self,
        segments: int,
        samples: int,
        airframe: Annotated[NDArray[np.float64], "(41,)"],
        prices: Annotated[NDArray[np.float64], "(5,)"],
        clearances: Annotated[NDArray[np.float64], "(segments,)"],
        distances: Callable[[NDArray[np.float64]], tuple[NDArray[np.float64], NDArray[np.float64]]],
    ) -> None: ...
    def evaluate(
        self,
        knots: NDArray[np.float64],
        durations: NDArray[np.float64],
        by_knots: NDArray[np.float64],
        by_durations: NDArray[np.float64],
    ) -> float:
        """The cost; fills its gradients."""
    def excess(
        self,
        states: Annotated[NDArray[np.float64], "(k + 1, 4, 4)"],
        durations: NDArray[np.float64],
        out: Annotated[NDArray[np.float64], "(k, samples, 13)"],
    ) -> None:
        """Fills in the relative excess over each limit, of any spline."""
    def set_offsets(self, offsets: Annotated[NDArray[np.float64], "(k, samples, 13)"]) -> None:
        """What is added to each excess."""
    def set_reference(self, durations: NDArray[np.float64]) -> None:
        """The time (k,) over which each segment's excess is charged, whatever its own becomes."""
    def set_speeds(self, speeds: NDArray[np.float64]) -> None:
        """The speed limit (k,) of each segment."""
    def set_jerks(self, jerks: NDArray[np.float64]) -> None:
        """The jerk limit (k,) of each segment."""
    def set_given(
        self,
        states: Annotated[NDArray[np.float64], "(k + 1, 4, 4)"],
        held: Annotated[NDArray[np.uint8], "(k + 1,)"],
    ) -> None:
        """Derivatives at both ends, and the velocity of the knots that are held."""
    def set_balls(self, balls: Annotated[NDArray[np.float64], "(k + 1, 4)"]) -> None:
        """Centre and radius of the balls that knots may move in; a radius of 0 is none."""
    def set_gates(self, gates: Annotated[NDArray[np.float64], "(k + 1, 3, 3)"]) -> None:
        """Centre, left and upper half edge of the openings whose planes knots move in; zero edges are none."""
    def look_at(self, x: float, y: float) -> None:
        """The price on heading is for not looking at this point, instead of not along the path."""
    def minimise(
        self,
        knots: NDArray[np.float64],
        durations: NDArray[np.float64],
        free: Annotated[NDArray[np.uint8], "(k + 1, 4)"],
        iterations: int,
        precision: float,
        stop: StopFlag | None,
    ) -> tuple[float, int, bool, bool]:
        """Moves knots and durations; returns cost, evaluations, whether it converged, whether it was stopped."""
    def slopes(
        self,
        states: Annotated[NDArray[np.float64], "(k + 1, 4, 4)"],
        durations: NDArray[np.float64],
        by_states: Annotated[NDArray[np.float64], "(k + 1, 4, 4)"],
        by_log_durations: NDArray[np.float64],
    ) -> float:
        """The cost of a spline; fills its gradients by the knot states and by the logarithms of the durations."""
    def refine(
        self,
        states: Annotated[NDArray[np.float64], "(k + 1, 4, 4)"],
        durations: NDArray[np.float64],
        free: Annotated[NDArray[np.uint8], "(k + 1, 4, 4)"],
        iterations: int,
        precision: float,
        hold: float,
        stop: StopFlag | None,
    ) -> tuple[float, int, bool, bool, float]:
        """Moves knot states and durations; returns cost, evaluations, whether it converged, whether it was stopped, and
        the share of the cost that the quadratic model still promises."""
