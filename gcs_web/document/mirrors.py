"""Files that other programs read and write, kept equal to the document: `waypoints.json` and the map's edits."""

import logging
from abc import ABC, abstractmethod
from pathlib import Path
from typing import ClassVar

import msgspec

from esdf.edits import EDITS
from flight import mission, results
from gcs_web.document import map_edits, missions
from gcs_web.document.document import Content

logger = logging.getLogger(__name__)

Seen = tuple[int, int, int] | None
"""Which file it is: inode, time of change, size; each of our writes makes a new one. None: there is no file."""


class Left:
    """How we left each file, on disk: what another program did to it while no station was open is told from it.

    Written after the file itself, so that a station that is killed between the two finds a file that is the
    document's. Not fsynced: one that is lost makes a file look foreign, and a foreign file is read, never dropped.
    """

    def __init__(self, path: Path) -> None:
        self._path = path
        try:
            self._seen: dict[str, Seen] = msgspec.json.decode(path.read_bytes(), type=dict[str, Seen])
        except (OSError, ValueError, msgspec.MsgspecError):
            self._seen = {}

    def __getitem__(self, name: str) -> Seen | bool:
        return self._seen.get(name, False)

    def __setitem__(self, name: str, seen: Seen) -> None:
        if self[name] == seen:
            return
        self._seen[name] = seen
        beside = self._path.with_suffix(".tmp")
        try:
            beside.write_bytes(msgspec.json.encode(self._seen))
            beside.replace(self._path)
        except OSError as error:
            logger.warning("%s could not be written: %s", self._path, error.strerror)


class Mirror(ABC):
    """A file with a part of the document."""

    while_behind: ClassVar[str]
    """What holds as long as the file could not be written."""

    def __init__(self, path: Path, left: Left) -> None:
        self.path, self._left = path, left
        self.written: Seen | bool = False
        """The file as we left or read it; False before that."""
        self.problem = ""
        """Why the file is not that of the document; empty when it is."""

    @property
    @abstractmethod
    def is_missing(self) -> bool:
        """Whether there is nothing to read: no change by another program."""

    @abstractmethod
    def lacks(self, content: Content) -> bool:
        """Whether a file that is missing should be there."""

    @abstractmethod
    def read(self, content: Content) -> Content:
        """The document with what the file says. Raises `FlightError` if it is damaged."""

    @abstractmethod
    def same(self, a: Content, b: Content) -> bool:
        """Whether two documents are the same in what the file says."""

    @abstractmethod
    def write(self, content: Content) -> None: ...

    def first(self, content: Content) -> Content:
        """Of a document that was never opened."""
        return content if self.is_missing else self.read(content)

    def seen(self) -> Seen:
        try:
            found = self.path.stat()
        except FileNotFoundError:
            return None
        return (found.st_ino, found.st_mtime_ns, found.st_size)

    def is_ours(self, seen: Seen) -> bool:
        return self.written is not False and self.written == seen

    @property
    def is_as_left(self) -> bool:
        """Whether nobody wrote the file since we did, in this session or the last one."""
        return self._left[self.path.name] == self.seen()

    def leave(self) -> None:
        """Take the file for the document's, as it is now."""
        self.written = seen = self.seen()
        self._left[self.path.name] = seen

    def is_behind(self, before: Content, after: Content) -> bool:
        """Whether the file must be written after this change."""
        return True

    def update(self, before: Content, after: Content) -> str:
        """Bring the file up to date; returns a sentence where another program's version was kept beside it.

        Raises:
            OSError: it cannot be written.
        """
        said = ""
        if not self.is_behind(before, after):
            return said
        try:
            if self.path.exists() and not self.is_ours(self.seen()):
                kept = results.keep(self.path)
                said = f"another program wrote {self.path.name} during an edit here; its version is kept as {kept.name}"
            self.write(after)
        except OSError as error:
            self.problem = f"{self.path.name} could not be written: {error.strerror}"
            raise
        self.problem = ""
        return said


class WaypointsFile(Mirror):
    """`waypoints.json`: the waypoints and what is asked of them."""

    while_behind = "other programs see an older state"

    @property
    def is_missing(self) -> bool:
        return not self.path.exists()

    def lacks(self, content: Content) -> bool:
        return bool(content.points)

    def read(self, content: Content) -> Content:
        return missions.with_mission(content, mission.load(self.path))

    def same(self, a: Content, b: Content) -> bool:
        return missions.same(a, missions.mission_of(b))

    def write(self, content: Content) -> None:
        mission.save(self.path, missions.mission_of(content))
        self.leave()


class MapEditsFile(Mirror):
    """The edits of the map beside its distance field; no file is the same as no edits."""

    while_behind = "the map lacks this edit, so nothing is planned or checked until it is written"

    def __init__(self, map_folder: Path, left: Left) -> None:
        super().__init__(map_folder / "esdf" / EDITS, left)

    @property
    def is_missing(self) -> bool:
        return not self.path.parent.is_dir()

    def lacks(self, content: Content) -> bool:
        return False

    def read(self, content: Content) -> Content:
        found = map_edits.load(self.path)
        return content.with_map_edits(map_edits.renewed(content.map_edits, found, content.next_id))

    def same(self, a: Content, b: Content) -> bool:
        return [edit.edit() for edit in a.map_edits] == [edit.edit() for edit in b.map_edits]

    def write(self, content: Content) -> None:
        if self.path.exists() or content.map_edits:
            map_edits.save(self.path, content.map_edits)
        self.leave()

    def is_behind(self, before: Content, after: Content) -> bool:
        """Only where the list changed: what another program wrote waits to be taken over."""
        return not self.is_missing and (bool(self.problem) or before.map_edits != after.map_edits)
