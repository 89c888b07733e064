"""`goshawk next-flight` as a stranger uses it: a table and waypoints, the same as JSON, a second run, wrong input."""

import json
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

import vehicle
from flight import flight_log, project
from goshawk.commands.learn import next_flight
from tests.goshawk.running import run, typed
from vehicle import flights, manoeuvres

PAIR = ("--candidate", "rotor_drag_thrust", "--candidate", "rotor_drag_speed")
SPACE = ("--space", "6,6,3")
TWO = ("--manoeuvre", "oblique", "--manoeuvre", "hover")


@pytest.fixture(scope="module")
def folder(tmp_path_factory) -> Path:
    """A short flight that says little about drag, and a vehicle file without rotor drag."""
    folder, truth, rng = tmp_path_factory.mktemp("next"), vehicle.example(), np.random.default_rng(2)
    flown = flights.fly_trajectory(truth, manoeuvres.scaled(manoeuvres.make("doublets"), 0.5), rng=rng)
    flight_log.save(folder / "doublets.parquet", flights.measure(flown, rng=rng))
    vehicle.save(folder / "vehicle.toml", truth.without_effect("rotor_drag_thrust"))
    return folder


def asked(folder: Path, *more: object) -> tuple[object, ...]:
    return ("next-flight", folder / "doublets.parquet", "--vehicle", folder / "vehicle.toml", *more)


def test_it_names_the_manoeuvre_that_separates_two_candidates_and_the_next_command(folder, tmp_path):
    out = tmp_path / "waypoints.json"
    said = run(*asked(folder, *PAIR, *SPACE, *TWO, "--out", out))
    lines = said.splitlines()
    assert "next flight for rotor_drag_thrust or rotor_drag_speed" in lines[0]
    order = [name for line in lines for name in ("oblique", "hover") if line.strip().startswith(name)]
    assert order == ["oblique", "hover"]
    assert "oblique are expected to tell rotor_drag_thrust from rotor_drag_speed with log odds of" in said
    assert f"written: {out}" in said
    assert typed(lines[-1].removeprefix("next: "))[:2] == ["plan", str(out)]
    points = project.load_waypoints(out).positions_world_m
    assert len(points) > 2
    assert (np.abs(points[:, :2]) < 3.0).all()
    assert (points[:, 2] > 0.5).all()


def test_json_has_the_same_facts_and_a_second_run_writes_the_same_file(folder, tmp_path):
    out = tmp_path / "waypoints.json"
    arguments = asked(folder, *PAIR, *SPACE, *TWO, "--manoeuvre", "ceiling_climb", "--out", out, "--json")
    first = json.loads(run(*arguments))
    written = out.read_bytes()
    assert (first["schema"], first["version"]) == ("goshawk-next-flight", 2)
    assert first["candidates"] == ["rotor_drag_thrust", "rotor_drag_speed"]
    assert [p["name"] for p in first["proposals"]] == ["oblique", "hover"]
    assert (first["chosen"], first["written"]) == ("oblique", str(out))
    assert "ceiling" in first["skipped"]["ceiling_climb"]
    best = first["proposals"][0]
    assert best["expected_log_odds_per_s"] == pytest.approx(best["expected_log_odds"] / best["duration_s"])
    assert json.loads(run(*arguments, "--overwrite")) == first
    assert out.read_bytes() == written


def test_a_hovering_manoeuvre_is_ranked_but_never_written(folder, tmp_path):
    out = tmp_path / "waypoints.json"
    said = run(*asked(folder, *PAIR, *SPACE, "--manoeuvre", "hover", "--out", out), code=2)
    assert "fits into the space hovers" in said
    assert not out.exists()


def test_bad_input_is_one_sentence(folder, tmp_path):
    (tmp_path / "empty.parquet").write_bytes(b"")
    car = ("--vehicle", folder / "vehicle.toml")
    unread = ["next-flight", tmp_path / "empty.parquet", *car, *SPACE]  # refused before any log is read
    refused = {
        "none.parquet": ["next-flight", tmp_path / "none.parquet", *car, *PAIR, *SPACE],
        "empty.parquet": ["next-flight", tmp_path / "empty.parquet", *car, *PAIR, *SPACE],
        "other.toml": ["next-flight", folder / "doublets.parquet", "--vehicle", tmp_path / "other.toml", *SPACE],
        "there is no effect named 'no_such'": [*unread, "--candidate", "no_such"],
        "'weak_rotor[7]' is not among the candidates of weak_rotor": [*unread, "--candidate", "weak_rotor[7]"],
        "the model has thrust_bem already": [*unread, "--candidate", "thrust_bem"],
        "there is no manoeuvre 'looping'": asked(folder, *PAIR, *SPACE, "--manoeuvre", "looping"),
        "is not 3 finite numbers": asked(folder, *PAIR, "--space", "6,6"),
        "leaves no room": asked(folder, *PAIR, "--space", "6,0.1,3"),
        "give either --space X,Y,Z or --map MAP": asked(folder, *PAIR),
        "--corner goes with --space": asked(folder, *PAIR, "--map", folder, "--corner", "0,0,0"),
        "--radius and --margin go with --map": asked(folder, *PAIR, *SPACE, "--margin", "0.2"),
        "Missing argument": ["next-flight", *car, *SPACE],
    }
    for words, arguments in refused.items():
        said = run(*arguments, code=2)
        assert words in said
        assert said.strip().splitlines()[-1].startswith("goshawk: ")
        assert "Traceback" not in said


def test_a_space_too_small_for_any_manoeuvre_is_refused_with_the_reason(folder):
    document = run(*asked(folder, *PAIR, "--space", "6,6,3", "--manoeuvre", "ground_sweep"), code=1)
    assert "no manoeuvre can be flown in 6,6,3 m: ground_sweep: it goes down to" in document


def test_in_a_map_it_writes_a_trajectory_that_check_passes(folder, pillar_map, tmp_path):
    out, vehicle_file = tmp_path / "next.json", folder / "vehicle.toml"
    inside = asked(folder, *PAIR, "--map", pillar_map, "--manoeuvre", "oblique", "--out", out)
    said = run(*inside)
    assert "next flight in the map for rotor_drag_thrust or rotor_drag_speed" in " ".join(said.split())
    assert "m from obstacles, 0.34 m is needed. " in said
    assert f"next: goshawk upload {out}" in said
    run("check", out, "--map", pillar_map, "--vehicle", vehicle_file)
    before = out.read_bytes()
    assert "--overwrite" in run(*inside, code=2)
    assert out.read_bytes() == before


@pytest.mark.slow
def test_a_map_without_room_is_refused_with_the_space_that_it_takes(folder, pillar_map, tmp_path):
    out = tmp_path / "next.json"
    inside = asked(folder, *PAIR, "--map", pillar_map, "--margin", "3", "--manoeuvre", "oblique", "--out", out)
    said = run(*inside, code=1)
    assert "not in this map: oblique needs" in said
    assert "the largest free box is" in said
    assert not out.exists()


def test_a_law_of_thrust_in_doubt_leaves_the_simpler_one_with_the_same_hover(monkeypatch):
    """The gate of --map checks rotor speeds with this vehicle."""
    fitted = vehicle.example()
    diagnosis = SimpleNamespace(vehicle=fitted, more={"in_doubt": ["thrust_bem"]})
    monkeypatch.setattr(next_flight.kept, "newest", lambda *asked: diagnosis)
    names, believed = next_flight._kept_question((), Path("vehicle.toml"), fitted)
    assert names == ("thrust_bem",)
    assert {"thrust_bem", "thrust_quadratic"} & set(believed.effects) == {"thrust_quadratic"}
    assert vehicle.invert.hover(believed) == pytest.approx(vehicle.invert.hover(fitted), rel=1e-2)
