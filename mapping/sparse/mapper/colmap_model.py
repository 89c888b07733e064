"""COLMAP's model as our arrays, and back: cameras, poses, what the points explain in the images."""

import tempfile
from pathlib import Path
from typing import Any

import numpy as np

from flight import FloatArray, MapError, frames
from mapping.camera.adjustment import Observations
from mapping.camera.errors import State
from mapping.camera.rig import Camera, Rig
from mapping.camera.trial import Trial
from mapping.input.images import ImageSet

_LOST_PX = 30.0
"""Reprojection error of a point that is lost: no error of a lens that remains is as large."""


def colmap_camera(camera: Camera, *, camera_id: int = 0) -> Any:
    """COLMAP's camera of ours; its `verify_params` guards against uninitialised numbers."""
    import pycolmap

    made = pycolmap.Camera(
        camera_id=camera_id, model=camera.model, width=camera.width, height=camera.height, params=camera.params
    )
    # without this COLMAP calls every fisheye pair degenerate and finds no match at all
    made.has_prior_focal_length = True
    if not made.verify_params():
        raise MapError(f"COLMAP refuses the parameters of camera {camera.name!r}: {camera.params.tolist()}")
    return made


def cam_from_rig(rig: Rig) -> list[Any]:
    """Each camera's pose on COLMAP's rig, whose origin is the first camera."""
    import pycolmap

    T_body_rig = rig.cameras[0].T_body_camera
    return [pycolmap.Rigid3d((frames.invert(c.T_body_camera) @ T_body_rig)[:3]) for c in rig]


def poses(model: Any, images: ImageSet) -> tuple[FloatArray, np.ndarray, Rig]:
    """T_world_body (instants, 4, 4), what is registered (instants, cameras), and the rig with the model's lenses."""
    where = {images.relative(i, c): (i, c) for i, c in images.pairs()}
    T_world_body = np.full((len(images.instants), 4, 4), np.nan)
    registered = np.zeros(images.present.shape, dtype=bool)
    params: dict[str, FloatArray] = {}
    for image_id in model.reg_image_ids():
        image = model.image(image_id)
        instant, camera = where[image.name]
        params[images.rig.cameras[camera].name] = np.array(image.camera.params)
        T_camera_world = np.eye(4)
        T_camera_world[:3] = image.cam_from_world().matrix()
        # the first camera defines the body's pose; the others may have been moved relative to it
        if not registered[instant, :camera].any():
            T_world_body[instant] = frames.invert(images.rig.cameras[camera].T_body_camera @ T_camera_world)
        registered[instant, camera] = True
    return T_world_body, registered, images.rig.with_params(params)


def observations(model: Any, images: ImageSet) -> Observations:
    """What the model explains, in its own world frame; points in the order of their COLMAP numbers."""
    T_world_body, _, rig = poses(model, images)
    where = {images.relative(i, c): (i, c) for i, c in images.pairs()}
    index_of = {point_id: index for index, point_id in enumerate(sorted(model.point3D_ids()))}
    observations: list[np.ndarray] = []
    pixels: list[np.ndarray] = []
    for image_id in model.reg_image_ids():
        image = model.image(image_id)
        seen = [image.point2D(int(k)) for k in image.get_observation_point2D_idxs()]
        points = np.array([index_of[p.point3D_id] for p in seen], dtype=np.int64)
        observations.append(np.column_stack([points, np.tile(where[image.name], (len(points), 1))]))
        pixels.append(np.array([p.xy for p in seen]).reshape(-1, 2))
    points_world = np.array([model.point3D(k).xyz for k in index_of]).reshape(-1, 3)
    return Observations(
        rig, T_world_body, points_world, np.concatenate(observations), np.concatenate(pixels), images.time_s
    )


def sizes_px(database: Path, model: Any) -> FloatArray:
    """(o,) size of the feature of each of the `observations`."""
    import pycolmap

    with pycolmap.Database.open(database) as opened:
        sizes = [
            np.asarray(opened.read_keypoints(image_id))[model.image(image_id).get_observation_point2D_idxs(), 2]
            for image_id in model.reg_image_ids()
        ]
    return np.concatenate(sizes).astype(np.float64)


def triangulated(
    database: Path, images: ImageSet, T_world_rig: FloatArray, options: Any, *, without_matches: bool
) -> Any:
    """COLMAP's model with these poses, and the points that the matches have in common.

    Args:
        T_world_rig: (instants, 4, 4) of the first camera; NaN where not placed.
        options: COLMAP's.
        without_matches: whether images without a match are in it too.
    """
    import pycolmap

    with pycolmap.Database.open(database) as opened:
        chosen = pycolmap.DatabaseCacheOptions(load_all_images=without_matches)
        cache = pycolmap.DatabaseCache.create(opened, chosen)
    model = pycolmap.Reconstruction()
    model.load(cache)
    instant_of = {images.relative(i, c): i for i, c in images.pairs()}
    for image in model.images.values():
        T = T_world_rig[instant_of[image.name]]
        if np.isfinite(T).all():
            model.frame(image.frame_id).rig_from_world = pycolmap.Rigid3d(frames.invert(T)[:3])
            model.register_frame(image.frame_id)
    with tempfile.TemporaryDirectory(dir=database.parent) as folder:
        return pycolmap.triangulate_points(model, database, images.folder, folder, options=options)


def write_back(model: Any, images: ImageSet, adjusted: Trial | State) -> None:
    """Give the model the calibration, poses and points of an adjustment of its `observations`."""
    import pycolmap

    for number, (camera, pose) in enumerate(zip(adjusted.rig, cam_from_rig(adjusted.rig), strict=True), start=1):
        made = colmap_camera(camera, camera_id=number)
        model.camera(number).model, model.camera(number).params = made.model, made.params
        if number > 1:
            model.rig(1).set_sensor_from_rig(pycolmap.sensor_t(pycolmap.SensorType.CAMERA, number), pose)
    instant_of = {images.relative(i, c): i for i, c in images.pairs()}
    T_rig_body = frames.invert(adjusted.rig.cameras[0].T_body_camera)
    for image_id in model.reg_image_ids():
        image = model.image(image_id)
        T_rig_world = T_rig_body @ frames.invert(adjusted.T_world_body[instant_of[image.name]])
        model.frame(image.frame_id).rig_from_world = pycolmap.Rigid3d(T_rig_world[:3])
    for point_id, xyz in zip(sorted(model.point3D_ids()), adjusted.points_world, strict=True):
        model.point3D(point_id).xyz = xyz


def drop_lost_points(model: Any) -> None:
    """Remove observations of points that the corrected calibration puts behind the camera or out of its image.

    There are a dozen in a map, but the projection of one is anything: the mean of all errors was 1e151 px.
    """
    import pycolmap

    pycolmap.ObservationManager(model).filter_all_points3D(_LOST_PX, 0.0)
