from typing import Any

import numpy as np
from numpy.typing import NDArray

Vector = tuple[float, float, float]

def transform_int16(
    state: NDArray[np.uint8],
    out: NDArray[np.float32],
    lo: tuple[int, int, int],
    table_x: NDArray[Any],
    table_y: NDArray[Any],
    table_z: NDArray[Any],
    cap: float,
    scale: float,
    cap_m: float,
    unknown_is_solid: bool,
    unknown_is_nan: bool,
    faces: int,
    scratch: NDArray[Any],
    threads: int,
    isa: str,
    /,
) -> None: ...

transform_int32 = transform_int16
transform_float = transform_int16

def distance(
    values: NDArray[np.float32],
    origin: Vector,
    voxel: Vector,
    points: NDArray[np.float64],
    out: NDArray[np.float64],
    /,
) -> None: ...
def distance_and_gradient(
    values: NDArray[np.float32],
    origin: Vector,
    voxel: Vector,
    points: NDArray[np.float64],
    out: NDArray[np.float64],
    gradient: NDArray[np.float64],
    /,
) -> None: ...
def instruction_sets() -> list[str]: ...
