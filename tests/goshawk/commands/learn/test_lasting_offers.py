"""`goshawk compare` offers what lasted in the measured disturbance; one command previews, writes and takes it back."""

import json
import shlex
from pathlib import Path

import pytest

import vehicle
from firmware_bridge import Sensors, closed_loop
from firmware_bridge.controller import parameters_of
from flight import FlightLog, flight_log
from goshawk.commands.learn import lasting_offers
from tests.goshawk.running import run
from vehicle import manoeuvres, simulate

FILE = vehicle.example("rigter2019")


@pytest.fixture(scope="module")
def heavy() -> FlightLog:
    """Flown by a vehicle 5 % heavier than the file, as `goshawk fly` writes it."""
    path = manoeuvres.scaled(manoeuvres.make("vertical"), 0.5)
    truth = FILE.with_value("mass_kg", 1.05 * FILE.mass_kg)
    start = simulate.State(path.position([0.0])[0] * [1.0, 1.0, 0.0])
    plant = simulate.Plant(truth, start, ground_m=0.0)
    log = closed_loop.fly(plant, parameters_of(FILE), path, sensors=Sensors.typical(), imu=True).log
    return FlightLog(log.columns, {"name": "lap", "vehicle_hash": vehicle.vehicle_hash(FILE)[:16]})


@pytest.fixture
def folder(heavy, tmp_path) -> Path:
    flight_log.save(tmp_path / "lap.parquet", heavy)
    vehicle.save(tmp_path / "mine.toml", FILE)
    return tmp_path


def test_compare_offers_a_command_that_previews_writes_and_is_undone(folder, monkeypatch):
    monkeypatch.chdir(folder)
    facts = json.loads(run("compare", "lap.parquet", "--vehicle", "mine.toml", "--json"))
    assert "weighs 4.9% more" in facts["lasting"][0] or "weighs 5.0% more" in facts["lasting"][0]
    assert facts["measured_disturbance_rms"]["F_z"] == pytest.approx(0.05 * FILE.mass_kg * 9.8, rel=0.1)
    said = run("compare", "lap.parquet", "--vehicle", "mine.toml")
    assert "measured disturbance: this vehicle weighs" in said
    before = Path("mine.toml").read_bytes()
    words = shlex.split(facts["next"][0].partition("goshawk ")[2])
    assert "mass_kg" in run(*words)
    assert Path("mine.toml").read_bytes() == before
    run(*(word for word in words if word != "--dry-run"))
    assert vehicle.load(Path("mine.toml")).mass_kg == pytest.approx(1.05 * FILE.mass_kg, rel=0.003)
    run("vehicle", "undo", "mine.toml", "--yes")
    assert Path("mine.toml").read_bytes() == before


def test_a_change_is_not_offered_twice(heavy):
    changed = FILE.with_value("mass_kg", 1.05 * FILE.mass_kg)
    said, commands = lasting_offers.offers([heavy], {Path("mine.toml"): changed})
    assert commands == []
    assert "flew with another model" in said[0]
    said, commands = lasting_offers.offers([heavy], {Path("new.toml"): changed, Path("old.toml"): FILE})
    assert all("old.toml" in command for command in commands)
    assert len(commands) == 2


def test_logs_without_an_observer_are_offered_nothing(heavy):
    columns = {n: v for n, v in heavy.columns.items() if not n.startswith(("disturbance", "observer"))}
    assert lasting_offers.offers([FlightLog(columns, heavy.metadata)], {Path("mine.toml"): FILE}) == ([], [])
