"""Recorded poses and odometry: read in both formats, laid beside a map in any frame, and every fault of them named."""

import dataclasses
import tracemalloc
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

import mapping
from flight import FloatArray, FormatError, InputError, MapError, frames, rotations
from mapping import poses_file, verdict
from mapping.camera import rig_export
from mapping.camera.rig import R_BODY_CAMERA_FORWARD, Rig, forward_camera
from mapping.input import trajectory
from mapping.input.images import ImageSet
from mapping.input.trajectory import MotionKind
from mapping.sparse import alignment
from mapping.sparse.alignment import Alignment, Length, References
from mapping.sparse.mapper import pairing

COUNT = 40
IMAGES_S = 50.0 + np.arange(COUNT) / 4.0
RECORDED_S = 48.0 + np.arange(1400) / 100.0
RIG = Rig((forward_camera("SIMPLE_RADIAL_FISHEYE", 64, 48, [40.0, 32.0, 24.0, 0.0]),))
OLD_SCALE = 0.4
"""Metres per unit of COLMAP's world."""


def pose(t_s: FloatArray) -> FloatArray:
    """(n, 4, 4) T_world_body of two climbing turns."""
    t = np.asarray(t_s) - 50.0
    positions = np.stack([3.0 * np.sin(0.9 * t), 2.0 - 2.0 * np.cos(0.9 * t), 1.0 + 0.2 * t], axis=-1)
    lean = rotations.exp(np.stack([0.25 * np.sin(1.7 * t), 0.1 + 0.2 * np.cos(1.1 * t), 0.0 * t], axis=-1))
    return frames.transform(rotations.multiply(rotations.from_yaw(0.9 * t + 0.4 * np.sin(1.3 * t)), lean), positions)


TRUTH = pose(IMAGES_S)


def old(T_world_body: FloatArray = TRUTH) -> FloatArray:
    """Poses as COLMAP gives them: in another frame, in another unit."""
    T = frames.transform(rotations.exp([0.4, -1.1, 2.0]), [5.0, -3.0, 1.0]) @ T_world_body
    T[:, :3, 3] /= OLD_SCALE
    return T


def write_tum(path: Path, time_s: FloatArray, T: FloatArray) -> Path:
    rig_export.write_tum(path, time_s, T)
    return path


def write_euroc(path: Path, time_s: FloatArray, T: FloatArray) -> Path:
    q = rotations.from_matrix(T[:, :3, :3])
    rows = [
        f"{round(t * 1e9)},{','.join(f'{v:.12g}' for v in [*p, *a, 0.1, 0.2, 0.3])}"
        for t, p, a in zip(time_s, T[:, :3, 3], q, strict=True)
    ]
    path.write_text("\n".join(["#timestamp [ns],p_x [m],p_y,p_z,q_w,q_x,q_y,q_z,v_x,v_y,v_z", *rows, ""]))
    return path


def beside(kind: MotionKind, path: Path) -> ImageSet:
    names = tuple(f"{k:03d}.jpg" for k in range(COUNT))
    images = ImageSet(path.parent, RIG, names, np.ones((COUNT, 1), bool), IMAGES_S)
    return images.beside({kind: path})


def aligned(images: ImageSet, T_old: FloatArray, *, length: Length | None = None) -> Alignment:
    return alignment.align(images, T_old, alignment.read_references(images), baseline_std=None, length=length)


def doubts(found: Alignment) -> list[str]:
    return [text for check in found.motions for text in verdict._motion_doubts(check)]


@pytest.mark.parametrize("write", [write_tum, write_euroc])
@pytest.mark.parametrize("axes", [np.eye(3), R_BODY_CAMERA_FORWARD])
def test_recorded_poses_give_scale_frame_and_up(tmp_path: Path, write: Callable[..., Path], axes: FloatArray) -> None:
    recorded = pose(RECORDED_S)
    recorded[:, :3, :3] = recorded[:, :3, :3] @ axes  # a tracker may state the axes of the camera
    found = aligned(beside(MotionKind.POSES, write(tmp_path / "p", RECORDED_S, recorded)), old())
    assert (found.scale_source, found.up_source) == ("recorded poses", "recorded poses")
    assert found.scale == pytest.approx(OLD_SCALE, rel=1e-3)
    np.testing.assert_allclose(found.poses(old()), TRUTH, atol=0.01)
    assert doubts(found) == []


def test_odometry_in_any_frame_that_drifts_gives_the_scale(tmp_path: Path) -> None:
    t = RECORDED_S - RECORDED_S[0]
    drift = frames.transform(rotations.exp(np.outer(t, [0.0, 0.0, 0.01])), np.outer(t, [0.02, -0.02, 0.01]))
    recorded = frames.transform(rotations.exp([1.0, 2.0, -0.5]), [9.0, 9.0, 9.0]) @ drift @ pose(RECORDED_S)
    found = aligned(beside(MotionKind.ODOMETRY, write_tum(tmp_path / "o", RECORDED_S, recorded)), old())
    assert found.scale_source == "odometry"
    assert abs(found.scale / OLD_SCALE - 1.0) < 3.0 * found.witnesses[0].std < 0.1
    assert doubts(found) == []


def test_a_map_of_the_wrong_size_is_shown_by_both(tmp_path: Path) -> None:
    """A third too large, as a turned camera makes it: each source of scale is laid beside the one in use."""
    path = write_tum(tmp_path / "p", RECORDED_S, pose(RECORDED_S))
    length = Length(1.3 * float(np.linalg.norm(np.diff(TRUTH[:, :3, 3], axis=0), axis=1).sum()))
    for kind in MotionKind:
        used, other = aligned(beside(kind, path), old(), length=length).witnesses
        assert other.source == kind
        reasons: tuple[list[str], list[str]] = [], []
        verdict._weigh(used, other, *reasons)
        assert other.ratio == pytest.approx(1.3, rel=0.01)
        assert "one of them is wrong" in reasons[1][0]


def test_recorded_motion_is_no_witness_of_images_that_it_placed(tmp_path: Path) -> None:
    bent = old()
    bent[10:20, :3, 3] *= 1.5
    images = beside(MotionKind.ODOMETRY, write_tum(tmp_path / "o", RECORDED_S, pose(RECORDED_S)))
    references = alignment.read_references(images)
    whole, rest = (
        alignment.align(images, bent, references, baseline_std=None, length=None, by_motion=instants)
        for instants in ([], [*range(10, 20)])
    )
    assert (whole.motions[0].instants, rest.motions[0].instants) == (COUNT, COUNT - 10)
    assert doubts(whole)
    assert not doubts(rest)
    assert np.isfinite(rest.poses(bent)).all()


def test_a_bent_map_is_shown_by_odometry(tmp_path: Path) -> None:
    """A scale that drifts along the path: the whole has the right length, its shape is wrong."""
    grown = np.exp(np.linspace(-0.25, 0.25, COUNT - 1))[:, None]
    bent = TRUTH.copy()
    bent[1:, :3, 3] = TRUTH[0, :3, 3] + np.cumsum(grown * np.diff(TRUTH[:, :3, 3], axis=0), axis=0)
    found = aligned(beside(MotionKind.ODOMETRY, write_tum(tmp_path / "o", RECORDED_S, pose(RECORDED_S))), old(bent))
    assert any("differ in shape" in text for text in doubts(found))


@pytest.mark.parametrize("late_s", [-0.35, 0.03, 0.8])
def test_a_clock_that_is_off_is_named(tmp_path: Path, late_s: float) -> None:
    path = write_tum(tmp_path / "p", RECORDED_S + late_s, pose(RECORDED_S))
    (check,) = aligned(beside(MotionKind.POSES, path), old()).motions
    assert check.late_s == pytest.approx(late_s, abs=0.01)
    said = [text for text in verdict._motion_doubts(check) if "against the images" in text]
    assert f"{abs(check.late_s or 0.0):.3f}" in said[0]
    assert ("late" if late_s > 0.0 else "early") in said[0]


def test_poses_of_another_flight_do_not_fit(tmp_path: Path) -> None:
    other = pose(50.0 - 1.7 * (RECORDED_S - 50.0))
    found = aligned(beside(MotionKind.POSES, write_tum(tmp_path / "p", RECORDED_S, other)), old())
    assert any("another flight" in text for text in doubts(found))


@pytest.mark.parametrize(
    ("order", "signs"),
    [([3, 0, 1, 2], [1, 1, 1, 1]), ([1, 2, 3, 0], [1, 1, 1, 1]), ([0, 1, 2, 3], [-1, -1, -1, 1])],
    ids=["w first", "w third", "world to body"],
)
def test_quaternions_of_another_convention_are_refused(tmp_path: Path, order: list[int], signs: list[int]) -> None:
    """Their turn angles are the same, so only the directions show it; the map would lie tilted, of another size."""
    path = write_tum(tmp_path / "p", RECORDED_S, pose(RECORDED_S))
    rows = np.loadtxt(path)
    right = aligned(beside(MotionKind.POSES, path), old())
    rows[:, 4:] = signs * rows[:, 4:][:, order]
    np.savetxt(path, rows, fmt="%.9f")
    found = aligned(beside(MotionKind.POSES, path), old())
    assert doubts(found) == []
    assert "quaternions are of another order" in verdict._motion_refusals(found.motions[0])[0]
    assert verdict._motion_refusals(right.motions[0]) == []


def test_noisy_poses_of_a_tracker_beside_the_cameras_are_not_refused(tmp_path: Path) -> None:
    rng = np.random.default_rng(0)
    noisy = pose(RECORDED_S)
    noisy[:, :3, 3] += noisy[:, :3, :3] @ [0.3, 0.1, 0.2] + rng.normal(0.0, 0.03, (len(noisy), 3))
    noisy[:, :3, :3] = noisy[:, :3, :3] @ rotations.matrix(rotations.exp(rng.normal(0.0, 0.02, (len(noisy), 3))))
    found = aligned(beside(MotionKind.POSES, write_tum(tmp_path / "p", RECORDED_S, noisy)), old())
    assert verdict._motion_refusals(found.motions[0]) == []


def test_poses_of_a_hover_within_their_noise_are_not_refused(tmp_path: Path) -> None:
    rng = np.random.default_rng(0)

    def hover(count: int) -> FloatArray:
        return frames.transform(rotations.exp(rng.normal(0.0, 0.005, (count, 3))), rng.normal(0.0, 0.01, (count, 3)))

    images = beside(MotionKind.POSES, write_tum(tmp_path / "p", RECORDED_S, hover(len(RECORDED_S))))
    found = aligned(images, old(hover(COUNT)))
    assert found.motions[0].direction_error_rad is None
    assert verdict._motion_refusals(found.motions[0]) == []


def test_poses_whose_z_is_not_up_are_named(tmp_path: Path) -> None:
    tipped = frames.transform(rotations.exp([0.5 * np.pi, 0.0, 0.0]), np.zeros(3)) @ pose(RECORDED_S)
    found = aligned(beside(MotionKind.POSES, write_tum(tmp_path / "p", RECORDED_S, tipped)), old())
    assert found.scale == pytest.approx(OLD_SCALE, rel=1e-3)
    assert "Give them with z up" in verdict._tilt_doubts(found.poses(old()))[0]
    assert verdict._tilt_doubts(TRUTH) == []


def test_poses_along_a_straight_line_do_not_say_what_is_up(tmp_path: Path) -> None:
    def straight(t_s: FloatArray) -> FloatArray:
        return frames.transform(np.tile([1.0, 0.0, 0.0, 0.0], (len(t_s), 1)), np.outer(t_s - 50.0, [1.0, 0.2, 0.0]))

    images = beside(MotionKind.POSES, write_tum(tmp_path / "p", RECORDED_S, straight(RECORDED_S)))
    found = aligned(images, old(straight(IMAGES_S)))
    assert found.up_source == "first image taken as level"
    assert found.motions[0].late_s is None


def test_places_that_were_passed_twice_are_matched(tmp_path: Path) -> None:
    path = write_tum(tmp_path / "o", RECORDED_S, pose(RECORDED_S))
    images = beside(MotionKind.ODOMETRY, path)
    near = pairing.near_in_space(images, 4)
    assert near
    assert all(b - a > 4 for a, b in near)
    shots = images.pairs()
    nothing = [np.zeros((0, 128), np.float32)] * COUNT
    with_motion, without = (pairing.choose(shots, nothing, window=4, similar=0, near=n) for n in (near, []))
    assert set(with_motion) - set(without) == {((a, 0), (b, 0)) for a, b in near}


def changed(row: int, column: int, word: str) -> Callable[[list[list[str]]], object]:
    return lambda rows: rows[row].__setitem__(column, word)


def scaled(factor: float) -> Callable[[list[list[str]]], object]:
    return lambda rows: [row.__setitem__(k, str(factor * float(row[k]))) for row in rows for k in (1, 2, 3)]


FAULTS = [
    (changed(3, 2, "nan"), "line 5: a number is missing or not finite"),
    (changed(3, 2, "inf"), "not finite"),
    (changed(3, 2, "east"), "a line that is no pose must begin with #"),
    (changed(3, 2, "east"), ", line 5: '"),
    (changed(3, 0, "1.0"), "not after that of the pose before"),
    (changed(3, 7, "0.1"), "quaternion (x y z w) is not of unit length"),
    (lambda rows: rows[3].pop(), "7 columns"),
    (scaled(1000.0), "must be in metres, not in millimetres"),
    (lambda rows: rows.__delitem__(slice(1, None)), "has 1 poses"),
    (lambda rows: rows.__delitem__(slice(270, None)), "covers 3 of 40 images"),
    (lambda rows: [row.__setitem__(0, str(float(row[0]) + 1.7e9)) for row in rows], "give both by one clock"),
]


@pytest.mark.parametrize(("change", "said"), FAULTS)
def test_each_fault_of_the_file_is_named(tmp_path: Path, change: Callable, said: str) -> None:
    path = write_tum(tmp_path / "p", RECORDED_S, pose(RECORDED_S))
    head, *lines = path.read_text().splitlines()
    rows = [line.split() for line in lines]
    change(rows)
    path.write_text("\n".join([head, *(" ".join(row) for row in rows)]))
    with pytest.raises((InputError, FormatError)) as raised:
        beside(MotionKind.POSES, path)
    assert said in str(raised.value)
    assert str(path) in str(raised.value)


def test_a_byte_order_mark_is_no_part_of_the_first_time(tmp_path: Path) -> None:
    path = write_tum(tmp_path / "p", RECORDED_S, pose(RECORDED_S))
    marked = tmp_path / "marked"
    marked.write_text("\n".join(["\ufeff" + path.read_text().splitlines()[1], *path.read_text().splitlines()[2:]]))
    np.testing.assert_array_equal(trajectory.read(marked).time_s, trajectory.read(path).time_s)


def test_centimetres_at_walking_pace_are_refused_and_a_fast_flight_in_metres_is_not(tmp_path: Path) -> None:
    for pace, factor in ((0.3, 1.0), (2.0, 1.0), (0.3, 100.0)):
        T = pose(50.0 + pace * (RECORDED_S - 50.0))
        T[:, :3, 3] *= factor
        path = write_tum(tmp_path / "p", RECORDED_S, T)
        if factor > 1.0:
            speed_m_s = np.linalg.norm(np.diff(T[:, :3, 3], axis=0), axis=1).max() / 0.01
            assert speed_m_s < trajectory.FASTEST_M_S
            with pytest.raises(InputError, match=r"m/s2.*not in millimetres or centimetres"):
                trajectory.read(path)
        else:
            assert len(trajectory.read(path).time_s) == len(RECORDED_S)


def test_a_scale_that_is_a_hundred_times_the_rigs_names_the_unit(tmp_path: Path) -> None:
    doubted: list[str] = []
    refused: list[str] = []
    used, other = (alignment.ScaleWitness(name, ratio, 0.01) for name, ratio in (("length", 1.0), ("poses", 0.0101)))
    verdict._weigh(used, other, doubted, refused)
    assert "as if it were in centimetres" in refused[0]
    assert not doubted


def test_files_that_hold_no_poses_and_images_without_times_are_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="does not exist"):
        trajectory.read(tmp_path / "absent")
    (tmp_path / "bytes").write_bytes(b"\xff\xfe\x00\x01")
    with pytest.raises(FormatError, match="not a text file"):
        trajectory.read(tmp_path / "bytes")
    (tmp_path / "empty").write_text("# nothing\n")
    with pytest.raises(FormatError, match="has 0 poses"):
        trajectory.read(tmp_path / "empty")
    path = write_tum(tmp_path / "p", RECORDED_S, pose(RECORDED_S))
    untimed = dataclasses.replace(beside(MotionKind.POSES, path), time_s=np.full(COUNT, np.nan))
    with pytest.raises(InputError, match="have no times"):
        untimed.beside({MotionKind.POSES: path})


def test_a_file_that_is_missing_is_named_before_any_image_is_read(tmp_path: Path) -> None:
    options = mapping.MapOptions(poses=tmp_path / "absent.txt")
    with pytest.raises(InputError, match=r"absent\.txt does not exist"):  # nor do the images
        mapping.build_map(tmp_path / "images", RIG, tmp_path / "map", options)
    assert list(tmp_path.iterdir()) == []


def test_poses_on_a_national_grid_are_refused(tmp_path: Path) -> None:
    far = pose(RECORDED_S)
    far[:, :3, 3] += [500_000.0, 5_400_000.0, 0.0]
    path = write_tum(tmp_path / "p", RECORDED_S, far)
    with pytest.raises(InputError, match="5,400 km from the origin"):
        beside(MotionKind.POSES, path)
    assert beside(MotionKind.ODOMETRY, path).motions  # its frame is not used


def test_positions_are_not_given_twice(tmp_path: Path) -> None:
    images = beside(MotionKind.POSES, write_tum(tmp_path / "p", RECORDED_S, pose(RECORDED_S)))
    (tmp_path / "references.csv").write_text("image,x_m,y_m,z_m\n003.jpg,1,2,3\n")
    with pytest.raises(InputError, match="leave the positions of one out"):
        alignment.read_references(images)


def test_nothing_is_interpolated_over_a_gap(tmp_path: Path) -> None:
    kept = (RECORDED_S < 52.0) | (RECORDED_S > 53.0)
    read = trajectory.read(write_tum(tmp_path / "p", RECORDED_S[kept], pose(RECORDED_S[kept])))
    found = read.at(np.array([47.0, 51.003, 52.5, np.nan, 99.0]))
    assert np.isfinite(found[:, 0, 0]).tolist() == [False, True, False, False, False]
    np.testing.assert_allclose(found[1], pose(np.array([51.003]))[0], atol=1e-4)


@pytest.mark.parametrize("off_s", [0.0, 5e-4, -5e-4, 1e-3, -1e-3])
def test_poses_of_key_frames_far_apart_hold_at_their_own_times(tmp_path: Path, off_s: float) -> None:
    key_frames_s = 50.0 + np.arange(5.0)
    read = trajectory.read(write_tum(tmp_path / "p", key_frames_s, pose(key_frames_s)))
    found = read.at(key_frames_s + off_s)
    if abs(off_s) > 6e-4:
        assert np.isnan(found).all()
    else:
        np.testing.assert_allclose(found, pose(key_frames_s), atol=2e-3)  # 3 m/s over half a millisecond
    assert not read.interpolates(key_frames_s[1:-1]).any()


def test_key_frames_alone_give_the_scale_but_not_the_clock(tmp_path: Path) -> None:
    key_frames_s = IMAGES_S[::3]
    found = aligned(beside(MotionKind.POSES, write_tum(tmp_path / "p", key_frames_s, pose(key_frames_s))), old())
    assert found.scale == pytest.approx(OLD_SCALE, rel=1e-3)
    assert found.motions[0].late_s is None
    assert not doubts(found)


def test_a_late_clock_is_named_where_some_images_have_key_frames_alone(tmp_path: Path) -> None:
    at_images = np.arange(COUNT) > COUNT // 3
    late_s = 0.3
    recorded_s = RECORDED_S[RECORDED_S + late_s < IMAGES_S[at_images][0] - 0.6]
    time_s = np.concatenate([recorded_s + late_s, IMAGES_S[at_images][::3]])
    path = write_tum(tmp_path / "p", time_s, pose(time_s - late_s))
    (check,) = aligned(beside(MotionKind.POSES, path), old()).motions
    assert check.instants > 2 * COUNT // 5
    assert check.late_s == pytest.approx(late_s, abs=0.01)


def test_a_map_needs_no_other_scale(tmp_path: Path) -> None:
    """The options reach the checks that come before any long work."""
    (tmp_path / "images").mkdir()
    path = write_tum(tmp_path / "p", RECORDED_S, pose(RECORDED_S))
    for options, said in ((mapping.MapOptions(), "--odometry FILE"), (mapping.MapOptions(poses=path), "no image")):
        with pytest.raises(MapError if not options.poses else InputError, match=said):
            mapping.build_map(tmp_path / "images", RIG, tmp_path / "map", options)


def test_references_without_poses_stay_what_they_are() -> None:
    nothing = References(np.full((COUNT, 3), np.nan), np.full((COUNT, 3), np.nan))
    assert (nothing.position_source, nothing.up_source) == ("recorded positions", "recorded gravity")


@pytest.mark.parametrize(
    ("factor", "wild", "said"),
    [
        (1e9, None, "times from 0 to .* nanoseconds.* divide the first column"),
        (1e6, None, "microseconds"),
        (1.0, 10, r"line 12: its time \(1e\+09 s\) is after those of the lines below.*take the line out"),
    ],
)
def test_times_that_are_none_are_one_sentence_and_memory_goes_by_the_poses(
    tmp_path: Path, factor: float, wild: int | None, said: str
) -> None:
    seconds = np.linspace(0.0, 3.267, 100)
    time_s = factor * seconds
    if wild is not None:
        time_s[wild] = 1e9
    path = write_tum(tmp_path / "poses.tum", time_s, pose(seconds))
    tracemalloc.start()
    with pytest.raises((InputError, FormatError), match=said):
        trajectory.read(path)
    assert tracemalloc.get_traced_memory()[1] < 10e6
    tracemalloc.stop()


def test_one_pose_that_is_far_ahead_at_the_end_takes_no_memory(tmp_path: Path) -> None:
    seconds = np.linspace(0.0, 3.267, 100)
    time_s = seconds.copy()
    time_s[-1] = 1e9
    tracemalloc.start()
    assert len(trajectory.read(write_tum(tmp_path / "poses.tum", time_s, pose(seconds))).time_s) == 100
    assert tracemalloc.get_traced_memory()[1] < 10e6
    tracemalloc.stop()


def write_aria(path: Path, time_s: FloatArray, T: FloatArray) -> Path:
    """As Machine Perception Services write closed loop trajectories, without their later columns."""
    q = rotations.from_matrix(T[:, :3, :3])[:, [1, 2, 3, 0]]
    names = [f"{name}_world_device" for name in ("tx", "ty", "tz", "qx", "qy", "qz", "qw")]
    rows = [
        f"0a1b,{round(t * 1e6)},{round(t * 1e9)},{','.join(f'{v:.12g}' for v in [*p, *a])},1"
        for t, p, a in zip(time_s, T[:, :3, 3], q, strict=True)
    ]
    head = ",".join(["graph_uid", "tracking_timestamp_us", "utc_timestamp_ns", *names, "quality_score"])
    path.write_text("\n".join([head, *rows, ""]))
    return path


def write_arkit(path: Path, time_s: FloatArray, T: FloatArray) -> Path:
    """As ARKitScenes has them: rotation vector and shift of world to camera."""
    inverse = frames.invert(T)
    turns = rotations.log(rotations.from_matrix(inverse[:, :3, :3]))
    np.savetxt(path.with_suffix(".traj"), np.column_stack([time_s, turns, inverse[:, :3, 3]]), fmt="%.12g")
    return path.with_suffix(".traj")


def write_ours(path: Path, time_s: FloatArray, T: FloatArray) -> Path:
    covariance = np.tile(np.diag([0.02**2] * 3 + [0.01**2] * 3), (len(T), 1, 1))
    poses_file.write_poses(path, [f"{k}.jpg" for k in range(len(T))], time_s, T, covariance)
    return path


@pytest.mark.parametrize("write", [write_tum, write_euroc, write_aria, write_arkit, write_ours])
def test_poses_of_each_format_are_the_same(tmp_path: Path, write: Callable[..., Path]) -> None:
    found = trajectory.read(write(tmp_path / "p", RECORDED_S, pose(RECORDED_S)))
    np.testing.assert_allclose(found.time_s, RECORDED_S, atol=1e-6)
    np.testing.assert_allclose(found.T_start_body, pose(RECORDED_S), atol=2e-5)
    assert found.std == (pytest.approx((0.01, 0.02)) if write is write_ours else None)
    assert trajectory.looks_like_one(found.path)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("graph_uid,tracking_timestamp_us,tx_world_device\n1,2,3\n1,3,4\n", "has no column ty_world_device"),
        ("time_s,x_m,y_m,z_m,qw,qx,qy,qz\n1,0,0,0,1,0,0,0\n2,0,0,0,1,0,0\n", "line 3: 7 columns, the first line has 8"),
        ("time_s,x_m,y_m,z_m,qw,qx,qy,qz\n1,0,0,0,1,0,0,0\n2,0,nan,0,1,0,0,0\n", "line 3: a number is missing"),
        ("time_s,x_m,y_m,z_m,qw,qx,qy,qz\n1,0,0,0,1,0,0,0\n", "has 1 poses; at least 2"),
    ],
)
def test_a_table_of_poses_that_is_cut_says_where(tmp_path: Path, text: str, said: str) -> None:
    path = tmp_path / "poses.csv"
    path.write_text(text)
    with pytest.raises(FormatError, match=said):
        trajectory.read(path)


def test_seven_columns_are_arkits_only_by_the_files_name(tmp_path: Path) -> None:
    for name in ("poses.txt", "poses.traj"):
        (tmp_path / name).write_text("1 0 0 0 0 0 0\n2 0 0 0 0 0 0\n")
    assert len(trajectory.read(tmp_path / "poses.traj").time_s) == 2
    with pytest.raises(FormatError, match="7 columns"):
        trajectory.read(tmp_path / "poses.txt")


def test_a_clock_that_the_priors_found_is_the_one_that_is_said(tmp_path: Path) -> None:
    images = beside(MotionKind.POSES, write_tum(tmp_path / "p", RECORDED_S + 0.05, pose(RECORDED_S)))
    references = alignment.read_references(images)
    found = alignment.align(
        images, old(), references, baseline_std=None, length=None, clocks={MotionKind.POSES: [0.051, 0.001]}
    )
    (said,) = doubts(found)
    assert "0.051 ± 0.002 s late" in said


def test_two_clocks_that_contradict_each_other_are_not_said(tmp_path: Path) -> None:
    images = beside(MotionKind.POSES, write_tum(tmp_path / "p", RECORDED_S, pose(RECORDED_S)))
    references = alignment.read_references(images)
    clocks = {MotionKind.POSES: [-0.071, 0.005]}  # as by poses that jump
    found = alignment.align(images, old(), references, baseline_std=None, length=None, clocks=clocks)
    assert found.motions[0].late_s is None
    assert not doubts(found)
