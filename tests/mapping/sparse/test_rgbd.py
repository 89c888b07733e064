"""Depth images place the images that show them, in metres; what they contradict is not placed.

Recorded motion places what depth and features do not, if the depth agrees.
"""

import csv
import dataclasses
from pathlib import Path

import cv2
import numpy as np
import pytest

import mapping
from esdf.solids import Box
from flight import FloatArray, MapError, frames, rotations
from goshawk.rendered import scene as rendered_room
from goshawk.rendered import world as rendered_world
from goshawk.rendered.scene import RenderedScene
from goshawk.rendered.world import RenderedFlight
from mapping.camera import rig as rigs
from mapping.camera import rig_export
from mapping.input.depth_images import DepthFolder
from mapping.input.images import ImageSet
from mapping.input.trajectory import Motion, MotionKind, Trajectory
from mapping.sparse import reconstruction
from mapping.sparse.mapper import rgbd
from mapping.sparse.mapper.rgbd import Placed
from mapping.stages import StoppedError
from mapping.verdict import Standing
from tests.goshawk.running import run

CAMERA = dataclasses.replace(rigs.forward_camera("PINHOLE", 320, 240, [230.0, 230.0, 160.0, 120.0]), folder="rgb")
RIG = rigs.Rig((CAMERA,))
ROOM = rendered_room.furnished()
GAP = range(4, 8)
"""Images without a feature."""
T_TRACKED_CAMERA = frames.transform(rotations.exp([0.4, -1.2, 2.3]), [0.1, -0.2, 0.3])


def depth_m(T_world_camera: FloatArray, scene: RenderedScene = ROOM) -> FloatArray:
    """(height, width) along the optical axis."""
    rays = CAMERA.unproject(CAMERA.pixel_centres()).reshape(-1, 3)
    ranges_m = rendered_world.cast_rays(scene, T_world_camera[:3, 3], rays @ T_world_camera[:3, :3].T)
    return (ranges_m * rays[:, 2]).reshape(CAMERA.height, CAMERA.width)


def write_depths(folder: Path, flight: RenderedFlight, scene: RenderedScene = ROOM) -> DepthFolder:
    """16-bit millimetres; nothing beyond 5 m, as depth cameras have it."""
    (folder / CAMERA.folder).mkdir(parents=True)
    for k, T_world_body in enumerate(flight.T_world_body):
        seen_m = depth_m(T_world_body @ CAMERA.T_body_camera, scene)
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
    monkeypatch.setattr(rgbd, "_edges", lambda *_: {(k, k + 1): rgbd._Edge(np.eye(4), np.eye(6), 9) for k in range(11)})
    monkeypatch.setattr(rgbd, "_optimised", lambda *_: moved)
    monkeypatch.setattr(rgbd.colmap_model, "triangulated", lambda *given, **how: given[2])
    placed = rgbd.place(Path("database.db"), image_set(flight, depths), None, lambda stage, fraction: None).model
    assert np.flatnonzero(np.isnan(placed[:, 0, 0])).tolist() == [5]


def recorded(flight: RenderedFlight) -> FloatArray:
    """(n, 4, 4) poses of a tracker 37 cm from the camera, in a frame of its own, off by 3 mm and .2 deg."""
    rng, count = np.random.default_rng(0), len(flight.times_s)
    noise = [std * rng.normal(size=(count, 3)) for std in (np.radians(0.2), 0.003)]
    T_world_tracked = flight.T_world_body @ CAMERA.T_body_camera @ frames.invert(T_TRACKED_CAMERA)
    T_start_world = frames.transform(rotations.exp([0.0, 0.0, 1.0]), [5.0, 3.0, 1.0])
    return T_start_world @ T_world_tracked @ frames.transform(rotations.exp(noise[0]), noise[1])


def placed_with(
    flight: RenderedFlight,
    depths: DepthFolder,
    T_start_tracked: FloatArray | None,
    monkeypatch: pytest.MonkeyPatch,
    gap: range = GAP,
) -> tuple[FloatArray, Placed]:
    """Poses from true motions of all pairs outside of the gap, and from a recording."""
    true, count = flight.T_world_body @ CAMERA.T_body_camera, len(flight.times_s)
    pairs = [(a, b) for a in range(count) for b in range(a + 1, min(a + 6, count)) if not {a, b} & {*gap}]
    information = 20_000.0 * np.diag([4.0, 4.0, 4.0, 1.0, 1.0, 1.0])  # as many points, 2 m away
    edges = {(a, b): rgbd._Edge(frames.invert(true[b]) @ true[a], information, 100) for a, b in pairs}
    monkeypatch.setattr(rgbd, "_edges", lambda *_: edges)
    monkeypatch.setattr(rgbd.colmap_model, "triangulated", lambda *given, **how: given[2])
    images = image_set(flight, depths)
    if T_start_tracked is not None:
        motion = Motion(MotionKind.POSES, Trajectory(Path("tracker.tum"), flight.times_s, T_start_tracked))
        images = dataclasses.replace(images, motions=(motion,))
    placed = rgbd.place(Path("database.db"), images, None, lambda stage, fraction: None)
    return true[0] @ placed.model, placed


def off_m(T: FloatArray, flight: RenderedFlight) -> FloatArray:
    return np.linalg.norm((T - flight.T_world_body @ CAMERA.T_body_camera)[:, :3, 3], axis=1)


def test_recorded_motion_places_what_features_do_not(
    flight: RenderedFlight, depths: DepthFolder, monkeypatch: pytest.MonkeyPatch
) -> None:
    alone, _ = placed_with(flight, depths, None, monkeypatch)
    T, placed = placed_with(flight, depths, recorded(flight), monkeypatch)
    assert np.flatnonzero(np.isnan(alone[:, 0, 0])).tolist() == [*GAP]
    assert np.flatnonzero(placed.by_motion).tolist() == [*GAP]
    assert off_m(T, flight)[list(GAP)].max() < 0.015
    others = np.setdiff1d(np.arange(12), GAP)
    assert np.abs(T - alone)[others].max() < 1e-3  # it does not bend what features know
    assert placed.notes == []


def test_recorded_motion_holds_images_of_a_plain_wall(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Depth alone would slide along it: the same two depth images agree wherever they lie in its plane."""
    t = np.arange(16) / 4.0
    turns = np.stack([0.1 * np.sin(2.0 * t), 0.1 * np.cos(1.5 * t), 0.15 * np.sin(1.1 * t)], axis=-1)
    positions = np.stack([0.1 * np.sin(t), 0.4 * t, 1.5 + 0.1 * np.cos(t)], axis=-1)
    along = RenderedFlight(t, frames.transform(rotations.exp(turns), positions))
    wall = RenderedScene(((Box((1.8, -30.0, -30.0), (2.0, 30.0, 30.0)), "plain"),))
    depths = write_depths(tmp_path / "depth", along, wall)
    slid = along.T_world_body @ CAMERA.T_body_camera
    slid[6:, :3, 3] += [0.0, 0.1, 0.1]
    assert rgbd.agreement(image_set(along, depths), slid, [(5, 6)])[5] == 1.0
    T, placed = placed_with(along, depths, recorded(along), monkeypatch, gap=range(6, 10))
    assert np.flatnonzero(placed.by_motion).tolist() == [6, 7, 8, 9]
    assert off_m(T, along).max() < 0.015


def test_what_the_depth_contradicts_is_not_placed_by_recorded_motion(
    flight: RenderedFlight, depths: DepthFolder, monkeypatch: pytest.MonkeyPatch
) -> None:
    """One recorded pose of the gap is wrong: its image finds no place, those about it do."""
    wrong = recorded(flight)
    wrong[5, :3, 3] += 0.6
    T, placed = placed_with(flight, depths, wrong, monkeypatch)
    assert np.flatnonzero(np.isnan(T[:, 0, 0])).tolist() == [5]
    assert np.flatnonzero(placed.by_motion).tolist() == [4, 6, 7]
    assert np.nanmax(off_m(T, flight)) < 0.015
    wrong[list(GAP), :3, 3] += 0.6 * np.array([[1.0], [-2.0], [2.0], [-2.0]])
    T, placed = placed_with(flight, depths, wrong, monkeypatch)
    assert np.flatnonzero(np.isnan(T[:, 0, 0])).tolist() == [*GAP]
    assert not placed.by_motion.any()
    assert "the depth images contradict it" in placed.notes[-1]


def test_motion_of_another_flight_places_nothing_and_that_is_said(
    flight: RenderedFlight, depths: DepthFolder, monkeypatch: pytest.MonkeyPatch
) -> None:
    alone, _ = placed_with(flight, depths, None, monkeypatch)
    T, placed = placed_with(flight, depths, recorded(flight)[::-1], monkeypatch)
    np.testing.assert_array_equal(T, alone)
    assert not placed.by_motion.any()
    assert "of another flight or clock" in placed.notes[0]


def test_recorded_motion_alone_places_nothing(
    flight: RenderedFlight, depths: DepthFolder, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Nothing shows where the camera sits on the tracked thing."""
    with pytest.raises(MapError, match="need texture, depth and overlap; recorded motion cannot place them"):
        placed_with(flight, depths, recorded(flight), monkeypatch, gap=range(12))
    with pytest.raises(MapError, match=r"overlap$"):
        placed_with(flight, depths, None, monkeypatch, gap=range(12))


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


@pytest.mark.slow
def test_a_map_has_the_images_without_a_feature_by_recorded_motion_and_says_so(
    tmp_path: Path, flight: RenderedFlight, depths: DepthFolder
) -> None:
    """A recording of another flight was given first: its stages are not used again."""
    seen = rendered_world.pictures(RIG, flight, ROOM, 1)
    blank = np.full((CAMERA.height, CAMERA.width), 90, np.uint8)
    images = rendered_world.write_rendered_sequence(
        tmp_path / "images", rig=RIG, flight=flight, picture=lambda k, number: blank if k in GAP else seen(k, number)
    )
    rig_export.write_tum(tmp_path / "other.tum", flight.times_s, recorded(flight)[::-1])
    rig_export.write_tum(tmp_path / "tracker.tum", flight.times_s, recorded(flight))
    options, out = mapping.MapOptions(depths=depths, poses=tmp_path / "other.tum"), tmp_path / "map"
    with pytest.raises(StoppedError):
        mapping.build_map(images, RIG, out, options, until=reconstruction.CALIBRATION)
    given = ("--camera", images / "camera.toml", "--depth", depths.folder, "--poses", tmp_path / "tracker.tum")
    said = run("map", "build", images, *given, "--out", out)
    assert "placed by recorded motion" in said
    assert "4: rgb/0004.png, rgb/0005.png, rgb/0006.png, rgb/0007.png" in said
    assert "8 images, scale" in said  # the others' places do not witness it
    true, found = flight.T_world_body, mapping.open_map(out).T_world_body
    ours, theirs = (np.linalg.norm(T[:, None, :3, 3] - T[None, :, :3, 3], axis=2) for T in (found, true))
    assert np.abs(ours - theirs).max() < 0.03
    options = mapping.MapOptions(depths=depths, odometry=tmp_path / "other.tum")
    report = mapping.build_map(images, RIG, tmp_path / "unplaced", options)
    assert (report.images_placed, report.placed_by_motion) == (8, [])
    assert "of another flight or clock" in report.motion_notes[0]
    assert report.verdict != Standing.GOOD
