"""The controller's parameters: names, bounds and presets from its table, meanings from the comments of its header."""

import re
from pathlib import Path

from firmware_bridge.controller import PARAMETERS, ParameterInfo
from tools.reference.markdown import code, number, plain, table

LIBRARY = Path(__file__).parents[2] / "firmware_bridge" / "controller"
HEADER = LIBRARY / "include" / "goshawk_controller" / "parameters.h"
ROWS = LIBRARY / "src" / "base" / "parameters.c"
MEMBER = re.compile(r"^    float (\w+)(?:\[\w+\])?;(?: */\* (.*?) \*/)?$")
SECTION = re.compile(r"^    /\* (.*?)(?: \*/)?$")


def page() -> str:
    """A table for each section of the header."""
    member_of = dict(re.findall(r'\{"(\w+)", AT\((\w+)', ROWS.read_text()))
    parts = []
    for title, members in sections().items():
        rows = [_row(info, members[member_of[name]]) for name, info in PARAMETERS.items() if member_of[name] in members]
        head = ("parameter", "unit", "bounds", "preset", "in flight", "meaning")
        parts += [f"## {title}", table(head, rows)]
    return "\n\n".join(parts)


def sections() -> dict[str, dict[str, str]]:
    """The meaning of every member of `tc_parameters`, by section of the header."""
    body = HEADER.read_text().split("typedef struct {\n")[1].split("} tc_parameters;")[0]
    found: dict[str, dict[str, str]] = {}
    for line in body.splitlines():
        if member := MEMBER.match(line):
            found[list(found)[-1]][member[1]] = member[2] or ""
        elif section := SECTION.match(line):
            found[re.split(r"[.:,]", section[1])[0]] = {}
    return found


def _row(info: ParameterInfo, meaning: str) -> tuple[str, ...]:
    bounds = f"{number(info.smallest)} to {number(info.largest)}"
    unit = "" if info.unit == "1" else info.unit
    return code(info.name), unit, bounds, number(info.preset), "yes" if info.in_flight else "", plain(meaning)
