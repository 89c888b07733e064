"""`goshawk compare` as a user runs it: by a protocol, over gaps, with a refit."""

import importlib.util
import json
import sys
from pathlib import Path

import numpy as np
import pytest

import vehicle
from flight import FlightLog, flight_log
from tests.goshawk.running import run


@pytest.fixture(scope="module")
def folder(tmp_path_factory) -> Path:
    """Two short flights of the paper's vehicle, one of them with a gap, and its vehicle file."""
    path = Path(__file__).parents[3] / "sysid" / "flying.py"
    spec = importlib.util.spec_from_file_location("compare_test_flying", path)
    assert spec is not None
    assert spec.loader is not None
    flying = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = flying
    spec.loader.exec_module(flying)
    folder = tmp_path_factory.mktemp("compare")
    rng = np.random.default_rng(8)
    logs = flying.fly(flying.Truth(), flying.paper_flights(rng, 1, 0.1), 3, duration_s=6.0, rng=rng, rate_hz=100.0)
    flight_log.save(folder / "fast.parquet", logs[1])
    gap = {
        name: np.where((logs[2].time_s > 2.9) & (logs[2].time_s < 3.1), np.nan, values)
        for name, values in logs[2].columns.items()
        if name != "time_s"
    }
    flight_log.save(folder / "turning.parquet", FlightLog({**logs[2].columns, **gap}, logs[2].metadata))
    vehicle.save(folder / "vehicle.toml", vehicle.example("rigter2019"))
    return folder


def flights(folder: Path) -> list[Path]:
    return [folder / "fast.parquet", folder / "turning.parquet"]


def test_a_protocol_is_judged_beside_zero_and_rate_held(folder, tmp_path):
    page = tmp_path / "r.html"
    base = ("compare", *flights(folder), "--vehicle", folder / "vehicle.toml", "--protocol", "h10", "--split-gaps")
    facts = json.loads(run(*base, "--report", page, "--json"))
    found = {p["name"]: p["error_mean"]["velocity_m_s"] for p in facts["protocol"]["predictors"]}
    assert found["vehicle"] < found["vehicle, rate held"] < found["zero"]
    assert len(facts["protocol"]["flights"]) == 3  # one of them in two pieces
    assert facts["wrench"]["models"]["vehicle"]["explained"]["F_z"] > 0.8
    assert all(heading in page.read_text() for heading in ("Protocol h10", "Force and moment"))


def test_a_gap_is_refused_with_an_option_that_exists(folder):
    said = run("compare", folder / "turning.parquet", "--vehicle", folder / "vehicle.toml", code=2)
    assert "--split-gaps" in said
    assert "gaps=" not in said


def test_gravity_is_that_of_the_vehicle_file_unless_it_is_given(folder, tmp_path):
    high, low = tmp_path / "high.toml", folder / "vehicle.toml"
    vehicle.save(high, vehicle.load(low).with_gravity(9.84))
    base = ("compare", folder / "fast.parquet", "--json")

    def error(*more: object) -> float:
        (model,) = json.loads(run(*base, *more))["models"].values()
        return model["error_rms"]["velocity_m_s"][0]

    kept, given = error("--vehicle", high), error("--vehicle", low, "--gravity", "9.84")
    assert kept == given
    assert kept != error("--vehicle", low)
    assert "give --gravity" in run(*base[:2], "--vehicle", low, "--vehicle", high, code=2)
    assert "on Earth it is between" in run(*base[:2], "--vehicle", low, "--gravity", "981", code=2)


def test_models_are_refitted_to_the_training_flights(folder, tmp_path):
    wrong = vehicle.load(folder / "vehicle.toml").with_value("thrust_bem.k1_n_s2", 6e-6)
    vehicle.save(tmp_path / "wrong.toml", wrong)
    base = ("compare", folder / "fast.parquet", "--vehicle", tmp_path / "wrong.toml", "--json")
    options = ("--hold", "inertia_*", "--gusts", "white", "--split-gaps")
    before, after = (
        json.loads(run(*base, *more))["models"]["wrong"]["error_rms"]["velocity_m_s"][0]
        for more in ((), ("--train", folder / "turning.parquet", *options))
    )
    assert after < 0.5 * before


def test_a_flight_is_not_judged_by_itself(folder, tmp_path):
    fast, copy = folder / "fast.parquet", tmp_path / "copy.parquet"
    copy.write_bytes(fast.read_bytes())
    base = ("compare", fast, "--vehicle", folder / "vehicle.toml")
    for more in ((copy,), ("--train", copy)):
        said = run(*base, *more, code=2)
        assert "are the same flight; give each flight once, in FLIGHTS or with --train" in said
