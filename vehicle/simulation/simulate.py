"""Fly a vehicle: fixed-step Runge-Kutta of fourth order, one vehicle or many, wind and a floor included.

The vehicle given here is the true one; the controller may use another `Vehicle` as its model.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from flight import FloatArray, InputError
from vehicle import invert
from vehicle.model import Vehicle
from vehicle.simulation import integrate


@dataclass(frozen=True, slots=True, eq=False)
class State:
    """Pose, velocities and rotor speeds of a vehicle."""

    position_world_m: FloatArray = field(default_factory=lambda: np.zeros(3))
    """Of the centre of mass."""
    velocity_world_m_s: FloatArray = field(default_factory=lambda: np.zeros(3))
    q_world_body: FloatArray = field(default_factory=lambda: np.array([1.0, 0.0, 0.0, 0.0]))
    rate_body_rad_s: FloatArray = field(default_factory=lambda: np.zeros(3))
    rotor_speed_rad_s: FloatArray = field(default_factory=lambda: np.zeros(4))

    def row(self) -> FloatArray:
        """(13 + r,) in the kernel's order, with r rotors."""
        parts = (
            self.position_world_m,
            self.velocity_world_m_s,
            self.q_world_body,
            self.rate_body_rad_s,
            self.rotor_speed_rad_s,
        )
        row = np.concatenate([np.asarray(part, dtype=np.float64).ravel() for part in parts])
        sizes = [np.size(part) for part in parts[:4]]
        if sizes != [3, 3, 4, 3] or not np.isfinite(row).all():
            raise InputError(f"a state needs finite position, velocity, attitude, rate (3, 3, 4, 3), got {sizes}")
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
"""Air at rest."""


@dataclass(frozen=True, slots=True)
class Battery:
    """A battery whose voltage falls in proportion to the energy drawn."""

    full_v: float = 16.8
    empty_v: float = 13.2
    energy_j: float = 80_000.0
    """Mechanical rotor energy between full and empty; 80 kJ is about a 1500 mAh four-cell pack at 60 % efficiency."""

    def voltage(self, drawn_j: FloatArray | float) -> FloatArray:
        left = np.maximum(1.0 - np.asarray(drawn_j) / self.energy_j, 0.0)  # np.clip takes three times as long
        left = np.minimum(left, 1.0)
        return self.empty_v + (self.full_v - self.empty_v) * left


class Fleet:
    """Many vehicles of one kind flown at once, each with its own state, command and, optionally, parameter values."""

    def __init__(
        self,
        vehicle: Vehicle,
        states: Sequence[State],
        *,
        values: Mapping[str, FloatArray] | None = None,
        rng: np.random.Generator | None = None,
        wind: Wind = CALM,
        battery: Battery | None = None,
        ground_m: float = -math.inf,
        ceiling_m: float = math.inf,
        step_s: float = 1e-3,
    ) -> None:
        """
        Args:
            states: initial states of the m vehicles.
            values: full parameter name to (m,) values, for those that differ from vehicle to vehicle.
            rng: needed only for gusts.
            ground_m: height of a floor that carries the vehicles; none by default.
            step_s: largest step of the integrator. With 1 ms the position error in a second of brisk flight
                stays below a tenth of a micrometre (tests/vehicle/simulation/test_plant.py); it falls with its fourth
                power.
        """
        if wind.gust_std_m_s > 0.0 and rng is None:
            raise InputError("gusts need a random generator: pass rng=numpy.random.default_rng(seed)")
        if not step_s > 0.0:
            raise InputError(f"step_s is {step_s:g}; it must be positive")
        if not states:
            raise InputError("a fleet needs at least one state")
        for state in states:
            if np.size(state.rotor_speed_rad_s) != vehicle.rotors:
                raise InputError(
                    f"a state has {np.size(state.rotor_speed_rad_s)} rotor speeds; {vehicle.name} has {vehicle.rotors}"
                )
        m = len(states)
        self.vehicle = vehicle
        self.time_s = 0.0
        self._rng, self._wind, self._battery, self._step_s = rng, wind, battery or Battery(), step_s
        self._rows = np.stack([state.row() for state in states])
        self._advance = integrate.stepper(vehicle, values, m)
        self._world = np.repeat(
            integrate.world_row(wind.mean_world_m_s, vehicle.gravity_m_s2, ground_m, ceiling_m), m, axis=0
        )
        self._drawn_j, self._specific_force, self._gust = np.zeros(m), np.zeros((m, 3)), np.zeros((m, 3))
        if rng is not None and wind.gust_std_m_s > 0.0:
            self._gust = rng.normal(0.0, wind.gust_std_m_s, (m, 3))
            self._world[:, :3] += self._gust
        self._volts = self._battery.voltage(self._drawn_j)  # kept: reading it takes a third of a step
        held = np.ascontiguousarray(self._rows[:, 13:])
        self._advance(self._world, held, self._volts[:, None], 0, step_s, self._rows, self._specific_force)

    def step(self, rotor_speed_command_rad_s: FloatArray, duration_s: float) -> None:
        """Hold rotor speed commands, (m, r) or (r,) for all, for a while; they are clipped to 0 and the fastest speed.

        Raises:
            InputError: a command is not a finite number for each rotor, or the duration is not positive.
        """
        command = np.atleast_2d(np.array(rotor_speed_command_rad_s, dtype=np.float64))
        r = self.vehicle.rotors
        if command.ndim != 2 or command.shape[1] != r or len(command) not in (1, len(self._rows)):
            raise InputError(
                f"the rotor speed command: expected shape ({r},) or ({len(self)}, {r}), got {command.shape}"
            )
        if not np.isfinite(command).all():
            raise InputError(f"the rotor speed command: expected {r} finite numbers, got {command[0]}")
        if not duration_s > 0.0:
            raise InputError(f"duration_s is {duration_s:g}; it must be positive")
        np.maximum(command, 0.0, out=command)
        np.minimum(command, self.vehicle.limits.rotor_speed_max_rad_s, out=command)
        steps = max(1, math.ceil(duration_s / self._step_s - 1e-9))
        self._blow(duration_s)
        self._drawn_j += self._advance(
            self._world, command, self._volts[:, None], steps, duration_s / steps, self._rows, self._specific_force
        )
        self._volts = self._battery.voltage(self._drawn_j)
        self.time_s += duration_s

    def _blow(self, duration_s: float) -> None:
        if self._rng is not None and self._wind.gust_std_m_s > 0.0:
            keep = math.exp(-duration_s / self._wind.gust_time_s)
            fresh = self._wind.gust_std_m_s * math.sqrt(1.0 - keep * keep)
            self._gust = keep * self._gust + self._rng.normal(0.0, fresh, self._gust.shape)
            self._world[:, :3] = np.asarray(self._wind.mean_world_m_s) + self._gust

    def __len__(self) -> int:
        return len(self._rows)

    @property
    def rows(self) -> FloatArray:
        """(m, 13 + r) copy of all states: position, velocity, q_world_body, body rate, rotor speed."""
        return self._rows.copy()

    @property
    def position_world_m(self) -> FloatArray:
        """(m, 3) of the centres of mass."""
        return self._rows[:, 0:3].copy()

    @property
    def velocity_world_m_s(self) -> FloatArray:
        return self._rows[:, 3:6].copy()

    @property
    def q_world_body(self) -> FloatArray:
        return self._rows[:, 6:10].copy()

    @property
    def rate_body_rad_s(self) -> FloatArray:
        return self._rows[:, 10:13].copy()

    @property
    def rotor_speed_rad_s(self) -> FloatArray:
        return self._rows[:, 13:].copy()

    @property
    def specific_force_body_m_s2(self) -> FloatArray:
        """(m, 3) readings of ideal accelerometers at the centres of mass."""
        return self._specific_force.copy()

    @property
    def wind_world_m_s(self) -> FloatArray:
        return self._world[:, 0:3].copy()

    @property
    def battery_v(self) -> FloatArray:
        return self._volts.copy()


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
        """As `Fleet`, for one vehicle; it starts hovering at the origin if no state is given."""
        self.vehicle = vehicle
        self._fleet = Fleet(
            vehicle,
            [state or hovering(vehicle, np.zeros(3))],
            rng=rng,
            wind=wind,
            battery=battery,
            ground_m=ground_m,
            ceiling_m=ceiling_m,
            step_s=step_s,
        )

    def step(self, rotor_speed_command_rad_s: FloatArray, duration_s: float) -> None:
        """Hold a rotor speed command (r,) for a while; raises as `Fleet.step`."""
        self._fleet.step(rotor_speed_command_rad_s, duration_s)

    @property
    def time_s(self) -> float:
        return self._fleet.time_s

    @property
    def state(self) -> State:
        return State(*np.split(self._fleet.rows[0], (3, 6, 10, 13)))

    @property
    def position_world_m(self) -> FloatArray:
        """(3,) of the centre of mass."""
        return self._fleet.position_world_m[0]

    @property
    def velocity_world_m_s(self) -> FloatArray:
        return self._fleet.velocity_world_m_s[0]

    @property
    def q_world_body(self) -> FloatArray:
        return self._fleet.q_world_body[0]

    @property
    def rate_body_rad_s(self) -> FloatArray:
        return self._fleet.rate_body_rad_s[0]

    @property
    def rotor_speed_rad_s(self) -> FloatArray:
        return self._fleet.rotor_speed_rad_s[0]

    @property
    def specific_force_body_m_s2(self) -> FloatArray:
        """(3,) reading of an ideal accelerometer at the centre of mass."""
        return self._fleet.specific_force_body_m_s2[0]

    @property
    def wind_world_m_s(self) -> FloatArray:
        return self._fleet.wind_world_m_s[0]

    @property
    def battery_v(self) -> float:
        return float(self._fleet.battery_v[0])
