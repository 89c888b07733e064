"""The renderer of the simulated room. Contiguous arrays in, new arrays out; see `goshawk/src/module.cpp`."""

import numpy as np
from numpy.typing import NDArray

def cast_rays(
    solids: NDArray[np.float64], origins: NDArray[np.float64], directions: NDArray[np.float64], threads: int
) -> tuple[NDArray[np.float64], NDArray[np.int32]]: ...
def render(
    solids: NDArray[np.float64],
    materials: NDArray[np.float64],
    lamps: NDArray[np.float64],
    rays: NDArray[np.float64],
    T_world_camera: NDArray[np.float64],
    gain: float,
    noise: float,
    vignette: float,
    seed: int,
    threads: int,
) -> NDArray[np.uint8]: ...
