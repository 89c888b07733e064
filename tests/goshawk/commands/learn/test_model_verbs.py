"""`goshawk vehicle` as a user runs it: add, judge, undo; and what did not help is said to have not helped."""

import contextlib
import io
import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import sysid
import vehicle
from flight import FlightLog, flight_log
from goshawk.cli import main
from goshawk.commands.learn import model_change
from sysid.estimator import fit_to_use
from sysid.estimator.validation import changes
from vehicle import flights, history, manoeuvres

DRAG = "rotor_drag_thrust"
BOB = [(1.25, 1.0), (1.25, -1.0)] * 2


def goshawk(*arguments: object, code: int = 0) -> str:
    """What the verb says, on standard error where it fails; judged by exit code, as the program would end."""
    out, err = streams(*arguments, code=code)
    return out if code == 0 else err


def streams(*arguments: object, code: int) -> tuple[str, str]:
    out, err = io.StringIO(), io.StringIO()
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err), pytest.raises(SystemExit) as ended:
        main(["vehicle", *map(str, arguments)])
    assert ended.value.code == code, out.getvalue() + err.getvalue()
    return out.getvalue(), err.getvalue()


def told(*arguments: object) -> dict:
    return json.loads(goshawk(*arguments, "--json"))


@pytest.fixture(scope="module")
def flown(tmp_path_factory) -> Path:
    """A truth with rotor drag, two flights of it, and a vehicle file without."""
    folder = tmp_path_factory.mktemp("flown")
    truth = vehicle.example()
    rng = np.random.default_rng(5)
    for name, size in (("a", 9.0), ("b", -7.0)):
        weave = manoeuvres.from_legs(x=[(2.5, size), (2.5, -size)], y=[(1.0, 0.0), (2.0, 4.0), (2.0, -4.0)], z=BOB)
        flight = flights.fly_trajectory(truth, weave)
        flight_log.save(folder / f"{name}.parquet", flights.measure(flight, rng=rng))
    return folder


@pytest.fixture
def file(tmp_path):
    path = tmp_path / "kestrel.toml"
    vehicle.save(path, vehicle.example().without_effect(DRAG))
    return path


def logs(flown: Path) -> tuple[object, ...]:
    return (flown / "a.parquet", "--held-out", flown / "b.parquet")


def test_the_missing_effect_helps_on_a_flight_that_was_not_used_and_undo_brings_the_file_back(file, flown):
    before = file.read_bytes()
    found = told("effect", "add", file, DRAG, *logs(flown))
    assert found["verdict"].startswith("helped")
    assert found["compensated"] is True
    errors = found["errors"]
    assert errors[changes.AFTER]["position_m"] < 0.3 * errors[changes.BEFORE]["position_m"]
    learned = vehicle.load(file).parameter(f"{DRAG}.drag_s_m")
    assert abs(learned.value - 0.0175) < 5.0 * learned.std
    assert told("undo", file, "--yes")["restored"] == 0
    assert file.read_bytes() == before


def fit_ends_early(monkeypatch: pytest.MonkeyPatch, model_has_drag: bool) -> None:
    """The fit of the model with (or without) rotor drag stops after one iteration, far from its minimum."""
    fit = sysid.identify

    def identify(logs, believed, options, **further):
        early = replace(options, max_iterations=1) if (DRAG in believed.effects) == model_has_drag else options
        return fit(logs, believed, early, **further)

    for module in (changes, fit_to_use):
        monkeypatch.setattr(module, "identify", identify)


def test_a_refit_that_did_not_converge_is_written_only_when_asked(file, flown, monkeypatch):
    fit_ends_early(monkeypatch, model_has_drag=True)
    before, arguments = file.read_bytes(), ("effect", "add", file, DRAG, flown / "a.parquet")
    refused = json.loads(streams(*arguments, "--json", code=1)[0])
    assert refused["fit"]["use"] == "do not use"
    assert "converge" in refused["fit"]["reasons"][0]
    assert refused["version"] is None
    assert file.read_bytes() == before
    words, _ = streams(*arguments, code=1)
    assert words.startswith("verdict on the refit: do not use\n")
    assert "--anyway" in words
    assert f"written: {file}, version 1" in streams(*arguments, "--anyway", code=1)[0]
    assert DRAG in vehicle.load(file).effects


def test_a_refit_to_a_log_that_contradicts_the_vehicle_is_refused_as_identify_refuses_it(file, flown: Path):
    log = flight_log.load(flown / "a.parquet")
    rpm = {f"rotor_speed_{i}_rad_s": 30.0 / np.pi * log.columns[f"rotor_speed_{i}_rad_s"] for i in range(4)}
    flight_log.save(flown / "rpm.parquet", FlightLog({**log.columns, **rpm}, log.metadata))
    path = flown / "rpm.parquet"
    chosen = changes.Flights({path: flight_log.load(path)}, {})
    found = changes.refitted(vehicle.load(file), vehicle.example(), chosen)
    assert found.fit is not None
    assert found.fit.misread


def test_a_comparison_with_a_refit_that_did_not_converge_is_doubtful(file, flown, monkeypatch):
    fit_ends_early(monkeypatch, model_has_drag=False)
    found = told("effect", "add", file, DRAG, *logs(flown))
    assert found["fit"]["use"] == "doubtful"
    assert any("compared with" in reason for reason in found["fit"]["reasons"])


def test_an_effect_that_is_not_there_does_not_help(file, flown):
    goshawk("effect", "add", file, DRAG, "--set", "drag_s_m=0.0175")
    said = goshawk("effect", "add", file, "gyroscopic_torque", *logs(flown))
    assert "did not" in said
    assert "NOT compensated by the controller" in said


def test_the_history_is_a_staircase_on_any_flights(file, flown):
    goshawk("effect", "add", file, DRAG, "--set", "drag_s_m=0.0175")
    goshawk("effect", "remove", file, "parasitic_drag", "--yes")
    picture = file.parent / "stairs.svg"
    found = told("history", file, flown / "b.parquet", "--figure", picture)
    position = [found["errors"][str(n)]["position_m"] for n in range(3)]
    assert position[1] < position[2] < position[0]
    assert "<svg" in picture.read_text()
    assert [step["action"] for step in found["steps"]] == ["start", "add-effect", "remove-effect"]
    assert "rotor_drag_thrust" in goshawk("history", file)


def test_a_law_of_thrust_that_is_removed_leaves_the_simpler_one_behind(file):
    hover = vehicle.invert.hover(vehicle.load(file))
    goshawk("effect", "remove", file, "thrust_bem", "--yes")
    left = vehicle.load(file)
    assert {"thrust_bem", "thrust_quadratic"} & set(left.effects) == {"thrust_quadratic"}
    assert vehicle.invert.hover(left) == pytest.approx(hover, rel=1e-3)


def test_a_preview_writes_nothing(file):
    before = file.read_bytes()
    assert "nothing was written" in goshawk("effect", "add", file, DRAG, "--dry-run")
    assert "- effect parasitic_drag" in goshawk("effect", "remove", file, "parasitic_drag", "--dry-run")
    assert file.read_bytes() == before
    assert [p.name for p in file.parent.iterdir()] == [file.name]


def test_values_are_set_by_name_each_time_as_one_version_that_can_be_undone(file):
    before = file.read_bytes()
    assert told("set", file, "mass_kg=0.72", "limits.speed_m_s=12", "gravity_m_s2=9.79")["version"] == 1
    changed = vehicle.load(file)
    assert (changed.mass_kg, changed.limits.speed_m_s, changed.gravity_m_s2) == (0.72, 12.0, 9.79)
    assert changed.parameter("mass_kg").source == "set by hand"
    goshawk("set", file, "mass_kg=0.9", "--dry-run")
    assert vehicle.load(file).mass_kg == 0.72
    for wrong in ("wings=2", "limits.wings=2", "mass_kg", "mass_kg=nan", "gravity_m_s2=3"):
        goshawk("set", file, "limits.speed_m_s=9", wrong, code=2)
    assert vehicle.load(file).limits.speed_m_s == 12.0
    goshawk("undo", file, "--yes")
    assert file.read_bytes() == before


def test_a_destructive_change_needs_confirmation(file):
    before = file.read_bytes()
    assert "--yes" in goshawk("effect", "remove", file, "parasitic_drag", code=2)
    assert file.read_bytes() == before


def test_show_lists_values_sources_and_compensations(file):
    found = told("show", file)
    assert found["parameters"]["mass_kg"] == {
        "value": 0.7,
        "std": 0.0,
        "unit": "kg",
        "source": "Rigter et al. 2019, weighed",
    }
    assert all(effect["compensated"] for effect in found["effects"])
    assert found["rotors"][0] == {"x_m": 0.0885, "y_m": 0.0885, "z_m": 0.0, "spin": "clockwise"}
    goshawk("effect", "add", file, "gyroscopic_torque")
    effects = {effect["name"]: effect for effect in told("show", file)["effects"]}
    assert effects["gyroscopic_torque"]["compensated"] is False
    assert effects["gyroscopic_torque"]["how"] == "attitude feedback takes it"


def test_show_says_what_a_model_is_not_for(file):
    fitted = vehicle.load(file).with_value("inertia_zz_kg_m2", 0.08, source="identified from lap")
    vehicle.save(file, vehicle.purpose.marked(fitted, {"inertia_zz_kg_m2": "c_q / I_zz = 3.9e-07 ± 1 % is known"}))
    assert told("show", file)["not_for_design"] == {"inertia_zz_kg_m2": "c_q / I_zz = 3.9e-07 ± 1 % is known"}
    assert "is for prediction, not for design: inertia_zz_kg_m2 (c_q / I_zz" in goshawk("show", file)
    goshawk("set", file, "inertia_zz_kg_m2=0.0044")
    assert told("show", file)["not_for_design"] == {}


def test_an_effect_of_ones_own_comes_as_a_file(file):
    (file.parent / "guard.py").write_text(OWN)
    assert told("effect", "add", file, file.parent / "guard.py", "--set", "drag_kg_m=0.03")["compensated"] is False
    assert vehicle.load(file).value("side_guard_here.drag_kg_m") == 0.03
    goshawk("effect", "remove", file, "side_guard_here", "--yes")
    assert vehicle.load(file).effect_files == ()


OWN = """
from vehicle.effects.base import Effect, Spec, Stage

def apply(flow, p):
    flow.force_n[1] -= p.drag_kg_m * flow.velocity_m_s[1]

EFFECT = Effect(name="side_guard_here", number=0, stage=Stage.FORCE, apply=apply,
    parameters=(Spec("drag_kg_m", "N s/m", prior=0.02, bounds=(0.0, 1.0)),),
    law="F_y = -c v_y", source="here", channel="F_y", regressor="v_y", excited_by=("fast_level",))
"""


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("effect", "add", "{file}", "rotor_drag"), "near it: rotor_drag_thrust"),
        (("effect", "add", "{file}", DRAG, "--set", "drag=0.1"), "it has drag_s_m"),
        (("effect", "add", "{file}", DRAG, "--set", "drag_s_m"), "NAME=VALUE"),
        (("effect", "add", "{file}", "parasitic_drag"), "already"),
        (("effect", "remove", "{file}", DRAG, "--yes"), "not active"),
        (("undo", "{file}", "--yes"), "nothing to undo"),
        (("show", "{folder}/none.toml"), "does not exist"),
        (("effect", "add", "{file}", DRAG, "{a}", "--held-out", "{a}"), "cannot be both"),
    ],
)
def test_bad_input_is_refused_in_one_sentence(file, flown, arguments, words):
    said = [a.format(file=file, folder=file.parent, a=flown / "a.parquet") for a in arguments]
    assert words in goshawk(*said, code=2)


@pytest.mark.parametrize(
    ("after", "words"),
    [
        ({"position_m": 0.5, "velocity_m_s": 1.0}, "helped: position −50%"),
        ({"position_m": 0.995, "velocity_m_s": 1.0}, "did not help"),
        ({"position_m": 0.9, "velocity_m_s": 1.2}, "did not clearly help"),
        ({"position_m": 1.1, "velocity_m_s": 1.0}, "made the model worse"),
    ],
)
def test_the_verdict_considers_every_quantity(after, words):
    assert words in changes.verdict({"position_m": 1.0, "velocity_m_s": 1.0}, after)


def test_every_effect_and_number_that_differs_is_listed_once():
    old = vehicle.example()
    new = old.without_effect("rotor_drag_thrust").with_effect("flapping_moment").with_value("mass_kg", 0.9)
    lines = history.differences(old, new)
    assert [line for line in lines if line.startswith(("+", "-"))] == [
        "+ effect flapping_moment",
        "- effect rotor_drag_thrust",
    ]
    assert "  mass_kg: 0.7 -> 0.9 kg" in lines
    assert history.differences(old, old) == []


def test_prediction_errors_are_told_in_units_that_people_read():
    quantities = {"position": 0.0123, "velocity": 0.5, "attitude": np.pi / 180.0, "rate": 0.25}
    told = [model_change.prediction_error(name, value) for name, value in quantities.items()]
    assert told == ["12.3 mm", "0.5 m/s", "1 deg", "0.25 rad/s"]
