"""Stages of a long work that survive it: killed, cancelled or out of disk, it goes on with the first unfinished one.

Each stage has a folder of its own, named for it and complete as soon as it has that name. Its file `inputs` holds a
hash of everything that the result depends on, the stages before it included: a changed image, camera file or option
makes exactly those stages again that depend on it.
"""

import contextlib
import fcntl
import hashlib
import os
import shutil
import tempfile
from collections.abc import Callable, Generator, Iterable
from dataclasses import dataclass
from pathlib import Path

from flight import InputError

_INPUTS = "inputs"
_LOCK = "lock"
_PART = ".part"


@dataclass(frozen=True, slots=True)
class Work:
    """The folder of a work in progress, and a hash of what all its later stages depend on."""

    folder: Path
    """Holds one folder for each finished stage."""
    depends: bytes
    """Of the inputs so far."""

    def on(self, *inputs: object) -> "Work":
        """The same work where later stages depend on `inputs` too: bytes, or things whose `repr` says all of them."""
        joined = hashlib.sha256(self.depends)
        for item in inputs:
            data = item if isinstance(item, bytes) else repr(item).encode()
            joined.update(len(data).to_bytes(8, "little") + data)
        return Work(self.folder, joined.digest())

    def stage(self, name: str, make: Callable[[Path], None]) -> Path:
        """The folder of a finished stage; `make` fills it, unless that was done before from the same inputs."""
        place, part = self.folder / name, self.folder / f"{name}{_PART}"
        if (place / _INPUTS).is_file() and (place / _INPUTS).read_bytes() == self.depends:
            return place
        for old in (place, part):
            shutil.rmtree(old, ignore_errors=True)
        part.mkdir(parents=True)
        make(part)
        (part / _INPUTS).write_bytes(self.depends)
        os.sync()
        part.rename(place)
        return place


@contextlib.contextmanager
def begin(folder: Path) -> Generator[Work]:
    """Open the folder of a work, alone. It stays until `finish`, so that the work can be taken up again.

    Raises:
        InputError: another process works in it, or it holds something else.
    """
    folder.mkdir(parents=True, exist_ok=True)
    if not (folder / _LOCK).exists() and any(folder.iterdir()):
        raise InputError(f"{folder} holds files of someone else; move it, or choose another output")
    with open(folder / _LOCK, "w") as lock:
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            raise InputError(f"another process is at work in {folder}; wait for it, or choose another output") from None
        yield Work(folder, b"")


@contextlib.contextmanager
def temporary() -> Generator[Work]:
    """A work that nothing survives."""
    with tempfile.TemporaryDirectory(prefix="goshawk-map-") as name:
        yield Work(Path(name), b"")


def finish(work: Work) -> None:
    """Remove the folder of a work whose result is safe elsewhere."""
    shutil.rmtree(work.folder, ignore_errors=True)


def finished(folder: Path, names: Iterable[str]) -> list[str]:
    """Which of the named stages an earlier, interrupted work left behind."""
    return [name for name in names if (folder / name / _INPUTS).is_file()]
