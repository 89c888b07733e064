"""Parameters of `drone-models` and `crazyflow` (TOML): one table a vehicle, with rpm2thrust, mixing_matrix, J and L."""

import math
import tomllib
from pathlib import Path
from typing import Any

import numpy as np

from flight import FormatError, InputError
from flight.frames import GRAVITY_M_S2
from flight.rotations import FloatArray
from flight.units import RAD_S_PER_RPM
from vehicle import Parameter
from vehicle.draft import Known
from vehicle.importers.import_betaflight import text_of


def read(path: Path) -> Known:
    """The vehicle of a file with one table.

    Raises:
        InputError: several vehicles, or a value is missing or no number.
        FormatError: it is no such file.
    """
    path = Path(path)
    try:
        document: Any = tomllib.loads(text_of(path))
    except tomllib.TOMLDecodeError as error:
        raise FormatError(f"{path} is not valid TOML: {error}") from None
    tables = {"": document} if "mass" in document else {k: v for k, v in document.items() if isinstance(v, dict)}
    tables = {name: table for name, table in tables.items() if "mass" in table and "mixing_matrix" in table}
    if not tables:
        raise FormatError(f"{path} holds no vehicle of drone-models: no table has mass and mixing_matrix")
    if len(tables) > 1:
        raise InputError(f"{path} holds {', '.join(tables)}; copy the table of one of them to a file of its own")
    ((name, given),) = tables.items()
    return _known(path, name, given)


def _known(path: Path, name: str, given: dict[str, Any]) -> Known:
    source = f"{path.name}{f', {name}' if name else ''}"
    mass_kg, arm_m = _number(path, given, "mass"), _number(path, given, "L")
    mixing, inertia = _matrix(path, given, "mixing_matrix", (3, 4)), _matrix(path, given, "J", (3, 3))
    k, torque = (_quadratic(path, given, key, mass_kg) for key in ("rpm2thrust", "rpm2torque"))
    parameters = {
        f"inertia_{axis}_kg_m2": Parameter(float(inertia[i, i]), 0.0, "kg m2", f"{source}, J")
        for i, axis in enumerate(("xx", "yy", "zz"))
    }
    parameters["thrust_quadratic.k_n_s2"] = Parameter(k, 0.0, "N s2", f"{source}, rpm2thrust at hover")
    parameters["rotor_yaw_torque.torque_n_m_s2"] = Parameter(torque, 0.0, "N m s2", f"{source}, rpm2torque at hover")
    if "thrust_tau" in given:
        for end in ("rise_s", "fall_s"):
            lag = Parameter(_number(path, given, "thrust_tau"), 0.0, "s", f"{source}, thrust_tau")
            parameters[f"motor_lag.{end}"] = lag
    radius = _number(path, given, "prop_radius") if "prop_radius" in given else None
    # rows of the mixing matrix are the signs of the torques about x, y and z that each rotor adds to
    hubs = arm_m * np.column_stack([-mixing[1], mixing[0], np.zeros(4)])
    return Known(
        name=name or path.stem,
        mass_kg=Parameter(mass_kg, 0.0, "kg", source),
        hub_body_m=hubs + 0.0,
        spin=-mixing[2],
        rotor_radius_m=None if radius is None else Parameter(radius, 0.0, "m", f"{source}, prop_radius"),
        parameters=parameters,
        notes=(f"rotors 0 to 3 are motors 1 to 4 of {source}; its thrust curve was taken at hover, as a square",),
    )


def _number(path: Path, given: dict[str, Any], key: str) -> float:
    value = given.get(key)
    if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value) or value <= 0.0:
        raise InputError(f"{path}: {key} is {value!r}; a positive number is expected")
    return float(value)


def _matrix(path: Path, given: dict[str, Any], key: str, shape: tuple[int, ...]) -> FloatArray:
    try:
        values = np.array(given.get(key), dtype=np.float64)
    except (TypeError, ValueError):
        values = np.empty(0)
    if values.shape != shape or not np.isfinite(values).all():
        raise InputError(f"{path}: {key} is {str(given.get(key))[:60]}; finite numbers of shape {shape} are expected")
    return values


def _quadratic(path: Path, given: dict[str, Any], key: str, mass_kg: float) -> float:
    """Value over the square of the rotor speed (rad/s) at hover, of a polynomial in rpm."""
    thrust, own = (_matrix(path, given, name, (3,)) for name in ("rpm2thrust", key))
    lift = np.roots((thrust - [mass_kg * GRAVITY_M_S2 / 4.0, 0.0, 0.0])[::-1])
    hover_rpm = max((float(root.real) for root in lift if abs(root.imag) < 1e-9), default=0.0)
    if hover_rpm <= 0.0:
        raise InputError(f"{path}: no rotor speed carries the weight by rpm2thrust = {thrust.tolist()}")
    return float(np.polyval(own[::-1], hover_rpm)) / (hover_rpm * RAD_S_PER_RPM) ** 2
