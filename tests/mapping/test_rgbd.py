"""Depth images place the images that show them, in metres; what they contradict is not placed."""

import csv
import dataclasses
from pathlib import Path

import cv2
import numpy as np
import pytest

import mapping
from flight import FloatArray, frames, rotations
from goshawk.rendered import scene as rendered_room
from goshawk.rendered import world as rendered_world
from goshawk.rendered.world import RenderedFlight
from mapping.camera import rig as rigs
from mapping.input.depth_images import DepthFolder
from mapping.input.images import ImageSet
from mapping.sparse import rgbd
from mapping.verdict import Standing

CAMERA = dataclasses.replace(rigs.forward_camera("PINHOLE", 320, 240, [230.0, 230.0, 160.0, 120.0]), folder="rgb")
RIG = rigs.Rig((CAMERA,))
ROOM = rendered_room.furnished()


def depth_m(T_world_camera: FloatArray) -> FloatArray:
    """(height, width) along the optical axis, of the furnished room."""
    rays = CAMERA.unproject(CAMERA.pixel_centres()).reshape(-1, 3)
    ranges_m = rendered_world.cast_rays(ROOM, T_world_camera[:3, 3], rays @ T_world_camera[:3, :3].T)
    return (ranges_m * rays[:, 2]).reshape(CAMERA.height, CAMERA.width)


def write_depths(folder: Path, flight: RenderedFlight) -> DepthFolder:
    """16-bit millimetres; nothing beyond 5 m, as depth cameras have it."""
    (folder / CAMERA.folder).mkdir(parents=True)
    for k, T_world_body in enumerate(flight.T_world_body):
        seen_m = depth_m(T_world_body @ CAMERA.T_body_camera)
        millimetres = np.where(seen_m < 5.0, 1000.0 * seen_m, 0.0).round().astype(np.uint16)
        cv2.imwrite(str(folder / CAMERA.folder / f"{k:04d}.png"), millimetres)
    return DepthFolder(folder)


@pytest.fixture(scope="module")
def flight() -> RenderedFlight:
    return rendered_world.loop_flight(12, share=0.12)


@pytest.fixture(scope="module")
def depths(tmp_path_factory: pytest.TempPathFactory, flight: RenderedFlight) -> DepthFolder:
    return write_depths(tmp_path_factory.mktemp("rgbd") / "depth", flight)


def image_set(flight: RenderedFlight, depths: DepthFolder) -> ImageSet:
    count = len(flight.times_s)
    names = tuple(f"{k:04d}.png" for k in range(count))
    return ImageSet(depths.folder, RIG, names, np.ones((count, 1), bool), flight.times_s, depths=depths)


def test_depth_agrees_at_the_true_poses_and_nowhere_else(flight: RenderedFlight, depths: DepthFolder) -> None:
    images, true = image_set(flight, depths), flight.T_world_body @ CAMERA.T_body_camera
    pairs = [(k, k + step) for k in range(12) for step in (1, 2, 3) if k + step < 12]
    assert rgbd.agreement(images, true, pairs).min() > 0.97
    moved = true.copy()
    moved[5] = moved[5] @ frames.transform(rotations.exp([0.0, 0.12, 0.0]), [0.3, 0.0, 0.5])
    shares = rgbd.agreement(images, moved, pairs)
    assert shares[5] < rgbd.LEAST_AGREEMENT
    assert np.delete(shares, 5).min() > 0.9
    unknown = np.full((12, 4, 4), np.nan)
    assert np.isnan(rgbd.agreement(images, unknown, pairs)).all()


def test_an_image_whose_final_pose_no_pair_can_confirm_is_not_placed(
    flight: RenderedFlight, depths: DepthFolder, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The pose graph has moved it so far that it shares nothing with its neighbours any more."""
    moved = flight.T_world_body @ CAMERA.T_body_camera
    moved[5, :3, 3] += 100.0
    monkeypatch.setattr(rgbd, "_edges", lambda *_: {(k, k + 1): None for k in range(11)})
    monkeypatch.setattr(rgbd, "_optimised", lambda *_: moved)
    monkeypatch.setattr(rgbd, "triangulated", lambda database, images, T_world_camera, options: T_world_camera)
    placed = rgbd.place(Path("database.db"), image_set(flight, depths), None, lambda stage, share: None)
    assert np.flatnonzero(np.isnan(placed[:, 0, 0])).tolist() == [5]


def test_a_wrong_scale_of_the_poses_is_contradicted_by_depth(flight: RenderedFlight, depths: DepthFolder) -> None:
    """Images alone would never tell: their reprojection is the same."""
    images, scaled = image_set(flight, depths), flight.T_world_body @ CAMERA.T_body_camera
    scaled[:, :3, 3] *= 1.5
    pairs = [(k, k + 4) for k in range(8)]
    assert np.median(rgbd.agreement(images, scaled, pairs)) < rgbd.LEAST_AGREEMENT


@pytest.mark.slow
def test_a_map_of_depth_images_is_metric_and_true(tmp_path: Path, flight: RenderedFlight, depths: DepthFolder) -> None:
    images = rendered_world.write_rendered_sequence(tmp_path / "images", rig=RIG, flight=flight)
    out, options = tmp_path / "map", mapping.MapOptions(depths=depths)
    report = mapping.build_map(images, RIG, out, options)
    assert (report.images_placed, report.scale_source, report.verdict) == (12, "depth images", Standing.GOOD)
    found, true = mapping.open_map(out).T_world_body, flight.T_world_body
    ours, theirs = (np.linalg.norm(T[:, None, :3, 3] - T[None, :, :3, 3], axis=2) for T in (found, true))
    assert np.abs(ours - theirs).max() < 0.02
    contradicted = tmp_path / "references.csv"
    with open(contradicted, "w", newline="") as stream:  # odometry that calls every metre 1.3
        rows = [[f"{k:04d}.png", *(1.3 * T[:3, 3])] for k, T in enumerate(true)]
        csv.writer(stream).writerows([["image", "x_m", "y_m", "z_m"], *rows])
    options = dataclasses.replace(options, references=contradicted)
    refused = mapping.build_map(images, RIG, tmp_path / "other", options)
    assert refused.verdict == Standing.REFUSED
    assert "one of them is wrong" in refused.reasons[0]
