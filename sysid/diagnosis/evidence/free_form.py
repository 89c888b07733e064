"""What could be explained at all: smooth curves of one variable in one channel, with no physics in them.

A named effect must explain at least as much as the best of these, or it is not the one that is missing.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from flight import rotations
from flight.flight_log import MOST_ROTORS
from flight.rotations import FloatArray
from sysid.estimator.flights.flight_data import Flight, IndexArray
from sysid.estimator.motors import motor
from sysid.estimator.result import CHANNELS
from sysid.estimator.trajectory.midpoint import Middle, middle
from sysid.estimator.trajectory.model import slopes_along
from sysid.estimator.trajectory.states import States
from vehicle import Vehicle, rigid_body

Read = Callable[[Flight, Middle], FloatArray]


def _rotor(i: int) -> Read:
    return lambda flight, mid: flight.rotor_speed_rad_s[:, i]


def _spin_up(i: int) -> Read:
    return lambda flight, mid: flight.rotor_acceleration_rad_s2[:, i]


def _command_rate(i: int) -> Read:
    return lambda flight, mid: np.gradient(
        flight.rotor_command_rad_s[:, i], 0.5 * (flight.time_s[1:] + flight.time_s[:-1])
    )


@dataclass(frozen=True, slots=True)
class Variable:
    """One thing a residual may depend on."""

    name: str
    unit: str
    read: Read
    """(k,) its value in the middle of each interval."""
    functions: int
    """How many B-splines span its range."""
    rotor: int = -1
    """Which one it is of; -1: none."""
    of_commands: bool = False
    """Whether it says something only where rotor speed is simulated from commands."""


def _axis(quantity: str, i: int) -> Read:
    return lambda flight, mid: getattr(mid, quantity)[:, i]


def _product(i: int, j: int) -> Read:
    return lambda flight, mid: mid.velocity_body_m_s[:, i] * mid.velocity_body_m_s[:, j]


VARIABLES: tuple[Variable, ...] = (
    Variable("constant", "", lambda flight, mid: np.zeros(len(mid.step_s)), 1),
    Variable("time", "s", lambda flight, mid: 0.5 * (flight.time_s[1:] + flight.time_s[:-1]) - flight.time_s[0], 16),
    Variable("x", "m", _axis("position_world_m", 0), 8),
    Variable("y", "m", _axis("position_world_m", 1), 8),
    Variable("height", "m", _axis("position_world_m", 2), 5),
    *(Variable(f"v_{a}", "m/s", _axis("velocity_body_m_s", i), 6) for i, a in enumerate("xyz")),
    *(Variable(f"v_{'xyz'[i]} v_{'xyz'[j]}", "m2/s2", _product(i, j), 4) for i, j in ((0, 1), (0, 2), (1, 2))),
    Variable("speed", "m/s", lambda flight, mid: np.linalg.norm(mid.velocity_body_m_s, axis=1), 5),
    *(Variable(f"w_{a}", "rad/s", _axis("rate_body_rad_s", i), 4) for i, a in enumerate("xyz")),
    *(Variable(f"n_{i}", "rad/s", _rotor(i), 9, rotor=i) for i in range(MOST_ROTORS)),
    *(Variable(f"dn_{i}/dt", "rad/s2", _spin_up(i), 4, rotor=i) for i in range(MOST_ROTORS)),
    *(Variable(f"dc_{i}/dt", "rad/s2", _command_rate(i), 4, i, of_commands=True) for i in range(MOST_ROTORS)),
    Variable("voltage", "V", lambda flight, mid: flight.battery_v, 5, of_commands=True),
    Variable("heading", "rad", lambda flight, mid: rotations.yaw(mid.q_world_body), 5),
)
"""What curves are drawn against: velocity and rate in body axes, position in world axes, time since take-off;
n rotor speed, c its command."""

VARIABLE = {v.name: v for v in VARIABLES}


@dataclass(frozen=True, slots=True)
class RotorVariable:
    """One thing that each rotor has of its own."""

    name: str
    unit: str
    read: Callable[[Flight, Middle, Vehicle], FloatArray]
    """(k, r) its value in the middle of each interval."""
    functions: int


def _downstream(flight: Flight, mid: Middle, vehicle: Vehicle) -> FloatArray:
    arm = (vehicle.hub_body_m - rigid_body(vehicle).centre_of_mass_m)[:, :2]
    return -mid.velocity_body_m_s[:, :2] @ (arm / np.linalg.norm(arm, axis=1, keepdims=True)).T


@dataclass(frozen=True, slots=True)
class LevelVariable:
    """One thing that both level axes of the body have of their own."""

    name: str
    unit: str
    carrier: Callable[[Flight, Middle], FloatArray]
    """(k,) what the level airspeed is multiplied by."""
    functions: int = 5

    def read(self, flight: Flight, mid: Middle) -> FloatArray:
        """(k, 2) its value in the middle of each interval."""
        return self.carrier(flight, mid)[:, None] * mid.velocity_body_m_s[:, :2]


LEVEL = (
    LevelVariable("v level", "m/s", lambda flight, mid: np.ones(len(mid.step_s))),
    LevelVariable("n v level", "m/s rad/s", lambda flight, mid: flight.rotor_speed_rad_s.mean(axis=1)),
    LevelVariable("|v| v level", "m2/s2", lambda flight, mid: np.linalg.norm(mid.velocity_body_m_s, axis=1)),
)
"""The airspeed along each level axis, alone or with what carries it."""
LEVEL_OWN = {v.name: v for v in LEVEL}

PER_ROTOR = (
    RotorVariable("n", "rad/s", lambda flight, mid, vehicle: flight.rotor_speed_rad_s, 9),
    RotorVariable("s", "m/s", _downstream, 6),
)
"""Its speed n, and s, the speed at which the wake of the others comes towards it: -v_xy along its arm."""
ROTORS_OWN = {v.name: v for v in PER_ROTOR}
UNIT = {v.name: v.unit for v in (*VARIABLES, *PER_ROTOR)}
"""Of every variable."""

THRUST = "T"
"""Thrust of every rotor, by one law for all: a curve is the share of its thrust that a rotor gains or loses. It shows
in F_z, and by the arms in M_x and M_y, as no curve of a single channel does. (Drag that grows with thrust follows too,
by far less.)"""
ROTORS = tuple(f"{THRUST}_{i}" for i in range(MOST_ROTORS))
"""The same of one rotor alone, against its own speed; a vehicle has the first few of them."""
OF_THRUST = (*ROTORS_OWN, "v_z", "speed", "height")
SHOWN_BY_THRUST = ("F_z", "M_x", "M_y")

LIFT = "L"
"""Thrust that every rotor gains alike, in newtons, whatever its own: lift by the flow. Where the centre of mass is not
in the middle of the hubs it shows in M_x and M_y too, unlike a curve of F_z, and unlike a share of thrusts that balance
there."""
GAIN = "thrust_affine.constant_n"
"""Parameter whose derivative says what that does."""
OF_LIFT = ("v_z", "speed", "height")

WORLD = ("F_x_world", "F_y_world")
"""Level forces along the axes of the world: a tether, a draught, a slope of the floor pull so whatever the heading."""
OF_THE_WORLD = ("constant", "time", "x", "y", "height")
"""What such a force may depend on; a constant one is what a pose frame that is not level shows."""
EVERY_CHANNEL = (*CHANNELS, *WORLD, THRUST, *ROTORS, LIFT)
DRAG = "drag"
"""Level force along both axes of the body by one law for both: what forms of drag are made of. It is asked what a drag
in the model leaves of its own physics, which a curve along one axis cannot take over from it; it is never named."""


def losses(vehicle: Vehicle) -> tuple[str, ...]:
    """Parameters whose derivatives say what a share of a rotor's thrust does."""
    return tuple(f"weak_rotor.loss_{i}" for i in range(vehicle.rotors))


def channels_of(vehicle: Vehicle) -> tuple[str, ...]:
    """Those of `EVERY_CHANNEL` that a vehicle has."""
    return tuple(name for name in EVERY_CHANNEL if name not in ROTORS[vehicle.rotors :])


def belongs(variable: str, channel: str) -> bool:
    """Whether curves of a variable are drawn in a channel."""
    if channel == DRAG or variable in LEVEL_OWN:
        return channel == DRAG and variable in LEVEL_OWN
    if channel in CHANNELS:
        return variable not in ROTORS_OWN
    if channel in WORLD:
        return variable in OF_THE_WORLD
    if channel == LIFT:
        return variable in OF_LIFT
    return variable in OF_THRUST if channel == THRUST else variable == f"n_{channel[2]}"


def of_thrust(channel: str) -> bool:
    """Whether curves in a channel change the thrust of rotors, and so show in several channels in body axes."""
    return channel[0] in (THRUST, LIFT)


def axes_of(channel: str) -> tuple[str, ...]:
    """Which of the six channels in body axes a curve in a channel shows in."""
    if channel in WORLD:
        return ("F_x", "F_y")
    return (channel,) if channel in CHANNELS else SHOWN_BY_THRUST


def unit(channel: str) -> str:
    """Of a curve: a share of the thrust, a force or a torque."""
    return "1" if channel[0] == THRUST else "N m" if channel[0] == "M" else "N"


def along_axes(channel: str, mid: Middle) -> tuple[IndexArray, FloatArray]:
    """Which of the six accelerations (force, then torque, in body axes) a channel moves, and (k, 1 or 3) how much."""
    if channel in CHANNELS:
        return np.array([CHANNELS.index(channel)]), np.ones((len(mid.step_s), 1))
    return np.arange(3), mid.R_world_body[:, "xyz".index(channel[2])]


@dataclass(frozen=True, slots=True)
class Curve:
    """A family of curves of one variable: cubic B-splines over the range that was flown."""

    variable: str
    knots: FloatArray

    def basis(self, values: FloatArray) -> FloatArray:
        """(k, functions); values beyond the range are taken at its end."""
        from scipy.interpolate import BSpline

        if self.variable == "constant":
            return np.ones((len(values), 1))
        low, high = self.knots[3], self.knots[-4]
        inside = np.clip(values, low, high)
        return BSpline.design_matrix(inside, self.knots, 3).toarray()

    @property
    def functions(self) -> int:
        return 1 if self.variable == "constant" else len(self.knots) - 4


def curves(flights: Sequence[Flight], states: Sequence[States], vehicle: Vehicle) -> tuple[Curve, ...]:
    """Curve families whose knots follow what was flown; variables that hardly changed are left out."""
    driven = [motor.driven(f, vehicle) for f in flights]
    mids = [middle(f, s) for f, s in zip(driven, states, strict=True)]
    found = []
    for variable in PER_ROTOR:
        values = np.concatenate([variable.read(f, m, vehicle).ravel() for f, m in zip(driven, mids, strict=True)])
        family = curves_of(variable, values)
        if family is not None:
            found.append(family)
    for variable in LEVEL:
        values = np.concatenate([variable.read(f, m).ravel() for f, m in zip(driven, mids, strict=True)])
        family = curves_of(variable, values)
        if family is not None:
            found.append(family)
    by_command = any(f.driven_by_command for f in flights)
    for variable in (v for v in VARIABLES if (by_command or not v.of_commands) and v.rotor < vehicle.rotors):
        values = np.concatenate([variable.read(f, m) for f, m in zip(driven, mids, strict=True)])
        family = curves_of(variable, values)
        if family is not None:
            found.append(family)
    return tuple(found)


def curves_of(variable: Variable | RotorVariable | LevelVariable, values: FloatArray) -> Curve | None:
    """Curves of one variable over the range of its values; none if it hardly changes, or was not logged."""
    if variable.name == "constant":
        return Curve("constant", np.zeros(0))
    if not np.isfinite(values).all():
        return None
    low, high = np.quantile(values, [0.005, 0.995])
    if high - low <= 1e-9:
        return None
    inner = np.linspace(low, high, variable.functions - 2)
    return Curve(variable.name, np.concatenate([np.full(3, low), inner, np.full(3, high)]))


def columns(curves_: Sequence[Curve], flight: Flight, mid: Middle) -> FloatArray:
    """(k, c) all families side by side along one flight."""
    return np.concatenate([c.basis(VARIABLE[c.variable].read(flight, mid)) for c in curves_], axis=1)


def accelerations(
    channel: str, curves_: Sequence[Curve], flight: Flight, mid: Middle, vehicle: Vehicle
) -> tuple[IndexArray, FloatArray]:
    """Which of the six accelerations curves in a channel move, and (k, r, c) by how much each function does.

    Args:
        vehicle: with the effects `weak_rotor` and `thrust_affine`, by whose parameters thrust is changed.
    """
    if channel == DRAG:
        values = [LEVEL_OWN[c.variable].read(flight, mid) for c in curves_]
        both = list(zip(curves_, values, strict=True))
        along = [np.concatenate([c.basis(v[:, i]) for c, v in both], axis=1) for i in (0, 1)]
        return np.arange(2), np.stack(along, axis=1)
    if not of_thrust(channel):
        which, share = along_axes(channel, mid)
        return which, share[:, :, None] * columns(curves_, flight, mid)[:, None]
    which = np.flatnonzero([name in SHOWN_BY_THRUST for name in CHANNELS])
    if channel == LIFT:
        by_gain = slopes_along(vehicle, (GAIN,), flight, mid).parameters
        return which, by_gain[:, which] * columns(curves_, flight, mid)[:, None]
    by_share = -slopes_along(vehicle, losses(vehicle), flight, mid).parameters
    rotors = range(vehicle.rotors) if channel == THRUST else [int(channel[2])]
    drawn = [by_share[:, which, i, None] * _of_rotor(i, curves_, flight, mid, vehicle)[:, None] for i in rotors]
    return which, np.sum(drawn, axis=0)


def _of_rotor(i: int, curves_: Sequence[Curve], flight: Flight, mid: Middle, vehicle: Vehicle) -> FloatArray:
    """(k, c) all families along one flight, as one rotor has their variables."""
    parts = []
    for curve in curves_:
        own = ROTORS_OWN.get(curve.variable)
        values = own.read(flight, mid, vehicle)[:, i] if own else VARIABLE[curve.variable].read(flight, mid)
        parts.append(curve.basis(values))
    return np.concatenate(parts, axis=1)
