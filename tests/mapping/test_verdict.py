"""What makes a map doubtful or refused: each reason alone, and none of them."""

import dataclasses
from pathlib import Path

import numpy as np
import pytest

from flight import FormatError, InputError, frames, rotations
from goshawk.rendered import world as rendered_world
from mapping import map_folder, verdict
from mapping.camera.errors import Candidate, Kind
from mapping.camera.trial import Finding, Trial, Verdict
from mapping.input.images import ImageSet
from mapping.input.trajectory import MotionKind
from mapping.sparse.alignment import Alignment, ScaleWitness
from mapping.sparse.reconstruction import SparseMap
from mapping.sparse.recorded_motion.motion import MotionCheck
from mapping.verdict import Standing

RIG = rendered_world.default_rig(0.25)
COUNT = 10


def placed(
    *,
    missing: int = 0,
    findings: tuple[Finding, ...] = (),
    noise_px: float = 0.2,
    ratio: float = 1.0,
    std: float = 0.01,
    used_std: float = 0.001,
    lost_camera: bool = False,
    repeated: float = 0.05,
    breaks: tuple[tuple[int, int], ...] = (),
) -> SparseMap:
    names = tuple(f"{k}.png" for k in range(COUNT))
    registered = np.ones((COUNT, 2), bool)
    registered[:missing] = False
    registered[:, 1] &= not lost_camera
    T_world_body = np.tile(np.eye(4), (COUNT, 1, 1))
    T_world_body[:missing] = np.nan
    witnesses = (ScaleWitness("rig baseline", 1.0, used_std), ScaleWitness("recorded positions", ratio, std))
    nothing = np.zeros((0, 3))
    return SparseMap(
        images=ImageSet(Path(), RIG, names, np.ones((COUNT, 2), bool), np.full(COUNT, np.nan)),
        T_world_body=T_world_body,
        registered=registered,
        points_world_m=nothing,
        descriptors=np.zeros((0, 128), np.float32),
        observations=np.zeros((0, 3), int),
        pixels=np.zeros((0, 2)),
        reprojection_error_px=0.3,
        least_agreement=1.0,
        breaks=np.array(breaks, int).reshape(-1, 2),
        overlaps=np.array([[1, 2, 17]]),
        repeated=repeated,
        by_motion=[],
        motion_notes=[],
        trial=Trial(findings, RIG, np.zeros((0, 4, 4)), nothing, noise_px, 0.001),
        alignment=Alignment(1.0, np.eye(4), "rig baseline", "recorded gravity", witnesses=witnesses),
        cpu_s={},
    )


def finding(kind: Kind, what: Verdict, *, shift_px: float = 2.0, largest_px: float = 2.1) -> Finding:
    count = len(kind.units)
    return Finding(
        Candidate("down", kind), what, np.full(count, 0.01), np.full(count, 1e-3), shift_px, largest_px, 99.0
    )


@pytest.mark.parametrize(("tilt_deg", "is_doubted"), [(0.0, False), (115.0, False), (125.0, True), (180.0, True)])
def test_gravity_that_has_the_vehicle_hang_upside_down_is_doubted(tilt_deg: float, is_doubted: bool) -> None:
    sparse = placed(missing=1)
    tilted = sparse.T_world_body @ frames.transform(rotations.exp([np.radians(tilt_deg), 0.0, 0.0]), np.zeros(3))
    found = verdict.judge(dataclasses.replace(sparse, T_world_body=tilted))
    assert [text for text in found.reasons if "upside down" in text and f"{tilt_deg:.0f} deg" in text] == list(
        found.reasons if is_doubted else []
    )
    level = dataclasses.replace(sparse.alignment, up_source="first image taken as level")
    assert not verdict.judge(dataclasses.replace(sparse, T_world_body=tilted, alignment=level)).reasons


def test_recorded_positions_beside_the_map_and_another_up_are_doubted() -> None:
    sparse = placed()
    beside = dataclasses.replace(
        sparse.alignment, position_residual_m=3.5, position_extent_m=4.0, better_axes="their z points down (0.01 m)"
    )
    (reason,) = verdict.judge(dataclasses.replace(sparse, alignment=beside)).reasons
    assert "3.5 m apart" in reason
    assert "they fit if their z points down (0.01 m)" in reason
    tilted = dataclasses.replace(sparse.alignment, poses_up_off_rad=np.pi)
    (reason,) = verdict.judge(dataclasses.replace(sparse, alignment=tilted)).reasons
    assert "up by the recorded poses is 180 deg from the recorded gravity" in reason
    near = dataclasses.replace(
        sparse.alignment, position_residual_m=0.05, position_extent_m=4.0, poses_up_off_rad=np.radians(3.0)
    )
    assert verdict.judge(dataclasses.replace(sparse, alignment=near)).standing is Standing.GOOD


@pytest.mark.parametrize(("off_deg", "standing"), [(8.0, Standing.GOOD), (12.0, Standing.DOUBTFUL)])
def test_up_by_the_poses_may_be_off_as_far_as_an_accelerometer_in_flight_is(off_deg, standing) -> None:
    sparse = placed()
    tilted = dataclasses.replace(sparse.alignment, poses_up_off_rad=np.radians(off_deg))
    assert verdict.judge(dataclasses.replace(sparse, alignment=tilted)).standing is standing


def moved(**what: float) -> MotionCheck:
    fits = MotionCheck(
        f"{MotionKind.POSES} of a file", COUNT, 1.0, 0.01, 0.02, np.radians(0.5), np.radians(5.0), 0.0, 0.001
    )
    return dataclasses.replace(fits, **what)


@pytest.mark.parametrize(
    ("what", "standing", "said"),
    [
        ({"turn_error_rad": np.radians(2.5)}, Standing.GOOD, ""),
        ({"turn_error_rad": np.radians(4.0)}, Standing.DOUBTFUL, "differ from the map's by 4.0 deg"),
        ({"shape": 0.08}, Standing.GOOD, ""),
        ({"shape": 0.13}, Standing.DOUBTFUL, "changes by 13 %"),
        ({"late_s": 0.009}, Standing.GOOD, ""),
        ({"late_s": -0.02}, Standing.DOUBTFUL, "0.020 ± 0.002 s early"),
        ({"late_s": 0.02, "late_std_s": 0.01}, Standing.GOOD, ""),
        ({"direction_error_rad": np.radians(20.0)}, Standing.GOOD, ""),
        ({"direction_error_rad": np.radians(35.0)}, Standing.REFUSED, "35 deg apart"),
    ],
)
def test_recorded_poses_that_turn_or_move_otherwise_than_the_images_are_told(what, standing, said) -> None:
    sparse = placed()
    alignment = dataclasses.replace(sparse.alignment, motions=(moved(**what),))
    found = verdict.judge(dataclasses.replace(sparse, alignment=alignment))
    assert found.standing is standing
    assert said in " ".join(found.reasons)


def test_a_map_without_reasons_is_good() -> None:
    found = verdict.judge(placed(findings=(finding(Kind.ROTATION, Verdict.PRESENT),)))
    assert found.standing is Standing.GOOD
    assert found.corrections == ("down: rotation on the body: 0.992 ± 0.2 deg, corrected",)


DOUBTS = [
    (
        {"missing": 2},
        "4 of 20 images could not be placed: 0.png to 1.png (verified matches: 17 between 1.png and 2.png)",
    ),
    ({"noise_px": 1.01}, "1.01 px"),
    ({"repeated": 0.4}, "repeated texture: 40% of the features"),
    ({"findings": (finding(Kind.SHUTTER, Verdict.PRESENT),)}, "rolling shutter of 10 ± 2 ms"),
    ({"findings": (finding(Kind.ROTATION, Verdict.UNKNOWN),)}, "cannot tell an error of the down: rotation"),
    ({"ratio": 1.06}, "1.060 times"),
    ({"ratio": 0.94}, "0.940 times"),
    ({"ratio": 1.14}, "1.140 times"),
    ({"used_std": 0.026}, "gives the scale to ± 5 % (95 %) only"),
]


@pytest.mark.parametrize(("what", "said"), DOUBTS)
def test_each_doubt_is_named(what: dict, said: str) -> None:
    found = verdict.judge(placed(**what))
    assert found.standing is Standing.DOUBTFUL
    assert len(found.reasons) == 1
    assert said in found.reasons[0]


def test_a_first_guess_of_a_lens_that_was_far_off_is_doubted_and_not_taken_for_another_lens() -> None:
    far = placed(findings=(finding(Kind.FOCAL, Verdict.PRESENT, shift_px=90.0),))
    assert verdict.judge(far).standing is Standing.REFUSED
    rig = dataclasses.replace(RIG, refine_intrinsics=True)
    found = verdict.judge(dataclasses.replace(far, images=dataclasses.replace(far.images, rig=rig)))
    assert found.standing is Standing.DOUBTFUL
    (reason,) = found.reasons
    assert "first guess" in reason
    assert "goshawk camera add" in reason
    turned = placed(findings=(finding(Kind.ROTATION, Verdict.PRESENT, shift_px=90.0),))
    turned = dataclasses.replace(turned, images=dataclasses.replace(turned.images, rig=rig))
    assert verdict.judge(turned).standing is Standing.REFUSED  # of a lens alone the file states a guess


@pytest.mark.parametrize(("std_m", "standing"), [(0.03, Standing.GOOD), (0.06, Standing.DOUBTFUL)])
def test_a_map_that_may_be_bent_is_doubted_and_says_where(std_m: float, standing: Standing) -> None:
    sparse = placed()
    std = np.full(COUNT, std_m)
    std[7] *= 1.5
    std[3] = np.nan  # placed by recorded motion: no match sees it
    bent = dataclasses.replace(sparse, trial=dataclasses.replace(sparse.trial, shape_std=std))
    found = verdict.judge(bent)
    assert found.standing is standing
    if standing is Standing.DOUBTFUL:
        assert "image 7.png may be 0.18 m beside its place" in found.reasons[0]
        assert "a loop" in found.reasons[0]


@pytest.mark.parametrize(
    ("residual_m", "used", "standing"),
    [(0.02, COUNT, Standing.GOOD), (0.5, COUNT, Standing.DOUBTFUL), (0.02, 3, Standing.DOUBTFUL)],
)
def test_a_map_whose_recorded_positions_it_fits_is_not_bent(residual_m: float, used: int, standing: Standing) -> None:
    """The advice, once followed, removes the doubt; positions of a few images, or coarse ones, say too little."""
    sparse = placed()
    alignment = dataclasses.replace(
        sparse.alignment, position_residual_m=residual_m, positions_used=used, position_extent_m=10.0
    )
    trial = dataclasses.replace(sparse.trial, shape_std=np.full(COUNT, 0.3))
    found = verdict.judge(dataclasses.replace(sparse, alignment=alignment, trial=trial))
    assert found.standing is standing
    assert all("record positions within 5 cm" in reason for reason in found.reasons)


def test_the_position_of_an_image_is_as_uncertain_as_the_shape_and_the_scale() -> None:
    sparse = placed(used_std=0.02)
    T = sparse.T_world_body.copy()
    T[:, 0, 3] = np.arange(COUNT) - 4.5
    trial = dataclasses.replace(sparse.trial, shape_std=np.full(COUNT, 0.03))
    found = dataclasses.replace(sparse, T_world_body=T, trial=trial).position_std_m
    np.testing.assert_allclose(found[[0, 9]], np.hypot(0.03, 0.02 * 4.5))
    assert np.isnan(sparse.position_std_m).all()


@pytest.mark.parametrize(
    ("kind", "way"),
    [(Kind.OFFSET, "turns about all axes"), (Kind.UNTIMED_OFFSET, "times.csv"), (Kind.FOCAL, "turned by 90 deg")],
)
def test_an_uncertain_scale_names_the_error_that_matters_most_and_what_to_record(kind: Kind, way: str) -> None:
    small = dataclasses.replace(finding(Kind.ROTATION, Verdict.EXCLUDED), scale_std=0.001)
    large = dataclasses.replace(finding(kind, Verdict.EXCLUDED), scale_std=0.06)
    (reason,) = verdict.judge(placed(findings=(small, large), used_std=0.06)).reasons
    assert f"hardly tell the down: {kind} (± 12 %)" in reason
    assert way in reason
    assert "--length" in reason


def test_a_time_offset_without_times_asks_for_these() -> None:
    (reason,) = verdict.judge(placed(findings=(finding(Kind.UNTIMED_OFFSET, Verdict.PRESENT),))).reasons
    assert "time offset in image intervals of 0.01 ± 0.002, which" in reason
    assert "times.csv" in reason


@pytest.mark.parametrize(("growth", "said"), [(0.1, "0.1 times as large"), (1.05, "")])
def test_a_map_that_the_trial_made_of_another_size_says_so(growth: float, said: str) -> None:
    sparse = placed()
    found = verdict.judge(dataclasses.replace(sparse, trial=dataclasses.replace(sparse.trial, growth=growth)))
    assert found.standing is Standing.GOOD
    assert bool(found.corrections) == bool(said)
    assert said in "".join(found.corrections)


def test_times_too_far_apart_for_velocities_are_not_asked_for_again() -> None:
    sparse = placed(findings=(finding(Kind.UNTIMED_OFFSET, Verdict.PRESENT),))
    images = dataclasses.replace(sparse.images, time_s=1.0 * np.arange(COUNT))
    (reason,) = verdict.judge(dataclasses.replace(sparse, images=images)).reasons
    assert "at most 0.6 s apart" in reason
    assert "times.csv" not in reason


def test_a_camera_that_is_not_in_the_map_is_a_doubt() -> None:
    found = verdict.judge(placed(lost_camera=True))
    assert any("no image of camera down" in reason for reason in found.reasons)


@pytest.mark.parametrize(
    "what",
    [
        {"missing": 1},
        {"used_std": 0.025},
        {"noise_px": 0.99},
        {"ratio": 1.04},
        {"ratio": 1.2, "std": 0.1},
        {"findings": (finding(Kind.ROTATION, Verdict.UNKNOWN, largest_px=0.9),)},
        {"findings": (finding(Kind.ROTATION, Verdict.EXCLUDED, shift_px=0.01, largest_px=0.05),)},
    ],
)
def test_what_is_usual_is_no_reason(what: dict) -> None:
    assert verdict.judge(placed(**what)).standing is Standing.GOOD


@pytest.mark.parametrize(
    "what",
    [
        {"ratio": 1.2},
        {"findings": (finding(Kind.ROTATION, Verdict.PRESENT, shift_px=21.0),)},
        {"findings": (finding(Kind.FOCAL, Verdict.PRESENT, shift_px=4.0),)},
    ],
)
def test_a_wrong_size_or_another_camera_is_refused(what: dict) -> None:
    assert verdict.judge(placed(**what)).standing is Standing.REFUSED


def test_nothing_is_planned_in_a_refused_map() -> None:
    area = dataclasses.replace(opened(), facts={"verdict": "refused", "reasons": ["two sources of scale disagree"]})
    with pytest.raises(InputError, match="two sources of scale disagree"):
        area.require_not_refused()
    opened().require_not_refused()
    assert opened().standing is Standing.NOT_JUDGED


@pytest.mark.parametrize("verdict", ["good", "doubtful", None])
def test_a_map_of_images_whose_free_space_is_of_the_earlier_rule_is_doubtful(verdict: str | None) -> None:
    """Maps of images made before say nothing of what carried the cameras."""
    facts = {"scale_source": "rig baseline"} | ({"verdict": verdict} if verdict else {})
    area = dataclasses.replace(opened(), facts=facts)
    assert area.standing is Standing.DOUBTFUL
    assert area.reasons[-1] == map_folder.EARLIER_FREE_SPACE
    area = dataclasses.replace(opened(), facts=facts | {"verdict": "refused", "reasons": ["too large"]})
    assert area.standing is Standing.REFUSED


@pytest.mark.parametrize(
    "facts",
    [
        {"verdict": "good"},
        {"verdict": "good", "scale_source": "depth images"},
        {"verdict": "good", "scale_source": "rig baseline", "carrier_radius_m": 0.2},
    ],
)
def test_free_space_of_depth_images_of_solids_and_of_this_version_is_no_reason(facts: dict) -> None:
    area = dataclasses.replace(opened(), facts=facts)
    assert (area.standing, area.reasons) == (Standing.GOOD, ())


@pytest.mark.parametrize("radius_m", [np.nan, np.inf, 0.0, "wide"])
def test_a_carrier_radius_that_cannot_be_is_refused(radius_m: object) -> None:
    area = dataclasses.replace(opened(), facts={"scale_source": "rig baseline", "carrier_radius_m": radius_m})
    with pytest.raises(FormatError, match="carrier_radius_m"):
        _ = area.standing


def opened() -> map_folder.Map:
    field = None  # the verdict does not look at it
    return map_folder.Map(Path("map"), field, RIG, (), np.zeros(0), np.zeros((0, 4, 4)), {})  # type: ignore[arg-type]


def test_a_broken_map_is_refused_and_names_the_two_images() -> None:
    found = verdict.judge(placed(breaks=((4, 5),)))
    assert found.standing is Standing.REFUSED
    assert "broken between the images 4.png and 5.png" in found.reasons[0]


@pytest.mark.parametrize(
    ("turn_rad", "said"),
    [([np.pi, 0.0, 0.0], "z were down"), ([-np.pi / 2, 0.0, 0.0], "y were up"), ([0.0, np.pi / 2, 0.0], "x were up")],
)
def test_poses_with_another_axis_up_are_said_to_have_it(turn_rad: list[float], said: str) -> None:
    T = frames.transform(rotations.exp([*turn_rad]), np.zeros(3))[None]
    (doubt,) = verdict._tilt_doubts(T)
    assert said in doubt
    assert not verdict._tilt_doubts(np.eye(4)[None])
