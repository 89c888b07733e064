"""Recorded motion joins images that nothing else joins, as exactly as it fits the others, or says why it does not."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest

from flight import FloatArray, frames, rotations
from mapping.camera.rig import Rig, forward_camera
from mapping.input.images import ImageSet
from mapping.input.trajectory import Motion, MotionKind, Trajectory
from mapping.sparse.recorded_motion import hand_eye, recorded_edges
from mapping.sparse.recorded_motion.recorded_edges import Pair, RecordedEdge

COUNT = 30
GAP = range(12, 18)
"""Instants that nothing joins to the others."""
TIME_S = np.arange(COUNT) / 4.0
NAMES = tuple(f"{k}.png" for k in range(COUNT))
T_TRACKED_CAMERA = frames.transform(rotations.exp([0.4, -1.2, 2.3]), [0.1, -0.2, 0.3])
TURNS = np.stack([0.3 * np.sin(1.7 * TIME_S), 0.2 * np.cos(1.1 * TIME_S), 0.7 * np.sin(0.8 * TIME_S)], axis=-1)
PATH_M = np.stack([0.5 * TIME_S, np.sin(TIME_S), 0.3 * np.cos(1.3 * TIME_S)], axis=-1)


def poses(turns: FloatArray = TURNS) -> FloatArray:
    """(instants, 4, 4) of the tracked thing."""
    return frames.transform(rotations.exp(turns), PATH_M)


def noisy(T: FloatArray, turn_rad: float = np.radians(0.2), shift_m: float = 0.003) -> FloatArray:
    rng = np.random.default_rng(0)
    turns, shifts = (std * rng.normal(size=(COUNT, 3)) for std in (turn_rad, shift_m))
    return T @ frames.transform(rotations.exp(turns), shifts)


def between(
    recorded: FloatArray | tuple[FloatArray, ...],
    *,
    true: FloatArray | None = None,
    gap: Sequence[int] = GAP,
    time_s: FloatArray = TIME_S,
    apart: int = 7,
) -> tuple[dict[Pair, RecordedEdge], list[str]]:
    """Of recordings of the tracked thing (n, 4, 4) at the times (n,).

    Images outside of the gap and at most so many `apart` are joined.
    """
    T_world_camera = (poses() if true is None else true) @ T_TRACKED_CAMERA
    joined = [(a, b) for a in range(COUNT) for b in range(a + 1, min(a + 1 + apart, COUNT)) if not {a, b} & {*gap}]
    measured = {(a, b): frames.invert(T_world_camera[b]) @ T_world_camera[a] for a, b in joined}
    T_world_camera[list(gap)] = np.nan
    given = recorded if isinstance(recorded, tuple) else (recorded,)
    rig = Rig((forward_camera("PINHOLE", 64, 48, [40.0, 40.0, 32.0, 24.0]),))
    motions = tuple(
        Motion(kind, Trajectory(Path(f"{kind}.tum"), time_s, T)) for kind, T in zip(MotionKind, given, strict=False)
    )
    images = ImageSet(Path(), rig, NAMES, np.ones((COUNT, 1), bool), TIME_S, motions=motions)
    return recorded_edges.between(images, measured, T_world_camera)


def test_the_images_of_a_gap_are_joined_as_exactly_as_is_said() -> None:
    edges, notes = between(noisy(poses()))
    assert notes == []
    assert sorted(edges) == [(a, b) for a in range(10, 18) for b in (a + 1, a + 2) if {a, b} & {*GAP}]
    true = poses() @ T_TRACKED_CAMERA
    for (a, b), edge in edges.items():
        off = hand_eye.difference((frames.invert(true[b]) @ true[a])[None], edge.T_b_a[None])[0]
        assert off @ np.linalg.solve(edge.covariance, off) < 22.5  # chi squared of six, 1 in 1,000
        assert np.linalg.norm(off[3:]) < 0.02


def test_nothing_is_asked_of_a_recording_where_all_images_are_joined() -> None:
    assert between(poses()[::-1], gap=range(0)) == ({}, [])


def test_the_parts_of_a_split_map_are_joined() -> None:
    """No image is missing; the two halves have nothing in common."""
    true = poses() @ T_TRACKED_CAMERA
    halves = {(a, b): frames.invert(true[b]) @ true[a] for a in range(29) for b in (a + 1,) if b != 15}
    images = ImageSet(
        Path(),
        Rig((forward_camera("PINHOLE", 64, 48, [40.0, 40.0, 32.0, 24.0]),)),
        NAMES,
        np.ones((COUNT, 1), bool),
        TIME_S,
        motions=(Motion(MotionKind.POSES, Trajectory(Path("p"), TIME_S, noisy(poses()))),),
    )
    T_world_camera = true.copy()
    T_world_camera[15:] = np.nan
    edges, notes = recorded_edges.between(images, halves, T_world_camera)
    assert sorted(edges) == [(13, 15), (14, 15), (14, 16)]
    assert notes == []


@pytest.mark.parametrize("late", [1, 2, 4])
def test_a_late_clock_and_another_flight_place_nothing(late: int) -> None:
    for recorded in (np.roll(poses(), late, axis=0), poses()[::-1]):
        edges, notes = between(recorded)
        assert edges == {}
        assert "of another flight or clock" in notes[0]
        assert "recorded poses (recorded poses.tum): it leaves" in notes[0]


@pytest.mark.parametrize("times", [0.8, 0.9, 1.1, 1.2])
def test_a_recording_in_other_metres_places_nothing(times: float) -> None:
    scaled = noisy(poses())
    scaled[:, :3, 3] *= times
    edges, notes = between(scaled)
    if abs(times - 1.0) > 0.15:
        assert edges == {}
        assert f"its distances are {times:.2f} times those of the depth images" in notes[0]
    else:  # its scale is taken into account
        assert notes == []
        true = poses() @ T_TRACKED_CAMERA
        off = [edge.T_b_a - frames.invert(true[b]) @ true[a] for (a, b), edge in edges.items()]
        assert np.abs(off).max() < 0.015


def test_turns_about_one_axis_join_what_turns_about_it_and_nothing_else() -> None:
    yaw = TURNS * [0.0, 0.0, 1.0]
    same = poses(yaw)
    edges, notes = between(noisy(same), true=same)
    assert len(edges) == 15
    assert notes == []
    leaning = yaw.copy()
    leaning[list(GAP)] += np.stack([0.5 * np.sin(2.0 * np.arange(len(GAP))), *2 * [np.zeros(len(GAP))]], axis=-1)
    edges, notes = between(noisy(poses(leaning)), true=poses(leaning))
    assert len(edges) < 4
    assert "the turns are too few or too small to tell where the camera sits" in notes[0]


@pytest.mark.parametrize(("turn_rad", "shift_m"), [(0.02, 0.003), (0.0035, 0.03)])
def test_a_recording_that_is_too_noisy_places_nothing(turn_rad: float, shift_m: float) -> None:
    edges, notes = between(noisy(poses(), turn_rad, shift_m))
    assert edges == {}
    assert notes[0].endswith("its noise")


def test_a_recording_that_jumps_within_a_gap_places_nothing_there() -> None:
    jumped = noisy(poses())
    jumped[15:] = frames.transform([1.0, 0.0, 0.0, 0.0], [0.0, 0.2, 0.0]) @ jumped[15:]
    edges, notes = between(jumped)
    assert edges == {}
    assert notes[0].endswith("it contradicts the images 11.png and 18.png, so it places none between")


def test_a_jump_elsewhere_does_no_harm() -> None:
    """In another gap, or between images that are placed."""
    jumped = noisy(poses())
    jumped[6:] = frames.transform([1.0, 0.0, 0.0, 0.0], [0.0, 0.2, 0.0]) @ jumped[6:]
    for gap, said in (([*GAP], 0), ([5, 6, *GAP], 1)):
        edges, notes = between(jumped, gap=gap)
        assert sorted(edges) == [(a, b) for a in range(10, 18) for b in (a + 1, a + 2) if {a, b} & {*GAP}]
        assert len(notes) == said


def test_drift_over_a_gap_is_no_contradiction() -> None:
    drift = frames.transform(rotations.exp(np.outer(TIME_S, [0.0, 0.0, 0.005])), np.outer(TIME_S, [0.01, -0.01, 0.01]))
    edges, notes = between((noisy(poses()), drift @ noisy(poses()))[1:])
    assert len(edges) == 15
    assert notes == []


def test_loops_that_odometry_does_not_close_are_not_compared() -> None:
    drift = frames.transform(rotations.exp(np.outer(TIME_S, [0.0, 0.0, 0.02])), np.outer(TIME_S, [0.05, -0.05, 0.03]))
    (near, notes), (far, _) = (between(drift @ noisy(poses()), apart=apart) for apart in (5, COUNT))
    assert notes == []
    assert sorted(far) == sorted(near)
    for pair, edge in near.items():
        np.testing.assert_allclose(far[pair].covariance, edge.covariance)


def test_too_few_placed_images_show_nothing() -> None:
    edges, notes = between(poses(), gap=range(5, COUNT))
    assert edges == {}
    assert "covers 5 images that depth and features place, 6 are needed" in notes[0]
    assert between(poses(), gap=range(6, COUNT))[0]


def test_instants_without_a_record_are_stepped_over() -> None:
    kept = np.delete(np.arange(COUNT), [13, 14])  # longer than is interpolated
    edges, _ = between(noisy(poses())[kept], time_s=TIME_S[kept])
    assert (12, 15) in edges
    assert not {13, 14} & {k for pair in edges for k in pair}


def test_the_first_recording_goes_before_the_second() -> None:
    both, _ = between((noisy(poses()), noisy(poses(), 0.007, 0.006)))
    first, _ = between(noisy(poses()))
    for pair, edge in first.items():
        np.testing.assert_array_equal(both[pair].T_b_a, edge.T_b_a)
    second, notes = between((poses()[::-1], noisy(poses())))
    assert sorted(second) == sorted(first)
    assert len(notes) == 1
