"""Which program wrote a recording, by its content; its name decides only where the content does not."""

import gzip
import re
import zlib
from pathlib import Path

from sysid.logs.readers import blackbox, dataflash, read_poses, read_tlog, read_usdlog

LOOKED_AT = 1 << 16
"""Bytes from the beginning that are looked at."""
_MAGIC = (
    (b"ULog\x01\x12\x35", "ulog"),
    (b"PAR1", "parquet"),
    (b"\x89MCAP0\r\n", "ros"),
    (b"#ROSBAG V", "ros"),
    (b"SQLite format 3\0", "ros"),
)
_ENDINGS = (
    ((".csv", ".csv.gz"), "csv"),
    ((".ulg",), "ulog"),
    ((".mcap", ".bag", ".db3"), "ros"),
    ((".bin",), "ardupilot"),
    ((".tlog",), "tlog"),
    ((".bbl", ".bfl", ".bf"), "blackbox"),
)
_OWN = re.compile(rb'^\{?\s*"?format"?\s*[=:]\s*"(goshawk-[a-z-]+)"', re.M)


def kind_of(path: Path) -> str:
    """The kind: `parquet`, `ulog`, `ros`, `csv`, `ardupilot`, `blackbox`, `usdlog`, `tlog`, `tum`.

    Of folders `ros`, `euroc` and `folder`; `unknown` for what is none of them.

    Raises:
        OSError: it cannot be read.
    """
    if path.is_dir():
        return "ros" if (path / "metadata.yaml").is_file() else "euroc" if read_poses.is_euroc(path) else "folder"
    head = _head(path)
    by_magic = next((kind for magic, kind in _MAGIC if head.startswith(magic)), "")
    if by_magic:
        return by_magic
    if dataflash.is_binary(head) or dataflash.is_text(head):
        return "ardupilot"
    if blackbox.is_blackbox(head):
        return "blackbox"
    if read_usdlog.is_usdlog(head):
        return "usdlog"
    if read_tlog.is_tlog(head):
        return "tlog"
    if read_poses.is_tum(head):
        return "tum"
    name = path.name.lower()
    by_name = next((kind for endings, kind in _ENDINGS if name.endswith(endings)), "")
    return by_name or ("csv" if _is_text(head) else "unknown")


def own_other(path: Path) -> str:
    """The `format` of a TOML or JSON file of ours, which is no log; empty where it names none."""
    found = None if path.is_dir() else _OWN.search(_head(path))
    return found[1].decode() if found else ""


def _head(path: Path) -> bytes:
    with path.open("rb") as file:
        head = file.read(LOOKED_AT)
    if head[:2] == b"\x1f\x8b":
        try:
            with gzip.open(path) as packed:
                return packed.read(LOOKED_AT)
        except (OSError, EOFError, zlib.error):
            return head
    return head


def _is_text(head: bytes) -> bool:
    """Whether it is lines of printable text."""
    try:
        text = head.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        if error.start < len(head) - 4 or not error.start:  # else a character was cut at the end of what was read
            return False
        text = head[: error.start].decode("utf-8-sig")
    return "\n" in text and all(c.isprintable() or c in "\t\r\n" for c in text)
