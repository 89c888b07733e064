"""Messages of a ROS recording that was cut or damaged, one after the other without its index, as far as they go.

MCAP (https://mcap.dev/spec), ROS 1 bags (https://wiki.ros.org/Bags/Format/2.0), SQLite. It offers what rosbags'
`AnyReader` does, so that a recording is read alike.
"""

import bz2
import os
import sqlite3
import struct
import tempfile
from collections.abc import Collection, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from flight import FormatError

MCAP, BAG, SQLITE = b"\x89MCAP0\r\n", b"#ROSBAG V2.0\n", b"SQLite format 3\0"
LARGEST_CHUNK = 1 << 30


@dataclass(frozen=True, slots=True)
class Connection:
    """A topic."""

    topic: str
    msgtype: str


@dataclass(slots=True)
class Salvaged:
    """The messages that could be read."""

    typestore: Any
    ros1: bool
    lost: str = ""
    kept: list[tuple[Connection, int, bytes]] = field(default_factory=list)
    """Topic, time of reception in ns, and the message as it was written."""

    @property
    def connections(self) -> list[Connection]:
        return list(dict.fromkeys(connection for connection, _, _ in self.kept))

    def messages(self, connections: Collection[Connection]) -> Iterator[tuple[Connection, int, bytes]]:
        wanted = set(connections)
        return (one for one in sorted(self.kept, key=lambda one: one[1]) if one[0] in wanted)

    def deserialize(self, raw: bytes, kind: str) -> Any:
        read = self.typestore.deserialize_ros1 if self.ros1 else self.typestore.deserialize_cdr
        return read(raw, kind)


def _unreadable(path: Path, reason: str) -> FormatError:
    return FormatError(f"{path} is not a readable ROS recording ({reason}); it may be of another kind, or damaged")


def salvage(path: Path, reason: str) -> Salvaged:
    """What can be read of a recording that its own reader refuses for this reason.

    Raises:
        FormatError: no message can.
    """
    from rosbags.typesys import Stores, get_typestore

    parts = [path] if path.is_file() else sorted([*path.glob("*.db3"), *path.glob("*.mcap")])
    if len(parts) != 1:
        raise _unreadable(path, reason)
    content = parts[0].read_bytes()
    ros1 = content.startswith(BAG)
    found = Salvaged(get_typestore(Stores.ROS1_NOETIC if ros1 else Stores.ROS2_HUMBLE), ros1)
    if content.startswith(MCAP):
        end = _Mcap(found).read(content, len(MCAP))
    elif ros1:
        end = _Bag(found).read(content, len(BAG))
    else:
        end = _sqlite(content, found) if content.startswith(SQLITE) else 0
    if not found.kept:
        raise _unreadable(path, reason)
    if content.startswith(SQLITE) and not is_cut_database(parts[0]):
        found.lost = f"the database was read row by row, as {reason}"
        return found
    last_s = 1e-9 * (max(one[1] for one in found.kept) - min(one[1] for one in found.kept))
    found.lost = (
        f"the file is cut or damaged at byte {end} of {len(content)}, {last_s:.3f} s after its first message: read "
        f"{len(found.kept)} messages before it"
    )
    return found


def _define(store: Any, kind: str, text: str) -> None:
    """Make a type known by the recording's own definition; one that cannot be read stays unknown."""
    from rosbags.typesys import get_types_from_msg

    if kind in store.fielddefs:
        return
    try:
        types = get_types_from_msg(text, kind)
        store.register({name: one for name, one in types.items() if name not in store.fielddefs})
    except Exception:  # rosbags' parser raises what it stumbles over
        return


class _Mcap:
    """Records: a byte for the kind, eight for the length, the body; little-endian."""

    def __init__(self, found: Salvaged) -> None:
        self._found = found
        self._schemas: dict[int, str] = {}
        self._channels: dict[int, Connection] = {}

    def read(self, content: bytes, at: int) -> int:
        """Where the whole records end."""
        while at + 9 <= len(content):
            kind, size = content[at], int.from_bytes(content[at + 1 : at + 9], "little")
            body = content[at + 9 : at + 9 + size]
            try:
                if kind == 0x06:
                    self._chunk(body)
                if len(body) < size or not self._record(kind, body):
                    break
            except (struct.error, UnicodeDecodeError, KeyError, OSError, ValueError, EOFError, IndexError):
                break
            at += 9 + size
        return at

    def _record(self, kind: int, body: bytes) -> bool:
        if kind == 0x03:
            (number,) = struct.unpack_from("<H", body)
            name, at = _text(body, 2)
            _, at = _text(body, at)
            self._schemas[number] = name
            _define(self._found.typestore, name, _text(body, at)[0])
        elif kind == 0x04:
            number, schema = struct.unpack_from("<HH", body)
            self._channels[number] = Connection(_text(body, 4)[0], self._schemas[schema])
        elif kind == 0x05:
            number, _, stamp = struct.unpack_from("<HIQ", body)
            self._found.kept.append((self._channels[number], stamp, body[22:]))
        return 0 < kind < 0x80

    def _chunk(self, body: bytes) -> None:
        """The records of a chunk, also of one that was cut, as far as they go."""
        name, at = _text(body, 28)
        size = int.from_bytes(body[16:24], "little")
        records = _unpacked(name, body[at + 8 :], size)
        self.read(records, 0)


class _Bag:
    """Records: length of the header, fields `name=value`, length of the data, the data; little-endian."""

    def __init__(self, found: Salvaged) -> None:
        self._found = found
        self._connections: dict[bytes, Connection] = {}

    def read(self, content: bytes, at: int) -> int:
        """Where the whole records end."""
        while at + 8 <= len(content):
            try:
                header, begin = _fields(content, at)
                size = int.from_bytes(content[begin : begin + 4], "little")
                data = content[begin + 4 : begin + 4 + size]
                if header[b"op"] == b"\x05":
                    self.read(_unpacked(header[b"compression"].decode(), data, LARGEST_CHUNK), 0)
                if len(data) < size:
                    break
                self._record(header, data)
            except (struct.error, UnicodeDecodeError, KeyError, OSError, ValueError, EOFError, IndexError):
                break
            at = begin + 4 + size
        return at

    def _record(self, header: dict[bytes, bytes], data: bytes) -> None:
        if header[b"op"] == b"\x07":
            inner, _ = _fields(len(data).to_bytes(4, "little") + data, 0)
            kind = inner[b"type"].decode()
            kind = kind if "/msg/" in kind else kind.replace("/", "/msg/")
            self._connections[header[b"conn"]] = Connection(header[b"topic"].decode(), kind)
            _define(self._found.typestore, kind, inner[b"message_definition"].decode())
        elif header[b"op"] == b"\x02":
            second, nano = struct.unpack("<II", header[b"time"])
            self._found.kept.append((self._connections[header[b"conn"]], second * 10**9 + nano, data))


def _fields(content: bytes, at: int) -> tuple[dict[bytes, bytes], int]:
    """The fields of a header, and what follows them."""
    end = at + 4 + int.from_bytes(content[at : at + 4], "little")
    if end > len(content):
        raise EOFError
    found, at = {}, at + 4
    while at < end:
        size = int.from_bytes(content[at : at + 4], "little")
        name, _, value = content[at + 4 : at + 4 + size].partition(b"=")
        found[name] = value
        at += 4 + size
    return found, end


def _text(body: bytes, at: int) -> tuple[str, int]:
    end = at + 4 + int.from_bytes(body[at : at + 4], "little")
    if end > len(body):
        raise EOFError
    return body[at + 4 : end].decode(), end


def _unpacked(name: str, data: bytes, size: int) -> bytes:
    """What a compressed chunk holds, as far as it goes."""
    if name in ("", "none"):
        return data
    if size > LARGEST_CHUNK:
        raise ValueError(size)
    try:
        if name == "bz2":
            return bz2.BZ2Decompressor().decompress(data, LARGEST_CHUNK)
        if name == "lz4":
            import lz4.frame

            return lz4.frame.LZ4FrameDecompressor().decompress(data, size)
        import zstandard

        return zstandard.ZstdDecompressor().decompressobj().decompress(data)
    except ImportError:
        raise
    except Exception as error:  # each library has errors of its own
        raise ValueError(name) from error


def is_cut_database(path: Path) -> bool:
    """Whether a SQLite file is shorter than its header says."""
    with path.open("rb") as file:
        head = file.read(100)
    return head.startswith(SQLITE) and len(head) == 100 and path.stat().st_size < _database_bytes(head)


def _database_bytes(head: bytes) -> int:
    page = int.from_bytes(head[16:18], "big")
    return (65536 if page == 1 else page) * int.from_bytes(head[28:32], "big")


def _sqlite(content: bytes, found: Salvaged) -> int:
    """Rows in the order in which they were written, up to the first page that is not there; where the file ends.

    SQLite opens no file that is too short: it reads a copy, filled up with zeros.
    """
    wanted = _database_bytes(content[:100])
    if wanted > max(2 * len(content), LARGEST_CHUNK):
        return 0
    with tempfile.TemporaryDirectory() as folder:
        copy = Path(folder) / "copy.db3"
        copy.write_bytes(content)
        os.truncate(copy, max(wanted, len(content)))
        base = sqlite3.connect(copy)
        try:
            topics = {n: Connection(name, kind) for n, name, kind in base.execute("SELECT id, name, type FROM topics")}
            for number, stamp, data in base.execute("SELECT topic_id, timestamp, data FROM messages ORDER BY id"):
                found.kept.append((topics[number], int(stamp), bytes(data)))
        except (sqlite3.Error, KeyError, TypeError, ValueError, OverflowError):
            pass
        finally:
            base.close()
    return len(content)
