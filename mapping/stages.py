"""Stages of a long work that survive it: killed, cancelled or out of disk, it goes on with the first unfinished one.

Each stage has a folder of its own, named for it and complete as soon as it has that name. Its file `inputs` holds a
hash of everything that the result depends on, the stages before it included: a changed image, camera file or option
makes exactly those stages again that depend on it. It holds the sizes of the stage's files too: one that was cut off or
removed since (a disk that failed, a copy that was not finished) makes the stage again. A stage of many tasks keeps the
answers of those that are done in the same way.
"""

import contextlib
import fcntl
import functools
import hashlib
import json
import os
import shutil
import tempfile
import time
from collections.abc import Callable, Generator, Iterable
from dataclasses import dataclass, replace
from importlib import metadata
from pathlib import Path
from typing import IO

from flight import FlightError, InputError
from mapping import _mapping

_INPUTS = "inputs"
_LOCK = "lock"
_PART, _TASKS = ".part", ".tasks"
_LIBRARIES = ("goshawk", "numpy", "scipy", "pycolmap", "opencv-python-headless", "open3d", "open3d-cpu")
"""Packages whose version a result depends on."""
_FULL_BYTES = 1_000_000
_PATIENCE_S = 5.0
"""A killed run's child process, which holds the lock as well, ends within a second."""


class StoppedError(FlightError):
    """The work was asked to go no further than the stage that is now finished."""


@dataclass(frozen=True, slots=True)
class Work:
    """The folder of a work in progress, and a hash of what all its later stages depend on."""

    folder: Path
    """Holds one folder for each finished stage."""
    depends: bytes
    """Of the inputs so far."""
    lock: int | None = None
    """File descriptor that holds the folder's lock; a child process that writes in the folder must inherit it."""
    until: str | None = None
    """The last stage to make."""

    def on(self, *inputs: object) -> "Work":
        """The same work where later stages depend on `inputs` too: bytes, or things whose `repr` says all of them."""
        joined = hashlib.sha256(self.depends)
        for item in inputs:
            data = item if isinstance(item, bytes) else repr(item).encode()
            joined.update(len(data).to_bytes(8, "little") + data)
        return replace(self, depends=joined.digest())

    def stage(self, name: str, make: Callable[[Path], None]) -> Path:
        """The folder of a finished stage; `make` fills it, unless that was done before from the same inputs.

        Raises:
            StoppedError: it is the last stage to make.
        """
        place, part = self.folder / name, self.folder / f"{name}{_PART}"
        if _is_whole(place, self.depends):
            return self._reached(name, place)
        for old in (place, part):
            shutil.rmtree(old, ignore_errors=True)
        part.mkdir(parents=True)
        make(part)
        files = {str(file.relative_to(part)): file.stat().st_size for file in part.rglob("*") if file.is_file()}
        (part / _INPUTS).write_text(json.dumps({"depends": self.depends.hex(), "files": files}))
        os.sync()
        part.rename(place)
        shutil.rmtree(self.folder / f"{name}{_TASKS}", ignore_errors=True)
        return self._reached(name, place)

    def tasks(self, name: str) -> Path:
        """A folder for the answers of a stage's tasks, which an interrupted work of the same inputs finds again.

        It is removed when the stage is finished.
        """
        place = self.folder / f"{name}{_TASKS}"
        if not _is_whole(place, self.depends):
            shutil.rmtree(place, ignore_errors=True)
            place.mkdir(parents=True)
            (place / _INPUTS).write_text(json.dumps({"depends": self.depends.hex(), "files": {}}))
        return place

    def _reached(self, name: str, place: Path) -> Path:
        if name == self.until:
            raise StoppedError(f"stopped after {name}, as asked")
        return place


def _is_whole(place: Path, depends: bytes) -> bool:
    """Whether a stage was finished from these inputs, and its files are still as long as they were."""
    try:
        noted = json.loads((place / _INPUTS).read_bytes())
        sizes = {name: (place / name).stat().st_size for name in noted["files"]}
    except (OSError, ValueError, TypeError, KeyError):
        return False
    return (noted["depends"], noted["files"]) == (depends.hex(), sizes)


@contextlib.contextmanager
def begin(folder: Path, *, again: Iterable[str] = (), until: str | None = None) -> Generator[Work]:
    """Open the folder of a work, alone. It stays until `finish`, so that the work can be taken up again.

    Args:
        again: stages to make even if they are finished.
        until: the last stage to make; `Work.stage` then raises `StoppedError`.

    Raises:
        InputError: another process works in it, it holds something else, or the disk is full.
    """
    with _locked(folder) as lock:  # a child process that inherited it holds the lock on
        _remove_unfinished(folder, again)  # of a killed run
        try:
            yield Work(folder, program(), lock.fileno(), until)
        except StoppedError:
            raise
        except Exception as error:
            if (free := shutil.disk_usage(folder).free) < _FULL_BYTES:
                raise InputError(
                    f"no space is left on the disk of {folder} ({free // 1000} kB): make room; the same command goes on"
                ) from error
            raise
        finally:
            _remove_unfinished(folder)


def _remove_unfinished(folder: Path, again: Iterable[str] = ()) -> None:
    """Remove all but the finished stages and answers of tasks, and of those the ones that are to be made again."""
    for entry in folder.iterdir() if folder.exists() else ():
        if entry.is_dir() and (entry.name.removesuffix(_TASKS) in again or not (entry / _INPUTS).is_file()):
            shutil.rmtree(entry)


def _locked(folder: Path) -> IO[str]:
    """The folder's lock file, once the lock is ours; closing it gives the lock away."""
    deadline_s = time.monotonic() + _PATIENCE_S
    while time.monotonic() < deadline_s:
        folder.mkdir(parents=True, exist_ok=True)
        names = os.listdir(folder)  # once: another run may be making its lock file
        if names and _LOCK not in names:
            raise InputError(f"{folder} holds files that are not of an earlier run; move it, or choose another output")
        with contextlib.suppress(FileNotFoundError):  # the folder's last user may be removing it
            lock = open(folder / _LOCK, "a")  # noqa: SIM115 - stays open for as long as the lock is held
            if _taken(lock.fileno(), folder / _LOCK):
                return lock
            lock.close()
        time.sleep(0.1)
    raise InputError(f"another process is at work in {folder}; wait for it, or choose another output")


def _taken(lock: int, path: Path) -> bool:
    """Whether the lock could be taken, and is still the folder's: its last holder may have removed the folder."""
    try:
        fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    return path.exists() and os.path.samestat(os.fstat(lock), path.stat())


@functools.cache
def program() -> bytes:
    """What else a stage depends on: this package's files, and the libraries that do the work."""
    whole = hashlib.sha256("".join(f"{name} {version}\n" for name, version in libraries().items()).encode())
    for file in (*sorted(Path(__file__).parent.rglob("*.py")), Path(_mapping.__file__)):
        whole.update(file.read_bytes())
    return whole.digest()


def libraries() -> dict[str, str]:
    """Versions of the packages that a result depends on, by name."""
    found = dict[str, str]()
    for library in _LIBRARIES:
        with contextlib.suppress(metadata.PackageNotFoundError):  # Open3D has one of two names
            found[library] = metadata.version(library)
    return found


@contextlib.contextmanager
def temporary() -> Generator[Work]:
    """A work that nothing survives."""
    with tempfile.TemporaryDirectory(prefix="goshawk-map-") as name:
        yield Work(Path(name), b"")


def finish(work: Work) -> None:
    """Remove the folder of a work whose result is safe elsewhere; its lock last, and only while we hold it."""
    for entry in work.folder.iterdir():
        if entry.is_dir() and not entry.is_symlink():
            shutil.rmtree(entry, ignore_errors=True)
        elif entry.name != _LOCK:
            entry.unlink()
    (work.folder / _LOCK).unlink()
    with contextlib.suppress(OSError):  # a run that waited has made its lock file in it
        work.folder.rmdir()


def finished(folder: Path, names: Iterable[str]) -> list[str]:
    """Which of the named stages an earlier, interrupted work left behind."""
    return [name for name in names if (folder / name / _INPUTS).is_file()]
