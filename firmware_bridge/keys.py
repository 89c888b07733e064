"""The shared key that signs the link: a file of 64 hexadecimal digits that only its owner may read."""

import os
import secrets
from pathlib import Path

from flight import FormatError, InputError


def default_path() -> Path:
    """`GOSHAWK_LINK_KEY` if set, else `~/.config/goshawk/link.key`."""
    named = os.environ.get("GOSHAWK_LINK_KEY")
    return Path(named) if named else Path.home() / ".config" / "goshawk" / "link.key"


def load(path: Path | None = None) -> bytes:
    """The key of a key file.

    Raises:
        InputError: there is no such file, or others may read it.
        FormatError: it is not 64 hexadecimal digits.
    """
    path = path or default_path()
    try:
        text = path.read_text()
        mode = path.stat().st_mode
    except FileNotFoundError:
        raise InputError(f"no link key at {path}; make one with `goshawk sitl` or copy the vehicle's") from None
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(f"{path} cannot be read as a link key: {error}") from error
    if mode & 0o077:
        raise InputError(f"{path} can be read by others; run: chmod 600 {path}")
    try:
        key = bytes.fromhex(text.strip())
    except ValueError:
        key = b""
    if len(key) != 32:
        raise FormatError(f"{path} is not a link key: expected 64 hexadecimal digits")
    return key


def create(path: Path | None = None) -> bytes:
    """Write a new random key and return it.

    Raises:
        InputError: the file exists; a key in use is never overwritten.
    """
    path = path or default_path()
    path.parent.mkdir(parents=True, exist_ok=True)
    key = secrets.token_bytes(32)
    try:
        handle = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600)
    except FileExistsError:
        raise InputError(f"{path} exists already; a key in use is not overwritten") from None
    try:
        with os.fdopen(handle, "w") as file:
            file.write(key.hex() + "\n")
    except BaseException:  # a full disk, Ctrl-C: half a key would stand in the way of the next one
        path.unlink()
        raise
    return key


def load_or_create(path: Path | None = None) -> bytes:
    """The key of a key file, made first if there is none."""
    path = path or default_path()
    if not path.exists():
        try:
            return create(path)
        except InputError:  # somebody else made it in this moment
            pass
    return load(path)
