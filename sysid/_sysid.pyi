from numpy import float64
from numpy.typing import NDArray

def factor(diagonal: NDArray[float64], coupling: NDArray[float64]) -> int: ...
def solve(factor: NDArray[float64], coupling: NDArray[float64], columns: NDArray[float64]) -> None: ...
def inverse_blocks(
    factor: NDArray[float64],
    coupling: NDArray[float64],
    diagonal: NDArray[float64],
    off_diagonal: NDArray[float64],
) -> None: ...
