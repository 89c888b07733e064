"""The page's next flight: for the question that the diagnosis leaves open, a saved trajectory that the gate passes."""

import shutil

import numpy as np
import pytest

import mapping
import vehicle
from flight import InputError, file_format, flight_log, project, silent, trajectory
from gcs_web.flights.flights import Flights
from gcs_web.jobs.job_process import Done, JobProcess
from gcs_web.learning.learning import Learning
from goshawk.station_jobs import next_flight
from goshawk.station_jobs.next_flight import Arguments
from planner.gate import gate
from sysid.diagnosis import diagnose
from sysid.diagnosis.experiment_design.next_flight import in_doubt
from sysid.diagnosis.findings import Verdict
from sysid.estimator.options import Options
from tests.gcs_web.station_process import alive
from vehicle import flights, manoeuvres


@pytest.fixture(scope="module")
def opened(tmp_path_factory, pillar_map) -> project.Project:
    """A project with a map, and a short flight that says little of a vehicle whose file lacks rotor drag."""
    made = project.create(tmp_path_factory.mktemp("next") / "project", "next")
    made.flight("a").parent.mkdir()
    truth, rng = vehicle.example(), np.random.default_rng(2)
    flown = flights.fly_trajectory(truth, manoeuvres.scaled(manoeuvres.make("doublets"), 0.5), rng=rng)
    flight_log.save(made.flight("a"), flights.measure(flown, rng=rng))
    vehicle.save(made.vehicle, truth.without_effect("rotor_drag_thrust"))
    shutil.copytree(pillar_map, made.map, dirs_exist_ok=True)
    return made


def test_a_taken_name_is_refused_before_the_queue(opened):
    path = opened.trajectory("taken")
    path.parent.mkdir(exist_ok=True)
    path.write_text("{}")
    with pytest.raises(InputError, match="taken"):
        next_flight.KIND.check(opened, Arguments(["a"], out="taken"))
    with pytest.raises(InputError, match="escape"):
        next_flight.KIND.check(opened, Arguments(["a"], out="../escape"))
    path.unlink()


def test_a_doubtful_map_is_taken_only_when_the_pilot_accepts_it(opened, tmp_path):
    folder = shutil.copytree(opened.folder, tmp_path / "doubtful")
    path = folder / "map" / "map.toml"
    facts = file_format.read_toml(path, format="goshawk-map", version=1)
    body = facts | {"verdict": "doubtful", "reasons": ["the walk is short"]}
    file_format.write_toml(path, format="goshawk-map", version=1, body=body)
    with pytest.raises(InputError, match=r"doubtful: the walk is short.*accept it"):
        next_flight._run(folder, Arguments(["a"]), silent)
    with pytest.raises(
        InputError, match=r"gone\.parquet does not exist"
    ):  # the map is taken, then the flights are read
        next_flight._run(folder, Arguments(["gone"], accept_doubtful_map=True), silent)


def test_a_cancelled_proposal_leaves_no_process_and_no_file(opened, tmp_path):
    folder = shutil.copytree(opened.folder, tmp_path / "cancelled")
    job = JobProcess(next_flight._run, folder, Arguments(["a"]), tmp_path / "job.log")
    pid = job._process.pid

    def cancel(stage: str, fraction: float) -> None:
        job.cancel()

    assert not isinstance(job.outcome(cancel), Done)
    assert not alive(pid)
    assert list((folder / "trajectories").glob("*")) == []


@pytest.mark.slow
def test_the_open_question_is_answered_by_a_saved_checked_trajectory(opened, monkeypatch):
    hover = {"hover": manoeuvres.LIBRARY["hover"]}
    monkeypatch.setattr(manoeuvres, "LIBRARY", {n: manoeuvres.LIBRARY[n] for n in ("oblique", "yaw_sweep")})
    before = opened.vehicle.read_bytes()
    result = next_flight._run(opened.folder, Arguments(["a"]), silent)
    log = flight_log.load(opened.flight("a"))
    named = flight_log.FlightLog(log.columns, {**log.metadata, "name": "a"})
    believed = vehicle.load(opened.vehicle)
    found = diagnose([named], believed, auto=True, options=Options(unseen="hold", gusts="white"))
    assert tuple(result.candidates) == in_doubt(found)
    assert not set(result.candidates) & {f.name for f in found.candidates if f.verdict is Verdict.EXCLUDED}
    kept = trajectory.load(opened.trajectory(result.name))
    assert gate.check_file(kept, mapping.open_map(opened.map).field, believed).passed
    assert opened.vehicle.read_bytes() == before
    shown = Learning(opened, Flights(opened, lambda _: None)).next_flight()
    assert (shown.state, shown.name, shown.refusal) == ("current", result.name, "")
    assert shown.known_log_odds + shown.expected_log_odds >= shown.needed_log_odds > 0.0
    assert shown.clearance_m >= shown.required_clearance_m
    drawn, path = np.reshape(shown.path_m, (-1, 3)), kept.trajectory
    np.testing.assert_allclose(drawn[[0, -1]], path.position([0.0, path.duration_s]), atol=0.05)

    # nothing that may be flown moves: the answer is no, and what it takes is said
    monkeypatch.setattr(manoeuvres, "LIBRARY", hover)
    refused = next_flight._run(opened.folder, Arguments(["a"], out="none"), silent)
    assert refused.name == ""
    assert not opened.trajectory("none").exists()
    shown = Learning(opened, Flights(opened, lambda _: None)).next_flight()
    assert shown.refusal == refused.sentence != ""
    (opened.map / "map.toml").write_text((opened.map / "map.toml").read_text() + "\n")
    assert Learning(opened, Flights(opened, lambda _: None)).next_flight().state == "old"
