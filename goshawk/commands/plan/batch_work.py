"""What a batch works on: what `batch` and `batch_cluster` ask of a job, be it to plan missions or to fly them ahead."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar, Protocol, Self, TypeVar

JOURNAL = "journal.jsonl"
RESULTS = "results.json"
"""In the folder of a batch."""
Row = dict[str, Any]
"""What is known of an item: name, status, reason, and the other columns of its kind."""


@dataclass(frozen=True, slots=True)
class Kind:
    """What the items of a batch are."""

    format: str
    """Of the table as JSON."""
    noun: str
    """Of several items; the table's key."""
    do: str
    """What is done with one, ..."""
    does: str
    """... what a command does, ..."""
    done: str
    """... and what it then is."""
    file: str
    """What a worker reads of one, in words."""
    inputs: str
    """All that its result depends on, in words."""
    columns: Mapping[str, type]
    """Of the tables; after name, status and reason, a row may be without."""
    made: tuple[str, ...]
    """Statuses of an item with a file of its own."""
    lasting: tuple[str, ...]
    """Statuses without one, that the same inputs would give again."""
    newer: tuple[str, ...] = ()
    """Columns that a journal of an earlier version is without."""

    def row(self, name: str, status: str, reason: str, **facts: Any) -> Row:
        return dict.fromkeys(self.columns) | {"name": name, "status": status, "reason": reason} | facts


class Item(Protocol):
    """One of many: a path, or what has a name and can be sent to another folder's process."""

    @property
    def stem(self) -> str:
        """Its name, unlike those of the others."""
        ...

    def absolute(self) -> Self: ...


T = TypeVar("T", bound=Item, contravariant=True)


class Work(Protocol[T]):
    """All that a worker needs to do any of the items; it is pickled, and has a copy with other fields."""

    kind: ClassVar[Kind]

    @property
    def out(self) -> Path: ...
    @property
    def overwrite(self) -> bool: ...
    @property
    def inputs(self) -> bytes:
        """Hash of what all items share: a worker that lives on reads changed files again."""
        ...

    def inputs_hash(self) -> bytes:
        """What `inputs` is to be."""
        ...

    def with_inputs(self, inputs: bytes) -> Self:
        """The same with `inputs`."""
        ...

    def into(self, out: Path) -> Self:
        """The same with another output folder."""
        ...

    def absolute(self) -> Self:
        """The same for a process in another folder."""
        ...

    def shared_files(self) -> str:
        """The files that all items share, in words."""
        ...

    def key_of(self, item: T) -> str:
        """Hash of an item's files and all other inputs."""
        ...

    def missing(self, item: T) -> Path | None:
        """A file of the item that is not there."""
        ...

    def work_on(self, item: T) -> Row:
        """Do an item, and write its file; one that fails is a row that says why."""
        ...

    def file_of(self, name: str) -> Path:
        """Where an item's file is written."""
        ...

    def is_that_of(self, row: Row, path: Path) -> bool:
        """Whether a file holds, unchanged, what a row of the journal is about."""
        ...

    def beside(self) -> dict[str, Any]:
        """What the table says besides its rows."""
        ...
