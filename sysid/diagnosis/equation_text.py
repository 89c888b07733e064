"""An equation in words, as plain values, and as the file of an effect that an identification estimates anew."""

import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from flight import FormatError, file_format
from sysid.diagnosis import curve
from sysid.diagnosis.equation import Equation, Rival, Term
from sysid.diagnosis.evidence.forms import EXPONENT, Form, forms
from sysid.diagnosis.evidence.free_form import EVERY_CHANNEL, UNIT, unit
from sysid.diagnosis.evidence.laws import Axis

LETTERS = "abc"
"""Of the coefficients, one for each axis that has its own."""


def sentence(found: Equation) -> str:
    """The equation with its coefficients, how likely its form is, and what would tell it from the next one."""
    beside = f"besides {found.beside}, " if found.beside else ""
    laws = ", ".join(_law(found, i) for i in range(len(found.terms)))
    own = found.terms[:1] if found.is_isotropic else found.terms
    sizes = ", ".join(
        f"{letter} = {abs(t.coefficient):.3g} ± {t.sigma:.1g} {_unit(found, t)}".rstrip(" 1")
        for letter, t in zip(LETTERS, own, strict=False)
    )
    said = f"{beside}{laws}, {sizes} ({found.probability:.0%})"
    return f"{said}; {_rivals(found)}" if found.rivals else said


def _rivals(found: Equation) -> str:
    """The forms that nothing tells from it, and how far one would have to fly."""
    variable = found.variable
    forms_ = " or ".join(f"{_formula(r.form, r.shape, variable)} ({r.probability:.0%})" for r in found.rivals)
    flight = curve.READ[variable].excited_by
    return (
        f"{forms_} fits as well: to tell, fly {flight} to {variable} = {found.needed:.3g} {UNIT[variable]} "
        f"(now {found.reach:.3g})"
    )


def _law(found: Equation, i: int) -> str:
    term = found.terms[i]
    letter = LETTERS[0 if found.is_isotropic else i]
    sign = "-" if term.coefficient * term.axis.sign < 0.0 else ""
    return f"{term.axis.channel} = {sign}{letter} {_formula(found.form, found.shape, term.axis.variable)}"


def _formula(form: Form, shape: float, variable: str) -> str:
    """With the variable and the shape's value in it."""
    if form.kind == EXPONENT:
        return f"{variable} |{variable}|^{shape - 1.0:.2g}"
    value = f"{shape:.3g}"
    text = re.sub(r"\bs\b", value, form.formula)
    return re.sub(r"\bx\b", variable.replace(" ", "*"), text)


def _unit(found: Equation, term: Term) -> str:
    return coefficient_unit(found.form, term.axis)


def coefficient_unit(form: Form, axis: Axis) -> str:
    """`N s2/m2` of a force over the square of a speed."""
    powers = _powers(unit(axis.channel), 1)
    for name, exponent in (*_powers(UNIT[axis.variable], form.power).items(), *CARRIED[form.carrier]):
        powers[name] = powers.get(name, 0) - exponent
    above = " ".join(_power(n, p) for n, p in powers.items() if p > 0)
    below = " ".join(_power(n, -p) for n, p in powers.items() if p < 0)
    return f"{above or '1'}/{below}" if below else above or "1"


CARRIED = {"": (), "n": (("s", -1),), "speed": (("m", 1), ("s", -1))}
"""Powers of what a form is multiplied by; a radian is none."""


def _powers(text: str, times: int) -> dict[str, int]:
    """`m2/s2` as powers of its parts, radians left out."""
    found: dict[str, int] = {}
    for i, part in enumerate(text.split("/")):
        for word in part.split():
            name, exponent = re.fullmatch(r"([A-Za-z]+)(\d*)", word).groups() if word != "1" else ("", "")  # type: ignore[union-attr]
            if name not in ("", "rad"):
                found[name] = found.get(name, 0) + times * int(exponent or 1) * (-1 if i else 1)
    return found


def _power(name: str, exponent: int) -> str:
    return name if exponent == 1 else f"{name}{exponent}"


def as_dict(found: Equation) -> dict[str, Any]:
    """Plain JSON values; a form is told by its formula."""
    return {
        "sentence": sentence(found),
        "formula": found.form.formula,
        "shape": found.shape,
        "terms": [
            {
                "channel": t.axis.channel,
                "variable": t.axis.variable,
                "sign": t.axis.sign,
                "coefficient": t.coefficient,
                "sigma": t.sigma,
                "unit": _unit(found, t),
            }
            for t in found.terms
        ],
        "isotropic": found.is_isotropic,
        "beside": found.beside,
        "probability": found.probability,
        "rivals": [
            {"formula": r.form.formula, "shape": r.shape, "coefficient": r.coefficient, "probability": r.probability}
            for r in found.rivals
        ],
        "flown_to": found.reach,
        "fly_to": found.needed,
        "share": found.share,
    }


def from_dict(facts: Mapping[str, Any]) -> Equation:
    """Raises `FormatError` where something is missing, no number, or no form that is known."""
    try:
        terms = tuple(_term(t) for t in facts["terms"])
        variable = terms[0].axis.variable
        rivals = tuple(
            Rival(
                _form(variable, r["formula"]), _number(r["shape"]), _number(r["coefficient"]), _number(r["probability"])
            )
            for r in facts["rivals"]
        )
        numbers = [_number(facts[key]) for key in ("shape", "probability", "flown_to", "fly_to", "share")]
        return Equation(
            _form(variable, facts["formula"]), numbers[0], terms, bool(facts["isotropic"]), str(facts["beside"]),
            numbers[1], rivals, *numbers[2:],
        )  # fmt: skip
    except (KeyError, TypeError, ValueError, IndexError) as error:
        raise FormatError(f"the diagnosis holds no usable equation: {file_format.damage_text(error)}") from None


def _term(facts: Mapping[str, Any]) -> Term:
    channel, variable = str(facts["channel"]), str(facts["variable"])
    if channel not in EVERY_CHANNEL or variable not in curve.READ:
        raise ValueError(f"{channel} against {variable} is not known")
    axis = Axis(channel, variable, -1.0 if _number(facts["sign"]) < 0.0 else 1.0)
    return Term(axis, _number(facts["coefficient"]), _number(facts["sigma"]))


def _form(variable: str, formula: object) -> Form:
    return {form.formula: form for form in forms(variable)}[str(formula)]


def _number(value: Any) -> float:
    number = float(value)
    if not np.isfinite(number):
        raise ValueError(f"{value!r} is no number")
    return number


def suggested_name(found: Equation) -> str:
    """`f_x_of_v_x`; of several axes `f_of_v`."""
    channel, variable = found.channel, found.variable
    if len(found.terms) > 1:
        channel, variable = channel[0], variable[0]
    return f"{channel}_of_{variable}".lower().replace("/", "_").replace(" ", "_")


def scaffold(found: Equation | Mapping[str, Any], path: str | Path, *, name: str) -> Path:
    """Write an effect file of the law, whose coefficients (and shape, if it has one) an identification estimates.

    Args:
        found: also as `as_dict` says it.

    Raises:
        InputError: the file is there already, or the name is taken or no name.
        FormatError: there is no usable equation.
    """
    file, law = Path(path).resolve(), found if isinstance(found, Equation) else from_dict(found)
    curve.check(file, law.channel, law.variable, name)
    file_format.write_bytes(file, _text(law, name).encode())
    return file


def _text(found: Equation, name: str) -> str:
    form, reads = found.form, [curve.READ[t.axis.variable] for t in found.terms]
    shape_unit = "1" if form.kind == EXPONENT else UNIT[found.variable]
    shape = f"shape{_suffix(shape_unit)}"
    own = found.terms[:1] if found.is_isotropic else found.terms
    names = [f"{letter}{_suffix(_unit(found, t))}" for letter, t in zip(LETTERS, own, strict=False)]
    lines = [f"s = p.{shape}"] if form.shapes else []
    lines += ["n = flow.rotor_speed_rad_s.mean(axis=0)"] if form.carrier == "n" else []
    lines += ["speed = length(flow.velocity_m_s)"] if form.carrier == "speed" else []
    needs = sorted({r.needs for r in reads if r.needs})
    lines += [f"assert flow.{need} is not None" for need in needs]
    for i, (term, reading) in enumerate(zip(found.terms, reads, strict=True)):
        change = curve.changes(term.axis.channel)[0]
        change = change.replace("+=", "-=") if term.axis.sign < 0.0 else change
        lines += [reading.before] if reading.before else []
        lines += [f"x = {reading.expression}", f"{change} p.{names[0 if found.is_isotropic else i]} * ({form.code})"]
    body = "\n".join(f"    {line}" for line in lines)
    _, stage, _ = curve.changes(found.channel)
    channel = " ".join(dict.fromkeys(curve.changes(t.axis.channel)[2] for t in found.terms))
    helpers = "".join(f", {h}" for h in ("length", "magnitude", "positive") if f"{h}(" in body)
    specs = [_spec(n, _unit(found, t), t.coefficient, (-20.0, 20.0)) for n, t in zip(names, own, strict=True)]
    if form.shapes:
        bounds = (1.0 / found.shape, 4.0 / found.shape) if form.kind == EXPONENT else (0.2, 5.0)
        specs.append(_spec(shape, shape_unit, found.shape, bounds))
    numpy = "import numpy as np\n\n" if "np." in body else ""
    turned = curve.TURNED if found.variable == "heading" else ""
    array = "Array, " if turned else ""
    return f'''"""{name}: {_title(found)}.

Proposed by `goshawk diagnose`: the simplest law of its curve, flown to {found.reach:.3g} {UNIT[found.variable]}.
"""

{numpy}from vehicle.effects.base import {array}Effect, Flow, Spec, Stage, Values{helpers}{turned}


def apply(flow: Flow, p: Values) -> None:
{body}


EFFECT = Effect(
    name="{name}",
    number=0,
    stage=Stage.{stage},
    apply=apply,
    parameters=(
        {"        ".join(specs)}    ),
    strength=({", ".join(f'"{n}"' for n in names)},),
    law="{_title(found)}",
    source="proposed by goshawk diagnose",
    channel="{channel}",
    regressor="{" ".join(dict.fromkeys(t.axis.variable for t in found.terms))}",
    excited_by=("{reads[0].excited_by}",),
    needs=({"".join(f'"{need}", ' for need in needs)}),
)
'''


def _title(found: Equation) -> str:
    return ", ".join(_law(found, i) for i in range(len(found.terms)))


def _spec(name: str, unit_: str, value: float, bounds: tuple[float, float]) -> str:
    size = max(abs(value), 1e-12)
    low, high = bounds[0] * size, bounds[1] * size
    return (
        f'Spec("{name}", "{unit_}", prior={size:.4g}, bounds=({low:.4g}, {high:.4g}), default={value:.6g}, '
        f"planted={value:.4g}),\n"
    )


def _suffix(unit_: str) -> str:
    """`N s2/m2` as the end of a parameter's name."""
    words = re.findall(r"[A-Za-z]+\d*", unit_)
    return "".join(f"_{word.lower()}" for word in words)
