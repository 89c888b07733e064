"""Write generated/goshawk_dialect.h (the vehicle) and generated/messages.py (the ground) from the XML beside this file.

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
    words: str

    @property
    def size(self) -> int:
        return _SIZES[self.ctype] * max(self.length, 1)


@dataclass(frozen=True, slots=True)
class Definition:
    id: int
    name: str
    words: str
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
        entries = [(e.attrib["name"], int(e.attrib["value"]), _words(e)) for e in enum.iterfind("entry")]
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
    return Definition(int(message.attrib["id"]), name, _words(message), tuple(base), tuple(extension))


def _words(element: ElementTree.Element) -> str:
    return " ".join((element.findtext("description") or "").split())


def header(messages: list[Definition], enums: list[tuple[str, list[tuple[str, int, str]]]]) -> str:
    """The C header: enum constants, one struct per message, encode and decode byte by byte."""
    parts = [_C_TOP]
    for name, entries in enums:
        lines = [f"    {entry} = {value}, /* {words} */" for entry, value, words in entries]
        parts.append(f"/* {name} */\nenum {{\n" + "\n".join(lines) + "\n};\n")
    parts += [_c_message(message) for message in messages]
    rows = [f"    {{{m.name}_ID, {m.name}_LENGTH, {m.name}_CRC_EXTRA, {_target(m)}u}}," for m in messages]
    parts.append(_C_BOTTOM.replace("ROWS", "\n".join(rows)).replace("NO_TARGET_VALUE", f"{_NO_TARGET}u"))
    return "\n".join(parts)


def _target(message: Definition) -> int:
    """Where the system a message is meant for stands in it."""
    return _NO_TARGET if message.target_offset < 0 else message.target_offset


def _c_message(message: Definition) -> str:
    upper, lower = message.name, message.name.lower()
    lines = [f"/* {message.words} */"]
    lines += [f"#define {upper}_ID {message.id}u", f"#define {upper}_LENGTH {message.length}u"]
    lines += [f"#define {upper}_CRC_EXTRA {message.crc_extra}u", "typedef struct {"]
    lines += [f"    {f.ctype} {f.name}{f'[{f.length}]' if f.length else ''}; /* {f.words} */" for f in message.fields]
    lines += [f"}} {lower}_msg;", "enum {"]
    offset = 0
    for f in message.fields:
        lines.append(f"    {upper}_{f.name.upper()}_AT = {offset},")
        offset += f.size
    lines += ["};", ""]
    for verb in ("encode", "decode"):
        lines += [*_c_codec(message, verb), ""]
    return "\n".join(lines)


def _c_codec(message: Definition, verb: str) -> list[str]:
    """Field by field; in one piece where memory and wire look alike."""
    upper, lower, out = message.name, message.name.lower(), verb == "encode"
    given = f"const {lower}_msg *m, uint8_t payload[{upper}_LENGTH]" if out else f"{lower}_msg *m, goshawk_payload p"
    by_field: list[str] = []
    offset, gapless = 0, True
    for field in message.fields:
        by_field += _c_field(field, offset, "put" if out else "get")
        gapless = gapless and offset % _SIZES[field.ctype] == 0
        offset += field.size
    if gapless:
        last = message.fields[-1].name
        piece = f"memcpy(payload, m, {upper}_LENGTH);" if out else f"goshawk_read(m, {upper}_LENGTH, p, 0);"
        check = f'_Static_assert(offsetof({lower}_msg, {last}) == {upper}_{last.upper()}_AT, "no gaps");'
        by_field = ["#if GOSHAWK_LITTLE_ENDIAN", f"    {check}", f"    {piece}", "#else", *by_field, "#endif"]
    return [f"static inline void {lower}_{verb}({given})", "{", *by_field, "}"]


def _c_field(field: Field, offset: int, verb: str) -> list[str]:
    suffix = {"float": "f32", "char": "i8"}.get(field.ctype) or re.sub(r"(u?)int(\d+)_t", r"\g<1>", field.ctype)
    if suffix in ("", "u"):
        suffix = f"{suffix or 'i'}{_SIZES[field.ctype] * 8}"
    size = _SIZES[field.ctype]
    target, place = f"m->{field.name}", f"payload + {offset}" if verb == "put" else f"p, {offset}u"
    loop: list[str] = []
    if field.length:
        loop = [f"    for (unsigned i = 0; i < {field.length}u; i++)"]
        target += "[i]"
        place += f" + ({size}u * i)" if size > 1 else " + i"
    cast = "(char)" if field.ctype == "char" else ""
    if verb == "put":
        value = f"(int8_t){target}" if field.ctype == "char" else target
        statement = f"goshawk_put_{suffix}({place}, {value});"
    else:
        statement = f"{target} = {cast}goshawk_get_{suffix}({place});"
    return [*loop, ("        " if loop else "    ") + statement]


def python(messages: list[Definition], enums: list[tuple[str, list[tuple[str, int, str]]]]) -> str:
    """The Python module: one IntEnum per enum, one dataclass per message."""
    parts = [_PYTHON_TOP]
    for name, entries in enums:
        short = _camel(name.removeprefix("GOSHAWK_"))
        lines = [f"class {short}(IntEnum):"]
        for entry, value, words in entries:
            lines += [f"    {entry.removeprefix(name + '_')} = {value}", f'    """{words}"""']
        parts.append("\n".join(lines) + "\n")
    parts += [_python_message(message) for message in messages]
    table = "\n".join(f"    {m.id}: {_camel(m.name.removeprefix('GOSHAWK_'))}," for m in messages)
    parts.append(f"BY_ID: dict[int, type[Message]] = {{\n{table}\n}}\n")
    return "\n\n".join(parts)


def _python_message(message: Definition) -> str:
    layout = "".join(f"{f.length or ''}{_STRUCT[f.ctype]}" for f in message.fields)
    arrays = tuple(-1 if f.ctype == "char" and f.length else f.length for f in message.fields)
    lines = ["@dataclass(slots=True)", f"class {_camel(message.name.removeprefix('GOSHAWK_'))}(Message):"]
    lines += [f'    """{message.words}"""', "", f"    ID: ClassVar[int] = {message.id}"]
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
        lines.append(f'    """{field.words}"""')
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

/* On such a machine a message's struct and its payload are the same bytes. */
#if defined(__BYTE_ORDER__) && __BYTE_ORDER__ == __ORDER_LITTLE_ENDIAN__
#define GOSHAWK_LITTLE_ENDIAN 1
#else
#define GOSHAWK_LITTLE_ENDIAN 0
#endif

/* Little-endian access that needs no alignment. */
static inline void goshawk_put_u8(uint8_t *p, uint8_t v) { p[0] = v; }
#if GOSHAWK_LITTLE_ENDIAN
static inline void goshawk_put_u16(uint8_t *p, uint16_t v) { memcpy(p, &v, sizeof v); }
static inline void goshawk_put_u32(uint8_t *p, uint32_t v) { memcpy(p, &v, sizeof v); }
static inline void goshawk_put_u64(uint8_t *p, uint64_t v) { memcpy(p, &v, sizeof v); }
#else
static inline void goshawk_put_u16(uint8_t *p, uint16_t v)
{
    p[0] = (uint8_t)(v & 0xFFu);
    p[1] = (uint8_t)(v >> 8);
}
static inline void goshawk_put_u32(uint8_t *p, uint32_t v)
{
    goshawk_put_u16(p, (uint16_t)(v & 0xFFFFu));
    goshawk_put_u16(p + 2, (uint16_t)(v >> 16));
}
static inline void goshawk_put_u64(uint8_t *p, uint64_t v)
{
    goshawk_put_u32(p, (uint32_t)(v & 0xFFFFFFFFu));
    goshawk_put_u32(p + 4, (uint32_t)(v >> 32));
}
#endif
static inline void goshawk_put_i8(uint8_t *p, int8_t v) { goshawk_put_u8(p, (uint8_t)v); }
static inline void goshawk_put_i16(uint8_t *p, int16_t v) { goshawk_put_u16(p, (uint16_t)v); }
static inline void goshawk_put_i32(uint8_t *p, int32_t v) { goshawk_put_u32(p, (uint32_t)v); }
static inline void goshawk_put_i64(uint8_t *p, int64_t v) { goshawk_put_u64(p, (uint64_t)v); }
static inline void goshawk_put_f32(uint8_t *p, float v)
{
    uint32_t bits;
    memcpy(&bits, &v, sizeof bits);
    goshawk_put_u32(p, bits);
}

/* A payload as it came. MAVLink cuts trailing zeros off, so what lies beyond its end reads as zero. */
typedef struct {
    const uint8_t *bytes;
    unsigned n;
} goshawk_payload;

static inline uint8_t goshawk_get_u8(goshawk_payload p, unsigned at) { return at < p.n ? p.bytes[at] : 0u; }
#if GOSHAWK_LITTLE_ENDIAN
static inline void goshawk_read(void *out, unsigned size, goshawk_payload p, unsigned at)
{
    uint8_t *bytes = (uint8_t *)out;
    for (unsigned i = 0; i < size; i++)
        bytes[i] = goshawk_get_u8(p, at + i);
}
#endif
static inline uint16_t goshawk_get_u16(goshawk_payload p, unsigned at)
{
    return (uint16_t)(goshawk_get_u8(p, at) | ((unsigned)goshawk_get_u8(p, at + 1u) << 8));
}
static inline uint32_t goshawk_get_u32(goshawk_payload p, unsigned at)
{
    return (uint32_t)goshawk_get_u16(p, at) | ((uint32_t)goshawk_get_u16(p, at + 2u) << 16);
}
static inline uint64_t goshawk_get_u64(goshawk_payload p, unsigned at)
{
    return (uint64_t)goshawk_get_u32(p, at) | ((uint64_t)goshawk_get_u32(p, at + 4u) << 32);
}
static inline int8_t goshawk_get_i8(goshawk_payload p, unsigned at) { return (int8_t)goshawk_get_u8(p, at); }
static inline int16_t goshawk_get_i16(goshawk_payload p, unsigned at) { return (int16_t)goshawk_get_u16(p, at); }
static inline int32_t goshawk_get_i32(goshawk_payload p, unsigned at) { return (int32_t)goshawk_get_u32(p, at); }
static inline int64_t goshawk_get_i64(goshawk_payload p, unsigned at) { return (int64_t)goshawk_get_u64(p, at); }
static inline float goshawk_get_f32(goshawk_payload p, unsigned at)
{
    const uint32_t bits = goshawk_get_u32(p, at);
    float v;
    memcpy(&v, &bits, sizeof v);
    return v;
}
"""

_C_BOTTOM = """\
#define GOSHAWK_NO_TARGET NO_TARGET_VALUE

typedef struct {
    uint16_t id;
    uint8_t length; /* of the full payload */
    uint8_t crc_extra;
    uint8_t target; /* where target_system lies in the payload (target_component follows), or GOSHAWK_NO_TARGET */
} goshawk_dialect_row;

/* What is known of a message; NULL when it is not of this dialect. */
static inline const goshawk_dialect_row *goshawk_dialect_of(uint32_t id)
{
    static const goshawk_dialect_row rows[] = {
ROWS
    };
    for (unsigned i = 0; i < sizeof rows / sizeof rows[0]; i++) {
        if (rows[i].id == id) {
            return &rows[i];
        }
    }
    return NULL;
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
    """Write both files."""
    messages, enums = read(HERE / "goshawk.xml")
    HEADER.write_text(header(messages, enums))
    PYTHON.write_text(python(messages, enums))


if __name__ == "__main__":
    main()
