"""Errors that no image tells: without times, in the size and in the shape of the whole path."""

import numpy as np
import pytest

from flight import FloatArray, frames
from mapping.camera import adjustment, advice, errors
from mapping.camera import trial as trials
from mapping.camera.adjustment import Observations
from mapping.camera.errors import Kind
from mapping.camera.trial import Trial
from tests.mapping.camera.formula import (
    NOISE_PX,
    RATE_HZ,
    RIG,
    TIMES_S,
    changed,
    observed,
    scale_error,
)


def untimed(unevenly: float = 0.0, offset_s: float = 0.0, shutter_s: float = 0.0) -> tuple[Trial, FloatArray]:
    """The trial of `RIG` on images without times, and the true poses; intervals between images differ by `unevenly`."""
    T, points, index, pixels = observed(RIG, unevenly=unevenly, offset_s=offset_s, shutter_s=shutter_s)
    return trials.hold(Observations(RIG, T, points, index, pixels, np.full(len(T), np.nan))), T


@pytest.mark.parametrize("unevenly", [0.0, 0.5])
def test_a_camera_that_is_late_is_found_without_times_and_the_scale_is_right(unevenly: float) -> None:
    """How even the images are is estimated with the offset: nobody says it."""
    found, true = untimed(unevenly, offset_s=0.020)
    assert [str(f.candidate) for f in found.present] == ["down: time offset in image intervals"]
    assert found.present[0].size[0] == pytest.approx(0.020 * RATE_HZ, rel=0.05 + unevenly)
    assert abs(scale_error(found, true)) < 1.96 * found.scale_std
    assert found.scale_std < 0.03
    assert found.inexpressible == found.present


def test_a_rolling_shutter_is_found_without_times() -> None:
    found, true = untimed(shutter_s=0.010)
    assert {str(f.candidate) for f in found.present} == {f"{c.name}: rolling shutter in image intervals" for c in RIG}
    assert abs(scale_error(found, true)) < 1.96 * found.scale_std


def test_right_images_without_times_are_acquitted() -> None:
    found, _ = untimed()
    assert not found.present
    assert not {Kind.OFFSET, Kind.SHUTTER} & {f.candidate.kind for f in found.findings}
    assert found.scale_std < 0.02


def test_images_too_far_apart_for_velocities_are_tried_in_intervals_as_they_are_spaced() -> None:
    T, points, index, pixels = observed(RIG)
    seen = Observations(RIG, T, points, index, pixels, 2.0 * np.arange(len(T)))
    counted = adjustment.counted(seen)
    assert counted.is_counted
    np.testing.assert_allclose(np.diff(counted.time_s), errors.INTERVAL_S)
    assert {Kind.UNTIMED_OFFSET, Kind.UNTIMED_SHUTTER} <= {f.candidate.kind for f in trials.hold(seen).findings}


def test_a_few_images_close_together_do_not_switch_the_trial_in_intervals_off() -> None:
    """Of 24 images .7 s apart 4 have a velocity: without the others' a late camera is blamed on a lens."""
    at_s = np.concatenate([np.arange(12), [11.36, 11.72], np.arange(12, 22)]) / RATE_HZ
    T, points, index, pixels = observed(RIG, offset_s=0.020, at_s=at_s)
    found = trials.hold(Observations(RIG, T, points, index, pixels, 7.0 * at_s))
    assert [str(f.candidate) for f in found.present] == ["down: time offset in image intervals"]
    assert abs(scale_error(found, T)) < 3.0 * found.scale_std


def test_a_straight_flight_leaves_the_scale_as_uncertain_as_a_late_camera_would_make_it() -> None:
    """Along a straight line a late camera is like one mounted further back: the images cannot tell them apart."""
    rng = np.random.default_rng(2)
    points = rng.uniform([-1.0, -5.0, -1.0], [12.0, 5.0, 5.0], (400, 3))
    positions = np.stack([4.0 * TIMES_S, 0.0 * TIMES_S, 1.5 + 0.0 * TIMES_S], axis=1)
    T = frames.transform(np.tile([1.0, 0.0, 0.0, 0.0], (len(TIMES_S), 1)), positions)
    index, pixels = [], []
    for number, camera in enumerate(RIG):
        for i, T_world_body in enumerate(T):
            seen = camera.project(frames.apply(frames.invert(T_world_body @ camera.T_body_camera), points))
            shown = np.flatnonzero(camera.contains(seen))
            index.append(np.column_stack([shown, np.full((len(shown), 2), [i, number])]))
            pixels.append(seen[shown] + NOISE_PX * rng.normal(size=(len(shown), 2)))
    found = trials.hold(Observations(RIG, T, points, np.concatenate(index), np.concatenate(pixels), TIMES_S))
    assert not found.present
    assert found.scale_std > 0.05
    least = advice.least_certain(found)
    assert least is not None
    assert least.candidate.kind in (Kind.OFFSET, Kind.TRANSLATION)
    assert "--length" in advice.scale_text(found, is_timed=True)


@pytest.mark.parametrize("factor", [10.0, 0.2])
def test_a_map_of_another_size_than_its_matches_ask_for_is_set_right_and_no_lens_is_blamed(factor: float) -> None:
    T, points, index, pixels = observed(RIG)
    large = T.copy()
    large[:, :3, 3] *= factor
    found = trials.hold(Observations(RIG, large, factor * points, index, pixels, TIMES_S))
    assert not found.present
    assert abs(scale_error(found, T)) < 3.0 * found.scale_std
    assert found.growth == pytest.approx(1.0 / factor, rel=0.05)


def test_a_map_of_its_right_size_is_adjusted_once_and_one_without_a_baseline_keeps_its_own(monkeypatch) -> None:
    freed: list[object] = []
    adjust = trials.adjust
    monkeypatch.setattr(
        trials, "adjust", lambda seen, state, free: freed.append(list(free)) or adjust(seen, state, free)
    )
    T = RIG.cameras[1].T_body_camera.copy()
    T[:3, 3] = RIG.cameras[0].T_body_camera[:3, 3] + [0.0, 0.001, 0.0]
    for rig in (RIG, changed(RIG, 1, T_body_camera=T)):
        poses, points, index, pixels = observed(rig)
        seen = Observations(rig, poses, points, index, pixels, TIMES_S)
        trials._at_its_size(seen, errors.candidates(rig, timed=True))
    assert freed == [[], []]


def off_shape_m(found: Trial, true: FloatArray) -> float:
    """RMS distance of the positions from the true ones after the best similarity."""
    a, b = (T[:, :3, 3] - T[:, :3, 3].mean(axis=0) for T in (found.T_world_body, true))
    u, strength, vt = np.linalg.svd(b.T @ a)
    turned = a @ (u @ vt).T * strength.sum() / (a**2).sum()
    return float(np.sqrt(((turned - b) ** 2).sum(axis=1).mean()))


def test_errors_that_all_images_share_convict_no_lens_and_are_in_the_stated_shape() -> None:
    """Features lie beside their places as the image has them, by .3 px: no noise, and no lens."""
    T, points, index, pixels = observed(RIG)
    place = pixels / [RIG.cameras[0].width, RIG.cameras[0].height]
    beside_px = 0.3 * np.column_stack([np.sin(9.0 * place[:, 1] + 4.0 * place[:, 0]), np.cos(8.0 * place[:, 0])])
    exact, shared = (
        trials.hold(Observations(RIG, T, points, index, pixels + px, TIMES_S)) for px in (0.0 * beside_px, beside_px)
    )
    assert not shared.present
    assert exact.shape_std is not None
    assert shared.shape_std is not None
    for found in (exact, shared):
        assert off_shape_m(found, T) < 2.0 * float(np.sqrt(np.mean(found.shape_std**2)))
    assert off_shape_m(exact, T) > 0.7 * float(np.sqrt(np.mean(exact.shape_std**2)))  # independent noise counts once
    assert np.median(shared.shape_std) > 1.5 * np.median(exact.shape_std)
    assert shared.scale_std > 1.5 * exact.scale_std


def test_an_instant_without_matches_has_no_stated_shape_and_takes_none_from_the_others() -> None:
    T, points, index, pixels = observed(RIG)
    seen = index[:, 1] != 11
    candidates = errors.candidates(RIG, timed=True)
    stated = []
    for kept in (np.ones_like(seen), seen):
        part = Observations(RIG, T, points, index[kept], pixels[kept], TIMES_S)
        state = adjustment.initial(part)
        stated.append(adjustment.Normal(part, state, candidates).shape_std(state))
    others = np.arange(len(T)) != 11
    assert np.isnan(stated[1][11])
    np.testing.assert_allclose(stated[1][others], stated[0][others], rtol=0.4)
