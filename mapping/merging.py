"""Two maps in one: registered by the points that both have, refined on their surfaces, refused where they contradict.

1. Points of one map that mean a point of the other, by their descriptors.
2. The similarity that most of these pairs agree on (RANSAC, Open3D). Its scale must be one: both maps are metric.
3. The rigid motion of those pairs, refined by point-to-plane ICP on the meshes (Open3D).
4. Surfaces of each map in space that the other saw empty: few, or this is no overlap but a mistake.
"""

import dataclasses
from dataclasses import dataclass
from typing import Any

import numpy as np

import esdf
from esdf import moved as moving
from esdf import regrid
from flight import FloatArray, MapError, Progress, frames, rotations, silent
from mapping import inferred_layer
from mapping.camera.rig import Rig
from mapping.dense import confidence, occupancy, resolution
from mapping.localization import relocalization
from mapping.localization.relocalization import LocalizationOptions
from mapping.map_folder import has_earlier_free_space
from mapping.map_parts import HISTORY, MapParts, mesh_of, moved
from mapping.sparse import tracks
from mapping.sparse.localization_map import LocalizationMap
from mapping.verdict import SCALE_DOUBT, Standing

_WITHIN_M = 0.10
"""Largest distance of two places of one point, and of surfaces that ICP takes for one."""
_LEAST_PAIRS, _LEAST_SHARE = 50, 0.15
"""Pairs that must agree on one motion; their share of all is smaller by chance."""
_TRIALS = 20_000
_LEAST_SEEN_BY_BOTH = 0.05
"""Share of the smaller mesh that the other map must have seen, too."""
_SAME_FOCAL, _SAME_PLACE = 0.03, 0.03
"""How far cameras of one rig may differ: focal length, relative; elements of T_body_camera, metres or radians."""
_RESIDUALS = 2.0
"""Medians of the distance of two places of one point that 99 % of such distances are below (Maxwell's distribution)."""
_MOST_CONTRADICTION = 0.10
"""Share of the surfaces seen by both that one map may show in the other's free space: things are moved."""


@dataclass(frozen=True, slots=True, eq=False)
class Registration:
    """Where one map lies in another, and what speaks for it."""

    T_first_second: FloatArray
    """(4, 4) rigid."""
    pairs: np.ndarray
    """(k, 2) points of the first and of the second map that are one point."""
    matches: int
    """Points that looked alike."""
    residual_m: float
    """Median distance of the pairs."""
    scale: float
    """The second map's lengths in the first map's; its own are kept."""
    seen_by_both: float
    """Share of the smaller mesh that lies where the other map is known."""
    contradiction: float
    """Share of those surfaces that lie deep in the other map's free space."""

    def as_dict(self) -> dict[str, Any]:
        """For JSON."""
        return {
            "T_first_second": self.T_first_second.tolist(),
            "pairs": len(self.pairs),
            **{
                name: getattr(self, name)
                for name in ("matches", "residual_m", "scale", "seen_by_both", "contradiction")
            },
        }


def register(first: MapParts, second: MapParts, *, progress: Progress = silent) -> Registration:
    """Find where `second` lies in `first`.

    Raises:
        MapError: too little is common to both, their scales differ, or their surfaces contradict each other.
    """
    progress("matching points", 0.0)
    a, b = first.known, second.known
    of_b, of_a = relocalization.match(b.descriptors, a.descriptors, LocalizationOptions().ratio)
    pairs = np.column_stack([of_a, of_b])
    kept, scale = _agreeing(a.points_world_m[of_a], b.points_world_m[of_b])
    if kept.sum() < max(_LEAST_PAIRS, _LEAST_SHARE * len(pairs)):
        raise MapError(
            f"{first.name} and {second.name} have too little in common: {int(kept.sum())} of {len(pairs)} similar "
            f"points agree on one motion, at least {_LEAST_PAIRS} and {_LEAST_SHARE:.0%} must; take images of the "
            "space between them"
        )
    if abs(scale - 1.0) > SCALE_DOUBT:
        raise MapError(
            f"{second.name} is {1.0 / scale:.3f} times as large as {first.name}: one of the scales is wrong; see the "
            "sources of scale in both report.json"
        )
    progress("refining on the surfaces", 0.4)
    pairs = pairs[kept]
    places = a.points_world_m[pairs[:, 0]], b.points_world_m[pairs[:, 1]]
    T = _refined(_rigid(*places), places, first, second)
    progress("comparing the surfaces", 0.8)
    common, contradiction = _compared(first, second, T)
    if common < _LEAST_SEEN_BY_BOTH:
        raise MapError(
            f"only {common:.1%} of the smaller mesh was seen by the other map, too, at least {_LEAST_SEEN_BY_BOTH:.0%} "
            "must be; take images of the space between them"
        )
    if contradiction > _MOST_CONTRADICTION:
        raise MapError(
            f"{contradiction:.0%} of the surfaces that both maps saw lie in the other's free space, at most "
            f"{_MOST_CONTRADICTION:.0%} may: these places only look alike, or much was moved between the maps"
        )
    residual_m = float(np.median(_apart(T, places)))
    return Registration(T, pairs, len(of_a), residual_m, scale, common, contradiction)


def merged(first: MapParts, second: MapParts, found: Registration) -> MapParts:
    """Both maps in the first one's frame and voxels.

    A voxel that either map saw is known, one occupied in either is occupied; the second map's voxels, which are turned,
    grow by up to one, and by twice the registration's residual: nearly all common points are nearer to each other. The
    camera file is the first map's. Poses of the second are left out if another rig took its images. What each pilot
    freed stays free as far as the other map shows nothing there.
    """
    first, second = _settled(first), _settled(second)
    sentence = (
        f"joined {first.name} ({first.field.hash[:8]}) and {second.name} ({second.field.hash[:8]}), "
        f"{len(found.pairs)} common points, {1000.0 * found.residual_m:.0f} mm"
    )
    uncertain_m = _RESIDUALS * found.residual_m
    turned = moving.moved_field(second.field, found.T_first_second, lattice=first.field.grid, uncertain_m=uncertain_m)
    if (turned.cap_m, turned.unknown) != (first.field.cap_m, first.field.unknown):
        turned = esdf.build(turned.state, turned.grid, cap_m=first.field.cap_m, unknown=first.field.unknown)
    field = regrid.merge(first.field, turned)
    other = moved(second, found.T_first_second, sentence)
    new = ~_near(other.vertices_world_m, first.vertices_world_m, 1.5 * max(first.field.grid.voxel_m))
    vertices, faces, colours, added = mesh_of(other, new)
    sure = confidence.joined(first.confidence, added)
    if not _same_rig(first.rig, second.rig):
        sentence += f"; without the poses of {second.name}, whose camera file is another one"
        empty = other.T_world_body[:0]
        other = dataclasses.replace(other, images=(), time_s=other.time_s[:0], T_world_body=empty, tracks=tracks.none())
    single = np.ones(len(other.known.points_world_m), bool)
    single[found.pairs[:, 1]] = False
    known = LocalizationMap(
        np.concatenate([first.known.points_world_m, other.known.points_world_m[single]]),
        np.concatenate([first.known.descriptors, other.known.descriptors[single]]),
    )
    seen_again = other.tracks.part(single, np.ones(len(other.images), bool)).shifted(
        len(first.known.points_world_m), len(first.images)
    )
    return dataclasses.replace(
        first,
        field=field,
        edits=_joined(
            moving.moved_edits(first.edits, np.eye(4), field.grid),
            moving.moved_edits(second.edits, found.T_first_second, field.grid),
            second.name,
        ),
        vertices_world_m=np.concatenate([first.vertices_world_m, vertices]),
        faces=np.concatenate([first.faces, faces + len(first.vertices_world_m)]),
        colours=np.concatenate([first.colours, colours]),
        confidence=sure,
        known=known,
        tracks=tracks.joined(first.tracks, seen_again),
        images=_all_images(first, other),
        time_s=np.concatenate([first.time_s, other.time_s]),
        T_world_body=np.concatenate([first.T_world_body, other.T_world_body]),
        seen=resolution.joined(field, [(first.seen, first.field), (other.seen, turned)]),
        inferred=inferred_layer.joined(
            field,
            [
                (first.inferred, first.field),
                (inferred_layer.moved(second.inferred, second.field, found.T_first_second, turned), turned),
            ],
        ),
        occupancy=occupancy.joined(
            field,
            [
                (first.occupancy, first.field),
                (
                    None
                    if second.occupancy is None
                    else occupancy.moved(second.occupancy, second.field, found.T_first_second, turned),
                    turned,
                ),
            ],
        ),
        facts=_facts(first, second, sentence) | confidence.figures(sure, field.grid.voxel_m[0]),
        report=None,
    )


def _agreeing(a: FloatArray, b: FloatArray) -> tuple[np.ndarray, float]:
    """Which pairs (n, 3) agree on one similarity from b to a, and its scale."""
    import open3d

    if len(a) < 3:
        return np.zeros(len(a), bool), 1.0
    registration = open3d.pipelines.registration
    open3d.utility.random.seed(0)
    same = open3d.utility.Vector2iVector(np.repeat(np.arange(len(a), dtype=np.int32)[:, None], 2, axis=1))
    answer = registration.registration_ransac_based_on_correspondence(
        _cloud(b),
        _cloud(a),
        same,
        _WITHIN_M,
        registration.TransformationEstimationPointToPoint(with_scaling=True),
        3,
        [registration.CorrespondenceCheckerBasedOnEdgeLength(0.8)],
        registration.RANSACConvergenceCriteria(_TRIALS, 0.9999),
    )
    T = np.array(answer.transformation)
    kept = _apart(T, (a, b)) < _WITHIN_M
    return kept, float(np.cbrt(np.linalg.det(T[:3, :3])))


def _rigid(a: FloatArray, b: FloatArray) -> FloatArray:
    """(4, 4) from b to a, least squares."""
    import open3d

    same = open3d.utility.Vector2iVector(np.repeat(np.arange(len(a), dtype=np.int32)[:, None], 2, axis=1))
    estimation = open3d.pipelines.registration.TransformationEstimationPointToPoint()
    return np.array(estimation.compute_transformation(_cloud(b), _cloud(a), same))


def _cloud(points: FloatArray) -> Any:
    import open3d

    return open3d.geometry.PointCloud(open3d.utility.Vector3dVector(points))


def _apart(T_first_second: FloatArray, places: tuple[FloatArray, FloatArray]) -> FloatArray:
    return np.linalg.norm(places[0] - frames.apply(T_first_second, places[1]), axis=1)


def _refined(T: FloatArray, places: tuple[FloatArray, FloatArray], first: MapParts, second: MapParts) -> FloatArray:
    """The motion after ICP; that of the points alone where ICP leaves them (it slides along a plain corridor)."""
    import open3d

    clouds = []
    for parts in (first, second):
        cloud = _cloud(parts.vertices_world_m).voxel_down_sample(max(parts.field.grid.voxel_m))
        cloud.estimate_normals(open3d.geometry.KDTreeSearchParamKNN(20))
        clouds.append(cloud)
    registration = open3d.pipelines.registration
    answer = registration.registration_icp(
        clouds[1], clouds[0], _WITHIN_M, T, registration.TransformationEstimationPointToPlane()
    )
    refined = np.array(answer.transformation)
    refined[:3, :3] = rotations.matrix(rotations.from_matrix(refined[:3, :3]))
    before_m, after_m = (np.median(_apart(each, places)) for each in (T, refined))
    return refined if after_m < 1.5 * before_m else T


def _compared(first: MapParts, second: MapParts, T_first_second: FloatArray) -> tuple[float, float]:
    """Share of the smaller mesh seen by both, and share of what both saw that lies deep in free space of the other."""
    shares, seen, deep = [], 0, 0
    for mesh, other, T in ((second, first, T_first_second), (first, second, frames.invert(T_first_second))):
        vertices = frames.apply(T, mesh.vertices_world_m)
        known = vertices[other.field.status(vertices) == esdf.KNOWN]
        deep_m = 2.0 * other.field.grid.half_diagonal_m + 0.05
        shares.append(len(known) / max(len(vertices), 1))
        seen, deep = seen + len(known), deep + int((other.field.distance(known) > deep_m).sum())
    return max(shares), deep / max(seen, 1)


def _same_rig(first: Rig, second: Rig) -> bool:
    """Whether both are one rig, but for what the images of each refined."""
    if [(c.name, c.model, c.width, c.height) for c in first] != [(c.name, c.model, c.width, c.height) for c in second]:
        return False
    return all(
        np.allclose(a.focal_px, b.focal_px, rtol=_SAME_FOCAL)
        and np.abs(a.T_body_camera - b.T_body_camera).max() < _SAME_PLACE
        for a, b in zip(first, second, strict=True)
    )


def _near(points_m: FloatArray, others_m: FloatArray, within_m: float) -> np.ndarray:
    """(n,) whether one of the others is that near."""
    from scipy.spatial import KDTree

    if not len(others_m):
        return np.zeros(len(points_m), bool)
    distance_m, _ = KDTree(others_m).query(points_m, distance_upper_bound=within_m)
    return np.isfinite(distance_m)


def _settled(parts: MapParts) -> MapParts:
    """The map with its edits in its voxels, up to the last that frees space; no-fly zones stay edits.

    An edit that frees space is about what its own map shows, and must not free what another one does.
    """
    last = max((n for n, edit in enumerate(parts.edits, 1) if edit.action in ("remove", "clear")), default=0)
    done = [edit for edit in parts.edits[:last] if edit.action != "no-fly"]
    if not done:
        return parts
    kept = tuple(edit for n, edit in enumerate(parts.edits, 1) if n > last or edit.action == "no-fly")
    return dataclasses.replace(parts, field=esdf.Editor(parts.field, done).snapshot(), edits=kept)


def _joined(first: tuple[esdf.Edit, ...], second: tuple[esdf.Edit, ...], name: str) -> tuple[esdf.Edit, ...]:
    """Both lists; a no-fly zone of a name that exists gets the second map's name in front."""
    names = {edit.name for edit in first if edit.action == "no-fly"}
    again = (
        dataclasses.replace(edit, name=f"{name}: {edit.name}")
        if edit.action == "no-fly" and edit.name in names
        else edit
        for edit in second
    )
    return (*first, *again)


def _all_images(first: MapParts, second: MapParts) -> tuple[str, ...]:
    """Names of all images; where one occurs in both, all of the second map's get its name in front."""
    names, number = second.images, 2 if second.name == first.name else 1
    while set(first.images) & set(names):  # those of a map that was joined before have a name in front already
        folder = second.name if number == 1 else f"{second.name}-{number}"
        names, number = tuple(f"{folder}/{image}" for image in second.images), number + 1
    return (*first.images, *names)


def _facts(first: MapParts, second: MapParts, sentence: str) -> dict[str, Any]:
    """Facts of the joined map; its verdict is the worse one, its carrier's radius what holds about every camera."""
    a, b = first.facts, second.facts
    order = [Standing.GOOD, Standing.NOT_JUDGED, Standing.DOUBTFUL, Standing.REFUSED]  # by what planning asks
    worse = max((facts.get("verdict", Standing.NOT_JUDGED) for facts in (a, b)), key=order.index)
    facts: dict[str, Any] = {
        "verdict": str(worse),
        "reasons": _said(first, second, "reasons"),
        HISTORY: [*_said(first, second, HISTORY), sentence],
    }
    for name in ("images", "images_placed", "path_length_m"):
        if name in a and name in b:
            facts[name] = a[name] + b[name]
    radii_m = [facts["carrier_radius_m"] for facts in (a, b) if "carrier_radius_m" in facts]
    if radii_m and not any(has_earlier_free_space(facts) for facts in (a, b)):
        facts["carrier_radius_m"] = min(radii_m)
    if sources := list(dict.fromkeys(facts["scale_source"] for facts in (a, b) if "scale_source" in facts)):
        facts["scale_source"] = " and ".join(sources)
    if "up_source" in a:
        facts["up_source"] = a["up_source"]
    return facts


def _said(first: MapParts, second: MapParts, name: str) -> list[str]:
    """Sentences of both maps, with the map's name in front."""
    return [f"{parts.name}: {sentence}" for parts in (first, second) for sentence in parts.facts.get(name, [])]
