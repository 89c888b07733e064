"""From a curve to an equation: planted laws come back with their size, and the file of one computes what it says."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

import vehicle
from flight import FormatError, InputError
from sysid import Options, identify
from sysid.diagnosis import equation_text
from sysid.diagnosis.equation import Equation, Rival, Term, equation
from sysid.diagnosis.evidence.forms import FLIPPED, Form, forms, parity
from sysid.diagnosis.evidence.laws import Axis
from sysid.diagnosis.examined import examine, stated_curve
from sysid.diagnosis.procedure import while_searching
from tests.sysid import flying
from vehicle import Surroundings
from vehicle import forces as physics

VELOCITY, RATE, SPEED = np.array([[1.3, -0.7, 0.4]]), np.array([[0.5, -0.4, 0.9]]), np.full((1, 4), 2.5)
AROUND = Surroundings(
    np.array([[np.cos(0.3), 0.0, 0.0, np.sin(0.3)]]), np.array([1.2]), np.array([np.inf]), np.full((1, 4), 1.5)
)
VALUE = {"v_x": 1.3, "v_y": -0.7, "w_z": 0.9, "speed": float(np.linalg.norm(VELOCITY)), "height": 1.2, "n_1": 2.5}
VALUE |= {"heading": 0.6, "v_x v_y": -0.91, "dn_2/dt": 1.5}
CARRIER = {"": 1.0, "n": 2.5, "speed": VALUE["speed"]}


def law(form: Form, axis: Axis, shape: float = 0.0, coefficient: float = 0.02, *rivals: Rival) -> Equation:
    return Equation(form, shape, (Term(axis, coefficient, 0.002),), False, "", 0.8, rivals, 8.0, 9.6, 1.0)


def form_of(variable: str, formula: str) -> Form:
    return next(form for form in forms(variable) if form.formula == formula)


@pytest.mark.parametrize("variable", list(VALUE))
def test_the_file_computes_the_law_in_its_channel_only(tmp_path: Path, variable: str):
    plain = vehicle.example()
    for i, form in enumerate(forms(variable)):
        shape = 1.6 if form.shapes else 0.0
        name = f"law_{list(VALUE).index(variable)}_{i}"
        drawn = plain.with_effect_file(
            equation_text.scaffold(law(form, Axis("F_y", variable), shape), tmp_path / f"{name}.py", name=name)
        )
        more, less = (np.concatenate(physics.wrench_numpy(v, VELOCITY, RATE, SPEED, AROUND), 1) for v in (drawn, plain))
        expected = np.zeros(6)
        value = form.values(np.array([VALUE[variable]]), shape)[0]
        expected[1] = 0.02 * CARRIER[form.carrier] * value
        assert (more - less)[0] == pytest.approx(expected, abs=1e-8), form.formula
        assert np.isfinite(
            vehicle.wrench_jacobian(drawn, 0.0 * VELOCITY, RATE, SPEED, surroundings=AROUND).velocity
        ).all()


def test_one_coefficient_serves_both_axes_with_the_sign_of_a_quarter_turn(tmp_path: Path):
    terms = (Term(Axis("M_x", "v_y"), -0.03, 0.001), Term(Axis("M_y", "v_x", -1.0), -0.03, 0.001))
    both = Equation(form_of("v_y", "x"), 0.0, terms, True, "", 0.9, (), 5.0, 0.0, 1.0)
    file = equation_text.scaffold(both, tmp_path / "quarter.py", name="quarter")
    drawn, plain = vehicle.example().with_effect_file(file), vehicle.example()
    more, less = (physics.wrench_numpy(v, VELOCITY, RATE, SPEED, AROUND)[1][0] for v in (drawn, plain))
    assert more - less == pytest.approx([-0.03 * -0.7, 0.03 * 1.3, 0.0], abs=1e-9)
    assert equation_text.sentence(both).startswith("M_x = -a v_y, M_y = a v_x, a = 0.03 ± 0.001 N s (90%)")
    assert [p for p in drawn.parameters if p.startswith("quarter.")] == ["quarter.a_n_s"]


def test_a_rival_is_said_with_the_speed_that_would_tell():
    rival = Rival(form_of("v_x", "tanh(x/s)"), 2.0, -0.5, 0.15)
    said = equation_text.sentence(law(form_of("v_x", "x |x|"), Axis("F_x", "v_x"), 0.0, -0.021, rival))
    assert said == (
        "F_x = -a v_x |v_x|, a = 0.021 ± 0.002 N s2/m2 (80%); tanh(v_x/2) (15%) fits as well: to tell, "
        "fly fast_level to v_x = 9.6 m/s (now 8)"
    )


def test_symmetry_says_which_laws_are_odd():
    assert parity("F_x", "v_x") == parity("M_x", "w_x") == parity("M_y", "v_x") == "odd"
    assert parity("F_z", "v_x") == "even"
    assert parity("F_z", "v_z") == parity("M_z", "v_z") == "either"
    assert all(parity(one, other) == parity(other, one) for one in FLIPPED[0] for other in FLIPPED[0])


def test_plain_values_give_the_equation_back_and_damage_is_refused():
    rival = Rival(form_of("v_x", "x^3"), 0.0, -0.5, 0.15)
    found = law(form_of("v_x", "tanh(x/s)"), Axis("F_x", "v_x"), 2.0, -0.4, rival)
    facts = equation_text.as_dict(found)
    assert equation_text.from_dict(facts) == found
    code = "__import__('os').getcwd()"
    for wrong in ({"formula": code}, {"shape": float("nan")}, {"terms": []}, {"rivals": None}):
        with pytest.raises(FormatError, match="no usable equation"):
            equation_text.from_dict(facts | wrong)
    with pytest.raises(FormatError, match="no usable equation"):
        equation_text.from_dict({})


def test_a_name_or_file_that_is_taken_is_refused(tmp_path: Path):
    found = law(form_of("v_x", "x"), Axis("F_x", "v_x"))
    with pytest.raises(InputError, match="taken by the catalogue"):
        equation_text.scaffold(found, tmp_path / "motor_lag.py", name="motor_lag")
    assert not list(tmp_path.iterdir())


def climbing(v: np.ndarray, w: np.ndarray, n: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    return 0.0 * v, 0.004 * v[:, 2:] * [0.0, 0.0, 1.0]


def damping(v: np.ndarray, w: np.ndarray, n: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    return 0.0 * v, -np.array([0.003, 0.004, 0.002]) * np.sign(w) * np.abs(w) ** 1.5


@pytest.mark.slow
@pytest.mark.parametrize(
    ("extra", "formula", "size"),
    [(climbing, "x", {"M_z": 0.004}), (damping, "x |x|^(s-1)", {"M_x": -0.003, "M_y": -0.004, "M_z": -0.002})],
)
def test_a_planted_law_is_found_with_its_size_along_every_axis(extra: Callable, formula: str, size: dict[str, float]):
    rng = np.random.default_rng(4)
    truth = flying.Truth(extra=extra, gust=0.2)
    logs = flying.fly(truth, flying.paper_flights(rng), 3, duration_s=12.0, rng=rng, rate_hz=100.0)
    model = examine(identify(logs, vehicle.example(), while_searching(Options(gusts="white"))))
    curve = stated_curve(model)
    assert curve is not None
    found = equation(model, curve)
    assert found is not None
    assert found.form.formula == formula
    assert {t.axis.channel: t.coefficient for t in found.terms} == pytest.approx(size, rel=0.06)
    assert found.probability > 0.6
