"""Reports that the page offers: written with their result, one file that asks nobody, foreign names as text."""

import html
import re
from dataclasses import replace

import numpy as np
import pytest

import vehicle
from flight import InputError, flight_log, project, silent
from gcs_web.comparison import reports
from goshawk.station_jobs import compare, diagnose
from goshawk.station_jobs.flights import Chosen
from vehicle import flights, manoeuvres

HOSTILE = "<script>alert(1)</script>"


@pytest.fixture(scope="module")
def opened(tmp_path_factory) -> project.Project:
    """Two short flights with markup in what they say of themselves, and a vehicle of such a name without rotor drag."""
    made = project.create(tmp_path_factory.mktemp("reports") / "project", "reports")
    made.flight("a").parent.mkdir()
    truth, rng = vehicle.example(), np.random.default_rng(5)
    weave = manoeuvres.from_legs(x=[(2.5, 6.0), (2.5, -6.0)], y=[(1.0, 0.0), (2.0, 3.0), (2.0, -3.0)])
    for name in ("a", "b"):
        log = flights.measure(flights.fly_trajectory(truth, weave), rng=rng)
        hostile = flight_log.FlightLog(log.columns, {**log.metadata, "name": HOSTILE, "source": HOSTILE})
        flight_log.save(made.flight(name), hostile)
    vehicle.save(made.vehicle, replace(truth.without_effect("rotor_drag_thrust"), name=HOSTILE))
    return made


def test_the_report_of_a_comparison_is_one_file_with_foreign_names_as_text(opened):
    compare._run(opened.folder, Chosen(["a"], ["b"]), silent)
    name, text = reports.read(opened, "comparison")
    assert name == "reports comparison"
    assert "Comparison of models" in text
    refused(text)


@pytest.mark.slow
def test_the_report_of_a_diagnosis_says_what_the_page_says_and_what_to_do_next(opened):
    shown = diagnose._run(opened.folder, diagnose.Arguments(["a"], ["b"]), silent)
    _, text = reports.read(opened, "diagnosis")
    assert f"<b>{html.escape(shown.verdict)}</b>" in text
    assert shown.verdict.startswith("Nothing is confirmed to be missing")  # these flights are too short to judge by
    assert "goshawk next-flight flights/a.parquet --vehicle vehicle.toml --candidate" in text
    assert "rotor drag with thrust" in shown.verdict
    refused(text)


def test_a_report_is_gone_before_a_new_result_is_saved_and_drawn(opened, monkeypatch):
    old = reports.report_file(opened.folder, "comparison")
    old.write_text("of the comparison before")
    monkeypatch.setattr("sysid.report.write_comparison", lambda *_: (_ for _ in ()).throw(KeyboardInterrupt))
    with pytest.raises(KeyboardInterrupt):
        compare._run(opened.folder, Chosen(["b"], ["a"]), silent)
    assert not old.exists()


def refused(text: str) -> None:
    """Nothing is loaded from elsewhere, and no foreign string is markup."""
    assert HOSTILE not in text
    assert not re.search(r"(?:src|href)=[\"']?(?:https?:)?//", text)


def test_what_was_not_made_or_is_no_report_is_refused(tmp_path):
    empty = project.create(tmp_path / "project", "empty")
    with pytest.raises(InputError, match="no report of a diagnosis yet"):
        reports.read(empty, "diagnosis")
    with pytest.raises(InputError, match=r"no report '\.\./vehicle'"):
        reports.read(empty, "../vehicle")
