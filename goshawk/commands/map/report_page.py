"""A map as one offline HTML page: verdict, scale, camera file on trial, residuals, coverage, where to look again."""

import math
import tempfile
from datetime import UTC, datetime
from html import escape
from importlib.metadata import version
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

import esdf
from flight import FormatError, InputError, file_format
from goshawk.commands.map import look_again
from mapping import Map, map_folder, map_parts
from mapping.dense import confidence, occupancy
from mapping.exploration.view_planning import ViewOptions
from mapping.sparse.mapper.overlap import UnplacedRun
from mapping.verdict import Standing
from sysid.report.drawing import figure, look, plain, written
from sysid.report.pages import picture, table, write_page

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_ARROWS = 100.0
"""Mean errors are drawn so many times as long."""
_STYLE = "td.long { white-space: normal; overflow-wrap: anywhere }"
"""A list of images takes as many lines as it needs; the page stays as wide as it is."""
_COLOURS = {Standing.GOOD: "good", Standing.DOUBTFUL: "held", Standing.REFUSED: "bad", Standing.NOT_JUDGED: "held"}


def write(path: Path, area: Map) -> Path:
    """Write the page; pictures are inside the file.

    Raises:
        FormatError: the map's report is damaged.
    """
    report = map_folder.read_report(area.folder)
    try:
        tables = _unplaced(report) + _witnesses(report) + _trial(report)
        with tempfile.TemporaryDirectory() as folder:
            drawn = [
                _residuals(report, Path(folder)),
                _residual_profiles(report, Path(folder)),
                _coverage(area, Path(folder)),
            ]
    except (KeyError, TypeError, ValueError, IndexError) as error:
        raise FormatError(f"{area.folder / 'report.json'}: {file_format.damage_text(error)}") from error
    with tempfile.TemporaryDirectory() as folder:
        drawn.append(_again(area, Path(folder)))
    body = _head(area, report) + _figures(area, report) + tables + "".join(drawn)
    return write_page(path, f"Map {area.folder.resolve().name}", body, _STYLE)


def _head(area: Map, report: dict[str, Any]) -> str:
    now = datetime.now(UTC).strftime("%Y-%m-%d %H:%M UTC")
    said = "".join(f"<li>{escape(reason)}</li>" for reason in area.reasons)
    mended = "".join(f"<p>Corrected in the map: {escape(each)}.</p>" for each in report.get("corrections", []))
    verdict = f"<p><b class='{_COLOURS[area.standing]}'>{area.standing}</b></p><ul>{said}</ul>{mended}"
    return (
        f"<h1>Map {escape(area.folder.resolve().name)}</h1>"
        f"<p class='small'>goshawk {version('goshawk')}, {now}. SI units, world z up.</p>"
        f"<div class='verdict'>{verdict}</div>"
    )


def _figures(area: Map, report: dict[str, Any]) -> str:
    voxel_m3 = float(np.prod(area.field.grid.voxel_m))
    volumes = [
        float((area.field.state == which).sum()) * voxel_m3 for which in (esdf.FREE, esdf.OCCUPIED, esdf.UNKNOWN)
    ]
    facts = area.facts
    rows = {
        "images placed": f"{facts['images_placed']} of {facts['images']}" if "images" in facts else "not recorded",
        "not placed": ", ".join(report.get("not_placed", [])) or "none",
        "placed by recorded motion": ", ".join(report.get("placed_by_motion", [])),
        "recorded motion": "; ".join(report.get("motion_notes", [])),
        "reprojection error": f"{facts['reprojection_error_px']:.2f} px" if "reprojection_error_px" in facts else "",
        "scale from": facts.get("scale_source", ""),
        "up from": facts.get("up_source", ""),
        "path": f"{facts['path_length_m']:.2f} m" if "path_length_m" in facts else "",
        "free, occupied, unknown": ", ".join(f"{volume:.1f} m³" for volume in volumes) + ", edits included",
        "surface": confidence.describe(facts),
        "plain walls, inferred": f"{float(area.inferred().sum()) * voxel_m3:.1f} m³ of the unknown",
        "contradicted by images": _contradicted(area),
        "errors, scale and camera file": f"as found in {whole}, before it was cropped"
        if (whole := report.get(map_parts.MADE_OF))
        else "",
        "hash": area.hash,
        "history": "; ".join(facts.get(map_parts.HISTORY, [])),
    }
    cells = "".join(
        f"<tr><td>{name}</td><td class='word long'>{escape(str(v))}</td></tr>" for name, v in rows.items() if v
    )
    return "<h2>Figures</h2>" + table(("", ""), cells, words=1)


def _contradicted(area: Map) -> str:
    stated = occupancy.load(area.folder / occupancy.FILE, area.field.grid.shape)
    return "" if stated is None else occupancy.describe(occupancy.figures(stated, area.field))


def _unplaced(report: dict[str, Any]) -> str:
    """The runs of images without a place, and their overlap with their neighbours; nothing if all have one."""
    runs = [UnplacedRun(**run) for run in report.get("unplaced_runs", [])]
    if not runs:
        return ""
    rows = "".join(
        f"<tr><td>{escape(run.span)}</td><td>{run.count}</td>"
        + _matches(run.before, run.matches_before)
        + _matches(run.after, run.matches_after)
        + f"<td class='word'>{escape(', '.join(' to '.join(piece) for piece in run.pieces))}</td></tr>"
        for run in runs
    )
    head = ("not placed", "instants", "matches with the one before", "with the one after", "pieces of their own")
    note = (
        "<p class='small'>Verified matches, of all cameras together. Few or none: the overlap was lost there. Images "
        "of a piece of their own overlap well with each other, but with no placed image.</p>"
    )
    return "<h2>Images without a place</h2>" + table(head, rows, words=1) + note


def _matches(neighbour: str | None, matches: int) -> str:
    """A cell: the matches with a neighbour, if there is one."""
    return "<td></td>" if neighbour is None else f"<td>{matches} ({escape(neighbour)})</td>"


def _witnesses(report: dict[str, Any]) -> str:
    witnesses = report.get("scale_witnesses", [])
    if not witnesses:
        return "<h2>Sources of the scale</h2><p>None is recorded in this map.</p>"
    rows = "".join(
        f"<tr><td>{escape(w['source'])}</td><td>{w['ratio']:.4f}</td><td>{w['std']:.4f}</td></tr>" for w in witnesses
    )
    note = "<p class='small'>The first is in use. Ratio: the map's scale over that of the source, with its σ.</p>"
    return "<h2>Sources of the scale</h2>" + table(("source", "ratio", "σ of the source"), rows) + note


def _trial(report: dict[str, Any]) -> str:
    found = report.get("calibration", [])
    if not found:
        return "<h2>The camera file on trial</h2><p>No trial is recorded in this map.</p>"
    rows = "".join(_tried(finding) for finding in found)
    head = ("possible error", "size", "σ", "unit", "shift (px)", "at most (px)", "verdict")
    left = "What is left after the corrections above. " if report.get("corrections") else ""
    note = f"<p class='small'>{left}Shift: of the image, RMS; at most: at the far end of the 90 % interval.</p>"
    return "<h2>The camera file on trial</h2>" + table(head, rows, words=1) + note


def _tried(finding: dict[str, Any]) -> str:
    """A row of the trial's table."""
    size = " ".join(f"{value:.2g}" for value in finding["size"])
    std = " ".join(f"{value:.1g}" for value in finding["std"])
    numbers = (
        size,
        std,
        escape(finding["units"][0] or "relative"),
        f"{finding['shift_px']:.2f}",
        f"{finding['largest_shift_px']:.2f}",
    )
    style = "word bad" if finding["verdict"] == "present" else "word"
    name = f"{escape(finding['camera'])}: {escape(finding['error'])}"
    cells = "".join(f"<td>{number}</td>" for number in numbers)
    return f"<tr><td>{name}</td>{cells}<td class='{style}'>{escape(finding['verdict'])}</td></tr>"


def _residuals(report: dict[str, Any], folder: Path) -> str:
    fields = report.get("residual_field", [])
    if not fields:
        return "<h2>Residuals over the image</h2><p>None are recorded in this map.</p>"
    drawn, axes = figure(1, len(fields), (5.5 * len(fields), 4.6))
    for place, field in zip(axes[0], fields, strict=True):
        count, rms = np.array(field["count"]), np.array(field["rms_px"], dtype=float)
        mean = np.array([[m or (math.nan, math.nan) for m in row] for row in field["mean_px"]], dtype=float)
        rows, columns = count.shape
        width, height = field["width"], field["height"]
        image = place.imshow(rms, extent=(0, width, height, 0), cmap="viridis", vmin=0.0, interpolation="nearest")
        x, y = np.meshgrid((np.arange(columns) + 0.5) * width / columns, (np.arange(rows) + 0.5) * height / rows)
        well = count >= 10
        place.quiver(
            x[well], y[well], *(_ARROWS * mean[well]).T, angles="xy", scale_units="xy", scale=1.0, color="white"
        )
        plain(place, f"{field['camera']}: {int(count.sum())} observations", "x (px)", "y (px)")
        place.grid(False)
        drawn.colorbar(image, ax=place, shrink=0.8, label="RMS (px)")
    path = written(drawn, folder / "residuals.svg")
    note = (
        f"<p class='small'>Observed less projected. Colour: RMS of a cell; arrow: its mean, {_ARROWS:g} times as long, "
        "where there are ten observations. A lens that fits leaves arrows without a pattern.</p>"
    )
    return "<h2>Residuals over the image</h2>" + picture(path, "Reprojection errors, cell by cell") + note


def _residual_profiles(report: dict[str, Any], folder: Path) -> str:
    """The errors over the angle from the optical axis and over time; nothing for a report of an earlier version."""
    over_radius, over_time = report.get("residual_radius", []), report.get("residual_time", [])
    if not over_radius or not over_time:
        return ""
    drawn, axes = figure(2, len(over_radius), (5.5 * len(over_radius), 5.2))
    for upper, lower, rings, images in zip(axes[0], axes[1], over_radius, over_time, strict=True):
        _draw_radius(upper, rings)
        _draw_time(lower, images)
    path = written(drawn, folder / "profiles.svg")
    note = (
        "<p class='small'>Above: mean along the radius, positive outwards, with its standard error if all errors were "
        "independent, and RMS, over the angle from the optical axis. A mean that changes with the angle is a radial "
        "distortion or a focal length that does not fit. Below: mean and RMS of each image; one that stands apart is a "
        "little out of place, or shows things that moved.</p>"
    )
    return picture(path, "Reprojection errors over angle and time") + note


def _draw_radius(place: "Axes", rings: dict[str, Any]) -> None:
    count = np.array(rings["count"])
    mean_px, rms_px = (np.array(rings[name], dtype=float) for name in ("mean_radial_px", "rms_px"))
    bounds_deg = np.degrees(rings["angle_rad"])
    middle_deg = 0.5 * (bounds_deg[:-1] + bounds_deg[1:])
    # half of the squared error lies along the radius
    std_px = rms_px / np.sqrt(2.0 * np.maximum(count, 1))
    place.plot(middle_deg, rms_px, ".-", color=look().pale, label="RMS")
    place.errorbar(
        middle_deg, mean_px, std_px, fmt=".-", color=look().colours[0], capsize=2, label="mean along the radius"
    )
    place.axhline(0.0, color=look().ink, linewidth=0.6)
    plain(place, rings["camera"], "angle from the optical axis (°)", "error (px)")
    place.legend(fontsize=8, frameon=False)


def _draw_time(place: "Axes", images: dict[str, Any]) -> None:
    time_s = np.array(images["time_s"], dtype=float)
    is_timed = bool(np.isfinite(time_s).all())
    at = time_s if is_timed else np.arange(len(time_s))
    mean_px = np.array([mean or (math.nan, math.nan) for mean in images["mean_px"]], dtype=float).reshape(-1, 2)
    place.plot(at, np.array(images["rms_px"], dtype=float), ".-", color=look().pale, label="RMS")
    for axis, name in enumerate(("mean x", "mean y")):
        place.plot(at, mean_px[:, axis], ".-", color=look().colours[axis], linewidth=0.8, label=name)
    place.axhline(0.0, color=look().ink, linewidth=0.6)
    plain(place, images["camera"], "time (s)" if is_timed else "placed image, in order", "error (px)")
    place.legend(fontsize=8, frameon=False, ncols=3)


def _coverage(area: Map, folder: Path) -> str:
    grid, state = area.field.grid, area.field.state
    drawn, axes = figure(1, 2, (12.0, 5.0))
    positions = area.T_world_body[:, :3, 3]
    for place, (across, up, along) in zip(axes[0], ((0, 1, 2), (0, 2, 1)), strict=True):
        free_m = (state == esdf.FREE).sum(axis=along) * grid.voxel_m[along]
        known = (state != esdf.UNKNOWN).any(axis=along)
        low, high = grid.low_world_m, grid.high_world_m
        image = place.imshow(
            np.where(known, free_m, np.nan).T,
            origin="lower",
            extent=(low[across], high[across], low[up], high[up]),
            cmap="Blues",
            vmin=0.0,
            interpolation="nearest",
        )
        place.set_facecolor("#8c8c8c")
        place.plot(positions[:, across], positions[:, up], ".-", color="#b0413e", markersize=3, linewidth=0.8)
        names = "xyz"
        plain(place, f"free along {names[along]}", f"{names[across]} (m)", f"{names[up]} (m)")
        place.grid(False)
        bar = drawn.colorbar(image, ax=place, shrink=0.8)
        bar.set_label("free (m)", color=look().ink)
    path = written(drawn, folder / "coverage.svg")
    note = (
        "<p class='small'>From above and from the side: metres of free space along the view, edits included; grey "
        "where nothing is known, white where nothing is free. Red: where the images were taken.</p>"
    )
    return "<h2>Coverage</h2>" + picture(path, "What was seen") + note


def _capital(sentence: str) -> str:
    return sentence[:1].upper() + sentence[1:]


def _again(area: Map, folder: Path) -> str:
    head = "<h2>Where to look again</h2>"
    options = ViewOptions(clearance_m=look_again.clearance_m(area, None, None, None))
    try:
        found = look_again.find(area, options)
    except InputError as error:  # no images, no room: the rest of the page is worth reading
        return f"{head}<p>Not known: {escape(str(error))}.</p>"
    said = f"{head}<p>{escape(_capital(look_again.sentence(found)))}.</p>"
    if not found.views:
        return said
    drawn, axes = figure(1, 1, (9.0, 6.0))
    place, grid = axes[0][0], area.field.grid
    low, high = grid.low_world_m, grid.high_world_m
    free = (area.field.state == esdf.FREE).any(axis=2)
    extent = (low[0], high[0], low[1], high[1])
    place.imshow(free.T, origin="lower", extent=extent, cmap="Blues", vmin=0.0, vmax=4.0, interpolation="nearest")
    for shown, colour, name in ((False, "#8c8c8c", "unknown, not shown"), (True, "#c98a1b", "unknown, would be shown")):
        cells = found.targets_world_m[found.shown == shown]
        place.plot(cells[:, 0], cells[:, 1], "s", color=colour, markersize=3, label=name)
    positions = np.array([view.position_world_m for view in found.views])
    heading = np.array([view.heading_rad for view in found.views])
    place.plot(positions[:, 0], positions[:, 1], "-", color=look().ink, linewidth=0.8, label="order")
    place.quiver(positions[:, 0], positions[:, 1], np.cos(heading), np.sin(heading), color="#b0413e", scale=25.0)
    for number, (x, y, _) in enumerate(positions):
        place.annotate(str(number), (x, y), color=look().ink, xytext=(3, 3), textcoords="offset points")
    plain(place, "from above", "x (m)", "y (m)")
    place.grid(False)
    drawn.legend(loc="outside lower center", ncols=3, frameon=False)
    rows = "".join(
        f"<tr><td>{number}</td>"
        + "".join(f"<td>{value:.2f}</td>" for value in view.position_world_m)
        + f"<td>{view.heading_deg:.0f}</td><td>{view.shows_m3:.2f}</td></tr>"
        for number, view in enumerate(found.views)
    )
    listed = table(("waypoint", "x (m)", "y (m)", "z (m)", "heading (°)", "shows (m³)"), rows, words=1)
    note = (
        f"<p class='small'>Arrows: places with a clearance of {options.clearance_m:.2f} m, and where the body's x axis "
        "points there. What a view shows is an estimate, and views share it. <code>goshawk map again</code> writes "
        "them as waypoints.</p>"
    )
    picture_of = picture(written(drawn, folder / "again.svg"), "Where to look again, from above")
    return said + picture_of + listed + note
