"""Points that a corrected calibration puts behind a camera leave the map, and its mean error stays finite."""

import pycolmap

from mapping.sparse.mapper import colmap_model


def mean_error_px(model: pycolmap.Reconstruction) -> float:
    model.update_point_3d_errors()
    return model.compute_mean_reprojection_error()


def test_a_point_behind_its_cameras_is_dropped_and_no_other() -> None:
    options = pycolmap.SyntheticDatasetOptions()
    options.num_rigs, options.num_frames_per_rig, options.num_points3D = 1, 5, 40
    pycolmap.set_random_seed(0)
    model = pycolmap.synthesize_dataset(options)
    points = sorted(model.point3D_ids())
    camera = model.images[min(model.reg_image_ids())]
    point = model.point3D(points[7])
    point.xyz = camera.projection_center() + 0.5 * (camera.projection_center() - point.xyz)
    assert mean_error_px(model) > 10.0
    colmap_model.drop_lost_points(model)
    assert mean_error_px(model) < 1e-6
    assert sorted(model.point3D_ids()) == points[:7] + points[8:]
