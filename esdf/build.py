"""From occupancy to distance: the exact signed Euclidean distance to the surface of the solid voxels.

Solid voxels count as full boxes. A free voxel's value is the distance from its centre to the nearest point of a solid
box; a solid voxel's value is minus the distance to the nearest free box. That is the true signed distance to one well
defined surface, so it never changes by more than the distance travelled (Lipschitz constant 1), and if every real
surface lies inside solid voxels it never overestimates the distance to it.
"""

import math
import os
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from esdf import _esdf
from esdf.field import Field, Policy
from esdf.grid import Grid, Region, StateArray, checked_state
from flight import InputError

INT16_CAP = 16383  # two of these still fit an int16, so sums in the kernel cannot overflow
INT32_CAP = 1 << 30
FARTHEST_M = 1e9  # used in place of infinity, which could not be interpolated
WORTH_A_THREAD = 500_000  # voxels below which starting another thread costs more than it saves


def build(
    state: ArrayLike,
    grid: Grid,
    *,
    cap_m: float = 2.0,
    unknown: Policy = "obstacle",
    threads: int | None = None,
) -> Field:
    """The distance field of a map.

    Args:
        state: (nx, ny, nz) of UNKNOWN, FREE, OCCUPIED.
        cap_m: Distances are exact up to here and equal to it beyond; `math.inf` for no limit (a map with
            nothing solid then has 1e9 m everywhere).
        unknown: "obstacle": unknown voxels, and everything outside the grid, are solid. "nan": unknown voxels do not
            stop a distance, and have none themselves.
        threads: None for every core.

    Raises:
        InputError: the state does not fit the grid or holds other numbers, the cap is not positive, the policy unknown.
    """
    states = checked_state(state, grid)
    recipe = Recipe.of(grid, cap_m, unknown)
    values = np.empty(grid.shape, np.float32)
    transform(recipe, states, grid.everything, values, recipe.faces, threads=threads)
    return Field(grid, states, values, recipe.cap_m, unknown)


@dataclass(frozen=True, slots=True, eq=False)
class Recipe:
    """Everything but the voxels that determines a field's values."""

    cap_m: float
    unknown: Policy
    tables: tuple[NDArray[Any], NDArray[Any], NDArray[Any]]
    """Per axis: squared separation of two voxels k apart, k = 0 .. n, clipped at `cap`; int16, int32 or float32."""
    cap: int | float
    """The squared cap in the tables' unit."""
    scale: float
    """metres = scale * sqrt(squared separation)."""

    @staticmethod
    def of(grid: Grid, cap_m: float, unknown: Policy) -> "Recipe":
        if not cap_m > 0.0:
            raise InputError(f"cap_m is {cap_m:g}; it must be positive (math.inf for no limit)")
        cap_m = min(float(cap_m), FARTHEST_M)
        if unknown not in ("obstacle", "nan"):
            raise InputError(f"unknown is {unknown!r}; choose 'obstacle' or 'nan'")
        # The box of a voxel k away begins k - 1/2 voxels from our centre; doubled, that is a whole number.
        doubled = [np.concatenate([[0], 2 * np.arange(1, n + 1, dtype=np.int64) - 1]) for n in grid.shape]
        farthest = sum(int(d[-1]) ** 2 for d in doubled) + 1
        wanted = (2.0 * cap_m / grid.voxel_m[0]) ** 2
        cap = farthest if wanted >= farthest else math.ceil(wanted)
        if grid.cubic and cap <= INT32_CAP:
            kind = np.int16 if cap <= INT16_CAP else np.int32
            tables = tuple(np.minimum(d**2, cap).astype(kind) for d in doubled)
            return Recipe(cap_m, unknown, tables, cap, 0.5 * grid.voxel_m[0])  # pyright: ignore[reportArgumentType]
        limit = np.float32(cap_m * cap_m)
        limit = np.nextafter(limit, np.float32(np.inf))
        squares = [np.square(0.5 * v * d).astype(np.float32) for v, d in zip(grid.voxel_m, doubled, strict=True)]
        tables = tuple(np.minimum(s, limit) for s in squares)
        return Recipe(cap_m, unknown, tables, float(limit), 1.0)  # pyright: ignore[reportArgumentType]

    @property
    def faces(self) -> int:
        """Bits of a whole map's six faces beyond which everything counts as solid: all or none."""
        return 0b111111 if self.unknown == "obstacle" else 0

    @property
    def reach(self) -> tuple[int, int, int]:
        """Per axis: the largest separation, in voxels, at which one voxel's state affects another's distance."""
        return tuple(int(np.argmax(t >= self.cap)) - 1 if t[-1] >= self.cap else len(t) - 1 for t in self.tables)  # pyright: ignore[reportReturnType]


def transform(
    recipe: Recipe,
    state: StateArray,
    region: Region,
    out: NDArray[np.float32],
    faces: int,
    *,
    threads: int | None = None,
    instruction_set: str = "best",
) -> None:
    """Write the distances of `region` of `state` to `out` (of the region's shape, contiguous along z).

    Args:
        faces: Bit 2 * axis + side is set where everything beyond that face of `state` is solid.
        instruction_set: For tests; see `_esdf.instruction_sets()`.
    """
    kind = recipe.tables[0].dtype
    kernel = {"int16": _esdf.transform_int16, "int32": _esdf.transform_int32, "float32": _esdf.transform_float}[
        kind.name
    ]
    window = region.grown(recipe.reach, state.shape)  # pyright: ignore[reportArgumentType]
    if window.shape[0] == region.shape[0]:  # no room of its own: a line of squares fits where its distances will be
        scratch = out.view(kind)[:, :, : region.shape[2]]
    else:
        scratch = np.empty((window.shape[0], *region.shape[1:]), kind)
    if threads is None:
        threads = min(cores(), 1 + scratch.size // WORTH_A_THREAD)
    obstacle = recipe.unknown == "obstacle"
    kernel(
        state, out, region.low, *recipe.tables, recipe.cap, recipe.scale, recipe.cap_m,
        obstacle, not obstacle, faces, scratch, threads, instruction_set,
    )  # fmt: skip


def cores() -> int:
    """How many cores this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
