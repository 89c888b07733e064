"""A plan as one offline HTML page: path, clearance, speed, tilt, rotors, and the limit that binds in each segment."""

import html
from dataclasses import dataclass

import numpy as np

from flight import FloatArray, TrajectoryFile
from planner import GateReport
from planner.gate import could_hide, limits
from planner.gate.limits import Check
from planner.request import space
from vehicle import Limits, Vehicle, flatness

_STEP_S = 0.02
_WIDTH, _HEIGHT, _EDGE = 900, 170, 45
_COLOURS = ("#1f5fa8", "#b35900", "#2b7a3d", "#8a2be2")
_SCALE = (
    "#440154", "#482475", "#414487", "#355f8d", "#2a788e", "#21918c", "#22a884", "#44bf70", "#7ad151", "#bddf26",
)  # fmt: skip
"""Viridis at equal steps: colour-blind-safe, the end at the limit stands out from white paper."""
_PLENTY_ABOVE_M = 0.7
"""Clearance this far above what is required has the last colour."""
_STYLE = """
body { font: 15px/1.5 sans-serif; margin: 0 auto; max-width: 1000px; padding: 0 1em 3em; color: #222; }
h1 { font-size: 1.4em; } h2 { font-size: 1.1em; margin: 1.4em 0 0; } svg { width: 100%; height: auto; }
table { border-collapse: collapse; } td, th { padding: .15em .9em .15em 0; text-align: left; }
td.number { text-align: right; white-space: nowrap; }
.fails { color: #b30000; } text { font: 12px sans-serif; fill: #555; }
text.bound { fill: #b30000; text-anchor: end; } .key { font-weight: normal; }
.scroll { overflow-x: auto; } .scroll svg { min-width: 560px; }
@media print {
  body { max-width: none; font-size: 11px; print-color-adjust: exact; -webkit-print-color-adjust: exact; }
  h2 { break-after: avoid; } svg, tr { break-inside: avoid; }
  .scroll { overflow: visible; } .scroll svg { min-width: 0; }
}
"""


@dataclass(frozen=True, slots=True, eq=False)
class _Chart:
    """Curves over time, with the bounds they must keep."""

    title: str
    unit: str
    curves: dict[str, FloatArray]
    bounds: tuple[float, ...] = ()


def page(item: TrajectoryFile, report: GateReport, field: space.DistanceField, drone: Vehicle, bounds: Limits) -> str:
    """The page's text.

    Args:
        report: the gate's, asked just now for this map and vehicle.
        bounds: limits that the plan was held to.
    """
    path = item.trajectory
    times = path.sample(max(_STEP_S, path.duration_s / 3000.0))
    position, joins = path.position(times), path.position(path.starts_s)
    charts = "".join(_drawn(chart, times, path.starts_s) for chart in _charts(item, field, drone, bounds, times))
    facts = {
        "verdict": "passes the gate" if report.passed else "may not be flown",
        "duration": f"{path.duration_s:.2f} s",
        "clearance, proved": f"{report.clearance_m:.3f} m, {report.required_clearance_m:.3f} m required",
        "could hide": could_hide.describe(report),
        "segments": str(len(path.durations_s)),
    }
    rows = "".join(f"<tr><td>{html.escape(k)}</td><td>{html.escape(v)}</td></tr>" for k, v in facts.items())
    title = html.escape(f"Plan {item.name}")
    return f"""<!doctype html>
<html lang="en"><head><meta charset="utf-8">
<meta http-equiv="Content-Security-Policy" content="default-src 'none'; style-src 'unsafe-inline'">
<meta name="viewport" content="width=device-width, initial-scale=1">
<title>{title}</title><style>{_STYLE}</style></head><body>
<h1>{title}</h1><table>{rows}</table>
<h2>Path from above</h2>
{_map(position, np.asarray(field.distance(position)), report.required_clearance_m, joins, item.waypoints_world_m)}
{charts}
<h2>Segments</h2>{_segments(report)}
<h2>Checks of the gate</h2>{_checks(report)}
</body></html>
"""


def _charts(
    item: TrajectoryFile, field: space.DistanceField, drone: Vehicle, bounds: Limits, times: FloatArray
) -> list[_Chart]:
    path = item.trajectory
    state = flatness.state(drone, path, times)
    rotor = state.rotor_speed_rad_s
    required = float(item.check.get("required_clearance_m", np.nan))
    return [
        _Chart("Clearance", "m", {"": np.asarray(field.distance(path.position(times)))}, (required,)),
        _Chart("Speed", "m/s", {"": np.linalg.norm(path.position(times, 1), axis=1)}, (bounds.speed_m_s,)),
        _Chart("Tilt", "°", {"": np.degrees(state.tilt_rad)}, (float(np.degrees(bounds.tilt_rad)),)),
        _Chart(
            "Rotor speed",
            "rad/s",
            {f"rotor {i}": rotor[:, i] for i in range(rotor.shape[1])},
            (bounds.rotor_speed_min_rad_s, bounds.rotor_speed_max_rad_s),
        ),
    ]


def _drawn(chart: _Chart, times: FloatArray, joins_s: FloatArray) -> str:
    values = np.concatenate([*chart.curves.values(), chart.bounds])
    finite = values[np.isfinite(values)]
    low, high = min(0.0, float(finite.min())), float(finite.max()) * 1.05 + 1e-9
    x = _EDGE + (times / times[-1]) * (_WIDTH - _EDGE)

    def y(value: FloatArray | float) -> FloatArray:
        return _HEIGHT - 20.0 - (np.asarray(value, dtype=np.float64) - low) / (high - low) * (_HEIGHT - 30.0)

    parts = [f'<text x="0" y="{y(v) + 4.0:.1f}">{_short(v)}</text>' for v in (low, high)]
    for t in joins_s:
        at = _EDGE + t / times[-1] * (_WIDTH - _EDGE)
        parts.append(f'<line x1="{at:.1f}" y1="5" x2="{at:.1f}" y2="{_HEIGHT - 20}" stroke="#eee"/>')
    for bound in chart.bounds:
        if np.isfinite(bound):
            parts.append(
                f'<line x1="{_EDGE}" y1="{y(bound):.1f}" x2="{_WIDTH}" y2="{y(bound):.1f}" stroke="#b30000" '
                f'stroke-dasharray="5 4"/><text class="bound" x="{_WIDTH}" y="{y(bound) - 3.0:.1f}">'
                f"limit {_short(bound)} {chart.unit}</text>"
            )
    for colour, curve in zip(_COLOURS, chart.curves.values(), strict=False):
        for first, last in _runs(np.isfinite(curve)):
            points = " ".join(f"{a:.1f},{b:.1f}" for a, b in zip(x[first:last], y(curve[first:last]), strict=True))
            parts.append(f'<polyline points="{points}" fill="none" stroke="{colour}"/>')
    parts.append(f'<text x="{_EDGE}" y="{_HEIGHT - 4}">0</text>')
    parts.append(f'<text x="{_WIDTH - 40}" y="{_HEIGHT - 4}">{times[-1]:.2f} s</text>')
    names = zip(_COLOURS, chart.curves, strict=False)
    key = "".join(f' <span class="key" style="color: {c}">{html.escape(name)}</span>' for c, name in names)
    return f"<h2>{chart.title}, {chart.unit}{key}</h2>" + _svg(_WIDTH, _HEIGHT, parts)


def _short(value: float) -> str:
    """Three digits, and no power of ten for rotor speeds."""
    return f"{value:.3g}" if abs(value) < 1000.0 else f"{value:.0f}"


def _runs(good: np.ndarray) -> list[tuple[int, int]]:
    """First and past-the-last index of each run of true values."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], good, [False]]).astype(int)))
    return [(int(a), int(b)) for a, b in zip(edges[::2], edges[1::2], strict=True)]


def _map(
    position: FloatArray, clearance_m: FloatArray, required_m: float, joins: FloatArray, waypoints: FloatArray
) -> str:
    """The path coloured by clearance, dark where it is closest to what is required."""
    low, high = position[:, :2].min(axis=0) - 0.5, position[:, :2].max(axis=0) + 0.5
    scale = min((_WIDTH - 20) / (high[0] - low[0]), 420.0 / (high[1] - low[1]))
    width, height = scale * (high - low)

    def at(point: FloatArray) -> str:
        return f"{scale * (point[0] - low[0]):.1f},{height - scale * (point[1] - low[1]):.1f}"

    share = np.nan_to_num((clearance_m - required_m) / _PLENTY_ABOVE_M, nan=0.0)
    shades = np.clip(share * len(_SCALE), 0, len(_SCALE) - 1).astype(int)
    parts = []
    for first, last in zip(*_stretches(shades), strict=True):
        points = " ".join(map(at, position[first : last + 1]))
        parts.append(f'<polyline points="{points}" fill="none" stroke="{_SCALE[shades[first]]}" stroke-width="3"/>')
    for point in joins:
        x, y = at(point).split(",")
        parts.append(f'<circle cx="{x}" cy="{y}" r="2" fill="#888"/>')
    for i, point in enumerate(waypoints, start=1):
        x, y = at(point).split(",")
        label = f"<title>waypoint {i}: {point[0]:.2f}, {point[1]:.2f}, {point[2]:.2f}</title>"
        parts.append(f'<circle cx="{x}" cy="{y}" r="5" fill="{_COLOURS[1]}">{label}</circle>')
        parts.append(f'<text x="{float(x) + 7:.1f}" y="{float(y) - 5:.1f}">{i}</text>')
    y_bar, x_end = height - 8.0, 10.0 + scale
    parts.append(f'<line x1="10" y1="{y_bar:.1f}" x2="{x_end:.1f}" y2="{y_bar:.1f}" stroke="#555" stroke-width="3"/>')
    parts.append(f'<text x="10" y="{y_bar - 6.0:.1f}">1 m</text>')
    boxes = [f'<rect x="{20 * i}" y="0" width="20" height="12" fill="{shade}"/>' for i, shade in enumerate(_SCALE)]
    legend = f'<svg viewBox="0 0 {_WIDTH} 12" role="img" aria-label="Colours of clearance">{"".join(boxes)}</svg>'
    words = f"Clearance from {required_m:.2f} m, which is required (left), to {required_m + _PLENTY_ABOVE_M:.2f} m."
    return f"{_svg(width, height, parts)}<p>{words}</p>{legend}"


def _stretches(shades: np.ndarray) -> tuple[FloatArray, FloatArray]:
    """First sample of each stretch of one shade, and the first one of the next stretch, or the last of all."""
    edges = np.flatnonzero(np.diff(shades)) + 1
    return np.concatenate([[0], edges]), np.concatenate([edges, [len(shades) - 1]])


def _svg(width: float, height: float, parts: list[str]) -> str:
    """As large as it was drawn for at most: a small or tall picture is not blown up to the page's width."""
    size = f'viewBox="0 0 {width:.0f} {height:.0f}" style="max-width: {width:.0f}px"'
    return f"<div class='scroll'><svg {size}>{''.join(parts)}</svg></div>"


def _segments(report: GateReport) -> str:
    """Per segment: share of each limit that is used, and the one that binds."""
    usage = report.usage
    if usage is None:
        return "<p>The vehicle's model has no answer for this motion.</p>"
    names = [limits.NAMES[i] for i in np.flatnonzero(usage.limited)]
    heads = "".join(f"<th>{html.escape(name)}</th>" for name in ("segment", *names, "binds"))
    rows: list[str] = []
    for i, binding in enumerate(usage.binding):
        shares = "".join(f'<td class="number">{100.0 * share:.0f} %</td>' for share in usage.share[usage.limited, i])
        rows.append(f'<tr><td class="number">{i}</td>{shares}<td>{html.escape(binding)}</td></tr>')
    return "<p>Share of each limit that is used at most.</p>" + _table(heads, "".join(rows))


def _checks(report: GateReport) -> str:
    rows = "".join(
        f'<tr class="{"" if check.passed else "fails"}"><td>{html.escape(check.name)}</td>'
        f'<td class="number">{_value(check.value, check)}</td><td class="number">{_value(check.bound, check)}</td>'
        f"<td>{'passes' if check.passed else 'fails'}</td><td>{html.escape(check.reason)}</td></tr>"
        for check in report.checks
    )
    heads = "<th>check</th><th>value</th><th>bound</th><th>result</th><th>why</th>"
    return _table(heads, rows)


def _value(value: float, check: Check) -> str:
    """With its unit; empty for a check that is kept or not, without a size."""
    return f"{value:.4g} {html.escape(check.unit.replace('s2', 's²').replace('s3', 's³'))}" if check.unit else ""


def _table(heads: str, rows: str) -> str:
    return f'<div class="scroll"><table><tr>{heads}</tr>{rows}</table></div>'
