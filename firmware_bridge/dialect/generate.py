"""Write generated/goshawk_dialect.h (the vehicle) and generated/messages.py (the ground) from the XML beside this file.

And generated/autopilot_messages.py from autopilot.xml: what only the ground says, to autopilots of others.

    python firmware_bridge/dialect/generate.py

A test regenerates and compares, and checks layout and CRC_EXTRA against pymavlink's own generator.
"""

import re
import xml.etree.ElementTree as ElementTree
from dataclasses import dataclass
from pathlib import Path

HERE = Path(__file__).parent
HEADER = HERE / "generated" / "goshawk_dialect.h"
PYTHON = HERE / "generated" / "messages.py"
AUTOPILOT = HERE / "generated" / "autopilot_messages.py"

_SIZES = {"double": 8, "float": 4, "char": 1} | {f"{s}int{n}_t": n // 8 for s in ("", "u") for n in (8, 16, 32, 64)}
_STRUCT = {"float": "f", "char": "s", "int8_t": "b", "uint8_t": "B", "int16_t": "h", "uint16_t": "H", "int32_t": "i"}
_NO_TARGET = 255
_STRUCT |= {"uint32_t": "I", "int64_t": "q", "uint64_t": "Q"}


@dataclass(frozen=True, slots=True)
class Field:
    name: str
    ctype: str
    length: int
    """0 for a single value."""
    description: str

    @property
    def size(self) -> int:
        return _SIZES[self.ctype] * max(self.length, 1)


@dataclass(frozen=True, slots=True)
class Definition:
    id: int
    name: str
    description: str
    base: tuple[Field, ...]
    """In wire order: largest type first, else as written."""
    extension: tuple[Field, ...]

    @property
    def fields(self) -> tuple[Field, ...]:
        return self.base + self.extension

    @property
    def length(self) -> int:
        return sum(field.size for field in self.fields)

    @property
    def target_offset(self) -> int:
        """Where target_system lies in the payload (target_component follows); -1 when no target is named."""
        offset = 0
        for field in self.fields:
            if field.name == "target_system":
                return offset
            offset += field.size
        return -1

    @property
    def crc_extra(self) -> int:
        """A byte that differs when name, field names, types or order differ (MAVLink's serialisation guide)."""
        crc = x25(f"{self.name} ".encode())
        for field in self.base:
            crc = x25(f"{field.ctype} {field.name} ".encode(), crc)
            if field.length:
                crc = x25(bytes([field.length]), crc)
        return (crc & 0xFF) ^ (crc >> 8)


def x25(data: bytes, crc: int = 0xFFFF) -> int:
    """CRC-16/MCRF4XX, the checksum of MAVLink frames; the plain one."""
    for byte in data:
        low = (byte ^ crc) & 0xFF
        low ^= (low << 4) & 0xFF
        crc = (crc >> 8) ^ (low << 8) ^ (low << 3) ^ (low >> 4)
    return crc


def read(path: Path) -> tuple[list[Definition], list[tuple[str, list[tuple[str, int, str]]]]]:
    """Messages (by id) and enums of a dialect and of what it includes."""
    root = ElementTree.parse(path).getroot()
    messages, enums = [], []
    for include in root.findall("include"):
        more_messages, more_enums = read(path.parent / str(include.text))
        messages += more_messages
        enums += more_enums
    for enum in root.iterfind("enums/enum"):
        entries = [(e.attrib["name"], int(e.attrib["value"]), _description(e)) for e in enum.iterfind("entry")]
        enums.append((enum.attrib["name"], entries))
    messages += [_definition(message) for message in root.iterfind("messages/message")]
    return sorted(messages, key=lambda message: message.id), enums


def _definition(message: ElementTree.Element) -> Definition:
    base: list[Field] = []
    extension: list[Field] = []
    target = base
    for child in message:
        if child.tag == "extensions":
            target = extension
        if child.tag == "field":
            kind, length = re.fullmatch(r"(\w+?)(?:_mavlink_version)?(?:\[(\d+)\])?", child.attrib["type"]).groups()  # pyright: ignore[reportOptionalMemberAccess]
            target.append(Field(child.attrib["name"], kind, int(length or 0), (child.text or "").strip()))
    base.sort(key=lambda field: -_SIZES[field.ctype])
    name = message.attrib["name"]
    return Definition(int(message.attrib["id"]), name, _description(message), tuple(base), tuple(extension))


def _description(element: ElementTree.Element) -> str:
    return " ".join((element.findtext("description") or "").split())


def header(messages: list[Definition], enums: list[tuple[str, list[tuple[str, int, str]]]]) -> str:
    """The C header: enum constants, one struct, encoder and decoder per message, the table of all messages."""
    parts = [_C_TOP]
    for name, entries in enums:
        lines = [f"    {entry} = {value}, /* {description} */" for entry, value, description in entries]
        parts.append(f"/* {name} */\nenum {{\n" + "\n".join(lines) + "\n};\n")
    parts += [_c_message(message) for message in messages]
    rows = [
        f"    {{{m.name}_ID, {m.name}_CRC_EXTRA, {m.name}_LENGTH, {_target(m)}u, {_session(m)}u}}," for m in messages
    ]
    numbers = [f"    {m.name}_ROW," for m in messages]
    bottom = _C_BOTTOM.replace("\nROWS\n", "\n" + "\n".join(rows) + "\n").replace("NUMBERS", "\n".join(numbers))
    parts.append(bottom.replace("NO_TARGET_VALUE", f"{_NO_TARGET}u"))
    return "\n".join(parts)


def _target(message: Definition) -> int:
    """Where the system a message is meant for stands in it."""
    return _NO_TARGET if message.target_offset < 0 else message.target_offset


def _session(message: Definition) -> int:
    """Where the session of its sender stands in it."""
    offset = 0
    for field in message.fields:
        if field.name == "session":
            return offset
        offset += field.size
    return _NO_TARGET


def _c_message(message: Definition) -> str:
    upper, lower = message.name, message.name.lower()
    lines = [f"/* {message.description} */"]
    lines += [f"#define {upper}_ID {message.id}u", f"#define {upper}_LENGTH {message.length}u"]
    lines += [f"#define {upper}_CRC_EXTRA {message.crc_extra}u", "typedef struct {"]
    lines += [
        f"    {f.ctype} {f.name}{f'[{f.length}]' if f.length else ''}; /* {f.description} */" for f in message.fields
    ]
    lines += [f"}} {lower}_msg;", "enum {"]
    offset = 0
    for f in message.fields:
        lines.append(f"    {upper}_{f.name.upper()}_AT = {offset},")
        offset += f.size
    lines += ["};", ""]
    lines += [*_c_encode(message), "", *_c_decode(message), ""]
    return "\n".join(lines)


def _gapless(message: Definition) -> bool:
    """Whether the struct and the payload are the same bytes: every field lies on a multiple of its size."""
    offset = 0
    for field in message.fields:
        if offset % _SIZES[field.ctype]:
            return False
        offset += field.size
    return True


def _c_encode(message: Definition) -> list[str]:
    """In one piece where memory and wire look alike, else field by field."""
    upper, lower = message.name, message.name.lower()
    head = f"static inline void {lower}_encode(const {lower}_msg *m, uint8_t payload[{upper}_LENGTH])"
    if _gapless(message):
        last = message.fields[-1].name
        check = f'_Static_assert(offsetof({lower}_msg, {last}) == {upper}_{last.upper()}_AT, "no gaps");'
        return [head, "{", f"    {check}", f"    memcpy(payload, m, {upper}_LENGTH);", "}"]
    copies = [
        f"    memcpy(payload + {upper}_{f.name.upper()}_AT, {'' if f.length else '&'}m->{f.name}, {f.size}u);"
        for f in message.fields
    ]
    return [head, "{", *copies, "}"]


def _c_decode(message: Definition) -> list[str]:
    """The reverse. What MAVLink cut off at the end of the payload is zero; what is beyond the message is ignored."""
    upper, lower = message.name, message.name.lower()
    head = f"static inline void {lower}_decode({lower}_msg *m, const uint8_t *payload, size_t length)"
    count = f"length < {upper}_LENGTH ? length : {upper}_LENGTH"
    if _gapless(message):
        return [head, "{", "    memset(m, 0, sizeof *m);", f"    memcpy(m, payload, {count});", "}"]
    copies = [
        f"    memcpy({'' if f.length else '&'}m->{f.name}, whole + {upper}_{f.name.upper()}_AT, {f.size}u);"
        for f in message.fields
    ]
    whole = [f"    uint8_t whole[{upper}_LENGTH] = {{0}};", f"    memcpy(whole, payload, {count});"]
    return [head, "{", *whole, "    memset(m, 0, sizeof *m);", *copies, "}"]


def python(
    messages: list[Definition], enums: list[tuple[str, list[tuple[str, int, str]]]], *, source: str = "goshawk.xml"
) -> str:
    """The Python module: one IntEnum per enum, one dataclass per message."""
    top = _PYTHON_TOP.replace("goshawk.xml", source)
    parts = [top if enums else top.replace("from enum import IntEnum\n", "")]
    for name, entries in enums:
        short = _camel(name.removeprefix("GOSHAWK_"))
        lines = [f"class {short}(IntEnum):"]
        for entry, value, description in entries:
            lines += [f"    {entry.removeprefix(name + '_')} = {value}", f'    """{description}"""']
        parts.append("\n".join(lines) + "\n")
    parts += [_python_message(message) for message in messages]
    table = "\n".join(f"    {m.id}: {_camel(m.name.removeprefix('GOSHAWK_'))}," for m in messages)
    parts.append(f"BY_ID: dict[int, type[Message]] = {{\n{table}\n}}\n")
    return "\n\n".join(parts)


def _python_message(message: Definition) -> str:
    layout = "".join(f"{f.length or ''}{_STRUCT[f.ctype]}" for f in message.fields)
    arrays = tuple(-1 if f.ctype == "char" and f.length else f.length for f in message.fields)
    lines = ["@dataclass(slots=True)", f"class {_camel(message.name.removeprefix('GOSHAWK_'))}(Message):"]
    lines += [f'    """{message.description}"""', "", f"    ID: ClassVar[int] = {message.id}"]
    lines += [f"    CRC_EXTRA: ClassVar[int] = {message.crc_extra}"]
    lines += [f'    STRUCT: ClassVar[struct.Struct] = struct.Struct("<{layout}")']
    lines += [f"    ARRAYS: ClassVar[tuple[int, ...]] = {arrays}"]
    for field in message.fields:
        number, zero = ("float", "0.0") if field.ctype == "float" else ("int", "0")
        if field.ctype == "char" and field.length:
            lines.append(f'    {field.name}: str = ""')
        elif field.length:
            lines.append(f"    {field.name}: tuple[{number}, ...] = ({zero},) * {field.length}")
        else:
            lines.append(f"    {field.name}: {number} = {zero}")
        lines.append(f'    """{field.description}"""')
    return "\n".join(lines) + "\n"


def _camel(name: str) -> str:
    return "".join(word.capitalize() for word in name.split("_"))


_C_TOP = """\
/* Written by dialect/generate.py from goshawk.xml; do not edit. */
#ifndef GOSHAWK_DIALECT_H
#define GOSHAWK_DIALECT_H

#include <stddef.h>
#include <stdint.h>
#include <string.h>

/* Payloads are little-endian, and so must be the machine: a message's struct and its payload are the same bytes. */
#if defined(__BYTE_ORDER__)
_Static_assert(__BYTE_ORDER__ == __ORDER_LITTLE_ENDIAN__, "a little-endian machine");
#endif
"""

_C_BOTTOM = """\
#define GOSHAWK_NO_TARGET NO_TARGET_VALUE

/* Which row of the table below a message is. */
enum {
NUMBERS
    GOSHAWK_DIALECT_ROWS
};

typedef struct {
    uint16_t id;
    uint8_t crc_extra;
    uint8_t length; /* of the whole payload, before zeros at its end are cut off */
    uint8_t target;  /* where target_system lies in the payload (target_component follows), or GOSHAWK_NO_TARGET */
    uint8_t session; /* where the sender's session lies, or GOSHAWK_NO_TARGET */
} goshawk_dialect_row;

/* All messages. For one file of a program: every file that calls this has the table. */
static inline const goshawk_dialect_row *goshawk_dialect(void)
{
    static const goshawk_dialect_row rows[GOSHAWK_DIALECT_ROWS] = {
ROWS
    };
    return rows;
}

#endif
"""

_PYTHON_TOP = '''\
"""Written by dialect/generate.py from goshawk.xml; do not edit."""

import struct
from dataclasses import dataclass
from enum import IntEnum
from typing import ClassVar

from firmware_bridge.dialect.message import Message
'''


def main() -> None:
    """Write the three files."""
    messages, enums = read(HERE / "goshawk.xml")
    HEADER.write_text(header(messages, enums))
    PYTHON.write_text(python(messages, enums))
    AUTOPILOT.write_text(python(*read(HERE / "autopilot.xml"), source="autopilot.xml"))


if __name__ == "__main__":
    main()
