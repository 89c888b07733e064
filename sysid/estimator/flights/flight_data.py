"""One flight made ready for the estimator: nodes in time, what was measured there, mean rotor speed in between."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from flight import rotations
from flight.frames import GRAVITY_M_S2
from flight.rotations import FloatArray
from sysid.estimator.flights.sampling import Signal
from sysid.logs.checks.clocks import Offset
from sysid.logs.sensors.low_pass import LowPass

IndexArray = NDArray[np.intp]


@dataclass(frozen=True, slots=True, eq=False)
class Flight:
    """A stretch of one log without gaps. What was not measured is NaN."""

    name: str
    """For messages: the log's name and the piece of it."""
    log_index: int
    """Which of the logs handed in it came from; pieces of one log share the sensors' biases."""
    time_s: FloatArray
    """(n,) instants of the states."""
    readings: Mapping[str, FloatArray]
    """What the sensors measured, by quantity: (n, c) at the nodes, (n - 1, c) means over the intervals."""
    rotor_speed_rad_s: FloatArray
    """(n - 1, r) mean over each interval; found from the command where it was not measured."""
    rotor_acceleration_rad_s2: FloatArray
    """(n - 1, r) mean over each interval."""
    rotor_command_rad_s: FloatArray
    """(n - 1, r) mean over each interval; only used where rotor speed was not measured."""
    battery_v: FloatArray
    """(n - 1,) mean over each interval."""
    streams: Mapping[str, Signal] = field(default_factory=dict)
    """Streams whose delay can be estimated, by quantity: between their samples, freed of noise."""
    lead_in: "LeadIn | None" = None
    """What was commanded just before; only where rotor speed was not measured."""
    carries_payload: bool | None = None
    """Whether the vehicle's payload, if it has one, was on board; None where the log does not say: it was."""
    gravity_m_s2: float = GRAVITY_M_S2
    """Where it was flown."""
    gyro_clock: Offset | None = None
    """How late its log's gyro is against the attitude by instrumental variables; None where that was not to be had."""
    commands_on_time: bool = False
    """Whether its commands are taken to be on time: they have a delay as other streams have, and it is held at zero."""
    full_throttle_rad_s: float | None = None
    """Speed that a command of 1 was taken for, where commands were logged from 0 to 1; None: they were speeds."""
    accelerometer_low_pass: LowPass | None = None
    """What the accelerometer went through in the vehicle, as the log says."""
    climb_m_s: FloatArray | None = None
    """(k,) speed along the thrust over each interval, as far as an accelerometer shows it; None: taken to be nil."""
    left_out: str = ""
    """In words, which stretches of its log are not part of any flight, and why."""

    @property
    def position_world_m(self) -> FloatArray:
        """(n, 3) measured by the pose sensor."""
        return self.readings["position_world_m"]

    @property
    def q_world_sensor(self) -> FloatArray:
        """(n, 4) measured by the pose sensor, continuous in sign."""
        return self.readings["q_world_sensor"]

    @property
    def rate_body_rad_s(self) -> FloatArray:
        """(n, 3) measured by the gyro."""
        return self.readings["rate_body_rad_s"]

    @property
    def specific_force_body_m_s2(self) -> FloatArray:
        """(n - 1, 3) mean of the accelerometer over each interval."""
        return self.readings["specific_force_body_m_s2"]

    @property
    def step_s(self) -> FloatArray:
        """(n - 1,) lengths of the intervals."""
        return np.diff(self.time_s)

    @property
    def has_pose(self) -> bool:
        return bool(np.isfinite(self.position_world_m).any())

    @property
    def has_gyro(self) -> bool:
        """Whether it was sampled at some of the nodes."""
        return bool(np.isfinite(self.rate_body_rad_s).any())

    @property
    def has_accelerometer(self) -> bool:
        return bool(np.isfinite(self.specific_force_body_m_s2).all())

    @property
    def driven_by_command(self) -> bool:
        """Whether rotor speed was not measured and comes from the commands."""
        return bool(np.isfinite(self.rotor_command_rad_s).all())

    def __len__(self) -> int:
        return len(self.time_s)


@dataclass(frozen=True, slots=True, eq=False)
class LeadIn:
    """Intervals before the first node: only the motors are simulated there."""

    step_s: FloatArray
    """(m,)."""
    rotor_command_rad_s: FloatArray
    """(m, r)."""
    battery_v: FloatArray
    """(m,)."""


def left_out(flights: Iterable[Flight]) -> tuple[str, ...]:
    """In words and once per log, which stretches are not part of any flight, and why."""
    return tuple(dict.fromkeys(flight.left_out for flight in flights if flight.left_out))


def rates_from_attitude(time_s: FloatArray, q: FloatArray) -> FloatArray:
    """(n - 1, 3) mean body rate between neighbouring attitudes."""
    return rotations.log(rotations.multiply(rotations.conjugate(q[:-1]), q[1:])) / np.diff(time_s)[:, None]
