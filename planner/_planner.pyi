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
