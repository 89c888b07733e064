"""One rule for every result: an existing one is replaced only with `overwrite`, and is then kept beside the new one.

`walk.json` becomes `walk.json.old-1`, so that no pattern (`*.json`) takes the old one for a result. Only regular files,
and folders that Goshawk wrote, are ever replaced. The rule is checked twice: before the work (`require_free`), so that
a conflict is reported early, and again when the result is moved into place (`new_file`), as another program may have
written there meanwhile.
"""

import contextlib
import os
import secrets
import shutil
import stat
import tempfile
from collections.abc import Callable, Generator, Iterable
from dataclasses import dataclass
from pathlib import Path

from flight import file_format
from flight.errors import InputError


@dataclass(slots=True)
class Placing:
    """A result that is being written, and its final path."""

    temporary: Path
    """Path to write to, in the same folder as the final path."""
    path: Path
    """Final path of the result."""
    kept: Path | None = None
    """Path of the earlier result after it was moved aside; None if there was none."""

    def placed(self, written: Path) -> Path:
        """Final path of a file written below `temporary`."""
        return self.path / written.relative_to(self.temporary)


def require_free(path: Path, *, overwrite: bool) -> None:
    """Refuse, before any work, a path at which the result could not be written.

    Raises:
        InputError: something is there and `overwrite` was not given, it is no regular file, or no file can be made.
    """
    target = _resolved(path)
    kind = _kind(target)
    if kind == "folder":
        raise InputError(f"{path} is a folder; give the name of a file")
    if kind not in ("", "file"):
        raise InputError(f"{path} is a {kind}, not a regular file; results are only written to files")
    if kind and not overwrite:
        raise InputError(_exists(path))
    _require_room(path, target)


def require_free_folder(path: Path, *, overwrite: bool, ours: Callable[[Path], bool]) -> None:
    """As `require_free`, for a folder; an empty folder is free.

    Args:
        ours: whether Goshawk wrote the folder's content; other content is never moved.

    Raises:
        InputError: as `require_free`, or the folder holds something else.
    """
    target = _resolved(path)
    kind = _kind(target)
    if kind not in ("", "folder"):
        raise InputError(f"{path} is a {kind}; give the name of a folder")
    if kind and any(target.iterdir()):
        if not ours(target):
            raise InputError(f"{path} is not empty and not a result of this command; choose another folder")
        if not overwrite:
            raise InputError(_exists(path))
        if os.path.ismount(target):
            raise InputError(
                f"{path} is a mount point, and the old result cannot be kept beside it; name a folder in it"
            )
    _require_room(path, target)


def require_apart(paths: Iterable[Path | None]) -> None:
    """
    Raises:
        InputError: two results are to be written to the same place.
    """
    seen: set[Path] = set()
    for path in paths:
        if path is None:
            continue
        if (place := Path(os.path.abspath(path))) in seen:
            raise InputError(f"{path} is named for two results; give each its own name")
        seen.add(place)


@contextlib.contextmanager
def new_file(path: Path, *, overwrite: bool) -> Generator[Placing]:
    """Yield where to write a result; it is moved to `path` if the block raises nothing. Call `require_free` before.

    Raises:
        InputError: the path is a folder or a device; or a file that must not be replaced has appeared. It stays, and
            the new result is kept beside it, under the name that the message gives.
    """
    target = _resolved(path)
    if _kind(target) not in ("", "file"):  # nothing is written beside a device
        require_free(path, overwrite=overwrite)
    with file_format.with_parents(target):
        placing = Placing(_temporary(target), target)
        try:
            yield placing
            kind = _kind(target)
            if kind == "file" and overwrite:
                placing.kept = keep(target)
                os.replace(placing.temporary, target)
            elif kind:
                raise _overtaken(path, _moved_beside(placing.temporary, target, "new"))
            else:
                _put(placing.temporary, target, path)
        finally:
            placing.temporary.unlink(missing_ok=True)


@contextlib.contextmanager
def new_folder(
    path: Path, *, overwrite: bool, ours: Callable[[Path], bool], within: Path | None = None
) -> Generator[Placing]:
    """As `new_file`, for a folder.

    Args:
        ours: as for `require_free_folder`.
        within: where to write it, on the same file system; by default beside its final path, and in it if that is an
            (empty) mount point.
    """
    target = _resolved(path)
    with file_format.with_parents(target):
        folder = target if os.path.ismount(target) else within or target.parent
        placing = Placing(_temporary(folder / target.name), target)
        placing.temporary.mkdir()
        try:
            yield placing
            filled = target.is_dir() and any(child != placing.temporary for child in target.iterdir())
            if (filled and not (overwrite and ours(target))) or _kind(target) not in ("", "folder"):
                raise _overtaken(path, _moved_beside(placing.temporary, target, "new"))
            if filled:
                placing.kept = _moved_beside(target, target, "old")
            if target.is_dir():  # it may be a mount point, which cannot be replaced itself
                for child in placing.temporary.iterdir():
                    os.rename(child, target / child.name)
            else:
                os.rename(placing.temporary, target)
        except BaseException:
            if placing.kept is not None and not target.exists():
                os.rename(placing.kept, target)
            raise
        finally:
            shutil.rmtree(placing.temporary, ignore_errors=True)


def keep(path: Path) -> Path:
    """Link or copy a file to a free name beside it; returns that name. The file itself stays."""
    path = _resolved(path)
    for name in _siblings(path, "old"):
        try:
            os.link(path, name)
            return name
        except FileExistsError:
            continue
        except OSError:  # a file system without links
            if name.exists():
                continue
            shutil.copy2(path, name)
            return name
    raise AssertionError("there is always a free name")


def move_aside(path: Path) -> Path:
    """Move a file or folder to a name beside it; returns that name. Of a link, the link: what it leads to stays."""
    return _moved_beside(path, path, "old")


def newest_kept(path: Path) -> Path | None:
    """The newest file or folder that was moved aside from `path`; None if there is none."""
    last = None
    for name in _siblings(_resolved(path), "old"):
        if not os.path.lexists(name):
            return last
        last = name
    return last


def _resolved(path: Path) -> Path:
    """The place a path leads to, links followed.

    Raises:
        InputError: a link leads nowhere or in a circle.
    """
    try:
        target = Path(path).resolve()
    except (OSError, RuntimeError) as error:
        raise InputError(f"{path} cannot be written: {error}") from error
    if Path(path).is_symlink() and not target.exists():
        raise InputError(f"{path} is a link to {target}, which does not exist; remove the link or give another name")
    return target


def _kind(path: Path) -> str:
    """Kind of the file at `path` (`folder`, `pipe`, ...); empty if nothing is there."""
    try:
        mode = path.stat().st_mode
    except (FileNotFoundError, NotADirectoryError):
        return ""
    except OSError as error:
        raise InputError(f"{path} cannot be written: {error.strerror}") from error
    kinds = {stat.S_IFREG: "file", stat.S_IFDIR: "folder", stat.S_IFCHR: "device", stat.S_IFBLK: "device"}
    return (kinds | {stat.S_IFIFO: "pipe", stat.S_IFSOCK: "socket"}).get(stat.S_IFMT(mode), "special file")


def _require_room(path: Path, target: Path) -> None:
    """Check by trial that a file can be made in the result's folder, or in the nearest parent that exists."""
    folder = target.parent
    while not folder.exists():
        folder = folder.parent
    if not folder.is_dir():
        raise InputError(f"{path} cannot be written: {folder} is a file, not a folder")
    try:
        with contextlib.suppress(FileNotFoundError):
            os.stat(_temporary(folder / target.name))  # the name may be too long
        tempfile.TemporaryFile(dir=folder).close()  # without a name, so that a killed process leaves nothing
    except OSError as error:
        raise InputError(f"{path} cannot be written: {error.strerror} ({folder})") from error


def _exists(path: Path) -> str:
    old = next(name for name in _siblings(Path(path), "old") if not os.path.lexists(name))
    return f"{path} exists; give another name, or --overwrite to replace it (the old one is kept as {old.name})"


def _overtaken(path: Path, ours: Path) -> InputError:
    return InputError(f"{path} was written by another program meanwhile and stays; this result is {ours}")


def _put(temporary: Path, target: Path, path: Path) -> None:
    """Move a file to a path that is free; raises if another program has taken the path meanwhile."""
    try:
        os.link(temporary, target)
    except FileExistsError:
        raise _overtaken(path, _moved_beside(temporary, target, "new")) from None
    except OSError:  # a file system without links
        os.rename(temporary, target)


def _moved_beside(what: Path, beside: Path, word: str) -> Path:
    name = next(name for name in _siblings(beside, word) if not os.path.lexists(name))
    os.rename(what, name)
    return name


def _siblings(path: Path, word: str) -> Generator[Path]:
    number = 0
    while True:
        number += 1
        yield path.with_name(f"{path.name}.{word}-{number}")


def _temporary(target: Path) -> Path:
    """A hidden name in the same folder, with the same suffix: some writers choose the format by it."""
    return target.with_name(f".{target.stem}.{secrets.token_hex(4)}{target.suffix}")
