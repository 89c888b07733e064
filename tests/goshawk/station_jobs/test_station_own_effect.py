"""An effect of a curve that no known effect explains: drafted, read, agreed to, tried, kept, and used everywhere."""

import hashlib
from collections.abc import Iterator
from contextlib import closing

import msgspec
import numpy as np
import pytest

import planner
import vehicle
from esdf import solids
from flight import FormatError, InputError, Waypoints, file_format, flight_log, project, silent
from gcs_web.flights import reading
from gcs_web.flights.flights import Flights
from gcs_web.learning import diagnosis_values, learning
from gcs_web.learning.consent import Consent
from gcs_web.learning.learning import Learning
from gcs_web.protocol.learning import Diagnosis
from goshawk.station_jobs import compare, try_effect
from goshawk.station_jobs.flights import Chosen
from sysid.diagnosis import OutsideFinding, curve
from sysid.diagnosis.equation import Equation, Term
from sysid.diagnosis.evidence.forms import forms
from sysid.diagnosis.evidence.laws import Axis
from tests.goshawk.station_jobs.test_station_learning import BOB
from vehicle import flights, manoeuvres, simulate

DRAG_N_S_M = 0.25
GUARD = """
from vehicle.effects.base import Effect, Spec, Stage

def apply(flow, p):
    flow.force_n[1] -= p.drag_n_s_m * flow.velocity_m_s[1]

EFFECT = Effect(name="hidden_side_guard", number=0, stage=Stage.FORCE, apply=apply,
    parameters=(Spec("drag_n_s_m", "N s/m", prior=0.02, bounds=(0.0, 1.0)),),
    law="F_y = -c v_y", source="here", channel="F_y", regressor="v_y", excited_by=("fast_level",))
"""
AT = np.linspace(-4.0, 4.0, 33)
CHOSEN = {"learn": ["a"], "held_out": ["b"]}


LAW = Equation(forms("v_y")[0], 0.0, (Term(Axis("F_y", "v_y"), -DRAG_N_S_M, 0.002),), False, "", 0.9, (), 4.0, 0.0, 1.0)
"""The hidden law, as a diagnosis would propose it."""


def finding(channel: str = "F_y", variable: str = "v_y", unit: str = "m/s") -> OutsideFinding:
    """The curve of the hidden law, as a diagnosis would draw it."""
    mass_kg = vehicle.example().value("mass_kg")
    return OutsideFinding(
        channel, variable, unit, AT, -DRAG_N_S_M * AT / mass_kg, np.full(len(AT), 0.01), mass_kg, 9.0, 1e-6, 0.9
    )


def diagnosed(opened: project.Project, found: OutsideFinding) -> None:
    """Save a diagnosis of the project as it is now, with this curve."""
    shown = Diagnosis(
        "current",
        "Something unknown is missing.",
        learn=["a"],
        held_out=["b"],
        outside=diagnosis_values._outside(found),
        equation=diagnosis_values._equation(LAW),
        vehicle=vehicle.vehicle_hash(vehicle.load(opened.vehicle)),
        logs=reading.contents(opened, ["a", "b"]),
    )
    learning.diagnosis_file(opened.folder).parent.mkdir(exist_ok=True)
    file_format.write_bytes(learning.diagnosis_file(opened.folder), msgspec.json.encode(shown))


@pytest.fixture(scope="module")
def opened(tmp_path_factory) -> project.Project:
    """Two flights of a vehicle with a drag that no effect of the catalogue is, and a model without."""
    made = project.create(tmp_path_factory.mktemp("own") / "project", "own effect")
    made.flight("a").parent.mkdir()
    guard = made.folder.parent / "hidden_side_guard.py"
    guard.write_text(GUARD)
    believed, rng = vehicle.example(), np.random.default_rng(8)
    truth = believed.with_effect_file(guard, drag_n_s_m=DRAG_N_S_M)
    for name, size in (("a", 9.0), ("b", -7.0)):
        weave = manoeuvres.from_legs(x=[(1.0, 0.0), (2.0, 4.0), (2.0, -4.0)], y=[(2.5, size), (2.5, -size)], z=BOB)
        flight_log.save(made.flight(name), flights.measure(flights.fly_trajectory(truth, weave), rng=rng))
    vehicle.save(made.vehicle, believed)
    return made


@pytest.fixture
def learned(opened) -> Iterator[Learning]:
    listed = Flights(opened, lambda _: None)
    listed.set_role("b", "hold_out")
    diagnosed(opened, finding())
    yield Learning(opened, listed)
    listed.close()


def test_the_curve_on_the_page_is_that_of_the_verb(opened, learned, tmp_path):
    shown = learned.diagnosis().outside
    assert shown is not None
    assert shown.effect == "f_y_of_v_y"
    facts, whole = diagnosis_values.curve_facts(shown), finding().as_dict()
    assert (facts["channel"], facts["variable"], facts["variable_unit"]) == ("F_y", "v_y", "m/s")
    for key in ("at", "residual", "residual_sigma"):
        np.testing.assert_allclose(facts[key], whole[key], rtol=1e-12)


@pytest.mark.parametrize(
    ("channel", "variable", "why"), [("F_x_world", "v_x", "tether"), ("F_y", "time", "drifts with time")]
)
def test_a_curve_that_no_vehicle_can_know_offers_no_effect_and_says_why(opened, learned, channel, variable, why):
    diagnosed(opened, finding(channel, variable, "s" if variable == "time" else "m/s"))
    shown = learned.diagnosis().outside
    assert shown is not None
    assert shown.effect == ""
    assert why in shown.advice
    with pytest.raises(InputError, match="cannot become an effect"):
        learned.draft_effect("any_name", "spline")


def test_the_proposed_equation_becomes_an_effect_of_its_own_law(opened, learned):
    shown = learned.diagnosis().equation
    assert shown is not None
    assert shown.effect == "f_y_of_v_y"
    assert "F_y = -a v_y, a = 0.25" in shown.sentence
    file = learned.draft_effect("side_guard_law", "equation")
    drawn = vehicle.example().with_effect_file(file)
    guarded = vehicle.example().with_effect_file(opened.folder.parent / "hidden_side_guard.py", drag_n_s_m=DRAG_N_S_M)
    assert sideways_m_s(drawn) == pytest.approx(sideways_m_s(guarded), rel=1e-9)
    file.unlink()


def test_without_an_equation_none_is_drafted(opened, learned):
    saved = learning.diagnosis_file(opened.folder)
    saved.write_bytes(msgspec.json.encode(msgspec.structs.replace(learned.diagnosis(), equation=None)))
    with pytest.raises(InputError, match="proposes no equation"):
        learned.draft_effect("any_name", "equation")


@pytest.mark.parametrize("name", ["../out", "Big", "", "parasitic_drag", "a b", "x.py", "\u202ename"])
def test_a_name_that_is_none_writes_nothing(opened, learned, name):
    with pytest.raises(InputError, match=r"cannot name an effect|taken by the catalogue"):
        learned.draft_effect(name, "spline")
    assert not list(opened.folder.rglob("*.py"))


def test_text_in_a_diagnosis_never_becomes_code():
    facts = finding().as_dict()
    for key, hostile in (("variable_unit", "m/s\nimport os"), ("channel", 'F_y"\nimport os'), ("variable", "v_y\nx")):
        with pytest.raises((FormatError, InputError)):
            curve.scaffold(facts | {key: hostile}, "never_written.py", name="never_written")


def sideways_m_s(model: vehicle.Vehicle) -> float:
    """Speed along y, 2 m/s at first, after 0.1 s."""
    plant = simulate.Plant(model, simulate.State(velocity_world_m_s=np.array([0.0, 2.0, 0.0])))
    plant.step(np.full(4, 800.0), 0.1)
    return float(plant.velocity_world_m_s[1])


def test_a_drafted_effect_is_read_agreed_to_tried_kept_and_used(opened, learned):
    with closing(Consent(opened)) as asked:
        file = learned.draft_effect("side_guard_drawn", "spline")
        with pytest.raises(InputError, match="exists already"):
            learned.draft_effect("side_guard_drawn", "spline")
        (shown,) = asked.files()
        assert (shown.name, shown.needed, shown.agreed) == ("side_guard_drawn.py", False, False)
        assert "# m/s" in shown.text
        asking = try_effect.Arguments(**CHOSEN, effect="side_guard_drawn.py")
        with pytest.raises(InputError, match="nobody has agreed"):
            try_effect._check(opened, asking)
        asked.agree(str(file), hashlib.sha256(file.read_bytes()).hexdigest())
        try_effect._check(opened, asking)
        kept = try_effect._run(opened.folder, asking, silent)
        at = kept.shown.quantities.index("position")
        assert kept.shown.after[at] < 0.2 * kept.shown.before[at]
        assert asked.files()[0].needed  # the change that is tried names it
        learned.keep(kept.shown.vehicle_hash)
        model = learned.model()
        assert "side_guard_drawn" in model.effects
        scale = next(row for row in model.parameters if row.name == "side_guard_drawn.scale")
        assert (scale.value, scale.unit) == (pytest.approx(1.0, abs=0.15), "1")  # rotor drag takes a part
        with pytest.raises(InputError, match="has side_guard_drawn already"):
            try_effect._check(opened, asking)

        changed = vehicle.load(opened.vehicle)
        line = Waypoints(np.array([[1.0, 1.0, 1.0], [1.0, 5.0, 1.0], [5.0, 5.0, 1.5]]), np.full(3, np.nan))
        room = solids.Scene([solids.Room((0.0, 0.0, 0.0), (6.0, 6.0, 2.5))])
        assert planner.plan(line, room, changed).gate.passed
        assert sideways_m_s(changed) < sideways_m_s(vehicle.example()) * np.exp(-0.8 * 0.1 * DRAG_N_S_M / 0.7)
        assert learned.diagnosis().state == "old"
        found = compare._run(opened.folder, Chosen(**CHOSEN), silent)
        assert found.vehicle == vehicle.vehicle_hash(changed)
        assert found.rms[1] < 0.1
