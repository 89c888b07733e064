"""What is wrong with a log, said before anything is fitted; every finding proposes a fix and none is applied."""

from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np

from flight import FlightLog, InputError, Progress, silent
from sysid.logs import manoeuvres
from sysid.logs.apply import apply, joined
from sysid.logs.checks import consistency, contact, rotor_count, samples
from sysid.logs.checks.finding import Finding, error, warning
from sysid.logs.events import recording
from sysid.logs.events.event import Event
from sysid.logs.events.repair import Span
from sysid.logs.motors import full_throttle
from sysid.logs.readers.read_ulog import LOST
from vehicle import Vehicle


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
    """What the log, faultless as it may be, is of use for and of no use for, one sentence each."""

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
                | ({"event": f.event.as_dict()} if f.event is not None else {})
                for f in self.findings
            ],
            "inconclusive": list(self.inconclusive),
            "notes": list(self.notes),
        }


def check_log(log: FlightLog, vehicle: Vehicle | None = None, *, progress: Progress = silent) -> LogReport:
    """Look for faults in a log; with a vehicle, also for rotor order, spin and units that its motion contradicts.

    A change of the log is proposed only if, tried on the spot, it takes the finding away.
    """
    report = examine(log, vehicle, progress=progress)
    tried = [f if f.repair is None or f.event is not None else _tried(f, log, vehicle) for f in report.findings]
    progress("checking", 1.0)
    return replace(report, findings=tuple(tried))


def _tried(finding: Finding, log: FlightLog, vehicle: Vehicle | None) -> Finding:
    """The finding without its repair, if that does not take it away."""
    assert finding.repair is not None
    try:
        helps = is_gone(finding, examine(apply(log, finding.repair), vehicle))
    except InputError:  # nothing would be left of the log
        helps = False
    return finding if helps else replace(finding, repair=None, fix="no change of the log that was tried mends it")


def is_gone(finding: Finding, after: LogReport) -> bool:
    """Whether a log to which a finding's repair was applied has it no longer, or (a shift) less than half of it."""
    assert finding.repair is not None
    wanted = finding.repair
    for other in after.findings:
        again = other.repair
        if (
            other.what != finding.what
            or again is None
            or (again.action, again.columns) != (wanted.action, wanted.columns)
        ):
            continue
        if wanted.action != "shift" or abs(again.shift_s) > 0.5 * abs(wanted.shift_s):
            return False
    return True


def examine(log: FlightLog, vehicle: Vehicle | None = None, *, progress: Progress = silent) -> LogReport:
    """As `check_log`, with repairs that nobody tried."""
    progress("checking", 0.0)
    step_s = np.diff(log.time_s)
    touching = contact.spans(log)
    events = recording.find(log, touching)
    findings = [*_lost(log), *samples.check(log, touching), *map(_of_event, events), *_contact(touching)]
    for event in events:
        if event.repair is not None:
            log = apply(log, event.repair)
    compared, inconclusive = list[Finding](), list[str]()
    if vehicle is not None and (other := rotor_count.check(log, vehicle)):
        findings, vehicle = [*findings, *other], None
    if not any(finding.what == "time unit" for finding in findings):
        compared, inconclusive = consistency.check(joined(log), vehicle, progress)
    progress("checking", 0.9)
    return LogReport(
        name=str(log.metadata.get("name", "log")),
        duration_s=float(log.time_s[-1] - log.time_s[0]) if len(log) else 0.0,
        rate_hz=float(1.0 / np.median(step_s)) if len(step_s) else 0.0,
        findings=(*findings, *compared, *samples.partial(log)),
        inconclusive=tuple(inconclusive),
        notes=_notes(log),
    )


def _of_event(event: Event) -> Finding:
    make = warning if event.done and event.certain else error
    found = make(event.kind, event.sentence, event.way_out, repair=event.repair, spans=(event.span,))
    return replace(found, event=event)


def _notes(log: FlightLog) -> tuple[str, ...]:
    flown = (*_slow(log), *(one.sentence for one in manoeuvres.found(log)))
    if log.has("rotor_speed_rad_s") or log.has("rotor_speed_command_rad_s"):
        return flown
    if full_throttle.has_ratios(log):
        said = "its motor commands are from 0 to 1: a fit takes 1 for the fastest rotor speed of the vehicle file"
        return (said, *flown)
    return (
        "it has no rotor speed and no motor command: no vehicle can be identified from it "
        f"(a motor command is {full_throttle.RATIOS[0]} ..., from 0 to 1, or {full_throttle.COMMAND})",
    )


def _slow(log: FlightLog) -> tuple[str, ...]:
    """Of a log without a pose whose IMU shows no inertia."""
    imu = log.has("rate_body_rad_s") and log.has("specific_force_body_m_s2")
    if log.has("position_world_m") or not imu or (rate_hz := manoeuvres.rate_hz(log)) >= manoeuvres.SLOWEST_HZ:
        return ()
    return (
        f"gyro and accelerometer at {rate_hz:.0f} Hz without a pose show no inertia apart from lag: log them at "
        f"{manoeuvres.SLOWEST_HZ:g} Hz or more, or record a pose",
    )


def _lost(log: FlightLog) -> list[Finding]:
    lost = log.metadata.get(LOST)
    return (
        [warning("incomplete file", str(lost), "copy it from the vehicle again if it is whole there")] if lost else []
    )


def _contact(where: tuple[Span, ...]) -> list[Finding]:
    if not where:
        return []
    length_s = sum(end - start for start, end in where)
    sentence = f"the vehicle stands on the ground, or touches something, for {length_s:.1f} s"
    remedy = "nothing to mend: every fit leaves these stretches out, and says so"
    return [warning("contact", sentence, remedy, spans=where)]
