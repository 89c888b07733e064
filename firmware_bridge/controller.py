"""The embedded controller from Python: parameters from a vehicle, uploads, commands, ticks.

The C files are those of the vehicle; this module only names, checks and converts.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import IntEnum, IntFlag
from typing import Any, Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from firmware_bridge import _controller, wire
from firmware_bridge.compensation import EFFECTS, Compensation, missing_partner
from firmware_bridge.dialect.generated.messages import Command
from firmware_bridge.dialect.generated.messages import MissionState as State
from firmware_bridge.wire import LinkLoss
from flight import FloatArray, InputError, Trajectory


class ThrustModel(IntEnum):
    """Which thrust law the mixer inverts."""

    QUADRATIC = 0
    BEM_AXIAL = 1
    """Eqs. (1)-(2) with v_xy = 0, as a table over (v_z, n) would have it."""
    BEM = 2


class Velocity(IntEnum):
    """Which velocity a compensation uses."""

    NONE = 0
    SETPOINT = 1
    ESTIMATE = 2


class Valid(IntFlag):
    """What of an estimate holds (tc_estimate.valid)."""

    POSITION_XY = 1
    POSITION_Z = 2
    VELOCITY_XY = 4
    VELOCITY_Z = 8
    ATTITUDE = 16
    RATE = 32
    SPECIFIC_FORCE = 64
    ROTOR_SPEED = 128


_POSE = 63
"""All of the pose."""


@dataclass(frozen=True, slots=True)
class Reset:
    """A relocalization: the estimator has moved its frame by this, new minus old."""

    counter: int = 0
    """One more with every relocalization."""
    position_world_m: tuple[float, float, float] = (0.0, 0.0, 0.0)
    velocity_world_m_s: tuple[float, float, float] = (0.0, 0.0, 0.0)
    yaw_rad: float = 0.0


_PLAIN = {"airflow_velocity": 1.0, "attitude_mode": 1.0, "feed_torque": 0.0, "rotor_lag_s": 0.0}
VARIANTS: dict[str, dict[str, float]] = {
    "quadratic thrust, no drag": {**_PLAIN, "thrust_model": ThrustModel.QUADRATIC, "drag_velocity": Velocity.NONE},
    "axial BEM, no drag": {**_PLAIN, "thrust_model": ThrustModel.BEM_AXIAL, "drag_velocity": Velocity.NONE},
    "axial BEM, rotor drag": {
        **_PLAIN, "thrust_model": ThrustModel.BEM_AXIAL, "drag_x_kg_m": 0.0, "drag_y_kg_m": 0.0, "drag_z_kg_m": 0.0
    },
    "axial BEM, all drag (the paper)": {**_PLAIN, "thrust_model": ThrustModel.BEM_AXIAL},
    "full BEM, all drag": {**_PLAIN},
    "ours": {},
}  # fmt: skip
"""Overrides that turn a configuration into the rungs of the paper's ladder (all with Lee et al.'s attitude loop)."""

SATURATION = {"tilt": 1, "collective": 2, "yaw": 4, "rotor": 8, "input": 16}
"""Bits of the saturation report."""


@dataclass(frozen=True, slots=True)
class ParameterInfo:
    """One row of the controller's parameter table."""

    name: str
    smallest: float
    largest: float
    preset: float
    in_flight: bool
    """Whether it may change in the air."""
    unit: str
    """"1": dimensionless."""


PARAMETERS: dict[str, ParameterInfo] = {row[0]: ParameterInfo(*row) for row in _controller.parameter_table()}
"""The parameter table in the order of `parameters.h`."""


class VehicleLike(Protocol):
    """What `parameters_of` reads of a vehicle model; `vehicle.Vehicle` has it."""

    @property
    def hub_body_m(self) -> FloatArray: ...
    @property
    def spin(self) -> FloatArray: ...
    @property
    def axis_body(self) -> FloatArray | None: ...
    @property
    def effects(self) -> tuple[str, ...]: ...
    @property
    def limits(self) -> Any: ...
    @property
    def body(self) -> Any: ...
    @property
    def gravity_m_s2(self) -> float: ...
    def value(self, name: str) -> float: ...


@dataclass(frozen=True, slots=True)
class Configuration:
    """Controller parameters made from a vehicle model."""

    parameters: Mapping[str, float]
    """By the names of `PARAMETERS`; those not named keep their preset."""
    not_compensated: tuple[str, ...] = ()
    """Active effects of the model that the controller does not cancel."""

    def with_values(self, **values: float) -> "Configuration":
        """A copy with some parameters set otherwise."""
        return Configuration(checked({**self.parameters, **values}), self.not_compensated)


_SWITCHED_OFF = (
    "rotor_drag_s_m", "rotor_drag_kg", "drag_x_kg_m", "drag_y_kg_m", "drag_z_kg_m",
    "drag_norm_x_kg_m", "drag_norm_y_kg_m", "drag_norm_z_kg_m", "lift_kg_m", "inflow_kg", "flapping_kg_m",
    "damping_x_n_m_s", "damping_y_n_m_s", "damping_z_n_m_s", "battery_ref_v", "battery_gain_1_v",
)  # fmt: skip
"""Compensations that a model without the effect must not inherit from the presets."""


def compensated_effects() -> dict[str, Compensation]:
    """Every effect of the catalogue, and whether the controller cancels it: true or false, with words in `how`."""
    return dict(EFFECTS)


def compensations(vehicle: VehicleLike) -> dict[str, tuple[bool, str]]:
    """Every active effect of a model: whether the controller compensates it, and how or why not."""
    try:
        left = parameters_of(vehicle).not_compensated
    except InputError as error:
        return dict.fromkeys(vehicle.effects, (False, str(error)))
    found: dict[str, tuple[bool, str]] = {}
    for name in vehicle.effects:
        entry = EFFECTS.get(name)
        how = "an effect of your own, for which the controller has no compensation" if entry is None else entry.how
        if entry is not None and entry.compensated and name in left:
            how = f"only together with {entry.only_with} alone"
        found[name] = (name not in left, how)
    return found


def checked(values: Mapping[str, float]) -> dict[str, float]:
    """The same values, after looking each one up in the table.

    Raises:
        InputError: an unknown name, a value that is not finite or out of range.
    """
    for name, value in values.items():
        if name not in PARAMETERS:
            raise InputError(f"the controller has no parameter {name!r}")
        row = PARAMETERS[name]
        if not (np.isfinite(value) and row.smallest <= np.float32(value) <= row.largest):
            raise InputError(
                f"controller parameter {name} is {value:g}; it must be {row.smallest:g} to {row.largest:g}"
            )
    return {name: float(value) for name, value in values.items()}


def parameters_of(vehicle: VehicleLike, **overrides: float) -> Configuration:
    """Controller parameters that mirror a vehicle model's body, rotors and effects; gains stay at their presets.

    Raises:
        InputError: the model has other rotors than four along body z, no thrust law the controller knows, or a value is
            out of the table's range.
    """
    require_four(vehicle)
    values = dict.fromkeys(_SWITCHED_OFF, 0.0)
    values |= _body(vehicle)
    left: list[str] = []
    for effect in vehicle.effects:
        entry = EFFECTS.get(effect)
        if entry is None or not entry.compensated or missing_partner(effect, vehicle.effects):
            left.append(effect)
            continue
        for name, targets in entry.targets.items():
            value = vehicle.value(f"{effect}.{name}")
            values |= dict.fromkeys(targets, 1.0 - value if effect == "weak_rotor" else value)
    if "thrust_bem" in vehicle.effects:
        values["thrust_model"] = ThrustModel.BEM
        values["quad_n_s2"] = _quadratic_at_hover(values)
    elif "thrust_quadratic" in vehicle.effects:
        values["thrust_model"] = ThrustModel.QUADRATIC
        if {"thrust_affine", "torque_affine"} & set(vehicle.effects):
            values |= _curves_at_hover(vehicle, values)
    else:
        raise InputError("the controller needs a thrust law; add thrust_bem or thrust_quadratic to the vehicle")
    return Configuration(checked({**values, **overrides}), tuple(left))


def require_four(vehicle: VehicleLike, stage: str = "") -> None:
    """Raises `InputError` for what the controller's mixer cannot drive.

    Args:
        stage: what needs it, a clause that the sentence begins with.
    """
    if len(vehicle.spin) != 4 or vehicle.axis_body is not None:
        rotors = f"{len(vehicle.spin)} rotors" if vehicle.axis_body is None else "tilted rotors"
        whose = f"{stage}, whose" if stage else "the controller's"
        raise InputError(
            f"{whose} mixer drives four rotors along body z; this vehicle "
            f"has {rotors}: today only PX4 and ArduPilot fly them (goshawk fly PLAN --on mavlink:...)"
        )


def _body(vehicle: VehicleLike) -> dict[str, float]:
    body = vehicle.body
    values = {
        "mass_kg": float(body.mass_kg),
        "com_x_m": float(body.centre_of_mass_m[0]),
        "com_y_m": float(body.centre_of_mass_m[1]),
        "gravity_m_s2": vehicle.gravity_m_s2,
        "air_density": vehicle.value("air_density_kg_m3"),
        "disk_area_m2": float(np.pi * vehicle.value("rotor_radius_m") ** 2),
        "rotor_min_rad_s": vehicle.limits.rotor_speed_min_rad_s,
        "rotor_max_rad_s": vehicle.limits.rotor_speed_max_rad_s,
        "rotor_idle_rad_s": vehicle.limits.rotor_speed_min_rad_s,
    }
    values |= {f"inertia_{axis * 2}": float(body.inertia_kg_m2[i, i]) for i, axis in enumerate("xyz")}
    for i in range(4):
        values[f"rotor{i}_x_m"], values[f"rotor{i}_y_m"] = (float(x) for x in vehicle.hub_body_m[i, :2])
        values[f"rotor{i}_spin"] = -float(vehicle.spin[i])  # drag turns the body against the rotor's spin
        values[f"rotor{i}_gain"] = 1.0
    return values


def _quadratic_at_hover(values: Mapping[str, float]) -> float:
    """The k of T = k n^2 that agrees with eqs. (1)-(2) at hover, for the quadratic controller variant."""
    thrust = values["mass_kg"] * values["gravity_m_s2"] / 4.0
    induced = np.sqrt(thrust / (2.0 * values["air_density"] * values["disk_area_m2"]))
    k1, b = values["k1_n_s2"], values["k2_n_s2_m"] * induced
    speed = (-b + np.sqrt(b * b + 4.0 * k1 * thrust)) / (2.0 * k1)
    return float(thrust / speed**2)


def _curves_at_hover(vehicle: VehicleLike, values: Mapping[str, float]) -> dict[str, float]:
    """Coefficients of the squares that agree at hover with curves that have lower terms, too.

    Raises:
        InputError: no rotor speed makes the thrust of hover, or torque there turns the other way.
    """
    constant, slope, torque_slope = (
        vehicle.value(name) if name.partition(".")[0] in vehicle.effects else 0.0
        for name in ("thrust_affine.constant_n", "thrust_affine.slope_n_s", "torque_affine.slope_n_m_s")
    )
    thrust, k = values["mass_kg"] * values["gravity_m_s2"] / 4.0, values["quad_n_s2"]
    beyond = thrust - constant
    halves = slope + np.sqrt(max(slope * slope + 4.0 * k * beyond, 0.0))
    if not (beyond > 0.0 and halves > 0.0):
        raise InputError(
            f"by this vehicle's thrust_quadratic and thrust_affine no rotor speed makes the {thrust:.3g} N of hover; "
            "fly throttle steps about hover and identify it again"
        )
    speed = 2.0 * beyond / halves
    found = {"quad_n_s2": float(thrust / speed**2)}
    if "torque_affine" in vehicle.effects:
        torque = values.get("cq_n_m_s2", 0.0) + torque_slope / speed
        if not torque > 0.0:
            raise InputError(
                "by this vehicle's rotor_yaw_torque and torque_affine a rotor in hover has no torque against its spin; "
                "fly yaw steps about hover and identify it again"
            )
        found["cq_n_m_s2"] = float(torque)
    return found


class RefusedError(InputError):
    """The controller said no; `reason` is its number, the message its words."""

    def __init__(self, what: str, reason: int) -> None:
        super().__init__(f"{what} refused: {_controller.reason_text(reason)}")
        self.reason = reason


@dataclass(slots=True)
class Controller:
    """One controller, as on the vehicle, without a link."""

    configuration: Configuration
    raw: _controller.Controller = field(default_factory=_controller.Controller)
    """The compiled object, for the link and for benchmarks."""

    def __post_init__(self) -> None:
        self.set_parameters(self.configuration.parameters)

    def set_parameters(self, values: Mapping[str, float]) -> None:
        """Set some parameters, all of them or none; the others keep what they are.

        Raises:
            InputError: an unknown name or a value out of range.
            RefusedError: singular rotor geometry, too little thrust, or not changeable in the air.
        """
        table = vector(checked(values), base=self.raw.parameters().ravel() if self.raw.configured else None)
        reason, _ = self.raw.set_parameters(table)
        if reason:
            raise RefusedError("parameter set", reason)

    def parameters(self) -> dict[str, float]:
        """What is in force."""
        return dict(zip(PARAMETERS, self.raw.parameters().ravel().tolist(), strict=True))

    def command(self, command: Command, value: float = 0.0) -> None:
        """Raises `RefusedError` with the controller's reason."""
        reason = self.raw.command(int(command), float(value))
        if reason:
            raise RefusedError(command.name.lower().replace("_", " "), reason)

    def upload(
        self,
        trajectory: Trajectory,
        *,
        id: int = 1,
        link_loss: LinkLoss = LinkLoss.FINISH,
        clearance_m: float = 0.0,
    ) -> int:
        """Stage, check and activate a trajectory without a link. Returns its CRC-32.

        Args:
            clearance_m: room for the tracking error, by which the supervisor judges; 0 = not stated.

        Raises:
            InputError: it does not fit into the vehicle (`wire.plan_from_trajectory`).
            RefusedError: the vehicle's own checks found something; the message says which segment.
        """
        plan = wire.plan_from_trajectory(trajectory, id=id, on_link_loss=link_loss, clearance_m=clearance_m)
        k, _, n = plan.coefficients.shape
        crc = plan.crc32
        self._must("upload", self.raw.upload_begin(id, crc, k, n, int(link_loss), plan.clearance_m))
        for i in range(k):
            what = f"segment {i}"
            self._must(what, self.raw.upload_segment(i, int(plan.durations_us[i]), plan.coefficients[i]))
        for time_us, value in zip(*wire.check_points(plan, trajectory), strict=True):
            self._must("sample", self.raw.upload_sample(int(time_us), value))
        reason = self.raw.upload_finish()
        self._must(f"trajectory (segment {self.raw.refused_segment()})", reason)
        self._must("activation", self.raw.upload_activate(id, crc))
        return crc

    @staticmethod
    def _must(what: str, reason: int) -> None:
        if reason:
            raise RefusedError(what, reason)

    def tick(
        self,
        time_us: int,
        state: ArrayLike,
        *,
        position_time_us: int | None = None,
        attitude_time_us: int | None = None,
        rate_time_us: int | None = None,
        battery_v: float = 0.0,
        specific_force_body_m_s2: ArrayLike | None = None,
        rotor_speed_rad_s: ArrayLike | None = None,
        valid: int = _POSE,
        position_std_m: tuple[float, float] = (0.0, 0.0),
        velocity_std_m_s: tuple[float, float] = (0.0, 0.0),
        reset: Reset | None = None,
    ) -> FloatArray:
        """One control step.

        Args:
            state: (13,): position 3, velocity 3, q_world_body 4, body rate 3.
            position_time_us, attitude_time_us, rate_time_us: when those were true; `time_us` unless given.
            specific_force_body_m_s2: (3,) of the accelerometer; None: there is none.
            rotor_speed_rad_s: (4,) as measured; None: they are not.
            valid: bits of `Valid`, of the pose.
            position_std_m, velocity_std_m_s: horizontal, vertical; 0 = not told.
            reset: the estimator's last relocalization.

        Returns:
            (4,) rotor speed commands, rad/s. Always finite and in range, whatever the state holds.
        """
        row = np.ascontiguousarray(state, dtype=np.float64)
        if row.shape != (13,):
            raise InputError(f"the state has shape {row.shape}, expected (13,)")
        at = time_us if position_time_us is None else position_time_us
        attitude_at = time_us if attitude_time_us is None else attitude_time_us
        moved = reset or Reset()
        force = np.zeros(3) if specific_force_body_m_s2 is None else np.asarray(specific_force_body_m_s2, np.float64)
        rotors = np.zeros(4) if rotor_speed_rad_s is None else np.asarray(rotor_speed_rad_s, np.float64)
        more = np.concatenate([
            force, position_std_m, velocity_std_m_s, moved.position_world_m, moved.velocity_world_m_s, [moved.yaw_rad],
            rotors,
        ])  # fmt: skip
        bits = valid if specific_force_body_m_s2 is None else valid | Valid.SPECIFIC_FORCE
        bits = bits if rotor_speed_rad_s is None else bits | Valid.ROTOR_SPEED
        speeds, _ = self.raw.tick(
            time_us, row, at, attitude_at, battery_v, rate_time_us, int(bits), moved.counter % 256, more
        )
        return speeds.astype(np.float64)

    def shadow(self) -> None:
        """Compute while another controller flies. Raises `RefusedError`."""
        self._must("shadow mode", self.raw.shadow())

    def end_shadow(self) -> None:
        """Back to disarmed, in command of stopped rotors.

        The caller must know that the vehicle stands: in the air the rotors stop, and a hover is not told from standing.

        Raises:
            RefusedError: outside of shadow mode, or above 0.5 m/s or 0.5 rad/s.
        """
        self._must("the end of shadow mode", self.raw.shadow_end())

    def engage(self, rotor_speed_rad_s: ArrayLike | None = None) -> None:
        """Take over in flight, from (4,) rotor speeds if known. Raises `RefusedError`."""
        speeds = None if rotor_speed_rad_s is None else np.ascontiguousarray(rotor_speed_rad_s, dtype=np.float32)
        self._must("taking over", self.raw.engage(speeds))

    def release(self) -> None:
        """Give back in flight, to shadow mode. Raises `RefusedError`."""
        self._must("release", self.raw.release())

    @property
    def telemetry(self) -> dict[str, Any]:
        """All of the last tick; see `tc_telemetry` in `controller.h`."""
        return self.raw.telemetry()

    @property
    def state(self) -> State:
        return State(self.raw.state())


def vector(values: Mapping[str, float], base: NDArray[np.float32] | None = None) -> NDArray[np.float32]:
    """Parameters in table order, presets (or `base`) where not given: (p,) float32."""
    table = np.array([row.preset for row in PARAMETERS.values()], np.float32) if base is None else base.copy()
    names = list(PARAMETERS)
    for name, value in values.items():
        table[names.index(name)] = value
    return table
