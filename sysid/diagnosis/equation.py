"""From a curve that no known effect explains to an equation: the simplest law of its variable that explains as much.

Every law of `evidence.forms` is one more column beside the fitted model, and so is the same law along the other axes
that symmetry joins (F_y with v_y beside F_x with v_x). They are judged on blocks left out of the estimate, the odds
between them as those between effects; each shape costs what it was chosen from. What the curve still explains beside
the chosen law says whether that is the whole of it.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from sysid.diagnosis.belief import curve_is_there
from sysid.diagnosis.evidence.evidence import Blocks
from sysid.diagnosis.evidence.forms import EXPONENT, Form, forms, parity
from sysid.diagnosis.evidence.free_form import DRAG, THRUST, of_thrust
from sysid.diagnosis.evidence.laws import Axis, Law, largest, moved
from sysid.diagnosis.evidence.score import Score, score
from sysid.diagnosis.examined import Model, Outside
from sysid.diagnosis.thresholds import THRESHOLDS
from sysid.estimator.flights.flight_data import IndexArray
from vehicle import rigid_body

LEAST_SHARE = 0.5
"""Of what the curve explains on blocks left out: a law that explains less is not stated."""
EQUAL_SIGMAS = 2.0
"""Coefficients of two axes that differ by fewer standard errors are taken as one."""
SHOWS_SIGMAS = 3.0
"""A coefficient of a further axis that is smaller than so many standard errors is none."""
REFUSED = ("constant", "time", "x", "y", "voltage")
"""Variables of which no law of the vehicle is made."""

MOMENTS = (Axis("M_x", "v_y"), Axis("M_y", "v_x", -1.0))
JOINED = (
    MOMENTS,
    (Axis("F_x", "v_x"), Axis("F_y", "v_y")),
    (Axis("M_x", "w_x"), Axis("M_y", "w_y"), Axis("M_z", "w_z")),
    (Axis("F_x", "w_y"), Axis("F_y", "w_x", -1.0)),
)
"""Laws that a quarter turn of a vehicle about z makes of each other, with the sign that goes along."""
MOST_RIVALS = 2
APART = 0.25
"""Share by which two forms must differ where a flight is to tell them apart."""


@dataclass(frozen=True, slots=True)
class Term:
    """The law along one axis: coefficient times form of the axis' variable."""

    axis: Axis
    coefficient: float
    """In N, N m or share of thrust over the variable's unit to the form's power."""
    sigma: float


@dataclass(frozen=True, slots=True)
class Rival:
    """A form that was tried, and how likely it is the right one of those tried."""

    form: Form
    shape: float
    coefficient: float
    probability: float


@dataclass(frozen=True, slots=True)
class Equation:
    """A law in place of a curve."""

    form: Form
    shape: float
    """0 where the form has none."""
    terms: tuple[Term, ...]
    is_isotropic: bool
    """Whether one coefficient serves all axes."""
    beside: str
    """The named effect of whose law it is what the catalogue's form leaves; empty where it stands alone."""
    probability: float
    """That this form is the right one, and the whole of what follows the variable."""
    rivals: tuple[Rival, ...]
    """Forms that nothing tells from it."""
    reach: float
    """Largest |variable| that was flown."""
    needed: float
    """To which |variable| one would have to fly to tell the first rival from it; 0 where there is none."""
    share: float
    """Of what the curve explains on blocks left out."""

    @property
    def variable(self) -> str:
        return self.terms[0].axis.variable

    @property
    def channel(self) -> str:
        return self.terms[0].axis.channel


def equation(model: Model, curve: Outside, *, beside: str = "") -> Equation | None:
    """The simplest law that explains what a curve does; None where none explains half of it.

    Args:
        beside: the named effect of whose law the curve is the form.
    """
    known = {c.variable for c in model.evidence.curves}
    tried = [_Trial.of(model, axes) for axes in _groups(curve) if axes[0].variable in known]
    if not tried:
        return None
    trial = max(tried, key=lambda one: one.log_odds)
    if not trial.share > LEAST_SHARE:
        return None
    law, found = trial.best
    kept = [i for i in range(len(trial.axes)) if i == 0 or abs(found.size[i]) > SHOWS_SIGMAS * found.sigma[i]]
    columns, base = found.columns[kept], model.evidence.base
    left = score(trial.blocks, np.concatenate([base, columns]), trial.drawn)
    terms, is_isotropic = _terms(model, [trial.axes[i] for i in kept], score(trial.blocks, base, columns))
    odds = sum(p for _, _, p in trial.others)
    there = curve_is_there(trial.alone.log_odds) * (1.0 - curve_is_there(left.log_odds))
    scale = _scale(model, trial.axes[0])
    rivals = tuple(
        Rival(one.form, one.shape, scale * float(s.size[0]), p * there / (1.0 + odds))
        for one, s, p in trial.others
        if p > np.exp(-THRESHOLDS.clear_lead)
    )[:MOST_RIVALS]
    return Equation(
        form=law.form,
        shape=law.shape,
        terms=terms,
        is_isotropic=is_isotropic,
        beside=beside,
        probability=min(THRESHOLDS.most_confidence, there / (1.0 + odds)),
        rivals=rivals,
        reach=law.reach,
        needed=_needed(law, terms[0], rivals),
        share=min(1.0, trial.share),
    )


@dataclass(frozen=True, slots=True)
class _Trial:
    """All laws along some axes."""

    axes: tuple[Axis, ...]
    blocks: Blocks
    drawn: IndexArray
    """Columns of the free curve along the first axis."""
    alone: Score
    """Of that curve."""
    best: tuple[Law, Score]
    others: list[tuple[Law, Score, float]]
    """Of every other form the best shape, with its odds against the best."""
    share: float
    """Of what the curve explains, how much the best law does along the same axis."""

    @classmethod
    def of(cls, model: Model, axes: tuple[Axis, ...]) -> "_Trial":
        laws, evidence = _laws(model, axes), model.evidence
        curve = next(c for c in evidence.curves if c.variable == axes[0].variable)
        blocks = evidence.with_columns(moved(axes, laws, curve))
        start, width = len(evidence.names), len(axes)
        columns = np.arange(start, blocks.score.shape[1], dtype=np.intp)
        own = columns[: len(laws) * width].reshape(len(laws), width)
        best, others = _ranked([(law, score(blocks, evidence.base, c)) for law, c in zip(laws, own, strict=True)], axes)
        alone = score(blocks, evidence.base, columns[len(laws) * width :])
        first = score(blocks, evidence.base, best[1].columns[:1])
        share = first.gain_unseen / alone.gain_unseen if alone.gain_unseen > 0.0 else 0.0
        return cls(axes, blocks, columns[len(laws) * width :], alone, best, others, share)

    @property
    def log_odds(self) -> float:
        return self.best[1].log_odds


def _groups(curve: Outside) -> list[tuple[Axis, ...]]:
    """Axes of laws to be tried: of the curve, and where it may be a share of thrusts, of moments against the motion.

    Thrust that rotors lose in the wake of others makes moments; a law of moments may be drawn as such a curve.
    """
    axes = _axes(curve)
    return [axes, MOMENTS] if axes and (curve.channel, curve.variable) == (THRUST, "s") else [axes] if axes else []


def _axes(curve: Outside) -> tuple[Axis, ...]:
    """The axis of the curve, then those that symmetry joins with it; none where no law is made of such a variable."""
    channel, variable = curve.channel, curve.variable
    if channel == DRAG:
        channel, variable = "F_x", "v_x"
    if variable in REFUSED or channel.endswith("_world") or variable.startswith("dc_"):
        return ()
    joined = [group for group in JOINED if (channel, variable) in {(a.channel, a.variable) for a in group}]
    first = Axis(channel, variable)
    if not joined:
        return (first,)
    sign = next(a.sign for a in joined[0] if (a.channel, a.variable) == (channel, variable))
    others = [a for a in joined[0] if (a.channel, a.variable) != (channel, variable)]
    return (first, *(Axis(a.channel, a.variable, sign * a.sign) for a in others))


def _laws(model: Model, axes: Sequence[Axis]) -> list[Law]:
    """Every form with every shape that is tried."""
    reach = largest(axes[0], model.flights, model.fit.solution.point.states, model.candidate_set.vehicle)
    found: list[Law] = []
    for form in forms(axes[0].variable):
        if of_thrust(axes[0].channel) and form.carrier == "n":
            continue  # thrust grows with rotor speed by itself
        shapes = [s if form.kind == EXPONENT else s * reach for s in form.shapes] or [0.0]
        found += [Law(form, shape, reach) for shape in shapes]
    return found


def _ranked(
    scored: Sequence[tuple[Law, Score]], axes: Sequence[Axis]
) -> tuple[tuple[Law, Score], list[tuple[Law, Score, float]]]:
    """The best law, and of every other form the best shape with its odds against that one."""
    allowed = parity(axes[0].channel, axes[0].variable)
    dispersion = max(scored, key=lambda one: one[1].gain_unseen)[1].dispersion

    def weight(one: tuple[Law, Score]) -> float:
        law, found = one
        costs = np.log(len(law.form.shapes)) if law.form.shapes else 0.0
        costs += 0.0 if law.form.allowed(allowed) else THRESHOLDS.clear_lead
        return found.gain_unseen / dispersion - costs

    by_form: dict[Form, tuple[Law, Score]] = {}
    for one in scored:
        known = by_form.get(one[0].form)
        by_form[one[0].form] = one if known is None or weight(one) > weight(known) else known
    ordered = sorted(by_form.values(), key=weight, reverse=True)
    best = ordered[0]
    return best, [(law, s, float(np.exp(weight((law, s)) - weight(best)))) for law, s in ordered[1:]]


def _terms(model: Model, axes: Sequence[Axis], found: Score) -> tuple[tuple[Term, ...], bool]:
    """Sizes in the channels' units; one for all axes where they do not differ."""
    scale = np.array([_scale(model, axis) for axis in axes])
    size, covariance = scale * found.size, np.outer(scale, scale) * found.covariance
    sigma = np.sqrt(np.maximum(np.diag(covariance), 0.0))
    spread = np.abs(size - size.mean()).max()
    if len(axes) == 1 or spread > EQUAL_SIGMAS * float(sigma.max()):
        return tuple(Term(a, float(c), float(s)) for a, c, s in zip(axes, size, sigma, strict=True)), False
    weights = 1.0 / np.maximum(sigma, 1e-300) ** 2
    mean, std = float(weights @ size / weights.sum()), float(weights.sum() ** -0.5)
    return tuple(Term(axis, mean, std) for axis in axes), True


def _scale(model: Model, axis: Axis) -> float:
    """From the acceleration that a column is to force, torque or share of thrust."""
    if of_thrust(axis.channel):
        return 1.0
    body = rigid_body(model.fit.vehicle)
    i = "xyz".index(axis.channel[2])
    return float(body.mass_kg if axis.channel[0] == "F" else body.inertia_kg_m2[i, i])


def _needed(law: Law, term: Term, rivals: Sequence[Rival]) -> float:
    """The smallest |variable| beyond the flown ones where the first rival differs clearly; 0 without a rival."""
    if not rivals:
        return 0.0
    rival = rivals[0]
    x = law.reach * np.arange(1.1, 3.05, 0.1)
    for side in (-1.0, 1.0):
        own = term.coefficient * law.form.values(side * x, law.shape)
        other = rival.coefficient * rival.form.values(side * x, rival.shape)
        differs = np.abs(own - other) > APART * np.maximum(np.abs(own), np.abs(other))
        if differs.any() and own.any():
            return float(x[differs][0])
    return float(x[-1])
