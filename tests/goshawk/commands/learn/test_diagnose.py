"""`goshawk diagnose` as a user runs it: verdict first, table, JSON, vehicle file, next line to type, bad input."""

import importlib.util
import json
import re
import sys
from pathlib import Path

import numpy as np
import pytest

import vehicle
from flight import flight_log
from goshawk.commands.learn import kept
from tests.goshawk.running import answer, run

DAMPING = 0.0008


def damping(velocity: np.ndarray, rate: np.ndarray, speed: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    return 0.0 * velocity, -DAMPING * rate


@pytest.fixture(scope="module")
def folder(tmp_path_factory) -> Path:
    """Two flights to learn from and one to judge by, of the paper's vehicle with a damping it does not know."""
    path = Path(__file__).parents[3] / "sysid" / "flying.py"
    spec = importlib.util.spec_from_file_location("diagnose_test_flying", path)
    flying = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = flying
    spec.loader.exec_module(flying)
    folder = tmp_path_factory.mktemp("diagnose")
    rng = np.random.default_rng(8)
    truth = flying.Truth(gust=0.1, extra=damping)
    logs = flying.fly(truth, flying.paper_flights(rng, 2, 0.1), 6, duration_s=10.0, rng=rng, rate_hz=100.0)
    for name, i in (("vertical", 0), ("fast", 1), ("turning", 2), ("held_out", 4)):
        flight_log.save(folder / f"{name}.parquet", logs[i])
    vehicle.save(folder / "vehicle.toml", vehicle.example("rigter2019"))
    return folder


def base(folder: Path) -> list[object]:
    flights = [folder / f"{name}.parquet" for name in ("vertical", "fast", "turning")]
    return ["diagnose", *flights, "--vehicle", folder / "vehicle.toml"]


def test_the_missing_effect_is_named_written_and_the_next_command_works(folder, tmp_path):
    out, page = tmp_path / "better.toml", tmp_path / "d.html"
    asked = (*base(folder), "--held-out", folder / "held_out.parquet", "--out", out)
    said = run(*asked, "--report", page, "--plots", tmp_path / "p", "--details")
    assert said.startswith("missing was angular_damping (confidence ")
    for expected in ("helped: ", "+ angular_damping", "excluded", "inconclusive", "unobservable", f"written: {out}"):
        assert expected in said
    document = json.loads(run(*asked, "--overwrite", "--json"))  # what the first call kept
    assert (document["schema"], document["version"]) == ("goshawk-diagnosis", 2)
    assert said.startswith(f"missing was angular_damping (confidence {document['confidence']:.0%})")
    assert document["confidence"] == document["probabilities"]["as_stated"]
    assert document["flights"] == ["vertical", "fast", "turning"]
    assert document["held_out"] == ["held_out"]
    assert document["additions"] == ["angular_damping"]
    first = document["candidates"][0]
    assert first["verdict"] == "present"
    for size in first["sizes"].values():
        assert abs(size["value"] - DAMPING) < 5.0 * size["sigma"]
    added = vehicle.load(out)
    assert "angular_damping" in added.effects
    assert added.value("angular_damping.z_n_m_s") == first["sizes"]["angular_damping.z_n_m_s"]["value"]
    assert document["next"][0].startswith("goshawk diagnose ")
    assert str(out) in document["next"][0]
    assert document["written"] == str(out)
    drawn = {path.stem for path in (tmp_path / "p").iterdir()}
    assert drawn == {"staircase", "candidate_1", "residual_share", "residual_wrench", "confounded"}
    html = page.read_text()
    assert html.count("data:image/svg+xml") == len(drawn)
    assert "Missing was angular damping." in html
    for shown in (said, html):  # within what was flown, and no farther
        assert "within the flown envelope" in shown
        assert f"sink to {document['envelope']['sink_m_s']:.1f} m/s" in shown
        assert f"robability {document['confidence']:.0%} that this is right" in shown
    assert document["next"][0] in html
    assert "src='http" not in html


def test_the_vehicle_is_replaced_only_with_overwrite_and_can_be_restored(folder, tmp_path):
    mine = tmp_path / "vehicle.toml"
    mine.write_bytes((folder / "vehicle.toml").read_bytes())
    words = [*base(folder)[:-1], mine, "--out", mine]
    assert "--overwrite" in run(*words, code=2)
    assert mine.read_bytes() == (folder / "vehicle.toml").read_bytes()
    document = json.loads(run(*words, "--overwrite", "--json"))
    assert "training flights" in document["attempts"][0]["evidence"]["judged_on"]
    assert "angular_damping" in vehicle.load(mine).effects
    run("vehicle", "undo", mine, "--yes")
    assert mine.read_bytes() == (folder / "vehicle.toml").read_bytes()


def test_a_diagnosis_is_kept_with_the_flights_and_read_by_the_next_call_until_anything_differs(folder, tmp_path):
    log = flight_log.load(folder / "fast.parquet")
    short = log.slice(float(log.time_s[0]) + 2.0, float(log.time_s[0]) + 6.0)  # what it shows is not asked here
    flight_log.save(tmp_path / "short.parquet", short)
    (tmp_path / "vehicle.toml").write_bytes((folder / "vehicle.toml").read_bytes())
    words = ("diagnose", tmp_path / "short.parquet", "--vehicle", tmp_path / "vehicle.toml")
    first = answer(*words)
    (file,) = (tmp_path / kept.FOLDER).glob("diagnosis-*.json")
    assert f"kept: {file}" in first.stderr
    assert "note: no climb and descent" in first.stdout
    assert "and 2 more notes" in first.stdout
    assert "hold another flight out (--held-out), for one alone" in file.read_text()
    again = answer(*words, "--out", tmp_path / "fitted.toml")
    assert f"read from {file}" in again.stderr
    assert first.stdout.splitlines()[:5] == again.stdout.splitlines()[:5]
    assert "fitting" not in again.stderr
    assert vehicle.load(tmp_path / "fitted.toml").parameters == vehicle.load(file.with_suffix(".toml")).parameters
    changed = vehicle.load(tmp_path / "vehicle.toml").with_value("mass_kg", 0.71)
    vehicle.save(tmp_path / "vehicle.toml", changed)
    assert "read from" not in answer(*words).stderr
    assert "read from" not in answer(*words, "--hold", "inertia_*").stderr


def lines_of_80_columns(text: str) -> int:
    return sum(max(1, -(-len(line) // 80)) for line in text.splitlines())


def test_the_answer_fits_one_screen_and_details_come_from_what_was_kept(folder):
    words = (*base(folder), "--held-out", folder / "held_out.parquet")
    said = run(*words)
    assert lines_of_80_columns(re.sub(r"\S+/", "", said)) <= 24  # paths are as long as the caller's are
    assert said.startswith("missing was angular_damping (confidence ")
    for expected in ("as given", "fitted", "+ angular_damping", "the fit is usable", "\nnext: ", "x_n_m_s"):
        assert expected in said
    more = answer(*words, "--details")
    assert "read from" in more.stderr
    assert all(line in more.stdout for line in said.splitlines())
    document = json.loads(run(*words, "--json"))
    assert all(f"  {c['name']}" in more.stdout for c in document["candidates"])


@pytest.mark.slow
def test_without_out_the_next_line_adds_the_effect(folder):
    document = json.loads(run(*base(folder), "--json"))
    assert document["written"] is None
    assert "goshawk vehicle effect add" in document["next"][0]
    assert "angular_damping" in document["next"][0]


def test_bad_input_is_one_sentence(folder, tmp_path):
    fast, car = folder / "fast.parquet", folder / "vehicle.toml"
    copy = tmp_path / "copy.parquet"
    copy.write_bytes(fast.read_bytes())
    empty = tmp_path / "empty.parquet"
    empty.write_bytes(b"")
    log, part, future = flight_log.load(fast), tmp_path / "part.parquet", tmp_path / "future.toml"
    flight_log.save(part, log.slice(float(log.time_s[0]) + 2.0, float(log.time_s[0]) + 6.0))
    future.write_text(re.sub(r"(?m)^version = .*", "version = 99", car.read_text()))
    refused = {
        "no such file": ["diagnose", tmp_path / "none.parquet", "--vehicle", car],
        "same flight": ["diagnose", fast, copy, "--vehicle", car],
        "give each flight once, for fitting or held out": ["diagnose", fast, "--vehicle", car, "--held-out", copy],
        "fast and part hold the same flight": ["diagnose", fast, "--vehicle", car, "--held-out", part],
        "version 99 of goshawk-vehicle": ["diagnose", fast, "--vehicle", future],
        "other.toml": ["diagnose", fast, "--vehicle", tmp_path / "other.toml"],
        "empty.parquet": ["diagnose", empty, "--vehicle", car],
        "Missing argument": ["diagnose", "--vehicle", car],
    }
    for words, arguments in refused.items():
        said = run(*arguments, code=2)
        assert words in said
        last = said.strip().splitlines()[-1]
        assert last.startswith("goshawk: ")
        assert "Traceback" not in said


@pytest.mark.slow
def test_a_short_held_out_flight_is_reported_as_too_little_and_lowers_the_confidence(folder, tmp_path):
    log = flight_log.load(folder / "held_out.parquet")
    start_s = float(log.time_s[0])
    flight_log.save(tmp_path / "short.parquet", log.slice(start_s + 2.0, start_s + 5.0))
    said = run(*base(folder), "--held-out", tmp_path / "short.parquet", "--json")
    document = json.loads(said, parse_constant=pytest.fail)
    assert "too little to judge by" in document["findings"][0]
    assert "too short to confirm" in document["verdict"]
    assert document["confidence"] <= 0.5
    assert not re.search(r"\b(inf|nan)\b", said.partition('"not_finite"')[0])
