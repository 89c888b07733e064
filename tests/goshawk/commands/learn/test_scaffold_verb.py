"""`goshawk vehicle effect scaffold` as a stranger uses it: from a diagnosis in JSON to an effect that can be added."""

import json
from pathlib import Path

import numpy as np
import pytest

import vehicle
from flight import flight_log
from goshawk.commands.learn import kept
from goshawk.terminal.screen import Screen
from sysid.diagnosis import equation_text
from sysid.diagnosis.equation import Equation, Term
from sysid.diagnosis.evidence.forms import forms
from sysid.diagnosis.evidence.laws import Axis
from tests.goshawk.running import run, typed
from tests.journeys import inputs as journeys
from vehicle import flights, manoeuvres

AT = np.linspace(-2.0, 2.0, 80)
CURVE = {
    "channel": "M_z",
    "variable": "v_z",
    "variable_unit": "m/s",
    "at": AT.tolist(),
    "residual": (0.004 * AT).tolist(),
    "residual_sigma": np.full(80, 1e-4).tolist(),
}
"""A torque of 4 mN m per m/s of climb."""


@pytest.fixture
def folder(tmp_path, monkeypatch) -> Path:
    """A vehicle file and a diagnosis that draws a curve, in the folder where the user works."""
    vehicle.save(tmp_path / "vehicle.toml", vehicle.example("rigter2019"))
    diagnosis(tmp_path / "diagnosis.json", CURVE)
    monkeypatch.chdir(tmp_path)
    return tmp_path


def diagnosis(path: Path, outside: object, version: int = 2) -> None:
    verdict = "nothing that these flights could show is missing" if outside is None else "M_z against v_z"
    head = {"schema": "goshawk-diagnosis", "version": version}
    path.write_text(json.dumps({**head, "verdict": verdict, "outside": outside}))


def scaffolding(name: str = "climb_twist", *more: object, source: str = "diagnosis.json") -> list[object]:
    options = ["--diagnosis", source, "--name", name, "--out", f"{name}.py", *more]
    return ["vehicle", "effect", "scaffold", "vehicle.toml", *options]


def test_the_file_is_written_the_vehicle_untouched_and_the_next_line_adds_the_effect(folder):
    before = (folder / "vehicle.toml").read_bytes()
    said = run(*scaffolding())
    assert "climb_twist: M_z against v_z" in said
    assert (folder / "vehicle.toml").read_bytes() == before
    assert "EFFECT = Effect(" in (folder / "climb_twist.py").read_text()
    rng = np.random.default_rng(1)
    steps = manoeuvres.scaled(manoeuvres.make("throttle_steps"), 0.5)
    flown = flights.fly_trajectory(vehicle.example(), steps, rng=rng)
    flight_log.save(folder / "a.parquet", flights.measure(flown, rng=rng))
    document = json.loads(run(*scaffolding("climb_turn"), "--json"))
    words = typed(document["then"].replace("FLIGHT --held-out FLIGHT", "--held-out a.parquet"))
    assert "NOT compensated" in run(*words)  # an effect of one's own is unknown to the controller
    assert "climb_turn" in vehicle.load(folder / "vehicle.toml").effects


def test_the_diagnosis_that_was_kept_with_the_flights_is_read(folder):
    flight = folder / "a.parquet"
    flight.write_bytes(b"a flight")
    words = ("vehicle", "effect", "scaffold", "vehicle.toml", flight, "--name", "climb", "--out", "climb.py")
    assert "no diagnosis of" in run(*words, code=2)
    found = kept.Kept({"outside": CURVE}, Screen(), None, kept.about([flight], folder / "vehicle.toml"))
    kept.keep("diagnosis", flight, "0" * 64, found)
    run(*words)
    assert "EFFECT = Effect(" in (folder / "climb.py").read_text()


def test_one_command_keeps_the_proposed_equation_and_another_takes_it_back(folder):
    law = Equation(forms("v_z")[0], 0.0, (Term(Axis("M_z", "v_z"), 0.004, 2e-5),), False, "", 0.9, (), 2.0, 0.0, 1.0)
    rng = np.random.default_rng(1)
    flown = flights.fly_trajectory(vehicle.example(), journeys.lap_path(), rng=rng)
    flight_log.save(folder / "a.parquet", flights.measure(flown, rng=rng))
    document = {"outside": CURVE, "equation": equation_text.as_dict(law)}
    found = kept.Kept(document, Screen(), None, kept.about([folder / "a.parquet"], folder / "vehicle.toml"))
    kept.keep("diagnosis", folder / "a.parquet", "0" * 64, found)
    words = ("vehicle", "effect", "add", "vehicle.toml", "m_z_of_v_z.py", "a.parquet", "--proposed", "--anyway")
    run(*words, "--dry-run")
    assert not (folder / "m_z_of_v_z.py").exists()
    run(*words)
    assert "p.a_n_s * (x)" in (folder / "m_z_of_v_z.py").read_text()
    assert "m_z_of_v_z" in vehicle.load(folder / "vehicle.toml").effects
    run("vehicle", "effect", "remove", "vehicle.toml", "m_z_of_v_z", "--yes")
    assert "m_z_of_v_z" not in vehicle.load(folder / "vehicle.toml").effects


@pytest.mark.slow
def test_the_documented_lines_make_an_effect_of_a_kept_curve_and_add_it(folder, documented):
    """The first line's result is put in its place: what a diagnosis finds is tested elsewhere."""
    diagnose, scaffold, add = documented[0].commands
    for seed, name in enumerate(("a", "b")):
        rng = np.random.default_rng(seed)
        flown = flights.fly_trajectory(vehicle.example(), journeys.lap_path(), rng=rng)
        flight_log.save(folder / f"{name}.parquet", flights.measure(flown, rng=rng))
    flight = folder / typed(diagnose)[1]
    kept.keep(
        "diagnosis",
        flight,
        "0" * 64,
        kept.Kept({"outside": CURVE}, Screen(), None, kept.about([flight], folder / "vehicle.toml")),
    )
    run(*typed(scaffold))
    run(*typed(add))
    assert "climb_twist" in vehicle.load(folder / "vehicle.toml").effects


def test_a_diagnosis_of_the_first_version_is_read(folder):
    diagnosis(folder / "earlier.json", CURVE, version=1)
    run(*scaffolding("earlier", source="earlier.json"))
    run(*scaffolding("later"))
    assert (folder / "earlier.py").read_text().replace("earlier", "later") == (folder / "later.py").read_text().replace(
        "diagnosis.json", "later.json"
    )


def test_json_names_the_written_file(folder):
    document = json.loads(run(*scaffolding("bent", "--form", "polynomial", "--json")))
    assert {key: document[key] for key in ("effect", "channel", "variable", "form")} == {
        "effect": "bent",
        "channel": "M_z",
        "variable": "v_z",
        "form": "polynomial",
    }
    assert Path(document["written"]) == (folder / "bent.py").resolve()
    assert "COEFFICIENTS" in (folder / "bent.py").read_text()


def test_a_second_run_does_not_write_over_the_first(folder):
    run(*scaffolding())
    mine = (folder / "climb_twist.py").read_text() + "# improved by hand\n"
    (folder / "climb_twist.py").write_text(mine)
    assert "--overwrite" in run(*scaffolding(), code=2)
    assert (folder / "climb_twist.py").read_text() == mine


def test_bad_input_is_one_sentence_and_writes_nothing(folder):
    (folder / "broken.json").write_text("{")
    (folder / "other.json").write_text('{"schema": "goshawk-comparison"}')
    diagnosis(folder / "none.json", None)
    diagnosis(folder / "time.json", CURVE | {"variable": "time", "variable_unit": "s"})
    diagnosis(folder / "cut.json", CURVE | {"residual": [0.0, 1.0]})
    refused = {
        "absent.json does not exist": scaffolding(source="absent.json"),
        "broken.json is not JSON": scaffolding(source="broken.json"),
        "other.json is not a diagnosis": scaffolding(source="other.json"),
        "has no residual curve: nothing that these flights could show is missing": scaffolding(source="none.json"),
        "cannot become an effect": scaffolding(source="time.json"),
        "do not fit together": scaffolding(source="cut.json"),
        "cannot name an effect": scaffolding("Climb-Twist"),
        "is taken by the catalogue": scaffolding("angular_damping"),
        "give the FLIGHTS that were diagnosed, or --diagnosis FILE": [
            "vehicle",
            "effect",
            "scaffold",
            "vehicle.toml",
            "--name",
            "a",
            "--out",
            "a.py",
        ],
        "no.toml": ["vehicle", "effect", "scaffold", "no.toml", *scaffolding()[4:]],
    }
    for words, arguments in refused.items():
        said = run(*arguments, code=2)
        assert words in said
        assert said.strip().splitlines()[-1].startswith("goshawk: ")
        assert "Traceback" not in said
    assert not list(folder.glob("*.py"))
