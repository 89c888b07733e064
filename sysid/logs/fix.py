"""Carry out the fixes that the checks of a log propose, one after the other, and nothing else.

After each fix the log is checked again: what the next finding proposes is judged on the mended log. The pose's frame
goes first, because everything else is judged by it.
"""

from dataclasses import dataclass

import numpy as np

from flight import FlightLog, InputError, Progress, frames, rotations, silent
from flight.flight_log import COLUMNS
from flight.rotations import FloatArray
from sysid.logs.check import LogReport, check_log
from sysid.logs.checks.finding import Finding, Repair, turn_in_words
from sysid.logs.readers.streams import shifted
from vehicle import Vehicle

MOST_FIXES = 40
SMALLEST_SHIFT_S = 1e-3
"""A clock is read to about a millisecond; what is left below that is not shifted again."""
FIXES = "fixes"
"""Where the log's metadata say what was done."""


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
    progress: Progress = silent,
) -> Fixed:
    """Apply every fix that is a change of the log.

    Args:
        vehicle: as in `check_log`.
        aloft: first and last instant in the air: only there is the log judged; the whole of it is changed.
    """
    done: list[str] = []
    times: dict[tuple[str, str, tuple[str, ...]], int] = {}
    fixable = 1
    while True:
        progress("fixing and checking again", min(len(done) / fixable, 1.0))
        report = check_log(_part(log, aloft), vehicle)
        found = report.findings
        fixable = len(done) + 1 + sum(finding.repair is not None for finding in found)
        finding = _next(found, times)
        if finding is None or len(done) == MOST_FIXES:
            break
        assert finding.repair is not None
        kind = (finding.what, finding.repair.action, finding.repair.columns)
        times[kind] = times.get(kind, 0) + 1
        log = apply(log, finding.repair)
        if finding.repair.columns == ("time_s",) and aloft is not None:
            aloft = (aloft[0] * finding.repair.factor, aloft[1] * finding.repair.factor)
        done.append(f"{finding.sentence}: {words(finding.repair)}")
    before = list(log.metadata.get(FIXES, []))
    mended = FlightLog(log.columns, {**log.metadata, FIXES: before + done}) if done else log
    return Fixed(mended, tuple(done), report)


def _part(log: FlightLog, aloft: tuple[float, float] | None) -> FlightLog:
    return log if aloft is None else log.slice(aloft[0], np.nextafter(aloft[1], np.inf))


def _next(found: tuple[Finding, ...], times: dict[tuple[str, str, tuple[str, ...]], int]) -> Finding | None:
    """The finding to mend next: the time's unit, then the pose, then the others; the same fix at most twice."""

    def rank(finding: Finding) -> int:
        columns = finding.repair.columns if finding.repair is not None else ()
        if columns == ("time_s",):
            return 0
        return 1 if set(columns) & {*COLUMNS["q_world_body"], *COLUMNS["position_world_m"]} else 2

    def worth(finding: Finding) -> bool:
        repair = finding.repair
        if repair is None or (repair.action == "shift" and abs(repair.shift_s) < SMALLEST_SHIFT_S):
            return False
        most = 1 if repair.action in ("scale", "rotor order", "quaternion order", "conjugate", "drop") else 2
        return times.get((finding.what, repair.action, repair.columns), 0) < most

    return min(filter(worth, found), key=rank, default=None)


def apply(log: FlightLog, repair: Repair) -> FlightLog:
    """The log after one repair.

    Raises:
        InputError: the log would hold fewer than two rows.
    """
    columns = dict(log.columns)
    there = [name for name in repair.columns if name in columns]
    match repair.action:
        case "scale":
            columns |= {name: columns[name] * repair.factor for name in there}
        case "drop":
            columns = {name: values for name, values in columns.items() if name not in there}
        case "blank":
            inside = np.zeros(len(log), dtype=bool)
            for first_s, last_s in repair.spans:
                inside |= (log.time_s >= first_s) & (log.time_s <= last_s)
            columns |= {name: np.where(inside, np.nan, columns[name]) for name in there}
        case "rotor order":
            for quantity in ("rotor_speed_rad_s", "rotor_speed_command_rad_s"):  # the same motors, in the same order
                names = COLUMNS[quantity]
                if log.has(quantity):
                    columns |= {names[i]: log.columns[names[k]] for i, k in enumerate(repair.order)}
        case _:
            for quantity, names in COLUMNS.items():
                if log.has(quantity) and set(names) <= set(there):
                    columns |= dict(zip(names, _changed(log, quantity, repair).T, strict=True))
    mended = FlightLog(columns, log.metadata)
    return _trimmed(mended, there) if repair.action == "shift" else mended


def _changed(log: FlightLog, quantity: str, repair: Repair) -> FloatArray:
    values, is_attitude = log.vector(quantity), quantity.endswith("q_world_body")
    if repair.action == "shift":
        return shifted(log.time_s, values, repair.shift_s, quaternion=is_attitude)
    if repair.action in ("turn", "turn body"):
        turn = rotations.exp(np.array(repair.turn_rad))
        if not is_attitude:
            return rotations.rotate(turn, values)
        return rotations.multiply(turn, values) if repair.action == "turn" else rotations.multiply(values, turn)
    if repair.action == "conjugate":
        return rotations.conjugate(values)
    if repair.action == "quaternion order":
        return np.roll(values, 1, axis=1)
    return frames.flip_attitude(values) if is_attitude else frames.flip_vector(values)


def _trimmed(log: FlightLog, names: list[str]) -> FlightLog:
    """Without the rows at the ends for which the shifted stream has nothing."""
    known = np.flatnonzero(np.isfinite([log.columns[name] for name in names]).all(axis=0))
    if len(known) < 2:
        raise InputError(f"nothing is left of {names[0]} after the shift: it is longer than the log")
    kept = slice(known[0], known[-1] + 1)
    return FlightLog({name: values[kept] for name, values in log.columns.items()}, log.metadata)


def words(repair: Repair) -> str:
    """What was done, in words."""
    names = repair.columns[0] if len(repair.columns) == 1 else f"{repair.columns[0]} ... {repair.columns[-1]}"
    match repair.action:
        case "scale":
            return f"multiplied {names} by {repair.factor:.6g}"
        case "shift":
            return f"shifted the time stamps of {names} by {1000.0 * repair.shift_s:+.1f} ms"
        case "blank":
            return f"wrote NaN into {names} at {', '.join(f'{first:.3f}' for first, _ in repair.spans[:5])} s" + (
                f" and {len(repair.spans) - 5} more places" if len(repair.spans) > 5 else ""
            )
        case "rotor order":
            return f"took columns {list(repair.order)} of rotor speed (and of its command) as rotors 0 to 3"
        case "drop":
            return f"dropped {names}"
        case "flip":
            return f"turned {names} from z down to z up"
        case "turn" | "turn body":
            axes = "world" if repair.action == "turn" else "body"
            return f"turned the {axes} axes of {names} by {turn_in_words(repair.turn_rad)}"
        case "conjugate":
            return f"conjugated {names}"
        case "quaternion order":
            return f"reordered {names} from x y z w to w x y z"
