"""Flights of a project as the estimator takes them, and what a list of them shows; done in a process of its own."""

import contextlib
import hashlib
from collections.abc import Iterable
from datetime import UTC, datetime
from importlib.metadata import version
from pathlib import Path

import msgspec
import numpy as np

import sysid
import vehicle
from firmware_bridge.airborne import aloft_s, in_the_air, tracking
from flight import FlightError, FlightLog, InputError, Progress, file_format, flight_log
from flight.project import Project
from gcs_web.flights import session_files
from gcs_web.protocol.flights import Finding, FlightCard
from sysid.estimator import prepare
from sysid.logs import fix
from sysid.logs.check import LogReport
from vehicle import Vehicle, history

GAP = "gap"
"""What such a finding of the checks is about."""
PATH_POINTS = 80
"""Of the picture of a path."""

Signature = tuple[int, int, str]
"""Time of the last change (ns) and size of a log, and the hash of the vehicle that it is checked against."""


class Kept(msgspec.Struct, frozen=True):
    """A card on disk."""

    signature: Signature
    card: FlightCard
    made_by: str = ""
    """Version of Goshawk: another one may check more."""


def load(opened: Project, name: str) -> FlightLog:
    """A flight as the verbs read it: the rows in the air, with its name.

    Raises:
        FlightError: there is none, it cannot be read, or the vehicle was never in the air.
    """
    path = opened.flight(name)
    log = flight_log.load(path)
    aloft = in_the_air(log, str(path)) if log.has("mission_state") else log
    return FlightLog(aloft.columns, {**log.metadata, "name": name})


def signature(opened: Project, name: str, vehicle_hash: str) -> Signature:
    status = opened.flight(name).stat()
    return status.st_mtime_ns, status.st_size, vehicle_hash


def contents(opened: Project, names: Iterable[str]) -> str:
    """Another text whenever one of these logs is another, by its size or the time of its last change."""
    stamps = []
    for name in sorted(names):
        try:
            stamps.append((name, *signature(opened, name, "")[:2]))
        except (OSError, InputError):
            stamps.append((name, 0, 0))
    return hashlib.sha256(repr(stamps).encode()).hexdigest()


def card_file(opened: Project, name: str) -> Path:
    return opened.folder / ".session" / "flights" / f"{name}.json"


def kept_card(opened: Project, name: str, wanted: Signature) -> FlightCard | None:
    """The card of a flight if this version made it of the log as it is now."""
    found = session_files.read(card_file(opened, name), Kept)
    if found is None or (found.signature, found.made_by) != (wanted, version("goshawk")):
        return None
    return found.card


def write_cards(folder: Path, names: list[str], progress: Progress) -> None:
    """Make the cards of flights; each is on disk when progress is told of it. The work of a process."""
    opened = Project(folder, "")
    for k, name in enumerate(names):
        believed = _believed(opened)
        with contextlib.suppress(FileNotFoundError):  # discarded in the meantime: that is no fault of the next one
            seen = signature(opened, name, "" if believed is None else vehicle.vehicle_hash(believed))
            made = Kept(seen, card(opened, name, believed), version("goshawk"))
            file_format.write_bytes(card_file(opened, name), msgspec.json.encode(made))
        progress(name, (k + 1) / len(names))


def _believed(opened: Project) -> Vehicle | None:
    try:
        return vehicle.load(opened.vehicle)
    except FlightError:
        return None


def card(opened: Project, name: str, believed: Vehicle | None) -> FlightCard:
    """What the list shows of a flight; one that cannot be read says why."""
    path = opened.flight(name)
    recorded = datetime.fromtimestamp(path.stat().st_mtime, UTC).isoformat(timespec="seconds")
    try:
        log = flight_log.load(path)
        judged = _judged(log, path)
        checked = sysid.check_log(judged, believed)
    except FlightError as error:
        return FlightCard(name, "unreadable", sentence=str(error), recorded_at=recorded)
    flown = tracking(log) if _has_tracking(log) else {}
    return FlightCard(
        name,
        "ready",
        recorded_at=recorded,
        vehicle_said=_vehicle_said(opened, log),
        trajectory=str(log.metadata.get("trajectory", "")),
        duration_s=checked.duration_s,
        rows=len(log),
        tracking_mean_m=flown.get("tracking_mean_m"),
        tracking_worst_m=flown.get("tracking_worst_m"),
        path_m=_path(log),
        findings=[*findings(checked), *_gap(judged, checked)],
        inconclusive=list(checked.inconclusive),
        notes=list(checked.notes),
        fixed=[str(done) for done in log.metadata.get(fix.FIXES, [])],
    )


def findings(checked: LogReport) -> list[Finding]:
    return [
        Finding(
            f.level,
            f.sentence,
            _on_the_page(f.fix),
            f.repair is not None,
            [(float(a), float(b)) for a, b in f.spans],
            f.what,
        )
        for f in checked.findings
    ]


def _gap(log: FlightLog, checked: LogReport) -> list[Finding]:
    """Where rows are there, but not what a fit needs of them: a fit refuses such a log too, or takes its pieces."""
    if any(finding.what == GAP for finding in checked.findings):
        return []
    try:
        found = prepare.gaps(log)
    except InputError:  # what is wrong with it is among the findings, or it is no log to fit
        return []
    spans = [(begin_s, end_s) for begin_s, end_s, _ in found]
    fix = "take the pieces between gaps as flights of their own"
    return [Finding("warning", prepare.gaps_sentence(found), fix, False, spans, GAP)] if found else []


def _on_the_page(fix: str) -> str:
    """Without the library's arguments: the page has a switch for gaps, and applies fixes by a click."""
    return fix.removesuffix(" (gaps='split')").removesuffix(", or fit with robust=True")


def _judged(log: FlightLog, path: Path) -> FlightLog:
    """The rows in the air if the log says which: standing on the ground is no fault."""
    return log if aloft_s(log) is None else in_the_air(log, str(path))


def _has_tracking(log: FlightLog) -> bool:
    needed = ("mission_state", "position_world_m", "setpoint_position_world_m", "velocity_world_m_s")
    return all(log.has(quantity) for quantity in needed)


def _vehicle_said(opened: Project, log: FlightLog) -> str:
    """The version of the project's vehicle file that its plan was checked with, else what the log says of its vehicle.

    What the controller flew with are its parameters, of which a log says nothing.
    """
    wanted = str(log.metadata.get("vehicle_hash", ""))
    if not wanted:
        name = str(log.metadata.get("vehicle", ""))
        return f"flown by {name}" if name else ""
    try:
        steps = history.read(opened.vehicle).steps
    except FlightError:
        steps = ()
    of = next((f"version {s.number}" for s in steps if s.vehicle_hash.startswith(wanted)), "another vehicle file")
    return f"its plan was checked with {of}"


def _path(log: FlightLog) -> list[float]:
    if not log.has("position_world_m"):
        return []
    known = log.vector("position_world_m")[:, :2]
    known = known[np.isfinite(known).all(axis=1)]
    if len(known) < 2:
        return []
    chosen = known[np.linspace(0, len(known) - 1, min(PATH_POINTS, len(known))).astype(int)]
    return [round(float(value), 3) for value in chosen.ravel()]


def fixed(opened: Project, name: str, only: str = "") -> tuple[FlightLog, tuple[str, ...]]:
    """A flight's log with every fix that its checks propose, and what was done; as `goshawk log fix`.

    Args:
        only: the sentence of the one finding whose fix is applied; empty: all.

    Raises:
        InputError: no finding proposes a change of the log, or none has that sentence.
    """
    log = flight_log.load(opened.flight(name))
    log = FlightLog(log.columns, {"name": name, **log.metadata})
    if only:
        found = sysid.check_log(_judged(log, opened.flight(name)), _believed(opened)).findings
        chosen = next((finding for finding in found if finding.sentence == only), None)
        if chosen is None:
            raise InputError(f"{name}: the checks no longer find this: {only}")
        new = fix.repaired(log, chosen)
        done = tuple(map(str, new.metadata[fix.FIXES][-1:]))
    else:
        mended = fix.fix(log, _believed(opened), aloft=aloft_s(log))
        new, done = mended.log, mended.done
    if not done:
        raise InputError(f"{name}: no finding proposes a change of the log")
    return FlightLog(new.columns, {**new.metadata, "fixed_from": f"{name}.parquet"}), done
