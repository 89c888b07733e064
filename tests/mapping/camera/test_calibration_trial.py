"""A known error of the calibration is found, with its size; none is invented. Points and poses are made by formula."""

import dataclasses

import numpy as np
import pytest

from flight import frames, rotations
from mapping.camera import adjustment, errors
from mapping.camera import trial as trials
from mapping.camera.adjustment import Observations
from mapping.camera.errors import Kind
from mapping.camera.rig import Rig
from mapping.camera.trial import Trial, Verdict
from tests.mapping.camera.formula import (
    FOCAL_PX,
    NOISE_PX,
    RATE_HZ,
    RIG,
    TIMES_S,
    changed,
    image,
    lens,
    observed,
    pose,
    scale_error,
    tried,
    turned,
)


def test_a_right_camera_file_is_acquitted() -> None:
    found = tried(RIG, RIG)
    assert not found.present
    assert found.noise_px == pytest.approx(NOISE_PX, rel=0.1)
    assert found.scale_std < 0.01
    for finding in found.findings:
        assert (np.abs(finding.size) < 4.5 * finding.std).all(), str(finding.candidate)
    np.testing.assert_array_equal(found.rig.cameras[1].T_body_camera, RIG.cameras[1].T_body_camera)


TURN_RAD = np.radians([0.6, 0.6, -0.5])
PLANTED = [
    ("down", Kind.ROTATION, turned(RIG, TURN_RAD), {}, TURN_RAD),
    ("front", Kind.FOCAL, lens(RIG, 0, fx=0.01 * FOCAL_PX, fy=0.01 * FOCAL_PX), {}, [0.01]),
    ("down", Kind.FOCAL, lens(RIG, 1, fx=0.01 * FOCAL_PX, fy=0.01 * FOCAL_PX), {}, [0.01]),
    ("front", Kind.RADIAL, lens(RIG, 0, k1=0.006), {}, [0.006]),
    ("down", Kind.OFFSET, RIG, {"offset_s": 0.005}, [0.005]),
]


@pytest.mark.parametrize(("camera", "kind", "true", "how", "size"), PLANTED)
def test_a_planted_error_is_the_one_found(camera: str, kind: Kind, true: Rig, how: dict, size: list[float]) -> None:
    found = tried(true, RIG, **how)
    assert [(f.candidate.camera, f.candidate.kind) for f in found.present] == [(camera, kind)]
    (finding,) = found.present
    np.testing.assert_allclose(finding.size, size, atol=4.5 * float(finding.std.max()))
    assert found.noise_px == pytest.approx(NOISE_PX, rel=0.1)


@pytest.mark.parametrize("factor", [0.9, pytest.param(1.1, marks=pytest.mark.slow)])
def test_a_focal_length_that_is_far_off_is_found(factor: float) -> None:
    """Far from linear: full steps of the adjustment diverge from here."""
    told = RIG
    for number in range(2):
        told = changed(told, number, params=RIG.cameras[number].params * [factor, factor, *[1.0] * 6])
    found = tried(RIG, told)
    assert {(f.candidate.camera, f.candidate.kind) for f in found.present} == {(c.name, Kind.FOCAL) for c in RIG}
    for finding in found.present:
        np.testing.assert_allclose(finding.size, 1.0 / factor - 1.0, atol=4.5 * float(finding.std.max()))


def test_an_extended_unified_camera_is_tried_like_the_others() -> None:
    """EUCM has no radial terms of its own; what is found of the focal length or the mount keeps the model."""
    named = {number: np.array([*camera.params[:4], 0.63, 1.04]) for number, camera in enumerate(RIG)}
    right = changed(changed(RIG, 0, model="EUCM", params=named[0]), 1, model="EUCM", params=named[1])
    assert not tried(right, right).present
    longer = changed(right, 0, params=named[0] * [1.01, 1.01, 1.0, 1.0, 1.0, 1.0])
    for true, kind, size in ((longer, Kind.FOCAL, [0.01]), (turned(right, TURN_RAD), Kind.ROTATION, TURN_RAD)):
        found = tried(true, right)
        assert [finding.candidate.kind for finding in found.present] == [kind]
        np.testing.assert_allclose(found.present[0].size, size, atol=1e-3)
        assert {camera.model for camera in found.rig} == {"EUCM"}


LENS_AND_OFFSET = {"front: focal length": 0.007, "front: radial distortion": 0.004, "down: time offset": 0.005}
LONGER = lens(RIG, 0, fx=0.007 * FOCAL_PX, fy=0.007 * FOCAL_PX, k1=0.004)


@pytest.fixture(scope="module")
def shaken() -> Trial:
    """The trial of `LENS_AND_OFFSET` on a flight that shakes faster than it takes images."""
    return tried(LONGER, RIG, offset_s=0.005, shake_rad=0.03)


def test_the_scale_is_uncertain_where_the_motion_between_images_is_not_known(shaken: Trial) -> None:
    """Velocities from poses a tenth of a second apart are wrong, and with them where a late camera was."""
    steady = tried(LONGER, RIG, offset_s=0.005)
    assert abs(scale_error(steady, pose(TIMES_S))) < 2.5 * steady.scale_std
    assert abs(scale_error(shaken, pose(TIMES_S, 0.03))) < 2.5 * shaken.scale_std
    assert shaken.scale_std > 2.0 * steady.scale_std


def test_shaking_between_images_is_not_taken_for_errors_of_the_cameras(shaken: Trial) -> None:
    assert {str(f.candidate) for f in shaken.present} == set(LENS_AND_OFFSET)
    of_the_lens = [f for f in shaken.present if f not in shaken.inexpressible]
    for finding in of_the_lens:
        assert abs(finding.size[0] - LENS_AND_OFFSET[str(finding.candidate)]) < 3.0 * finding.std[0]
    others = [f.verdict for f in shaken.findings if f.candidate.kind in (Kind.CENTRE, Kind.ROTATION)]
    assert others == [Verdict.UNKNOWN] * 3


def test_copies_of_matches_are_no_further_evidence() -> None:
    """They share their errors within each image: with four copies of each, no less is uncertain, and no more found."""
    T, points, index, pixels = observed(lens(RIG, 0, fx=0.01 * FOCAL_PX, fy=0.01 * FOCAL_PX))
    copies = 4
    copied = np.tile(index, (copies, 1))
    copied[:, 0] += np.repeat(len(points) * np.arange(copies), len(index))
    once, often = (
        trials.hold(
            Observations(RIG, T, np.tile(points, (n, 1)), copied[: n * len(index)], np.tile(pixels, (n, 1)), TIMES_S)
        )
        for n in (1, copies)
    )
    assert [str(f.candidate) for f in once.present] == [str(f.candidate) for f in often.present]
    assert often.present[0].gain < 1.5 * once.present[0].gain
    std = {f.candidate: f.std for f in often.findings}
    assert np.median([std[f.candidate] / f.std for f in once.findings if len(f.std) == 1]) > 0.8


def test_the_images_gradients_add_up_and_no_parameter_varies_more_than_the_dispersion_says() -> None:
    T, points, index, pixels = observed(RIG)
    seen = Observations(RIG, T, points, index, pixels, TIMES_S)
    candidates = errors.candidates(RIG, timed=True)
    normal = adjustment.Normal(seen, adjustment.initial(seen), candidates, folds=1)
    by_image, by_cell = map(normal._of_calibration, normal._scores)
    redundancy = 1.0 - (3 * len(np.unique(index[:, 0])) + 6 * len(T)) / pixels.size
    gradient = normal._reduced.marginal.gradient
    for by_group in (by_image, by_cell):
        total = np.sqrt(redundancy) * by_group.sum(axis=1)
        np.testing.assert_allclose(total, gradient, atol=1e-6 * np.abs(gradient).max())
    for candidate in candidates:
        k = normal._unknowns([candidate])
        _, covariance = normal.solve([candidate])
        for by_group in (by_image, by_cell):
            of_each = ((covariance @ by_group[k]) ** 2).sum(axis=1)
            assert (of_each <= 1.0001 * normal.dispersion([candidate], candidate) * np.diag(covariance)).all(), (
                candidate
            )


def test_both_cameras_share_a_rolling_shutter() -> None:
    found = tried(RIG, RIG, shutter_s=0.010)
    assert {str(f.candidate) for f in found.present} == {"front: rolling shutter", "down: rolling shutter"}
    for finding in found.present:
        assert finding.size[0] == pytest.approx(0.010, abs=5.0 * finding.std[0] + 2e-4)
    assert len(found.inexpressible) == 2


def test_two_errors_are_told_apart() -> None:
    found = tried(lens(turned(RIG, TURN_RAD), 0, fx=2.0, fy=2.0), RIG)
    assert {str(f.candidate) for f in found.present} == {"down: rotation on the body", "front: focal length"}
    np.testing.assert_allclose(
        found.rig.cameras[1].T_body_camera, turned(RIG, TURN_RAD).cameras[1].T_body_camera, atol=1e-3
    )
    assert found.rig.cameras[0].focal_px[0] == pytest.approx(FOCAL_PX + 2.0, abs=0.1)


def test_tangential_distortion_is_found_though_no_camera_file_states_it() -> None:
    found = tried(RIG, RIG, tangential=0.002)
    assert {f.candidate.kind for f in found.inexpressible} == {Kind.TANGENTIAL}
    assert {f.candidate.camera for f in found.inexpressible} == {"front", "down"}


def test_a_single_camera_has_no_scale_and_no_pose_on_trial() -> None:
    rig = dataclasses.replace(RIG, cameras=RIG.cameras[:1])
    found = tried(rig, rig)
    assert found.scale_std == float("inf")
    assert not {Kind.ROTATION, Kind.TRANSLATION, Kind.OFFSET} & {f.candidate.kind for f in found.findings}


def test_few_matches_cannot_tell() -> None:
    T, points, index, pixels = observed(RIG)
    few = (index[:, 0] < 12) & (index[:, 1] < 5)
    found = trials.hold(Observations(RIG, T, points, index[few], pixels[few], np.arange(len(T)) / RATE_HZ))
    assert not found.present
    assert sum(f.verdict is Verdict.UNKNOWN for f in found.findings) > 0.7 * len(found.findings)


def test_derivatives_agree_with_finite_differences() -> None:
    T, points, index, pixels = observed(RIG)
    seen = Observations(RIG, T, points, index, pixels, np.arange(len(T)) / RATE_HZ)
    candidates = [*errors.candidates(RIG, timed=True), errors.Candidate("down", Kind.BASELINE)]
    state = errors.State(RIG, T, points, np.zeros((2, 2)), np.array([0.0, 2e-3]), np.array([3e-3, 1e-3]))
    start = 0
    rows = adjustment.linearise(seen, state, candidates)
    for candidate in candidates:
        for k in range(len(candidate.kind.units)):
            step = np.zeros(len(candidate.kind.units))
            step[k] = 1e-6
            ahead, behind = (
                adjustment.linearise(seen, errors.corrected(state, candidate, sign * step), candidates).residual
                for sign in (1.0, -1.0)
            )
            slope = -(ahead - behind) / 2e-6
            expected = rows.calibration[:, :, start]
            assert np.abs(slope - expected).max() < 1e-3 * max(np.abs(expected).max(), 1.0), (candidate, k)
            start += 1


def pinholes(rig: Rig) -> Rig:
    cameras = [dataclasses.replace(c, model="PINHOLE", params=c.params[:4], field_of_view_rad=2.2) for c in rig]
    return dataclasses.replace(rig, cameras=tuple(cameras))


def test_a_pinhole_stays_one_when_its_focal_length_is_corrected() -> None:
    told = pinholes(RIG)
    found = tried(changed(told, 0, params=told.cameras[0].params * [1.01, 1.01, 1.0, 1.0]), told)
    assert [str(f.candidate) for f in found.present] == ["front: focal length"]
    assert found.rig.cameras[0].model == "PINHOLE"
    assert found.rig.cameras[0].focal_px[0] == pytest.approx(1.01 * FOCAL_PX, abs=0.15)


def test_a_pinhole_with_distortion_is_written_as_the_same_lens() -> None:
    none = np.zeros(2)
    state = errors.State(pinholes(RIG), np.zeros((0, 4, 4)), np.zeros((0, 3)), np.zeros((2, 2)), none, none)
    pinhole = state.rig.cameras[0]
    changed_state = errors.corrected(state, errors.Candidate("front", Kind.RADIAL), np.zeros(1))
    rays = pinhole.unproject(pinhole.pixel_centres()[::16, ::16])
    np.testing.assert_allclose(changed_state.rig.cameras[0].project(rays), pinhole.project(rays), atol=0.1)


def test_a_step_that_first_overshoots_is_not_the_last() -> None:
    """The map has adapted to a wrong lens: its scale is wrong, and the first linear step is far from the end."""
    true = lens(RIG, 0, fx=0.06 * FOCAL_PX, fy=0.06 * FOCAL_PX, k1=0.02)
    T, points, index, pixels = observed(true)
    small = T.copy()
    small[:, :3, 3] *= 0.7
    found = trials.hold(Observations(RIG, small, 0.7 * points, index, pixels, TIMES_S))
    assert found.rig.cameras[0].focal_px[0] == pytest.approx(1.06 * FOCAL_PX, rel=2e-3)
    assert np.ptp(found.T_world_body[:, 0, 3]) == pytest.approx(np.ptp(T[:, 0, 3]), rel=0.02)
    assert found.noise_px == pytest.approx(NOISE_PX, rel=0.1)


def test_noise_is_that_of_the_matches_however_few_images_see_a_point() -> None:
    T, points, index, pixels = observed(RIG)
    pairs = np.concatenate([np.flatnonzero(index[:, 0] == p)[:2] for p in range(len(points))])
    pairs = pairs[np.bincount(index[pairs, 0], minlength=len(points))[index[pairs, 0]] == 2]
    seen = Observations(RIG, T, points, index[pairs], pixels[pairs], TIMES_S)
    state = errors.State(RIG, T, points, np.zeros((2, 2)), np.zeros(2), np.zeros(2))
    normal = adjustment.Normal(seen, adjustment.adjust(seen, state, [])[0], [])
    assert 0.6 * NOISE_PX < normal.noise_px < 1.3 * NOISE_PX


def test_normal_equations_with_folds_refuse_to_step_instead_of_leaving_the_points_behind() -> None:
    T, points, index, pixels = observed(RIG)
    seen = Observations(RIG, T, points, index, pixels, TIMES_S)
    state = adjustment.initial(seen)
    with pytest.raises(AssertionError, match="folds"):
        adjustment.Normal(seen, state, []).step(state, [], np.zeros(0), 1.0)


@pytest.mark.parametrize("count", [1, 3, 5])
def test_fewer_points_than_folds_are_no_crash(count: int) -> None:
    T, points, index, pixels = observed(RIG)
    few = index[:, 0] < count
    assert not trials.hold(Observations(RIG, T, points, index[few], pixels[few], TIMES_S)).present


def test_one_instant_gives_no_scale() -> None:
    T, points, index, pixels = observed(RIG)
    T[1:] = np.nan
    one = index[:, 1] == 0
    assert trials.hold(Observations(RIG, T, points, index[one], pixels[one], TIMES_S)).scale_std == np.inf


def test_velocity_is_not_taken_across_a_gap_or_from_equal_times() -> None:
    T = pose(TIMES_S)
    gap_s = TIMES_S + 100.0 * (np.arange(len(T)) > 0)
    twice_s = TIMES_S.copy()
    twice_s[1] = twice_s[2]
    for times_s in (gap_s, twice_s):
        twist = adjustment.twists(times_s, T)
        assert np.isnan(twist[0]).all()
        assert np.isfinite(twist[4:]).all()


def test_the_basis_of_a_direction_does_not_jump_when_a_coordinate_changes_sign() -> None:
    bases = []
    for small_m in (1e-6, -1e-6):
        T = RIG.cameras[1].T_body_camera.copy()
        T[:3, 3] = RIG.cameras[0].T_body_camera[:3, 3] + [small_m, 0.1, -small_m]
        rig = changed(RIG, 1, T_body_camera=T)
        bases.append(errors._perpendicular(rig.cameras[1], rig.cameras[0]))
    np.testing.assert_allclose(bases[0], bases[1], atol=1e-5)


def test_a_vehicle_that_stands_cannot_tell_of_time() -> None:
    T, points, index, pixels = observed(RIG)
    first = np.flatnonzero(index[:, 1] == 0)
    rng = np.random.default_rng(3)
    again = np.concatenate([index[first] + [0, i, 0] for i in range(8)])
    noisy = np.tile(pixels[first], (8, 1)) + NOISE_PX * rng.normal(size=(8 * len(first), 2))
    found = trials.hold(Observations(RIG, np.tile(T[0], (8, 1, 1)), points, again, noisy, TIMES_S[:8]))
    of_time = [f for f in found.findings if f.candidate.kind in (Kind.OFFSET, Kind.SHUTTER)]
    assert len(of_time) == 3
    assert {f.verdict for f in of_time} == {Verdict.UNKNOWN}


def test_matches_without_redundancy_exclude_nothing() -> None:
    T, points, index, pixels = observed(RIG)
    first_two = (index[:, 1] < 2) & (index[:, 2] == 0) & (index[:, 0] < 60)
    found = trials.hold(Observations(RIG, T, points, index[first_two], pixels[first_two], TIMES_S))
    assert {f.verdict for f in found.findings} <= {Verdict.UNKNOWN}


def test_what_couples_instants_does_not_grow_with_their_square() -> None:
    """A long path: each point is seen from a few neighbouring instants only."""
    counts = []
    for instants in (20, 80):
        rng = np.random.default_rng(0)
        times_s = np.arange(instants) / RATE_HZ
        T = pose(times_s)
        middle = np.repeat(np.arange(instants), 20)
        points = frames.apply(T[middle], rng.uniform([2.0, -1.5, -1.0], [4.0, 1.5, 1.0], (len(middle), 3))[:, None])[
            :, 0
        ]
        index, pixels = [], []
        for i in range(instants):
            near = np.flatnonzero(np.abs(middle - i) < 3)
            seen = image(RIG.cameras[0], times_s[i], points[near], 0.0, 0.0)
            inside = np.flatnonzero(RIG.cameras[0].contains(seen))
            index.append(np.column_stack([near[inside], np.full((len(inside), 2), [i, 0])]))
            pixels.append(seen[inside])
        seen = Observations(RIG, T, points, np.concatenate(index), np.concatenate(pixels), times_s)
        state = errors.State(RIG, T, points, np.zeros((2, 2)), np.zeros(2), np.zeros(2))
        normal = adjustment.Normal(seen, state, [], folds=1)
        counts.append(normal._reduced.factor.nnz)
    assert counts[1] < 5.0 * counts[0]


def test_a_third_camera_is_tried_like_the_second() -> None:
    T = RIG.cameras[1].T_body_camera.copy()
    T[:3, :3] = rotations.matrix(rotations.exp([0.0, 0.0, 1.2])) @ RIG.cameras[0].T_body_camera[:3, :3]
    T[:3, 3] += [0.0, 0.07, 0.02]
    left = dataclasses.replace(RIG.cameras[0], name="left", folder="left", T_body_camera=T)
    told = dataclasses.replace(RIG, cameras=(*RIG.cameras, left))
    T_true = T.copy()
    T_true[:3, :3] = T[:3, :3] @ rotations.matrix(rotations.exp(TURN_RAD))
    found = tried(changed(told, 2, T_body_camera=T_true), told)
    assert [str(f.candidate) for f in found.present] == ["left: rotation on the body"]
    np.testing.assert_allclose(found.present[0].size, TURN_RAD, atol=4.5 * float(found.present[0].std.max()))
