"""One self-contained HTML page per fit: what was found, how sure, how it got there, and what to read twice."""

import base64
import tempfile
from collections.abc import Iterable, Mapping, Sequence
from datetime import UTC, datetime
from html import escape
from importlib.metadata import version
from pathlib import Path

from flight import file_format
from sysid.diagnosis.evidence import explained
from sysid.estimator.blocks.catalogue import BLOCKS
from sysid.estimator.blocks.noise import MOTION
from sysid.estimator.result import (
    CHANNELS,
    NOT_IDENTIFIABLE,
    NOT_SETTLED,
    SPAN_S,
    Estimate,
    Identification,
    residual_statistics,
)
from sysid.estimator.validation.comparison import HORIZONS_S, JUDGED_S, QUANTITIES, Comparison
from sysid.estimator.validation.protocol import KNOWS, Judged
from sysid.estimator.validation.wrench_error import WrenchErrors
from sysid.estimator.verdict import Use
from sysid.logs.check import LogReport
from sysid.report import plots, residual_plots, words
from vehicle import purpose

STYLE = """
body { font: 15px/1.5 system-ui, sans-serif; color: #2b2b2b; max-width: 1180px; margin: 2em auto; padding: 0 1em }
h1 { font-size: 1.6em; margin-bottom: .2em } h2 { font-size: 1.2em; margin-top: 2em; border-bottom: 1px solid #ddd }
h3 { font-size: 1em; margin: 1.6em 0 .2em } .small { color: #777; font-size: .88em; max-width: 60em }
table { border-collapse: collapse; font-variant-numeric: tabular-nums; margin: .5em 0 }
td, th { padding: .2em 1.2em .2em .4em; text-align: right; white-space: nowrap }
thead th { border-bottom: 1px solid #bbb }
td:first-child, th:first-child { text-align: left; font-family: ui-monospace, monospace; font-size: .92em }
td.word, th.word { text-align: left } tbody tr:nth-child(even) { background: #f7f7f7 }
.verdict { border-left: 5px solid #1f6f8b; background: #f2f7f9; padding: .4em 1em .6em; margin: 1em 0 }
.verdict p { margin: .4em 0 } .verdict p:first-child { font-size: 1.3em } sup { line-height: 0; font-size: .75em }
img { width: 100%; margin: .3em 0 } .held { color: #999 } li.error, .bad { color: #b0413e } .good { color: #3c7a1f }
.scroll { overflow-x: auto } .scroll img { min-width: 760px } .scroll img.wide { min-width: 2400px }
@media print { body { max-width: none; font-size: 11px; print-color-adjust: exact } .scroll { overflow: visible }
  .scroll img, .scroll img.wide { min-width: 0 } h2, h3 { break-after: avoid } img, tr { break-inside: avoid } }
"""

CAPTIONS = {
    "parameters": "Each parameter with its standard error, and the information by flight",
    "convergence": "Convergence of the fit",
    "correlation": "Correlation of the estimates",
    "overlay": "Measured motion and model",
    "residuals": "Residuals, with their expected band",
    "prediction_error": "Prediction error against horizon",
    "residual_wrench": "Unexplained force and torque over time",
    "residual_share": "What explains the residual, channel by channel",
    "residual_against_all": "Residual against every variable",
    "residual_against": "Residual against what explains it",
    "residual_path": "Where on the path the models fail",
    "residual_against_speed": "Unexplained force against air speed",
    "repeated": "Repeated trials",
}
WIDE = ("residual_against_all",)
"""Pictures of so many panels that the page's width is too little to read them."""
AXES = "SI units, body axes x forward, y left, z up."
LETTERS = (
    "F is force, M torque, T rotor thrust, L rotor lift, v velocity through the air, w turning rate, n rotor speed."
)
SHOWN = {"position": ("mm", 1e3), "velocity": ("m/s", 1.0), "attitude": ("deg", 57.29578), "rate": ("rad/s", 1.0)}
"""Units of the table of prediction errors."""


def write(
    path: Path,
    result: Identification | Mapping[str, Identification],
    *,
    comparison: Comparison | None = None,
    logs: Sequence[LogReport] = (),
    trials: Sequence[Identification] = (),
) -> Path:
    """Write the report; pictures are inside the file.

    Args:
        result: one fit, or one per stage as `identify_in_stages` returns them.
        comparison: of models on flights that were not fitted.
        logs: what the checks of the logs found.
        trials: fits of repeated trials, drawn as estimates over trials.
    """
    stages = {"": result} if isinstance(result, Identification) else dict(result)
    last = list(stages.values())[-1]
    parts = [_head(stages), _logs(logs)]
    with tempfile.TemporaryDirectory() as folder:
        for name, fit in stages.items():
            parts.append(_fit(name, fit, Path(folder) / (name or "fit")))
        if trials:
            repeated = plots.repeated(trials, last.free_names, Path(folder) / "repeated.svg")
            parts += ["<h2>Repeated trials</h2>", picture(repeated)]
        if comparison is not None:
            parts.append(_comparison(comparison))
            parts += [picture(p) for p in plots.comparison(comparison, Path(folder))]
    return write_page(Path(path), f"Identification of {last.vehicle.name}", "".join(parts))


def write_comparison(
    path: Path, comparison: Comparison, wrench: WrenchErrors | None = None, judged: Judged | None = None
) -> Path:
    """Write a page about models on flights; pictures are inside the file.

    Args:
        wrench: force and moment of the same models against what was measured.
        judged: the same models by a protocol.
    """
    models = "".join(
        f"<tr><td>{escape(name)}</td><td class='word'>{escape(', '.join(v.effects))}</td></tr>"
        for name, v in comparison.models.items()
    )
    with tempfile.TemporaryDirectory() as folder:
        pictures = "".join(picture(p) for p in plots.comparison(comparison, Path(folder)))
    verdict = f"<div class='verdict'>{_comparison_verdict(comparison)}</div>"
    head = f"<h1>Comparison of models</h1>{stamp(f'{AXES} {LETTERS}')}{verdict}"
    tables = table(("model", "effects"), models, words=1)
    tables += _protocol(judged) if judged is not None else ""
    tables += _wrench(wrench) if wrench is not None else ""
    tables += _comparison(comparison)
    body = f"{head}{tables}{pictures}"
    return write_page(Path(path), "Comparison of models", body)


def _comparison_verdict(comparison: Comparison) -> str:
    """Who predicts best, by how much, and what tells most of what each model leaves."""
    at = HORIZONS_S.index(JUDGED_S)
    errors = {name: [found[quantity][at] for quantity in QUANTITIES] for name, found in comparison.errors.items()}
    first, *others = errors
    best = min(errors, key=lambda name: errors[name][0])
    lines = []
    if others:
        off_mm = 1000.0 * errors[best][0]
        lines.append(f"<b>{escape(best)}</b> predicts the position best: {off_mm:.3g} mm after {JUDGED_S:g} s.")
    for name in others:
        changes = zip(QUANTITIES, errors[name], errors[first], strict=True)
        said = ", ".join(f"{quantity} {new / old - 1.0:+.0%}" for quantity, new, old in changes).replace("-", "−")
        lines.append(f"{escape(name)} against {escape(first)}: {said}.")
    for name, residuals in comparison.residuals.items():
        channel, variable, share = residual_plots.most_telling(residuals)
        curve = "a constant" if variable == "constant" else f"a curve against {words.variable(variable)} ({variable})"
        told = (
            f"{curve} predicts {share:.0%} of what is left of the {words.channel(channel)} ({channel})"
            if share > residual_plots.NOTABLE
            else "no curve of one variable predicts what is left"
        )
        lines.append(f"What {escape(name)} leaves unexplained: {told}, {explained.judged_how(residuals)}.")
    lines += [f"<b class='bad'>{escape(remark)}.</b>" for remark in comparison.remarks]
    lines += [f"{escape(sentence)}." for sentence in comparison.left_out]
    return "".join(f"<p>{line}</p>" for line in lines)


def write_page(path: Path, title: str, body: str, style: str = "") -> Path:
    """Write a whole page in our style."""
    page = (
        f"<!doctype html><html lang='en'><head><meta charset='utf-8'>"
        f"<meta name='viewport' content='width=device-width, initial-scale=1'><title>{escape(title)}</title>"
        f"<style>{STYLE}{style}</style></head><body>{body}</body></html>\n"
    )
    with file_format.atomic_file(path) as temporary:
        temporary.write_text(page, encoding="utf-8")
    return path


def stamp(sentences: str) -> str:
    """Version and time, and what else the small print under a heading says (HTML)."""
    now = datetime.now(UTC).strftime("%Y-%m-%d %H:%M UTC")
    return f"<p class='small'>goshawk {version('goshawk')}, {now}. {sentences}</p>"


def _head(stages: Mapping[str, Identification]) -> str:
    how = "Joint maximum likelihood over states, parameters and noise levels"
    last = list(stages.values())[-1]
    verdicts = "".join(
        f"<div>{escape(name.capitalize() or 'Fit')}: {_verdict(fit)}</div>" for name, fit in stages.items()
    )
    return (
        f"<h1>Identification of {escape(last.vehicle.name)}</h1>"
        f"{stamp(f'{how}. All values in {AXES}')}"
        f"<div class='verdict'>{verdicts}<p>{_known(last)}</p></div>"
        f"<p>Model: {escape(', '.join(last.vehicle.effects))}.</p>"
    )


def _known(result: Identification) -> str:
    """How much was estimated from what, and how well."""
    free = [e for e in result.parameters if e.status == "free" and not e.name.startswith("pose_sensor")]
    seconds = sum(float(f.time_s[-1] - f.time_s[0]) for f in result.flights)
    held = [e.name for e in result.parameters if e.status == NOT_IDENTIFIABLE]
    unsettled = [e.name for e in result.parameters if e.status == NOT_SETTLED]
    said = f"{len(free)} numbers of the vehicle from {len(result.flights)} flights, {seconds:.0f} s."
    shares = {e.name: e.std_robust / abs(e.value) for e in free if e.std_robust < abs(e.value)}
    loose = [e.name for e in free if e.name not in shares]
    if shares:
        worst = max(shares, key=lambda name: shares[name])
        said += f" Standard errors up to {shares[worst]:.0%} ({escape(worst)})."
    if loose:
        said += f" Not significantly different from zero: {escape(', '.join(loose))}."
    if held:
        said += f" Held, because they are not identifiable from these flights: {escape(', '.join(held))}."
    if unsettled:
        said += f" Held, because the fit did not settle with them free: {escape(', '.join(unsettled))}."
    return said


def _verdict(result: Identification) -> str:
    steps = len(result.solution.record)
    said = f"converged in {steps} steps." if result.converged else f"not converged after {steps} steps."
    style = {Use.USABLE: "good", Use.DOUBTFUL: "held", Use.PREDICTION: "held", Use.REJECTED: "bad"}[result.verdict.use]
    reasons = result.verdict.reasons
    listed = f"<ul>{''.join(f'<li>{escape(reason)}</li>' for reason in reasons)}</ul>" if reasons else ""
    mark = purpose.mark_sentence(result.vehicle)
    physical = f" The model is {escape(mark)}." if mark else " Every parameter is within what mass and size allow."
    return f"<b class='{style}'>{result.verdict.use}</b>; {said}{physical}{listed}"


def _fit(stage: str, result: Identification, folder: Path) -> str:
    heading = f"<h1>Stage: {escape(stage)}</h1>" if stage else ""
    findings = "".join(f"<li>{escape(sentence)}</li>" for sentence in result.findings)
    flights = "".join(
        f"<tr><td>{escape(f.name)}</td><td>{f.time_s[-1] - f.time_s[0]:.1f}</td><td>{len(f)}</td></tr>"
        for f in result.flights
    )
    return "".join(
        (
            heading,
            f"<h2>To read first</h2><ul>{findings}</ul>",
            _parameters(result.parameters),
            f"<h2>Flights</h2>{table(('flight', 'length (s)', 'nodes'), flights)}",
            _noise(result),
            "<h2>Pictures</h2>",
            *(picture(p) for p in plots.identification(result, folder)),
        )
    )


def _parameters(estimates: Sequence[Estimate]) -> str:
    rows = []
    for e in estimates:
        if e.status == "free":
            share = f"{100.0 * e.std_robust / abs(e.value):.2g}" if e.std_robust < abs(e.value) else ">100"
            cells = (
                f"{e.value:.5g}",
                f"{e.std_robust:.2g}",
                f"{e.std:.2g}",
                share,
                f"{e.interval90:.2g}",
                f"{e.start:.5g}",
            )
        else:
            cells = (f"{e.value:.5g}", "", "", "", "", f"{e.start:.5g}")
        style = "" if e.status == "free" else " class='held'"
        numbers = "".join(f"<td>{c}</td>" for c in cells)
        words = f"<td class='word'>{escape(e.unit)}</td><td class='word'>{e.status}</td>"
        rows.append(f"<tr{style}><td>{escape(e.name)}</td>{numbers}{words}</tr>")
    head = ("parameter", "value", "± robust", "± plain", "robust, %", "90 % ±", "start", "unit", "status")
    note = (
        "<p class='small'>± is one standard error. The robust one allows for errors correlated in time and for forms "
        "that are slightly wrong; believe that one, and the 90 % interval made of it. "
        "Not identifiable from these flights: held.</p>"
    )
    return f"<h2>Parameters</h2>{table(head, ''.join(rows), words=2)}{note}"


def _noise(result: Identification) -> str:
    noise = result.noise
    process = noise.process
    sensors = [b for b in BLOCKS if b.channels and b.name in noise.levels and b.name != MOTION]
    levels = [
        *(
            (f"{b.name}: {c.name.replace('_', ' ')}", f"{c.scale * b.channel_level(c, noise):.2f} {c.unit}")
            for b in sensors
            if any(b.acts(flight, noise) for flight in result.flights)
            for c in b.channels
        ),
        ("unmodelled acceleration x, y, z", f"{_listed(process[:3])} m/s² √s"),
        ("unmodelled angular acceleration x, y, z", f"{_listed(process[3:])} rad/s² √s"),
    ]
    if noise.gusts is not None:
        size, lasts_s = noise.gusts.size, noise.gusts.lasts_s
        levels += [
            ("disturbance that lasts, world x, y, z", f"{_listed(size[:3])} m/s² for {_listed(lasts_s[:3])} s"),
            ("turning disturbance that lasts, x, y, z", f"{_listed(size[3:])} rad/s² for {_listed(lasts_s[3:])} s"),
        ]
    rows = "".join(f"<tr><td>{name}</td><td class='word'>{value}</td></tr>" for name, value in levels)
    statistics = "".join(
        f"<tr><td>{name}</td><td>{s['rms']:.2f}</td><td>{s['lag_one']:+.2f}</td></tr>"
        for name, s in residual_statistics(result).items()
        if s["rms"] > 0.0
    )
    note = (
        "<p class='small'>Residuals over the noise found. Those of the sensors have an rms of 1 or a little less and "
        "no correlation with the next when the model is right. Force and torque are what the smoother leaves to the "
        "model's noise: below 1 and smooth in time by nature, the more so the noisier the pose.</p>"
    )
    head = ("channel", "rms", "correlation with the next")
    tables = table(("noise as estimated", ""), rows, words=1) + table(head, statistics)
    return f"<h2>Noise and residuals</h2>{tables}{note}"


def _listed(values: Iterable[float]) -> str:
    return ", ".join(f"{v:.3g}" for v in values)


def _comparison(comparison: Comparison) -> str:
    rows = "".join(
        f"<tr><td>{escape(model)}</td><td class='word'>{quantity} ({unit})</td>"
        + "".join(f"<td>{scale * value:.3g}</td>" for value in comparison.errors[model][quantity])
        + "</tr>"
        for quantity, (unit, scale) in SHOWN.items()
        for model in comparison.models
    )
    flights = ", ".join(escape(f.name) for f in comparison.flights)
    head = ("model", "rms error after", *(f"{h:g} s" for h in HORIZONS_S))
    note = (
        f"<p class='small'>Open loop, with the measured rotor speeds, from {comparison.predictions} starts. Position "
        f"and attitude against the pose sensor, velocity and rate against states smoothed with "
        f"{escape(next(iter(comparison.models)))}.</p>"
    )
    return f"<h2>Prediction on {flights}</h2>{table(head, rows)}{note}"


def _wrench(wrench: WrenchErrors) -> str:
    """Errors of force and moment, axis by axis, and the share explained."""
    units = [residual_plots.unit(channel) for channel in CHANNELS]

    def row(name: str, values: Iterable[str]) -> str:
        return f"<tr><td>{escape(name)}</td>{''.join(f'<td>{value}</td>' for value in values)}</tr>"

    rows = row("none (measured)", (f"{s * v:.3g}" for (s, _), v in zip(units, wrench.size, strict=True)))
    for name, rmse in wrench.rmse.items():
        both = zip(units, rmse, wrench.explained[name], strict=True)
        rows += row(name, (f"{s * v:.3g} ({share:.0%})" for (s, _), v, share in both))
    head = ("model", *(f"{channel} ({unit})" for channel, (_, unit) in zip(CHANNELS, units, strict=True)))
    force = "the accelerometer" if wrench.accelerometer else "the measured velocity"
    note = (
        f"<p class='small'>Root mean square of measured less modelled, means over {SPAN_S:g} s; in brackets the share "
        f"of the variance explained (negative: worse than the mean). Force by {force}, moment by the measured rate; "
        "lever arms are taken out.</p>"
    )
    open_ = "".join(f"<p class='bad'>{escape(sentence)}.</p>" for sentence in wrench.not_converged)
    return f"<h2>Force and moment</h2>{table(head, rows)}{open_}{note}"


def _protocol(judged: Judged) -> str:
    """Errors by a protocol, pooled over all flights."""
    rows = "".join(
        f"<tr><td>{escape(way.name)}</td>{''.join(f'<td>{e:.3f}</td>' for e in judged.pooled(way).values())}</tr>"
        for way in judged.errors
    )
    head = ("predictor", *(f"{quantity} ({unit})" for quantity, unit in QUANTITIES.items()))
    findings = "".join(f"<p>{escape(finding)}.</p>" for finding in judged.findings)
    note = (
        f"<p class='small'>Mean absolute error {judged.protocol.horizon_s:g} s after each of {sum(judged.starts)} "
        f"measured states. What each knows: {escape(KNOWS)}.</p>"
    )
    return f"<h2>Protocol {judged.protocol.name}</h2>{table(head, rows)}{findings}{note}"


def _logs(logs: Sequence[LogReport]) -> str:
    if not logs:
        return ""
    items = [
        f"<li class='{f.level}'>{escape(report.name)}: {escape(f.sentence)}. <i>Fix: {escape(f.fix)}.</i></li>"
        for report in logs
        for f in report.findings
    ]
    found = "".join(items) or "<li class='good'>nothing found</li>"
    return f"<h2>Checks of the logs</h2><ul>{found}</ul><p class='small'>Nothing was changed in any log.</p>"


def table(head: Sequence[str], rows: str, *, words: int = 0) -> str:
    """A table; the last `words` columns are text."""
    marks = ["" if i < len(head) - words else " class='word'" for i in range(len(head))]
    cells = "".join(f"<th{mark}>{name}</th>" for mark, name in zip(marks, head, strict=True))
    return f"<div class='scroll'><table><thead><tr>{cells}</tr></thead><tbody>{rows}</tbody></table></div>"


def picture(path: Path, caption: str = "") -> str:
    """An SVG file as part of the page, under its caption."""
    kind = path.stem.rstrip("0123456789").rstrip("_")
    caption = caption or CAPTIONS.get(kind, path.stem)
    data = base64.b64encode(path.read_bytes()).decode()
    mark = " class='wide'" if kind in WIDE else ""
    image = f"<img{mark} alt='{escape(caption)}' src='data:image/svg+xml;base64,{data}'>"
    return f"<h3>{caption}</h3><div class='scroll'>{image}</div>"
