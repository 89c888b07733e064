"""`goshawk preflight`: from a planned file to go or no-go, and what it refuses."""

import json
import os
import shutil
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

import mapping
import preflight
import vehicle
from flight import FormatError, Waypoints, file_format, trajectory
from flight.mission import Laps, LegSpeed, Mission
from goshawk.commands.plan import preflown
from goshawk.commands.preflight import inputs, outcome, screen
from goshawk.commands.preflight import preflight as verb
from goshawk.commands.preflight.outcome import Outcome
from goshawk.terminal import outputs
from mapping import map_folder
from preflight import Options, slower
from preflight.result import SCHEMA, SCHEMA_VERSION
from tests.goshawk.running import answer

LINES = 24


@pytest.fixture(scope="module")
def folder(pillar_map: Path, tmp_path_factory) -> Path:
    """A project folder with a map, two vehicles, and a plan for one of them."""
    folder = tmp_path_factory.mktemp("preflight")
    os.symlink(pillar_map, folder / "map")
    vehicle.save(folder / "vehicle.toml", vehicle.example())
    vehicle.save(folder / "other.toml", vehicle.example().with_value("mass_kg", 0.8))
    (folder / "waypoints.csv").write_text("x,y,z\n0.8,0.8,1.0\n1.0,3.0,1.3\n3.0,3.2,1.2\n")
    ended = answer("plan", folder / "waypoints.csv", *world(folder), "--speed", 3, "--out", folder / "plan.json", "-q")
    assert ended.returncode == 0, ended.stderr
    return folder


def world(folder: Path, drone: str = "vehicle.toml") -> tuple[object, ...]:
    return ("--map", folder / "map", "--vehicle", folder / drone)


def flown_ahead(folder: Path, *options: object):
    return answer("preflight", folder / "plan.json", *world(folder), "-q", *options)


def test_a_slow_plan_in_a_wide_room_is_a_go_on_one_screen(folder, tmp_path):
    ended = flown_ahead(folder, "--flights", 60, "--risk", 0.05, "--out", tmp_path / "found.json")
    assert ended.returncode == 0, ended.stdout
    assert len(ended.stdout.splitlines()) <= LINES
    assert "GO: the risk is at most" in ended.stdout
    assert "0 of 60: at most 4.9e-02" in ended.stdout
    found = json.loads((tmp_path / "found.json").read_text())
    assert found["format"] == "goshawk-preflight"
    assert found["go"] is True
    assert len(found["tube"]["q90_m"]) == 100


def test_a_storm_of_gusts_is_a_no_go_that_names_them(folder):
    ended = flown_ahead(folder, "--flights", 80, "--risk", 0.1, "--gust-std", 8, "--json")
    found = json.loads(ended.stdout)
    assert ended.returncode == 1
    assert found["risk"]["count"] > 0
    assert found["risk"]["upper95"] > found["risk"]["estimate"] > 0.0
    assert found["dominating"]["factor"] == "gusts"
    assert next(iter(found["loss_shares"])) == "gusts"


def test_a_rare_loss_is_looked_for_by_levels_and_the_screen_says_so(folder):
    ended = flown_ahead(folder, "--rare", "--flights", 200, "--risk", 0.01)
    assert ended.returncode == 0, ended.stdout
    assert len(ended.stdout.splitlines()) <= LINES
    assert "by 2 levels" in " ".join(ended.stdout.split()) or "by 3 levels" in " ".join(ended.stdout.split())


def test_a_share_by_levels_is_one_of_what_loses_flights_and_else_of_the_variance():
    result = SimpleNamespace(dominating=("wind", 0.76), removed=None, rare=None, loss_shares={"wind": 0.76})
    assert screen._remedy(result)[0] == "wind: 76 % of the variance"
    result.rare = object()
    assert screen._remedy(result)[0] == "wind: 76 % of what loses flights"


def test_the_same_seed_prints_the_same_and_another_does_not(folder):
    one, same, other = (flown_ahead(folder, "--flights", 20, "--seed", s, "--json").stdout for s in (1, 1, 2))
    assert one == same
    assert one != other


def test_few_flights_do_not_show_a_small_risk_and_the_screen_says_how_many_would(folder):
    ended = flown_ahead(folder, "--flights", 20)
    assert ended.returncode == 1
    assert "fly at least 2995" in " ".join(ended.stdout.split())


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (("--risk", 0), "no number of flights"),
        (("--wind", 40), "cannot hover in a wind of 40 m/s"),
        (("--wind", "1,2"), "3 finite numbers"),
        (("--wind", "-3"), "at least 0"),
        (("--flights", 0), "at least one"),
        (("--flights", 50, "--rare"), "from 200 to"),
        (("--rate", 250), "a control rate of 250 Hz: it must be 400 to 1000"),
    ],
)
def test_what_cannot_be_asked_is_refused_in_a_sentence(folder, options, said):
    ended = flown_ahead(folder, *options)
    assert ended.returncode == 2, ended.stdout
    assert said in ended.stderr


def test_another_vehicles_plan_and_a_map_edited_since_are_refused(folder, tmp_path):
    other = answer("preflight", folder / "plan.json", *world(folder, "other.toml"), "--flights", 5)
    assert other.returncode == 2
    assert "was checked for vehicle" in other.stderr
    shutil.copytree((folder / "map").resolve(), tmp_path / "map")
    assert answer("map", "edit", "add", tmp_path / "map", "--box", "4.5,0.6,0.5,0.2,0.2,0.2").returncode == 0
    edited = answer("preflight", folder / "plan.json", "--map", tmp_path / "map", "--vehicle", folder / "vehicle.toml")
    assert edited.returncode == 2
    assert "was checked in map" in edited.stderr


def test_no_map_and_an_unchecked_plan_are_refused(folder, tmp_path):
    none = answer("preflight", folder / "plan.json", "--map", tmp_path, "--vehicle", folder / "vehicle.toml")
    assert none.returncode in (1, 2)
    assert "goshawk: " in none.stderr
    item = trajectory.load(folder / "plan.json")
    with outputs.file(tmp_path / "raw.json", overwrite=False) as temporary:
        trajectory.save(temporary, replace(item, check={}))
    raw = answer("preflight", tmp_path / "raw.json", *world(folder))
    assert raw.returncode == 2
    assert "final gate" in raw.stderr


def test_a_maps_scale_is_as_unsure_as_its_sources_disagree():
    first = {"source": "length", "ratio": 1.0, "std": 0.01}
    assert inputs.scale_std([first]) == pytest.approx(0.01)
    assert inputs.scale_std([first, {"ratio": 1.05, "std": 0.03}]) == pytest.approx(np.hypot(0.01, 0.04))
    assert inputs.scale_std([first, {"ratio": 1.05, "std": 0.2}]) == pytest.approx(0.01)
    assert inputs.scale_std(None) == inputs.scale_std([]) == 0.0
    for broken in (3, [3], [{"std": "wide"}]):
        with pytest.raises(FormatError, match="scale_witnesses"):
            inputs.scale_std(broken)


def test_voxels_add_to_the_error_of_the_surfaces(folder):
    found = inputs.of_map(mapping.open_map(folder / "map"), preflight.Uncertainty())
    assert found.map_error_std_m > preflight.Uncertainty().map_error_std_m


def stating(folder: Path, tmp_path: Path, shape_std_m: object) -> Path:
    """The map with a report that states this of its images' positions."""
    shutil.copytree((folder / "map").resolve(), tmp_path / "map")
    body = {**map_folder.read_report(tmp_path / "map"), "shape_std_m": shape_std_m}
    file_format.write_json(tmp_path / "map" / "report.json", format=map_folder.REPORT_FORMAT, version=1, body=body)
    return tmp_path / "map"


def test_the_pose_errs_by_what_the_map_states_near_the_path(folder, tmp_path):
    path = trajectory.load(folder / "plan.json").trajectory
    places = np.tile(np.eye(4), (4, 1, 1))
    places[:, :3, 3] = [*path.position([0.0, 0.5 * path.duration_s]), (50.0, 0.0, 0.0), path.position([0.0])[0]]
    images = mapping.open_map(stating(folder, tmp_path, [0.06, 0.06, 0.6, None]))
    area = replace(images, images=("a", "b", "c", "d"), T_world_body=places)
    per_axis_m = 0.06 / np.sqrt(3.0)
    assert inputs.position_std_m(area, path) == pytest.approx(per_axis_m)
    found = inputs.of_map(area, preflight.Uncertainty(), path)
    assert found.localization_std_m == pytest.approx(np.hypot(0.02, per_axis_m))
    assert inputs.position_std_m(area) == pytest.approx(np.sqrt((2 * 0.06**2 + 0.6**2) / 9.0))
    given = preflight.Uncertainty(localization_std_m=0.01)
    assert inputs.of_map(area, given, path).localization_std_m == 0.01
    assert inputs.position_std_m(images, path) is None  # of another number of images


def test_screen_and_page_say_where_the_error_of_the_pose_is_from(folder, tmp_path):
    of_map = stating(folder, tmp_path, [0.06] * len(mapping.open_map(folder / "map").images))
    files = ("preflight", folder / "plan.json", "--vehicle", folder / "vehicle.toml", "--flights", 5, "-q")
    told = answer(*files, "--map", of_map, "--report", tmp_path / "told.html")
    assert "2 cm of the localizer, assumed, and 3.5 cm from the map's images" in " ".join(told.stdout.split())
    assert "4.0 cm each axis</td><td>the map along the path (3.5 cm)" in (tmp_path / "told.html").read_text()
    given = answer(*files, "--map", of_map, "--localization", 0.01, "--report", tmp_path / "given.html")
    assert "localizer" not in given.stdout
    assert "1.0 cm each axis</td><td>asked" in (tmp_path / "given.html").read_text()
    answer(*files, "--map", folder / "map", "--report", tmp_path / "assumed.html")
    assert "2.0 cm each axis</td><td>assumed; the map states none" in (tmp_path / "assumed.html").read_text()


def test_standard_deviations_that_are_no_numbers_are_refused(folder, tmp_path):
    with pytest.raises(FormatError, match="shape_std_m"):
        inputs.position_std_m(mapping.open_map(stating(folder, tmp_path, ["wide"])))


def test_ctrl_c_shows_what_was_flown(folder, monkeypatch):
    whole = preflight.fly

    def interrupted(*arguments, progress, **options):
        calls = []

        def report(stage, fraction):
            calls.append(fraction)
            if len(calls) > 1 and fraction < 1.0:
                raise KeyboardInterrupt

        return whole(*arguments, progress=report, **options)

    monkeypatch.setattr(verb.preflight, "fly", interrupted)
    ended = flown_ahead(folder, "--flights", 1000, "--json")
    assert ended.returncode == 130
    assert 0 < json.loads(ended.stdout)["flights"] < 1000
    assert "stopped after" in ended.stderr


def test_ctrl_c_between_levels_says_which_were_flown(folder, monkeypatch):
    whole = preflight.fly

    def interrupted(*arguments, progress, **options):
        def report(stage, fraction):
            if stage == "level 2":
                raise KeyboardInterrupt

        return whole(*arguments, progress=report, **options)

    monkeypatch.setattr(verb.preflight, "fly", interrupted)
    ended = flown_ahead(folder, "--rare", "--flights", 200, "--risk", 1e-4, "--json")
    assert ended.returncode == 130
    assert json.loads(ended.stdout)["risk"]["reached"] is False
    assert "stopped after level 1: 200 flights" in ended.stderr
    ended = flown_ahead(folder, "--rare", "--flights", 200, "--risk", 1e-4)
    assert "run it to the end" in ended.stdout
    assert "NO-GO" in ended.stdout
    assert "lost" in ended.stdout


def test_ctrl_c_while_the_worst_are_flown_again_keeps_the_result(folder, tmp_path, monkeypatch):
    def interrupted(*arguments, **options):
        raise KeyboardInterrupt

    monkeypatch.setattr(verb.preflight, "replay", interrupted)
    ended = flown_ahead(folder, "--flights", 10, "--out", tmp_path / "kept.json", "--report", tmp_path / "page.html")
    assert ended.returncode == 130
    assert json.loads((tmp_path / "kept.json").read_text())["flights"] == 10
    assert not (tmp_path / "page.html").exists()
    assert "before the worst were flown again" in ended.stderr


def test_plan_preflight_plan_is_a_go_within_three_rounds(folder, tmp_path):
    """From a margin that the flights exceed; the last plan with luck that no round before has met."""
    (tmp_path / "way.csv").write_text("x,y,z\n0.8,0.8,1.0\n3.0,2.0,1.3\n5.2,0.8,1.0\n")
    flown = ("--flights", 60, "--risk", 0.05, "--gust-std", 1, "-q")
    codes, asked_m = [], []
    for turn in range(3):
        plan, found = tmp_path / f"plan{turn}.json", tmp_path / f"found{turn}.json"
        before = ("--preflown", tmp_path / f"found{turn - 1}.json") if turn else ("--margin", 0.03)
        planned = answer("plan", tmp_path / "way.csv", *world(folder), *before, "--out", plan, "-q")
        assert planned.returncode == 0, planned.stderr
        ended = answer("preflight", plan, *world(folder), *flown, "--seed", turn, "--out", found)
        codes.append(ended.returncode)
        again = json.loads(found.read_text())["plan_again"]
        if ended.returncode == 0:
            break
        assert "--preflown" in ended.stdout
        assert "not tried yet" in " ".join(ended.stdout.split())
        asked_m.append(again["margin_m"])
    assert codes[0] == 1
    assert codes[-1] == 0
    assert asked_m == sorted(asked_m)


def test_a_go_asks_for_no_more_room(folder, tmp_path):
    assert flown_ahead(folder, "--flights", 60, "--risk", 0.05, "--out", tmp_path / "go.json").returncode == 0
    ended = answer("plan", folder / "waypoints.csv", *world(folder), "--preflown", tmp_path / "go.json", "--out", "x")
    assert ended.returncode == 2
    assert "asks for no more room: the risk is at most 4.9e-02, and 0.05 is accepted" in ended.stderr
    (tmp_path / "other.json").write_text('{"format": "goshawk-trajectory", "version": 1}')
    ended = answer(
        "plan", folder / "waypoints.csv", *world(folder), "--preflown", tmp_path / "other.json", "--out", "x"
    )
    assert ended.returncode == 2


def planned_again(folder: Path, tmp_path: Path, *options: object, drone: str = "vehicle.toml", **changed: object):
    """`goshawk plan --preflown` with a result that asks for 0.12 m, changed; a value of ... is left out."""
    area, body = mapping.open_map(folder / "map"), {"plan_again": {"margin_m": 0.12}, "vehicle": "", "reason": "it is"}
    believed = vehicle.load(folder / "vehicle.toml")
    body |= {"map_hash": area.hash, "vehicle": believed.name, "vehicle_hash": vehicle.vehicle_hash(believed)} | changed
    kept = {name: value for name, value in body.items() if value is not ...}
    file_format.write_json(tmp_path / "found.json", format=SCHEMA, version=SCHEMA_VERSION, body=kept)
    asked = ("--preflown", tmp_path / "found.json", "--speed", 3, "--overwrite", "--out", tmp_path / "again.json")
    return answer("plan", folder / "waypoints.csv", *world(folder, drone), *asked, *options)


@pytest.mark.parametrize(("margin_m", "kept_m"), [(None, 0.12), (0.03, 0.12), (0.15, 0.15)])
def test_a_plan_keeps_the_larger_of_both_margins_and_says_which(folder, tmp_path, margin_m, kept_m):
    ended = planned_again(folder, tmp_path, *(() if margin_m is None else ("--margin", margin_m)))
    assert ended.returncode == 0, ended.stderr
    assert f"keeps a margin of {kept_m:.3f} m" in ended.stderr
    assert "asks for 0.120 m" in ended.stderr
    item = trajectory.load(tmp_path / "again.json")
    checked = item.check
    assert checked["required_clearance_m"] - checked["body_radius_m"] == pytest.approx(kept_m)


@pytest.mark.parametrize(
    ("changed", "said"),
    [
        ({"map_hash": "0" * 64}, "is of map 000000000000, not "),
        ({"vehicle": "another", "vehicle_hash": "0" * 64}, "is of another 000000000000, not of "),
        ({"vehicle_hash": ...}, "has no vehicle_hash"),
        ({"plan_again": {"margin_m": True}}, "the margin to plan with is True"),
        ({"plan_again": {"margin_m": -1}}, "the margin to plan with is -1"),
        ({"plan_again": {"margin_m": 0.1, "near": [{"margin_m": 0.2}]}}, "a local margin is damaged"),
        ({"plan_again": {"margin_m": 0.1, "legs": [{"speed_m_s": 1}]}}, "is a damaged result: 'from_world_m'"),
        ({"plan_again": ...}, "has no plan_again"),
        ({"plan_again": None, "reason": "only 3 % come to the end"}, "no more room: only 3 % come to the end"),
    ],
)
def test_another_map_another_vehicle_and_a_damaged_margin_are_refused(folder, tmp_path, changed, said):
    ended = planned_again(folder, tmp_path, **changed)
    assert ended.returncode == 2
    assert said in ended.stderr


def test_margins_near_parts_of_the_plan_and_speeds_of_legs_are_kept_and_recorded(folder, tmp_path):
    first = planned_again(folder, tmp_path, plan_again={"margin_m": 0.12})
    assert first.returncode == 0, first.stderr
    plain = trajectory.load(tmp_path / "again.json").trajectory
    line = plain.position(np.linspace(0.4, 0.6, 5) * plain.duration_s)
    near = {"margin_m": 0.3, "polyline_world_m": line.tolist()}
    points = trajectory.load(tmp_path / "again.json").waypoints_world_m.tolist()
    legs = [{"from_world_m": points[1], "to_world_m": points[2], "speed_m_s": 1.0, "slowed": False}]
    asked = {"margin_m": 0.12, "near": [near], "legs": legs}
    ended = planned_again(folder, tmp_path, plan_again=asked)
    assert ended.returncode == 0, ended.stderr
    assert "0.120 m, up to 0.300 m near 1 parts of the plan, at most 1.00 m/s on 1 legs" in " ".join(
        ended.stderr.split()
    )
    item = trajectory.load(tmp_path / "again.json")
    assert item.check["asked"]["local_margins"] == [near]
    assert item.check["conditions"]["leg_speed_m_s"] == [None, 1.0]
    assert answer("check", tmp_path / "again.json", *world(folder)).returncode == 0
    found = Outcome(inputs.subject(item, mapping.open_map(folder / "map"), vehicle.example(), Options(5, 0.5)), None)
    passed_s = outcome._passed_s(found.subject)
    assert item.trajectory.position(passed_s) == pytest.approx(item.waypoints_world_m, abs=0.02)
    slow = slower.Slower(1, *item.trajectory.starts_s[1:3], 1.25, 3)
    (one, two) = outcome._leg_speeds(found.subject, (slow,))
    times_s = np.linspace(*item.trajectory.starts_s[1:3], 200)
    top_m_s = np.linalg.norm(item.trajectory.position(times_s, 1), axis=1).max()
    assert (one["from_world_m"], one["slowed"]) == (points[0], True)
    assert one["speed_m_s"] == pytest.approx(top_m_s / 1.25, rel=0.01)
    assert two == legs[0]


POINTS = np.arange(12.0).reshape(4, 3)


def mission_of(*numbers: int, **more) -> Mission:
    return Mission(Waypoints(POINTS[list(numbers)], np.full(len(numbers), np.nan)), **more)


def leg(first: int, last: int, speed_m_s: float, *, slowed: bool = True) -> preflown.Leg:
    begin, end = (tuple(POINTS[number].tolist()) for number in (first, last))
    return preflown.Leg(begin, end, speed_m_s, slowed)


def test_legs_are_found_by_where_they_begin_and_end_and_one_that_is_not_slows_down_all():
    again = preflown.Again(0.1, legs=(leg(0, 1, 2.0), leg(1, 2, 1.0)))
    assert again.of(mission_of(0, 1, 2)).leg_speeds == (LegSpeed(0, 1, 2.0), LegSpeed(1, 2, 1.0))
    assert again.of(mission_of(3, 0, 1, 2)).leg_speeds == (LegSpeed(1, 2, 2.0), LegSpeed(2, 3, 1.0))
    assert again.of(mission_of(2, 1, 0)).leg_speeds == (LegSpeed(0, 2, 1.0),)
    round_ = mission_of(0, 1, 2, laps=Laps(2))
    assert again.of(round_).leg_speeds == (LegSpeed(0, 1, 2.0), LegSpeed(1, 2, 1.0))
    assert preflown.Again(0.1, legs=(leg(2, 0, 1.5),)).of(round_).leg_speeds == (LegSpeed(0, 2, 1.5),)
    assert preflown.Again(0.1).of(round_) is round_


def test_a_speed_that_was_only_kept_slows_down_no_other_leg():
    kept = preflown.Again(0.1, legs=(leg(0, 1, 0.4, slowed=False),))
    assert kept.of(mission_of(0, 1, 2)).leg_speeds == (LegSpeed(0, 1, 0.4),)
    assert kept.of(mission_of(3, 1, 2)).leg_speeds == ()


def test_a_vehicle_of_the_same_name_and_other_values_is_another(folder, tmp_path):
    assert vehicle.load(folder / "other.toml").name == vehicle.load(folder / "vehicle.toml").name
    ended = planned_again(folder, tmp_path, drone="other.toml")
    assert ended.returncode == 2
    assert "preflight the plan for it, or say --margin" in ended.stderr


def test_the_screen_names_a_segment_that_is_touched_before_one_where_flights_overturn_or_are_given_up():
    given_up = {"segment": 2, "touching": False, "extra_m": 0.1}
    touched = {"segment": 5, "touching": True, "extra_m": 0.07}
    overturned = {"segment": 3, "factor": 1.2}
    assert screen._short([given_up, touched], [overturned]) == "segment 5 is 7 cm short"
    assert screen._short([given_up], [overturned]) == "flights overturn in segment 3 unless it takes 1.2 times as long"
    assert screen._short([given_up], []) == "flights are given up for their tracking error in segment 2"
