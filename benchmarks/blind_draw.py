"""What a blind campaign hides: the true vehicle, the effects its file lacks, and the answers that count as correct."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any

import blind_forms
import numpy as np
from blind_truth import (
    CHANNELS,
    AffineThrust,
    DragPerAxis,
    GroundCushion,
    RotorFriction,
    RotorGyroscope,
    RotorSpinUp,
    SideMoment,
    SpinDamping,
    Strange,
    Tether,
    ThrustScaledDrag,
    TiredRotor,
    VortexRing,
    WakeOnRear,
)

KINDS = ("single", "pair", "none", "outside", "foreign", "form")
BATTERY_V = 16.8
"""Full, where speed equals command."""
AIR_DENSITY_KG_M3 = 1.225

Rng = np.random.Generator
Sizes = dict[str, float]


@dataclass(slots=True)
class Truth:
    """Ground truth, hidden from the diagnosis."""

    kind: str
    body: dict[str, Any]
    """RotorPy's parameters; terms that are neither known nor hidden are zero."""
    known: set[str]
    """Terms the vehicle file holds."""
    centre_m: tuple[float, float] = (0.0, 0.0)
    sensor_m: tuple[float, float, float] = (0.0, 0.0, 0.0)
    """Pose sensor from the centre of mass."""
    sensor_turn_rad: tuple[float, float, float] = (0.0, 0.0, 0.0)
    wind_m_s: tuple[float, float, float] = (0.0, 0.0, 0.0)
    gust_m_s: float = 0.3
    delay_s: float = 0.0
    rotor_late_s: float = 0.0
    """By how much the stamps of rotor speed (or of its command) are too late; negative: too early."""
    commands_only: bool = False
    """Whether the log holds commands in place of measured rotor speed."""
    sag_per_v: float = 0.0
    drop_v: float = 0.0
    """By how much the battery's voltage falls in each flight."""
    payload_kg: float = 0.0
    low: bool = False
    """Whether some flights come near the ground."""
    extras: list[Any] = field(default_factory=list)
    hidden: dict[str, Sizes] = field(default_factory=dict)
    """Effect, in the catalogue's name, to its true parameters."""
    believed: list[str] = field(default_factory=list)
    """Drag forms the vehicle file holds in place of the true ones ..."""
    real: list[str] = field(default_factory=list)
    """... and the true ones: naming them is correct, but the wrong form may be a sufficient proxy for them."""
    channels: list[str] = field(default_factory=list)
    """Outside the catalogue: channels that count as right ..."""
    variables: list[str] = field(default_factory=list)
    """... and variables that do."""
    near: list[str] = field(default_factory=list)
    """A law of another form than the catalogue's: effects that are the nearest to it; naming one is correct."""
    law: str = ""


@dataclass(frozen=True, slots=True)
class Conditions:
    """How a campaign is flown and recorded."""

    gusts: bool = True
    offset: bool = False
    """Whether the clock of the rotor speeds is off, by up to `MOST_OFFSET_S`."""
    commands: bool = False
    """Whether only commands are logged."""


MOST_OFFSET_S = 0.008


def draw(kind: str, rng: Rng, conditions: Conditions = Conditions(), hide: Sequence[str] = ()) -> Truth:
    """One campaign of a kind; a single or a pair hides the effects of `hide` if given, else drawn ones."""
    truth = _vehicle(kind, rng)
    truth.commands_only = conditions.commands
    truth.gust_m_s *= conditions.gusts
    if conditions.commands:
        truth.known.add("motor_lag")
        truth.drop_v = float(rng.uniform(1.0, 2.0))
    if conditions.offset:
        truth.rotor_late_s = float(rng.uniform(-MOST_OFFSET_S, MOST_OFFSET_S))
    if kind in ("single", "pair"):
        catalogue = HIDDEN | (BY_COMMAND if conditions.commands else {})
        for name in hide or _choose(1 if kind == "single" else 2, rng, catalogue):
            truth.hidden[name] = catalogue[name](truth, rng)
    elif kind == "form":
        _form(truth, rng)
    elif kind == "outside":
        _outside(truth, rng)
    elif kind == "foreign":
        _foreign(truth, rng)
    low = "ground_effect" in (*truth.hidden, *truth.near)
    truth.low = low or bool(rng.random() < 0.4)
    _zero_unused_terms(truth)
    return truth


def _vehicle(kind: str, rng: Rng) -> Truth:
    """RotorPy's Hummingbird with every number moved, and what its file knows."""
    from rotorpy.vehicles.hummingbird_params import quad_params

    body = dict(quad_params) | {"kp_att": 260.0, "kd_att": 26.0, "tau_m": float(rng.uniform(0.018, 0.03))}
    for name in ("mass", "Ixx", "Iyy", "Izz", "k_eta", "k_m", "k_z", "k_h", "c_Dx", "c_Dy", "c_Dz"):
        body[name] = float(body[name] * rng.uniform(0.8, 1.25))
    body["k_d"] = float(body["k_d"] * rng.uniform(0.5, 1.0))
    body["k_flap"] = float(rng.uniform(0.8e-6, 2.5e-6))
    known = {"inflow_linear", "rotor_drag_speed", "parasitic_drag_speed"}
    for name, share in {"translational_lift": 0.7, "flapping_moment": 0.4, "centre_of_mass": 0.6}.items():
        if rng.random() < share:
            known.add(name)
    offset = rng.uniform(-0.003, 0.003, 2)
    centre = (float(offset[0]), float(offset[1])) if "centre_of_mass" in known else (0.0, 0.0)
    return Truth(
        kind,
        body,
        known,
        centre_m=centre,
        sensor_m=_triple(rng.normal(0.0, 0.04, 3)),
        sensor_turn_rad=_triple(rng.normal(0.0, 0.01, 3)),
        gust_m_s=float(rng.uniform(0.15, 0.35)),
    )


def _zero_unused_terms(truth: Truth) -> None:
    """Terms that are neither known nor hidden do not act."""
    present = truth.known | set(truth.hidden) | set(truth.real)
    for name, terms in _ROTORPY_TERMS.items():
        if name not in present:
            truth.body |= dict.fromkeys(terms, 0.0)
    x, y = truth.centre_m
    truth.body["rotor_pos"] = {n: np.asarray(r) - [x, y, 0.0] for n, r in truth.body["rotor_pos"].items()}


_ROTORPY_TERMS = {
    "inflow_linear": ("k_z",),
    "translational_lift": ("k_h",),
    "rotor_drag_speed": ("k_d",),
    "flapping_moment": ("k_flap",),
    "parasitic_drag_speed": ("c_Dx", "c_Dy", "c_Dz"),
}


def _triple(values: Any) -> tuple[float, float, float]:
    return float(values[0]), float(values[1]), float(values[2])


def _size(rng: Rng, low: float, high: float) -> float:
    return float(np.exp(rng.uniform(np.log(low), np.log(high))))


def _choose(count: int, rng: Rng, catalogue: dict[str, Callable[[Truth, Rng], Sizes]]) -> list[str]:
    """Different effects that do not change the same term of the true vehicle.

    Of a campaign with commands alone, half of the first are effects that only commands show.
    """
    own = sorted(set(catalogue) - set(HIDDEN))
    while True:
        names = [str(n) for n in rng.choice(sorted(HIDDEN), count, replace=False)]
        if own and rng.random() < 0.5:
            names[0] = str(rng.choice(own))
        if not any({a, b} <= group for a in names for b in names if a != b for group in _RIVALS):
            return names


_RIVALS = (
    {"rotor_drag_speed", "rotor_drag_thrust"},
    {"parasitic_drag", "parasitic_drag_speed"},
    {"angular_damping", "angular_damping_quadratic"},
)


def _weak_rotor(t: Truth, rng: Rng) -> Sizes:
    rotor, share = int(rng.integers(4)), _size(rng, 0.003, 0.06)
    t.extras.append(TiredRotor(rotor, share))
    return {f"loss_{i}": share if i == rotor else 0.0 for i in range(4)}


def _centre_of_mass(t: Truth, rng: Rng) -> Sizes:
    t.known.discard("centre_of_mass")
    size, angle = _size(rng, 6e-5, 2.5e-3), rng.uniform(0.0, 2.0 * np.pi)
    t.centre_m = (float(size * np.cos(angle)), float(size * np.sin(angle)))
    return {"x_m": t.centre_m[0], "y_m": t.centre_m[1]}


def _ground_effect(t: Truth, rng: Rng) -> Sizes:
    factor = _size(rng, 0.5, 2.5)
    t.extras.append(GroundCushion(factor, t.body["rotor_radius"]))
    return {"strength": factor}


def _angular_damping(t: Truth, rng: Rng) -> Sizes:
    about = _triple([_size(rng, 8e-4, 5e-3), _size(rng, 8e-4, 5e-3), _size(rng, 4e-4, 2e-3)])
    t.extras.append(SpinDamping(linear_n_m_s=about))
    return dict(zip(("x_n_m_s", "y_n_m_s", "z_n_m_s"), about, strict=True))


def _rotor_spin_up(t: Truth, rng: Rng) -> Sizes:
    inertia = _size(rng, 4e-7, 1.2e-5)
    t.extras.append(RotorSpinUp(inertia))
    return {"rotor_inertia_kg_m2": inertia}


def _friction(t: Truth, rng: Rng) -> Sizes:
    slope = _size(rng, 2e-6, 1e-5)
    t.extras.append(RotorFriction(slope))
    return {"slope_n_m_s": slope}


def _gyroscope(t: Truth, rng: Rng) -> Sizes:
    inertia = _size(rng, 1.5e-6, 2.5e-5)
    t.extras.append(RotorGyroscope(inertia))
    return {"rotor_inertia_kg_m2": inertia}


def _rotorpy_term(name: str, term: str, parameter: str, low: float, high: float) -> Callable[[Truth, Rng], Sizes]:
    """A term RotorPy has and the vehicle file lacks."""

    def take(t: Truth, rng: Rng) -> Sizes:
        t.known.discard(name)
        t.body[term] = _size(rng, low, high)
        return {parameter: t.body[term]}

    return take


def _parasitic_speed(t: Truth, rng: Rng) -> Sizes:
    t.known.discard("parasitic_drag_speed")
    for axis in "xyz":
        t.body[f"c_D{axis}"] = _size(rng, 2.5e-3, 1.2e-2)
    return {f"drag_{axis}_kg_m": t.body[f"c_D{axis}"] for axis in "xyz"}


def _parasitic_axis(t: Truth, rng: Rng) -> Sizes:
    t.known.discard("parasitic_drag_speed")
    level, upright = _size(rng, 2.5e-3, 1.2e-2), _size(rng, 5e-3, 2.5e-2)
    t.extras.append(DragPerAxis(level, upright))
    return {"drag_xy_kg_m": level, "drag_z_kg_m": upright}


def _thrust_drag(t: Truth, rng: Rng) -> Sizes:
    t.known.discard("rotor_drag_speed")
    drag = _size(rng, 0.008, 0.035)
    t.extras.append(ThrustScaledDrag(drag))
    return {"drag_s_m": drag}


def _wind(t: Truth, rng: Rng) -> Sizes:
    speed, angle = _size(rng, 0.25, 2.0), rng.uniform(0.0, 2.0 * np.pi)
    t.wind_m_s = _triple([speed * np.cos(angle), speed * np.sin(angle), 0.0])
    return dict(zip(("x_m_s", "y_m_s", "z_m_s"), t.wind_m_s, strict=True))


def _side_moment(t: Truth, rng: Rng) -> Sizes:
    arm = _triple(rng.choice([-1.0, 1.0], 3) * [_size(rng, 1e-5, 2e-4) for _ in range(3)])
    t.extras.append(SideMoment(arm))
    return dict(zip(("x_kg", "y_kg", "z_kg"), arm, strict=True))


def _descent(t: Truth, rng: Rng) -> Sizes:
    depth = _size(rng, 0.06, 0.35)
    t.extras.append(VortexRing(depth, t.body["rotor_radius"], AIR_DENSITY_KG_M3))
    return {"depth": depth}


def _payload(t: Truth, rng: Rng) -> Sizes:
    t.payload_kg = t.body["mass"] * _size(rng, 0.04, 0.2)
    return {"added_kg": t.payload_kg, "x_m": 0.0, "y_m": 0.0, "z_m": PAYLOAD_Z_M}


PAYLOAD_Z_M = -0.03


def _products(t: Truth, rng: Rng) -> Sizes:
    terms = _triple(rng.choice([-1.0, 1.0], 3) * [_size(rng, 3e-5, 4e-4) for _ in range(3)])
    t.body |= dict(zip(("Ixy", "Ixz", "Iyz"), terms, strict=True))
    return dict(zip(("xy_kg_m2", "xz_kg_m2", "yz_kg_m2"), terms, strict=True))


def _delay(t: Truth, rng: Rng) -> Sizes:
    t.delay_s = _size(rng, 0.002, 0.02)
    return {"delay_s": t.delay_s}


def _affine(t: Truth, rng: Rng) -> Sizes:
    slope = float(rng.choice([-1.0, 1.0])) * _size(rng, 3e-4, 1.5e-3)
    t.extras.append(AffineThrust(0.0, slope))
    return {"constant_n": 0.0, "slope_n_s": slope}


def _interaction(t: Truth, rng: Rng) -> Sizes:
    loss = _size(rng, 6e-4, 1e-2)
    t.extras.append(WakeOnRear(loss))
    return {"loss_s_m": loss}


HIDDEN: dict[str, Callable[[Truth, Rng], Sizes]] = {
    "weak_rotor": _weak_rotor,
    "centre_of_mass": _centre_of_mass,
    "ground_effect": _ground_effect,
    "angular_damping": _angular_damping,
    "rotor_acceleration_torque": _rotor_spin_up,
    "gyroscopic_torque": _gyroscope,
    "torque_affine": _friction,
    "translational_lift": _rotorpy_term("translational_lift", "k_h", "lift_kg_m", 8e-4, 5e-3),
    "inflow_linear": _rotorpy_term("inflow_linear", "k_z", "inflow_kg", 5e-5, 3.5e-4),
    "rotor_drag_speed": _rotorpy_term("rotor_drag_speed", "k_d", "drag_kg", 1e-5, 1.2e-4),
    "flapping_moment": _rotorpy_term("flapping_moment", "k_flap", "moment_kg_m", 6e-8, 2.5e-6),
    "parasitic_drag_speed": _parasitic_speed,
    "parasitic_drag": _parasitic_axis,
    "rotor_drag_thrust": _thrust_drag,
    "constant_wind": _wind,
    "airframe_side_moment": _side_moment,
    "descent_loss": _descent,
    "payload": _payload,
    "products_of_inertia": _products,
    "pose_delay": _delay,
    "thrust_affine": _affine,
    "rotor_interaction": _interaction,
}
"""Effects a campaign can hide, by the catalogue's name; each draws a size, changes the truth, and returns the size."""


def _motor_lag(t: Truth, rng: Rng) -> Sizes:
    t.known.discard("motor_lag")
    return {"rise_s": t.body["tau_m"], "fall_s": t.body["tau_m"]}


def _sag(t: Truth, rng: Rng) -> Sizes:
    t.sag_per_v = _size(rng, 0.01, 0.05)
    return {"sag_per_v": t.sag_per_v}


BY_COMMAND: dict[str, Callable[[Truth, Rng], Sizes]] = {"motor_lag": _motor_lag, "battery_sag": _sag}
"""Further ones that lie between command and rotor speed."""

OUTSIDE: tuple[tuple[str, str, tuple[str, ...], tuple[float, float]], ...] = (
    # channel, law of `Strange`, variables that count as right, range of the size (N or N m)
    ("F_y", "rotor_wave", ("n", "n_0", "n_1", "n_2", "n_3"), (0.08, 0.35)),
    ("F_x", "one_rotor_wave", ("n_1",), (0.1, 0.35)),
    ("M_y", "sink_square", ("v_z",), (8e-4, 4e-3)),
    ("F_x", "sink", ("v_z",), (0.06, 0.25)),
    ("M_z", "height", ("height",), (5e-4, 3e-3)),
    ("F_y", "slosh", ("time",), (0.06, 0.25)),
    ("F_z", "fading", ("time",), (0.06, 0.25)),
    ("F_x", "cubic_ahead", ("v_x",), (-0.3, -0.08)),
    ("M_z", "square_ahead", ("v_x",), (6e-4, 3e-3)),
    ("M_x", "square_aside", ("v_y",), (6e-4, 3e-3)),
    ("M_y", "turning", ("w_z",), (8e-4, 4e-3)),
    ("F_y", "wave_ahead", ("v_x",), (0.06, 0.25)),
    ("F_z", "wall", ("x",), (0.08, 0.3)),
    ("F_x", "tether", ("x", "y"), (0.02, 0.08)),
)


def _outside(t: Truth, rng: Rng) -> None:
    channel, law, variables, (low, high) = OUTSIDE[int(rng.integers(len(OUTSIDE)))]
    size = float(np.sign(low)) * _size(rng, *sorted((abs(low), abs(high))))
    if law == "tether":
        t.extras.append(Tether(size, (float(rng.uniform(-2, 2)), float(rng.uniform(-2, 2)))))
        t.channels = ["F_x_world", "F_y_world", "F_x", "F_y"]
    else:
        assert channel in CHANNELS
        t.extras.append(Strange(channel, law, size))
        t.channels = [channel]
    t.variables, t.law = list(variables), f"{channel}: {Strange.LAWS.get(law, law)}, size {size:.3g}"


def _foreign(t: Truth, rng: Rng) -> None:
    """The file's drag is of another form than the truth's; half the time something else is missing as well."""
    rotor = bool(rng.random() < 0.7)
    if rotor and rng.random() < 0.5:
        _swap(t, "rotor_drag_speed", "rotor_drag_thrust", ThrustScaledDrag(_size(rng, 0.01, 0.03)))
    elif rotor:
        _swap(t, "rotor_drag_thrust", "rotor_drag_speed", None)
    if not rotor or rng.random() < 0.4:
        if rng.random() < 0.5:
            drag = DragPerAxis(_size(rng, 4e-3, 1e-2), _size(rng, 8e-3, 2e-2))
            _swap(t, "parasitic_drag_speed", "parasitic_drag", drag)
        else:
            _swap(t, "parasitic_drag", "parasitic_drag_speed", None)
    if rng.random() < 0.5:
        other = [n for n in sorted(HIDDEN) if "drag" not in n and n != "constant_wind"]
        name = str(rng.choice(other))
        t.hidden[name] = HIDDEN[name](t, rng)


def _form(t: Truth, rng: Rng) -> None:
    """A law of another form than the catalogue's, on a vehicle of whose file all else is right."""
    form = blind_forms.draw(rng, t.body["rotor_radius"])
    t.known -= set(form.near)
    t.extras.append(form.extra)
    t.near, t.law = list(form.near), form.law
    t.channels, t.variables = list(form.channels), list(form.variables)


def _swap(t: Truth, believed: str, real: str, extra: Any) -> None:
    """The file has `believed`; the true vehicle has `real`."""
    t.known -= {believed, real}
    t.believed.append(believed)
    t.real.append(real)
    if extra is not None:
        t.extras.append(extra)
