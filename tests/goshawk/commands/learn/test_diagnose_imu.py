"""`goshawk diagnose` of a flight without a pose, as a user runs it."""

import json
import sys
from pathlib import Path

import numpy as np
import pytest

import vehicle
from flight import flight_log
from tests.goshawk.running import run

BENCHMARKS = Path(__file__).parents[4] / "benchmarks"


@pytest.fixture(scope="module")
def folder(tmp_path_factory) -> Path:
    """A flight of a vehicle whose centre of mass is 3 mm before the hubs' middle, and the vehicle file."""
    sys.path.insert(0, str(BENCHMARKS))
    import without_pose_flights as flights

    sys.path.remove(str(BENCHMARKS))
    folder = tmp_path_factory.mktemp("imu")
    rng, truth = np.random.default_rng(3), flights.body().with_effect("centre_of_mass", x_m=0.003, y_m=0.0)
    recorder = flights.Recorder(rate_hz=250.0)
    (log,) = flights.flown(truth, flights.drawn(1, rng), rng, duration_s=10.0, recorder=recorder)
    flight_log.save(folder / "stick.parquet", log)
    vehicle.save(folder / "vehicle.toml", flights.start())
    return folder


def test_the_fault_is_named_kept_written_and_the_next_command_adds_it(folder, tmp_path):
    asked = ("diagnose", folder / "stick.parquet", "--vehicle", folder / "vehicle.toml")
    said = run(*asked)
    assert said.startswith("missing was centre_of_mass (confidence ")
    assert len(said.splitlines()) <= 24
    assert f"next: goshawk vehicle effect add {folder / 'vehicle.toml'} centre_of_mass" in said
    out = tmp_path / "better.toml"
    document = json.loads(run(*asked, "--json", "--out", out))  # what the first call kept
    assert document["schema"] == "goshawk-diagnosis-imu"
    assert document["next"] == []
    assert vehicle.load(out).value("centre_of_mass.x_m") == pytest.approx(0.003, abs=3e-4)
    assert "unobservable: it depends on air speed" in run(*asked, "--details")


def test_what_needs_a_pose_is_refused(folder, tmp_path):
    asked = ("diagnose", folder / "stick.parquet", "--vehicle", folder / "vehicle.toml")
    assert "needs a pose" in run(*asked, "--report", tmp_path / "d.html", code=2)
    assert not (tmp_path / "d.html").exists()
    flight_log.save(tmp_path / "other.parquet", flight_log.load(folder / "stick.parquet").slice(0.0, 8.0))
    assert "leave --held-out out" in run(*asked, "--held-out", tmp_path / "other.parquet", code=2)
