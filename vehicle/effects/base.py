"""What an effect is: a small function that adds to a flow, with parameters, a source and the manoeuvres that excite it.

Arrays inside effects keep their components first and the instants last, `(3, n)` and, of r rotors, `(r, n)`, so that
formulas read as in the papers (`v_x, v_y, v_z = flow.velocity_m_s`); a parameter may be one number or one per instant.
Every function must also accept complex numbers (derivatives are checked by complex steps): use `magnitude`,
`length`, `positive` and `clipped` of this module instead of `abs`, `norm`, `maximum` and `clip`.
"""

from collections.abc import Callable
from dataclasses import dataclass, field
from enum import IntEnum
from types import SimpleNamespace
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[Any]
"""float64, or complex128 while a derivative is taken."""

Values = SimpleNamespace
"""An effect's parameter values by name; each a number, or (n,) with one value per instant."""


class Stage(IntEnum):
    """When an effect acts; effects of a vehicle are ordered by stage, then as the vehicle file lists them."""

    MASS = 0
    """Changes mass, inertia or centre of mass (acts on a `RigidBody`)."""
    COMMAND = 1
    """Changes the rotor speed command that reaches the motors (acts on a `Drive`)."""
    DRIVE = 2
    """From command to rotor acceleration (acts on a `Drive`)."""
    AIR = 3
    """Changes the air speed that the other effects use."""
    THRUST = 4
    """Adds to the thrust of each rotor."""
    THRUST_FACTOR = 5
    """Scales the thrust the earlier effects have made."""
    FORCE = 6
    """Adds force and torque, once thrust is known."""
    SENSOR = 7
    """Changes what a sensor reports, not what the vehicle does (acts on a `Reading`)."""


@dataclass(slots=True)
class RigidBody:
    """Mass properties. Effects of stage MASS change them in place."""

    mass_kg: Any
    inertia_kg_m2: Array
    """(3, 3) or (3, 3, n), about the centre of mass, body axes."""
    centre_of_mass_m: Array
    """(3,) or (3, n), from the middle of the hubs, body axes."""


@dataclass(slots=True)
class Drive:
    """The motors. Effects change `command_rad_s` (stage COMMAND) or set `acceleration_rad_s2` (stage DRIVE)."""

    command_rad_s: Array
    """(r, n) commanded rotor speed."""
    speed_rad_s: Array
    """(r, n) rotor speed."""
    battery_v: Any
    """Battery voltage, a number or (n,)."""
    acceleration_rad_s2: Array | None = None
    """(r, n) rotor acceleration, or None: the rotors follow the command at once."""


@dataclass(slots=True)
class Reading:
    """What the sensors report at n instants. Effects of stage SENSOR change it in place."""

    gyroscope_rad_s: Array
    """(3, n)."""
    accelerometer_m_s2: Array
    """(3, n) specific force."""
    angular_acceleration_rad_s2: Array
    """(3, n) of the body: what a sensor away from the centre of mass feels; not reported."""
    pose_age_s: Any = 0.0
    """Age of the pose at its time stamp."""


@dataclass(slots=True)
class Flow:
    """Motion of vehicle and rotors through the air at n instants, and the sums of the effects so far."""

    velocity_m_s: Array
    """(3, n) velocity of the centre of mass relative to the air, body axes."""
    rate_rad_s: Array
    """(3, n) body rate."""
    rotor_speed_rad_s: Array
    """(r, n), positive for every rotor whatever its spin."""
    hub_m: Array
    """(3, r, n or 1) hubs from the centre of mass, body axes."""
    spin: Array
    """(r, 1): +1 turns counter-clockwise seen from above, -1 clockwise."""
    radius_m: Any
    """Rotor radius."""
    air_density_kg_m3: Any
    q_world_body: Array | None = None
    """(4, n) attitude, when the caller gave it."""
    height_m: Array | None = None
    """(n,) height of the hubs above the ground, when the caller gave it."""
    ceiling_gap_m: Array | None = None
    """(n,) free height above the hubs, when the caller gave it."""
    rotor_acceleration_rad_s2: Array | None = None
    """(r, n), when the caller gave it."""
    tilt: Array | None = None
    """(3, 3, r) rotation from each rotor's axes, z along its thrust, to body axes; None: all thrust along body z."""
    thrust_n: Array = field(init=False)
    """(r, n) sum so far of the thrust of each rotor along its axis, at its hub."""
    hub_force_n: Array = field(init=False)
    """(3, r, n) sum so far of other forces that act at the hubs, in each rotor's axes."""
    force_n: Array = field(init=False)
    """(3, n) sum so far of forces at the centre of mass, body axes."""
    torque_n_m: Array = field(init=False)
    """(3, n) sum so far of torques, body axes."""

    def __post_init__(self) -> None:
        rotors, n = len(self.rotor_speed_rad_s), self.velocity_m_s.shape[-1]
        dtype = np.result_type(self.velocity_m_s, self.hub_m)
        self.thrust_n = np.zeros((rotors, n), dtype)
        self.hub_force_n = np.zeros((3, rotors, n), dtype)
        self.force_n = np.zeros((3, n), dtype)
        self.torque_n_m = np.zeros((3, n), dtype)

    def hub_velocity_m_s(self) -> Array:
        """(3, r, n) velocity of each hub relative to the air, in its rotor's axes."""
        body = self.velocity_m_s[:, None] + cross(self.rate_rad_s[:, None], self.hub_m)
        return body if self.tilt is None else np.einsum("jir,jrn->irn", self.tilt, body)

    def add_rotor_torque(self, axis: int, coefficient: Any, of_rotors: Array) -> None:
        """Add `coefficient` times (r, n), each about the x, y or z (`axis` 0, 1, 2) of its rotor's own axes."""
        if self.tilt is None:
            self.torque_n_m[axis] += coefficient * of_rotors.sum(axis=0)
        else:
            self.torque_n_m += coefficient * np.einsum("ir,rn->in", self.tilt[:, axis], of_rotors)


Scaling = tuple[float, float, float]
"""How a usual size grows from one vehicle to the next: as powers of mass, arm and hover rotor speed (rad/s)."""
SAME: Scaling = (0.0, 0.0, 0.0)
"""A ratio, or what comes from the world: the same on every vehicle."""
OF_THRUST: Scaling = (1.0, 0.0, 0.0)
"""A force that is a share of the weight."""
PER_ROTOR_SPEED: Scaling = (1.0, 0.0, -1.0)
"""A force per rotor speed that is a share of the weight at hover."""
PER_ROTOR_SPEED_SQUARED: Scaling = (1.0, 0.0, -2.0)
"""The same per square of rotor speed; also a rotor's moment per rotor speed and air speed."""
ADVANCE: Scaling = (0.0, -1.0, -1.0)
"""A share of thrust per air speed, which counts in tip speeds (`arm * rotor speed`)."""
BLADE: Scaling = (1.0, -1.0, -2.0)
"""A force per rotor speed and air speed: thrust times air speed over tip speed."""
ADVANCE_OF_WEIGHT: Scaling = (1.0, -1.0, -1.0)
"""A force per air speed: a share of the weight over tip speed."""
ADVANCE_SQUARED: Scaling = (1.0, -2.0, -2.0)
"""A force per square of air speed that comes from the rotors."""
AREA: Scaling = (0.0, 2.0, 0.0)
"""A force per square of air speed that comes from the airframe, in the same air."""
VOLUME: Scaling = (0.0, 3.0, 0.0)
"""The moment of such a force."""
LENGTH: Scaling = (0.0, 1.0, 0.0)
INERTIA: Scaling = (1.0, 2.0, 0.0)
YAW: Scaling = (1.0, 1.0, -2.0)
"""A torque per square of rotor speed that is a share of weight times arm."""
DAMPING: Scaling = (1.0, 1.0, -1.0)
"""A torque per body rate, from rotors that rise and sink at the ends of the arms."""
DAMPING_SQUARED: Scaling = (0.0, 5.0, 0.0)
"""A torque per square of the body rate, from an airframe in the same air."""


@dataclass(frozen=True, slots=True)
class Spec:
    """One parameter of an effect."""

    name: str
    """Ends in its unit, e.g. `drag_s_m`."""
    unit: str
    prior: float
    """How large it typically is on the reference vehicle (`vehicle.sizes`): the standard deviation of a weak prior, and
    the scale of numeric steps."""
    bounds: tuple[float, float]
    """Values outside are refused."""
    default: float = 0.0
    """Used when an effect is added without a value; 0 switches the effect off wherever its law allows."""
    planted: float = 0.0
    """The value the self-test plants and must recover."""
    held: bool = False
    """A convention rather than a fact (a reference voltage): never estimated."""
    scaling: Scaling = SAME
    """How `prior` grows with the vehicle."""
    optional: bool = False
    """A vehicle file may leave it out and means the default: added to an effect that files already name."""


@dataclass(frozen=True, slots=True)
class Effect:
    """One entry of the catalogue: a law, its parameters, and where it shows in the residuals."""

    name: str
    number: int
    """Number in the catalogue; 0 for one of the user's own."""
    stage: Stage
    apply: Callable[[Any, Values], None]
    """`apply(flow, values)` adds to a `Flow` (or `RigidBody`, `Drive`, `Reading`, by stage) in place."""
    parameters: tuple[Spec, ...]
    law: str
    """The formula as text."""
    source: str
    """Publication or reasoning the formula comes from."""
    channel: str
    """Residual channel in which it shows: of `F_x F_y F_z M_x M_y M_z`, or a description (command, sensor, time)."""
    regressor: str
    """What to plot that residual against."""
    excited_by: tuple[str, ...]
    """Manoeuvres of `vehicle.manoeuvres` that excite it."""
    family: str = ""
    """Physics of which it is one form, as `drag`; empty: it is the only one."""
    form: str = ""
    """Which form of its family's law it is, in words."""
    needs: tuple[str, ...] = ()
    """Which of `q_world_body`, `height_m`, `ceiling_gap_m`, `rotor_acceleration_rad_s2` it reads."""
    strength: tuple[str, ...] = ()
    """Parameters that make it vanish at zero; empty: all of them. The others mean nothing while these are zero."""
    each_rotor: Callable[[int], tuple[Spec, ...]] | None = None
    """The parameters on a vehicle of so many rotors, for an effect that has one for each; `parameters` are four's."""
    separate: bool = False
    """Whether each parameter is an effect to look for by itself: one rotor is weak, not a mixture of all."""
    between_flights: bool = False
    """Whether it shows only between flights with it and flights without."""
    instead_of: str = ""
    """Another effect that this one contains; the two are never active together ..."""
    takes_over: tuple[str, str] = ("", "")
    """... and its parameter, and which of ours has the same value."""
    moves_like: str = ""
    """Another effect that moves the vehicle alike, so that flights cannot tell the two apart: never a candidate."""


def cross(a: Array, b: Array) -> Array:
    """Cross product along the first axis, broadcasting the others (np.cross is slow and needs equal shapes)."""
    return np.stack(
        np.broadcast_arrays(a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0])
    )


def magnitude(x: Any) -> Any:
    """|x| of a real quantity; keeps the derivative when x carries a complex step."""
    return np.where(np.real(x) < 0.0, -x, x)


def length(v: Array) -> Array:
    """Euclidean length along the first axis; keeps a complex step, with derivative 0 at length 0."""
    squared = (v * v).sum(axis=0)
    return np.sqrt(np.where(np.real(squared) > 0.0, squared, 0.0))


def positive(x: Any) -> Any:
    """max(x, 0), keeping a complex step."""
    return np.where(np.real(x) > 0.0, x, 0.0)


def clipped(x: Any, low: Any, high: Any) -> Any:
    """x held between two bounds, keeping a complex step."""
    raised = np.where(np.real(x) > np.real(low), x, low)
    return np.where(np.real(raised) < np.real(high), raised, high)
