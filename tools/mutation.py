"""Mutation testing of the embedded C: small faults are put into a source, one at a time; the case files must notice.

The faults are made on clang's syntax tree, so that types are known and nearly all of them compile:

    a < b           a >= b; and, of integers, a <= b         a && b        a || b
    a + b, a * b    a - b, a / b                             -a, !a        a
    if (a), a ? ..  if (!(a)); and if (0)                    statement;    ;
    1, 2.0f         2, 3.0f                                  TC_NAME       (TC_NAME + 1)
    const X = 2.0f  3.0f and 1.33f                           true          false

and, of the table of transitions, [event] = TO(state): left out, and led to the state after that one. A boundary (< for
<=) of two floats is not tried: it differs for one value in four thousand million.

Equivalent mutants, which compute the same as the original, are listed by hand with the reason in
firmware_bridge/controller/test/equivalent_mutants.txt; they do not count. An entry that fits no mutant is an error.
"""

import json
import os
import re
import subprocess
import tempfile
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

LIBRARY = Path(__file__).resolve().parents[1] / "firmware_bridge" / "controller"
EQUIVALENT = LIBRARY / "test" / "equivalent_mutants.txt"
BOUNDS = ("-fsanitize=bounds", "-fsanitize-undefined-trap-on-error")
"""An index beyond its array ends the run."""
FLAGS = (
    "-std=c11", "-O1", "-w", *BOUNDS, "-ffp-contract=off", "-fno-math-errno", "-DTC_MAX_SEGMENTS=32",
    f"-I{LIBRARY / 'include'}", "-isystem", str(LIBRARY.parent / "dialect" / "generated"),
)  # fmt: skip
LONGEST_RUN_S = 10.0
"""The case files take a fraction of it; a mutant that takes longer loops for ever, and counts as killed."""

_NEGATED = {"<": ">=", ">=": "<", ">": "<=", "<=": ">", "==": "!=", "!=": "=="}
_BOUNDARY = {"<": "<=", "<=": "<", ">": ">=", ">=": ">"}
_SWAPPED = {
    "+": "-", "-": "+", "*": "/", "/": "*", "&&": "||", "||": "&&", "&": "|", "|": "&",
    "+=": "-=", "-=": "+=", "*=": "/=", "/=": "*=", "|=": "&=", "<<": ">>", ">>": "<<",
}  # fmt: skip


@dataclass(frozen=True, slots=True)
class Mutant:
    file: str
    function: str
    """Empty in tables and definitions."""
    begin: int
    """Offset of what is replaced."""
    end: int
    replacement: str
    line: int
    text: str
    """The line as it reads with the fault, blanks collapsed; what is left out when a statement is."""

    @property
    def key(self) -> str:
        """How the list of equivalent mutants names it: free of line numbers, so that it outlives edits elsewhere."""
        return f"{self.file} | {self.function or '-'} | {self.text}"

    def applied(self, source: str) -> str:
        return source[: self.begin] + self.replacement + source[self.end :]


@dataclass(slots=True)
class Score:
    file: str
    killed: int = 0
    survived: list[Mutant] = field(default_factory=list[Mutant])
    equivalent: int = 0
    invalid: int = 0
    """Do not compile; not counted."""

    @property
    def share(self) -> float:
        tried = self.killed + len(self.survived)
        return self.killed / tried if tried else 1.0


# -- making mutants ----------------------------------------------------------------------------------------------------


def mutants(path: Path, functions: frozenset[str] | None = None) -> list[Mutant]:
    """All of a source file, or of these functions of it alone (then without tables and definitions)."""
    source = path.read_text()
    done = subprocess.run(
        ["clang-19", *FLAGS, "-fsyntax-only", "-Xclang", "-ast-dump=json", str(path)],
        capture_output=True, text=True, check=True,
        env={**os.environ, "CCACHE_DISABLE": "1"},  # it would dump the tree of the preprocessed text
    )  # fmt: skip
    found: dict[tuple[int, int, str], Mutant] = {}

    def add(function: str, begin: int, end: int, replacement: str) -> None:
        first, last = source.rfind("\n", 0, begin) + 1, source.find("\n", end)
        changed = source[first:begin] + replacement + source[end:last]
        if not replacement and source[begin:end].strip(",") not in "!-":
            changed = f"without {source[begin:end]}"
            if source[begin:end] in ("break", "continue"):
                changed += f" after {source[:first].splitlines()[-1]}"
        text = " ".join(changed.split())
        line = source.count("\n", 0, begin) + 1
        found.setdefault((begin, end, replacement), Mutant(path.name, function, begin, end, replacement, line, text))

    for node in json.loads(done.stdout)["inner"]:
        if node.get("kind") != "FunctionDecl" or not any(
            n.get("kind") == "CompoundStmt" for n in node.get("inner", [])
        ):
            continue
        name = node["name"]
        if not re.search(rf"^[a-z].*\b{name}\(", source, re.MULTILINE) or (functions and name not in functions):
            continue
        span = _span(node, operand=True)  # `bool` is a macro
        if span is None or name not in source[span[0] : span[1]]:
            continue
        for begin, end, replacement in _of_tree(node, source):
            add(name, begin, end, replacement)
        for match in re.finditer(r"\b(true|false)\b", source[span[0] : span[1]]):
            add(name, span[0] + match.start(), span[0] + match.end(), "false" if match[1] == "true" else "true")
    if functions is None:
        for begin, end, replacement in _of_tables(source):
            add("", begin, end, replacement)
    return sorted(found.values(), key=lambda mutant: (mutant.begin, mutant.replacement))


def _span(node: dict, *, operand: bool = False) -> tuple[int, int] | None:
    """Offsets of a node in the file; None when a macro stands behind it, unless it is an operand: then where the macro
    is used."""
    begin, end = node["range"]["begin"], node["range"]["end"]
    if operand:
        begin, end = begin.get("expansionLoc", begin), end.get("expansionLoc", end)
    if "offset" not in begin or "offset" not in end:
        return None
    return begin["offset"], end["offset"] + end["tokLen"]


def _is_float(node: dict) -> bool:
    return node.get("type", {}).get("qualType", "") in ("float", "const float", "double")


def _of_tree(node: dict, source: str) -> Iterator[tuple[int, int, str]]:
    kind, inner, span = node.get("kind", ""), [n for n in node.get("inner", []) if n], _span(node)
    for child in inner:
        yield from _of_tree(child, source)
    if kind == "CompoundStmt" or (kind in ("IfStmt", "ForStmt", "CaseStmt", "DefaultStmt")):
        bodies = inner if kind == "CompoundStmt" else inner[1:] if kind == "IfStmt" else inner[-1:]
        for child in bodies:
            yield from _removal(child)
    if kind in ("BinaryOperator", "CompoundAssignOperator"):
        yield from _of_operator(node, inner, source)
    if span is None:
        return
    text = source[span[0] : span[1]]
    if kind == "UnaryOperator" and node["opcode"] in ("-", "!") and text.startswith(node["opcode"]):
        yield span[0], span[0] + 1, ""
    elif kind == "UnaryOperator" and node["opcode"] in ("++", "--"):
        yield span[0], span[1], text.replace("++", "@@").replace("--", "++").replace("@@", "--")
    elif kind in ("IfStmt", "ConditionalOperator", "WhileStmt"):
        condition = _span(inner[0], operand=True)
        if condition is not None:
            yield condition[0], condition[1], f"!({source[condition[0] : condition[1]]})"
            if kind == "IfStmt":
                yield condition[0], condition[1], "0"
    elif kind == "IntegerLiteral" and re.fullmatch(r"\d+[uUlL]*", text):
        yield span[0], span[1], re.sub(r"\d+", lambda n: str(int(n[0]) + 1), text)
    elif kind == "FloatingLiteral":
        yield span[0], span[1], _scaled(text, 1.5)
    elif kind == "DeclRefExpr" and node["referencedDecl"]["kind"] == "EnumConstantDecl":
        yield span[0], span[1], f"({text} + 1)"


def _removal(statement: dict) -> Iterator[tuple[int, int, str]]:
    kind, span = statement.get("kind"), _span(statement)
    removable = ("CallExpr", "BinaryOperator", "CompoundAssignOperator", "UnaryOperator", "CStyleCastExpr",
                 "BreakStmt", "ContinueStmt")  # fmt: skip
    if kind in removable and span is not None:
        yield span[0], span[1], ""


def _of_operator(node: dict, operands: list[dict], source: str) -> Iterator[tuple[int, int, str]]:
    left, right = _span(operands[0], operand=True), _span(operands[1], operand=True)
    operator = node["opcode"]
    if left is None or right is None:
        return
    at = source.find(operator, left[1], right[0])
    if at < 0:
        return
    wanted = [table[operator] for table in (_NEGATED, _SWAPPED) if operator in table]
    if operator in _BOUNDARY and not _is_float(operands[0]):
        wanted.append(_BOUNDARY[operator])
    for replacement in wanted:
        yield at, at + len(operator), replacement


def _scaled(text: str, factor: float) -> str:
    value = float(text.rstrip("fF"))
    return f"{value * factor or 1.0:.9g}".replace("e", "e").rstrip() + _suffix(value * factor or 1.0)


def _suffix(value: float) -> str:
    return "f" if any(c in f"{value:.9g}" for c in ".e") else ".0f"


def _of_tables(source: str) -> Iterator[tuple[int, int, str]]:
    for match in re.finditer(r"^(?:#define \w+|static const \w+ \w+ =) \(?(-?\d[\d.e+-]*f?)", source, re.MULTILINE):
        number = match[1]
        if "." in number or "e" in number:
            yield match.start(1), match.end(1), _scaled(number, 1.5)
            yield match.start(1), match.end(1), _scaled(number, 2.0 / 3.0)
        else:
            yield match.start(1), match.end(1), str(int(number) + 1)
    for match in re.finditer(r"\[(TC_(?:EVENT|COMMAND)_\w+)\] = TO\((\w+)\),?", source):
        yield match.start(), match.end(), ""
        yield match.start(2), match.end(2), f"({match[2]} + 1) % TC_MISSION_STATE_COUNT"
    for row in re.finditer(r"\[TC_\w+\] = \{\"[^}]*\}", source):
        for flag in re.finditer(r"\b(true|false)\b", row[0]):
            at = row.start() + flag.start()
            yield at, at + len(flag[0]), "false" if flag[0] == "true" else "true"


# -- killing them ------------------------------------------------------------------------------------------------------


class Bench:
    """The case files and all sources, compiled once; then one source again for each mutant."""

    def __init__(self, folder: Path, tests: tuple[Path, ...], arguments: tuple[str, ...] = ()) -> None:
        self.folder, self.arguments = folder, arguments
        self.objects: dict[str, Path] = {}
        for path in (*sorted((LIBRARY / "src").rglob("*.c")), *tests):
            self.objects[path.name] = folder / f"{path.stem}.o"
            self._compile(path, self.objects[path.name])
        if not self._passes(self.objects):
            raise SystemExit("the case files fail without any fault; run them by themselves first")

    def _compile(self, path: Path, out: Path, *flags: str) -> bool:
        command = ["gcc", *FLAGS, *flags, "-c", str(path), "-o", str(out)]
        return subprocess.run(command, capture_output=True, check=False).returncode == 0

    def _passes(self, objects: dict[str, Path]) -> bool:
        program = self.folder / "cases"
        subprocess.run(
            [
                "gcc",
                "-fsanitize=bounds",
                "-fsanitize-undefined-trap-on-error",
                *map(str, objects.values()),
                "-lm",
                "-o",
                str(program),
            ],
            check=True,
        )
        try:
            done = subprocess.run(
                [program, *self.arguments], capture_output=True, check=False, timeout=LONGEST_RUN_S
            )  # fmt: skip
        except subprocess.TimeoutExpired:
            return False
        return done.returncode == 0

    def kills(self, mutant: Mutant, original: Path) -> bool | None:
        """None: it does not compile."""
        path, out = self.folder / f"mutant_{mutant.file}", self.folder / "mutant.o"
        path.write_text(mutant.applied(original.read_text()))
        if not self._compile(path, out, f"-I{original.parent}"):
            return None
        return not self._passes({**self.objects, mutant.file: out})


def equivalents() -> dict[str, str]:
    """Reason by mutant."""
    listed = {}
    for line in EQUIVALENT.read_text().splitlines():
        if line and not line.startswith("#"):
            key, _, reason = line.rpartition(" | ")
            listed[key] = reason
    return listed


def score(
    path: Path,
    functions: frozenset[str] | None,
    tests: tuple[Path, ...],
    *,
    every: int = 1,
    arguments: tuple[str, ...] = (),
) -> Score:
    """Try the mutants of a file, or every so manieth of them."""
    listed, result = equivalents(), Score(path.name)
    found = mutants(path, functions)
    stale = {key for key in listed if key.startswith(f"{path.name} | ")} - {mutant.key for mutant in found}
    if stale:
        raise SystemExit(f"{EQUIVALENT.name} lists what is no mutant any more:\n" + "\n".join(sorted(stale)))
    with tempfile.TemporaryDirectory() as folder:
        bench = Bench(Path(folder), tests, arguments)
        for mutant in found[::every]:
            if mutant.key in listed:
                result.equivalent += 1
                continue
            killed = bench.kills(mutant, path)
            if killed is None:
                result.invalid += 1
            elif killed:
                result.killed += 1
            else:
                result.survived.append(mutant)
    return result
