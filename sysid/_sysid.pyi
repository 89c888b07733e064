from numpy import float64
from numpy.typing import NDArray

def factor(diagonal: NDArray[float64], coupling: NDArray[float64]) -> int: ...
def solve(
    factor: NDArray[float64], coupling: NDArray[float64], columns: NDArray[float64], only_back: bool = False
) -> None: ...
def eliminate(
    before: NDArray[float64],
    after: NDArray[float64],
    border: NDArray[float64],
    defect: NDArray[float64],
    sensor_state: NDArray[float64],
    sensor_border: NDArray[float64],
    sensor: NDArray[float64],
    diagonal: NDArray[float64],
    coupling: NDArray[float64],
    columns: NDArray[float64],
    reduced: NDArray[float64],
) -> int: ...
def leverage(
    before: NDArray[float64],
    after: NDArray[float64],
    sensor_state: NDArray[float64],
    factor: NDArray[float64],
    coupling: NDArray[float64],
    defect: NDArray[float64],
    sensor: NDArray[float64],
) -> None: ...
def add_change(
    before: NDArray[float64],
    after: NDArray[float64],
    sensor_state: NDArray[float64],
    states: NDArray[float64],
    defect: NDArray[float64],
    sensor: NDArray[float64],
) -> None: ...
def whiten(scale: NDArray[float64], rows: NDArray[float64]) -> None: ...
def drive(
    step_s: NDArray[float64],
    command: NDArray[float64],
    by: NDArray[float64],
    rise_s: float,
    fall_s: float,
    mean: NDArray[float64],
    change: NDArray[float64],
    mean_by: NDArray[float64],
    change_by: NDArray[float64],
) -> None: ...
