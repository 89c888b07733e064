"""`goshawk preflight --like`: gaps and noise as flights show them, said where they are from, and overruled by hand."""

import json
import os
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

import vehicle
from firmware_bridge import Sensors, closed_loop
from firmware_bridge.controller import State, parameters_of
from flight import FlightLog, flight_log
from goshawk.commands.preflight import like
from goshawk.commands.preflight.like import Like
from sysid.estimator.validation.steady import Known
from tests.goshawk.running import answer
from vehicle import manoeuvres, simulate

RATE_HZ, SECONDS, GAP_S, GAPS = 100, 50.0, 0.2, 10


@pytest.fixture(scope="module")
def folder(pillar_map: Path, tmp_path_factory) -> Path:
    """A plan for a vehicle in a map, and a flight of which a fifth of a second is missing every five."""
    folder = tmp_path_factory.mktemp("like")
    os.symlink(pillar_map, folder / "map")
    vehicle.save(folder / "vehicle.toml", vehicle.example())
    (folder / "waypoints.csv").write_text("x,y,z\n0.8,0.8,1.0\n1.0,3.0,1.3\n3.0,3.2,1.2\n")
    world = ("--map", folder / "map", "--vehicle", folder / "vehicle.toml")
    ended = answer("plan", folder / "waypoints.csv", *world, "--speed", 3, "--out", folder / "plan.json", "-q")
    assert ended.returncode == 0, ended.stderr
    flight_log.save(folder / "gaps.parquet", flown())
    return folder


def flown(*, position_std_m: float = 0.005) -> FlightLog:
    rng, time_s = np.random.default_rng(0), np.arange(0.0, SECONDS, 1.0 / RATE_HZ)
    curve = np.stack([np.sin(time_s), np.cos(time_s), 1.0 + 0.0 * time_s], axis=1)
    position = curve + rng.normal(0.0, position_std_m, curve.shape)
    position[(time_s % (SECONDS / GAPS) > 2.0 - 1e-6) & (time_s % (SECONDS / GAPS) < 2.0 + GAP_S - 1e-6)] = np.nan
    rate = rng.normal(0.0, 0.03, curve.shape)
    return flight_log.from_vectors(time_s, {"position_world_m": position, "rate_body_rad_s": rate})


def flown_ahead(folder: Path, *options: object):
    world = ("--map", folder / "map", "--vehicle", folder / "vehicle.toml")
    return answer("preflight", folder / "plan.json", *world, "--flights", 20, "--risk", 0.3, *options, "-q")


def test_a_flight_gives_gaps_and_noise_within_a_fifth(folder):
    found = Like.of([folder / "gaps.parquet"])
    assert found.drop_outs_per_s == pytest.approx(GAPS / SECONDS, rel=0.2)
    assert found.drop_out_s == pytest.approx(GAP_S, rel=0.2)
    assert found.sensors.position_std_m == pytest.approx(0.005, rel=0.2)
    assert found.sensors.rate_std_rad_s == pytest.approx(0.03, rel=0.2)
    assert found.sensors.attitude_std_rad == Like().sensors.attitude_std_rad
    two = Like.of([folder / "gaps.parquet"] * 2)
    assert two.said[0].startswith("from 2 flights: 20 gaps")
    assert all(len(sentence.split()) <= 30 for sentence in found.said + two.said)


@pytest.fixture(scope="module")
def blown(folder) -> FlightLog:
    """A flight of the example in 3 m/s of wind and gusts of 1 m/s, whose observer measured the force."""
    drone, path = vehicle.example(), manoeuvres.scaled(manoeuvres.make("oblique"), 0.5)
    start = simulate.State(path.position([0.0])[0] * [1.0, 1.0, 0.0])
    plant = simulate.Plant(
        drone, start, wind=simulate.Wind((3.0, 0.0, 0.0), 1.0), ground_m=0.0, rng=np.random.default_rng(1)
    )
    log = closed_loop.fly(plant, parameters_of(drone), path, sensors=Sensors.typical(), imu=True).log
    flight_log.save(folder / "blown.parquet", log)
    return log


def test_an_observer_gives_wind_and_gusts_unless_they_are_asked_for(folder, blown):
    models = {folder / "vehicle.toml": vehicle.example()}
    found = Like.of([folder / "blown.parquet"], models=models)
    assert found.wind_m_s == pytest.approx(3.0, rel=0.25)
    assert found.gust_std_m_s == pytest.approx(1.0, rel=0.35)
    assert found.said[-1].startswith("from blown.parquet: wind of ")
    assert all(len(sentence.split()) <= 30 for sentence in found.said)
    assert not any("no wind" in sentence for sentence in found.said)
    asked = Like.of([folder / "blown.parquet"], models=models, air=["gust_std_m_s"])
    assert (asked.wind_m_s, asked.gust_std_m_s) == (0.0, found.gust_std_m_s)
    assert "wind_m_s" not in asked.sources


def test_a_wind_that_gusts_make_uncertain_is_flown_with_its_error(monkeypatch):
    def told(size_m_s, std_m_s):
        seen = SimpleNamespace(wind_m_s=(Known(size_m_s, std_m_s), Known(0.0, std_m_s)), gust_m_s=1.2)
        monkeypatch.setattr(like, "_lasted", lambda log, models: seen)
        return like._Blown.of([cast("Any", None)], {}, like.AIR).told

    assert told(3.0, 0.55)["wind_m_s"] == 3.0
    assert told(3.0, 1.5)["wind_spread_ratio"] == pytest.approx(0.5)
    assert "wind_m_s" not in told(0.6, 0.7)


def test_a_flight_of_another_model_tells_no_wind(folder, blown):
    flight_log.save(folder / "foreign.parquet", FlightLog(blown.columns, {"vehicle_hash": "ab12"}))
    found = Like.of([folder / "foreign.parquet"], models={folder / "vehicle.toml": vehicle.example()})
    assert found.wind_m_s == found.gust_std_m_s == 0.0
    assert found.said[0].endswith("no wind, give --wind; flown with another model")


def test_a_flight_of_this_model_is_taken_and_one_that_names_none_only_with_a_word(folder, blown):
    models = {folder / "vehicle.toml": vehicle.example()}
    own = {"vehicle_hash": vehicle.vehicle_hash(vehicle.example())}
    for metadata, granted in ((own, False), ({}, True)):
        flight_log.save(folder / "named.parquet", FlightLog(blown.columns, metadata))
        found = Like.of([folder / "named.parquet"], models=models)
        assert found.wind_m_s > 2.0
        assert ("the model is the one flown" in found.said[-1]) is granted


def test_the_flights_wind_is_flown_and_one_given_by_hand_wins(folder, blown, tmp_path):
    seen = flown_ahead(folder, "--like", folder / "blown.parquet", "--json")
    assert seen.returncode in (0, 1), seen.stderr
    assert any("wind of" in sentence for sentence in json.loads(seen.stdout)["assumed"])
    calm = json.loads(
        flown_ahead(folder, "--like", folder / "blown.parquet", "--wind", 0, "--gust-std", 0, "--json").stdout
    )
    assert json.loads(seen.stdout)["error_m"]["median"] > 1.1 * calm["error_m"]["median"]
    assert not any("wind" in sentence for sentence in calm["assumed"])


def test_screen_file_and_page_name_the_flight(folder, tmp_path):
    asked = ("--like", folder / "gaps.parquet", "--report", tmp_path / "page.html", "--out", tmp_path / "found.json")
    ended = flown_ahead(folder, *asked)
    assert ended.returncode in (0, 1), ended.stderr
    assert "gaps.parquet: 10 gaps of the pose in 50 s (0.21 a second of 0.2 s)" in " ".join(ended.stdout.split())
    assert "no wind, give --wind" in " ".join(ended.stdout.split())
    assert "(attitude assumed)" in " ".join(ended.stdout.split())
    page = (tmp_path / "page.html").read_text()
    row = page[page.index("gaps of the pose</td>") :].partition("</tr>")[0]
    assert "gaps.parquet" in row
    assert "1.7°/s</td><td>gaps.parquet" in page
    assert any("10 gaps" in sentence for sentence in json.loads((tmp_path / "found.json").read_text())["assumed"])


def test_the_flights_noise_is_flown(folder):
    flight_log.save(folder / "noisy.parquet", flown(position_std_m=0.05))
    like = flown_ahead(folder, "--like", folder / "noisy.parquet", "--drop-outs", 0, "--json").stdout
    without = flown_ahead(folder, "--json").stdout
    assert json.loads(like)["error_m"]["median"] > json.loads(without)["error_m"]["median"]


def test_gaps_given_by_hand_win(folder, tmp_path):
    ended = flown_ahead(folder, "--like", folder / "gaps.parquet", "--drop-outs", 0, "--report", tmp_path / "page.html")
    assert "noise up to" in " ".join(ended.stdout.split())
    assert "gaps of the pose</td><td>none</td><td>asked" in (tmp_path / "page.html").read_text()
    both = Like.of([folder / "gaps.parquet"], 1.0, 0.5)
    assert not {"drop_outs_per_s", "drop_out_s"} & both.sources.keys()
    assert not any("gaps of the pose" in sentence for sentence in both.said)


def test_a_flight_that_tells_nothing_or_is_missing_is_refused(folder, tmp_path):
    still = flight_log.from_vectors(np.arange(500) / 100.0, {"position_world_m": np.zeros((500, 3))})
    flight_log.save(tmp_path / "still.parquet", still)
    for name, said in (("still.parquet", "leave out --like"), ("none.parquet", "none.parquet")):
        ended = flown_ahead(folder, "--like", tmp_path / name)
        assert ended.returncode == 2
        assert said in ended.stderr


def test_of_an_on_board_log_the_flight_alone_counts(tmp_path):
    log = flown()
    state = np.where((log.time_s > 10.0) & (log.time_s < 40.0), State.HOLD, State.DISARMED)
    flight_log.save(tmp_path / "onboard.parquet", FlightLog({**log.columns, "mission_state": state}, {}))
    assert "6 gaps of the pose in 30 s" in Like.of([tmp_path / "onboard.parquet"]).said[0]


def test_a_batch_flies_like_the_flight_too(folder, tmp_path):
    (tmp_path / "plans").mkdir()
    os.symlink(folder / "plan.json", tmp_path / "plans" / "plan.json")
    world = ("--map", folder / "map", "--vehicle", folder / "vehicle.toml", "--flights", 20, "--risk", 0.3)
    like = ("--like", folder / "gaps.parquet")
    ended = answer("preflight", "batch", tmp_path / "plans", *world, *like, "--out", tmp_path / "out", "-q")
    assert ended.returncode in (0, 1), ended.stderr
    (written,) = (tmp_path / "out" / "preflights").glob("*.json")
    alone = json.loads(flown_ahead(folder, *like, "--json").stdout)
    found = json.loads(written.read_text())
    assert (found["assumed"], found["risk"]) == (alone["assumed"], alone["risk"])
    assert any("10 gaps" in sentence for sentence in found["assumed"])
