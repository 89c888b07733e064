"""After a diagnosis: every line it proposes can be typed, and leads on from that verdict."""

import shlex
from html import escape
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

import vehicle
from flight import flight_log
from goshawk.commands.learn import what_next
from goshawk.commands.learn.what_next import DiagnoseCall
from sysid.diagnosis import Diagnosis, OutsideFinding, Verdict
from sysid.diagnosis.findings import CandidateFinding
from sysid.estimator import verdict as fits
from sysid.estimator.fit_to_use import Cause
from tests.goshawk.running import run, typed
from tests.sysid import flying

CALL = DiagnoseCall((Path("a.parquet"), Path("my b.parquet")), Path("vehicle.toml"), (Path("c.parquet"),))
AGAIN = ["diagnose", "a.parquet", "my b.parquet", "--vehicle", "vehicle.toml", "--held-out", "c.parquet"]
FITTED = ["a.parquet", "my b.parquet", "--held-out", "c.parquet"]


def candidate(name: str, verdict: Any, significance: float, *alike: str) -> CandidateFinding:
    shares = tuple((other, 0.95) for other in alike)
    sure = Verdict(verdict)
    return CandidateFinding(name, sure, "", (), 0.0, significance, 0.0, 0.9, shares, ("oblique",), ("F_x",), "v_x")


def drawn(variable: str = "v_z", channel: str = "M_z") -> OutsideFinding:
    at = np.linspace(0.0, 1.0, 9)
    return OutsideFinding(channel, variable, "m/s", at, at, 0.1 * at, 1.0, 50.0, 1e-9, 0.9)


def found(
    *candidates: CandidateFinding,
    outside: OutsideFinding | None = None,
    rivals: tuple[tuple[str, float], ...] = (),
    undecided: tuple[str, ...] = (),
    carried: tuple[bool, ...] = (),
    against: tuple[str, ...] = (),
    converged: bool = True,
    cause: Cause | None = None,
) -> Diagnosis:
    """A diagnosis whose flights took up 4 m x 2 m x 1 m round (1, 0, 1.5), one axis hardly moved."""
    place = np.array([[-1.0, -1.0, 1.49], [3.0, 1.0, 1.51]])
    additions = tuple(s.name for s in candidates if s.verdict == "present")
    fit = SimpleNamespace(
        flights=[SimpleNamespace(position_world_m=place)],
        verdict=fits.Verdict(against),
        converged=converged,
        solution=SimpleNamespace(record=[None] * 30),
    )
    search = SimpleNamespace(
        models=(SimpleNamespace(fit=fit),),
        undecided=SimpleNamespace(between=undecided) if undecided else None,
        equation=None,
        trials=[SimpleNamespace(candidate=SimpleNamespace(name=name), rivals=rivals) for name in additions],
    )
    body = vehicle.example()
    nothing = cast("Any", None)
    return Diagnosis(
        body, body, additions, (), (), candidates, outside, (), (), (), (), (), (), cast("Any", search), carried,
        nothing, fits.Verdict(), nothing, cause,
    )  # fmt: skip


def test_an_addition_is_made_to_the_vehicle_file_and_the_diagnosis_goes_on_from_a_new_one():
    damping = candidate("weak_rotor[2]", "present", 1e-9)
    (line,) = what_next.lines(found(damping), CALL)
    assert typed(line) == ["vehicle", "effect", "add", "vehicle.toml", "weak_rotor", *FITTED]
    call = DiagnoseCall(CALL.flights, CALL.vehicle_file, CALL.held_out, out=Path("better.toml"))
    (line,) = what_next.lines(found(damping), call)
    assert typed(line) == [*AGAIN[:4], "better.toml", *AGAIN[5:]]


def test_flights_without_the_payload_are_marked_before_the_vehicle_gets_it():
    load = found(candidate("payload", "present", 1e-9), carried=(True, False, False))
    marked, judging, line = what_next.lines(load, CALL)
    assert typed(marked) == ["log", "mark", "my b.parquet", "--payload", "left"]
    assert typed(judging) == ["log", "mark", "c.parquet", "--payload", "left"]
    assert typed(line) == ["vehicle", "effect", "add", "vehicle.toml", "payload", *FITTED]


def test_a_foreign_log_is_marked_beside_itself_and_the_marked_one_is_fitted():
    call = DiagnoseCall((Path("a.csv"), Path("b.csv")), CALL.vehicle_file, columns=Path("map.toml"))
    load = found(candidate("payload", "present", 1e-9), carried=(True, False))
    marked, line = what_next.lines(load, call)
    assert typed(marked) == ["log", "mark", "b.csv", "--columns", "map.toml", "--payload", "left"]
    assert typed(line)[5:] == ["a.csv", "b.parquet", "--columns", "map.toml"]


def test_a_curve_outside_the_catalogue_becomes_an_effect_and_is_evaluated():
    call = DiagnoseCall(CALL.flights, CALL.vehicle_file, CALL.held_out)
    (line,) = what_next.lines(found(outside=drawn("dn_0/dt")), call)
    assert typed(line) == ["vehicle", "effect", "add", "vehicle.toml", "m_z_of_dn_0_dt.py", *FITTED, "--proposed"]


@pytest.mark.parametrize(
    ("curve", "words"),
    [(drawn("time", "F_x"), "temperature"), (drawn("x"), "draught"), (drawn("constant", "F_z"), "weigh")],
)
def test_a_curve_against_no_state_of_the_vehicle_gets_a_remark(curve, words):
    (line,) = what_next.lines(found(outside=curve), CALL)
    assert line.startswith("(")
    assert words in line


def test_confounded_effects_are_separated_by_a_next_flight_in_the_space_flown():
    alike = candidate("rotor_drag_speed", "inconclusive", 1e-7, "rotor_drag_thrust")
    (line,) = what_next.lines(found(alike), CALL)
    assert typed(line) == [
        *["next-flight", "a.parquet", "my b.parquet", "--vehicle", "vehicle.toml"],
        *["--candidate", "rotor_drag_speed", "--candidate", "rotor_drag_thrust"],
        *["--space", "4.0,2.0,1.0", "--corner=-1.0,-1.0,1.0", "--out", "waypoints.json"],
    ]


def test_undecided_candidates_are_separated_first():
    doubtful = found(candidate("constant_wind", "inconclusive", 1e-9), undecided=("parasitic_drag", "rotor_drag_speed"))
    (line,) = what_next.lines(doubtful, CALL)
    words = typed(line)
    names = [words[i + 1] for i, word in enumerate(words) if word == "--candidate"]
    assert names == ["parasitic_drag", "rotor_drag_speed"]
    beside = found(outside=drawn(), undecided=("parasitic_drag", "rotor_drag_speed"))
    assert what_next.lines(beside, CALL) == [line]


def test_a_confounded_addition_is_tested_against_the_model_without_it():
    named = candidate("rotor_drag_speed", "present", 1e-9)
    call = DiagnoseCall(CALL.flights, CALL.vehicle_file, CALL.held_out, out=Path("better.toml"), auto=True)
    (line,) = what_next.lines(found(named, rivals=(("weak_rotor[1]", 0.3),)), call)
    words = typed(line)
    assert words[words.index("--vehicle") + 1] == "vehicle.toml"
    assert [words[i + 1] for i, word in enumerate(words) if word == "--candidate"] == [named.name, "weak_rotor[1]"]


def test_nothing_in_doubt_proposes_nothing():
    assert what_next.lines(found(candidate("angular_damping", "excluded", 0.4)), CALL) == []


def test_a_fit_that_is_not_to_be_used_comes_before_all_else():
    call = DiagnoseCall(CALL.flights, CALL.vehicle_file, CALL.held_out, auto=True)
    remark, again = what_next.lines(found(against=("not converged",), converged=False), call)
    assert remark.startswith("(the fit has not converged")
    assert typed(again) == [*AGAIN, "--steps", "60", "--auto"]
    (remark,) = what_next.lines(found(against=("absurd",)), CALL)
    assert remark.startswith("(the fit is not to be used")


def test_a_file_that_was_not_written_is_asked_for_again_and_in_no_other_line():
    call = DiagnoseCall(
        CALL.flights, CALL.vehicle_file, CALL.held_out, auto=True, fit=" --steps 15 --robust", refused=Path("b.toml")
    )
    doubt = candidate("ground_effect", "inconclusive", 0.4)
    _, again, fly = what_next.lines(found(doubt, against=("not converged",), converged=False), call)
    assert typed(again) == [*AGAIN, "--robust", "--steps", "60", "--auto", "--out", "b.toml"]
    assert "b.toml" not in typed(fly)
    named = found(candidate("rotor_drag_speed", "present", 1e-9), against=("not converged",), converged=False)
    assert not [line for line in what_next.lines(named, call) if "effect add" in line]


def test_the_column_map_of_a_foreign_log_is_repeated():
    call = DiagnoseCall((Path("a.csv"),), Path("vehicle.toml"), columns=Path("columns.toml"))
    lines = what_next.lines(found(candidate("ground_effect", "inconclusive", 0.4), outside=None), call)
    lines += what_next.lines(found(outside=drawn()), call)
    assert len(lines) == 2
    for line in lines:
        assert "--columns columns.toml" in line
        typed(line)


def turning_when_climbing(velocity: np.ndarray, rate: np.ndarray, speed: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    return 0.0 * velocity, np.stack([0.0 * rate[:, 0], 0.0 * rate[:, 1], 0.004 * velocity[:, 2]], axis=1)


@pytest.mark.slow
def test_typed_one_after_the_other_the_lines_lead_from_an_unknown_effect_to_a_better_model(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    rng = np.random.default_rng(8)
    truth = flying.Truth(gust=0.1, extra=turning_when_climbing)
    logs = flying.fly(truth, flying.paper_flights(rng, 2, 0.1), 6, duration_s=10.0, rng=rng, rate_hz=100.0)
    for name, log in zip(("vertical", "fast", "turning", "held_out"), logs, strict=False):
        flight_log.save(tmp_path / f"{name}.parquet", log)
    vehicle.save(tmp_path / "vehicle.toml", vehicle.example())
    said = run("diagnose", "vertical.parquet", "fast.parquet", "turning.parquet", "--vehicle", "vehicle.toml",
               "--held-out", "held_out.parquet", "--report", "d.html")  # fmt: skip
    assert "something is missing that no known effect is: M_z against v_z" in said
    assert "torque about z (M_z) follows velocity along z (v_z)" in " ".join(said.split())
    lines = [line.removeprefix("next: ") for line in said.splitlines() if line.startswith("next: ")]
    assert len(lines) == 1
    assert "M_z = a v_z" in " ".join(said.split())
    page = (tmp_path / "d.html").read_text()
    for words in (
        "The torque about z (M_z) follows velocity along z (v_z)",
        "no known effect is: torque about z against velocity along z.",
        "What no known effect explains",
        *lines,
    ):
        assert escape(words) in page
    assert "m_z_of_v_z helped: " in run(*shlex.split(lines[0])[1:])
