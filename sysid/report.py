"""One self-contained HTML page per fit: what was found, how sure, how it got there, and what to read twice."""

import base64
import tempfile
from collections.abc import Sequence
from html import escape
from pathlib import Path

from flight import file_format
from sysid import plots
from sysid.comparison import HORIZONS_S, QUANTITIES, Comparison
from sysid.log_check import LogReport
from sysid.result import Identification

STYLE = """
body { font: 15px/1.5 system-ui, sans-serif; color: #2b2b2b; max-width: 1180px; margin: 2em auto; padding: 0 1em }
h1 { font-size: 1.5em } h2 { font-size: 1.15em; margin-top: 2em; border-bottom: 1px solid #ddd }
table { border-collapse: collapse; font-variant-numeric: tabular-nums }
td, th { padding: .2em .9em .2em 0; text-align: right }
td:first-child, th:first-child { text-align: left; font-family: ui-monospace, monospace; font-size: .92em }
tr:nth-child(even) { background: #f7f7f7 } img { width: 100% } .held { color: #999 } li.error { color: #b0413e }
"""


def write(
    path: Path,
    result: Identification,
    *,
    comparison: Comparison | None = None,
    logs: Sequence[LogReport] = (),
) -> Path:
    """Write the report; pictures are inside the file."""
    parts = [_head(result), _parameters(result)]
    with tempfile.TemporaryDirectory() as folder:
        parts += [_picture(p) for p in plots.identification(result, Path(folder))]
        if comparison is not None:
            parts.append(_comparison(comparison))
            parts += [_picture(p) for p in plots.comparison(comparison, Path(folder))]
    parts += [_noise(result), _logs(logs)]
    page = (
        f"<!doctype html><html lang='en'><meta charset='utf-8'><title>Identification of {escape(result.vehicle.name)}"
    )
    page += f"</title><style>{STYLE}</style><body>{''.join(parts)}</body></html>"
    with file_format.atomic_file(Path(path)) as temporary:
        temporary.write_text(page, encoding="utf-8")
    return Path(path)


def _head(result: Identification) -> str:
    flights = ", ".join(f"{escape(f.name)} ({f.time_s[-1] - f.time_s[0]:.1f} s)" for f in result.flights)
    steps = len(result.solution.record)
    verdict = f"converged in {steps} steps" if result.converged else f"<b>not converged after {steps} steps</b>"
    findings = "".join(f"<li>{escape(sentence)}</li>" for sentence in result.findings)
    return (
        f"<h1>Identification of {escape(result.vehicle.name)}</h1>"
        f"<p>Model: {escape(', '.join(result.vehicle.effects))}. Flights: {flights}. "
        f"Joint maximum likelihood, {verdict}.</p><h2>To read first</h2><ul>{findings}</ul>"
    )


def _parameters(result: Identification) -> str:
    rows = []
    for e in result.parameters:
        if e.status == "free":
            cells = (f"{e.value:.5g}", f"{e.std_robust:.2g}", f"{e.std:.2g}", f"{e.start:.5g}", escape(e.unit))
        else:
            cells = (f"{e.value:.5g}", e.status, "", f"{e.start:.5g}", escape(e.unit))
        style = "" if e.status == "free" else " class='held'"
        rows.append(f"<tr{style}><td>{escape(e.name)}</td>" + "".join(f"<td>{c}</td>" for c in cells) + "</tr>")
    head = "".join(f"<th>{h}</th>" for h in ("parameter", "value", "robust std", "plain std", "start", "unit"))
    return f"<h2>Parameters</h2><table><tr>{head}</tr>{''.join(rows)}</table>"


def _comparison(comparison: Comparison) -> str:
    head = "".join(f"<th>{h:g} s</th>" for h in HORIZONS_S)
    rows = [
        f"<tr><td>{escape(model)}: {quantity} ({unit})</td>"
        + "".join(f"<td>{value:.4g}</td>" for value in comparison.errors[model][quantity])
        + "</tr>"
        for model in comparison.models
        for quantity, unit in QUANTITIES.items()
    ]
    flights = ", ".join(escape(f.name) for f in comparison.flights)
    return f"<h2>Prediction on {flights}</h2><table><tr><th>rms error after</th>{head}</tr>{''.join(rows)}</table>"


def _noise(result: Identification) -> str:
    sensor, process = result.noise.sensor, result.noise.process
    force, torque = (", ".join(f"{v:.3g}" for v in part) for part in (process[:3], process[3:]))
    return (
        f"<h2>Noise as estimated</h2><p>Pose {1000.0 * sensor.position_m:.2f} mm and {sensor.attitude_rad:.2g} rad. "
        f"Unmodelled acceleration, body axes: {force} m/s² √s; {torque} rad/s² √s.</p>"
    )


def _logs(logs: Sequence[LogReport]) -> str:
    items = [
        f"<li class='{f.level}'>{escape(report.name)}: {escape(f.sentence)}. <i>{escape(f.fix)}</i></li>"
        for report in logs
        for f in report.findings
    ]
    if not logs:
        return ""
    return f"<h2>Checks of the logs</h2><ul>{''.join(items) or '<li>nothing found</li>'}</ul>"


def _picture(path: Path) -> str:
    data = base64.b64encode(path.read_bytes()).decode()
    return f"<p><img alt='{escape(path.stem)}' src='data:image/svg+xml;base64,{data}'></p>"
