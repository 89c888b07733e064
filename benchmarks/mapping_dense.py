"""Rendering, dense depth, fusion: CPU seconds and accuracy on the rendered room with true poses."""

import time

import numpy as np
import report

from flight import FloatArray, frames
from goshawk.rendered import accuracy as map_accuracy
from goshawk.rendered import scene as rendered_room
from goshawk.rendered import world as rendered_world
from mapping.camera.rig import Camera
from mapping.dense import stereo, surface
from mapping.dense.surface import DenseOptions, ImageView

PAIRS = 60


def rows() -> list[report.Row]:
    """Rendering, dense depth, fusion: CPU seconds and accuracy on the rendered room with true poses."""
    scene, rig, flight = rendered_room.furnished(), rendered_world.default_rig(), rendered_world.loop_flight(PAIRS)
    clock = time.process_time
    start = clock()
    views = [
        ImageView(c, T @ c.T_body_camera, rendered_world.render(c, T, scene=scene, seed=i, gain=gain(i, number)))
        for i, T in enumerate(flight.T_world_body)
        for number, c in enumerate(rig)
    ]
    rendered_s = clock() - start
    options = DenseOptions()
    start = clock()
    depths = list(surface.depth_images(views, options.stereo))
    depth_s = clock() - start
    start = clock()
    volume = surface.fuse(views, depths, options)
    fused_s = clock() - start
    start = clock()
    result = surface.extract(surface.measured(volume, options), views, depths, options)
    extracted_s = clock() - start
    seen = map_accuracy.seen_surface(scene, [(v.camera, v.T_world_camera) for v in views], rng=np.random.default_rng(0))
    score = map_accuracy.compare(scene, seen, result.vertices_world_m, result.state, result.grid)
    total_s = depth_s + fused_s + extracted_s
    row = report.row
    return [
        row("render 60 pairs 640x480", rendered_s, "CPU s", "< 120", rendered_s < 120),
        row("dense depth, 120 images", depth_s, "CPU s"),
        row("fusion, 5 cm voxels", fused_s, "CPU s"),
        row("mesh and state grid", extracted_s, "CPU s"),
        row("dense in all", total_s, "CPU s", "< 49 (prototype)", total_s < 49),
        row("pixels with depth", 100 * result.statistics.share_with_depth, "%"),
        row("mesh: median error", 1000 * score.median_error_m, "mm", "< 7 (prototype)", score.median_error_m < 0.007),
        row("mesh: within 5 cm", 100 * score.share_within_5cm, "%", ">= 98", score.share_within_5cm >= 0.98),
        row("seen surface within 5 cm of mesh", 100 * score.seen_share_within_5cm, "%"),
        row("seen surface in a free voxel", 100 * score.seen_share_free, "%"),
        row(
            "seen surface in a hole of 10 cm",
            100 * score.seen_share_in_holes,
            "%",
            "< 0.1",
            score.seen_share_in_holes < 1e-3,
        ),
        row(
            "free voxels inside matter",
            100 * score.free_share_in_matter,
            "%",
            "< 0.1",
            score.free_share_in_matter < 1e-3,
        ),
        *fusion_beside_open3d(scene, flight.T_world_body[::2]),
    ]


def gain(index: int, camera_number: int) -> float:
    return rendered_world.GAIN * rendered_world.exposure_change(index, camera_number)


def fusion_beside_open3d(scene: rendered_room.RenderedScene, T_world_body: FloatArray) -> list[report.Row]:
    """The same perfect pinhole depth images into our volume and into Open3D's."""
    camera = Camera("pinhole", ".", "PINHOLE", 640, 480, np.array([400.0, 400.0, 320.0, 240.0]), np.eye(4))
    T_body_camera = rendered_world.default_rig()["front"].T_body_camera
    shades = np.full((480, 640, 3), 128, np.uint8)
    views = [ImageView(camera, T @ T_body_camera, shades) for T in T_world_body]
    rays = stereo.depth_rays(views[0], 1.0)
    depths_m = []
    for view in views:
        directions = rays.reshape(-1, 3) @ view.T_world_camera[:3, :3].T
        ranges = rendered_world.cast_rays(scene, view.position_world_m, directions)
        depths_m.append(ranges.reshape(480, 640) * rays[..., 2])
    start = time.process_time()
    depths = [stereo.depth_from_sensor(v, d) for v, d in zip(views, depths_m, strict=True)]
    ours = surface.reconstruct(views, DenseOptions(farthest_m=8.0), depths=depths).vertices_world_m
    ours_s = time.process_time() - start
    start = time.process_time()
    theirs = open3d_vertices(views, depths_m, voxel_m=0.05, truncation_voxels=2.5, farthest_m=8.0)
    theirs_s = time.process_time() - start
    ours_mm, theirs_mm = (1000 * float(np.quantile(np.abs(scene.distance(v)), 0.9)) for v in (ours, theirs))
    name = f"{len(views)} RGB-D images to mesh"
    return [
        report.row(f"{name}: CPU", ours_s, "CPU s", "<= Open3D", ours_s <= theirs_s, {"open3d": theirs_s}),
        report.row(f"{name}: 90 % error", ours_mm, "mm", "<= Open3D", ours_mm <= theirs_mm, {"open3d": theirs_mm}),
    ]


def open3d_vertices(
    views: list[ImageView], depths_m: list[FloatArray], *, voxel_m: float, truncation_voxels: float, farthest_m: float
) -> FloatArray:
    import open3d as o3d

    core, image = o3d.core, o3d.t.geometry.Image
    kinds = (core.float32, core.uint16, core.uint16)
    volume = o3d.t.geometry.VoxelBlockGrid(
        ("tsdf", "weight", "color"), kinds, ((1,), (1,), (3,)), voxel_m, 16, 20_000, core.Device("CPU:0")
    )
    # pixel centres at whole numbers there, at .5 here
    lens = core.Tensor(np.array([[400.0, 0.0, 319.5], [0.0, 400.0, 239.5], [0.0, 0.0, 1.0]]))
    for view, depth_m in zip(views, depths_m, strict=True):
        T_camera_world = core.Tensor(frames.invert(view.T_world_camera))
        depth = image(core.Tensor(depth_m.astype(np.float32)))
        colour = image(core.Tensor(view.pixels.astype(np.float32)))
        reach = (1.0, farthest_m, truncation_voxels)
        blocks = volume.compute_unique_block_coordinates(depth, lens, T_camera_world, *reach)
        volume.integrate(blocks, depth, colour, lens, T_camera_world, *reach)
    return volume.extract_triangle_mesh(weight_threshold=0.5).vertex.positions.numpy().astype(np.float64)


if __name__ == "__main__":
    report.main(rows)
