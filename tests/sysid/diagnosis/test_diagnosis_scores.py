"""The scores of the blind campaigns: what counts as right, on results made up by hand."""

import sys
from pathlib import Path

import numpy as np
import pytest

BENCHMARKS = Path(__file__).parents[3] / "benchmarks"


@pytest.fixture(scope="module", autouse=True)
def benchmarks_on_path():
    sys.path.insert(0, str(BENCHMARKS))
    yield
    sys.path.remove(str(BENCHMARKS))


def result(kind, hidden=(), said=(), *, outside=None, truth=((), ()), ratio=3.0, confidence=0.9, tolerated=(), near=(),
           excluded=(), commands=False, size=1.0):  # fmt: skip
    candidates = {n: {"verdict": "present", "confidence": confidence, "size": {}, "smallest_visible": {}} for n in said}
    small = {"verdict": "excluded", "confidence": 0.0, "size": {}, "smallest_visible": {}}
    candidates |= {n: {**small, "interval90": {"strength": [-0.2, 0.9]}} for n in excluded}
    return {
        "campaign": "campaign_000",
        "kind": kind,
        "diagnosis": {
            "additions": list(said),
            "outside": outside and {"channel": outside[0], "variable": outside[1], "confidence": confidence},
            "confidence": confidence,
            "candidates": candidates,
            "wall_s": 10.0,
            "cpu_s": 10.0,
        },
        "truth": {
            "hidden": {n: {"strength": size} for n in hidden},
            "channels": list(truth[0]),
            "variables": list(truth[1]),
            "tolerated": ["imu_errors", *tolerated, *near],
            "near": list(near),
            "commands_only": commands,
            "rotor_late_s": 0.0,
            "law": "",
            "real_drag": list(tolerated),
        },
        "ratio": dict.fromkeys(hidden, ratio),
        "inside": {},
    }


def score(results, start):
    from diagnosis import rows

    return next(r for r in rows(results) if r.name.startswith(start))


def test_a_single_counts_by_its_first_name_and_only_when_it_could_be_seen():
    results = [
        result("single", ["weak_rotor"], ["weak_rotor[2]"]),
        result("single", ["weak_rotor"], ["centre_of_mass", "weak_rotor[2]"]),
        result("single", ["ground_effect"], [], ratio=1.2),
        result("single", ["payload"], [], ratio=None),
    ]
    row = score(results, "single")
    assert row.value == 0.5
    assert row.ok is False
    assert row.peers == {"all singles": 0.25, "no limit stated": 1.0}


def test_a_pair_needs_both_names_and_no_other():
    hidden = ["weak_rotor", "ground_effect"]
    results = [
        result("pair", hidden, ["ground_effect", "weak_rotor[0]"]),
        result("pair", hidden, ["ground_effect"]),
        result("pair", hidden, [*hidden, "pose_delay"]),
        result("pair", hidden, hidden, outside=("F_x", "v_x")),
    ]
    assert score(results, "pairs").value == 0.25


def test_outside_needs_the_channel_and_the_variable():
    truth = (("M_y",), ("v_z",))
    results = [
        result("outside", outside=("M_y", "v_z"), truth=truth),
        result("outside", outside=("M_y", "v_z v_z"), truth=truth),
        result("outside", outside=("M_y", "v_x v_z"), truth=truth),
        result("outside", outside=("F_z", "v_z"), truth=truth),
        result("outside", truth=truth),
    ]
    assert score(results, "outside").value == pytest.approx(0.4)


def test_the_biased_imu_is_no_false_name_and_the_true_drag_of_a_foreign_base_neither():
    results = [
        result("none", said=["imu_errors"]),
        result("foreign", said=["rotor_drag_speed"], tolerated=["rotor_drag_speed"]),
        result("foreign", said=["angular_damping"], tolerated=["rotor_drag_speed"]),
    ]
    assert score(results, "nothing missing").value == 0.0
    assert score(results, "foreign").value == 0.5


def test_false_names_are_a_share_of_all_names():
    results = [
        result("single", ["weak_rotor"], ["weak_rotor[1]", "pose_delay"]),
        result("none", said=["ground_effect"]),
    ]
    assert score(results, "false names").value == pytest.approx(2.0 / 3.0)


def test_the_whole_sentence_is_held_against_the_truth():
    results = [result("single", ["weak_rotor"], ["weak_rotor[1]"], confidence=0.8), result("none", confidence=0.6)]
    row = score(results, "Brier")
    assert row.value == pytest.approx((0.2**2 + 0.4**2) / 2.0)
    besides = result("single", ["weak_rotor"], ["weak_rotor[1]"], outside=("F_x", "v_x"), confidence=0.8)
    assert score([besides], "Brier").value == pytest.approx(0.64)
    wrong = [result("single", ["weak_rotor"], [], confidence=0.9)]
    assert score(wrong, "Brier").value == pytest.approx(0.81)
    unseen = [result("single", ["weak_rotor"], [], confidence=0.9, ratio=0.4)]
    assert score(unseen, "Brier").value == pytest.approx(0.01)


def test_the_nearest_name_or_the_curve_is_right_for_a_law_of_another_form():
    truth = (("M_x",), ("w_x",))
    results = [
        result("form", said=["angular_damping"], near=["angular_damping"], truth=truth),
        result("form", outside=("M_x", "w_x"), near=["angular_damping"], truth=truth),
        result("form", said=["pose_delay"], near=["angular_damping"], truth=truth),
        result("form", near=["angular_damping"], truth=truth),
    ]
    assert score(results, "law of another form").value == 0.5
    assert score(results, "false names").value == 0.5


SINK, LIFT = (("F_z",), ("v_z",)), (("F_z",), ("v_x", "v_y", "speed"))
DRAG = (("F_x", "F_y", "F_z"), ("v_x", "v_y", "v_z", "speed"))
WAKE, ROTOR = (("F_z", "M_x", "M_y"), LIFT[1]), (("F_z", "M_x", "M_y", "M_z"), ("n_1",))


@pytest.mark.parametrize(
    ("kind", "truth", "curve", "is_right"),
    [
        ("form", SINK, ("T", "v_z"), True),
        ("form", LIFT, ("T", "speed"), True),
        ("form", ROTOR, ("T_1", "n_1"), True),
        ("form", ROTOR, ("T_0", "n_0"), False),
        ("form", ROTOR, ("T", "n"), False),
        ("form", WAKE, ("T", "s"), True),
        ("form", LIFT, ("T", "s"), False),
        ("form", DRAG, ("T", "speed"), False),
        ("form", DRAG, ("F_z", "v_z"), True),
        ("outside", SINK, ("T", "v_z"), False),
    ],
)
def test_a_curve_of_thrust_is_right_for_a_law_of_thrust_only(kind, truth, curve, is_right):
    from diagnosis import outside_is_right

    assert outside_is_right(result(kind, outside=curve, truth=truth)) is is_right


def test_the_size_of_what_is_hidden_and_too_weak_must_not_be_excluded():
    results = [
        result("single", ["pose_delay"], excluded=["pose_delay"], ratio=0.6),
        result("single", ["pose_delay"], ratio=0.6),
        result("single", ["pose_delay"], excluded=["pose_delay"], ratio=5.0),
    ]
    assert score(results, "too weak").value == 0.5
    results.append(result("single", ["pose_delay"], excluded=["pose_delay"], ratio=0.6, size=-0.8))
    assert score(results, "too weak").value == pytest.approx(1.0 / 3.0)


def test_campaigns_with_commands_alone_are_a_row_of_their_own():
    results = [
        result("single", ["motor_lag"], ["motor_lag"], commands=True),
        result("single", ["motor_lag"], [], commands=True),
        result("single", ["pose_delay"], ["pose_delay"]),
    ]
    assert score(results, "commands").value == 0.5


def test_silence_over_something_outside_the_catalogue_is_wrong():
    missed = [result("outside", truth=(("F_x",), ("v_x",)), confidence=1.0)]
    assert score(missed, "Brier").value == 1.0


def test_sizes_scale_with_the_mass_the_file_believes():
    import diagnosis_run

    truth = {"hidden": {"flapping_moment": {"moment_kg_m": 1e-6}}, "mass_kg": 0.5, "file_mass_kg": 0.51}
    for value, held in ((1.02e-6, True), (1.00e-6, False)):
        interval = {"moment_kg_m": [value - 8e-9, value + 8e-9]}
        said = {"additions": ["flapping_moment"], "candidates": {"flapping_moment": {"interval90": interval}}}
        assert diagnosis_run.inside(said, truth) == {"flapping_moment.moment_kg_m": held}


def test_times_and_ratios_do_not_scale_with_the_mass_the_file_believes():
    import diagnosis_run

    for effect, parameter, true in (("motor_lag", "rise_s", 0.03), ("battery_sag", "sag_per_v", 0.04)):
        truth = {"hidden": {effect: {parameter: true}}, "mass_kg": 0.5, "file_mass_kg": 0.51}
        interval = {effect: {"interval90": {parameter: [0.999 * true, 1.001 * true]}}}
        assert diagnosis_run.inside({"additions": [effect], "candidates": interval}, truth) == {
            f"{effect}.{parameter}": True
        }


def test_a_rotor_wrongly_blamed_has_no_size():
    import diagnosis_run

    sizes = {"loss_0": 0.0, "loss_2": 0.05}
    truth = {"hidden": {"weak_rotor": sizes}, "mass_kg": 0.5, "file_mass_kg": 0.5}
    interval = {"weak_rotor[0]": {"interval90": {"loss_0": [-0.1, 0.1]}}}
    assert diagnosis_run.inside({"additions": ["weak_rotor[0]"], "candidates": interval}, truth) == {}


def test_the_clearest_parameter_says_whether_an_effect_could_be_seen():
    import diagnosis_run

    candidates = {
        "weak_rotor[0]": {"smallest_visible": {"loss_0": 0.01}},
        "weak_rotor[1]": {"smallest_visible": {"loss_1": 0.02}},
    }
    sizes = {"loss_0": 0.0, "loss_1": 0.05}
    assert diagnosis_run.ratio("weak_rotor", sizes, candidates) == pytest.approx(2.5)
    assert diagnosis_run.ratio("ground_effect", {"strength": 1.0}, candidates) is None


@pytest.mark.slow
def test_unseen_flights_do_not_refuse_a_name_for_what_the_model_without_it_takes_for_noise(tmp_path):
    """The file believes in another form of drag: with the torque known, drag gets worse, and is renewed."""
    import blind_campaigns
    import blind_draw
    import diagnosis_run

    key = [20261121, blind_draw.KINDS.index("foreign"), 87, 0]
    rng = np.random.default_rng(key)
    truth = blind_draw.draw("foreign", rng)
    assert list(truth.hidden) == ["rotor_acceleration_torque"]
    (made,) = blind_campaigns.fly([truth], [rng], 36.0)
    blind_campaigns.write(tmp_path, "campaign_087", truth, made, key, rng)
    said = diagnosis_run.score(tmp_path / "campaign_087")["diagnosis"]
    assert said["additions"] == ["rotor_acceleration_torque", *truth.real]
    assert said["outside"] is None


def test_a_name_of_the_right_family_counts_for_the_family_and_one_of_another_family_beside_it_does_not():
    from diagnosis import family_is_right

    drag = ["parasitic_drag"]
    assert family_is_right(result("single", drag, ["rotor_drag_thrust"]))
    assert family_is_right(result("form", said=["parasitic_drag_linear"], near=drag))
    assert not family_is_right(result("single", drag))
    assert not family_is_right(result("single", drag, ["rotor_drag_thrust", "angular_damping"]))
    undecided = result("single", drag)
    undecided["diagnosis"]["undecided"] = ["parasitic_drag_speed", "rotor_drag_speed"]
    assert family_is_right(undecided)


@pytest.mark.parametrize(("ended", "is_right"), [("added", True), ("removed", False), ("not confirmed", False)])
def test_the_nearest_law_that_is_said_to_show_too_small_to_matter_is_no_silence(ended: str, is_right: bool):
    from diagnosis import family_is_right, sentence_is_right

    small = result("form", near=["flapping_moment"])
    small["diagnosis"]["attempts"] = [["flapping_moment", "added", ""], ["flapping_moment", ended, ""]]
    assert sentence_is_right(small) == family_is_right(small) == is_right
    other = result("form", near=["ground_effect"])
    other["diagnosis"]["attempts"] = small["diagnosis"]["attempts"]
    assert not sentence_is_right(other)
    assert not family_is_right(other)


def test_what_is_written_stands_beside_the_optimum_and_its_lines_and_fate_are_counted():
    def kept(written, equation, lines, *, halves=True, fate=True):
        answer = {"lines": lines, "halves": halves, "written": fate, "for_prediction": False, "marked": False}
        return result("form") | {
            "answer": answer,
            "optimum": {"written": written, "optimum": 0.1, "given": 1.0},
            "equation": equation,
        }

    results = [kept(0.104, "x", 20), kept(0.106, None, 25), kept(0.09, None, 22, halves=False, fate=False)]
    near = score(results, "other forms: held-out error")
    assert near.value == pytest.approx(2 / 3)
    assert (near.peers["with an equation"], near.peers["of them within"]) == (1, 1)
    refused = kept(float("inf"), None, 22, fate=False)
    lost = result("form") | {"no_optimum": "not converged", "answer": refused["answer"]}
    harder = score([*results, refused, lost], "other forms: held-out error")
    assert harder.value == pytest.approx(2 / 4)
    assert harder.peers["without an optimum"] == 1
    assert harder.peers["worst"] == float("inf")
    assert near.peers["worst"] == pytest.approx(1.06)
    assert score(results, "held-out error halves").value == 1.0
    assert score([kept(0.1, None, 24, fate=False)], "held-out error halves").ok is False
    assert score(results, "lines of 80 columns").value == 25
    assert score(results, "lines of 80 columns").ok is False
    assert score([result("form")], "lines of 80 columns").ok is None
