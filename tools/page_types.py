"""Writes the client's message types from the messages and commands of `gcs_web`: `python tools/page_types.py`."""

import types
import typing
from collections.abc import Iterator
from pathlib import Path

import msgspec

from gcs_web.panels import HANDLERS
from gcs_web.protocol.base import Command, Message
from gcs_web.protocol.people import PROTOCOL

TARGET = Path(__file__).parents[1] / "gcs_web" / "client" / "src" / "core" / "protocol.ts"
HEAD = "// Written by tools/page_types.py from the structs of gcs_web. Do not edit.\n"
_SIMPLE = {str: "string", int: "number", float: "number", bool: "boolean", type(None): "null"}

Struct = type[msgspec.Struct]


def typescript() -> str:
    """What a panel has handlers for, every message to pages, and all structs that these are made of, as interfaces."""
    unions = {"ToPage": set(tagged(Message)), "FromPage": set(HANDLERS)}
    structs: dict[str, Struct] = {}
    for kind in set.union(*unions.values()):
        _collect(kind, structs)
    parts = [HEAD, f"export const PROTOCOL = {PROTOCOL};", *(_interface(structs[name]) for name in sorted(structs))]
    for name, members in unions.items():
        parts.append(f"export type {name} = {' | '.join(sorted(kind.__name__ for kind in members))};")
    return "\n\n".join(parts) + "\n"


def tagged(base: Struct) -> Iterator[Struct]:
    """Those that come on the socket."""
    for kind in base.__subclasses__():
        if kind.__struct_config__.tag is not None:
            yield kind
        yield from tagged(kind)


def _collect(hint: object, into: dict[str, Struct]) -> None:
    """Every struct that a type is made of, by name."""
    for inside in typing.get_args(hint):
        _collect(inside, into)
    if not (isinstance(hint, type) and issubclass(hint, msgspec.Struct) and hint.__struct_fields__):
        return
    if into.get(hint.__name__) is hint:
        return
    if hint.__name__ in into:
        raise TypeError(f"two structs of the page's protocol are named {hint.__name__}; rename one")
    into[hint.__name__] = hint
    for inside in (*typing.get_type_hints(hint).values(), *hint.__bases__):
        _collect(inside, into)


def _interface(kind: Struct) -> str:
    lines = []
    if (tag := kind.__struct_config__.tag) is not None:
        lines.append(f'  type: "{tag}";')
    hints = typing.get_type_hints(kind)
    for field in msgspec.structs.fields(kind):
        # Commands may leave out what has a default; the server sends every field.
        optional = "?" if not field.required and issubclass(kind, Command) else ""
        lines.append(f"  {field.name}{optional}: {_type(hints[field.name])};")
    return "\n".join([f"export interface {kind.__name__} {{", *lines, "}"])


def _type(hint: object) -> str:
    origin, arguments = typing.get_origin(hint), typing.get_args(hint)
    if origin in (typing.Union, types.UnionType):
        return " | ".join(dict.fromkeys(_type(a) for a in arguments))
    if origin is typing.Literal:
        return " | ".join(f'"{a}"' for a in arguments)
    if origin is list:
        item = _type(arguments[0])
        return f"({item})[]" if "|" in item else f"{item}[]"
    if origin is dict:
        return f"Record<{_type(arguments[0])}, {_type(arguments[1])}>"
    if origin is tuple:
        return f"[{', '.join(_type(a) for a in arguments)}]"
    if isinstance(hint, type):
        return _SIMPLE.get(hint, hint.__name__)
    raise TypeError(f"the page's protocol has no TypeScript for {hint!r}")


if __name__ == "__main__":
    TARGET.write_text(typescript())
