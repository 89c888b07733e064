"""What the user may ask of an identification."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal

from flight import InputError

Reference = Literal["pose", "rotor speed"]
"""Streams whose clock the others can be measured against."""
Gaps = Literal["refuse", "split"]
LEAST_NODES = 5_000
"""Of `most_nodes`: below, what is fitted of a long flight is too short for its inertias."""


@dataclass(frozen=True, slots=True)
class HoverCommand:
    """A measured command, from 0 to 1 and of all rotors, at which the vehicle hovers."""

    command: float
    std: float = 0.01
    """Standard deviation."""
    battery_v: float | None = None
    """Voltage of the battery then; None: as in the flights."""

    def __post_init__(self) -> None:
        _require_command("a hover command", self.command)
        _require_positive("the standard deviation of a hover command", self.std)
        if self.battery_v is not None:
            _require_positive("the battery's voltage at a hover command", self.battery_v)


@dataclass(frozen=True, slots=True)
class RotorThrust:
    """A measured thrust of one rotor, on a balance, at a command from 0 to 1."""

    command: float
    thrust_n: float
    std_n: float
    """Standard deviation."""

    def __post_init__(self) -> None:
        _require_command("the command of a rotor's thrust", self.command)
        _require_positive("a rotor's thrust", self.thrust_n)
        _require_positive("the standard deviation of a rotor's thrust", self.std_n)


def _require_command(what: str, value: float) -> None:
    if not 0.0 < value <= 1.0:
        raise InputError(f"{what} is {value:g}; expected a share of full throttle, above 0 and up to 1")


def _require_positive(what: str, value: float) -> None:
    if not 0.0 < value < math.inf:
        raise InputError(f"{what} is {value:g}; it must be positive")


@dataclass(frozen=True, slots=True)
class Options:
    """Choices of `identify`; the defaults fit every parameter these flights can show."""

    free: tuple[str, ...] | None = None
    """Names to estimate, e.g. `rotor_drag_thrust.drag_s_m`; None: every parameter but those in `held`."""
    held: tuple[str, ...] = ()
    """Names kept at the vehicle's value. The mass is always held: pose and rotor speed show only ratios to it."""
    prior_std: Mapping[str, float] = field(default_factory=dict)
    """Name to the standard deviation of a prior around the vehicle's value."""
    anchors: tuple[HoverCommand | RotorThrust, ...] = ()
    """What was measured beside flights without a pose; the vehicle's mass, with its standard deviation, is another."""
    pose_sensor: bool = True
    """Estimate where the pose sensor sits and how it is turned."""
    use_rates: bool = True
    """Use `rate_body_rad_s` of the log as a gyro with a constant bias, when it is there."""
    use_accelerometer: bool = False
    """Use `specific_force_body_m_s2` also when there is a pose; without a pose it is always used."""
    clock: Reference = "pose"
    """Against whose clock the delays of gyro, accelerometer, rotor speed and commands are estimated. Against rotor
    speed (of logs of commands alone: against the gyro), the pose is late by the vehicle's `pose_delay`, or not at
    all."""
    estimate_command_delay: bool = False
    """Of logs without rotor speed: estimate how late the commands are. That is confounded with the motor lag, so they
    are taken to be on time unless another recorder than the gyro's stamped them; see `flights.clocks`."""
    gaps: Gaps = "refuse"
    """A log with a gap: refuse it, or fit the pieces between gaps as separate flights."""
    unseen: Literal["refuse", "hold"] = "hold"
    """Parameters these flights cannot show: hold them at the vehicle's value and say so, or refuse."""
    node_rate_hz: float = 200.0
    """Most states per second; faster logs are averaged down to it."""
    robust: bool = False
    """Give pose samples far off the fit less weight (Huber), for motion capture that jumps now and then."""
    gusts: Literal["estimate", "white"] = "estimate"
    """Disturbances that last (gusts, a swinging load): estimate their size and duration when the flights show such, and
    carry them among the states; or take all that is unexplained for white noise."""
    block_s: float = 1.5
    """Length of the blocks within which errors may be correlated, for the robust standard errors."""
    max_iterations: int = 30
    """Gauss-Newton steps before giving up."""
    most_nodes: int = 50_000
    """Flights with more nodes in all are cut into segments, and the most informative are fitted: 40 % of so many."""
    segments: Literal["most informative", "rest"] = "most informative"
    """Of flights so long: what a fit uses, or what it leaves to be predicted."""

    def __post_init__(self) -> None:
        for name in ("node_rate_hz", "block_s"):
            if not getattr(self, name) > 0.0:
                raise InputError(f"option {name} is {getattr(self, name)}; it must be positive")
        for name, least in (("max_iterations", 1), ("most_nodes", LEAST_NODES)):
            if getattr(self, name) < least:
                raise InputError(f"{name} is {getattr(self, name)}; it must be at least {least}")
        for name, std in self.prior_std.items():
            if not std > 0.0:
                raise InputError(f"the prior of {name} has standard deviation {std}; it must be positive")
