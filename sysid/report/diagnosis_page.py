"""One self-contained HTML page per diagnosis: verdict, evidence, sizes, confounded effects, what is open."""

import re
import tempfile
from collections.abc import Mapping, Sequence
from html import escape
from pathlib import Path

from sysid.diagnosis import equation_text
from sysid.diagnosis.evidence.free_form import EVERY_CHANNEL, UNIT
from sysid.diagnosis.experiment_design.outlook import Outlook
from sysid.diagnosis.findings import Outcome, OutsideFinding, Verdict
from sysid.diagnosis.procedure import Diagnosis
from sysid.estimator.verdict import Use
from sysid.report import diagnosis_figures, diagnosis_tables, residual_plots, words
from sysid.report.pages import AXES, LETTERS, picture, stamp, write_page
from vehicle import purpose

CAPTIONS = {
    "staircase": "Prediction error, model by model",
    "candidate": "The evidence",
    "outside": "What no known effect explains",
    "residual_share": "What explains the residual, channel by channel",
    "residual_wrench": "Unexplained force and torque over time",
    "confounded": "Share of each residual that another candidate reproduces",
}
IN_THE_MODEL = (Verdict.PRESENT, Verdict.PROXY)
MOST_LISTED = 8
"""More open candidates than these are not listed in the verdict."""
HORIZON = "0.5 s"
"""At which the verdict states the error."""
STYLE = (
    "table.grouped td, table.grouped th { padding: .12em .9em .12em .3em; font-size: .94em }"
    "table.grouped tbody tr { background: none !important; vertical-align: top }"
    "table.grouped tbody:nth-of-type(even) tr { background: #f7f7f7 !important }"
    "table.grouped td.name, td.name { font-family: ui-monospace, monospace; font-size: .9em; text-align: left }"
    "table.grouped td.word { font-family: inherit; font-size: .94em }"
    "td.present, td.useful { color: #b0413e; font-weight: 600 }"
    "details { margin: .8em 0 } summary { cursor: pointer; font-weight: 600 }"
    "pre { background: #f6f6f4; padding: .5em .8em; margin: .4em 0; white-space: pre-wrap; font-size: .92em }"
)


def write(
    path: Path, found: Diagnosis, *, further: Sequence[str] = (), outlooks: Mapping[str, Outlook] | None = None
) -> Path:
    """Write the report; pictures are inside the file.

    Args:
        further: what to type or fly now.
        outlooks: by candidate in doubt, the flight that would tell.
    """
    with tempfile.TemporaryDirectory() as folder:
        drawn = diagnosis_figures.write(found, Path(folder))
        pictures = {p.stem: picture(p, CAPTIONS[p.stem.rstrip("0123456789").rstrip("_")]) for p in drawn}
    evidence = [drawn for name, drawn in pictures.items() if name.startswith(("outside", "candidate"))]
    parts = [
        _head(found),
        _next(further),
        "<h2>Evidence</h2>",
        *evidence,
        pictures["staircase"],
        _attempts(found),
        "<h2>What is left</h2>",
        pictures["residual_wrench"],
        pictures["residual_share"],
        "<h2>Candidates</h2>",
        diagnosis_tables.candidates(found.candidates),
        _unseen(found, outlooks or {}),
        "<h2>Confounded effects</h2>",
        diagnosis_tables.confounded(found.candidates),
        pictures["confounded"],
        "<h2>The model now</h2>",
        diagnosis_tables.parameters(found.vehicle.parameters),
        _notes(found),
    ]
    return write_page(Path(path), f"Diagnosis of {found.base.name}", "".join(parts), STYLE)


def _head(found: Diagnosis) -> str:
    given = escape(", ".join(words.effect(name) for name in found.base.effects))
    learnt = f"Learnt from {escape(', '.join(found.flights))}"
    judged = f"judged on {', '.join(found.held_out)}" if found.held_out else "each stretch of flight judged by the rest"
    return (
        f"<h1>Diagnosis of {escape(found.base.name)}</h1>"
        f"{stamp(f'{learnt}; {escape(judged)}. Model as given: {given}. {AXES} {LETTERS}')}"
        f"<div class='verdict'>{_verdict(found)}</div>"
    )


def _verdict(found: Diagnosis) -> str:
    verdict = named(found, found.verdict)
    sentence = verdict[0].upper() + verdict[1:]
    said = [f"<b>{escape(sentence)}.</b>", *_fit_sentence(found), _belief_sentence(found)]
    said += [diagnosis_tables.size_sentence(s) for s in found.candidates if s.verdict in IN_THE_MODEL]
    if found.outside is not None:
        said.append(_curve_sentence(found.outside))
    if found.search.equation is not None:
        said.append(f"The simplest law of it: {escape(equation_text.sentence(found.search.equation))}.")
    said.append(_error_sentence(found))
    if not found.additions:
        said.append(_exclusions(found))
    return "".join(f"<p>{line}</p>" for line in said)


def _fit_sentence(found: Diagnosis) -> list[str]:
    """What speaks against the fit that all of this rests on; nothing if it is usable."""
    if found.fit_verdict.use is Use.USABLE:
        return []
    style = " class='bad'" if found.fit_verdict.against else ""
    reasons = escape(named(found, "; ".join(found.fit_verdict.reasons)))
    cause = f" Likely cause, by a trial: {escape(named(found, found.cause.sentence))}." if found.cause else ""
    mark = purpose.mark_sentence(found.vehicle)
    cause += f" The model is {escape(mark)}." if mark else ""
    return [
        f"<span{style}>The verdict on the fit that this rests on: {found.fit_verdict.use}. {reasons}.{cause}</span>"
    ]


def _belief_sentence(found: Diagnosis) -> str:
    of_families = [named(found, one.sentence) for one in found.families if one.has_forms]
    sentences = (*of_families, found.belief.sentence(named=found.says_missing), found.envelope.sentence)
    return " ".join(f"{said[0].upper()}{said[1:]}." for said in sentences)


def _curve_sentence(o: OutsideFinding) -> str:
    scale, written = residual_plots.unit(o.channel)
    curve = scale * o.acceleration * o.force_or_torque
    return (
        f"The {words.channel(o.channel)} ({o.channel}) follows {escape(words.variable(o.variable))} "
        f"({escape(o.variable)}): from {diagnosis_tables.plain(float(curve.min()))} to "
        f"{diagnosis_tables.plain(float(curve.max()))} {written} over {o.at[0]:.3g} to {o.at[-1]:.3g} "
        f"{diagnosis_tables.unit(o.variable_unit)}. Chance alone would do so with probability "
        f"{diagnosis_tables.chance(o.significance)}."
    )


def _error_sentence(found: Diagnosis) -> str:
    on = f"on the held-out flights {', '.join(found.held_out)}" if found.held_out else "on the training flights"
    steps = [f"{1000.0 * s.position_m[HORIZON]:.3g} mm ({escape(named(found, s.model))})" for s in found.staircase]
    return f"Position error after {HORIZON} {escape(on)}: {', '.join(steps)}."


def named(found: Diagnosis, text: str) -> str:
    """A sentence with effects, parameters and curves by their names."""
    text = words.curves_named(text, EVERY_CHANNEL, UNIT)
    text = words.parameters_named(text, found.vehicle.parameters)
    text = words.named(text, [*(s.name for s in found.candidates), *(name for name, _ in found.invisible)])
    for parameter in {size.parameter for s in found.candidates for size in s.sizes}:
        short = parameter.split(".")[-1]
        text = re.sub(rf"\b{re.escape(short)}\b", words.parameter(parameter), text) if "_" in short else text
    return text


def _exclusions(found: Diagnosis) -> str:
    excluded = sum(s.verdict is Verdict.EXCLUDED for s in found.candidates)
    open_ = [s.name for s in found.candidates if s.verdict is Verdict.INCONCLUSIVE]
    open_ += [name for name, _ in found.invisible]
    told = f"Of {len(found.candidates)} candidates, {excluded} can be excluded: too small to matter"
    said = escape(", ".join(words.effect(name) for name in open_))
    if len(open_) > MOST_LISTED:
        said = f"{len(open_)} others, which stand below"
    return f"{told}. These flights say nothing certain of {said}." if open_ else f"{told}."


def _attempts(found: Diagnosis) -> str:
    if not found.attempts:
        return "<p>No known effect explained enough to be tried.</p>"
    style = {
        Outcome.ADDED: "good",
        Outcome.USEFUL_PROXY: "good",
        Outcome.REMOVED: "held",
        Outcome.UNDECIDED: "held",
    }
    items = "".join(
        f"<li><b>{escape(words.effect(a.name))}</b> "
        f"<span class='{style.get(a.outcome, 'bad')}'>{escape(named(found, a.sentence))}</span>"
        f"{_rivals(a.rivals)}</li>"
        for a in found.attempts
    )
    note = "<p class='small'>The cost is half the sum of squares in units of the noise; ± one standard deviation.</p>"
    return f"<h3>What was tried, in order</h3><ul>{items}</ul>{note}"


def _rivals(rivals: Sequence[tuple[str, float]]) -> str:
    said = ", ".join(f"{escape(words.effect(name))} {p:.0%}" for name, p in rivals)
    return f" <span class='small'>also fitted, probability: {said}</span>" if said else ""


def _next(further: Sequence[str]) -> str:
    if not further:
        return "<h2>Next steps</h2><p>None: what these flights could show is in the model.</p>"
    lines = [f"<p>{escape(line[1:-1])}.</p>" if line[0] == "(" else f"<pre>{escape(line)}</pre>" for line in further]
    return f"<h2>Next steps</h2>{''.join(lines)}"


def _unseen(found: Diagnosis, outlooks: Mapping[str, Outlook]) -> str:
    items = []
    for s in found.candidates:
        if s.verdict is Verdict.INCONCLUSIVE:
            flight = f"; {outlooks[s.name].sentence}" if s.name in outlooks else ""
            said = escape(named(found, s.reason) + flight)
            items.append(f"<li><b>{escape(words.effect(s.name))}</b>: {said}</li>")
    items += [
        f"<li><b>{escape(words.effect(name))}</b>: not observable; {escape(named(found, why))}</li>"
        for name, why in found.invisible
    ]
    heading = "<h3>What these flights cannot tell, and the flight that would</h3>"
    return f"{heading}<ul>{''.join(items)}</ul>" if items else ""


def _notes(found: Diagnosis) -> str:
    findings = "".join(f"<li>{escape(named(found, sentence))}</li>" for sentence in found.findings)
    return f"<h2>Notes of the fit</h2><ul>{findings}</ul>" if findings else ""
