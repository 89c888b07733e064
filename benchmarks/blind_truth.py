"""Physics RotorPy lacks, for the truth of a blind campaign: written from the laws, sharing nothing with `vehicle`.

Each class is an `Extra` of `blind_flight`: it may change the thrust of each rotor, and add force and torque.
The second half is physics that no catalogue holds.
"""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from blind_flight import Air, Array, cross, turned_back


class Added:
    """An extra that changes nothing yet."""

    def thrust(self, air: Air, thrust: Array) -> Array:
        return thrust

    def wrench(self, air: Air, thrust: Array) -> tuple[Array, Array] | None:
        return None


@dataclass(frozen=True, slots=True)
class TiredRotor(Added):
    """One rotor gives a share less of its thrust."""

    rotor: int
    share: float

    def thrust(self, air: Air, thrust: Array) -> Array:
        left = thrust.copy()
        left[self.rotor] -= self.share * left[self.rotor]
        return left


@dataclass(frozen=True, slots=True)
class GroundCushion(Added):
    """Cheeseman and Bennett's source method, with a factor for several rotors."""

    factor: float
    rotor_radius_m: float

    def thrust(self, air: Air, thrust: Array) -> Array:
        image = self.rotor_radius_m / (4.0 * np.maximum(air.position[2], 0.02))
        return thrust / (1.0 - np.minimum(self.factor * image**2, 0.5))


@dataclass(frozen=True, slots=True)
class VortexRing(Added):
    """Thrust breaks down while sinking at half to twice the hover inflow; deepest in the middle."""

    depth: float
    rotor_radius_m: float
    air_density_kg_m3: float

    def thrust(self, air: Air, thrust: Array) -> Array:
        loading = np.maximum(thrust, 1e-9) / (2.0 * self.air_density_kg_m3 * np.pi * self.rotor_radius_m**2)
        # each hub's own axial speed: turning makes one side sink faster
        axial = air.velocity[2] + air.rate[0] * air.hub[1] - air.rate[1] * air.hub[0]
        off_middle = np.abs(axial / np.sqrt(loading) + 1.25)
        # (1 - x^2)^2 over the band, x = distance from its middle over its half width
        dip = np.square(np.maximum(1.0 - np.square(off_middle / 0.75), 0.0))
        return thrust - self.depth * dip * thrust


@dataclass(frozen=True, slots=True)
class AffineThrust(Added):
    """Thrust is not quite quadratic in rotor speed."""

    constant_n: float
    slope_n_s: float

    def thrust(self, air: Air, thrust: Array) -> Array:
        return thrust + (self.constant_n + self.slope_n_s * air.rotor_speed)


@dataclass(frozen=True, slots=True)
class WakeOnRear(Added):
    """Rotors downstream of the middle lose thrust in proportion to how fast the wake reaches them."""

    loss_s_m: float

    def thrust(self, air: Air, thrust: Array) -> Array:
        bearing = air.hub[:2] / np.hypot(air.hub[0], air.hub[1])
        towards_rear = -bearing[0] * air.velocity[0] - bearing[1] * air.velocity[1]
        return thrust * (1.0 - self.loss_s_m * np.where(towards_rear > 0.0, towards_rear, 0.0))


@dataclass(frozen=True, slots=True)
class ThrustScaledDrag(Added):
    """Blade flapping tilts the total thrust against the motion."""

    drag_s_m: float

    def wrench(self, air: Air, thrust: Array) -> tuple[Array, Array]:
        force = np.zeros_like(air.velocity)
        force[:2] = -self.drag_s_m * thrust.sum(axis=0) * air.velocity[:2]
        return force, np.zeros_like(force)


@dataclass(frozen=True, slots=True)
class DragPerAxis(Added):
    """Each body axis has its own drag, as if the others stood still."""

    level_kg_m: float
    upright_kg_m: float

    def wrench(self, air: Air, thrust: Array) -> tuple[Array, Array]:
        area = np.array([[self.level_kg_m], [self.level_kg_m], [self.upright_kg_m]])
        return -area * np.sign(air.velocity) * np.square(air.velocity), np.zeros_like(air.velocity)


@dataclass(frozen=True, slots=True)
class SpinDamping(Added):
    """Turning meets a torque: linear and quadratic in the body rate."""

    linear_n_m_s: tuple[float, float, float] = (0.0, 0.0, 0.0)
    quadratic_n_m_s2: tuple[float, float, float] = (0.0, 0.0, 0.0)

    def wrench(self, air: Air, thrust: Array) -> tuple[Array, Array]:
        linear, quadratic = (np.array(values)[:, None] for values in (self.linear_n_m_s, self.quadratic_n_m_s2))
        return np.zeros_like(air.rate), -air.rate * (linear + quadratic * np.abs(air.rate))


@dataclass(frozen=True, slots=True)
class RotorGyroscope(Added):
    """The rotors' own spin: turning the body turns their angular momentum."""

    inertia_kg_m2: float

    def wrench(self, air: Air, thrust: Array) -> tuple[Array, Array]:
        # a rotor spins against the torque it puts on the body
        momentum = np.zeros_like(air.rate)
        momentum[2] = -self.inertia_kg_m2 * (air.direction * air.rotor_speed).sum(axis=0)
        return np.zeros_like(momentum), -cross(air.rate, momentum)


@dataclass(frozen=True, slots=True)
class RotorFriction(Added):
    """A part of each rotor's torque that grows with its speed alone."""

    slope_n_m_s: float

    def wrench(self, air: Air, thrust: Array) -> tuple[Array, Array]:
        torque = np.zeros_like(air.rate)
        torque[2] = self.slope_n_m_s * (air.direction * air.rotor_speed).sum(axis=0)
        return np.zeros_like(torque), torque


@dataclass(frozen=True, slots=True)
class RotorSpinUp(Added):
    """Speeding a rotor up pushes the body the other way."""

    inertia_kg_m2: float

    def wrench(self, air: Air, thrust: Array) -> tuple[Array, Array]:
        torque = np.zeros_like(air.rate)
        torque[2] = self.inertia_kg_m2 * (air.direction * air.rotor_acceleration).sum(axis=0)
        return np.zeros_like(torque), torque


@dataclass(frozen=True, slots=True)
class SideMoment(Added):
    """The airframe's drag acts at a centre of pressure away from the centre of mass."""

    arm_times_area_kg: tuple[float, float, float]

    def wrench(self, air: Air, thrust: Array) -> tuple[Array, Array]:
        pressure = -np.sqrt(np.square(air.velocity).sum(axis=0)) * air.velocity
        arm = np.repeat(np.array(self.arm_times_area_kg)[:, None], pressure.shape[1], axis=1)
        return np.zeros_like(pressure), cross(arm, pressure)


CHANNELS = ("F_x", "F_y", "F_z", "M_x", "M_y", "M_z")


@dataclass(frozen=True, slots=True)
class Strange(Added):
    """One channel of the wrench as a curve of one variable: an effect outside the catalogue."""

    channel: str
    law: str
    size: float
    """In N or N m: the curve's own scale."""
    LAWS: ClassVar[dict[str, str]] = {
        "rotor_wave": "sin of the mean rotor speed",
        "one_rotor_wave": "sin of the speed of rotor 1",
        "sink_square": "v_z^2",
        "sink": "v_z",
        "height": "height above its middle",
        "slosh": "sin of time",
        "fading": "grows with time",
        "cubic_ahead": "v_x^3",
        "square_ahead": "v_x^2",
        "square_aside": "v_y^2",
        "turning": "|w_z|",
        "wave_ahead": "sin of v_x",
        "wall": "a bump in the world's x",
    }

    def wrench(self, air: Air, thrust: Array) -> tuple[Array, Array]:
        both = np.zeros((6, air.rate.shape[1]))
        both[CHANNELS.index(self.channel)] = self.size * self._curve(air)
        return both[:3], both[3:]

    def _curve(self, air: Air) -> Array:
        v_x, v_y, v_z = air.velocity
        curves = {
            "rotor_wave": lambda: np.sin(air.rotor_speed.mean(axis=0) / 40.0),
            "one_rotor_wave": lambda: np.sin(air.rotor_speed[1] / 40.0),
            "sink_square": lambda: 0.1 * v_z * v_z,
            "sink": lambda: 0.4 * v_z,
            "height": lambda: 0.8 * (air.position[2] - 6.0),
            "slosh": lambda: np.full_like(v_x, 1.2 * np.sin(0.9 * air.time_s)),
            "fading": lambda: np.full_like(v_x, air.time_s / 15.0),
            "cubic_ahead": lambda: (v_x / 4.0) ** 3,
            "square_ahead": lambda: (v_x / 5.0) ** 2,
            "square_aside": lambda: (v_y / 4.0) ** 2,
            "turning": lambda: np.abs(air.rate[2]),
            "wave_ahead": lambda: np.sin(v_x / 1.3),
            "wall": lambda: 2.0 * np.exp(-np.square((air.position[0] - 2.5) / 1.2)),
        }
        return np.asarray(curves[self.law]())


@dataclass(frozen=True, slots=True)
class Tether(Added):
    """A soft spring, in the level plane of the world, towards a fixed point."""

    stiffness_n_m: float
    anchor_m: tuple[float, float]

    def wrench(self, air: Air, thrust: Array) -> tuple[Array, Array]:
        pull = np.zeros_like(air.velocity)
        for axis, place in enumerate(self.anchor_m):
            pull[axis] = self.stiffness_n_m * (place - air.position[axis])
        return turned_back(air.rotation, pull), np.zeros_like(pull)
