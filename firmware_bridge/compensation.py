"""Which effects of a vehicle model the embedded controller cancels, and how: the one table."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from types import MappingProxyType


@dataclass(frozen=True, slots=True)
class Compensation:
    """What the controller does about one effect."""

    compensated: bool
    how: str
    """How it is cancelled, or why it is not, in words for the user."""
    targets: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    """The effect's parameters, each with the controller parameters that take its value."""
    only_with: str | None = None
    """The effect that must be active too; without it this one is not cancelled."""

    def __bool__(self) -> bool:
        return self.compensated


def _yes(how: str, targets: Mapping[str, tuple[str, ...]] | None = None, only_with: str | None = None) -> Compensation:
    return Compensation(True, how, targets or {}, only_with)


def _no(why: str) -> Compensation:
    return Compensation(False, why)


def _same(names: str, *controller_names: str) -> dict[str, tuple[str, ...]]:
    return {name: (target,) for name, target in zip(names.split(), controller_names, strict=True)}


EFFECTS: Mapping[str, Compensation] = MappingProxyType({
    # thrust laws
    "thrust_bem": _yes("inverted exactly, flow at each hub", _same("k1_n_s2 k2_n_s2_m", "k1_n_s2", "k2_n_s2_m")),
    "thrust_blade_element": _no("the thrust law has no advance ratio; refit thrust_bem with translational_lift"),
    "thrust_quadratic": _yes("inverted exactly", _same("k_n_s2", "quad_n_s2")),
    "inflow_linear": _yes("inverted exactly", _same("inflow_kg", "inflow_kg"), only_with="thrust_quadratic"),
    "thrust_affine": _no("the thrust law is a square: it agrees with the curve at hover, with thrust_quadratic"),
    "translational_lift": _yes("taken off the thrust asked of each rotor", _same("lift_kg_m", "lift_kg_m")),
    "weak_rotor": _yes(
        "the rotor's own gain in the mixer", {f"loss_{i}": (f"rotor{i}_gain",) for i in range(4)}
    ),
    "rotor_interaction": _no("small, and its form is too uncertain to feed forward"),
    "descent_loss": _no("the flow is unsteady there; plan slower descents"),
    "ground_effect": _no("the controller does not know its height over the ground; feedback takes it"),
    "ceiling_effect": _no("the controller does not know the gap; feedback takes it"),
    # drag
    "rotor_drag_thrust": _yes("fed forward at the set-point velocity", _same("drag_s_m", "rotor_drag_s_m")),
    "rotor_drag_speed": _yes(
        "force fed forward at the set-point velocity, its moment in the mixer", _same("drag_kg", "rotor_drag_kg")
    ),
    "parasitic_drag": _yes(
        "fed forward at the set-point velocity",
        {"drag_xy_kg_m": ("drag_x_kg_m", "drag_y_kg_m"), "drag_z_kg_m": ("drag_z_kg_m",)},
    ),
    "parasitic_drag_speed": _yes(
        "fed forward at the set-point velocity", {f"drag_{a}_kg_m": (f"drag_norm_{a}_kg_m",) for a in "xyz"}
    ),
    "parasitic_drag_linear": _no("the controller has no drag that is linear alone; feedback takes it"),
    "constant_wind": _no("the controller knows no wind; its integrator (ki_xy_1_s3) takes the steady part"),
    # moments
    "rotor_yaw_torque": _yes("inverted exactly", _same("torque_n_m_s2", "cq_n_m_s2")),
    "torque_affine": _no("the torque law is a square: it agrees with the curve at hover, with thrust_quadratic"),
    "centre_of_mass": _yes("arms of the mixer are from the centre of mass"),
    "centre_of_mass_height": _no("the mixer's arms lie in one plane; attitude feedback takes it"),
    "flapping_moment": _yes("taken off the torque asked of the mixer", _same("moment_kg_m", "flapping_kg_m")),
    "wake_skew_moment": _no("attitude feedback takes it"),
    "uneven_rotor_torque": _no("small, and in yaw alone; attitude feedback takes it"),
    "angular_damping": _yes(
        "taken off the torque asked of the mixer", {f"{a}_n_m_s": (f"damping_{a}_n_m_s",) for a in "xyz"}
    ),
    "angular_damping_quadratic": _no("attitude feedback takes it"),
    "airframe_side_moment": _no("attitude feedback takes it"),
    "gyroscopic_torque": _no("attitude feedback takes it"),
    "rotor_acceleration_torque": _no("attitude feedback takes it"),
    # mass
    "payload": _yes("mass, principal inertias and centre of mass are those with the payload; not its height"),
    "products_of_inertia": _no("the attitude loop works with the three principal inertias"),
    # drive
    "motor_lag": _yes("speed command led by the rise time; the fall time is not used", _same("rise_s", "rotor_lag_s")),
    "battery_sag": _yes(
        "speed command raised by the measured voltage",
        _same("sag_per_v reference_v", "battery_gain_1_v", "battery_ref_v"),
    ),
    # sensors
    "imu_errors": _no("handled by the estimator"),
    "pose_delay": _no("handled by the estimator; a known remaining delay can be set as predict_extra_s"),
})  # fmt: skip


def missing_partner(effect: str, active: tuple[str, ...]) -> bool:
    """Whether a compensated effect cannot be cancelled because the law it belongs to is not active."""
    partner = EFFECTS[effect].only_with
    return partner is not None and (partner not in active or "thrust_bem" in active)
