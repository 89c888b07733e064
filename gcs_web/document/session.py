"""One open project: the document with undo, journaled before anybody sees a change; nothing of page or planner.

Commands come from several people and threads. An edit made on an older revision is merged if what others changed since
are other waypoints and other settings, and refused with a sentence if not.
"""

import logging
import threading
from collections import deque
from collections.abc import Callable
from typing import Literal, NamedTuple

from flight import FlightError, InputError, Waypoints
from flight.mission import Mission
from flight.project import Project
from gcs_web.document import edits, missions, page_values
from gcs_web.document.document import Content, Settings, difference, patched
from gcs_web.document.journal import VERSION, WITH_MAP_EDITS, Entry, Journal
from gcs_web.document.mirrors import Left, MapEditsFile, Mirror, WaypointsFile
from gcs_web.protocol.base import Edit
from gcs_web.protocol.document import Document

logger = logging.getLogger(__name__)

REMEMBERED = 1000
"""Revisions back an edit may be based on."""

OUTSIDE = "another program"
"""Author of changes that are found in `waypoints.json` or in the map's list of edits."""


_DONE = {"undo": "taken back", "redo": "done again"}


class _Change(NamedTuple):
    revision: int
    author: str
    touched: frozenset[int | str]


class Session:
    """Thread-safe. `on_change` is called after every change, from whichever thread made it."""

    def __init__(self, opened: Project, settings: Settings) -> None:
        """Open the document; one that was never opened starts from `waypoints.json`.

        Args:
            settings: of a document that was never opened.

        Raises:
            InputError: another ground station has the project open.
            FormatError: the document, `waypoints.json` or the list of the map's edits is damaged.
        """
        self.project = opened
        self._lock = threading.RLock()
        self._recent: deque[_Change] = deque(maxlen=REMEMBERED)
        self._listeners: list[Callable[[], None]] = []
        self._journal = Journal(opened.folder / ".session")
        self._notice = self._journal.notice
        self.author = ""
        """Who made the newest change."""
        left = Left(opened.folder / ".session" / "files.json")
        self._waypoints, self._map_edits = WaypointsFile(opened.waypoints, left), MapEditsFile(opened.map, left)
        self._mirrors: tuple[Mirror, ...] = (self._waypoints, self._map_edits)
        try:
            if self._journal.is_new:
                first = Content(settings=settings)
                for mirror in self._mirrors:
                    first = mirror.first(first)
                self._journal.begin(first)
            elif self._journal.version < VERSION:  # an older program must refuse it, not drop what it does not know
                older = self.content
                lacks_edits = self._journal.version < WITH_MAP_EDITS
                self._journal.begin(self._map_edits.first(older) if lacks_edits else older)
            self._take_files(opening=True)
        except BaseException:
            self._journal.close()
            raise

    def on_change(self, listener: Callable[[], None]) -> None:
        self._listeners.append(listener)

    @property
    def content(self) -> Content:
        return self._journal.saved.content

    @property
    def revision(self) -> int:
        return self._journal.saved.revision

    def take_notice(self) -> str:
        """What opening the document or the newest change has to tell people, once; empty for nothing."""
        said, self._notice = self._notice, ""
        return said

    def document(self) -> Document:
        """The document as the page shows it."""
        with self._lock:
            saved = self._journal.saved
            return Document(
                revision=saved.revision,
                author=self.author,
                waypoints=[page_values.waypoint(point) for point in saved.content.points],
                settings=page_values.settings(saved.content.settings),
                mission=page_values.mission(saved.content.settings),
                map_edits=[page_values.map_edit(edit) for edit in saved.content.map_edits],
                undo=saved.undo[-1].label if saved.undo else "",
                redo=saved.redo[-1].label if saved.redo else "",
            )

    def edit(self, edit: Edit, author: str) -> str:
        """Make a change; returns what was done in words, empty when nothing changed.

        Raises:
            InputError: the edit is not possible, conflicts with another person's, or could not be saved.
        """
        with self._lock:
            after, label = edits.apply(self.content, edit)
            self._refuse_conflict(edit, difference(self.content, after).touched, author)
            return self._make(after, label, author)

    def take(self, wanted: Mission | Waypoints, label: str, author: str) -> str:
        """Replace all waypoints and requests, as one change."""
        asked = Mission(wanted) if isinstance(wanted, Waypoints) else wanted
        with self._lock:
            return self._make(missions.with_mission(self.content, asked), label, author)

    def undo(self, author: str) -> str:
        """Take back the newest change, whoever made it; returns what was taken back, naming who made it."""
        return self._step("undo", author)

    def redo(self, author: str) -> str:
        return self._step("redo", author)

    @property
    def map_edits_behind(self) -> str:
        """Why the map on disk lacks the document's edits; empty when it has them."""
        return self._map_edits.problem

    def take_files(self) -> list[str]:
        """Take over what another program wrote into `waypoints.json` or the map's edits, as changes that can be undone.

        Returns:
            Names of the files.

        Raises:
            FormatError: a file is damaged.
            InputError: a change could not be saved.
        """
        return self._take_files(opening=False)

    def close(self) -> None:
        with self._lock:
            self._journal.close()

    def _take_files(self, *, opening: bool) -> list[str]:
        taken, problem = [], None
        for mirror in self._mirrors:
            try:
                taken += [mirror.path.name] if self._take_file(mirror, opening=opening) else []
            except FlightError as error:
                problem = problem or error  # a damaged file must not hide the other one
        if problem is not None:
            raise problem
        return taken

    def _take_file(self, mirror: Mirror, *, opening: bool) -> bool:
        """As `take_files`; on opening, a file as we left it is one of before a change that we did not come to write."""
        with self._lock:
            if mirror.is_missing:
                if mirror.lacks(self.content):
                    mirror.write(self.content)
                return False
            seen = mirror.seen()
            if mirror.is_ours(seen):
                return False  # ours, if perhaps of before an edit that could not be written
            last = mirror.written
            found = mirror.read(self.content)
            mirror.written = seen  # a damaged file stays foreign: the next edit keeps it
            if mirror.same(self.content, found):
                mirror.leave()
                return False
            if opening and mirror.is_as_left:
                mirror.write(self.content)  # we were killed between journal and file
                return False
            try:
                return bool(self._make(found, f"{mirror.path.name} was changed by another program", OUTSIDE))
            except InputError:
                mirror.written = last  # stays foreign too
                raise

    def _refuse_conflict(self, edit: Edit, touched: frozenset[int | str], author: str) -> None:
        if edit.revision >= self.revision:
            return
        oldest = self._recent[0].revision if self._recent else self.revision + 1
        if edit.revision < oldest - 1:
            raise InputError("this page shows a document that is too old; it was brought up to date, try again")
        for change in self._recent:
            if change.revision > edit.revision and change.author != author and change.touched & touched:
                raise InputError(f"{change.author} changed the same meanwhile; nothing was changed, look again")

    def _make(self, after: Content, label: str, author: str) -> str:
        before = self.content
        patch = difference(before, after)
        if patched(before, patch) == before:
            return ""
        entry = Entry(self.revision + 1, author, label, "edit", patch, difference(after, before))
        self._commit(entry, after)
        return label

    def _step(self, kind: Literal["undo", "redo"], author: str) -> str:
        with self._lock:
            saved = self._journal.saved
            stack = saved.undo if kind == "undo" else saved.redo
            if not stack:
                raise InputError(f"there is nothing to {kind}")
            last = stack[-1]
            patch, inverse = (last.inverse, last.patch) if kind == "undo" else (last.patch, last.inverse)
            after = patched(self.content, patch)
            if self._map_edits.is_behind(self.content, after) and self._take_file(self._map_edits, opening=False):
                raise InputError(f"another program edited the map just now; nothing was {_DONE[kind]}, look again")
            entry = Entry(self.revision + 1, author, last.label, kind, patch, inverse)
            self._commit(entry, after)
            whose = "" if last.author == author else f" (by {last.author})"
            return f"{_DONE[kind]}: {last.label}{whose}"

    def _commit(self, entry: Entry, after: Content) -> None:
        before = self.content
        self._journal.append(entry, after)
        self.author = entry.author
        self._recent.append(_Change(entry.revision, entry.author, entry.patch.touched))
        for mirror in self._mirrors:
            try:
                self._notice = mirror.update(before, after) or self._notice
            except OSError as error:  # the change is made and in the journal
                self._notice = f"{mirror.path.name} could not be written: {error.strerror}; {mirror.while_behind}"
                logger.warning(self._notice)
        for listener in self._listeners:
            listener()
