"""What is not known before a flight, drawn: the model's parameters, the air, the estimate, the map, the start.

Every factor has a stream of its own by seed and name, so that flight i of two preflights meets the same weather and the
same luck: two plans, or two models, are compared flight by flight (common random numbers). No bit of it depends on the
processor.
"""

import hashlib
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial

import numpy as np

from flight import FloatArray, InputError, portable
from preflight.core import DRAW_COLUMNS, GUSTS, WEAK, sensed
from vehicle import Parameter, Vehicle, invert, simulate, specs

CORRELATION = "correlation"
"""In a fitted model's provenance: `names`, and the `matrix` in their order."""
TOGETHER = 0.9
"""Parameters correlated at least so much are one factor: no flight tells them apart."""
DELAY_STD_S = 0.003
LOCALIZATION_STD_M = 0.02
"""Of what a camera's mounting and a localizer leave, each axis, in a map without an error of its own."""
LATEST_S = 0.2
"""Oldest pose that is simulated."""
LAGS = ("motor_lag.rise_s", "motor_lag.fall_s")
"""Unless a flight told them apart, one ignorance: drawn apart, they would lift the vehicle, as unequal lags rectify
the noise of its commands."""
_NAMED = 4
"""Standard deviations that are named in a sentence."""
_DELAY = "pose_delay.delay_s"
_BATTERY = "battery_sag"
BATTERY, MOTOR_FAULT, POSE_JUMP, THERMALS = "battery", "motor fault", "pose jump", "thermals"


@dataclass(frozen=True, slots=True)
class Uncertainty:
    """Standard deviations of what the model does not tell; the defaults are a good indoor vehicle's."""

    wind_m_s: float = 0.0
    """Mean wind."""
    wind_direction: tuple[float, float, float] | None = None
    """Where it blows to, a unit vector; None: anywhere in the horizontal plane."""
    wind_spread_ratio: float = 0.2
    """Of the mean wind, over its size."""
    gust_std_m_s: float = 0.0
    """Of Dryden gusts, each axis."""
    gust_spread_ratio: float = 0.2
    thermal_std_m_s: float = 0.0
    """Of a lasting vertical wind at 10 m height; it grows with the cube root of z, from none at z = 0."""
    pose_delay_s: float = 0.01
    """Told by the time stamps."""
    pose_delay_std_s: float | None = None
    """Of what they do not tell; None: the model's, or `DELAY_STD_S` where it has no effect pose_delay."""
    drop_outs_per_s: float = 0.0
    """How often the pose is missing."""
    drop_out_s: float = 0.1
    """... and how long."""
    localization_std_m: float | None = None
    """Of a lasting error of the pose in the map, each axis; None: `LOCALIZATION_STD_M`."""
    heading_std_rad: float = 0.01
    """Of a lasting error of the heading."""
    map_scale_std_ratio: float = 0.005
    """Of the map's scale."""
    map_error_std_m: float = 0.01
    """Of the map's surfaces."""
    start_std_m: float = 0.05
    """Of the hover point before the start, each axis."""
    start_yaw_std_rad: float = 0.05
    noise_ratio: float = 1.0
    """Of the estimate's white noise, over the sensors'."""
    rotor_wear_ratio: float = 0.01
    """Of the thrust of each rotor, over the model's: propellers wear."""
    battery_v: float | None = None
    """Lowest voltage at the start, from which up to full is as likely; it falls to empty by the energy of
    `vehicle.simulate.Battery`, of as many cells. None: full, and it stays so."""
    motor_fault_ratio: float = 0.0
    """Thrust that one of the rotors loses at some moment of the trajectory, any as likely: 0 to 1."""
    pose_jump_std_m: float = 0.0
    """Of a lasting jump of the pose, each axis, at some moment of the trajectory."""
    pose_of_map: bool = True
    """Whether the pose is one in the map, of the same scale; else a wrong scale moves what is in the map."""

    def __post_init__(self) -> None:
        for name in self.__slots__:
            value = getattr(self, name)
            if value is not None and name != "wind_direction" and not (np.isfinite(value) and value >= 0.0):
                raise InputError(f"{name} is {value}; it must be a finite number of at least 0")
        if self.motor_fault_ratio > 1.0:
            raise InputError(f"motor_fault_ratio is {self.motor_fault_ratio:g}; a rotor has no more than 1 to lose")
        if self.pose_delay_s > LATEST_S:
            raise InputError(f"pose_delay_s is {self.pose_delay_s:g}; at most {LATEST_S:g} s is simulated")
        if self.wind_direction is not None and not abs(np.linalg.norm(self.wind_direction) - 1.0) < 1e-6:
            raise InputError(f"wind_direction is {self.wind_direction}; it must be a unit vector")


@dataclass(frozen=True, slots=True, eq=False)
class Drawn:
    """n flights' draws."""

    values: FloatArray
    """(n, p) of the vehicle's parameters."""
    rows: FloatArray
    """(n, d) as `core.Loop.fly` takes them."""
    map_scale: FloatArray
    """(n,) true metres in one of the map's."""
    map_shift: FloatArray
    """(n,) true metres in one of the map's, for where it is: 1 if the pose is one in the map."""
    map_error_m: FloatArray
    """(n,) by which the surfaces are farther away than the map says."""
    factors: Mapping[str, FloatArray]
    """Name of an uncertainty to its (n, q) draws in standard deviations."""
    assumed: tuple[str, ...]
    """Sentences on what the model does not tell."""
    inputs: Mapping[str, FloatArray]
    """Name to the (n, columns) standard normal numbers that all this was made of."""


def flown_form(vehicle: Vehicle) -> Vehicle:
    """The vehicle with what wears and its model may lack: a thrust of each rotor of its own."""
    if WEAK in vehicle.effects:
        return vehicle
    return vehicle.with_effect(WEAK, loss_0=0.0, loss_1=0.0, loss_2=0.0, loss_3=0.0)


def draw(vehicle: Vehicle, names: tuple[str, ...], uncertainty: Uncertainty, count: int, seed: int) -> Drawn:
    """Draw `count` flights.

    Args:
        vehicle: as `flown_form` returns it.
        names: of the parameters, in the order of `core.Loop.names`.
    """
    return _drawn(vehicle, names, uncertainty, _Normals(count, partial(_stream, seed, count)))


def made_of(
    vehicle: Vehicle, names: tuple[str, ...], uncertainty: Uncertainty, inputs: Mapping[str, FloatArray]
) -> Drawn:
    """The flights of given standard normal numbers, of the names and columns of another draw's `Drawn.inputs`."""
    count = len(next(iter(inputs.values())))
    return _drawn(vehicle, names, uncertainty, _Normals(count, lambda name, columns: inputs[name]))


def _drawn(vehicle: Vehicle, names: tuple[str, ...], uncertainty: Uncertainty, draw_of: "_Normals") -> Drawn:
    count = draw_of.count
    values, factors, assumed = _parameters(vehicle, names, draw_of)
    _wear(values, names, uncertainty, draw_of, factors)
    rows = np.zeros((count, len(DRAW_COLUMNS)))
    column = {name: rows[:, i] for i, name in enumerate(DRAW_COLUMNS)}
    _air(column, uncertainty, draw_of, factors)
    _estimate(column, vehicle, uncertainty, draw_of, factors)
    _start(column, uncertainty, draw_of, factors)
    for i, speed in enumerate(invert.hover(vehicle)):
        column[f"hover{i}_rad_s"][:] = speed
    _battery(column, vehicle, uncertainty, draw_of, factors)
    _faults(column, uncertainty, draw_of, factors)
    width = uncertainty.map_scale_std_ratio
    scale = portable.exponential(width * draw_of.one("map scale", width, factors))
    error = uncertainty.map_error_std_m * draw_of.one("map surface", uncertainty.map_error_std_m, factors)
    shift = np.ones(count) if uncertainty.pose_of_map else scale
    said = assumed + _not_flown(vehicle, uncertainty)
    return Drawn(values, rows, scale, shift, error, factors, said, draw_of.inputs)


class _Normals:
    """Standard normal numbers by name, kept."""

    def __init__(self, count: int, source: Callable[[str, int], FloatArray]) -> None:
        self.count = count
        self.inputs: dict[str, FloatArray] = {}
        self._source = source

    def __call__(self, name: str, columns: int = 1) -> FloatArray:
        """(count, columns)."""
        self.inputs[name] = self._source(name, columns)
        return self.inputs[name]

    def one(self, name: str, std: float, factors: dict[str, FloatArray]) -> FloatArray:
        """(count,), kept as a factor unless its standard deviation is zero."""
        found = self(name)
        if std > 0.0:
            factors[name] = found
        return found[:, 0]

    def three(self, name: str, std: float, factors: dict[str, FloatArray]) -> FloatArray:
        found = self(name, 3)
        if std > 0.0:
            factors[name] = found
        return found


def _stream(seed: int, count: int, name: str, columns: int) -> FloatArray:
    """(count, columns); the first rows do not depend on the count."""
    digest = hashlib.sha256(name.encode()).digest()
    key = np.array([seed, int.from_bytes(digest[:8], "little")], np.uint64)
    return np.random.Generator(np.random.Philox(key=key)).standard_normal((count, columns))


def _parameters(
    vehicle: Vehicle, names: tuple[str, ...], draw_of: _Normals
) -> tuple[FloatArray, dict[str, FloatArray], tuple[str, ...]]:
    """Values (n, p), and the factors of those that are uncertain."""
    values = np.repeat([[vehicle.value(name) for name in names]], draw_of.count, axis=0)
    uncertain = [name for name in names if vehicle.parameter(name).std > 0.0]
    if not uncertain:
        return values, {}, (f"{vehicle.name} states no uncertainty of its parameters: they are flown as exact; "
                            "`goshawk identify` tells their standard errors",)  # fmt: skip
    correlation, alone = correlations(vehicle, uncertain)
    normal = portable.product(np.concatenate([draw_of(name) for name in uncertain], axis=1), _root(correlation).T)
    bounds = specs(vehicle)
    for j, name in enumerate(uncertain):
        values[:, names.index(name)] = _physical(vehicle.parameter(name), bounds[name].bounds, normal[:, j])
    _rigid(values, names)
    factors = {" with ".join(uncertain[j] for j in group): normal[:, group] for group in _groups(correlation)}
    said = () if not alone else (
        f"of {len(alone)} of {len(uncertain)} standard errors ({alone[0]}) the correlation is not known: drawn "
        "independently, they overstate what they do together; fit all again with `goshawk identify`",)  # fmt: skip
    return values, factors, said + _unidentified(vehicle, uncertain)


def _unidentified(vehicle: Vehicle, names: list[str]) -> tuple[str, ...]:
    """A sentence on the standard deviations that no identification gave, the largest first; none where all did."""
    wide = {
        name: parameter.std / abs(parameter.value) if parameter.value else np.inf
        for name in names
        if not _is_identified(parameter := vehicle.parameter(name))
    }
    if not wide:
        return ()
    told = [_plus_minus(vehicle, name, wide[name]) for name in sorted(wide, key=lambda name: -wide[name])]
    more = f" and {len(told) - _NAMED} more" if len(told) > _NAMED else ""
    return (
        f"not identified, flown as widely as the vehicle file assumes: {', '.join(told[:_NAMED])}{more}; "
        "`goshawk identify` tells those that a log shows",
    )


def _plus_minus(vehicle: Vehicle, name: str, ratio: float) -> str:
    if np.isfinite(ratio):
        return f"{name} ±{100.0 * ratio:.2g} %"
    parameter = vehicle.parameter(name)
    return f"{name} ±{parameter.std:.2g} {parameter.unit}".removesuffix(" 1")


def _is_identified(parameter: Parameter) -> bool:
    return parameter.source.startswith("identified")


def _physical(parameter: Parameter, bounds: tuple[float, float], normal: FloatArray) -> FloatArray:
    """Draws (n,) with the parameter's mean and standard deviation; log-normal where it can only be positive."""
    value, std = parameter.value, parameter.std
    if bounds[0] > 0.0 or (bounds[0] == 0.0 and std < value):
        width = np.sqrt(portable.logarithm(1.0 + (std / value) ** 2))
        return np.clip(value * portable.exponential(width * normal - 0.5 * width * width), *bounds)
    return np.clip(value + std * normal, *bounds)


def _rigid(values: FloatArray, names: tuple[str, ...]) -> None:
    """No moment of inertia may exceed the sum of the other two."""
    places = [names.index(f"inertia_{axis}_kg_m2") for axis in ("xx", "yy", "zz")]
    for i in places:
        a, b = (j for j in places if j != i)
        values[:, i] = np.minimum(values[:, i], values[:, a] + values[:, b])


def correlations(vehicle: Vehicle, names: list[str]) -> tuple[FloatArray, list[str]]:
    """(k, k) between parameters, the identity where the model does not tell it (but 1 between `LAGS` that no flight
    told); and those that it should tell of."""
    known, matrix = _told(vehicle)
    identified = [name for name in names if _is_identified(vehicle.parameter(name))]
    fitted = [name for name in identified if name in known]
    found = np.eye(len(names))
    at, of = [names.index(name) for name in fitted], [known.index(name) for name in fitted]
    found[np.ix_(at, at)] = matrix[np.ix_(of, of)]
    tied = set(LAGS) if set(LAGS) <= set(names) - set(identified) else set()
    together = [i for i, name in enumerate(names) if name in tied]
    found[np.ix_(together, together)] = 1.0
    left = [name for name in identified if name not in known] if fitted else names
    return found, [name for name in left if name not in tied]


def _told(vehicle: Vehicle) -> tuple[list[str], FloatArray]:
    """Names and matrix in the model's provenance; empty where there is none that can be read."""
    told, nothing = vehicle.provenance.get(CORRELATION), ([], np.zeros((0, 0)))
    if not isinstance(told, Mapping):
        return nothing
    try:
        names, matrix = [str(name) for name in told["names"]], np.asarray(told["matrix"], dtype=np.float64)
    except (KeyError, TypeError, ValueError):
        return nothing
    if matrix.shape != (len(names), len(names)) or not (np.abs(matrix) <= 1.0 + 1e-6).all():
        return nothing
    return names, matrix


def _root(correlation: FloatArray) -> FloatArray:
    """A matrix whose square is the correlation, with unit rows; also of one that rounding made slightly indefinite."""
    size, vectors = portable.symmetric_eigen(correlation)
    root = portable.product(vectors * np.sqrt(np.maximum(size, 0.0)), vectors.T)
    return root / portable.length(root)[:, None]


def _groups(correlation: FloatArray) -> list[list[int]]:
    """Parameters that are told together only."""
    left, found = list(range(len(correlation))), []
    while left:
        group, new = [], [left.pop(0)]
        while new:
            group += new
            new = [j for j in left if (np.abs(correlation[group, j]) >= TOGETHER).any()]
            left = [j for j in left if j not in new]
        found.append(sorted(group))
    return found


def _wear(
    values: FloatArray, names: tuple[str, ...], given: Uncertainty, draw_of: _Normals, factors: dict[str, FloatArray]
) -> None:
    worn = draw_of("rotor wear", 4)
    for i in range(4):
        values[:, names.index(f"{WEAK}.loss_{i}")] += given.rotor_wear_ratio * worn[:, i]
    if given.rotor_wear_ratio > 0.0:
        factors["rotor wear"] = worn


def _air(
    column: Mapping[str, FloatArray], given: Uncertainty, draw_of: _Normals, factors: dict[str, FloatArray]
) -> None:
    size = given.wind_m_s * np.maximum(1.0 + given.wind_spread_ratio * draw_of("wind")[:, 0], 0.0)
    direction = draw_of("wind direction", 2)
    direction = direction / np.maximum(np.linalg.norm(direction, axis=1, keepdims=True), 1e-12)
    wind = np.column_stack([direction, np.zeros(draw_of.count)])
    if given.wind_direction is not None:
        wind[:] = given.wind_direction
    wind *= size[:, None]
    for i, axis in enumerate("xyz"):
        column[f"wind_{axis}_m_s"][:] = wind[:, i]
    if given.wind_m_s > 0.0:
        factors["wind"] = wind[:, wind.any(axis=0)] / given.wind_m_s
    spread = draw_of("gusts")[:, 0]
    column["gust_std_m_s"][:] = given.gust_std_m_s * np.maximum(1.0 + given.gust_spread_ratio * spread, 0.0)
    if given.gust_std_m_s > 0.0:
        factors[GUSTS] = spread[:, None]
    if given.thermal_std_m_s > 0.0:
        column["updraft_m_s"][:] = given.thermal_std_m_s * draw_of.one(THERMALS, given.thermal_std_m_s, factors)


def _estimate(
    column: Mapping[str, FloatArray],
    vehicle: Vehicle,
    given: Uncertainty,
    draw_of: _Normals,
    factors: dict[str, FloatArray],
) -> None:
    untold_s, std_s = _untold_delay(vehicle, given)
    late = untold_s + std_s * draw_of.one("pose delay", std_s, factors)
    column["pose_delay_s"][:] = np.clip(given.pose_delay_s + late, 0.0, LATEST_S)
    std_m = LOCALIZATION_STD_M if given.localization_std_m is None else given.localization_std_m
    bias = std_m * draw_of.three("localization", std_m, factors)
    for i, axis in enumerate("xyz"):
        column[f"bias_{axis}_m"][:] = bias[:, i]
    turned = draw_of.one("heading", given.heading_std_rad, factors)
    column["heading_bias_rad"][:] = given.heading_std_rad * turned
    column["drop_outs_per_s"][:] = given.drop_outs_per_s
    column["drop_out_s"][:] = given.drop_out_s


def _untold_delay(vehicle: Vehicle, given: Uncertainty) -> tuple[float, float]:
    """Mean and standard deviation of what the pose is older than its stamp, in seconds."""
    told = vehicle.parameters.get(_DELAY)
    std_s = DELAY_STD_S if told is None else told.std
    return 0.0 if told is None else told.value, std_s if given.pose_delay_std_s is None else given.pose_delay_std_s


def _not_flown(vehicle: Vehicle, given: Uncertainty) -> tuple[str, ...]:
    """Sentences on the model's effects that are not flown; empty if all are."""
    left = [name for name in sensed(vehicle) if name != _DELAY.split(".")[0]]
    said = [f"flown without {', '.join(left)}: no error of the IMU is simulated"] if left else []
    if _BATTERY in vehicle.effects and given.battery_v is None:
        said.append("flown with a full battery (--battery: the lowest voltage at the start)")
    if _BATTERY in vehicle.effects and given.battery_v is not None:
        (full_v, empty_v), energy_kj = _pack_v(vehicle), 1e-3 * simulate.Battery().energy_j
        said.append(f"a battery of {energy_kj:g} kJ at the rotors from {full_v:.1f} to {empty_v:.1f} V")
    return tuple(said)


def _battery(
    column: Mapping[str, FloatArray],
    vehicle: Vehicle,
    given: Uncertainty,
    draw_of: _Normals,
    factors: dict[str, FloatArray],
) -> None:
    """Voltages, which act through the model's effect alone.

    Raises:
        InputError: one is given, and the model has no such effect, or it is not between the pack's empty and full.
    """
    if given.battery_v is None:
        column["battery_v"][:] = vehicle.value(f"{_BATTERY}.reference_v") if _BATTERY in vehicle.effects else 0.0
        return
    if _BATTERY not in vehicle.effects:
        raise InputError(
            f"{vehicle.name} has no effect {_BATTERY}, which tells what {given.battery_v:g} V do: fit it from a long "
            "hover (goshawk vehicle effect), or leave out the battery's voltage"
        )
    full_v, empty_v = _pack_v(vehicle)
    if not empty_v <= given.battery_v <= full_v:
        raise InputError(
            f"a battery of at least {given.battery_v:g} V; it must be from {empty_v:.1f} to {full_v:g} V, which "
            f"{vehicle.name} takes for full ({_BATTERY}.reference_v): give --battery between them, or leave it out"
        )
    normal = draw_of.one(BATTERY, full_v - given.battery_v, factors)
    column["battery_v"][:] = full_v - (full_v - given.battery_v) * portable.normal_share(normal)
    column["battery_fall_v_j"][:] = (full_v - empty_v) / simulate.Battery().energy_j
    column["battery_empty_v"][:] = empty_v


def _pack_v(vehicle: Vehicle) -> tuple[float, float]:
    """Full and empty: those of `simulate.Battery` for as many cells."""
    pack, full_v = simulate.Battery(), vehicle.value(f"{_BATTERY}.reference_v")
    return full_v, pack.empty_v * full_v / pack.full_v


def _faults(
    column: Mapping[str, FloatArray], given: Uncertainty, draw_of: _Normals, factors: dict[str, FloatArray]
) -> None:
    """Of a rotor and of the pose: which, how much, and when as a share of the trajectory's time."""
    if given.motor_fault_ratio > 0.0:
        rotor, at = portable.normal_share(draw_of(MOTOR_FAULT, 2)).T
        struck = np.minimum(np.floor(4.0 * rotor), 3.0)
        sides = np.array([[-1.0, -1.0], [-1.0, 1.0], [1.0, -1.0], [1.0, 1.0]])[struck.astype(int)]
        factors[MOTOR_FAULT] = np.column_stack([sides, at - 0.5])  # with products, whatever depends on the rotor alone
        column["fault_rotor"][:] = struck
        column["fault_at"][:] = at
        column["fault_ratio"][:] = given.motor_fault_ratio
    if given.pose_jump_std_m > 0.0:
        jump = draw_of(POSE_JUMP, 4)
        factors[POSE_JUMP] = jump
        for i, axis in enumerate("xyz"):
            column[f"jump_{axis}_m"][:] = given.pose_jump_std_m * jump[:, i]
        column["jump_at"][:] = portable.normal_share(jump[:, 3])


def _start(
    column: Mapping[str, FloatArray], given: Uncertainty, draw_of: _Normals, factors: dict[str, FloatArray]
) -> None:
    off = given.start_std_m * draw_of.three("start", given.start_std_m, factors)
    for i, axis in enumerate("xyz"):
        column[f"start_{axis}_m"][:] = off[:, i]
    turned = given.start_yaw_std_rad * draw_of("start heading")[:, 0]
    column["start_yaw_rad"][:] = turned


def hover_in_wind(vehicle: Vehicle, wind_m_s: float) -> tuple[float, float]:
    """Tilt (rad) and rotor reserve (ratio) of a hover in a steady wind from ahead: level flight at that speed.

    The reserve is NaN where the rotors cannot do it at all.
    """
    from flight import Trajectory
    from vehicle import flatness

    coefficients = np.zeros((1, 4, 2))
    coefficients[0, 0, 1] = wind_m_s
    flat = flatness.state(vehicle, Trajectory(np.array([1.0]), coefficients), np.array([0.5]))
    return float(flat.tilt_rad[0]), float(vehicle.limits.rotor_margin(flat.rotor_speed_rad_s)[0])
