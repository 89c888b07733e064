"""Compare, try and diagnose as the station does them: figures and verdicts are those of the verbs."""

import contextlib
import io
import json
import os
import shutil
from pathlib import Path
from typing import Any
from unittest.mock import MagicMock

import msgspec
import numpy as np
import pytest

import vehicle
from flight import InputError, file_format, flight_log, project, silent
from gcs_web.comparison import comparing, residuals
from gcs_web.comparison.comparing import Comparing
from gcs_web.flights.flights import Flights
from gcs_web.learning import diagnosis_values
from gcs_web.learning.learning import KeptTrial, Learning, save_trial
from goshawk.cli import main
from goshawk.station_jobs import compare, diagnose, identify, try_effect
from goshawk.station_jobs.flights import Chosen
from sysid.diagnosis import OutsideFinding
from sysid.diagnosis.evidence import explained
from sysid.diagnosis.evidence.free_form import UNIT
from sysid.estimator.options import Options
from sysid.estimator.validation import changes
from sysid.estimator.validation.changes import HORIZON_S
from sysid.estimator.validation.comparison import HORIZONS_S, QUANTITIES
from sysid.estimator.validation.comparison import compare as compared_by_sysid
from sysid.report import residual_plots, words
from sysid.report.pages import SHOWN
from vehicle import flights, manoeuvres

DRAG = "rotor_drag_thrust"
BOB = [(1.25, 1.0), (1.25, -1.0)] * 2
GUARD = """
from vehicle.effects.base import Effect, Spec, Stage

def apply(flow, p):
    flow.force_n[1] -= p.drag_kg_m * flow.velocity_m_s[1]

EFFECT = Effect(name="trial_guard", number=0, stage=Stage.FORCE, apply=apply,
    parameters=(Spec("drag_kg_m", "N s/m", prior=0.02, bounds=(0.0, 1.0)),),
    law="F_y = -c v_y", source="here", channel="F_y", regressor="v_y", excited_by=("fast_level",))
"""


def told(*arguments: object, code: int = 0) -> dict[str, Any]:
    """What a verb says in JSON."""
    out = io.StringIO()
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(io.StringIO()), pytest.raises(SystemExit) as end:
        main([str(argument) for argument in arguments])
    assert (end.value.code or 0) == code
    return json.loads(out.getvalue())


@pytest.fixture(scope="module")
def opened(tmp_path_factory) -> project.Project:
    """A truth with rotor drag, two flights of it, and a project whose vehicle lacks it."""
    made = project.create(tmp_path_factory.mktemp("learning") / "project", "learning")
    made.flight("a").parent.mkdir()
    truth, rng = vehicle.example(), np.random.default_rng(5)
    for name, size in (("a", 9.0), ("b", -7.0)):
        weave = manoeuvres.from_legs(x=[(2.5, size), (2.5, -size)], y=[(1.0, 0.0), (2.0, 4.0), (2.0, -4.0)], z=BOB)
        flight_log.save(made.flight(name), flights.measure(flights.fly_trajectory(truth, weave), rng=rng))
    vehicle.save(made.vehicle, truth.without_effect(DRAG))
    return made


@pytest.fixture(scope="module")
def compared(opened: project.Project) -> residuals.Compared:
    return compare._run(opened.folder, Chosen(["a"], ["b"]), silent)


@pytest.fixture
def learning(opened: project.Project) -> Learning:
    return Learning(opened, Flights(opened, lambda _: None))


def test_the_comparison_has_the_figures_of_the_verb(opened, compared):
    said = told("compare", opened.flight("b"), "--vehicle", opened.vehicle, "--json")
    (model,) = said["models"].values()
    for quantity, unit in QUANTITIES.items():
        expected = model["error_rms"][f"{quantity}_{unit.replace('/', '_')}"]
        np.testing.assert_allclose(compared.errors[quantity], expected)
    assert compared.predictions == said["predictions"]


def test_the_drawn_prediction_is_off_by_the_verbs_error(compared):
    judging = compared.flight("b")
    for i, (horizon_s, ended) in enumerate(zip(HORIZONS_S, judging.predicted, strict=True)):
        moved, turned = np.array(ended.deviation).reshape(2, 3, -1)
        for quantity, off in (("position", moved), ("attitude", turned)):
            rms = np.sqrt((off**2).sum(axis=0).mean())
            assert rms == pytest.approx(compared.errors[quantity][i])
        assert len(ended.time_s) == compared.predictions
        assert ended.time_s[0] - judging.time_s[0] == pytest.approx(horizon_s, abs=0.06)


def test_shares_and_residuals_are_those_of_the_reports_heat_map(opened, compared):
    logs = [comparing_log(opened, name) for name in "ab"]
    model = vehicle.load(opened.vehicle)
    left = compared_by_sysid(logs, {"m": model}, Options(unseen="hold")).residuals["m"]
    names, shares = explained.shares(left[:1], left[1:])
    assert tuple(compared.variables) == names
    np.testing.assert_allclose(compared.shares, shares)
    for flight, one in zip(compared.flights, left, strict=True):
        np.testing.assert_allclose(np.transpose(flight.residual), one.means())
        modelled, measured = np.array(flight.modelled), np.array(flight.modelled) + flight.residual
        assert np.abs(modelled[2] - measured[2]).mean() < 0.1 * np.abs(measured[2]).mean()


def comparing_log(opened: project.Project, name: str) -> flight_log.FlightLog:
    log = flight_log.load(opened.flight(name))
    return flight_log.FlightLog(log.columns, {**log.metadata, "name": name})


def test_the_hidden_drag_shows_as_a_force_that_follows_the_velocity(compared):
    row = compared.shares[0]
    assert max(row) > 0.8
    found = residuals.scatter(compared, "F_x", "v_x", {})
    assert found.share == pytest.approx(row[compared.variables.index("v_x")])
    slope = np.polyfit(found.x, found.y, 1)[0]
    assert slope < -0.05  # drag pulls backwards
    assert sum(found.held_out[i] for i in found.flight) == len(compared.flights[1].time_s)
    with pytest.raises(InputError, match="no F_x against taste"):
        residuals.scatter(compared, "F_x", "taste", {})


def test_a_comparison_is_old_once_the_vehicle_or_the_choice_of_flights_is_another(opened, compared, monkeypatch):
    listed = Flights(opened, lambda _: None)
    shown = Comparing(opened, listed, MagicMock())
    listed._roles = {"b": "hold_out"}
    assert shown.state().state == "current"
    listed._roles = {}
    assert shown.state().state == "old"
    listed._roles = {"b": "hold_out"}
    status = opened.flight("b").stat()
    os.utime(opened.flight("b"), ns=(0, 0))  # another log of the same name
    assert shown.state().state == "old"
    os.utime(opened.flight("b"), ns=(status.st_atime_ns, status.st_mtime_ns))
    before = opened.vehicle.read_bytes()
    vehicle.save(opened.vehicle, vehicle.example())
    assert shown.state().state == "old"
    opened.vehicle.write_bytes(before)
    assert residuals.load(comparing.comparison_file(opened.folder)) == compared


def test_force_and_residual_are_streams_of_a_compared_flight(opened, compared):
    listed = Flights(opened, lambda _: None)
    shown = Comparing(opened, listed, MagicMock())
    found = shown.opened("a")
    assert {"F_x", "residual_F_x", "rotor_0"} <= {stream.key for stream in found.streams}
    force, rotor, left = shown.read("a", ["F_x", "rotor_0", "residual_F_x"], found.start_s, found.end_s, 500)
    assert [part.key for part in (force, rotor, left)] == ["F_x", "rotor_0", "residual_F_x"]
    model, measured = (np.array(curve.values) for curve in force.curves)
    np.testing.assert_allclose(measured - model, np.array(left.curves[0].values, dtype=float))
    assert left.band is not None
    assert left.band > 0.0


def test_a_try_has_the_figures_of_the_verb_and_keeps_nothing(opened, learning):
    before = opened.vehicle.read_bytes()
    kept = try_effect._run(opened.folder, try_effect.Arguments(["a"], ["b"], effect=DRAG), silent)
    said = told(
        "vehicle", "effect", "add", opened.vehicle, DRAG, opened.flight("a"), "--held-out",
        opened.flight("b"), "--dry-run", "--json",
    )  # fmt: skip
    assert kept.shown.verdict == said["verdict"]
    assert kept.shown.changes == said["changes"]
    for quantity, unit, shown in zip(kept.shown.quantities, kept.shown.units, kept.shown.after, strict=True):
        key = f"{quantity}_{QUANTITIES[quantity].replace('/', '_')}"
        assert shown == pytest.approx(SHOWN[quantity][1] * said["errors"]["refitted, with the change"][key])
        assert unit == SHOWN[quantity][0]
    assert HORIZON_S in HORIZONS_S
    assert opened.vehicle.read_bytes() == before
    assert learning.model().tried == kept.shown


def test_a_kept_try_is_a_version_that_can_be_undone(opened, learning):
    before = opened.vehicle.read_bytes()
    tried = learning.model().tried
    assert tried is not None
    with pytest.raises(InputError, match="another change was tried since"):
        learning.keep("of an earlier trial")
    opened.vehicle.write_bytes(before + b"# weighed again\n")
    with pytest.raises(InputError, match="vehicle file changed since"):
        learning.keep(tried.vehicle_hash)
    opened.vehicle.write_bytes(before)
    step = learning.keep(tried.vehicle_hash)
    now = learning.model()
    assert DRAG in now.effects
    assert now.tried is None
    assert [(v.number, v.current) for v in now.versions] == [(0, False), (1, True)]
    assert now.versions[1].position_mm == pytest.approx(tried.after[0])
    assert f"+ effect {DRAG}" in now.versions[1].changes
    assert step.held_out is not None
    with pytest.raises(InputError, match="no change is tried"):
        learning.keep(tried.vehicle_hash)
    learning.return_to(0)
    assert opened.vehicle.read_bytes() == before
    assert [(v.number, v.current, v.undone) for v in learning.model().versions] == [(0, True, False), (1, False, True)]


@pytest.mark.parametrize(
    ("kind", "arguments", "said"),
    [
        (compare.KIND, {"learn": []}, "no flight to learn from"),
        (compare.KIND, {"learn": ["a"], "held_out": ["a"]}, "same flight"),
        (compare.KIND, {"learn": ["none"]}, "no such file"),
        (try_effect.KIND, {"learn": ["a"], "effect": "../evil.py"}, "evil"),
        (try_effect.KIND, {"learn": ["a"], "effect": "thrust_bem"}, "already"),
    ],
)
def test_what_cannot_succeed_is_refused_before_the_queue(opened, kind, arguments, said):
    with pytest.raises(InputError, match=said):
        kind.check(opened, msgspec.convert(arguments, kind.arguments))


def trial(present: vehicle.Vehicle, changed: vehicle.Vehicle, file_sha256: str) -> KeptTrial:
    unjudged = changes.Change(changed, {}, None, (), None)
    return KeptTrial(diagnosis_values.tried(present, DRAG, unjudged, []), None, file_sha256)


def test_a_trial_of_a_vehicle_with_the_users_own_effect_can_be_kept(tmp_path):
    made = project.create(tmp_path / "project", "own")
    (made.folder / "guard.py").write_text(GUARD)
    present = vehicle.example().without_effect(DRAG).with_effect_file(made.folder / "guard.py")
    vehicle.save(made.vehicle, present)
    changed = present.with_effect(DRAG, source="assumed")
    kept = trial(present, changed, file_format.file_hash(made.vehicle))
    save_trial(made.folder, changed, kept)
    Learning(made, Flights(made, lambda _: None)).keep(kept.shown.vehicle_hash)
    assert vehicle.load(made.vehicle).effects == changed.effects
    assert vehicle.load(made.vehicle).effect_files == changed.effect_files


def test_gaps_are_taken_as_asked_when_an_effect_is_tried(opened, monkeypatch):
    asked: list[str] = []

    def refitted(*_: object, gaps: str, **__: object) -> None:
        asked.append(gaps)
        raise InputError("far enough")

    monkeypatch.setattr(changes, "refitted", refitted)
    for split in (False, True):
        with pytest.raises(InputError, match="far enough"):
            try_effect._run(opened.folder, try_effect.Arguments(["a"], [], split, effect=DRAG), silent)
    assert asked == ["refuse", "split"]


def test_a_flight_with_gaps_is_refused_in_the_words_of_the_page(opened, tmp_path):
    folder = shutil.copytree(opened.folder, tmp_path / "gaps")
    log = flight_log.load(opened.flight("a"))
    lost = (log.time_s > 2.0) & (log.time_s < 2.6)
    blanked = {name: np.where(lost, np.nan, values) for name, values in log.columns.items() if name != "time_s"}
    columns = {"time_s": log.time_s, **blanked}
    flight_log.save(folder / "flights" / "gap.parquet", flight_log.FlightLog(columns, log.metadata))
    box = 'the box "Take the pieces between them as flights of their own"'
    for work, asked in (
        (compare._run, Chosen(["gap"])),
        (diagnose._run, diagnose.Arguments(["gap"])),
        (try_effect._run, try_effect.Arguments(["gap"], effect=DRAG)),
        (identify._run, identify.Arguments(["gap"])),
    ):
        with pytest.raises(InputError, match="gap has no pose from") as said:
            work(folder, asked, silent)
        assert "gaps=" not in str(said.value)
        assert (box if work is not identify._run else 'the box "Fit the pieces between gaps"') in str(said.value)
    client = Path(comparing.__file__).parents[1] / "client" / "src" / "panels" / "compare" / "FlightList.tsx"
    assert "Take the pieces between them as flights of their own" in client.read_text(encoding="utf-8")


@pytest.mark.parametrize("channel", ["T", "T_2", "F_x_world", "M_y"])
@pytest.mark.parametrize("variable", ["n", "n_2", "s", "height"])
def test_a_curve_of_any_channel_is_shown_in_the_reports_units(channel, variable):
    at = np.linspace(0.0, 1.0, 5)
    found = OutsideFinding(channel, variable, "", at, 0.02 * at, 0.001 * at, 1.0, 5.0, 1e-6, 0.9)
    shown = diagnosis_values._outside(found)
    scale, unit = residual_plots.unit(channel)
    assert (shown.unit, shown.variable.name, shown.variable.unit) == (unit, variable, UNIT[variable])
    assert shown.words == words.channel(channel)
    np.testing.assert_allclose(shown.y, scale * 0.02 * at)


@pytest.mark.slow
def test_the_diagnosis_has_the_verdict_and_the_figures_of_the_verb(opened, learning):
    shown = diagnose._run(opened.folder, diagnose.Arguments(["a"], ["b"]), silent)
    said = told(
        "diagnose", opened.flight("a"), "--vehicle", opened.vehicle, "--held-out", opened.flight("b"),
        "--auto", "--json",
    )  # fmt: skip
    assert shown.probability == pytest.approx(said["confidence"])
    assert [(c.name, c.verdict) for c in shown.candidates] == [(c["name"], c["verdict"]) for c in said["candidates"]]
    for ours, verbs in zip(shown.candidates, said["candidates"], strict=True):
        assert [s.value for s in ours.sizes] == pytest.approx([s["value"] for s in verbs["sizes"].values()])
        assert ours.probability == pytest.approx(verbs["confidence"])
    stairs = [list(s["position_error_m"].values()) for s in said["staircase"]]
    np.testing.assert_allclose([s.errors_mm for s in shown.staircase], 1e3 * np.array(stairs))
    (drag,) = [c for c in shown.candidates if c.name == DRAG]
    assert drag.evidence is not None
    assert np.polyfit(drag.evidence.x, drag.evidence.y, 1)[0] < 0.0
    assert len(drag.evidence.held_x) == len(drag.evidence.held_before) == len(drag.evidence.held_after) > 0
    learning._flights._roles = {"b": "hold_out"}
    assert learning.diagnosis() == msgspec.structs.replace(shown, has_report=True)
    os.utime(opened.flight("b"), ns=(0, 0))
    assert learning.diagnosis().state == "old"
