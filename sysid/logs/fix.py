"""Carry out the fixes that the checks of a log propose, one after the other, and nothing else.

After each fix the log is checked again: what the next finding proposes is judged on the mended log. The pose's frame
goes first, because everything else is judged by it.
"""

from collections.abc import Collection
from dataclasses import asdict, dataclass

import numpy as np

from flight import FlightLog, InputError, Progress, silent
from flight.flight_log import COLUMNS
from sysid.logs.apply import apply, words
from sysid.logs.check import LogReport, examine, is_gone
from sysid.logs.checks.finding import Finding
from sysid.logs.events.repair import Repair
from vehicle import Vehicle

MOST_FIXES = 40
SMALLEST_SHIFT_S = 1e-3
"""A clock is read to about a millisecond; what is left below that is not shifted again."""
FIXES = "fixes"
"""Where the log's metadata say what was done, in sentences."""
REPAIRS = "repairs"
"""Where they say it as `Repair` has it, in the order in which it was done."""


@dataclass(frozen=True, slots=True)
class Fixed:
    """A mended log."""

    log: FlightLog
    """With what was done in its metadata, under `fixes`."""
    done: tuple[str, ...]
    """One sentence for each fix: the finding, and what was changed."""
    report: LogReport
    """What the checks still find: no change of the log would correct it, or it came back after it."""

    @property
    def left(self) -> tuple[Finding, ...]:
        return self.report.findings


def fix(
    log: FlightLog,
    vehicle: Vehicle | None = None,
    *,
    aloft: tuple[float, float] | None = None,
    leave: Collection[str] = (),
    progress: Progress = silent,
) -> Fixed:
    """Apply every fix that is a change of the log: first of all events that are certain, then of one finding at a time.

    A change that does not take its finding away is taken back.

    Args:
        vehicle: as in `check_log`.
        aloft: first and last instant in the air: only there is the log judged; the whole of it is changed.
        leave: kinds of findings (`Finding.what`) that are left as they are.
    """
    given, done, repairs = log, list[str](), list[Repair]()
    report = examine(_part(log, aloft), vehicle)
    for finding in _events(report.findings, leave):
        assert finding.repair is not None
        log = apply(log, finding.repair)
        done.append(_said(finding, finding.repair))
        repairs.append(finding.repair)
    times: dict[tuple[str, str, tuple[str, ...]], int] = {}
    if done:
        report = examine(_part(log, aloft), vehicle)
    fixable = 1
    of_events = len(done)
    while len(done) < MOST_FIXES + of_events:
        progress("fixing and checking again", min(len(done) / fixable, 1.0))
        fixable = len(done) + 1 + sum(finding.repair is not None for finding in report.findings)
        finding = _next(report.findings, times, leave)
        if finding is None:
            break
        assert finding.repair is not None
        kind = _kind(finding.what, finding.repair)
        times[kind] = times.get(kind, 0) + 1
        mended, where = apply(log, finding.repair), aloft
        if finding.repair.columns == ("time_s",) and aloft is not None:
            where = (aloft[0] * finding.repair.factor, aloft[1] * finding.repair.factor)
        after = examine(_part(mended, where), vehicle)
        if not is_gone(finding, after):
            times[kind] = MOST_FIXES
            continue
        log, aloft, report = mended, where, after
        done.append(_said(finding, finding.repair))
        repairs.append(finding.repair)
    if not done:
        return Fixed(given, (), report)
    return Fixed(_noted(log, done, repairs), tuple(done), report)


def repaired(log: FlightLog, finding: Finding) -> FlightLog:
    """The log with what one finding proposes, and nothing else; it is noted as by `fix`.

    Raises:
        InputError: it proposes no change of the log, or nothing would be left of it.
    """
    if finding.repair is None:
        raise InputError(f"no change of the log is proposed for: {finding.sentence}")
    return _noted(apply(log, finding.repair), [_said(finding, finding.repair)], [finding.repair])


def _said(finding: Finding, repair: Repair) -> str:
    return f"{finding.sentence}: {words(repair)}"


def _noted(log: FlightLog, done: list[str], repairs: list[Repair]) -> FlightLog:
    before = [list(log.metadata.get(key, [])) for key in (FIXES, REPAIRS)]
    said = {FIXES: before[0] + done, REPAIRS: before[1] + [asdict(repair) for repair in repairs]}
    return FlightLog(log.columns, {**log.metadata, **said})


def _events(found: tuple[Finding, ...], leave: Collection[str]) -> list[Finding]:
    """What happened during the recording, where only one repair is right."""
    return [
        finding
        for finding in found
        if finding.event is not None
        and finding.event.certain
        and finding.repair is not None
        and finding.what not in leave
    ]


def _kind(what: str, repair: Repair) -> tuple[str, str, tuple[str, ...]]:
    return what, repair.action, repair.columns


def _part(log: FlightLog, aloft: tuple[float, float] | None) -> FlightLog:
    return log if aloft is None else log.slice(aloft[0], np.nextafter(aloft[1], np.inf))


def _next(
    found: tuple[Finding, ...], times: dict[tuple[str, str, tuple[str, ...]], int], leave: Collection[str]
) -> Finding | None:
    """The finding to mend next: the time's unit, then the pose, then the others; the same fix at most twice."""

    def rank(finding: Finding) -> int:
        columns = finding.repair.columns if finding.repair is not None else ()
        if columns == ("time_s",):
            return 0
        return 1 if set(columns) & {*COLUMNS["q_world_body"], *COLUMNS["position_world_m"]} else 2

    def worth(finding: Finding) -> bool:
        repair = finding.repair
        if (
            repair is None
            or finding.what in leave
            or (repair.action == "shift" and abs(repair.shift_s) < SMALLEST_SHIFT_S)
        ):
            return False
        most = 1 if repair.action in ("scale", "rotor order", "quaternion order", "conjugate", "drop") else 2
        return times.get(_kind(finding.what, repair), 0) < most

    return min(filter(worth, found), key=rank, default=None)
