"""The vehicle's model as people work on it: the newest diagnosis, a change that was tried, the versions of the file."""

import json
import threading
from pathlib import Path

import msgspec

import vehicle
from flight import FlightError, InputError, file_format
from flight.project import Project
from gcs_web.comparison import reports
from gcs_web.flights import reading, session_files
from gcs_web.flights.flights import Flights
from gcs_web.learning import diagnosis_values, identified, proposed
from gcs_web.protocol.consent import EffectForm
from gcs_web.protocol.identified import Identification
from gcs_web.protocol.learning import Diagnosis, Model, ParameterRow, Tried, VehicleVersion
from gcs_web.protocol.next_flight import NextFlight
from sysid.diagnosis import curve, equation_text
from sysid.report import words
from vehicle import history
from vehicle.history import HeldOut, Step


class KeptTrial(msgspec.Struct, frozen=True):
    """A change that was tried, on disk."""

    shown: Tried
    held_out: HeldOut | None
    file_sha256: str
    """Of the vehicle file that it changes."""


def diagnosis_file(folder: Path) -> Path:
    return folder / ".session" / "diagnosis.json"


def tried_files(folder: Path) -> tuple[Path, Path]:
    """The changed vehicle, and what came of trying it."""
    return folder / ".session" / "tried.toml", folder / ".session" / "tried.json"


def own_effects(folder: Path) -> Path:
    """The folder of a project's own effect files, to be tried."""
    return folder / "effects"


class Learning:
    """Thread-safe."""

    def __init__(self, opened: Project, flights: Flights) -> None:
        self._project, self._flights = opened, flights
        self._lock = threading.RLock()

    def diagnosis(self) -> Diagnosis:
        """The newest diagnosis; `old` if vehicle or flights are others now."""
        found = session_files.read(diagnosis_file(self._project.folder), Diagnosis)
        if found is None:
            return Diagnosis("none")
        same = (found.vehicle, found.logs, found.learn, found.held_out) == (
            self._hash(),
            reading.contents(self._project, [*found.learn, *found.held_out]),
            self._flights.names("learn"),
            self._flights.names("hold_out"),
        )
        has_report = reports.report_file(self._project.folder, "diagnosis").is_file()
        return msgspec.structs.replace(found, state="current" if same else "old", has_report=has_report)

    def identification(self) -> Identification:
        """The newest identification; `old` if the vehicle or its flights are others now."""
        found = identified.load(self._project.folder)
        if found.state == "none":
            return found
        same = (found.vehicle, found.logs) == (self._hash(), reading.contents(self._project, found.flights))
        return msgspec.structs.replace(found, state="current" if same else "old")

    def next_flight(self) -> NextFlight:
        """The flight that was proposed last; `old` if the vehicle, the flights or the map are others now."""
        found = proposed.load(self._project.folder)
        if found.state == "none":
            return found
        learn, held_out = self._flights.names("learn"), self._flights.names("hold_out")
        same = (found.vehicle, found.map, found.learn, found.held_out, found.logs) == (
            self._hash(),
            proposed.map_hash(self._project),
            learn,
            held_out,
            reading.contents(self._project, [*learn, *held_out]),
        )
        return msgspec.structs.replace(found, state="current" if same else "old")

    def model(self) -> Model:
        """
        Raises:
            FlightError: the vehicle file or its history cannot be read.
        """
        present = vehicle.load(self._project.vehicle)
        kept = self._trial()
        return Model(
            present.name,
            [words.effect(effect) for effect in present.effects],
            list(present.effects),
            [
                ParameterRow(name, words.parameter_in_full(name), p.value, p.std, p.unit, p.source)
                for name, p in ((name, present.parameter(name)) for name in vehicle.specs(present))
            ],
            self._versions(),
            None if kept is None else kept.shown,
        )

    def keep(self, vehicle_hash: str) -> Step:
        """Make the tried change the next version of the vehicle file.

        Raises:
            InputError: nothing is tried, or the vehicle file changed since, or the page shows another trial.
        """
        with self._lock:
            kept = self._trial()
            if kept is None:
                raise InputError("no change is tried; try a candidate first")
            file, _ = tried_files(self._project.folder)
            changed = vehicle.load(file)
            if not kept.shown.vehicle_hash == vehicle_hash == vehicle.vehicle_hash(changed):
                raise InputError(f"another change was tried since: {kept.shown.title}; look at that one first")
            if kept.file_sha256 != file_format.file_hash(self._project.vehicle):
                raise InputError("the vehicle file changed since this was tried; try it again")
            step = history.record(
                self._project.vehicle, changed, "add-effect", effect=kept.shown.effect, held_out=kept.held_out
            )
            self.drop()
            return step

    def drop(self) -> None:
        """Forget the change that was tried."""
        for file in tried_files(self._project.folder):
            file.unlink(missing_ok=True)

    def draft_effect(self, name: str, form: EffectForm) -> Path:
        """Write an effect file of what was diagnosed, as `goshawk vehicle effect scaffold` does.

        Args:
            form: the proposed equation, or a function through the curve that no known effect explains.

        Raises:
            FlightError: there is no such equation or curve, no effect can be made of it, or the name is taken or no
                name.
        """
        found = self.diagnosis()
        if found.state == "old":
            raise InputError(
                "the vehicle, a flight or the choice of flights changed since the diagnosis; diagnose again"
            )
        folder = own_effects(self._project.folder)
        file = folder / f"{name}.py"
        with self._lock:
            folder.mkdir(exist_ok=True)
            if form == "equation":
                if found.equation is None:
                    raise InputError("the diagnosis proposes no equation; diagnose again")
                return equation_text.scaffold(json.loads(found.equation.facts), file, name=name)
            if found.outside is None:
                raise InputError("the diagnosis has no curve that no known effect explains; diagnose again")
            return curve.scaffold(diagnosis_values.curve_facts(found.outside), file, name=name, form=form)

    def return_to(self, number: int) -> tuple[Step, Step]:
        """Restore a version of the vehicle file; the one that was left, and the one that is there now.

        Raises:
            InputError: there is no such version.
        """
        with self._lock:
            return history.restore(self._project.vehicle, number)

    def _hash(self) -> str:
        try:
            return vehicle.vehicle_hash(vehicle.load(self._project.vehicle))
        except FlightError:
            return ""

    def _trial(self) -> KeptTrial | None:
        _, file = tried_files(self._project.folder)
        return session_files.read(file, KeptTrial)

    def _versions(self) -> list[VehicleVersion]:
        told = history.read(self._project.vehicle)
        line = {step.number for step in told.line()}
        return [
            VehicleVersion(
                step.number,
                step.action,
                step.effect,
                step.when_utc,
                step.number == told.current,
                step.number not in line,
                None if step.held_out is None else 1000.0 * step.held_out.after.get("position_m", float("nan")),
                "" if step.held_out is None else step.held_out.verdict,
                self._changes(told, step),
            )
            for step in told.steps
        ]

    def _changes(self, told: history.History, step: Step) -> list[str]:
        """From the version that a step started from; empty where that cannot be read any more."""
        if step.parent is None:
            return []
        try:
            before, after = (history.version(self._project.vehicle, s) for s in (told.steps[step.parent], step))
        except (FlightError, OSError):
            return []
        return history.differences(before, after)


def save_trial(folder: Path, changed: vehicle.Vehicle, kept: KeptTrial) -> None:
    """Keep a change that was tried, in place of the one before."""
    toml, json = tried_files(folder)
    json.unlink(missing_ok=True)  # first: the pair is never of two trials
    vehicle.save(toml, changed)
    file_format.write_bytes(json, msgspec.json.encode(kept))
