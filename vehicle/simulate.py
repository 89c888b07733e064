"""Fly a vehicle: fixed-step Runge-Kutta of fourth order, one vehicle or many, wind and a floor included.

The vehicle handed in here is the truth; what the controller believes may be another `Vehicle` altogether.
"""

import math
from dataclasses import dataclass, field, replace

import numpy as np

from flight import FloatArray, InputError
from vehicle import integrate, invert
from vehicle.model import Vehicle

GRAVITY_M_S2 = 9.81


@dataclass(frozen=True, slots=True, eq=False)
class State:
    """Where a vehicle is and how it moves."""

    position_world_m: FloatArray = field(default_factory=lambda: np.zeros(3))
    """Of the centre of mass."""
    velocity_world_m_s: FloatArray = field(default_factory=lambda: np.zeros(3))
    q_world_body: FloatArray = field(default_factory=lambda: np.array([1.0, 0.0, 0.0, 0.0]))
    rate_body_rad_s: FloatArray = field(default_factory=lambda: np.zeros(3))
    rotor_speed_rad_s: FloatArray = field(default_factory=lambda: np.zeros(4))

    def row(self) -> FloatArray:
        """(17,) as the kernel keeps it."""
        parts = (
            self.position_world_m,
            self.velocity_world_m_s,
            self.q_world_body,
            self.rate_body_rad_s,
            self.rotor_speed_rad_s,
        )
        row = np.concatenate([np.asarray(part, dtype=np.float64).ravel() for part in parts])
        if row.shape != (17,) or not np.isfinite(row).all():
            raise InputError("a state needs finite position, velocity, attitude, rate (3, 3, 4, 3) and 4 rotor speeds")
        return row


def hovering(vehicle: Vehicle, position_world_m: FloatArray, *, yaw_rad: float = 0.0) -> State:
    """At rest in the air, rotors at hover speed."""
    q = np.array([math.cos(0.5 * yaw_rad), 0.0, 0.0, math.sin(0.5 * yaw_rad)])
    return State(
        np.asarray(position_world_m, dtype=np.float64), q_world_body=q, rotor_speed_rad_s=invert.hover(vehicle)
    )


@dataclass(frozen=True, slots=True)
class Wind:
    """A steady wind and gusts on top of it (a first-order Gauss-Markov process on each world axis)."""

    mean_world_m_s: tuple[float, float, float] = (0.0, 0.0, 0.0)
    gust_std_m_s: float = 0.0
    gust_time_s: float = 1.0
    """Correlation time of the gusts."""


CALM = Wind()


@dataclass(frozen=True, slots=True)
class Battery:
    """A battery whose voltage falls in proportion to the energy drawn."""

    full_v: float = 16.8
    empty_v: float = 13.2
    energy_j: float = 80_000.0
    """Mechanical rotor energy between full and empty; 80 kJ is about a 1500 mAh four-cell pack at 60 % efficiency."""

    def voltage(self, drawn_j: FloatArray | float) -> FloatArray:
        left = np.clip(1.0 - np.asarray(drawn_j) / self.energy_j, 0.0, 1.0)
        return self.empty_v + (self.full_v - self.empty_v) * left


class Plant:
    """One vehicle in flight. Step it with rotor speed commands; read its true state from the attributes."""

    def __init__(
        self,
        vehicle: Vehicle,
        state: State | None = None,
        *,
        rng: np.random.Generator | None = None,
        wind: Wind = CALM,
        battery: Battery | None = None,
        ground_m: float = -math.inf,
        ceiling_m: float = math.inf,
        step_s: float = 1e-3,
    ) -> None:
        """
        Args:
            state: where it starts; at rest in the origin with rotors at hover speed if not given.
            rng: needed only for gusts.
            ground_m: height of a floor that carries the vehicle; none by default.
            step_s: largest step of the integrator. With 1 ms the position error after 10 s of brisk flight
                stays below a micrometre (see the tests).
        """
        if wind.gust_std_m_s > 0.0 and rng is None:
            raise InputError("gusts need a random generator: pass rng=numpy.random.default_rng(seed)")
        if not step_s > 0.0:
            raise InputError(f"step_s is {step_s:g}; it must be positive")
        self.vehicle = vehicle
        self.time_s = 0.0
        self._rng, self._wind, self._battery, self._step_s = rng, wind, battery or Battery(), step_s
        self._drawn_j, self._gust = 0.0, np.zeros(3)
        self._world = integrate.world_row(wind.mean_world_m_s, GRAVITY_M_S2, ground_m, ceiling_m)
        self._advance = integrate.stepper(vehicle)
        self._row = (state or hovering(vehicle, np.zeros(3))).row()[None].copy()
        self._specific_force = np.zeros((1, 3))
        if wind.gust_std_m_s > 0.0 and rng is not None:
            self._gust = rng.normal(0.0, wind.gust_std_m_s, 3)

    def step(self, rotor_speed_command_rad_s: FloatArray, duration_s: float) -> None:
        """Hold a rotor speed command for a while.

        Raises:
            InputError: the command is not four finite numbers, or the duration is not positive.
        """
        command = np.array(rotor_speed_command_rad_s, dtype=np.float64).reshape(1, -1)
        if command.shape != (1, 4) or not np.isfinite(command).all():
            raise InputError(f"the rotor speed command is {rotor_speed_command_rad_s}; four finite numbers are wanted")
        if not duration_s > 0.0:
            raise InputError(f"duration_s is {duration_s:g}; it must be positive")
        limits = self.vehicle.limits
        np.clip(command, 0.0, limits.rotor_speed_max_rad_s, out=command)
        steps = max(1, math.ceil(duration_s / self._step_s - 1e-9))
        self._blow(duration_s)
        volts = np.array([[self.battery_v]])
        self._drawn_j += float(
            self._advance(self._world, command, volts, steps, duration_s / steps, self._row, self._specific_force)[0]
        )
        self.time_s += duration_s

    def _blow(self, duration_s: float) -> None:
        if self._wind.gust_std_m_s > 0.0 and self._rng is not None:
            keep = math.exp(-duration_s / self._wind.gust_time_s)
            fresh = self._wind.gust_std_m_s * math.sqrt(1.0 - keep * keep)
            self._gust = keep * self._gust + self._rng.normal(0.0, fresh, 3)
            self._world[0, :3] = np.asarray(self._wind.mean_world_m_s) + self._gust

    @property
    def state(self) -> State:
        return State(
            self.position_world_m,
            self.velocity_world_m_s,
            self.q_world_body,
            self.rate_body_rad_s,
            self.rotor_speed_rad_s,
        )

    @property
    def position_world_m(self) -> FloatArray:
        """(3,) of the centre of mass."""
        return self._row[0, 0:3].copy()

    @property
    def velocity_world_m_s(self) -> FloatArray:
        return self._row[0, 3:6].copy()

    @property
    def q_world_body(self) -> FloatArray:
        return self._row[0, 6:10].copy()

    @property
    def rate_body_rad_s(self) -> FloatArray:
        return self._row[0, 10:13].copy()

    @property
    def rotor_speed_rad_s(self) -> FloatArray:
        return self._row[0, 13:17].copy()

    @property
    def specific_force_body_m_s2(self) -> FloatArray:
        """(3,) what an ideal accelerometer at the centre of mass reads; zero before the first step."""
        return self._specific_force[0].copy()

    @property
    def wind_world_m_s(self) -> FloatArray:
        return self._world[0, 0:3].copy()

    @property
    def battery_v(self) -> float:
        return float(self._battery.voltage(self._drawn_j))


def with_truth(vehicle: Vehicle, **changes: float) -> Vehicle:
    """A copy for use as hidden truth: parameters changed by full name, dots written as double underscores."""
    for name, value in changes.items():
        vehicle = vehicle.with_value(name.replace("__", "."), value, source="hidden truth")
    return replace(vehicle, name=f"{vehicle.name} (truth)")
