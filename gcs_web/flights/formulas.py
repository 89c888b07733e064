"""Streams that people write themselves: a formula of a log's columns, read by a parser of its own; nothing is run."""

import ast
from collections.abc import Callable

import numpy as np

from flight import FloatArray, InputError
from gcs_web.flights.streams import Columns, Curve, Quantity

PREFIX = "formula:"
"""A stream of a formula is called this and the formula."""
LONGEST, MOST_PARTS = 200, 60
"""Characters, and numbers, names and operations together."""

_FUNCTIONS: dict[str, tuple[int, Callable[..., FloatArray]]] = {
    "abs": (1, np.abs), "sqrt": (1, np.sqrt), "exp": (1, np.exp), "log": (1, np.log), "sin": (1, np.sin),
    "cos": (1, np.cos), "tan": (1, np.tan), "asin": (1, np.arcsin), "acos": (1, np.arccos), "sign": (1, np.sign),
    "deg": (1, np.degrees), "rad": (1, np.radians), "atan2": (2, np.arctan2), "hypot": (2, np.hypot),
    "min": (2, np.minimum), "max": (2, np.maximum),
}  # fmt: skip
"""By name: how many arguments, and what is done."""
_OPERATIONS: dict[type[ast.operator], Callable[[FloatArray, FloatArray], FloatArray]] = {
    ast.Add: np.add, ast.Sub: np.subtract, ast.Mult: np.multiply, ast.Div: np.divide, ast.Pow: np.power,
}  # fmt: skip
_Node = Callable[[Columns], FloatArray]


def quantity(key: str, there: tuple[str, ...]) -> Quantity:
    """The stream of a key that begins with `PREFIX`, in a log with these columns.

    Raises:
        InputError: it is no formula, or names a column that is not there; the message says what may stand in one.
    """
    text = key.removeprefix(PREFIX).strip()
    if len(text) > LONGEST:
        raise InputError(f"the formula has {len(text)} characters, at most {LONGEST}; write it shorter")
    try:
        tree = ast.parse(text, mode="eval")
    except (SyntaxError, ValueError, MemoryError, RecursionError):
        raise _refused(text, "cannot be read") from None
    if sum(1 for _ in ast.walk(tree)) > 3 * MOST_PARTS:
        raise InputError(f"the formula has more than {MOST_PARTS} parts; write it shorter")
    needs: dict[str, None] = {}
    value = _made(tree.body, frozenset(there), needs, text)
    if not needs:
        raise _refused(text, "names no column")

    def values(columns: Columns) -> FloatArray:
        with np.errstate(all="ignore"):  # a place that has no value is NaN
            found = np.asarray(value(columns), dtype=np.float64)
        return np.where(np.isfinite(found), found, np.nan)

    return Quantity(key, text, "", (Curve(text, "measured", tuple(needs), values),))


def _made(node: ast.expr, there: frozenset[str], needs: dict[str, None], text: str) -> _Node:
    if isinstance(node, ast.Constant) and isinstance(node.value, int | float) and not isinstance(node.value, bool):
        number = float(node.value)
        return lambda _: np.float64(number)  # type: ignore[return-value]
    if isinstance(node, ast.Name):
        return _column(node.id, there, needs, text)
    if isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.USub | ast.UAdd):
        of, sign = _made(node.operand, there, needs, text), -1.0 if isinstance(node.op, ast.USub) else 1.0
        return lambda columns: sign * of(columns)
    if isinstance(node, ast.BinOp) and type(node.op) in _OPERATIONS:
        a, b = (_made(side, there, needs, text) for side in (node.left, node.right))
        do = _OPERATIONS[type(node.op)]
        return lambda columns: do(a(columns), b(columns))
    if isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and not node.keywords:
        return _call(node.func.id, node.args, there, needs, text)
    raise _refused(text, f"has {ast.unparse(node)[:40]!r} in it")


def _column(name: str, there: frozenset[str], needs: dict[str, None], text: str) -> _Node:
    if name == "pi":
        return lambda _: np.float64(np.pi)  # type: ignore[return-value]
    if name not in there:
        raise _refused(text, f"names {name!r}, which is no column of this log")
    needs[name] = None
    return lambda columns: columns[name]


def _call(name: str, arguments: list[ast.expr], there: frozenset[str], needs: dict[str, None], text: str) -> _Node:
    if name not in _FUNCTIONS:
        raise InputError(f"there is no function {name!r}; the functions are {', '.join(sorted(_FUNCTIONS))}")
    wanted, do = _FUNCTIONS[name]
    if len(arguments) != wanted:
        raise InputError(f"{name} takes {wanted} argument{'s' if wanted > 1 else ''}, not {len(arguments)}")
    made = [_made(each, there, needs, text) for each in arguments]
    return lambda columns: do(*(each(columns) for each in made))


def _refused(text: str, why: str) -> InputError:
    return InputError(
        f"{text[:60]!r} {why}; the log's columns, pi, numbers, + - * / ** and functions like hypot may stand in it"
    )
