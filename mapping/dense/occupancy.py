"""How likely it is that a voxel holds something although the depth images call it free: a layer of the map.

Stated by the looks of the images (`contradiction`) for each voxel that is free by the depth images: those that several
images contradict, which are unknown in the map, and those that stay free.
"""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from esdf import FREE, OCCUPIED, UNKNOWN, Field
from esdf.solids import slabs
from flight import FloatArray, FormatError, file_format, frames
from mapping.dense.contradiction import Looks

FILE = "occupancy.npz"
VERSION = 1
FREE_BY_LOOKS = ((0, 6.0e-4), (2, 8.0e-5), (3, 9.0e-6))
"""Of voxels that no image contradicts, by the least number of looks."""
SOME_AGAINST = 4.0e-4
"""Of those that are not contradicted, though one image or a small share of the looks shows something."""
CONTRADICTED_BY_SHARE = ((0.0, 0.003), (0.4, 0.008), (0.6, 0.03), (0.8, 0.12))
"""Of contradicted voxels, by the least share of the looks that do."""
FIGURES = ("contradicted_m3", "expected_in_free")
"""Of a map: volume that images contradict, and how many of the free voxels are expected to hold something."""
FEW_LOOKS, BY_FEW_LOOKS = 2, 0.02
"""So many looks or fewer say little by their share."""


def probability(looks: Looks) -> NDArray[np.float16]:
    """(nx, ny, nz) that something is in the voxel; NaN where it is not free by the depth images.

    The figures are the frequencies in rendered rooms with poles, cables and nets (docs/evidence/studies/free_space.md):
    images that share an error, and things of the colour of what lies behind them, were in these too.
    """
    seen, against = np.arange(256)[:, None], np.arange(256)
    share = against / np.maximum(seen, 1)
    free = np.full((256, 256), SOME_AGAINST, np.float16)
    for least, value in FREE_BY_LOOKS:
        free[(seen >= least) & (against == 0)] = value
    contradicted = np.zeros((256, 256), np.float16)
    for least, value in CONTRADICTED_BY_SHARE:
        contradicted[share >= least] = value
    contradicted[: FEW_LOOKS + 1] = BY_FEW_LOOKS
    result = free[looks.looks, looks.contradictions]
    not_free = looks.contradicted
    result[not_free] = contradicted[looks.looks[not_free], looks.contradictions[not_free]]
    result[~looks.free] = np.nan
    return result


def save(path: Path, stated: NDArray[np.float16] | None) -> None:
    """Write the layer as a compressed `.npz`; nothing if it is not known."""
    if stated is None:
        return
    file_format.write_arrays(path, version=VERSION, probability=stated)


def load(path: Path, shape: tuple[int, int, int]) -> NDArray[np.float16] | None:
    """Read what `save` wrote, for a field of that shape; None where there is no file (earlier maps).

    Raises:
        FormatError: the file is damaged, newer, or of another field.
    """
    if not path.is_file():
        return None
    fault = "a damaged layer of occupancy probabilities"
    [values] = file_format.read_arrays(path, "probability", version=VERSION, fault=fault, remedy="build the map again")
    if values.dtype != np.float16 or values.shape != shape:
        raise FormatError(f"{path} holds {values.dtype} of shape {values.shape}, expected float16 of {shape}")
    if not (np.isnan(values) | ((values >= 0.0) & (values <= 1.0))).all():
        raise FormatError(f"{path} holds a probability outside of 0 to 1; build the map again")
    return values


def moved(stated: NDArray[np.float16], field: Field, T_new_old: FloatArray, new: Field) -> NDArray[np.float16]:
    """The layer in another frame: each voxel of the new field has the value of the old one in which its centre lay."""
    T_old_new, result = frames.invert(T_new_old), np.full(new.grid.shape, np.nan, np.float16)
    for slab in slabs(new.grid.everything):
        points = frames.apply(T_old_new, new.grid.centres(slab).reshape(-1, 3))
        inside = field.grid.contains(points)
        found = np.clip(field.grid.index(points[inside]), 0, np.array(field.grid.shape) - 1)
        part = np.full(len(points), np.nan, np.float16)
        part[inside] = stated[tuple(found.T)]
        result[slab.slices] = part.reshape(slab.shape)
    return result


def joined(both: Field, parts: Sequence[tuple[NDArray[np.float16] | None, Field]]) -> NDArray[np.float16] | None:
    """The layer of maps in one, of the same frame and voxels: the larger value where two state one.

    None if no map has the layer. What one of the maps shows to be occupied is so, with no probability.
    """
    if all(stated is None for stated, _ in parts):
        return None
    result = np.full(both.grid.shape, np.nan, np.float16)
    for stated, field in parts:
        if stated is not None:
            first = np.rint((field.grid.low_world_m - both.grid.low_world_m) / np.array(both.grid.voxel_m)).astype(int)
            place = tuple(slice(a, a + n) for a, n in zip(first, stated.shape, strict=True))
            result[place] = np.fmax(result[place], stated)
    result[both.state == OCCUPIED] = np.nan
    return result


def figures(stated: NDArray[np.float16], field: Field) -> dict[str, float]:
    """`FIGURES`, in the field with the pilot's edits."""
    known, free = np.isfinite(stated), field.state == FREE
    against = known & (field.state == UNKNOWN) & (stated >= np.float16(CONTRADICTED_BY_SHARE[0][1]))
    contradicted_m3 = float(against.sum()) * float(np.prod(field.grid.voxel_m))
    values = (contradicted_m3, float(stated[known & free].sum(dtype=np.float64)))
    return dict(zip(FIGURES, values, strict=True))


def describe(facts: Mapping[str, Any]) -> str:
    """The `figures` among a map's facts, in words; empty where it does not have them."""
    if not all(name in facts for name in FIGURES):
        return ""
    contradicted_m3, expected = (facts[name] for name in FIGURES)
    return f"{contradicted_m3:.2f} m3, unknown; of the free voxels {expected:.0f} are expected to hold something"
