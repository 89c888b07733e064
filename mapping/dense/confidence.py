"""How well the measured surface is known: the standard deviation of its position along its normal, point by point.

Each measurement that the distance volume fuses has a weight, its inverse variance. Were all independent, the variance
of their mean would be the inverse of the weights' sum; but images side by side share most of their errors, so that the
mean of many is hardly better than one. What they agree on is in their scatter: where the surface is slanted, has an
edge or looks different from each side, they differ by more than their deviations say.
"""

import functools
from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from flight import FloatArray

if TYPE_CHECKING:
    from scipy.spatial import KDTree

EXPECTED_SHARE, OBSERVED_SHARE = 0.25, 0.25
"""Of the variance that the deviations of the depths let expect of the mean, if they were independent, and of the
observed variance of one measurement. Fitted to the rendered room and the disturbed room, judged on others: the
surface's error over its standard deviation has an RMS of 0.9 to 1.2 (docs/evidence/studies/surface_confidence.md)."""
FIGURES = ("surface_std_median_m", "surface_std_90_percent_m", "surface_share_worse_than_voxel")
"""Of a map, by their names in `map.toml` and `report.json`."""


@dataclass(frozen=True, slots=True, eq=False)
class SurfaceConfidence:
    """Of each vertex of the measured surface."""

    deviation_m: NDArray[np.float32]
    """(v,) standard deviation of its position along the surface's normal; NaN where it is not known."""
    images: NDArray[np.uint8]
    """(v,) how many images measured it, 255 also for more; 0 where that is not known."""

    def part(self, kept: NDArray[np.integer] | NDArray[np.bool_]) -> "SurfaceConfidence":
        """Of some of the vertices, by index or mask."""
        return SurfaceConfidence(self.deviation_m[kept], self.images[kept])


def of_fused(
    weight: NDArray[np.float32], scatter_m2: NDArray[np.float32], images: NDArray[np.uint8], voxel_m: float
) -> SurfaceConfidence:
    """The confidence of vertices by what a distance volume fused there.

    Args:
        weight: (v,) sum of the weights; a measurement good to one voxel has weight 1.
        scatter_m2: (v,) sum of the weighted squared differences from the mean.
        images: (v,) that measured a surface there. A few of them may agree by chance: one alone has its own expected
            variance in full.
    """
    expected_m2 = voxel_m**2 / weight * (EXPECTED_SHARE + 1.0 / np.maximum(images, 1.0) ** 2)
    observed_m2 = OBSERVED_SHARE * scatter_m2 / weight
    return SurfaceConfidence(np.sqrt(expected_m2 + observed_m2).astype(np.float32), images)


def unknown(vertices: int) -> SurfaceConfidence:
    """Of so many vertices of which nothing is known."""
    return SurfaceConfidence(np.full(vertices, np.nan, np.float32), np.zeros(vertices, np.uint8))


def joined(first: SurfaceConfidence, second: SurfaceConfidence) -> SurfaceConfidence:
    """Of the vertices of both, one after the other."""
    return SurfaceConfidence(
        np.concatenate([first.deviation_m, second.deviation_m]), np.concatenate([first.images, second.images])
    )


def figures(confidence: SurfaceConfidence, voxel_m: float) -> dict[str, float]:
    """`FIGURES`: median and 90th percentile of the standard deviation, share of the surface that is worse than a voxel.

    The vertices lie equally dense on the surface. Empty where nothing is known.
    """
    known_m = confidence.deviation_m[np.isfinite(confidence.deviation_m)].astype(np.float64)
    if not len(known_m):
        return {}
    values = (*np.quantile(known_m, [0.5, 0.9]).tolist(), float((known_m > voxel_m).mean()))
    return dict(zip(FIGURES, values, strict=True))


def describe(facts: Mapping[str, Any]) -> str:
    """The `FIGURES` among a map's facts, in words; empty where it does not have them."""
    if not all(name in facts for name in FIGURES):
        return ""
    half_m, most_m, worse = (facts[name] for name in FIGURES)
    return (
        f"standard deviation {1e3 * half_m:.0f} mm at the median, {1e3 * most_m:.0f} mm at the 90th percentile; "
        f"{100.0 * worse:.1f} % of it above one voxel"
    )


@dataclass(frozen=True, slots=True)
class NearestSurface:
    """The measured surface that is nearest to a place."""

    point_world_m: tuple[float, float, float]
    """The nearest vertex."""
    distance_m: float
    """To it."""
    deviation_m: float | None
    """Standard deviation of its position along the normal; None where it is not known."""
    images: int
    """That measured it."""


@dataclass(frozen=True, eq=False)  # without slots, which a cached property cannot have
class MeasuredSurface:
    """The vertices of a map's mesh, and how well they are known."""

    vertices_world_m: FloatArray
    """(v, 3)."""
    confidence: SurfaceConfidence
    """Of each."""

    def nearest(self, point_world_m: FloatArray) -> NearestSurface:
        """The vertex nearest to a point (3,)."""
        apart_m, best = self._tree.query(point_world_m)
        x, y, z = self.vertices_world_m[best].tolist()
        deviation_m = float(self.confidence.deviation_m[best])
        known_m = deviation_m if np.isfinite(deviation_m) else None
        return NearestSurface((x, y, z), float(apart_m), known_m, int(self.confidence.images[best]))

    def deviations_m(self, points_world_m: FloatArray, within_m: float) -> FloatArray:
        """(n,) standard deviation at the vertex nearest to each point (n, 3); NaN if that is unknown or too far."""
        _, best = self._tree.query(points_world_m, distance_upper_bound=within_m)
        return np.append(self.confidence.deviation_m, np.nan)[best]  # beyond that range `best` is v

    @functools.cached_property
    def _tree(self) -> "KDTree":
        from scipy.spatial import KDTree

        return KDTree(self.vertices_world_m)
