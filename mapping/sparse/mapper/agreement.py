"""Finds images with a wrong pose: their verified pairwise matches leave the epipolar planes of the map.

An image can have a wrong pose although hundreds of its points fit: a second copy of the scene was reconstructed with
it, and the reprojection error stays small. Its matches with its neighbours, however, then leave the epipolar planes.
So do all matches across a place where a map is broken: each of its parts is right, one is turned against the other.
"""

import functools
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from flight import FloatArray, frames
from mapping import connected
from mapping.camera.rig import Rig
from mapping.input.images import ImageSet

LEAST = 0.85
"""An image whose matches agree less is in the wrong place. Measured: 0.97 to 1.00 right, 0.57 to 0.70 wrong; of single
pairs 0.93 to 1.00, and 0.63 to 0.79 across a place where the map was broken by 9 degrees."""

_TOLERANCE_PX = 4.0
LEAST_MATCHES = 25
"""Verified matches of a pair that is judged."""


@dataclass(frozen=True, slots=True, eq=False)
class PairShares:
    """For pairs of placed instants, the share of their verified matches in the epipolar planes of the map."""

    count: int
    """Of all instants."""
    instants: np.ndarray
    """(p, 2) int; a rig's instants have a pair for each two images that were matched."""
    share: FloatArray
    """(p,)."""

    def of_instants(self) -> FloatArray:
        """(count,) the median over the pairs of an instant; NaN where it is not placed or has no pair."""
        own = [self.share[(self.instants == k).any(axis=1)] for k in range(self.count)]
        return np.array([np.median(shares) if len(shares) else np.nan for shares in own])

    def part(self) -> np.ndarray:
        """(count,) number of the part of the map in which an instant is, 0 the largest; -1 where it has no pair.

        Instants are in one part if pairs that agree connect them: no pair between two parts agrees.
        """
        first, second = self.instants[self.share >= LEAST].T
        label = connected.groups(first, second, self.count)
        paired = np.isin(np.arange(self.count), self.instants)
        sizes = np.bincount(label[paired], minlength=self.count)
        place = np.argsort(np.argsort(-sizes, kind="stable"))
        return np.where(paired, place[label], -1)

    def breaks(self) -> np.ndarray:
        """(b, 2) for each part but the largest, the pair of instants nearest in order that ties it to another part."""
        part = self.part()
        ends = np.sort(self.instants, axis=1)
        found = []
        for number in range(1, int(part.max(initial=0)) + 1):
            across = ends[(part[ends] == number).sum(axis=1) == 1]
            if len(across):
                found.append(across[np.argmin(across[:, 1] - across[:, 0])])
        return np.array(found, dtype=np.int64).reshape(-1, 2)


def of_pairs(
    database: Path, images: ImageSet, rig: Rig, T_world_body: FloatArray, *, most: int | None = None
) -> PairShares:
    """How the verified matches of each pair of images fit the map.

    Args:
        database: COLMAP's, with verified matches.
        rig: with the lenses the map was made with.
        T_world_body: (instants, 4, 4), NaN where not placed.
        most: about so many pairs, evenly chosen, instead of all.
    """
    import pycolmap

    instants: list[tuple[int, int]] = []
    shares: list[float] = []
    with pycolmap.Database.open(database) as opened:
        where = {images.relative(i, c): (i, c) for i, c in images.pairs()}
        shots = {row.image_id: where[row.name] for row in opened.read_all_images()}
        rays = functools.cache(lambda i: _rays_camera(opened, i, rig, shots[i][1]))
        pair_ids, geometries = opened.read_two_view_geometries()
        step = 1 if most is None else max(1, len(pair_ids) // most)
        for pair_id, geometry in zip(pair_ids[::step], geometries[::step], strict=True):
            a, b = pycolmap.pair_id_to_image_pair(pair_id)
            matches = np.asarray(geometry.inlier_matches, dtype=np.int64).reshape(-1, 2)
            (i, ci), (k, ck) = shots[a], shots[b]
            if i == k or len(matches) < LEAST_MATCHES or not np.isfinite(T_world_body[[i, k]]).all():
                continue
            Ta, Tb = (T_world_body[n] @ rig.cameras[c].T_body_camera for n, c in ((i, ci), (k, ck)))
            tolerance_rad = _TOLERANCE_PX / min(rig.cameras[ci].focal_px)
            instants.append((i, k))
            shares.append(_share(frames.invert(Ta) @ Tb, rays(a)[matches[:, 0]], rays(b)[matches[:, 1]], tolerance_rad))
    return PairShares(len(images.instants), np.array(instants, dtype=np.int64).reshape(-1, 2), np.array(shares))


def _rays_camera(opened: Any, image_id: int, rig: Rig, camera: int) -> FloatArray:
    return rig.cameras[camera].unproject(opened.read_keypoints(image_id)[:, :2])


def _share(T_a_b: FloatArray, rays_a: FloatArray, rays_b: FloatArray, tolerance_rad: float) -> float:
    """Share of ray pairs that meet in one plane with the line between the cameras, and in front of both."""
    direction = T_a_b[:3, 3] / max(float(np.linalg.norm(T_a_b[:3, 3])), 1e-12)
    rotated = rays_b @ T_a_b[:3, :3].T
    # the plane that fits both rays best contains the baseline; each ray's angle to it is half of this one
    normal = np.cross(direction, rays_a + rotated)
    normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-9)
    off_rad = np.maximum(np.abs((normal * rays_a).sum(axis=1)), np.abs((normal * rotated).sum(axis=1)))
    # seen from the second camera a point moves away from where the first one went
    behind = (rotated - rays_a) @ direction > tolerance_rad
    return float(((off_rad < 0.5 * tolerance_rad) & ~behind).mean())
