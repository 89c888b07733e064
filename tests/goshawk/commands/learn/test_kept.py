"""Results of long work are kept with the flights, and read only where they are about the same."""

from pathlib import Path

import pytest

import vehicle
from goshawk.commands.learn import kept
from goshawk.commands.learn.kept import Kept
from goshawk.terminal.screen import Screen


@pytest.fixture
def flight(tmp_path) -> Path:
    (tmp_path / "flights").mkdir()
    path = tmp_path / "flights" / "a.parquet"
    path.write_bytes(b"a flight")
    vehicle.save(tmp_path / "vehicle.toml", vehicle.example())
    return path


def key(flight: Path, options: object = None) -> str:
    return kept.key([[flight]], None, [flight.parents[1] / "vehicle.toml"], options)


def result(flight: Path, verdict: str = "a") -> Kept:
    screen = Screen()
    screen.line(verdict)
    screen.table("sizes", ("effect", "size"), [("payload", 0.25)])
    return Kept({"verdict": verdict}, screen, vehicle.example(), kept.about([flight], None))


def test_what_was_kept_is_read_back_as_it_was(flight, capsys):
    kept.keep("diagnosis", flight, key(flight), result(flight))
    found = kept.find("diagnosis", flight, key(flight))
    assert found is not None
    assert found.vehicle is not None
    assert vehicle.vehicle_hash(found.vehicle) == vehicle.vehicle_hash(vehicle.example())
    given = result(flight)
    assert (found.document, found.screen, found.more) == (given.document, given.screen, given.more)
    found.screen.show()
    assert "payload" in capsys.readouterr().out


def test_another_flight_vehicle_or_option_makes_another_key(flight):
    keys = [key(flight), key(flight, "auto")]
    flight.write_bytes(b"another flight")
    keys.append(key(flight))
    file = flight.parents[1] / "vehicle.toml"
    vehicle.save(file, vehicle.example().with_value("mass_kg", 0.8))
    keys.append(key(flight))
    assert len(set(keys)) == 4
    assert kept.find("diagnosis", flight, keys[0]) is None


def test_the_newest_about_the_same_flights_is_read_and_none_about_others(flight):
    for options, verdict in (("one", "a"), ("two", "b")):
        kept.keep("diagnosis", flight, key(flight, options), result(flight, verdict))
    found = kept.newest("diagnosis", [flight])
    assert found is not None
    assert found.document["verdict"] == "b"
    assert kept.newest("comparison", [flight]) is None
    flight.write_bytes(b"another flight")
    assert kept.newest("diagnosis", [flight]) is None


@pytest.mark.parametrize("damage", ["", "{", "[]", '{"format": "goshawk-kept-result", "version": 1}'])
def test_a_damaged_file_is_as_if_it_were_not_there(flight, damage):
    kept.keep("diagnosis", flight, key(flight), result(flight))
    kept.place("diagnosis", flight, key(flight)).write_text(damage)
    assert kept.find("diagnosis", flight, key(flight)) is None
    assert kept.newest("diagnosis", [flight]) is None


def test_a_fitted_vehicle_that_was_changed_by_hand_is_no_result_any_more(flight):
    kept.keep("diagnosis", flight, key(flight), result(flight))
    file = kept.place("diagnosis", flight, key(flight)).with_suffix(".toml")
    vehicle.save(file, vehicle.load(file).with_value("mass_kg", 0.8))
    assert kept.find("diagnosis", flight, key(flight)) is None


def test_flights_of_a_project_have_their_results_in_the_project(flight):
    assert kept.folder(flight) == flight.parent / kept.FOLDER
    (flight.parents[1] / "project.toml").touch()
    assert kept.folder(flight) == flight.parents[1] / kept.FOLDER
