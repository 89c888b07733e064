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

def query_dense(
    values: NDArray[np.float32],
    origin: Vector,
    voxel: Vector,
    points: NDArray[np.float64],
    out: NDArray[np.float64],
    gradient: NDArray[np.float64] | None,
    isa: str,
    /,
) -> None: ...
def query_bricks(
    addresses: NDArray[np.uint64],
    shape: tuple[int, int, int],
    origin: Vector,
    voxel: Vector,
    points: NDArray[np.float64],
    out: NDArray[np.float64],
    gradient: NDArray[np.float64] | None,
    isa: str,
    /,
) -> None: ...
def cut_distance_bricks(
    values: NDArray[np.float32],
    overlap: int,
    uniform: NDArray[np.float32],
    out: NDArray[np.float32],
    index: NDArray[np.int32],
    /,
) -> int: ...
def cut_state_bricks(
    values: NDArray[np.uint8],
    overlap: int,
    uniform: NDArray[np.uint8],
    out: NDArray[np.uint8],
    index: NDArray[np.int32],
    /,
) -> int: ...
def carve(state: NDArray[np.uint8], origins: NDArray[np.float64], ends: NDArray[np.float64], value: int, /) -> None: ...
def carve_visible(
    state: NDArray[np.uint8],
    origins: NDArray[np.float64],
    ends: NDArray[np.float64],
    value: int,
    reached: NDArray[np.float64],
    /,
) -> None: ...
def line_of_sight(
    state: NDArray[np.uint8], eye: Vector, targets: NDArray[np.float64], visible: NDArray[np.bool_], /
) -> None: ...
def mark_triangles(
    state: NDArray[np.uint8], vertices: NDArray[np.float64], faces: NDArray[np.int64], value: int, /
) -> None: ...
def instruction_sets() -> list[str]: ...
