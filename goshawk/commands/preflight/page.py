"""A preflight as one offline HTML page: verdict, the flights in the map, the worst three, and what was assumed."""

import json
import math
import re
from collections.abc import Mapping, Sequence
from html import escape
from importlib.metadata import version
from pathlib import Path

import numpy as np

import preflight
from goshawk.commands.preflight import drawing, screen
from goshawk.commands.preflight.like import NOISE, noise_words
from goshawk.commands.preflight.outcome import Outcome
from preflight.core import SETTLE_S
from preflight.worst import Track

_BESIDE = Path(__file__).parent
_POLICY = "default-src 'none'; style-src 'unsafe-inline'; script-src 'unsafe-inline'"
_DEG = math.degrees(1.0)
_LARGEST_SHARES = 8
_CLEAR_M = 2.0
"""Clearance beyond the vehicle from which on the last bar holds all."""


def text(told: Outcome) -> str:
    """The page; nothing in it is loaded from elsewhere, and the same preflight makes the same page."""
    style, script = ((_BESIDE / f"page.{kind}").read_text(encoding="utf-8") for kind in ("css", "js"))
    title = escape(f"Preflight of {told.subject.item.name}")
    flights = json.dumps(_flights(told), allow_nan=False, separators=(",", ":")).replace("<", "\\u003c")
    body = _head(told) + _views(told) + _worst(told) + _spreads(told) + _why(told) + _assumed(told)
    return f"""<!doctype html>
<html lang="en"><head><meta charset="utf-8">
<meta http-equiv="Content-Security-Policy" content="{_POLICY}">
<meta name="viewport" content="width=device-width, initial-scale=1">
<title>{title}</title><style>{style}</style></head><body>
{body}
<script type="application/json" id="flights">{flights}</script><script>{script}</script></body></html>
"""


def _head(told: Outcome) -> str:
    result = told.result
    word = "Go" if result.go else "No-go"
    decides, remedy = screen.decides(result, told.plan_again, told.narrow_waypoints)
    facts = {
        "how sure": f"{_capital(str(result.lost))} with 95 % confidence; lost is to touch anything, to leave the map, "
        f"to overturn, or to come down without a position. {result.beside_flights}",
        "to the end": f"{100.0 * result.finished:.1f} % of the flights",
        "narrowest": screen.place(result) or "not known",
        "decides most": decides,
        **told.advice_words(),
        "next": "fly it" if result.go else remedy,
    }
    subject, place = told.subject, told.subject.area.folder.resolve().name
    short = "" if result.flights == result.wanted else f" Stopped after {result.flights} of {result.wanted} flights."
    return (
        f"<header><h1>Preflight of {escape(subject.item.name)}</h1>"
        f"<p class='small'>{_flights_words(result)} of {escape(subject.vehicle.name)} in {escape(place)}, "
        f"seed {subject.options.seed}, goshawk {version('goshawk')}.{short}</p>"
        f"<p class='verdict{'' if result.go else ' bad'}'>{word}: {escape(result.reason())}.</p>"
        + _definitions({name: value for name, value in facts.items() if value})
        + "</header>"
    )


def _flights_words(result: preflight.Result) -> str:
    if result.rare is None:
        return f"{result.flights} simulated flights"
    return f"{result.rare.risk.flights} simulated flights by levels, the first of {result.flights},"


_FIRST_LEVEL = "of the first level, drawn as they may come; those of later levels, ever nearer to a loss, are not shown"
"""What pictures and counts are of, where the risk was found by levels."""


def _of_first_level(result: preflight.Result) -> str:
    return "" if result.rare is None else f"<p class='small'>Flights {_FIRST_LEVEL}.</p>"


def _definitions(facts: dict[str, str]) -> str:
    rows = "".join(f"<dt>{escape(name)}</dt><dd>{_sentence(value)}</dd>" for name, value in facts.items())
    return f"<dl class='facts'>{rows}</dl>"


def _sentence(said: str) -> str:
    """HTML; what stands in backticks is code."""
    return re.sub("`([^`]*)`", r"<code>\1</code>", escape(_capital(said)))


def _capital(sentence: str) -> str:
    """With a capital letter, unless it begins with a parameter's name."""
    named = re.match(r"\w+[._]\w", sentence)
    return sentence if named else sentence[:1].upper() + sentence[1:]


def _views(told: Outcome) -> str:
    path, field, tube_m = told.subject.item.trajectory, told.subject.area.field, told.result.tube_m()
    beside = drawing.side(told.shown, path, field, tube_m)
    above, (low_m, high_m) = drawing.above(told.shown, path, field, tube_m, told.subject.radius_m)
    shades = "".join(f"<i class='b{i}'></i>" for i in range(drawing.SHADES))
    swatches = {
        "touch": "touches", "dash": "plan", "tube": "tube of 90 and 99 %", "occupied": "obstacle",
        "partly": "obstacle at some of the heights", "unknown": "unknown",
    }  # fmt: skip
    keys = "".join(f"<span><i class='swatch {kind}'></i>{words}</span>" for kind, words in swatches.items())
    scale = f"<span>clearance 0 <span class='scale'>{shades}</span> {drawing.PLENTY_M:g} m and more</span>"
    return (
        f"<section><h2>{len(told.shown.bundle)} of the flights, coloured by clearance</h2><div class='views'>"
        f"<div><h3>From above; obstacles from {low_m:.1f} to {high_m:.1f} m</h3>{above}</div>"
        f"<div><h3>From the side: height along the path, the map unrolled</h3>{beside}"
        f"<h3>Clearance beyond the vehicle</h3>{drawing.over_time(told.shown, path)}</div></div>"
        f"<p class='key'>{scale}{keys}</p>{_of_first_level(told.result)}</section>"
    )


def _worst(told: Outcome) -> str:
    tracks = told.shown.worst
    names = "".join(
        f"<button type='button' data-choose='{i}' aria-pressed='{'true' if i == 0 else 'false'}'>"
        f"{_label(track)}</button>"
        for i, track in enumerate(tracks)
    )
    values = (
        ("time", "time", "s"), ("path", "on the path", "s"), ("clear", "clearance", "m"),
        ("error", "off the path", "m"), ("speed", "speed", "m/s"), ("height", "height", "m"),
    )  # fmt: skip
    cells = "".join(
        f"<div><small>{words}</small><b id='v-{key}'></b> <span>{unit}</span></div>" for key, words, unit in values
    )
    return (
        f"<section><h2>The worst flights</h2>{_of_first_level(told.result)}"
        f"<p id='story'>{escape(_story(tracks[0], told))}</p>"
        "<div class='script'><div class='worst-bar'>"
        f"<div class='choices' role='group' aria-label='Flight'>{names}</div>"
        "<button type='button' id='play'>Play</button>"
        "<input type='range' id='moment' min='0' step='1' value='0' aria-label='Moment of the flight'></div>"
        f"<div class='live-values'>{cells}</div><p class='small'>Keys: 1 to {len(tracks)} choose a flight, arrows move "
        "in time, space plays. A click in a picture along the path goes there.</p></div></section>"
    )


def _label(track: Track) -> str:
    if track.touches or track.lost:
        return f"Flight {track.number}: {'touches' if track.touches else 'lost'}"
    least_m = float(track.clearance_m[track.moment])
    return f"Flight {track.number}" + (f": {least_m:.2f} m" if math.isfinite(least_m) else "")


def _story(track: Track, told: Outcome) -> str:
    """Where and when a flight came closest."""
    at = track.as_dict(told.subject.item.trajectory)
    x, y, z = at["point_world_m"]
    where = f"segment {at['segment']}, {at['time_s']:.2f} s on the path, at ({x:.2f}, {y:.2f}, {z:.2f})"
    how = "touches first" if track.touches else "is lost, and comes closest" if track.lost else "comes closest"
    said = f"Flight {track.number} {how}: {where}"
    if track.surface_world_m is not None:
        a, b, c = track.surface_world_m
        said += f"; the obstacle is at ({a:.2f}, {b:.2f}, {c:.2f})"
    return f"{said}. The same seed flies it again, bit by bit."


def _flights(told: Outcome) -> dict[str, object]:
    """What the script needs."""
    return {"radius_m": told.subject.radius_m, "tracks": [_track(track, told) for track in told.shown.worst]}


def _track(track: Track, told: Outcome) -> dict[str, object]:
    position = track.position_world_m
    numbers = {
        "t": track.time_s, "p": np.minimum(track.path_s, told.subject.item.trajectory.duration_s), "x": position[:, 0],
        "y": position[:, 1], "z": position[:, 2], "c": track.clearance_m, "e": track.error_m,
    }  # fmt: skip
    obstacle = None if track.surface_world_m is None else [round(v, 3) for v in track.surface_world_m]
    found = {name: [round(float(v), 3) if np.isfinite(v) else None for v in row] for name, row in numbers.items()}
    return {**found, "closest": track.moment, "obstacle": obstacle, "story": _story(track, told)}


def _spreads(told: Outcome) -> str:
    r, limits = told.result.record, told.subject.vehicle.limits
    energy_wh = r.energy_j / 3600.0
    pictures = (
        ("h-clearance", "least clearance", "m", r.clearance_m, 0.0, False, _CLEAR_M),
        ("h-tilt", "largest tilt", "°", _DEG * r.tilt_rad, _DEG * limits.tilt_rad, True, np.inf),
        ("h-rotor", "least rotor reserve", "%", 100.0 * r.rotor_reserve, 0.0, False, np.inf),
        ("h-energy", "energy of the rotors", "Wh", energy_wh, None, True, np.inf),
    )  # fmt: skip
    drawn = "".join(
        f"<div>{drawing.histogram(name, title, unit, values, limit, bad_above=bad, most=most)}</div>"
        for name, title, unit, values, limit, bad, most in pictures
    )
    note = (
        "The dashed line is the limit: touching; the plan's limit of tilt, which a flight may exceed; a rotor at its "
        f"limit. Energy is mechanical, with the {SETTLE_S:g} s of hover before."
    )
    head = "<section><h2>How far from the limits</h2>"
    return f"{head}<div class='four'>{drawn}</div><p class='small'>{note}</p>{_of_first_level(told.result)}</section>"


def _why(told: Outcome) -> str:
    result = told.result
    lost = "Share of the variance of being lost" if result.rare is None else "Share of what the lost flights differ in"
    parts = [
        _shares("What moves the least clearance", "Share of its variance, by uncertainty alone", result.shares),
        _shares("What loses flights", lost, result.loss_shares),
        _endings(result),
    ]
    return f"<div class='two'>{''.join(part for part in parts if part)}</div>"


def _shares(title: str, note: str, shares: Mapping[str, float]) -> str:
    kept = [(name, share) for name, share in list(shares.items())[:_LARGEST_SHARES] if share >= 0.005]
    if not kept:
        return ""
    rows = "".join(
        f"<tr><td>{escape(name)}</td><td class='n'>{min(100.0 * share, 100.0):.0f} %</td>"
        f"<td class='share'><i style='width: {min(100.0 * share, 100.0):.1f}%'></i></td></tr>"
        for name, share in kept
    )
    return f"<section><h2>{title}</h2><p class='small'>{note}.</p><table style='width: 100%'>{rows}</table></section>"


def _endings(result: preflight.Result) -> str:
    rows = [(words, str(chance)) for words, chance in result.endings().items()]
    rows = [("touches something", str(result.touched)), ("leaves the map", str(result.left_map)), *rows]
    if result.hidden is not None:
        rows.append(("meets what the map misses", result.hidden.describe()))
    table = _table(("", "flights, and 95 % bound"), rows)
    return f"<section><h2>How they end</h2>{_of_first_level(result)}{table}</section>"


def _assumed(told: Outcome) -> str:
    given, options, area = told.subject.options.uncertainty, told.subject.options, told.subject.area
    known = "the model" if "pose_delay.delay_s" in told.subject.vehicle.parameters else "assumed"
    direction = "from anywhere" if given.wind_direction is None else "towards " + ", ".join(
        f"{v:.2f}" for v in given.wind_direction
    )  # fmt: skip
    delay = "" if given.pose_delay_std_s is None else f"{1e3 * given.pose_delay_std_s:.1f} ms"
    drop_outs = f"{given.drop_outs_per_s:g} a second of {given.drop_out_s:g} s" if given.drop_outs_per_s else "none"
    jump = f"{100.0 * given.pose_jump_std_m:.0f} cm each axis" if given.pose_jump_std_m else "none"
    battery = "full, and stays so" if given.battery_v is None else f"from {given.battery_v:g} V to full, and it sags"
    fault, source = 100.0 * given.motor_fault_ratio, told.subject.sources.get
    noise_from = next((source(name) for name in NOISE if name in told.subject.sources), None) or "assumed"
    localization = f"{100.0 * (given.localization_std_m or 0.0):.1f} cm each axis"
    uncertain = sum(parameter.std > 0.0 for parameter in told.subject.vehicle.parameters.values())
    rows = [
        ("parameters", f"{uncertain} of {len(told.subject.vehicle.parameters)} uncertain", "the vehicle file"),
        (
            "mean wind",
            f"{given.wind_m_s:.3g} m/s {direction}, ± {100.0 * given.wind_spread_ratio:.0f} %",
            source("wind_m_s") or "asked",
        ),
        (
            "gusts (Dryden)",
            f"{given.gust_std_m_s:.3g} m/s each axis, length {options.air.gust_length_m:g} m",
            source("gust_std_m_s") or "asked",
        ),
        ("thermals", f"{given.thermal_std_m_s:g} m/s upwards at 10 m" if given.thermal_std_m_s else "none", "asked"),
        ("pose delay, untold", delay or "as the model says, or 3 ms", "asked" if delay else known),
        ("gaps of the pose", drop_outs, source("drop_outs_per_s", "asked")),
        ("noise of position, attitude, gyro", noise_words(options.sensors), noise_from),
        ("lasting error of the pose", localization, source("localization_std_m", "asked")),
        ("jump of the pose on the way", jump, "asked"),
        ("lasting error of the heading", f"{_DEG * given.heading_std_rad:.2f}°", "assumed"),
        ("map's scale", f"{100.0 * given.map_scale_std_ratio:.2f} %", "the map"),
        ("map's surfaces", f"{100.0 * given.map_error_std_m:.1f} cm", "assumed, and the map's voxels"),
        ("start", f"{100.0 * given.start_std_m:.0f} cm each axis, {_DEG * given.start_yaw_std_rad:.1f}°", "assumed"),
        ("rotor wear", f"{100.0 * given.rotor_wear_ratio:.1f} % of each thrust", "assumed"),
        ("motor fault", f"one loses {fault:.0f} % of its thrust on the way" if fault else "none", "asked"),
        ("battery at the start", battery, "asked"),
        ("vehicle's sphere", f"{told.subject.radius_m:.2f} m", "the plan's check, or the farthest propeller"),
        ("controller", f"{options.flown_hz} Hz, its C code", "assumed" if options.rate_hz is None else "asked"),
        ("map", f"{area.folder.resolve().name}, {area.hash[:12]}", "asked"),
        ("seed", str(options.seed), "asked"),
    ]
    sentences = "".join(f"<p>{_sentence(said)}.</p>" for said in told.assumed)
    head = ("", "standard deviation, or value", "from")
    simulated = "<p class='small'>Simulated throughout.</p>"
    return f"<section><h2>What was assumed</h2>{_table(head, rows)}{sentences}{simulated}</section>"


def _table(heads: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    head = "".join(f"<th>{escape(name)}</th>" for name in heads)
    body = "".join(f"<tr>{''.join(f'<td>{escape(cell)}</td>' for cell in row)}</tr>" for row in rows)
    return f"<div class='scroll'><table><tr>{head}</tr>{body}</table></div>"
