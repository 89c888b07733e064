"""A vehicle from a RotorPy parameter file (`quad_params = {...}`), parsed without executing it.

The text is parsed and only these are evaluated: numbers, strings, lists, tuples, dictionaries, names assigned before,
`+ - * / **`, `np.array`, and a few of NumPy's functions of one number. Anything else is refused with its line.
"""

import ast
import math
import operator
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from flight import FormatError, InputError, errors
from vehicle.draft import Known
from vehicle.parameters import Parameter

LARGEST_BYTES = 200_000
_OPERATORS: dict[type, Callable[[Any, Any], Any]] = {
    ast.Add: operator.add,
    ast.Sub: operator.sub,
    ast.Mult: operator.mul,
    ast.Div: operator.truediv,
}
_FUNCTIONS: dict[str, Callable[[float], float]] = {
    "sqrt": math.sqrt,
    "sin": math.sin,
    "cos": math.cos,
    "deg2rad": math.radians,
    "radians": math.radians,
}
_EFFECTS = {
    # RotorPy's name: (ours, unit)
    "k_eta": ("thrust_quadratic.k_n_s2", "N s2"),
    "k_m": ("rotor_yaw_torque.torque_n_m_s2", "N m s2"),
    "k_d": ("rotor_drag_speed.drag_kg", "kg"),
    "k_z": ("inflow_linear.inflow_kg", "kg"),
    "k_h": ("translational_lift.lift_kg_m", "N s2/m2"),
    "k_flap": ("flapping_moment.moment_kg_m", "kg m"),
    "c_Dx": ("parasitic_drag_speed.drag_x_kg_m", "N s2/m2"),
    "c_Dy": ("parasitic_drag_speed.drag_y_kg_m", "N s2/m2"),
    "c_Dz": ("parasitic_drag_speed.drag_z_kg_m", "N s2/m2"),
}
_ALWAYS = ("k_eta", "k_m")


def read(path: Path) -> Known:
    """All values of RotorPy's dictionary for which the catalogue has a law.

    Raises:
        InputError: no such file, or it lacks mass, rotors or thrust, or a value is no number.
        FormatError: it is not such a file, or holds an expression that would have to be executed.
    """
    path = Path(path)
    given = dictionary(path)
    hubs = _hubs(given, path)
    directions = np.asarray(given.get("rotor_directions", []), dtype=np.float64)
    if directions.shape != (4,) or not np.isin(directions, (-1.0, 1.0)).all():
        raise InputError(f"{path}: rotor_directions is {directions.tolist()}; four of 1 and -1 are expected")
    source = f"RotorPy file {path.name}"

    def number(name: str) -> float:
        value = given.get(name)
        if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
            raise InputError(f"{path}: {name} is {value!r}; a finite number is expected")
        return float(value)

    parameters = {f"inertia_{a}_kg_m2": Parameter(number(f"I{a}"), 0.0, "kg m2", source) for a in ("xx", "yy", "zz")}
    drags = [name for name in ("c_Dx", "c_Dy", "c_Dz") if given.get(name)]
    for name, (ours, unit) in _EFFECTS.items():
        if name in _ALWAYS or (name in given and number(name) != 0.0) or (name.startswith("c_D") and drags):
            parameters[ours] = Parameter(number(name), 0.0, unit, f"{source}, {name}")
    for end in ("rise_s", "fall_s"):
        parameters[f"motor_lag.{end}"] = Parameter(number("tau_m"), 0.0, "s", f"{source}, tau_m")
    notes = [
        f"rotors 0 to 3 are r1 to r4 of {path.name}; its rotor_directions are torques on the body, so spins are turned"
    ]
    if given.get("rotor_speed_min") == 0:
        notes.append(
            "rotor_speed_min is 0: a fifth of the hover speed is written, as rotors that stop cannot be controlled"
        )
    if products := [name for name in ("Ixy", "Ixz", "Iyz") if given.get(name)]:
        notes.append(f"{', '.join(products)} were not taken over: add the effect products_of_inertia")
    radius = Parameter(number("rotor_radius"), 0.0, "m", source) if "rotor_radius" in given else None
    return Known(
        name=path.stem.removesuffix("_params"),
        mass_kg=Parameter(number("mass"), 0.0, "kg", source),
        hub_body_m=hubs,
        spin=-directions,
        rotor_radius_m=radius,
        parameters=parameters,
        rotor_speed_min_rad_s=number("rotor_speed_min") if "rotor_speed_min" in given else None,
        rotor_speed_max_rad_s=number("rotor_speed_max") if "rotor_speed_max" in given else None,
        notes=tuple(notes),
    )


def _hubs(given: Mapping[str, Any], path: Path) -> np.ndarray:
    places = given.get("rotor_pos")
    if not isinstance(places, dict) or len(places) != 4:
        raise InputError(f"{path}: rotor_pos must give four rotors, as {{'r1': [x, y, z], ...}}")
    try:
        hubs = np.array([places[name] for name in sorted(places)], dtype=np.float64)
    except (TypeError, ValueError):
        hubs = np.empty(0)
    if hubs.shape != (4, 3) or not np.isfinite(hubs).all():
        raise InputError(f"{path}: rotor_pos must hold four rows of three finite numbers")
    return hubs


def dictionary(path: Path) -> dict[str, Any]:
    """The dictionary with `mass` in a RotorPy module, or the file's only expression."""
    if not path.is_file():
        raise errors.missing(path)
    if path.stat().st_size > LARGEST_BYTES:
        raise FormatError(f"{path} has {path.stat().st_size} bytes; a parameter file has less than {LARGEST_BYTES}")
    try:
        tree = ast.parse(path.read_text(encoding="utf-8"))
    except (SyntaxError, ValueError, RecursionError, MemoryError) as error:
        raise FormatError(f"{path} is not a Python file: {error}") from None
    names: dict[str, Any] = {}
    for statement in tree.body:
        if (
            isinstance(statement, ast.Assign)
            and len(statement.targets) == 1
            and isinstance(statement.targets[0], ast.Name)
        ):
            names[statement.targets[0].id] = _value(statement.value, names, path)
        elif isinstance(statement, ast.Expr) and isinstance(statement.value, ast.Dict):
            names["quad_params"] = _value(statement.value, names, path)
        elif not isinstance(statement, ast.Import | ast.ImportFrom | ast.Expr):
            raise FormatError(f"{path}, line {statement.lineno}: only assignments are read, no code is executed")
    found = [value for value in names.values() if isinstance(value, dict) and "mass" in value]
    if len(found) != 1:
        raise FormatError(
            f"{path} holds {len(found)} dictionaries with 'mass'; one, like RotorPy's quad_params, is expected"
        )
    return found[0]


def _value(node: ast.expr, names: Mapping[str, Any], path: Path) -> Any:
    """Value of an expression; the module's docstring lists what is allowed."""
    match node:
        case ast.Constant():
            return node.value
        case ast.Name(id=name) if name in names:
            return names[name]
        case ast.Attribute(value=ast.Name(id="np" | "numpy" | "math"), attr="pi"):
            return math.pi
        case ast.List() | ast.Tuple():
            return [_value(item, names, path) for item in node.elts]
        case ast.Dict():
            pairs = zip(node.keys, node.values, strict=True)
            return {str(_value(k, names, path)): _value(v, names, path) for k, v in pairs if k is not None}
        case ast.UnaryOp(op=ast.USub() | ast.UAdd()):
            inside = _numeric(_value(node.operand, names, path), node, path)
            return -inside if isinstance(node.op, ast.USub) else inside
        case ast.BinOp():
            return _binary(node, names, path)
        case ast.Call(func=ast.Attribute(value=ast.Name(id="np" | "numpy" | "math"), attr=name), args=[only]):
            inside = _value(only, names, path)
            if name == "array" and not node.keywords:
                return _numeric(inside, node, path)
            if name in _FUNCTIONS and isinstance(inside, int | float):
                return _worked_out(lambda: _FUNCTIONS[name](inside), node, path)
    raise FormatError(
        f"{path}, line {node.lineno}: {ast.unparse(node)[:60]!r} would have to be executed; write its value there"
    )


def _binary(node: ast.BinOp, names: Mapping[str, Any], path: Path) -> Any:
    left, right = (_numeric(_value(side, names, path), node, path) for side in (node.left, node.right))
    if isinstance(node.op, ast.Pow):  # of floats: 9**9**9 as whole numbers would fill the memory
        return _worked_out(lambda: np.asarray(left, float) ** np.asarray(right, float), node, path)
    if type(node.op) not in _OPERATORS:
        raise FormatError(
            f"{path}, line {node.lineno}: {ast.unparse(node)[:60]!r} is not understood; write its value there"
        )
    return _worked_out(lambda: _OPERATORS[type(node.op)](left, right), node, path)


def _numeric(value: Any, node: ast.expr, path: Path) -> Any:
    """A float, or an array of floats."""
    try:
        array = np.asarray(value, dtype=np.float64)
    except (TypeError, ValueError, OverflowError):
        raise FormatError(f"{path}, line {node.lineno}: {ast.unparse(node)[:60]!r} is not made of numbers") from None
    return float(array) if array.ndim == 0 else array


def _worked_out(work: Callable[[], Any], node: ast.expr, path: Path) -> Any:
    try:
        with np.errstate(all="ignore"):
            result = work()
    except (ArithmeticError, ValueError):
        raise FormatError(f"{path}, line {node.lineno}: {ast.unparse(node)[:60]!r} has no value") from None
    return float(result) if np.ndim(result) == 0 else result
