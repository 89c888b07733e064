"""Where the voxels are: an axis-aligned lattice of boxes in the world, and what each can be."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from flight import FloatArray, InputError

UNKNOWN, FREE, OCCUPIED = 0, 1, 2
"""States of a voxel (uint8). An unknown voxel is not free."""

StateArray = NDArray[np.uint8]
MAX_VOXELS = 1 << 36
"""69e9 voxels, 275 GB of distances: a larger grid is refused as a likely input error."""


class Region(NamedTuple):
    """A box of voxels: `low` included, `high` excluded."""

    low: tuple[int, int, int]
    high: tuple[int, int, int]

    @property
    def slices(self) -> tuple[slice, slice, slice]:
        return tuple(slice(a, b) for a, b in zip(self.low, self.high, strict=True))  # pyright: ignore[reportReturnType]

    @property
    def shape(self) -> tuple[int, int, int]:
        return tuple(max(b - a, 0) for a, b in zip(self.low, self.high, strict=True))  # pyright: ignore[reportReturnType]

    @property
    def empty(self) -> bool:
        return 0 in self.shape

    def common(self, other: "Region") -> "Region":
        """The voxels in both (empty if there are none)."""
        low = tuple(max(a, b) for a, b in zip(self.low, other.low, strict=True))
        high = tuple(max(min(a, b), c) for a, b, c in zip(self.high, other.high, low, strict=True))
        return Region(low, high)  # pyright: ignore[reportArgumentType]

    def relative_to(self, other: "Region") -> "Region":
        """This box in the indices of an array that holds only `other`."""
        low = tuple(a - b for a, b in zip(self.low, other.low, strict=True))
        high = tuple(a - b for a, b in zip(self.high, other.low, strict=True))
        return Region(low, high)  # pyright: ignore[reportArgumentType]

    def grown(self, voxels: tuple[int, int, int], shape: tuple[int, int, int]) -> "Region":
        """This box with a margin, as far as a lattice of `shape` goes."""
        low = tuple(max(a - m, 0) for a, m in zip(self.low, voxels, strict=True))
        high = tuple(min(b + m, n) for b, m, n in zip(self.high, voxels, shape, strict=True))
        return Region(low, high)  # pyright: ignore[reportArgumentType]


@dataclass(frozen=True, slots=True)
class Grid:
    """Voxel (i, j, k) is the box from origin + (i, j, k) * voxel to origin + (i + 1, j + 1, k + 1) * voxel."""

    origin_world_m: tuple[float, float, float]
    """The lowest corner of voxel (0, 0, 0)."""
    voxel_m: tuple[float, float, float]
    """Edge lengths of one voxel; a single number makes cubes."""
    shape: tuple[int, int, int]
    """How many voxels along x, y, z."""

    def __post_init__(self) -> None:
        object.__setattr__(self, "origin_world_m", _triple(self.origin_world_m, "the grid's origin"))
        object.__setattr__(self, "voxel_m", _triple(self.voxel_m, "the voxel size"))
        if min(self.voxel_m) <= 0.0:
            raise InputError(f"the voxel size is {self.voxel_m}; every edge must be positive")
        counts = np.asarray(self.shape)
        if counts.shape != (3,) or not np.issubdtype(counts.dtype, np.integer) or counts.min() < 1:
            raise InputError(f"a grid's shape is three whole numbers of at least 1, not {self.shape}")
        object.__setattr__(self, "shape", tuple(int(n) for n in counts))
        if self.voxels > MAX_VOXELS:
            raise InputError(f"a grid of {self.shape} has {self.voxels:.3g} voxels; at most {MAX_VOXELS:.3g}")

    @staticmethod
    def covering(low_world_m: ArrayLike, high_world_m: ArrayLike, voxel_m: float) -> "Grid":
        """The smallest grid of cubes that contains the box from `low` to `high`, aligned to multiples of the voxel."""
        low = np.array(_triple(low_world_m, "the lower corner"))
        high = np.array(_triple(high_world_m, "the upper corner"))
        if not (np.isfinite(voxel_m) and voxel_m > 0.0):
            raise InputError(f"the voxel size is {voxel_m:g} m; it must be positive")
        if (high <= low).any():
            corners = f"from {low.tolist()} to {high.tolist()}"
            raise InputError(f"the box {corners} is empty; every number of the second corner must be larger")
        # A corner that misses a multiple by rounding alone does not cost another layer of voxels.
        first = np.floor(low / voxel_m + 1e-9)
        counts = np.maximum(np.ceil(high / voxel_m - 1e-9) - first, 1)
        if counts.prod() > MAX_VOXELS:
            fitting_m = 1.01 * voxel_m * (counts.prod() / MAX_VOXELS) ** (1 / 3)
            raise InputError(
                f"a box of {' x '.join(f'{edge_m:.4g}' for edge_m in high - low)} m at {voxel_m:g} m is "
                f"{counts.prod():.3g} voxels; at most {MAX_VOXELS:.3g}: take voxels of {fitting_m:.2g} m, or less "
                "space"
            )
        return Grid(tuple(first * voxel_m), (voxel_m, voxel_m, voxel_m), tuple(counts.astype(int)))

    def as_dict(self) -> dict[str, list[float] | list[int]]:
        """For files."""
        return {
            "origin_world_m": list(self.origin_world_m),
            "voxel_m": list(self.voxel_m),
            "shape": list(self.shape),
        }

    @staticmethod
    def from_dict(document: Mapping[str, Any]) -> "Grid":
        """Read what `as_dict` wrote; raises `KeyError` or `InputError` if it is not that."""
        return Grid(document["origin_world_m"], document["voxel_m"], tuple(document["shape"]))

    @property
    def voxels(self) -> int:
        return int(self.shape[0]) * int(self.shape[1]) * int(self.shape[2])

    @property
    def cubic(self) -> bool:
        """Whether all edges of a voxel are the same number."""
        return self.voxel_m[0] == self.voxel_m[1] == self.voxel_m[2]

    @property
    def half_diagonal_m(self) -> float:
        """From a voxel's centre to its corner."""
        return 0.5 * math.hypot(*self.voxel_m)

    @property
    def low_world_m(self) -> FloatArray:
        return np.array(self.origin_world_m)

    @property
    def high_world_m(self) -> FloatArray:
        return self.low_world_m + np.array(self.shape) * np.array(self.voxel_m)

    @property
    def everything(self) -> Region:
        return Region((0, 0, 0), self.shape)

    def index(self, points_world_m: ArrayLike) -> NDArray[np.int64]:
        """The voxel each point (n, 3) lies in; outside the grid the indices leave 0 .. shape - 1."""
        points = np.asarray(points_world_m, dtype=np.float64)
        return np.floor((points - self.low_world_m) / np.array(self.voxel_m)).astype(np.int64)

    def contains(self, points_world_m: ArrayLike) -> NDArray[np.bool_]:
        """Whether each point (n, 3) lies in the grid, its faces included."""
        points = np.asarray(points_world_m, dtype=np.float64)
        voxels = (points - self.low_world_m) / np.array(self.voxel_m)
        # As in the compiled query: a point on the outer face is inside however the division rounds.
        return np.all((voxels >= -1e-9) & (voxels <= np.array(self.shape) + 1e-9), axis=-1, keepdims=False)

    def centre(self, indices: ArrayLike) -> FloatArray:
        """World coordinates of voxel centres (n, 3)."""
        steps = np.asarray(indices, dtype=np.float64) + 0.5
        return np.asarray(self.low_world_m + steps * np.array(self.voxel_m), dtype=np.float64)

    def axis_centres(self, axis: int, region: Region | None = None) -> FloatArray:
        """Coordinates of the voxel centres along one axis, of the whole grid or of a region."""
        low, high = (0, self.shape[axis]) if region is None else (region.low[axis], region.high[axis])
        first = self.origin_world_m[axis] + 0.5 * self.voxel_m[axis]
        return np.asarray(np.arange(low, high) * self.voxel_m[axis] + first, dtype=np.float64)

    def centres(self, region: Region | None = None) -> FloatArray:
        """World coordinates of all voxel centres of a region: (nx, ny, nz, 3)."""
        axes = [self.axis_centres(a, region) for a in range(3)]
        return np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1)

    def region(self, low_world_m: ArrayLike, high_world_m: ArrayLike) -> Region:
        """The voxels that a world box touches, as far as the grid goes."""
        low = np.clip(self.index(np.asarray(low_world_m)), 0, self.shape)
        high = np.clip(self.index(np.asarray(high_world_m)) + 1, low, self.shape)
        return Region(tuple(low.tolist()), tuple(high.tolist()))

    def part(self, region: Region) -> "Grid":
        """The grid of a region alone."""
        origin = self.low_world_m + np.array(region.low) * np.array(self.voxel_m)
        return Grid(tuple(origin), self.voxel_m, region.shape)


def _triple(value: ArrayLike, name: str) -> tuple[float, float, float]:
    try:
        numbers = np.broadcast_to(np.asarray(value, dtype=np.float64), (3,))
    except (TypeError, ValueError):
        raise InputError(f"{name}: expected three numbers, got {value!r}") from None
    if not np.isfinite(numbers).all():
        raise InputError(f"{name} is not finite: {numbers.tolist()}")
    return (float(numbers[0]), float(numbers[1]), float(numbers[2]))


def checked_state(state: ArrayLike, grid: Grid) -> StateArray:
    """A state array as contiguous uint8 of the grid's shape, or an `InputError` that names the fault."""
    array = np.asarray(state)
    if array.shape != grid.shape:
        raise InputError(f"the state array has shape {array.shape}, the grid {grid.shape}")
    if array.dtype.kind == "f":
        raise InputError(
            "the state array holds floating point numbers; it must be 0 unknown, 1 free, 2 occupied (uint8)"
        )
    if array.size and (array.max() > OCCUPIED or array.min() < UNKNOWN):
        raise InputError(f"a voxel's state is {array.max()}; it must be 0 unknown, 1 free or 2 occupied")
    return np.ascontiguousarray(array, dtype=np.uint8)
