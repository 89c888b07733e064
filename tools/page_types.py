"""Writes the client's message types from the structs of `gcs_web/protocol`: `python tools/page_types.py`."""

import importlib
import inspect
import pkgutil
import types
import typing
from pathlib import Path

import msgspec

from gcs_web import protocol

TARGET = Path(__file__).parents[1] / "gcs_web" / "client" / "src" / "core" / "protocol.ts"
HEAD = "// Written by tools/page_types.py from gcs_web/protocol. Do not edit.\n"
_SIMPLE = {str: "string", int: "number", float: "number", bool: "boolean", type(None): "null"}


def typescript() -> str:
    """All structs of the protocol as interfaces, then the two unions."""
    structs = [kind for module in _modules() for kind in vars(module).values() if _is_struct_of(module, kind)]
    parts = [HEAD, f"export const PROTOCOL = {protocol.PROTOCOL};", *(_interface(kind) for kind in structs)]
    for name in ("ToPage", "FromPage"):
        members = " | ".join(kind.__name__ for kind in typing.get_args(getattr(protocol, name)))
        parts.append(f"export type {name} = {members};")
    return "\n\n".join(parts) + "\n"


def _modules() -> list[types.ModuleType]:
    found = pkgutil.iter_modules(protocol.__path__, f"{protocol.__name__}.")
    return [*(importlib.import_module(module.name) for module in found), protocol]


def _is_struct_of(module: types.ModuleType, kind: object) -> bool:
    return inspect.isclass(kind) and issubclass(kind, msgspec.Struct) and kind.__module__ == module.__name__


def _interface(kind: type[msgspec.Struct]) -> str:
    lines = []
    if (tag := kind.__struct_config__.tag) is not None:
        lines.append(f"  type: {tag!r};".replace("'", '"'))
    hints = typing.get_type_hints(kind)
    for field in msgspec.structs.fields(kind):
        # Commands may leave out what has a default; the server sends every field.
        optional = "?" if not field.required and issubclass(kind, protocol.Command) else ""
        lines.append(f"  {field.name}{optional}: {_type(hints[field.name])};")
    return "\n".join([f"export interface {kind.__name__} {{", *lines, "}"])


def _type(hint: object) -> str:
    origin, arguments = typing.get_origin(hint), typing.get_args(hint)
    if origin in (typing.Union, types.UnionType):
        return " | ".join(_type(a) for a in arguments)
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
    TARGET.parent.mkdir(parents=True, exist_ok=True)
    TARGET.write_text(typescript())
