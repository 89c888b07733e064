from collections.abc import Callable

from numpy import float64
from numpy.typing import NDArray

class Model:
    """A vehicle's effects, compiled. All arrays are C-contiguous float64 with two axes; a single row is shared."""

    def __init__(
        self,
        effects: list[str],
        hub_body_m: NDArray[float64],
        spin: NDArray[float64],
        own: list[tuple[Callable[[], None], NDArray[float64]]],
        /,
    ) -> None: ...
    @property
    def width(self) -> int: ...
    def evaluate(
        self,
        values: NDArray[float64],
        motion: NDArray[float64],
        surroundings: NDArray[float64],
        as_acceleration: bool,
        out: NDArray[float64],
        /,
    ) -> None: ...
    def jacobian(
        self,
        values: NDArray[float64],
        motion: NDArray[float64],
        surroundings: NDArray[float64],
        slots: list[int],
        directions: list[int],
        as_acceleration: bool,
        out: NDArray[float64],
        slopes: NDArray[float64],
        /,
    ) -> None: ...
    def step(
        self,
        values: NDArray[float64],
        world: NDArray[float64],
        command: NDArray[float64],
        battery_v: NDArray[float64],
        steps: int,
        step_s: float,
        states: NDArray[float64],
        specific_force: NDArray[float64],
        energy_j: NDArray[float64],
        /,
    ) -> None: ...
    def invert(
        self,
        values: NDArray[float64],
        required: NDArray[float64],
        motion: NDArray[float64],
        surroundings: NDArray[float64],
        out: NDArray[float64],
        /,
    ) -> None: ...
    def flatness(
        self,
        values: NDArray[float64],
        gravity_m_s2: float,
        hover_rad_s: NDArray[float64],
        spacing_s: float,
        path: NDArray[float64],
        out: NDArray[float64],
        /,
    ) -> None: ...
    def at_nodes(
        self,
        values: NDArray[float64],
        gravity_m_s2: float,
        hover_rad_s: NDArray[float64],
        first: NDArray[float64],
        second: NDArray[float64],
        scale: NDArray[float64],
        path: NDArray[float64],
        out: NDArray[float64],
        /,
    ) -> None: ...

def effects() -> list[tuple[str, int]]: ...
