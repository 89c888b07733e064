"""Are a log's columns those of samples? Their times, values that are none, rows that are half there, saturation."""

import numpy as np
from numpy.typing import NDArray

from flight import FlightLog
from flight.flight_log import COLUMNS
from flight.rotations import FloatArray
from sysid.logs.checks.finding import Finding, error, warning
from sysid.logs.events.event import splits
from sysid.logs.events.frozen import COMMANDED, within
from sysid.logs.events.repair import Repair, Span
from sysid.logs.events.stamps import GAP_FACTOR, longest_pause_s

TOGETHER = (("position_world_m", "q_world_body"), ("rotor_speed_rad_s",))
"""What a fit takes as one sample: a row has all of its columns or none."""
SATURATED_SHARE = 0.01
"""A channel that sits exactly at its own extreme in this share of the samples has saturated."""
AT_REST_S = 0.25
"""Rotors that read 0 for less are not worth a word."""


def check(log: FlightLog, touching: tuple[Span, ...]) -> list[Finding]:
    """Findings about times and values, but for what is found once all else is said (`partial`).

    Args:
        touching: where the vehicle stands on the ground, or touches something.
    """
    return [*_time_base(log), *_not_finite(log), *_constant(log, touching), *_saturated(log)]


def _time_base(log: FlightLog) -> list[Finding]:
    step_s = np.diff(log.time_s)
    if len(step_s) < 10:
        return [error("length", f"the log has only {len(log)} rows", "record a flight of 10 s or more")]
    usual = float(np.median(step_s))
    found = []
    if usual >= 0.5:
        units = (("nanoseconds", "1e9", 1e5), ("microseconds", "1e6", 100.0), ("milliseconds", "1000", 0.0))
        unit, divisor, _ = next(one for one in units if usual > one[2])
        sentence = f"rows are {usual:g} s apart: the time looks like {unit}"
        repair = Repair("scale", ("time_s",), factor=1.0 / float(divisor))
        found.append(error("time unit", sentence, f"divide time_s by {divisor}", repair=repair))
    holes = np.flatnonzero((step_s > longest_pause_s(step_s)) & _unsplit(log))
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


def _unsplit(log: FlightLog) -> NDArray[np.bool_]:
    """(n - 1,) which steps between rows do not lie over a place where the log is split already."""
    free = np.ones(len(log) - 1, dtype=bool)
    for begin_s, end_s in splits(log):
        free &= ~((log.time_s[:-1] < end_s) & (log.time_s[1:] > begin_s))
    return free


def _not_finite(log: FlightLog) -> list[Finding]:
    found = []
    for name, values in log.columns.items() if len(log) else ():
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


def partial(log: FlightLog) -> list[Finding]:
    """Rows in which only some columns of a sample have a value: no fit takes such a log."""
    found = []
    for quantities in TOGETHER:
        if not all(log.has(quantity) for quantity in quantities):
            continue
        columns = tuple(name for quantity in quantities for name in log.names(quantity))
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


def _spans(time_s: FloatArray, rows: np.ndarray) -> tuple[Span, ...]:
    """Runs of neighbouring rows as spans."""
    runs = np.split(rows, np.flatnonzero(np.diff(rows) > 1) + 1)
    return tuple((float(time_s[run[0]]), float(time_s[run[-1]])) for run in runs if len(run))


def _constant(log: FlightLog, touching: tuple[Span, ...]) -> list[Finding]:
    """Columns that never change, but for rotors at rest: those read 0, and so may telemetry that was lost."""
    found: list[Finding] = []
    for quantity in COLUMNS:
        columns = log.names(quantity)
        if quantity.startswith(COMMANDED) or not log.has(quantity):
            continue
        values = log.vector(quantity)
        known = np.isfinite(values).all(axis=1)
        if quantity == "rotor_speed_rad_s":
            resting = known & (values == 0.0).all(axis=1) & within(log.time_s, touching)
            found += _at_rest(log.time_s[resting])
            known &= ~resting
        if known.sum() < 10:
            continue
        for name, constant in zip(columns, np.ptp(values[known], axis=0) == 0.0, strict=True):
            if constant:
                found.append(warning("constant", f"{name} never changes", "drop it or fix the recorder"))
    return found


def _at_rest(time_s: FloatArray) -> list[Finding]:
    if len(time_s) < 10 or time_s[-1] - time_s[0] <= AT_REST_S:
        return []
    sentence = (
        f"all rotors read 0 in {len(time_s)} rows, the first at {time_s[0]:.2f} s, the last at {time_s[-1]:.2f} s"
    )
    fix = "nothing, if the vehicle stood there; else the telemetry was lost; every fit leaves these rows out"
    return [warning("at rest", sentence, fix)]


def _saturated(log: FlightLog) -> list[Finding]:
    found = []
    for quantity in ("rotor_speed_rad_s", "rate_body_rad_s", "specific_force_body_m_s2"):
        if not log.has(quantity):
            continue
        for name, values in zip(log.names(quantity), log.vector(quantity).T, strict=True):
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
