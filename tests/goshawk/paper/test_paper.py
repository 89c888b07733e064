"""`goshawk paper`: theirs beside ours, each said to be flown, rendered or simulated; none of theirs is invented."""

import json
import re

import numpy as np
import pytest

import sysid
from flight import InfeasibleError, flight_log, rotations, silent
from goshawk.commands.project import paper
from goshawk.paper import identified, page, parts, theirs
from tests.goshawk.running import answer, run

PRINTED = {
    "inertia_xx_kg_m2": (0.00306, 0.00241), "inertia_yy_kg_m2": (0.00442, 0.00342),
    "inertia_zz_kg_m2": (0.00441, 0.00522), "pose_sensor_x_m": (0.0901, None), "pose_sensor_y_m": (0.0063, None),
    "pose_sensor_z_m": (0.0142, None), "centre_of_mass.x_m": (0.0014, None), "centre_of_mass.y_m": (0.00018, None),
    "thrust_bem.k1_n_s2": (3.119e-6, None), "thrust_bem.k2_n_s2_m": (-1.547e-4, None),
    "rotor_drag_thrust.drag_s_m": (0.0175, None), "parasitic_drag.drag_xy_kg_m": (0.0055, None),
    "parasitic_drag.drag_z_kg_m": (0.0185, None), "rotor_yaw_torque.torque_n_m_s2": (3.1e-8, None),
}  # fmt: skip


def quick(name: str) -> parts.Part:
    """A part that takes no time and has no pictures."""
    return parts.Part(name, "simulated", lambda folder, progress: {"of": name})


def test_table_one_is_what_the_vehicle_file_says_it_is():
    assert {row.name: (row.value, row.cad) for row in theirs.table()} == PRINTED


def test_the_verb_offers_every_part():
    assert tuple(parts.PARTS) == paper.NAMES


def test_figures_whose_content_is_not_known_say_so():
    assert list(theirs.FIGURES) == [f"Fig. {number}" for number in range(7, 12)]
    assert [shows == theirs.NOT_KNOWN for shows in theirs.FIGURES.values()] == [True, False, True, True, True]


def test_a_sensor_off_the_centre_is_carried_round_by_the_body():
    n, place_m = 40, np.array([0.09, 0.01, 0.02])
    yaw = np.linspace(0.0, 3.0, n)
    vectors = {
        "position_world_m": np.ones((n, 3)), "q_world_body": rotations.from_yaw(yaw),
        "rate_body_rad_s": np.zeros((n, 3)), "rotor_speed_rad_s": np.full((n, 4), 900.0),
    }  # fmt: skip
    log = flight_log.from_vectors(np.arange(n) * 0.005, vectors)
    seen = identified.seen_by_sensor(log, place_m)
    away = seen.vector("position_world_m") - 1.0
    assert len(seen) == n // 2
    assert np.linalg.norm(away, axis=1) == pytest.approx(np.linalg.norm(place_m))
    assert np.arctan2(away[:, 1], away[:, 0]) - yaw[::2] == pytest.approx(np.arctan2(0.01, 0.09), abs=1e-9)


def test_a_fit_begins_with_the_drawing_and_nothing_of_the_answer():
    begun, truth = identified.begun_with(1), theirs.drone()
    for row in theirs.table():
        assert begun.value(row.name) != truth.value(row.name)
        assert row.cad in (None, begun.value(row.name))


def test_ctrl_c_keeps_the_parts_that_are_done(tmp_path, monkeypatch):
    def stopped(folder, progress):
        (folder / "half.svg").touch()
        raise KeyboardInterrupt

    monkeypatch.setattr(parts, "PARTS", {"a": quick("a"), "b": parts.Part("b", "simulated", stopped), "c": quick("c")})
    assert parts.run(tmp_path, ["a", "b", "c"], silent) == ({"a": {"of": "a"}}, {})
    assert [path.name for path in tmp_path.iterdir()] == ["a"]
    with pytest.raises(KeyboardInterrupt):
        parts.run(tmp_path, ["b", "c"], silent)


def test_a_part_that_fails_leaves_the_others_and_says_why(tmp_path, monkeypatch):
    def refused(folder, progress):
        (folder / "half.svg").touch()
        raise InfeasibleError("no way through")

    bad = parts.Part("b", "simulated", refused)
    monkeypatch.setattr(parts, "PARTS", {"a": quick("a"), "b": bad, "c": quick("c")})
    done, failed = parts.run(tmp_path, ["a", "b", "c"], silent)
    assert (list(done), failed) == (["a", "c"], {"b": "no way through"})
    assert sorted(path.name for path in tmp_path.iterdir()) == ["a", "c"]
    (tmp_path / "none").mkdir()
    with pytest.raises(InfeasibleError, match="no way"):
        parts.run(tmp_path / "none", ["b"], silent)


def test_the_verb_keeps_what_is_done_and_takes_it_over_the_next_time(tmp_path, monkeypatch, capsys):
    def refused(folder, progress):
        raise InfeasibleError("no way through")

    row = {"course": "c", "controller": "d", "theirs_cm": 1.0, "ours_cm": 2.0, "runs_cm": [2.0]}
    work = {"vehicle": lambda folder, progress: [], "ladder": lambda folder, progress: [row], "path": refused}
    every = {name: parts.Part(name, "simulated", done) for name, done in work.items()}
    monkeypatch.setattr(parts, "PARTS", every)
    for name in every:
        monkeypatch.setattr(page, f"_{name}", lambda facts, folder: json.dumps(facts))
    out = tmp_path / "p"
    first = ["--only", "ladder", "--only", "path", "--json", "--out", str(out)]
    assert paper.command.main(first, standalone_mode=False) == 1
    assert "path failed: no way through" in capsys.readouterr().err
    assert json.loads((out / parts.FACTS).read_text())["failed"] == {"path": "no way through"}
    again = ["--only", "vehicle", "--overwrite", "--json", "--out", str(out)]
    assert paper.command.main(again, standalone_mode=False) == 0
    document = json.loads((out / parts.FACTS).read_text())
    assert list(document["made"]) == ["vehicle", "ladder"]
    assert (document["ladder"], document["taken_over"]) == ([row], ["ladder"])
    assert (out / parts.PAGE).read_text().count("by an earlier run") == 1
    assert (out / "ladder").is_dir()


def test_a_foreign_folder_is_refused_before_any_work(tmp_path):
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine" / "thesis.txt").write_text("precious")
    ended = answer("paper", "--out", tmp_path / "mine", "--overwrite")
    assert ended.returncode == 2
    assert "not a result of this command" in ended.stderr
    assert "figures" in run("paper", "--out", tmp_path / "new", "--only", "figures", code=2)


@pytest.mark.slow
def test_their_vehicle_is_found_again_from_a_trial():
    fit = sysid.identify(identified.flown(1), identified.begun_with(1))
    for row in theirs.table():
        estimate = fit.estimate(row.name)
        assert abs(estimate.value - row.value) < 5.0 * estimate.std_robust
    for axis in ("xx", "yy", "zz"):
        name = f"inertia_{axis}_kg_m2"
        assert fit.estimate(name).value == pytest.approx(theirs.drone().value(name), rel=0.01)


@pytest.mark.slow
def test_the_whole_writes_a_page_that_says_of_each_number_whose_it_is(tmp_path):
    document = json.loads(run("paper", "--out", tmp_path / "p", "--json"))
    page = (tmp_path / "p" / parts.PAGE).read_text()
    assert json.loads((tmp_path / "p" / parts.FACTS).read_text()).items() >= document.items()
    assert document["made"] == {name: part.made for name, part in parts.PARTS.items()}
    assert "src='data:" in page
    assert not re.search(r"(src|href)=['\"]http", page)
    for row in document["vehicle"]:
        assert row["theirs"] == PRINTED[row["name"]][0]
        assert abs(row["ours"] - row["theirs"]) < 5.0 * row["standard_error_of_one_trial"]
    known = {row["theirs_cm"] for row in document["ladder"]} - {None}
    assert known == {*theirs.LEVEL_CM, *theirs.VERTICAL_CM, theirs.GENERAL_CM}
    assert document["path"]["passes_gate"]
    assert document["path"]["tracking_cm"] < 6.0
    refused = answer("paper", "--out", tmp_path / "p", "--only", "ladder")
    assert refused.returncode == 2
    assert "--overwrite" in refused.stderr
