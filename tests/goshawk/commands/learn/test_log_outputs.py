"""`goshawk log`: the report page, CSV, MCAP, drafted columns, and the log with its fixes."""

import base64
import json
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import sysid
import vehicle
from firmware_bridge.controller import State
from flight import FlightLog, flight_log
from goshawk.commands.learn import log_report
from sysid.logs.check import check_log
from tests.goshawk import foreign_log
from tests.goshawk.running import answer, run, typed

BAG_MAP = """
format = "goshawk-bag-map"
version = 1
[pose]
topic = "/goshawk/pose"
[quantity.rate_body_rad_s]
topic = "/goshawk/rate_body_rad_s"
fields = ["data[0]", "data[1]", "data[2]"]
[quantity.rotor_speed_rad_s]
topic = "/goshawk/rotor_speed_rad_s"
fields = ["data[0]", "data[1]", "data[2]", "data[3]"]
"""


@pytest.fixture(scope="module")
def flown(tmp_path_factory) -> Path:
    """A clean simulated log, its vehicle, and the same flight as a foreign CSV."""
    folder = tmp_path_factory.mktemp("flown")
    truth = vehicle.example()
    log = foreign_log.simulated(truth)
    kept = {n: v for n, v in log.columns.items() if not n.startswith(("velocity", "specific", "setpoint", "wind"))}
    flight_log.save(folder / "clean.parquet", FlightLog(kept, {"name": "clean <flight>"}))
    vehicle.save(folder / "v.toml", truth)
    foreign_log.write(folder / "foreign.csv", log)
    return folder


def clean(flown: Path) -> FlightLog:
    return flight_log.load(flown / "clean.parquet")


def test_csv_holds_the_log_to_the_last_bit(flown, tmp_path):
    run("log", "export", flown / "clean.parquet", "--csv", tmp_path / "a.csv")
    head, *rows = (tmp_path / "a.csv").read_text().splitlines()
    values = np.array([[float(v) if v else np.nan for v in row.split(",")] for row in rows])
    for name, column in zip(head.split(","), values.T, strict=True):
        np.testing.assert_array_equal(column, clean(flown).columns[name])


def proposed(said: str) -> list[str]:
    """The command that a verb tells to type next, as words."""
    [line] = [line for line in said.splitlines() if line.startswith("next: ")]
    return typed(line.removeprefix("next: "))


def test_the_next_command_repeats_the_options_and_fits_the_pieces_between_gaps_that_a_fix_left(flown, tmp_path):
    log, file, out, model = clean(flown), tmp_path / "a flight.parquet", tmp_path / "b.parquet", flown / "v.toml"
    for leap_m, gaps in ((0.5, ["--split-gaps"]), (0.0, [])):
        columns = {name: values.copy() for name, values in log.columns.items()}
        columns["position_world_x_m"][(log.time_s > 4.0) & (log.time_s < 4.1)] += leap_m
        flight_log.save(file, FlightLog(columns, log.metadata))
        if gaps:
            fixing = proposed(answer("log", "check", file, "--vehicle", model).stdout)
            assert fixing == ["log", "fix", str(file), "--vehicle", str(model), "--out", "NEW.parquet"]
        fitting = proposed(run("log", "fix", file, "--vehicle", model, "--out", out, "--overwrite"))
        assert fitting == ["identify", str(out), "--vehicle", str(model), *gaps, "--out", "FITTED.toml"]


def test_mcap_reads_back_as_ros_messages(flown, tmp_path):
    run("log", "export", flown / "clean.parquet", "--mcap", tmp_path / "a.mcap")
    (tmp_path / "map.toml").write_text(BAG_MAP)
    read, log = sysid.read_log(tmp_path / "a.mcap", tmp_path / "map.toml"), clean(flown)
    for quantity in ("position_world_m", "q_world_body", "rotor_speed_rad_s"):
        np.testing.assert_allclose(read.vector(quantity), log.vector(quantity), atol=1e-12)


def page_data(path: Path) -> dict:
    text = path.read_text()
    assert "http" not in re.sub(r"<script>.*?</script>", "", text, flags=re.DOTALL), "the page works offline"
    assert "fetch(" not in text
    found = re.search(r'id="data">(.*?)</script>', text, flags=re.DOTALL)
    assert found
    return json.loads(found[1])


def test_the_report_holds_every_stream_and_marks_what_the_checks_found(flown, tmp_path):
    log = clean(flown)
    z = log.columns["position_world_z_m"].copy()
    z[400] += 0.5
    flight_log.save(tmp_path / "a.parquet", FlightLog({**log.columns, "position_world_z_m": z}, log.metadata))
    assert answer("log", "check", tmp_path / "a.parquet", "--report", tmp_path / "a.html").returncode == 1
    data = page_data(tmp_path / "a.html")
    assert sum(len(panel["streams"]) for panel in data["panels"]) == len(log.columns) - 1
    time_s = np.frombuffer(base64.b64decode(data["time"]), "<f8")
    np.testing.assert_array_equal(time_s, log.time_s)
    assert any(a <= log.time_s[400] <= b for mark in data["marks"] for a, b in mark["spans"])
    assert "the position jumps" in (tmp_path / "a.html").read_text()


def test_text_of_a_log_is_escaped_in_the_report(tmp_path):
    evil = "</script><script>alert(1)</script>"
    log = FlightLog({"time_s": np.arange(60) / 10, "flux_ratio": np.ones(60)}, {"name": evil, evil: evil})
    text = log_report.page(log, check_log(log), {"name": evil})
    assert "<script>alert" not in text


def test_a_log_that_no_vehicle_can_be_identified_from_is_named(flown, tmp_path):
    log = clean(flown)
    without = {name: values for name, values in log.columns.items() if not name.startswith("rotor_speed")}
    flight_log.save(tmp_path / "with.parquet", log)
    flight_log.save(tmp_path / "without.parquet", FlightLog(without, log.metadata))
    commands = {f"motor_command_{i}_ratio": np.full(len(log), 0.5) for i in range(4)}
    flight_log.save(tmp_path / "commanded.parquet", FlightLog({**without, **commands}, log.metadata))
    assert "a fit takes 1 for the fastest rotor speed" in run("log", "check", tmp_path / "commanded.parquet")
    for name, count in (("with", 0), ("without", 1)):
        said = run("log", "check", tmp_path / f"{name}.parquet", "--report", tmp_path / f"{name}.html")
        document = json.loads(run("log", "check", tmp_path / f"{name}.parquet", "--json"))
        assert len(document["check"]["notes"]) == count
        for text in (said, (tmp_path / f"{name}.html").read_text()):
            assert text.count("no vehicle can be identified") == count


def test_the_facts_on_top_of_the_report_are_those_of_the_log_and_of_what_was_checked(flown, tmp_path):
    log = clean(flown)
    aloft = np.full(len(log), float(State.ARMED))
    aloft[100:-100] = State.HOLD
    metadata = {
        "name": "lap",
        "fixes": ["time shifted", "z flipped"],
        "mass_kg": 0.7,
        "duration_s": 9,
        "payload": "left",
    }
    flight_log.save(tmp_path / "a.parquet", FlightLog({**log.columns, "mission_state": aloft}, metadata))
    run("log", "check", tmp_path / "a.parquet", "--report", tmp_path / "a.html")
    table = (tmp_path / "a.html").read_text().split("<table>")[1].split("</table>")[0]
    facts = dict(re.findall(r"<tr><td>(.*?)</td><td>(.*?)</td></tr>", table))
    whole_s, air_s = np.ptp(log.time_s), np.ptp(log.time_s[100:-100])
    assert facts["rows"] == str(len(log))
    assert (facts["duration"], facts["checked, in the air"]) == (f"{whole_s:.2f} s", f"{air_s:.2f} s")
    assert facts["rate"] == f"{1.0 / np.median(np.diff(log.time_s)):.1f} Hz"
    assert (facts["mass"], facts["duration_s"], facts["payload"]) == ("0.7 kg", "9 s", "left")
    assert (facts["fix 1"], facts["fix 2"]) == ("time shifted", "z flipped")
    assert not {"name", "fixes"} & facts.keys()


def test_what_the_checks_left_open_stands_on_the_report():
    log = FlightLog({"time_s": np.arange(60) / 10}, {})
    checked = replace(check_log(log), inconclusive=("the gyro's clock <is> open",))
    assert "inconclusive</b>: the gyro&#x27;s clock &lt;is&gt; open" in log_report.page(log, checked, {})


def test_thinning_loses_no_spike():
    values = np.zeros(100_000)
    values[70_001] = 5.0
    log = FlightLog({"time_s": np.arange(100_000) / 1000, "flux_ratio": values}, {})
    time_s, stored = log_report.thinned(log)
    assert len(time_s) <= log_report.MOST_POINTS
    assert stored["flux_ratio"].max() == 5.0
    assert abs(time_s[np.argmax(stored["flux_ratio"])] - 70.001) < 0.02


def test_a_foreign_csv_becomes_a_clean_log_of_ours_in_two_commands(flown, tmp_path):
    run("log", "draft-columns", flown / "foreign.csv", "--out", tmp_path / "map.toml")
    asked = ("--columns", tmp_path / "map.toml", "--vehicle", flown / "v.toml")
    document = json.loads(run("log", "fix", flown / "foreign.csv", *asked, "--out", tmp_path / "f.parquet", "--json"))
    assert any("time stamps of rotor_speed" in done for done in document["fixed"])
    assert document["check"]["worst"] == "fine"
    mended, log = flight_log.load(tmp_path / "f.parquet"), clean(flown)
    assert mended.metadata["fixes"] == document["fixed"]
    assert mended.metadata["fixed_from"] == "foreign.csv"
    np.testing.assert_allclose(
        mended.vector("position_world_m"), log.vector("position_world_m")[: len(mended)], atol=1e-6
    )
    speed = np.stack([np.interp(mended.time_s, log.time_s, s) for s in log.vector("rotor_speed_rad_s").T], axis=1)
    assert np.abs(mended.vector("rotor_speed_rad_s") - speed)[50:-50].mean() < 6.0  # a few rad/s of noise remain


def test_a_fix_never_touches_the_log_it_was_given(flown, tmp_path):
    before = (flown / "clean.parquet").read_bytes()
    said = run("log", "fix", flown / "clean.parquet", "--out", flown / "clean.parquet", "--overwrite", code=2)
    assert "never changed" in said
    assert (flown / "clean.parquet").read_bytes() == before
    assert ".parquet" in run("log", "fix", flown / "clean.parquet", "--out", tmp_path / "a.csv", code=2)


def test_an_existing_output_is_kept(flown, tmp_path):
    clean, foreign = flown / "clean.parquet", flown / "foreign.csv"
    asked = (
        ("export", clean, "--csv"), ("export", clean, "--mcap"), ("check", clean, "--report"),
        ("draft-columns", foreign, "--out"),
    )  # fmt: skip
    for words in asked:
        (tmp_path / "there").write_text("mine")
        assert "there" in run("log", *words, tmp_path / "there", code=2)
        assert (tmp_path / "there").read_text() == "mine"


def test_the_table_shows_display_names_and_units(flown):
    said = run("log", "show", flown / "clean.parquet")
    assert "body rate (gyro)" in said
    assert re.search(r"duration\s+4\.\d+ s", said)


def test_errors_found_are_exit_code_1_and_no_fault_is_0(flown, tmp_path):
    log = clean(flown)
    assert "found no fault" in run("log", "check", flown / "clean.parquet")
    keep = (log.time_s < 1.0) | (log.time_s > 2.0)
    flight_log.save(tmp_path / "gap.parquet", FlightLog({k: v[keep] for k, v in log.columns.items()}, log.metadata))
    for words, code in ((("check",), 1), (("show",), 0)):
        assert answer("log", *words, tmp_path / "gap.parquet").returncode == code


def test_another_programs_log_is_imported_as_it_is(flown, tmp_path):
    run("log", "draft-columns", flown / "foreign.csv", "--out", tmp_path / "map.toml")
    read = sysid.read_log(flown / "foreign.csv", tmp_path / "map.toml")
    run("log", "import", flown / "foreign.csv", "--columns", tmp_path / "map.toml", "--out", tmp_path / "own.parquet")
    own = flight_log.load(tmp_path / "own.parquet")
    for name, values in read.columns.items():
        np.testing.assert_array_equal(own.columns[name], values)
