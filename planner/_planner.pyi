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
) -> NDArray[np.int64]:
    """Cells (flat indices) of the cheapest way from start to goal; empty if there is none."""

def running_cost(
    states: Annotated[NDArray[np.float64], "(k, 8, 3)"],
    durations: Annotated[NDArray[np.float64], "(k,)"],
    basis: Annotated[NDArray[np.float64], "(5, s, 8)"],
    bounds: Annotated[NDArray[np.float64], "(7,)"],
    price: float,
    near: Annotated[NDArray[np.float64], "(k, s)"],
    by_position: Annotated[NDArray[np.float64], "(k, s, 3)"],
    by_states: Annotated[NDArray[np.float64], "(k, 8, 3)"],
    by_durations: Annotated[NDArray[np.float64], "(k,)"],
) -> float:
    """Integral of the penalties; fills its gradients by the segments' states and durations."""
