"""One self-contained HTML page per diagnosis: the verdict first, then what convicts, then what cannot be told."""

import tempfile
from collections.abc import Sequence
from datetime import UTC, datetime
from html import escape
from importlib.metadata import version
from pathlib import Path

from sysid.diagnosis import figures
from sysid.diagnosis.findings import SuspectFinding
from sysid.diagnosis.procedure import Diagnosis
from sysid.report import picture, table, write_page

CAPTIONS = {
    "staircase": "The error, model by model",
    "suspect": "What convicts",
    "outside": "What no known effect explains",
    "residual_share": "What explains the residual, channel by channel",
    "residual_wrench": "Unexplained force and torque over time",
    "look_alikes": "Which suspects look alike on these flights",
}
VERDICT_STYLE = (
    ".verdict { font-size: 1.25em; border-left: 5px solid #1f6f8b; background: #f2f7f9; padding: .6em 1em }"
    "td.present { color: #b0413e; font-weight: 600 } td.excluded { color: #777 } td.reason { white-space: normal }"
    "td, th { padding: .1em .6em .1em .3em; font-size: .94em }"
)


def write(path: Path, found: Diagnosis, *, further: Sequence[str] = ()) -> Path:
    """Write the report; pictures are inside the file.

    Args:
        further: what to type or fly now.
    """
    with tempfile.TemporaryDirectory() as folder:
        drawn = figures.write(found, Path(folder))
        pictures = {p.stem: picture(p, CAPTIONS[p.stem.rstrip("0123456789").rstrip("_")]) for p in drawn}
    parts = [
        _head(found),
        "<h2>Did the error fall?</h2>",
        pictures.pop("staircase"),
        _attempts(found),
        _next(further),
        "<h2>Suspects</h2>",
        _suspects(found.suspects),
        "<h2>Evidence</h2>",
        *pictures.values(),
        _unseen(found),
        _parameters(found),
    ]
    return write_page(Path(path), f"Diagnosis of {found.base.name}", "".join(parts), VERDICT_STYLE)


def _head(found: Diagnosis) -> str:
    now = datetime.now(UTC).strftime("%Y-%m-%d %H:%M UTC")
    judged = f"judged on {', '.join(found.held_out)}" if found.held_out else "each flight judged by the others"
    sentence = found.verdict[0].upper() + found.verdict[1:]
    return (
        f"<h1>Diagnosis of {escape(found.base.name)}</h1>"
        f"<p class='small'>goshawk {version('goshawk')}, {now}. Learnt from {escape(', '.join(found.flights))}; "
        f"{escape(judged)}. Model as given: {escape(', '.join(found.base.effects))}. SI units, body axes x forward, "
        "y left, z up.</p>"
        f"<p class='verdict'>{escape(sentence)}.<br><span class='small'>Confidence {found.confidence:.0%}.</span></p>"
    )


def _attempts(found: Diagnosis) -> str:
    if not found.attempts:
        return "<p>No suspect was strong enough to be tried.</p>"
    style = {"added": "good", "removed": "held"}
    items = "".join(
        f"<li><b>{escape(a.name)}</b> <span class='{style.get(a.outcome, 'bad')}'>{escape(a.sentence)}</span>"
        f"{_rivals(a.rivals)}</li>"
        for a in found.attempts
    )
    note = "<p class='small'>The cost is half the sum of squares in units of the noise; ± one standard deviation.</p>"
    return f"<h3>What was tried, in order</h3><ul>{items}</ul>{note}"


def _rivals(rivals: Sequence[tuple[str, float]]) -> str:
    said = ", ".join(f"{escape(name)} {p:.0%}" for name, p in rivals)
    return f" <span class='small'>also fitted: {said}</span>" if said else ""


def _next(further: Sequence[str]) -> str:
    if not further:
        return ""
    return "<h3>Next</h3>" + "".join(f"<p><code>{escape(line)}</code></p>" for line in further)


def _suspects(suspects: Sequence[SuspectFinding]) -> str:
    rows = []
    for suspect in suspects:
        span = f" rowspan='{len(suspect.sizes)}'"
        alike = ", ".join(f"{escape(name)} {share:.0%}" for name, share in suspect.look_alikes[:3])
        for i, size in enumerate(suspect.sizes):
            name = f"<td{span}>{escape(suspect.name)}</td>" if i == 0 else "<td hidden></td>"
            kind = suspect.verdict.split()[0]
            word = f"<td class='word {kind}'{span}>{suspect.verdict}</td>" if i == 0 else ""
            shown = size.sigma > 0.0
            numbers = (
                f"{size.value:.3g} ± {size.sigma:.1g}" if shown else "not flown",
                f"{size.excluded_above:.2g}" if shown else "",
                f"{size.smallest_visible:.2g}" if shown else "",
            )
            whole = f"<td{span}>{1000.0 * suspect.error_m:.1f}</td><td{span}>{suspect.confidence:.0%}</td>"
            whole += f"<td class='word reason'{span}>{alike}</td>"
            rows.append(
                f"<tr>{name}{word}<td class='word'>{escape(size.parameter.split('.')[-1])}</td>"
                + "".join(f"<td>{n}</td>" for n in numbers)
                + f"<td class='word'>{escape(size.unit)}</td>{whole if i == 0 else ''}</tr>"
            )
    head = ("suspect", "verdict", "parameter", "size ± σ", "excluded above", "visible from", "unit", "mm at 0.5 s")
    note = (
        "<p class='small'>Excluded above: larger sizes can be ruled out with 95 %. Visible from: a size that would "
        "have been called present nine times in ten. Mm at 0.5 s: position error the effect makes in half a second at "
        "its estimated size. Look-alikes: suspects that leave more than 90 % of the same trace here.</p>"
    )
    return table((*head, "sure", "look-alikes"), "".join(rows)) + note


def _unseen(found: Diagnosis) -> str:
    open_ = [s for s in found.suspects if s.verdict == "cannot tell"]
    items = [f"<li><b>{escape(s.name)}</b>: {escape(s.reason)}</li>" for s in open_]
    items += [f"<li><b>{escape(name)}</b> cannot be seen: {escape(why)}</li>" for name, why in found.invisible]
    return f"<h2>What these flights cannot tell, and why</h2><ul>{''.join(items)}</ul>" if items else ""


def _parameters(found: Diagnosis) -> str:
    rows = "".join(
        f"<tr><td>{escape(name)}</td><td>{p.value:.5g}</td><td>{p.std:.2g}</td>"
        f"<td class='word'>{escape(p.unit)}</td></tr>"
        for name, p in found.vehicle.parameters.items()
    )
    findings = "".join(f"<li>{escape(sentence)}</li>" for sentence in found.findings)
    return (
        f"<h2>The model now</h2>{table(('parameter', 'value', '± σ', 'unit'), rows, words=1)}"
        f"<h2>Notes of the fit</h2><ul>{findings}</ul>"
    )
