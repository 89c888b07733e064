"""A flight log as one offline HTML page: a plot of every stream, with the checks' findings on the time axis."""

import base64
import html
import json
from importlib import resources
from typing import Any

import numpy as np

from flight import FlightLog, FloatArray
from flight.flight_log import COLUMNS
from goshawk.terminal.words import component, named
from sysid.logs.check import LogReport
from sysid.logs.checks.finding import Finding

MOST_POINTS = 20_000
"""Most instants drawn; of a longer log the smallest and largest value of every few rows are kept."""

_STYLE = """
body { font: 15px/1.5 sans-serif; margin: 0 auto; max-width: 1200px; padding: 0 1em 3em; color: #222; }
h1 { font-size: 1.4em; } h3 { font-size: .95em; font-weight: normal; margin: .8em 0 0; } h3 span { margin-left: 1em; }
canvas { width: 100%; height: 150px; cursor: crosshair; } table { border-collapse: collapse; }
td { padding: .15em .8em .15em 0; vertical-align: top; } .error { color: #b30000; } .warning { color: #a05a00; }
nav { position: sticky; top: 0; background: #fff; padding: .4em 0; border-bottom: 1px solid #ddd; }
@media print { body { max-width: none; } nav, li button { display: none; } section { break-inside: avoid; } }
"""


def page(log: FlightLog, report: LogReport, facts: dict[str, str]) -> str:
    """The page's text.

    Args:
        facts: rows of the table at its top.
    """
    kept, stored = thinned(log)
    data = {
        "time": _packed(kept, np.float64),
        "panels": [_panel(title, unit, streams, stored) for title, unit, streams in panels(log)],
        "marks": [{"level": f.level, "spans": [list(s) for s in f.spans]} for f in report.findings if f.spans],
    }
    title = html.escape(report.name)
    rows = "".join(f"<tr><td>{html.escape(k)}</td><td>{html.escape(v)}</td></tr>" for k, v in facts.items())
    found = "".join(_finding(f) for f in report.findings) or "<li>The checks found no fault.</li>"
    found += "".join(f"<li><b>inconclusive</b>: {html.escape(sentence)}</li>" for sentence in report.inconclusive)
    found += "".join(f"<li><b>note</b>: {html.escape(sentence)}</li>" for sentence in report.notes)
    thin = f" Drawn are {len(kept)} of {len(log)} instants." if len(kept) < len(log) else ""
    script = resources.files("goshawk.commands.learn").joinpath("log_report.js").read_text(encoding="utf-8")
    # `<` is written as an escape: no text in a log can end the script element
    packed = json.dumps(data).replace("<", "\\u003c")
    return f"""<!doctype html>
<html lang="en"><head><meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1"><title>{title}</title>
<style>{_STYLE}</style></head><body>
<h1>{title}</h1><table>{rows}</table>
<h2>What the checks found</h2><ul>{found}</ul>
<nav><button id="all">whole flight</button> <b id="at"></b>
Drag to zoom, wheel to zoom about the cursor, double click for the whole flight.{thin}</nav>
<div id="panels"></div>
<script type="application/json" id="data">{packed}</script>
<script>{script}</script></body></html>
"""


def _finding(finding: Finding) -> str:
    places = "".join(
        f' <button data-span="{a},{b}">{a:.2f} s</button>' for a, b in finding.spans[:20] if np.isfinite([a, b]).all()
    )
    words = f"<b>{finding.level}</b>: {html.escape(finding.sentence)}; {html.escape(finding.fix)}"
    return f'<li class="{finding.level}">{words}{places}</li>'


def panels(log: FlightLog) -> list[tuple[str, str, dict[str, str]]]:
    """Title, unit and columns by label of every panel: vectors together, every other column on its own."""
    found, used = [], {"time_s"}
    for quantity, columns in COLUMNS.items():
        there = [name for name in columns if name in log.columns]
        if there:
            title, unit = named(quantity)
            found.append((title, unit, {component(name): name for name in there}))
            used |= set(there)
    for name in log.columns:
        if name not in used:
            title, unit = named(name)
            found.append((title, unit, {"": name}))
    return found


def _panel(title: str, unit: str, streams: dict[str, str], stored: dict[str, FloatArray]) -> dict[str, Any]:
    packed = [
        # a stream slower than the log has NaN between its samples, which are joined; any other NaN is a gap
        {
            "label": label,
            "sparse": float(np.isnan(stored[name]).mean()) > 0.3,
            "data": _packed(stored[name], np.float32),
        }
        for label, name in streams.items()
    ]
    return {"title": title, "unit": unit, "streams": packed}


def thinned(log: FlightLog) -> tuple[FloatArray, dict[str, FloatArray]]:
    """Instants and columns as drawn: all of them, or the extremes of runs of rows, so that no spike is lost."""
    run = -(-2 * len(log) // MOST_POINTS)
    if run <= 2:
        return log.time_s, dict(log.columns)
    runs = len(log) // run
    cut = runs * run
    time_s = log.time_s[:cut].reshape(runs, run)[:, [0, run // 2]].ravel()
    stored = {}
    for name, values in log.columns.items():
        block = values[:cut].reshape(runs, run)
        known = np.isfinite(block)
        low = np.where(known, block, np.inf).min(axis=1)
        high = np.where(known, block, -np.inf).max(axis=1)
        pair = np.stack([low, high], axis=1)
        rising = block[:, -1] >= block[:, 0]
        pair[~rising] = pair[~rising][:, ::-1]
        stored[name] = np.where(np.isfinite(pair), pair, np.nan).ravel()
    return time_s, stored


def _packed(values: FloatArray, kind: type) -> str:
    """Little-endian numbers as base64."""
    plain = np.where(np.isfinite(values), values, np.nan)
    return base64.b64encode(plain.astype(np.dtype(kind).newbyteorder("<")).tobytes()).decode()
