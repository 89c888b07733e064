"""What is wrong with a log, said before anything is fitted; every finding proposes a fix and none is applied."""

from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from flight import FlightLog, Progress, silent
from flight.flight_log import COLUMNS
from flight.rotations import FloatArray
from sysid.logs.checks import consistency, contact
from sysid.logs.checks.finding import Finding, Repair, Span, error, warning
from sysid.logs.readers.read_ulog import LOST
from sysid.logs.readers.streams import GAP_FACTOR, longest_pause_s
from vehicle import Vehicle

FROZEN_S = 0.25
"""A moving quantity that repeats exactly one value for this long has frozen."""
JUMP_FACTOR, JUMP_LEAST_M = 30.0, 0.05
"""A position jumps when it leaves the line through its neighbours by this many usual deviations, and this far."""
TOGETHER = (("position_world_m", "q_world_body"), ("rotor_speed_rad_s",))
"""What a fit takes as one sample: a row has all of its columns or none."""
SATURATED_SHARE = 0.01
"""A channel that sits exactly at its own extreme in this share of the samples has saturated."""
COMMANDED = ("setpoint_", "rotor_speed_command", "wind_world")
"""Columns that may stand still or sit at a limit by intent."""


@dataclass(frozen=True, slots=True)
class LogReport:
    """All findings about one log."""

    name: str
    duration_s: float
    rate_hz: float
    findings: tuple[Finding, ...]
    inconclusive: tuple[str, ...] = ()
    """What these flights excite too little to be checked, one sentence each."""
    notes: tuple[str, ...] = ()
    """What the log, faultless as it may be, is of no use for, one sentence each."""

    @property
    def worst(self) -> Literal["fine", "warning", "error"]:
        levels = {f.level for f in self.findings}
        return "error" if "error" in levels else "warning" if levels else "fine"

    def as_dict(self) -> dict[str, Any]:
        return {
            "name": self.name,
            "duration_s": self.duration_s,
            "rate_hz": self.rate_hz,
            "worst": self.worst,
            "findings": [
                {
                    "level": f.level,
                    "what": f.what,
                    "sentence": f.sentence,
                    "fix": f.fix,
                    "fixable": f.repair is not None,
                    "spans_s": [list(span) for span in f.spans],
                }
                for f in self.findings
            ],
            "inconclusive": list(self.inconclusive),
            "notes": list(self.notes),
        }


def check_log(log: FlightLog, vehicle: Vehicle | None = None, *, progress: Progress = silent) -> LogReport:
    """Look for faults in a log; with a vehicle, also for rotor order, spin and units that its motion contradicts."""
    progress("checking", 0.0)
    step_s = np.diff(log.time_s)
    touching = contact.spans(log)
    findings = [*_lost(log), *_time_base(log), *_not_finite(log), *_jumps(log)]
    findings += [*_frozen(log, touching), *_saturated(log)]
    findings += _contact(touching)
    compared, inconclusive = consistency.check(log, vehicle, progress)
    progress("checking", 1.0)
    findings += [*compared, *_partial(log)]
    return LogReport(
        name=str(log.metadata.get("name", "log")),
        duration_s=float(log.time_s[-1] - log.time_s[0]) if len(log) else 0.0,
        rate_hz=float(1.0 / np.median(step_s)) if len(step_s) else 0.0,
        findings=tuple(findings),
        inconclusive=tuple(inconclusive),
        notes=_notes(log),
    )


def _notes(log: FlightLog) -> tuple[str, ...]:
    if log.has("rotor_speed_rad_s") or log.has("rotor_speed_command_rad_s"):
        return ()
    return ("it has no rotor speed, nor its command in rad/s: no vehicle can be identified from it",)


def _lost(log: FlightLog) -> list[Finding]:
    lost = log.metadata.get(LOST)
    return (
        [warning("incomplete file", str(lost), "copy it from the vehicle again if it is whole there")] if lost else []
    )


def _time_base(log: FlightLog) -> list[Finding]:
    step_s = np.diff(log.time_s)
    if len(step_s) < 10:
        return [error("length", f"the log has only {len(log)} rows", "record a flight of 10 s or more")]
    usual = float(np.median(step_s))
    found = []
    if usual >= 0.5:
        unit, divisor = ("microseconds", "1e6") if usual > 100.0 else ("milliseconds", "1000")
        sentence = f"rows are {usual:g} s apart: the time looks like {unit}"
        repair = Repair("scale", ("time_s",), factor=1.0 / float(divisor))
        found.append(error("time unit", sentence, f"divide time_s by {divisor}", repair=repair))
    holes = np.flatnonzero(step_s > longest_pause_s(step_s))
    if len(holes):
        worst = int(holes[np.argmax(step_s[holes])])
        many = "1 gap" if len(holes) == 1 else f"{len(holes)} gaps"
        found.append(
            error(
                "gap",
                f"{many}, the longest of {step_s[worst]:.3f} s at {log.time_s[worst]:.3f} s",
                "fit the pieces between gaps as separate flights (gaps='split')",
                spans=tuple((float(log.time_s[i]), float(log.time_s[i + 1])) for i in holes),
            )
        )
    jitter = float(np.std(step_s[step_s < GAP_FACTOR * usual]) / usual)
    if jitter > 0.3:
        sentence = f"sample intervals vary by {100.0 * jitter:.0f} % of {1000.0 * usual:.1f} ms"
        found.append(warning("jitter", sentence, "stamp samples where they are taken"))
    return found


def _not_finite(log: FlightLog) -> list[Finding]:
    found = []
    for name, values in log.columns.items():
        bad = ~np.isfinite(values)
        if np.isinf(values).any():
            row = int(np.flatnonzero(np.isinf(values))[0])
            where = _spans(log.time_s, np.flatnonzero(np.isinf(values)))
            repair = Repair("blank", (name,), spans=where)
            sentence = f"{name} is infinite in row {row}"
            found.append(error("infinite", sentence, "write NaN there", repair=repair, spans=where))
        elif bad.all():
            repair = Repair("drop", (name,))
            found.append(warning("empty", f"{name} is never finite", "drop the column", repair=repair))
    return found


def _partial(log: FlightLog) -> list[Finding]:
    """Rows in which only some columns of a sample have a value: no fit takes such a log."""
    found = []
    for quantities in TOGETHER:
        if not all(log.has(quantity) for quantity in quantities):
            continue
        columns = tuple(name for quantity in quantities for name in COLUMNS[quantity])
        known = np.isfinite([log.columns[name] for name in columns])
        partly = np.flatnonzero(known.any(axis=0) & ~known.all(axis=0))
        if len(partly):
            where = _spans(log.time_s, partly)
            sentence = (
                f"in {len(partly)} rows (the first at {log.time_s[partly[0]]:.3f} s) only some columns of "
                f"{' and '.join(quantities)} have a value"
            )
            repair = Repair("blank", columns, spans=where)
            found.append(error("partial", sentence, "write NaN in all of them there", repair=repair, spans=where))
    return found


def _contact(where: tuple[Span, ...]) -> list[Finding]:
    if not where:
        return []
    length_s = sum(end - start for start, end in where)
    sentence = f"the vehicle stands on the ground, or touches something, for {length_s:.1f} s"
    return [warning("contact", sentence, "nothing: every fit leaves these stretches out, and says so", spans=where)]


def _jumps(log: FlightLog) -> list[Finding]:
    """Positions that leave the line through their neighbours by far more than is usual in this log."""
    if not log.has("position_world_m"):
        return []
    position = log.vector("position_world_m")
    rows = np.flatnonzero(np.isfinite(position).all(axis=1))
    if len(rows) < 50:
        return []
    off = np.linalg.norm(position[rows[2:]] - 2.0 * position[rows[1:-1]] + position[rows[:-2]], axis=1)
    step_s = np.diff(log.time_s[rows])
    across_gap = np.maximum(step_s[1:], step_s[:-1]) > longest_pause_s(step_s)
    bad = np.flatnonzero((off > max(JUMP_FACTOR * float(np.median(off)), JUMP_LEAST_M)) & ~across_gap)
    if not len(bad):
        return []
    worst = int(bad[np.argmax(off[bad])])
    sentence = (
        f"the position jumps by {off[worst]:.3f} m at {log.time_s[rows[worst + 1]]:.3f} s, {len(bad)} such samples"
    )
    where = _spans(log.time_s, rows[bad + 1])
    repair = Repair("blank", COLUMNS["position_world_m"], spans=where)
    return [error("jump", sentence, "write NaN there, or fit with robust=True", repair=repair, spans=where)]


def _spans(time_s: FloatArray, rows: np.ndarray) -> tuple[Span, ...]:
    """Runs of neighbouring rows as spans."""
    runs = np.split(rows, np.flatnonzero(np.diff(rows) > 1) + 1)
    return tuple((float(time_s[run[0]]), float(time_s[run[-1]])) for run in runs if len(run))


def _frozen(log: FlightLog, touching: tuple[Span, ...]) -> list[Finding]:
    """Channels that stand still, but for rotors at rest: those read 0, and so may telemetry that was lost."""
    found = []
    for quantity, columns in COLUMNS.items():
        if quantity.startswith(COMMANDED) or not log.has(quantity):
            continue
        values = log.vector(quantity)
        known = np.isfinite(values).all(axis=1)
        if quantity == "rotor_speed_rad_s":
            resting = known & (values == 0.0).all(axis=1) & _within(log.time_s, touching)
            found += _at_rest(log.time_s[resting])
            known &= ~resting
        rows = np.flatnonzero(known)
        if len(rows) < 10:
            continue
        for name, constant in zip(columns, np.ptp(values[rows], axis=0) == 0.0, strict=True):
            if constant:
                found.append(warning("constant", f"{name} never changes", "drop it or fix the recorder"))
        # all components at once: a single one may repeat when its resolution is coarse
        start, end = _longest_repeat(values[rows])
        length_s = float(log.time_s[rows[end]] - log.time_s[rows[start]])
        if length_s > FROZEN_S and end - start >= 10:
            sentence = f"{quantity} repeats one value for {length_s:.2f} s from {log.time_s[rows[start]]:.2f} s on"
            where = ((float(log.time_s[rows[start + 1]]), float(log.time_s[rows[end]])),)
            repair = Repair("blank", columns, spans=where)
            fix = "cut that stretch out, or write NaN there"
            found.append(error("frozen", sentence, fix, repair=repair, spans=where))
    return found


def _within(time_s: FloatArray, spans: tuple[Span, ...]) -> NDArray[np.bool_]:
    inside = np.zeros(len(time_s), dtype=bool)
    for start_s, end_s in spans:
        inside |= (time_s >= start_s) & (time_s <= end_s)
    return inside


def _at_rest(time_s: FloatArray) -> list[Finding]:
    if len(time_s) < 10 or time_s[-1] - time_s[0] <= FROZEN_S:
        return []
    sentence = (
        f"all rotors read 0 in {len(time_s)} rows, the first at {time_s[0]:.2f} s, the last at {time_s[-1]:.2f} s"
    )
    fix = "nothing, if the vehicle stood there; else the telemetry was lost; every fit leaves these rows out"
    return [warning("at rest", sentence, fix)]


def _longest_repeat(values: FloatArray) -> tuple[int, int]:
    """First and last index of the longest run of equal rows."""
    edges = np.flatnonzero(np.concatenate([[True], (np.diff(values, axis=0) != 0.0).any(axis=1), [True]]))
    longest = int(np.argmax(np.diff(edges)))
    return int(edges[longest]), int(edges[longest + 1] - 1)


def _saturated(log: FlightLog) -> list[Finding]:
    found = []
    for quantity in ("rotor_speed_rad_s", "rate_body_rad_s", "specific_force_body_m_s2"):
        if not log.has(quantity):
            continue
        for name, values in zip(COLUMNS[quantity], log.vector(quantity).T, strict=True):
            finite = values[np.isfinite(values)]
            if len(finite) < 100 or np.ptp(finite) == 0.0:
                continue
            for extreme in (finite.max(), finite.min()):
                share = float((finite == extreme).mean())
                if share > SATURATED_SHARE and extreme != 0.0 and _well_apart(finite, extreme):
                    sentence = f"{name} sits exactly at {extreme:g} in {100.0 * share:.1f} % of the samples"
                    fix = "raise the sensor's range or fly gentler; leave the stretch out of the fit"
                    found.append(warning("saturated", sentence, fix))
    return found


def _well_apart(values: FloatArray, extreme: float) -> bool:
    """Whether the extreme is much more frequent than its neighbours, so not just a coarse resolution."""
    other = values[values != extreme]
    nearest = other[np.argmin(np.abs(other - extreme))]
    return (values == extreme).sum() > 5 * (other == nearest).sum()
