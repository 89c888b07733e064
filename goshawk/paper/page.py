"""One offline page: theirs beside ours, each said to be flown, rendered or simulated."""

from collections.abc import Mapping, Sequence
from html import escape
from pathlib import Path
from typing import Any

from goshawk.paper import identified, ladder, path, theirs
from sysid.report import pages

_NOTE = (
    "Theirs was flown by them, on their vehicle; ours is simulated or rendered, as each heading says, and no flight of "
    "ours took part. Numbers of theirs are those that our sources state; the paper itself is no part of this system."
)


def write(file: Path, document: Mapping[str, Any], titles: Mapping[str, str]) -> Path:
    """Write the page; pictures lie in a folder of each part beside it, and are put into it.

    Args:
        titles: headings of the parts that were done.
    """
    bodies = {"vehicle": _vehicle, "ladder": _ladder, "path": _path}
    sections = [
        f"<h2>{escape(title)}: ours {escape(document['made'][name])}"
        f"{', by an earlier run' if name in document['taken_over'] else ''}</h2>"
        f"{bodies[name](document[name], file.parent / name)}"
        for name, title in titles.items()
    ]
    cut = document["cut_off"]
    left = f"<p class='bad'>Stopped before: {escape(', '.join(cut))}.</p>" if cut else ""
    left += "".join(
        f"<p class='bad'>{escape(name)} failed: {escape(reason)}.</p>" for name, reason in document["failed"].items()
    )
    head = f"<h1>Rigter et al. (2019) beside Goshawk</h1>{pages.stamp(_NOTE)}<p>{escape(theirs.TITLE)}.</p>{left}"
    return pages.write_page(file, "Rigter et al. (2019) beside Goshawk", head + "".join(sections) + _figures())


def _vehicle(rows: Sequence[Mapping[str, Any]], folder: Path) -> str:
    cells = [
        (row["name"], _number(row["theirs"]), _number(row["their_cad"]), _share(row["theirs"], row["their_cad"]),
         _number(row["ours"]), f"{row['standard_error_of_one_trial']:.1g}", _share(row["ours"], row["theirs"]),
         row["unit"])
        for row in rows
    ]  # fmt: skip
    head = ("parameter", "theirs", "their CAD", "off CAD", "ours", "± of one trial", "off theirs", "unit")
    note = (
        f"The simulated vehicle has the values of {theirs.TABLE}, so that ours should be theirs. ± is one robust "
        f"standard error of one trial of three flights; ours are means of {len(rows[0]['trials'])} trials, "
        f"each fitted jointly, not in their three stages. Standard errors of theirs: {theirs.NOT_KNOWN}."
    )
    return _table(head, cells) + _small(note) + pages.picture(folder / identified.PICTURE)


def _ladder(rows: Sequence[Mapping[str, Any]], folder: Path) -> str:
    cells = [
        (row["course"], row["controller"], _flown(row["theirs_cm"]),
         f"{row['ours_cm']:.2f}", f"{min(row['runs_cm']):.2f} to {max(row['runs_cm']):.2f}")
        for row in rows
    ]  # fmt: skip
    head = ("course", "controller", "theirs, flown (cm)", "ours (cm)", "runs")
    note = (
        "Mean distance from the set-point. Simulated with their values, noise, 10 ms of delay, gusts of "
        "0.3 m/s and motors of 30 ms, which are assumed. Their courses are known by speed and acceleration alone: ours "
        "have those. Which of their controllers flew all axes with yaw is not known here; it stands beside the last."
    )
    return _table(head, cells) + _small(note) + pages.picture(folder / ladder.PICTURE)


def _path(found: Mapping[str, Any], folder: Path) -> str:
    cells = [
        ("images placed", f"{found['images_placed']}"), ("length", f"{found['length_m']:.1f} m"),
        ("duration", f"{found['duration_s']:.2f} s"), ("top speed", f"{found['top_speed_m_s']:.1f} m/s"),
        ("proven clearance of its centre", f"{found['clearance_m']:.2f} m"),
        ("gate", "passed" if found["passes_gate"] else "refused"),
        ("mean tracking error", f"{found['tracking_cm']:.1f} cm"),
    ]  # fmt: skip
    note = f"A room of our own; their rooms, maps and paths: {theirs.NOT_KNOWN}."
    pictures = "".join(pages.picture(folder / name) for name in (path.SLICE, path.PLAN))
    return _table(("", "ours"), cells) + _small(note) + pictures


def _figures() -> str:
    cells = [(name, shows) for name, shows in theirs.FIGURES.items()]
    where = {"Fig. 8": "vehicle"}
    rows = [(name, shows, f"above: {where[name]}" if name in where else "none") for name, shows in cells]
    note = (
        "Tracking errors of theirs stand above under the ladder; in which of these figures they are shown is "
        f"{theirs.NOT_KNOWN}."
    )
    return f"<h2>Figures 7 to 11</h2>{_table(('figure', 'shows', 'ours'), rows)}{_small(note)}"


def _table(heads: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    body = "".join(f"<tr>{''.join(f'<td>{escape(cell)}</td>' for cell in row)}</tr>" for row in rows)
    return pages.table(heads, body)


def _small(note: str) -> str:
    return f"<p class='small'>{escape(note)}</p>"


def _flown(mean_cm: float | None) -> str:
    return "no such controller" if mean_cm is None else f"{mean_cm:g}"


def _number(value: float | None) -> str:
    return theirs.NOT_KNOWN if value is None else f"{value:.4g}"


def _share(value: float, of: float | None) -> str:
    return "" if not of else f"{100.0 * (value / of - 1.0):+.1f} %".replace("-", "−")
