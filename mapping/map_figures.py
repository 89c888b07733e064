"""The figures of a map's making: how well its images fit together, where its scale is from, how much it shows."""

import dataclasses
from dataclasses import dataclass
from typing import Any

import numpy as np

import esdf
from flight import FloatArray
from mapping import verdict
from mapping.dense import confidence, resolution, surface
from mapping.sparse import reconstruction
from mapping.sparse.reconstruction import SparseMap


@dataclass(frozen=True, slots=True)
class MapReport:
    """Figures of the finished map. Written as `report.json`."""

    images: int
    """Images in the folder."""
    images_placed: int
    """Images that have a pose in the map."""
    not_placed: list[str]
    """The others."""
    placed_by_motion: list[str]
    """Images placed by recorded motion, as depth and features do not join them to the others."""
    motion_notes: list[str]
    """Why recorded motion placed none, or not all, of the images that needed it; with depth images only."""
    image_notes: list[str]
    """What was done, or not, in reading the images: orientation tags."""
    unplaced_runs: list[dict[str, Any]]
    """Runs of instants without a pose, and their matches with their neighbours; see `sparse.overlap.UnplacedRun`."""
    reprojection_error_px: float
    """Mean over all observations."""
    least_agreement: float
    """Smallest share of matches that agree with the map, over the placed images; below 0.85 an image is not placed,
    unless depth images place it."""
    points: int
    """Sparse points."""
    scale_source: str
    """Source of the metric scale."""
    up_source: str
    """Source of the up direction."""
    position_residual_m: float | None
    """Median distance to recorded positions, if there are any."""
    scale_ratio_to_positions: float | None
    """This scale divided by the scale from recorded positions alone, if there are any."""
    scale_witnesses: list[dict[str, Any]]
    """Every source of scale: its name, the map's scale divided by its, and its relative standard deviation."""
    motions: list[dict[str, Any]]
    """How recorded poses and odometry fit the map where they did not place its images, see
    `mapping.sparse.recorded_motion.motion.MotionCheck`."""
    verdict: str
    """"good", "doubtful" or "refused"; see `verdict`."""
    reasons: list[str]
    """Why it is not good."""
    corrections: list[str]
    """What was wrong with the camera file and is right in the map."""
    calibration: list[dict[str, Any]]
    """The trial of the camera file: one entry for each error it may have had; see `calibration.trial.Finding`."""
    residual_field: list[dict[str, Any]]
    """Reprojection errors over each camera's image; see `camera.residual_field.field`."""
    residual_radius: list[dict[str, Any]]
    """The same over the angle from each camera's optical axis; see `camera.residual_field.over_radius`."""
    residual_time: list[dict[str, Any]]
    """The same for each placed image of each camera; see `sparse.reconstruction.residuals_over_time`."""
    position_std_m: list[float | None]
    """Standard deviation of each placed image's position, about the middle of the path; None where it is not known."""
    shape_std_m: list[float | None]
    """The same without that of the scale."""
    path_length_m: float
    """From the first placed image to the last."""
    lenses: dict[str, list[float]]
    """Parameters of each camera in the map."""
    mesh_vertices: int
    """Of `mesh.glb`."""
    mesh_faces: int
    """Of `mesh.glb`."""
    free_m3: float
    """Space known to be empty."""
    occupied_m3: float
    """Space known to be filled."""
    inferred_m3: float
    """Unknown space that a plain wall must pass through."""
    contradicted_m3: float
    """Space that depth images show as free and that several images contradict; it is unknown."""
    surface_std_median_m: float
    """Median of the standard deviation of the mesh's vertices along the surface's normal; see `dense.confidence`."""
    surface_std_90_percent_m: float
    """Nine tenths of the surface are better."""
    surface_share_worse_than_voxel: float
    """Share of the surface whose standard deviation is above the edge of a voxel."""
    carrier_radius_m: float
    """Radius about each camera within which what carried it is evidence of free space."""
    swept_occupied_m3: float
    """Space within that radius that stays occupied, because the images show a surface there."""
    resolved_m: dict[str, float]
    """Thickness of the thinnest obstacle that is resolved in half, and in nine tenths, of the free space."""
    depth: dict[str, float]
    """Statistics of the depth images."""
    hash: str
    """Of the distance field, as built."""
    cpu_s: dict[str, float]
    """CPU seconds of each step, all threads and processes."""

    def as_dict(self) -> dict[str, Any]:
        return dataclasses.asdict(self)

    def facts(self) -> dict[str, Any]:
        """The main figures, of `map.toml`."""
        names = (
            "verdict",
            "reasons",
            "hash",
            "scale_source",
            "up_source",
            "images",
            "images_placed",
            "reprojection_error_px",
            "path_length_m",
            *confidence.FIGURES,
            "carrier_radius_m",
        )
        return {name: getattr(self, name) for name in names}


def report(
    placed: SparseMap, surface: surface.Reconstruction, carrier_radius_m: float, hash: str, cpu_s: dict[str, float]
) -> MapReport:
    """Of a map's poses and surface.

    Args:
        hash: of the distance field; cpu_s: of each step.
    """
    voxel_m3 = float(np.prod(surface.grid.voxel_m))
    judged = verdict.judge(placed)
    path = placed.T_world_body[placed.placed, :3, 3]
    return MapReport(
        images=placed.images.count,
        images_placed=int(placed.registered.sum()),
        not_placed=list(reconstruction.unplaced(placed)),
        placed_by_motion=[placed.images.relative(instant, 0) for instant in placed.by_motion],
        motion_notes=placed.motion_notes,
        image_notes=list(placed.images.notes),
        unplaced_runs=[dataclasses.asdict(run) for run in reconstruction.unplaced_runs(placed)],
        reprojection_error_px=placed.reprojection_error_px,
        least_agreement=placed.least_agreement,
        points=len(placed.points_world_m),
        scale_source=placed.alignment.scale_source,
        up_source=placed.alignment.up_source,
        position_residual_m=placed.alignment.position_residual_m,
        scale_ratio_to_positions=placed.alignment.scale_ratio_to_positions,
        scale_witnesses=[dataclasses.asdict(witness) for witness in placed.alignment.witnesses],
        motions=[dataclasses.asdict(check) for check in placed.alignment.motions],
        verdict=judged.standing,
        reasons=list(judged.reasons),
        corrections=list(judged.corrections),
        calibration=[finding.as_dict() for finding in placed.trial.findings],
        residual_field=reconstruction.residual_fields(placed),
        residual_radius=reconstruction.residuals_over_radius(placed),
        residual_time=reconstruction.residuals_over_time(placed),
        position_std_m=_rounded(placed.position_std_m[placed.placed]),
        shape_std_m=_rounded(placed.shape_std_m[placed.placed]),
        path_length_m=float(np.linalg.norm(np.diff(path, axis=0), axis=1).sum()),
        lenses={camera.name: camera.params.tolist() for camera in placed.rig},
        mesh_vertices=len(surface.vertices_world_m),
        mesh_faces=len(surface.faces),
        free_m3=float((surface.state == esdf.FREE).sum()) * voxel_m3,
        occupied_m3=float((surface.state == esdf.OCCUPIED).sum()) * voxel_m3,
        inferred_m3=float(surface.inferred.sum()) * voxel_m3,
        contradicted_m3=0.0 if surface.looks is None else float(surface.looks.contradicted.sum()) * voxel_m3,
        **confidence.figures(surface.confidence, surface.grid.voxel_m[0]),
        carrier_radius_m=carrier_radius_m,
        swept_occupied_m3=surface.swept_occupied_m3,
        resolved_m=resolution.thickness_quantiles_m(surface.seen, surface.grid, surface.state == esdf.FREE),
        depth=dataclasses.asdict(surface.statistics),
        hash=hash,
        cpu_s=cpu_s,
    )


def _rounded(std_m: FloatArray) -> list[float | None]:
    """To a tenth of a millimetre; None for NaN."""
    return [round(float(value), 4) if np.isfinite(value) else None for value in std_m]
