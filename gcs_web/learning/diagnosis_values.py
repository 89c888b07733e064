"""A diagnosis and a tried change in the page's terms: titles, units that people read, points of the pictures."""

import functools
import json
from collections.abc import Mapping, Sequence
from typing import Any

import vehicle
from gcs_web.comparison.residuals import variable
from gcs_web.protocol import learning as learning_messages
from gcs_web.protocol.learning import (
    Attempt,
    Confounded,
    EffectSize,
    Evidence,
    OutsideCurve,
    ProposedEquation,
    Stair,
    Tried,
)
from sysid.diagnosis import Diagnosis, equation_text
from sysid.diagnosis.curve import advice, suggested_name
from sysid.diagnosis.equation import Equation
from sysid.diagnosis.evidence import explained
from sysid.diagnosis.evidence.candidates import Candidate
from sysid.diagnosis.evidence.free_form import UNIT, VARIABLE
from sysid.diagnosis.experiment_design.outlook import Outlook
from sysid.diagnosis.findings import CandidateFinding, OutsideFinding, Size
from sysid.estimator.result import CHANNELS
from sysid.estimator.validation import changes
from sysid.estimator.validation.changes import Change
from sysid.estimator.validation.comparison import QUANTITIES
from sysid.report import diagnosis_figures as figures
from sysid.report import diagnosis_page, drawing, words
from sysid.report.added_variable import added_variable, left_of
from sysid.report.pages import SHOWN
from sysid.report.residual_plots import SIGMAS, unit
from vehicle import Vehicle, history


def diagnosis(
    found: Diagnosis, outlooks: Mapping[str, Outlook], vehicle_hash: str, contents: str
) -> learning_messages.Diagnosis:
    belief = found.belief
    named = functools.partial(diagnosis_page.named, found)
    pictures = {candidate.name: evidence(found, candidate) for candidate in figures.leading(found)}
    return learning_messages.Diagnosis(
        "current",
        _sentence(named(found.verdict)),
        belief.as_stated,
        _sentence(belief.sentence(named=found.says_missing)),
        _sentence(found.envelope.sentence),
        named(found.fit_verdict.sentence),
        sorted(found.flights),
        sorted(found.held_out),
        [_candidate(found, one, outlooks.get(one.name), pictures.get(one.name)) for one in found.candidates],
        [Attempt(a.name, words.effect(a.name), str(a.outcome), named(a.sentence)) for a in found.attempts],
        list(found.staircase[0].position_m),
        [Stair(named(s.model), [1e3 * e for e in s.position_m.values()]) for s in found.staircase],
        None if found.outside is None else _outside(found.outside),
        None if found.search.equation is None else _equation(found.search.equation),
        [f"{words.effect(name)}: {named(why)}" for name, why in found.invisible],
        [named(sentence) for sentence in found.findings],
        _left(found),
        vehicle_hash,
        contents,
    )


def _equation(found: Equation) -> ProposedEquation:
    can_be_made = not advice(found.channel, found.variable)
    return ProposedEquation(
        f"the simplest law of it: {equation_text.sentence(found)}",
        equation_text.suggested_name(found) if can_be_made else "",
        json.dumps(equation_text.as_dict(found)),
    )


def _candidate(
    whole: Diagnosis, found: CandidateFinding, outlook: Outlook | None, picture: Evidence | None
) -> learning_messages.Candidate:
    effect = found.name.partition("[")[0]
    return learning_messages.Candidate(
        found.name,
        words.effect(found.name),
        found.verdict.value,
        diagnosis_page.named(whole, found.reason),
        found.confidence,
        vehicle.effects.find(effect).law,
        [_size(size) for size in found.sizes],
        1e3 * found.error_m,
        [Confounded(name, words.effect(name), share) for name, share in found.confounded],
        "" if outlook is None else outlook.sentence,
        picture,
    )


def _size(size: Size) -> EffectSize:
    return EffectSize(
        words.parameter(size.parameter),
        size.unit,
        size.value,
        size.sigma,
        *size.interval90,
        size.excluded_above,
        size.smallest_visible,
        size.usual,
    )


def evidence(found: Diagnosis, candidate: Candidate) -> Evidence:
    """The points of the report's picture of a candidate."""
    model = found.search.models[0]
    shown, before = added_variable(model, candidate), left_of(model)
    name, (scale, written) = figures.follows(shown.trace, before), unit(shown.channel)
    x = explained.read(before, VARIABLE[name])
    effect_x, effect_y, _ = drawing.binned(x, scale * shown.trace)
    judged = figures.unseen(found)
    held_x: list[float] = []
    held = {figures.BEFORE: held_x, figures.AFTER: held_x}
    if judged:
        held_x = explained.read(judged[figures.AFTER], VARIABLE[name]).tolist()
        held = {key: (scale * figures.in_channel(left, shown.channel)).tolist() for key, left in judged.items()}
    return Evidence(
        shown.channel,
        written,
        variable(name),
        x.tolist(),
        (scale * shown.partial_residual).tolist(),
        effect_x.tolist(),
        effect_y.tolist(),
        held_x,
        held[figures.BEFORE],
        held[figures.AFTER],
    )


def _outside(found: OutsideFinding) -> OutsideCurve:
    scale, written = unit(found.channel)
    return OutsideCurve(
        found.channel,
        words.channel(found.channel),
        written,
        variable(found.variable),
        found.at.tolist(),
        (scale * found.force_or_torque * found.acceleration).tolist(),
        (SIGMAS * scale * found.force_or_torque * found.band).tolist(),
        found.confidence,
        *((suggested_name(found), "") if not (why := advice(found.channel, found.variable)) else ("", why)),
    )


def curve_facts(shown: OutsideCurve) -> dict[str, Any]:
    """The curve as `goshawk diagnose --json` has it, in SI."""
    scale, _ = unit(shown.channel)
    return {
        "channel": shown.channel,
        "variable": shown.variable.name,
        "variable_unit": UNIT.get(shown.variable.name, ""),
        "at": shown.x,
        "residual": [y / scale for y in shown.y],
        "residual_sigma": [band / (SIGMAS * scale) for band in shown.band],
    }


def _left(found: Diagnosis) -> list[str]:
    """What the last model leaves, the flights that judge together."""
    rms = found.judged.wrench_rms(found.staircase[-1].model)
    rows = ((channel, *unit(channel), value) for channel, value in zip(CHANNELS, rms, strict=True))
    return [f"{channel} {scale * value:.2g} {written}" for channel, scale, written, value in rows]


def tried(present: Vehicle, effect: str, change: Change, held_out: Sequence[str]) -> Tried:
    """What came of adding an effect, in the units that people read."""

    def errors(model: str) -> list[float]:
        found = change.errors.get(model)
        return [] if found is None else [SHOWN[q][1] * found[changes.KEYS[q]] for q in QUANTITIES]

    said = change.held_out.verdict if change.held_out else "not judged: no flight is held out"
    return Tried(
        effect,
        words.effect(effect),
        said,
        "" if change.fit is None else str(change.fit.use),
        []
        if change.fit is None
        else [words.parameters_named(reason, change.vehicle.parameters) for reason in change.fit.reasons],
        list(QUANTITIES),
        [SHOWN[quantity][0] for quantity in QUANTITIES],
        errors(changes.PRESENT),
        errors(changes.BEFORE),
        errors(changes.AFTER),
        list(held_out),
        history.differences(present, change.vehicle),
        vehicle.vehicle_hash(change.vehicle),
    )


def _sentence(text: str) -> str:
    return f"{text[:1].upper()}{text[1:]}."
