"""The project's flights: their cards, what each is for, and the logs that come and go.

Cards are made in a process of its own, because a log may be large and its checks slow, and kept on disk.
"""

import contextlib
import logging
import re
import threading
from collections.abc import Callable, Mapping
from pathlib import Path
from types import MappingProxyType

import msgspec

import sysid
import vehicle
from flight import FlightError, FlightLog, InputError, file_format, flight_log, project, results
from flight.project import Project
from gcs_web.flights import reading, session_files
from gcs_web.flights.recorded import Recorded
from gcs_web.jobs import incoming
from gcs_web.jobs.job_process import Failed, JobProcess
from gcs_web.protocol import flights as flights_messages
from gcs_web.protocol.flights import ColumnGuess, FlightCard, Incoming, Role
from gcs_web.protocol.wording import for_page
from sysid.logs import reading as log_reading

logger = logging.getLogger(__name__)


class Flights:
    """Thread-safe. `on_change` is called from any thread with every new list."""

    def __init__(self, opened: Project, on_change: Callable[[flights_messages.Flights], None]) -> None:
        self.recorded = Recorded(opened)
        self._project, self._on_change = opened, on_change
        self._lock = threading.RLock()
        self._roles_file = opened.folder / ".session" / "roles.json"
        self._roles: dict[str, Role] = _roles(self._roles_file)
        self._notes_file = self._roles_file.with_name("notes.json")
        self._notes: dict[str, str] = session_files.read(self._notes_file, dict[str, str]) or {}
        self._failed: dict[str, tuple[reading.Signature, str]] = {}
        self._reader: threading.Thread | None = None
        self._process: JobProcess | None = None
        self._closed = False

    def refresh(self) -> None:
        """List the flights as they are on disk now; cards that are missing follow when they are made."""
        listed = self.listed()
        self._on_change(flights_messages.Flights(listed))
        with self._lock:
            missing = [card.name for card in listed if card.state == "reading"]
            if missing and not self._closed and (self._reader is None or not self._reader.is_alive()):
                self._reader = threading.Thread(target=self._read, args=(missing,), name="flight cards", daemon=True)
                self._reader.start()

    def listed(self) -> list[FlightCard]:
        """The newest first."""
        believed = self._believed()
        dated = [(_changed_ns(path), path.stem) for path in self._project.flights()]
        return [self._card(name, believed) for _, name in sorted(dated, key=lambda one: (-one[0], one[1]))]

    def set_role(self, name: str, role: Role) -> None:
        """
        Raises:
            InputError: there is no such flight, or the choice could not be saved.
        """
        self._require(name)
        self._set_roles({name: role})
        self.refresh()

    def set_note(self, name: str, note: str) -> None:
        """Keep what people write about a flight; empty takes it away. Raises as `set_role`."""
        self._require(name)
        self._set_notes({name: note})
        self.refresh()

    def rename(self, name: str, wanted: str) -> str:
        """Give a log another name, with its role and note; the new name.

        At no instant is there a log without them: whatever fails between leaves one that is left out left out.

        Raises:
            InputError: there is no such flight, the name is none or taken, or the disk refuses it.
        """
        path, new = self._require(name), project.part_name(wanted.strip())
        target = self._project.flight(new)
        if target.exists():
            raise InputError(f"there is a flight {new} already; choose another name")
        self._set_roles({new: self._role(name)})
        self._set_notes({new: self._notes.get(name, "")})
        try:
            target.hardlink_to(path)  # never over another file
            path.unlink()
        except FileExistsError as error:
            raise InputError(f"there is a flight {new} already; choose another name") from error
        except OSError as error:
            raise InputError(f"{name} was not renamed ({error.strerror})") from error
        self._set_roles({name: "learn"})  # as of one that nobody chose for
        self._set_notes({name: ""})
        self.refresh()
        return new

    def names(self, role: Role) -> list[str]:
        """Flights that can be read and are for this, in the order of their names."""
        return sorted(card.name for card in self.listed() if card.role == role and card.state != "unreadable")

    def fix(self, name: str, only: str = "") -> tuple[str, tuple[str, ...]]:
        """Write a flight's log with the fixes its checks propose as a new flight; its name, and what was done.

        The new one takes the role of the other, which is left out: one flight would otherwise count as two.

        Args:
            only: the sentence of the one finding whose fix is applied; empty: all.

        Raises:
            FlightError: there is no such flight, nothing to fix, or the new log is there already.
        """
        path = self._require(name)
        new = project.part_name(f"{name}-fixed")
        results.require_free(self._project.flight(new), overwrite=False)
        log, done = reading.fixed(self._project, path.stem, only)
        self._save(new, log, {new: self._role(name), name: "leave"})
        return new, done

    def discard(self, name: str) -> str:
        """Move a flight's log aside; the name under which it is kept beside. What it was fixed from takes its role."""
        path = self._require(name)
        source = self._fixed_from(path)
        kept = results.move_aside(path)
        if source and self._role(source) == "leave":
            self._set_roles({source: self._role(name)})
        self.refresh()
        return kept.name

    def restore(self, kept: str) -> str:
        """Bring back a log that was moved aside; the flight's name.

        Raises:
            InputError: it is not there, or a flight has that name now.
        """
        found = re.fullmatch(r"(.+)\.parquet\.old-\d+", kept)
        target = self._project.flight(found[1]) if found else None
        if target is None or not (target.with_name(kept)).is_file():
            raise InputError(f"{kept!r} is not kept here (any more)")
        try:
            target.hardlink_to(target.with_name(kept))  # never over another file
        except FileExistsError as error:
            raise InputError(f"there is a flight {target.stem} again; {kept} stays beside it") from error
        target.with_name(kept).unlink()
        source = self._fixed_from(target)
        if source and self._role(source) == self._role(target.stem):
            self._set_roles({source: "leave"})
        self.refresh()
        return target.stem

    # --- logs of other programs ---

    def take(self, file: str) -> str | Incoming:
        """Read a file that was dropped: the flight's name, or what its columns may be if it does not say so itself.

        Raises:
            FlightError: it is not there, or cannot be read.
        """
        path = self._dropped(file)
        if not log_reading.needs_map(path):
            return self._import(path, None)
        drafted = log_reading.draft(path)
        guesses = [ColumnGuess(g.name, g.columns or [g.entries["topic"]], g.reasons) for g in drafted.guesses]
        return Incoming(file, drafted.text, guesses, list(drafted.unused))

    def take_with_map(self, file: str, column_map: str) -> str:
        """Read a dropped file by a column map (TOML); the flight's name.

        Raises:
            FlightError: the map or the file cannot be read.
        """
        path = self._dropped(file)
        written = path.with_name(f"{path.name}.columns.toml")
        file_format.write_bytes(written, column_map.encode())
        return self._import(path, written)

    def close(self) -> None:
        with self._lock:
            self._closed = True
            if self._process is not None:
                self._process.kill()
        if self._reader is not None:
            self._reader.join(timeout=5.0)

    def _dropped(self, file: str) -> Path:
        _stem(file)
        path = incoming.place(self._project, file)
        if not path.is_file():
            raise InputError(f"{file} is not here (any more); drop it again")
        return path

    def _import(self, path: Path, column_map: Path | None) -> str:
        name = _stem(path.name)
        results.require_free(self._project.flight(name), overwrite=False)
        log = sysid.read_log(path, column_map)
        self._save(name, FlightLog(log.columns, {"name": name, **log.metadata, "imported_from": path.name}))
        for used in (path, column_map):
            if used is not None:
                used.unlink(missing_ok=True)
        return name

    def _save(self, name: str, log: FlightLog, roles: Mapping[str, Role] = MappingProxyType({})) -> None:
        with results.new_file(self._project.flight(name), overwrite=False) as placing:
            flight_log.save(placing.temporary, log)
        if roles:
            self._set_roles(roles)
        self.refresh()

    def _role(self, name: str) -> Role:
        return self._roles.get(name, "learn")

    def _set_roles(self, new: Mapping[str, Role]) -> None:
        with self._lock:
            roles: dict[str, Role] = {**self._roles, **new}
            try:
                file_format.write_bytes(self._roles_file, msgspec.json.encode(roles))
            except OSError as error:
                raise InputError(f"the choice was not saved ({error.strerror})") from error
            self._roles = roles

    def _set_notes(self, new: Mapping[str, str]) -> None:
        with self._lock:
            notes = {name: note for name, note in {**self._notes, **new}.items() if note}
            try:
                file_format.write_bytes(self._notes_file, msgspec.json.encode(notes))
            except OSError as error:
                raise InputError(f"the note was not saved ({error.strerror})") from error
            self._notes = notes

    def _fixed_from(self, path: Path) -> str:
        """The flight that a log was made from by fixes, if it is here; empty for none."""
        try:
            source = Path(str(flight_log.head(path)[1].get("fixed_from", ""))).stem
            return source if source and self._project.flight(source).is_file() else ""
        except (FlightError, OSError):
            return ""

    def _require(self, name: str) -> Path:
        path = self._project.flight(name)
        if not path.is_file():
            raise InputError(f"there is no flight {name} (any more)")
        return path

    def _believed(self) -> str:
        """Hash of the project's vehicle; empty for none that can be read."""
        try:
            return vehicle.vehicle_hash(vehicle.load(self._project.vehicle))
        except FlightError:
            return ""

    def _card(self, name: str, believed: str) -> FlightCard:
        role = self._role(name)
        try:
            wanted = reading.signature(self._project, name, believed)
        except (OSError, InputError) as error:
            return FlightCard(
                name, "unreadable", role, self._notes.get(name, ""), sentence=for_page(str(error), self._project.folder)
            )
        kept = reading.kept_card(self._project, name, wanted)
        failed, reason = self._failed.get(name, (None, ""))
        if kept is None and failed == wanted:
            return FlightCard(
                name, "unreadable", role, self._notes.get(name, ""), sentence=for_page(reason, self._project.folder)
            )
        note = self._notes.get(name, "")
        if kept is None:
            return FlightCard(name, "reading", role, note)
        return msgspec.structs.replace(kept, role=role, note=note)

    def _read(self, names: list[str]) -> None:
        log = self._project.folder / ".session" / "flight-cards.log"
        with self._lock:
            if self._closed:
                return
            self._process = JobProcess(reading.write_cards, self._project.folder, names, log)

        def progress(stage: str, fraction: float) -> None:
            logger.debug("read %s, %.0f %%", stage, 100.0 * fraction)
            self._on_change(flights_messages.Flights(self.listed()))

        outcome = self._process.outcome(progress)
        if self._closed:
            return
        left = {card.name for card in self.listed() if card.state == "reading"}
        stuck = next((name for name in names if name in left), None)
        if isinstance(outcome, Failed) and stuck is not None:  # the others are tried again without it
            with contextlib.suppress(OSError):  # it went since
                self._failed[stuck] = (reading.signature(self._project, stuck, self._believed()), outcome.reason)
        self._reader = None
        self.refresh()


def _stem(file: str) -> str:
    ending = next((kind for kind in sorted(incoming.LOGS, key=len, reverse=True) if file.lower().endswith(kind)), None)
    if ending is None:
        raise InputError(f"{file!r} is no flight log that can be read; these end in {', '.join(incoming.LOGS)}")
    return project.part_name(file[: -len(ending)])


def _roles(path: Path) -> dict[str, Role]:
    return session_files.read(path, dict[str, Role]) or {}


def _changed_ns(path: Path) -> int:
    try:
        return path.stat().st_mtime_ns
    except OSError:
        return 0
