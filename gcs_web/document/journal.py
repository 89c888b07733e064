"""The document on disk: a snapshot and a journal of the changes since, so that kill -9 loses nothing.

Each line of `journal.jsonl` is the CRC-32 of its text and the text; a change counts once its line is on disk (fsync).
A last line that is cut off was never acknowledged and is dropped. Every `COMPACT_AFTER` lines the snapshot is renewed
(temporary file, rename) and the journal begins anew; lines that the snapshot already holds are passed over on reading.
The snapshot has a CRC-32 of its own: what a disk or another program did to it is refused, never opened as a document.
"""

import errno
import fcntl
import io
import logging
import os
import re
import zlib
from collections import deque
from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal

import msgspec

from flight import FlightError, FormatError, InputError, file_format, results
from gcs_web.document.document import Content, Patch, patched

logger = logging.getLogger(__name__)

UNDO_DEPTH = 200
COMPACT_AFTER = 1000
FORMAT, VERSION = "goshawk-document", 4
WITH_MAP_EDITS, WITH_CRC = 3, 4
"""First versions that hold the edits of the map, and a CRC."""


class Entry(msgspec.Struct, frozen=True):
    """One change, and the way back."""

    revision: int
    author: str
    label: str
    kind: Literal["edit", "undo", "redo"]
    patch: Patch
    inverse: Patch


class _Snapshot(msgspec.Struct):
    format: str
    version: int
    revision: int
    content: Content
    undo: list[Entry]
    redo: list[Entry]


@dataclass(slots=True)
class Saved:
    """What is on disk."""

    revision: int = 0
    content: Content = field(default_factory=Content)
    undo: deque[Entry] = field(default_factory=lambda: deque(maxlen=UNDO_DEPTH))
    redo: list[Entry] = field(default_factory=list[Entry])

    def take(self, entry: Entry, content: Content) -> None:
        """Go on by one change. The content after it is given, because whoever made the change has it."""
        if entry.kind == "undo":
            self.redo.append(self.undo.pop())
        elif entry.kind == "redo":
            self.undo.append(self.redo.pop())
        else:
            self.undo.append(entry)
            self.redo.clear()
        self.revision, self.content = entry.revision, content


class Journal:
    """The folder `.session` of a project; one process at a time."""

    def __init__(self, folder: Path) -> None:
        """Take the folder and read what it holds into `saved`.

        Raises:
            InputError: another ground station has the project open.
            FormatError: the snapshot is damaged or of a newer version.
        """
        folder.mkdir(parents=True, exist_ok=True)
        self._snapshot, self._path = folder / "document.json", folder / "journal.jsonl"
        self._lock = _locked(folder / "lock")
        try:
            self.version = VERSION
            """Of what was found."""
            self.saved, self.notice = self._read()
            self._file = self._opened()
            self._lines = 0
        except BaseException:
            self._lock.close()
            raise

    @property
    def is_new(self) -> bool:
        """Whether no document was ever kept here."""
        return self.saved.revision == 0 and not self._snapshot.exists()

    def begin(self, content: Content) -> None:
        """Start a new document, or an old one in this version, with this content, which nobody can undo."""
        self.saved.content = content
        self.compact()

    def append(self, entry: Entry, content: Content) -> None:
        """Make a change last; `saved` is the document after it.

        Raises:
            InputError: the disk refused it; nothing was changed.
        """
        line, length = _line(entry), os.fstat(self._file.fileno()).st_size
        try:
            if self._file.write(line) != len(line):
                raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
            os.fsync(self._file.fileno())
        except OSError as error:
            os.ftruncate(self._file.fileno(), length)  # half a line would hide all that come after it
            said = f"the change was not saved ({error.strerror}) and not made; free some disk space"
            raise InputError(said) from error
        self.saved.take(entry, content)
        self._lines += 1
        if self._lines >= COMPACT_AFTER:
            try:
                self.compact()
            except OSError:  # the change is made and on disk; tried again after the next one
                logger.exception("the snapshot could not be renewed")

    def compact(self) -> None:
        """Renew the snapshot and begin the journal anew."""
        saved = self.saved
        snapshot = _Snapshot(FORMAT, VERSION, saved.revision, saved.content, list(saved.undo), saved.redo)
        file_format.write_bytes(self._snapshot, _encoded(snapshot))
        os.ftruncate(self._file.fileno(), 0)  # needs no space; a kill before it leaves lines that reading passes over
        os.fsync(self._file.fileno())
        self._lines = 0

    def close(self) -> None:
        self._file.close()
        self._lock.close()

    def _opened(self) -> io.FileIO:
        return io.FileIO(self._path, "ab")  # unbuffered: what was refused must not be written later

    def _read(self) -> tuple[Saved, str]:
        """The document, and a sentence where something was lost."""
        saved = Saved()
        if self._snapshot.exists():
            snapshot = _decoded(self._snapshot)
            self.version = snapshot.version
            saved = Saved(snapshot.revision, snapshot.content, deque(snapshot.undo, UNDO_DEPTH), snapshot.redo)
        if not self._path.exists():
            return saved, ""
        data = self._path.read_bytes()
        good = 0
        for line in data.splitlines(keepends=True):
            entry = _entry(line)
            if entry is None or (entry.revision > saved.revision and not _follows(saved, entry)):
                break
            good += len(line)
            if entry.revision > saved.revision:
                saved.take(entry, patched(saved.content, entry.patch))
        lost = data[good:]
        if not lost:
            return saved, ""
        kept = results.keep(self._path) if b"\n" in lost else None  # a cut-off last line was never acknowledged
        file_format.write_bytes(self._path, data[:good])
        if kept is None:
            return saved, ""
        return saved, f"the journal is damaged after revision {saved.revision}; what followed is kept in {kept.name}"


def _line(entry: Entry) -> bytes:
    text = msgspec.json.encode(entry)
    return b"%08x %s\n" % (zlib.crc32(text), text)


def _entry(line: bytes) -> Entry | None:
    """The change of a line, None where it is cut off or damaged."""
    crc, _, text = line.removesuffix(b"\n").partition(b" ")
    if not line.endswith(b"\n") or crc != b"%08x" % zlib.crc32(text):
        return None
    try:
        return msgspec.json.decode(text, type=Entry)
    except msgspec.DecodeError:
        return None


def _follows(saved: Saved, entry: Entry) -> bool:
    stack = {"edit": True, "undo": saved.undo, "redo": saved.redo}[entry.kind]
    return entry.revision == saved.revision + 1 and bool(stack)


_CRC = re.compile(rb',"crc32":"([0-9a-f]{8})"}\Z')
"""Last in a snapshot; of all bytes before it."""


def _encoded(snapshot: _Snapshot) -> bytes:
    text = msgspec.json.encode(snapshot).removesuffix(b"}")
    return b'%s,"crc32":"%08x"}' % (text, zlib.crc32(text))


def _decoded(path: Path) -> _Snapshot:
    data = path.read_bytes()
    crc = _CRC.search(data)
    try:
        if crc is not None and int(crc[1], 16) != zlib.crc32(data[: crc.start()]):
            raise FormatError("its CRC does not match")
        msgspec.json.decode(data)
    except (msgspec.DecodeError, UnicodeDecodeError, FormatError) as error:
        raise _damaged(path, error) from error
    file_format.read_json(path, format=FORMAT, version=VERSION)  # refuses what is no document, and newer versions
    try:
        snapshot = msgspec.json.decode(data, type=_Snapshot)
        if crc is None and snapshot.version >= WITH_CRC:
            raise FormatError("it has no CRC")
        _require_solids(snapshot)
    except (msgspec.DecodeError, FlightError) as error:
        raise _damaged(path, error) from error
    return snapshot


def _damaged(path: Path, why: Exception) -> FormatError:
    return FormatError(f"{path} is damaged: {why}; move it away to start from waypoints.json")


def _require_solids(snapshot: _Snapshot) -> None:
    """Raises `FlightError` if an edit of the map, or one that undo or redo would bring back, makes no solid."""
    patches = [patch for entry in (*snapshot.undo, *snapshot.redo) for patch in (entry.patch, entry.inverse)]
    for each in (*snapshot.content.map_edits, *(edit for patch in patches for edit in patch.map_edits)):
        each.edit()


def _locked(path: Path) -> io.FileIO:
    lock = io.FileIO(path, "a+")
    try:
        fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        lock.seek(0)
        owner = lock.read(20).decode(errors="replace").strip() or "unknown"
        lock.close()
        raise InputError(
            f"another ground station (process {owner}) has this project open; use its page, or stop it first"
        ) from None
    lock.truncate(0)
    lock.write(str(os.getpid()).encode())
    return lock
