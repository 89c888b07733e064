"""Poses from images and the depth images beside them: metric without another source of scale, and past blank walls.

Matched features that have a depth place one image of a pair against the other (perspective-n-point in a RANSAC loop),
RGB-D odometry over all pixels refines that (Park et al., "Colored point cloud registration revisited", 2017; Open3D),
and a pose graph joins the pairs and drops wrong ones (Choi et al., "Robust reconstruction of indoor scenes", 2015;
Open3D). Images that these leave apart are joined by recorded motion, if there is any and the depth agrees (see
`recorded_edges`). COLMAP then triangulates the points with these poses.
"""

import functools
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from flight import FloatArray, MapError, Progress, frames
from mapping.camera.rig import Camera
from mapping.input.images import ImageSet
from mapping.sparse.mapper import colmap_model
from mapping.sparse.recorded_motion import recorded_edges

_STAGE = "placing images by depth"
_LEAST_MATCHES = 8
_OUTLIER_PX = 2.0
_NEAREST_M, _FARTHEST_M = 0.05, 15.0
"""Range of the depth that places features: far ones still hold the rotation."""
_ODOMETRY_M = 6.0
"""Range of the depth that odometry uses."""
_DEPTH_JUMP_M = 0.07
"""Pixels whose depths differ by more do not show the same surface."""
_LARGEST_CORRECTION_M = 0.25
"""Odometry that moves further from what the features say has slipped along a wall."""
_EDGE_M = 0.03
_PRUNED = 0.25
_HELD = 24
"""Images held in memory with their depth; pairs come in the order of their first image."""
_AGREE = 0.05
"""Two depths of one surface differ by less, relative to the depth."""
LEAST_AGREEMENT = 0.8
"""Share of the depth: two images that agree in less are not where they seem. Measured: 0.98 right, 0.65 wrong."""
_LEAST_COMMON = 500
"""Pixels that must be in both images for a comparison of their depths."""
_STRIDE = 4


@dataclass(frozen=True, slots=True, eq=False)
class _Edge:
    """How one image of a pair lies to the other."""

    T_b_a: FloatArray
    information: FloatArray
    """(6, 6) of Open3D's odometry: of the squared distances (m2) between the points of the two images."""
    matches: int
    """Features that agree with it; 0 for recorded motion."""


@dataclass(frozen=True, slots=True, eq=False)
class Placed:
    """Where the images of a depth camera were taken."""

    model: Any
    """COLMAP's, in metres, the first placed camera at its origin."""
    by_motion: np.ndarray
    """(instants,) bool: placed by recorded motion, as depth and features do not join them to the others."""
    notes: list[str]
    """Why recorded motion placed none, or not all, of the images that needed it."""


def place(database: Path, images: ImageSet, options: Any, progress: Progress) -> Placed:
    """Place the images by depth and features, and by recorded motion those that these do not join to the others.

    Args:
        database: COLMAP's, with features and matches.
        options: COLMAP's, for triangulation.

    Raises:
        MapError: no two images could be placed against each other.
    """
    edges = _edges(database, images, progress)
    if not edges:
        raise MapError(
            "no two of these images could be placed against each other; they need texture, depth and overlap"
            + ("; recorded motion cannot place them, as nothing shows where the camera sits" if images.motions else "")
        )
    T_world_camera = _optimised(edges, len(images.instants))
    recorded, notes = _recorded(images, edges, T_world_camera)
    by_motion = np.isnan(T_world_camera[:, 0, 0])
    if recorded:
        edges |= recorded
        T_world_camera = _optimised(edges, len(images.instants))
    confirmed = agreement(images, T_world_camera, edges) >= LEAST_AGREEMENT  # not where no pair shares enough (NaN)
    T_world_camera[~confirmed] = np.nan
    # recorded motion also places images without a match
    model = colmap_model.triangulated(database, images, T_world_camera, options, without_matches=True)
    return Placed(model, by_motion & confirmed, notes)


def _recorded(
    images: ImageSet, edges: dict[tuple[int, int], _Edge], T_world_camera: FloatArray
) -> tuple[dict[tuple[int, int], _Edge], list[str]]:
    """Recorded motions between images that the edges leave apart, where the depth agrees; and what to say of others.

    They are not refined by odometry: it slides along a plain wall. Their information is that of points whose distances
    have a standard deviation of `_EDGE_M`, as the pose graph takes it, and hundreds of times less than an edge's.
    """
    measured = {pair: edge.T_b_a for pair, edge in edges.items()}
    found, notes = recorded_edges.between(images, measured, T_world_camera)
    camera = images.rig.cameras[0]
    read = functools.lru_cache(maxsize=_HELD)(lambda instant: images.depth_m(instant, 0))
    confirmed: dict[tuple[int, int], _Edge] = {}
    for (a, b), each in sorted(found.items()):
        agreeing = _agreement(camera, read(a), read(b), each.T_b_a)
        if agreeing is not None and agreeing >= LEAST_AGREEMENT:
            information = np.asarray(_EDGE_M**2 * np.linalg.inv(each.covariance), dtype=np.float64)
            confirmed[a, b] = _Edge(each.T_b_a, information, 0)
    if found and not confirmed:
        notes.append("recorded motion: the depth images contradict it wherever it is needed")
    return confirmed, notes


def agreement(images: ImageSet, T_world_camera: FloatArray, pairs: Any) -> FloatArray:
    """For each instant the share of its depth that its neighbours' depth agrees with, at these poses.

    Args:
        T_world_camera: (instants, 4, 4), NaN where not placed.
        pairs: pairs of instants that see the same things.

    Returns:
        (instants,) the median over its pairs; NaN where it is not placed or no pair shares enough.
    """
    camera = images.rig.cameras[0]
    read = functools.lru_cache(maxsize=_HELD)(lambda instant: images.depth_m(instant, 0))
    shares: list[list[float]] = [[] for _ in images.instants]
    for a, b in pairs:
        if np.isfinite(T_world_camera[[a, b]]).all():
            T_b_a = frames.invert(T_world_camera[b]) @ T_world_camera[a]
            if (share := _agreement(camera, read(a), read(b), T_b_a)) is not None:
                shares[a].append(share)
                shares[b].append(share)
    return np.array([np.median(s) if s else np.nan for s in shares])


def _agreement(camera: Camera, a_m: FloatArray, b_m: FloatArray, T_b_a: FloatArray) -> float | None:
    """Share of the depth of `a` that lies where `b` measured it; what something nearer hides in `b` is left out."""
    pixels = camera.pixel_centres()[::_STRIDE, ::_STRIDE]
    depth_m = a_m[::_STRIDE, ::_STRIDE]
    known = depth_m > 0.0
    points = frames.apply(T_b_a, _at_depth(camera, pixels[known], depth_m[known]))
    seen = camera.project(points)
    inside = camera.contains(seen)
    column, row = seen[inside].astype(int).T
    there_m, here_m = b_m[row, column], points[inside, 2]
    common = (there_m > 0.0) & (there_m > (1.0 - _AGREE) * here_m)
    if common.sum() < _LEAST_COMMON / _STRIDE**2:
        return None
    return float((there_m[common] < (1.0 + _AGREE) * here_m[common]).mean())


def _at_depth(camera: Camera, pixels: FloatArray, depth_m: FloatArray) -> FloatArray:
    """(n, 3) points in the camera frame."""
    rays = camera.unproject(pixels)
    return np.asarray(rays / rays[:, 2:] * depth_m[:, None], dtype=np.float64)


def _edges(database: Path, images: ImageSet, progress: Progress) -> dict[tuple[int, int], _Edge]:
    """The pairs of instants that could be placed against each other."""
    import pycolmap

    with pycolmap.Database.open(database) as opened:
        instant_of = {images.relative(i, c): i for i, c in images.pairs()}
        rows = {row.image_id: instant_of[row.name] for row in opened.read_all_images()}
        pixels = {rows[k]: np.asarray(opened.read_keypoints(k), dtype=np.float64)[:, :2] for k in rows}
        pair_ids, matched = opened.read_all_matches()
    ids = [pycolmap.pair_id_to_image_pair(pair_id) for pair_id in pair_ids]
    pairs = {(rows[a], rows[b]): np.asarray(m, dtype=np.int64) for (a, b), m in zip(ids, matched, strict=True)}
    shot = functools.lru_cache(maxsize=_HELD)(lambda instant: _rgbd(images, instant))
    edges: dict[tuple[int, int], _Edge] = {}
    for number, (a, b) in enumerate(sorted(pairs), start=1):
        matches = pairs[a, b]
        edge = _edge(images.rig.cameras[0], shot, a, b, pixels[a][matches[:, 0]], pixels[b][matches[:, 1]])
        if edge is not None:
            edges[a, b] = edge
        progress(_STAGE, number / len(pairs))
    return edges


def _rgbd(images: ImageSet, instant: int) -> Any:
    """Image and depth as Open3D takes them."""
    import open3d

    shown = open3d.geometry.RGBDImage()
    gray: Any = images.gray(instant, 0).astype(np.float32) / np.float32(255.0)  # Open3D's stub asks for a Buffer
    depth_m: Any = images.depth_m(instant, 0).astype(np.float32)
    shown.color, shown.depth = open3d.geometry.Image(gray), open3d.geometry.Image(depth_m)
    return shown


def _edge(
    camera: Camera, shot: Callable[[int], Any], a: int, b: int, pixels_a: FloatArray, pixels_b: FloatArray
) -> _Edge | None:
    """How `a` lies to `b`, or None if the two share too little."""
    import open3d

    column, row = pixels_a.astype(int).T
    depth_m = np.asarray(shot(a).depth)[row.clip(0, camera.height - 1), column.clip(0, camera.width - 1)]
    known = (depth_m > _NEAREST_M) & (depth_m < _FARTHEST_M)
    placed = _from_features(camera, _at_depth(camera, pixels_a[known], depth_m[known]), pixels_b[known])
    if placed is None:
        return None
    T_from_features, matches = placed
    odometry = open3d.pipelines.odometry
    (fx, fy), (cx, cy) = camera.focal_px, camera.principal_point_px
    lens = open3d.camera.PinholeCameraIntrinsic(camera.width, camera.height, fx, fy, cx - 0.5, cy - 0.5)
    met, T_b_a, information = odometry.compute_rgbd_odometry(
        shot(a),
        shot(b),
        lens,
        T_from_features,
        odometry.RGBDOdometryJacobianFromHybridTerm(),
        odometry.OdometryOption(depth_diff_max=_DEPTH_JUMP_M, depth_max=_ODOMETRY_M),
    )
    if not met or np.linalg.norm(T_b_a[:3, 3] - T_from_features[:3, 3]) > _LARGEST_CORRECTION_M:
        return None
    agreeing = _agreement(camera, np.asarray(shot(a).depth), np.asarray(shot(b).depth), T_b_a)
    return _Edge(T_b_a, information, matches) if agreeing is not None and agreeing >= LEAST_AGREEMENT else None


def _from_features(camera: Camera, points_a_m: FloatArray, pixels_b: FloatArray) -> tuple[FloatArray, int] | None:
    """T_b_a from points that `a` knows and where `b` sees them, and how many agree with it."""
    import cv2

    if len(points_a_m) < _LEAST_MATCHES:
        return None
    rays = camera.unproject(pixels_b)
    flat = rays[:, :2] / rays[:, 2:]
    cv2.setRNGSeed(1)
    met, turn, shift, inliers = cv2.solvePnPRansac(
        points_a_m, flat, np.eye(3), None, reprojectionError=_OUTLIER_PX / min(camera.focal_px), iterationsCount=1000,
        confidence=0.999, flags=cv2.SOLVEPNP_AP3P,
    )  # fmt: skip
    if not met or inliers is None or len(inliers) < _LEAST_MATCHES:
        return None
    kept = np.asarray(inliers, dtype=np.int64).ravel()
    turn, shift = cv2.solvePnPRefineLM(points_a_m[kept], flat[kept], np.eye(3), None, turn, shift)
    T_b_a = np.eye(4)
    T_b_a[:3, :3], T_b_a[:3, 3] = cv2.Rodrigues(turn)[0], shift.ravel()
    return T_b_a, len(kept)


def _optimised(edges: dict[tuple[int, int], _Edge], count: int) -> FloatArray:
    """(count, 4, 4) T_world_camera of the largest connected piece; NaN elsewhere."""
    import open3d

    T_world_camera, tree = _spanned(edges, count)
    registration = open3d.pipelines.registration
    number = {int(node): k for k, node in enumerate(np.flatnonzero(np.isfinite(T_world_camera[:, 0, 0])))}
    joined = registration.PoseGraph()
    for node in number:
        joined.nodes.append(registration.PoseGraphNode(T_world_camera[node]))
    for (a, b), edge in edges.items():
        if a in number and b in number:
            joined.edges.append(
                registration.PoseGraphEdge(
                    number[a], number[b], edge.T_b_a, edge.information, uncertain=(a, b) not in tree
                )
            )
    registration.global_optimization(
        joined,
        registration.GlobalOptimizationLevenbergMarquardt(),
        registration.GlobalOptimizationConvergenceCriteria(),
        registration.GlobalOptimizationOption(max_correspondence_distance=_EDGE_M, edge_prune_threshold=_PRUNED),
    )
    for node, k in number.items():
        T_world_camera[node] = joined.nodes[k].pose
    return T_world_camera


def _spanned(edges: dict[tuple[int, int], _Edge], count: int) -> tuple[FloatArray, set[tuple[int, int]]]:
    """Poses along the edges with the most matches, in the largest connected piece, and those edges.

    The first image of the piece is at the origin; images elsewhere are NaN.
    """
    from scipy.sparse import coo_matrix
    from scipy.sparse.csgraph import breadth_first_order, connected_components, minimum_spanning_tree

    a, b = np.array(list(edges)).T
    cost = np.array([1.0 / (1 + edge.matches) for edge in edges.values()])
    graph = coo_matrix((cost, (a, b)), shape=(count, count))
    _, piece = connected_components(graph, directed=False)
    first = int(np.flatnonzero(piece == np.bincount(piece).argmax())[0])
    order, before = breadth_first_order(minimum_spanning_tree(graph), first, directed=False)
    T_world_camera = np.full((count, 4, 4), np.nan)
    T_world_camera[first] = np.eye(4)
    tree: set[tuple[int, int]] = set()
    for node in map(int, order[1:]):
        parent = int(before[node])
        forward = (parent, node) in edges
        tree.add((parent, node) if forward else (node, parent))
        T_parent_node = frames.invert(edges[parent, node].T_b_a) if forward else edges[node, parent].T_b_a
        T_world_camera[node] = T_world_camera[parent] @ T_parent_node
    return T_world_camera, tree
