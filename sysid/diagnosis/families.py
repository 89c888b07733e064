"""Which family of laws is missing, and which of its forms: drag 99 %, linear in airspeed 81 %, quadratic 15 %.

That something drags shows long before it shows by which power of the airspeed. So the family is as likely as all its
forms together, and the forms share that by the odds of their fits. What a curve of the same physics still explains on
blocks left out, beside the best form of the catalogue, is the share of a form that the catalogue does not hold.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from sysid.diagnosis.thresholds import THRESHOLDS
from vehicle import effects
from vehicle.effects.base import Effect

TOGETHER = " + "
"""Between the names of forms that are missing together."""
LEAST_SHOWN = 0.01
"""Forms less likely than this are not listed."""


@dataclass(frozen=True, slots=True)
class Form:
    """One law of a family."""

    name: str
    """Of the candidate."""
    words: str
    probability: float

    @property
    def sentence(self) -> str:
        said = f" ({self.words})" if self.words else ""
        return f"{self.name}{said} {self.probability:.0%}"


@dataclass(frozen=True, slots=True)
class Family:
    """What is missing, whatever its form."""

    name: str
    probability: float
    forms: tuple[Form, ...]
    """The likeliest first."""
    another_form: float
    """Probability that it is this family, in a form that the catalogue does not hold."""

    @property
    def is_another_form(self) -> bool:
        """Whether a form that the catalogue lacks is likelier than all it has."""
        return self.another_form > sum(form.probability for form in self.forms)

    @property
    def names(self) -> tuple[str, ...]:
        """Of the candidates that are its forms."""
        return tuple(name for form in self.forms for name in form.name.split(TOGETHER))

    @property
    def known_form(self) -> float:
        """That the catalogue holds the form; 1 where the sentence says that it does not."""
        return 1.0 if self.is_another_form else 1.0 - self.another_form / max(self.probability, 1e-300)

    @property
    def lacking(self) -> str:
        """What is said in place of a name where the form is another one."""
        near = " and ".join(self.names[: 1 + self.forms[0].name.count(TOGETHER)])
        return f"{self.name} in a form that the catalogue lacks (the nearest is {near})"

    @property
    def has_forms(self) -> bool:
        """Whether there is more to say of it than its name."""
        return bool(self.forms[0].words)

    @property
    def sentence(self) -> str:
        """The family, then its forms, each with its probability."""
        forms = [form.sentence for form in self.forms if form.probability >= LEAST_SHOWN]
        if self.another_form >= LEAST_SHOWN:
            forms.append(f"another form {self.another_form:.0%}")
        return f"{self.name} {self.probability:.0%}: {', '.join(forms)}"

    def as_dict(self) -> dict[str, Any]:
        return {
            "name": self.name,
            "probability": self.probability,
            "forms": [{"name": f.name, "form": f.words, "probability": f.probability} for f in self.forms],
            "another_form": self.another_form,
        }


def family_of(candidate: str) -> str:
    """The family of a candidate (`weak_rotor[2]` is one of `weak_rotor`); its effect's name where it has none."""
    return _effect(candidate).family or _effect(candidate).name


def _effect(candidate: str) -> Effect:
    return effects.find(candidate.partition("[")[0])


def family(stated: Mapping[str, float], another: float, *, most: float) -> Family:
    """One family from the probabilities of its forms.

    Args:
        stated: probability of each form by the name of its candidate; all of one family.
        another: probability that it is none of these forms, given the family.
        most: nothing is believed more.
    """
    together = min(most, sum(stated.values()))
    share = together / max(sum(stated.values()), 1e-300)
    forms = [Form(name, _effect(name).form, (1.0 - another) * share * p) for name, p in stated.items()]
    ordered = tuple(sorted(forms, key=lambda form: -form.probability))
    return Family(family_of(ordered[0].name), together, ordered, together * another)


def of_curve(nearest: Sequence[tuple[str, float]], confidence: float) -> Family | None:
    """The family of a law that no known effect is; None where the catalogue has none of its physics.

    Args:
        nearest: known effects of the same physics and their shares in explaining the curve, the largest first.
        confidence: probability that channel and variable of the curve are right.
    """
    if not nearest:
        return None
    shares: dict[str, float] = {}
    for name, share in nearest:
        shares[family_of(name)] = shares.get(family_of(name), 0.0) + share
    likeliest = max(shares, key=lambda name: shares[name])
    own = {name: confidence * share for name, share in nearest if family_of(name) == likeliest}
    return family(own, 1.0, most=THRESHOLDS.most_confidence)


def families(
    named: Sequence[tuple[str, float, Sequence[tuple[str, float]]]], another: Mapping[str, float], *, most: float
) -> tuple[Family, ...]:
    """Of everything that is named, the likeliest first.

    Args:
        named: each candidate that is said to be missing, its probability, and its rivals' with theirs.
        another: by candidate, as `family` takes it; none where no curve is of its form.
    """
    most = min(most, THRESHOLDS.most_confidence)
    groups: dict[str, list[tuple[str, float, Sequence[tuple[str, float]]]]] = {}
    for one in named:
        groups.setdefault(family_of(one[0]), []).append(one)
    found = [
        _single(*own[0], another, most) if len(own) == 1 else _together(own, another, most) for own in groups.values()
    ]
    return tuple(sorted(found, key=lambda one: -one.probability))


def _single(
    name: str, probability: float, rivals: Sequence[tuple[str, float]], another: Mapping[str, float], most: float
) -> Family:
    own = {name: probability} | {n: p for n, p in rivals if family_of(n) == family_of(name) and n != name}
    return family(own, another.get(name, 0.0), most=most)


def _together(
    named: Sequence[tuple[str, float, Sequence[tuple[str, float]]]], another: Mapping[str, float], most: float
) -> Family:
    """Several forms of one family that are all named: two laws, or one that the catalogue lacks."""
    names = [name for name, _, _ in named]
    probability = min(most, max(p for _, p, _ in named))
    share = max(another.get(name, 0.0) for name in names)
    both = min(probability, float(np.prod([p for _, p, _ in named])))
    form = Form(TOGETHER.join(names), " and ".join(_effect(name).form for name in names), (1.0 - share) * both)
    return Family(family_of(names[0]), probability, (form,), probability * share)
