"""Versioned files that are either whole or absent: temporary file, fsync, rename."""

import contextlib
import hashlib
import json
import math
import os
import shutil
import tempfile
import tomllib
import zipfile
import zlib
from collections.abc import Generator, Mapping
from pathlib import Path
from typing import Any, cast

import numpy as np
import tomli_w

from flight.errors import FormatError, InputError, missing

Document = dict[str, Any]


@contextlib.contextmanager
def with_parents(path: Path) -> Generator[None]:
    """Make the missing folders above `path`; if the block is interrupted, remove those that are still empty."""
    missing = [folder for folder in path.parents if not folder.exists()]
    path.parent.mkdir(parents=True, exist_ok=True)
    try:
        yield
    except BaseException:
        for folder in missing:  # innermost first
            with contextlib.suppress(OSError):
                folder.rmdir()
        raise


@contextlib.contextmanager
def atomic_file(path: Path) -> Generator[Path]:
    """Yield a temporary file beside `path`; rename it to `path` only if the block raises nothing.

    If the block is interrupted (by an exception, by Ctrl-C), an earlier `path` stays as it was.
    """
    path = Path(path)
    with with_parents(path):
        handle, name = tempfile.mkstemp(prefix=f".{path.name}.", suffix=path.suffix, dir=path.parent)
        os.close(handle)
        temporary = Path(name)
        try:
            os.chmod(temporary, 0o666 & ~_umask())  # mkstemp makes files for their owner alone
            yield temporary
            with open(temporary, "rb") as written:
                os.fsync(written.fileno())
            os.replace(temporary, path)
        finally:
            temporary.unlink(missing_ok=True)


@contextlib.contextmanager
def atomic_folder(path: Path) -> Generator[Path]:
    """As `atomic_file`, for a folder: the old one is replaced as a whole once the new one is complete."""
    path = Path(path)
    if path.is_symlink() or path.is_file():
        raise InputError(f"{path} is a file or a link, not a folder; choose another output")
    with with_parents(path):
        temporary = Path(tempfile.mkdtemp(prefix=f".{path.name}.new-", dir=path.parent))
        retired = temporary.with_name(temporary.name.replace(".new-", ".old-"))
        try:
            os.chmod(temporary, 0o777 & ~_umask())
            yield temporary
            if path.exists():
                os.replace(path, retired)
            os.replace(temporary, path)
        finally:
            if retired.exists() and not path.exists():
                os.replace(retired, path)
            shutil.rmtree(temporary, ignore_errors=True)
            shutil.rmtree(retired, ignore_errors=True)


def _umask() -> int:
    mask = os.umask(0)
    os.umask(mask)
    return mask


def write_bytes(path: Path, data: bytes) -> None:
    with atomic_file(path) as temporary:
        temporary.write_bytes(data)


def json_text(document: object) -> str:
    """The JSON of a verb's answer. NumPy values and paths become plain ones; JSON cannot represent NaN and infinity.

    Such numbers become null, and a top-level key `not_finite` lists the place and the value of each.
    """
    lost: dict[str, str] = {}
    plain = _plain(document, "", lost)
    if lost and isinstance(plain, dict):
        plain["not_finite"] = lost
    return json.dumps(plain, indent=1, allow_nan=False) + "\n"


def _plain(value: Any, where: str, lost: dict[str, str]) -> Any:
    if hasattr(value, "tolist"):  # NumPy's arrays and numbers
        value = value.tolist()
    if isinstance(value, Mapping):
        entries = cast("Mapping[Any, Any]", value).items()
        return {str(key): _plain(item, f"{where}.{key}" if where else str(key), lost) for key, item in entries}
    if isinstance(value, list | tuple):
        return [_plain(item, f"{where}[{i}]", lost) for i, item in enumerate(cast("list[Any]", value))]
    if isinstance(value, float) and not math.isfinite(value):
        lost[where] = str(value)
        return None
    return value if value is None or isinstance(value, str | int | float) else str(value)


def write_json(path: Path, *, format: str, version: int, body: Mapping[str, Any]) -> None:
    """Write `body` with its `format` and `version` in front.

    Raises:
        InputError: a number in `body` is NaN or infinite (JSON cannot represent it).
    """
    try:
        text = json.dumps({"format": format, "version": version, **body}, indent=1, allow_nan=False)
    except ValueError as error:
        raise InputError(f"{path}: not written, a number in it is not finite ({error})") from error
    write_bytes(path, (text + "\n").encode())


def read_json(path: Path, *, format: str, version: int) -> Document:
    """Read a file that `write_json` wrote.

    Raises:
        InputError: there is no such file.
        FormatError: it is not JSON, of another format, or newer than `version`.
    """
    try:
        document = json.loads(_text(path, format))
    except (ValueError, RecursionError) as error:
        raise FormatError(f"{path} is not valid JSON ({error}); it may have been cut off") from error
    return _checked(path, document, format, version)


def write_toml(path: Path, *, format: str, version: int, body: Mapping[str, Any]) -> None:
    write_bytes(path, tomli_w.dumps({"format": format, "version": version, **body}).encode())


def read_toml(path: Path, *, format: str, version: int) -> Document:
    """Read a TOML file with a `format` and `version`; raises as `read_json`."""
    try:
        document = tomllib.loads(_text(path, format))
    except (ValueError, RecursionError) as error:
        raise FormatError(f"{path} is not valid TOML ({error})") from error
    return _checked(path, document, format, version)


def write_arrays(path: Path, *, version: int, **arrays: np.ndarray) -> None:
    """Arrays as a compressed `.npz`."""
    with atomic_file(Path(path)) as temporary, open(temporary, "wb") as file:
        np.savez_compressed(file, version=version, **arrays)  # pyright: ignore[reportArgumentType]


def read_arrays(path: Path, *names: str, version: int, fault: str, remedy: str) -> list[np.ndarray]:
    """The arrays of these names, as `write_arrays` wrote them.

    Args:
        fault, remedy: of a damaged file, in words.

    Raises:
        InputError: there is no such file.
        FormatError: it is damaged, or newer.
    """
    try:
        with np.load(path, allow_pickle=False) as archive:
            found, arrays = int(archive["version"]), [archive[name] for name in names]
    except FileNotFoundError:
        raise missing(path) from None
    except (KeyError, TypeError, ValueError, EOFError, OSError, zipfile.BadZipFile, zlib.error) as error:
        raise FormatError(f"{path} is {fault}: {damage_text(error)}; {remedy}") from error
    if found > version:
        raise FormatError(f"{path} is of a newer version; update Goshawk")
    return arrays


def _text(path: Path, format: str) -> str:
    try:
        text = _read(path).decode("utf-8-sig")
    except UnicodeDecodeError:
        raise FormatError(f"{path} is not a text file; expected a {format} file") from None
    if not text.strip():
        raise FormatError(f"{path} is empty; expected a {format} file")
    return text


def _read(path: Path) -> bytes:
    try:
        return Path(path).read_bytes()
    except FileNotFoundError:
        raise missing(path) from None
    except IsADirectoryError:
        raise InputError(f"{path} is a folder; expected a file") from None
    except OSError as error:
        raise InputError(f"{path} cannot be read: {error.strerror}") from error


def _checked(path: Path, document: object, format: str, version: int) -> Document:
    if not isinstance(document, dict) or "format" not in document:
        raise FormatError(f"{path} is not a {format} file: it names no format")
    found: Document = document  # pyright: ignore[reportUnknownVariableType]
    if found["format"] != format:
        raise FormatError(f"{path} is a {found['format']} file; expected a {format} file")
    if not isinstance(found.get("version"), int):
        raise FormatError(f"{path}: version is {found.get('version')!r}, not a whole number")
    if found["version"] > version:
        raise FormatError(
            f"{path} is version {found['version']} of {format}; this Goshawk reads up to {version}: update Goshawk"
        )
    return found


def damage_text(error: Exception) -> str:
    """What is wrong with the content of a file, from the exception that reading it raised, in words of the file."""
    said = str(error)
    word = said.rpartition(": ")[2]
    if isinstance(error, KeyError):
        return f"the key {said} is missing"
    if said.startswith("could not convert string to float"):
        return f"{word} is not a number"
    if said.startswith("invalid literal for int"):
        return f"{word} is not a whole number"
    if "inhomogeneous" in said or "setting an array element with a sequence" in said:
        return "a list has a word, a list or too few entries where a number is expected"
    if said.startswith("cannot reshape array"):
        return "a point has three numbers: x, y, z"
    if "indices must be" in said or "not subscriptable" in said or said.startswith("dictionary update sequence"):
        return "a table of keys and values is expected where it has something else"
    return said


def file_hash(path: Path) -> str:
    """SHA-256 of a file's bytes, in hex; a plan records it for the map it was made for."""
    return hashlib.sha256(_read(path)).hexdigest()
