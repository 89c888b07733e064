"""A new vehicle from partial data: given values stay, the rest are estimates or defaults, named as such in the file.

Estimates, all with their standard deviation in the file:

    thrust          T = k n^2 with k = C_T rho D^4 / (4 pi^2), or m g / (r n_hover^2) of r rotors if hover is known
    yaw torque      c_q = k sqrt(k / (2 rho A)) / FM: momentum theory, figure of merit FM (Leishman 2006)
    inertia         point masses at the hubs and a ball in the middle (Beard 2008, sec. 2)

Leishman, Principles of Helicopter Aerodynamics, 2nd ed. 2006. Beard, Quadrotor Dynamics and Control, 2008. C_T as in
Brandt, Selig, Propeller Performance Data at Low Reynolds Numbers, AIAA 2011-1255 (n there in revolutions per second).
"""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from flight import FloatArray, InputError
from flight.frames import GRAVITY_M_S2
from flight.units import RAD_S_PER_RPM
from vehicle import layouts, presets
from vehicle.effects import find
from vehicle.model import Vehicle, body_parameters
from vehicle.parameters import Limits, Parameter

THRUST_NUMBER, THRUST_NUMBER_STD = 0.15, 0.05
"""C_T at rest: about 0.1 for propellers of 9 to 11 inches (Brandt, Selig 2011); our two examples have 0.11 and 0.24."""
FIGURE_OF_MERIT, FIGURE_OF_MERIT_STD = 0.42, 0.08
"""Hover efficiency of small propellers; our two examples have 0.35 and 0.48."""
MOTOR_SHARE = 0.4
"""Share of the mass in the motors with their propellers; inertias of our examples come out within 30 %."""
INERTIA_STD = 0.3
"""Of the estimate, as a share."""
BALL_RADIUS = 0.5
"""Radius of the ball in the middle, as a share of the arm."""
THRUST_TO_WEIGHT = 2.5
SOUND_M_S = 340.0
THRUST_NUMBERS = (0.01, 1.0)
"""C_T = T / (rho n^2 D^4) of any propeller at rest lies well within; n in revolutions per second."""
LEAST_AUTHORITY = 0.2
"""Smallest singular value of lift and torques by rotor, arms scaled to one; a square X has 1.4."""
LEAST_SHARE = 0.2
"""Of the mean thrust that the least loaded rotor of six or eight has in hover."""
ARM_OVER_TORQUE = 10.0
"""Of an arm to a rotor's torque over its thrust; usual propellers and frames have 8 to 15."""
USUAL_SPINS = (-1.0, 1.0, -1.0, 1.0)
"""Front left clockwise, seen from above; neighbours turn opposite ways."""
COUNTS = {4: "four", 6: "six", 8: "eight"}
TURNS = {-1: "clockwise", 1: "counter-clockwise"}
"""A spin in words, seen from above."""


@dataclass(frozen=True, slots=True)
class Known:
    """The known data of a vehicle; a value that is None or missing is estimated, or required by `missing`."""

    name: str | None = None
    mass_kg: Parameter | None = None
    hub_body_m: FloatArray | None = None
    """(r, 3) from the centre of mass."""
    arm_known: bool = True
    """False: only the directions of the hubs are known, not how far they are."""
    spin: FloatArray | None = None
    """(r,) +1 turns counter-clockwise seen from above."""
    axis_body: FloatArray | None = None
    """(r, 3) unit vectors along the thrusts; None: all along body z."""
    rotor_radius_m: Parameter | None = None
    parameters: Mapping[str, Parameter] = field(default_factory=dict)
    """Inertias, and parameters of effects by full name: the vehicle gets those effects."""
    yaw_torque_to_thrust_m: float | None = None
    """Ratio of a rotor's torque to its thrust."""
    hover_rad_s: float | None = None
    rotor_speed_min_rad_s: float | None = None
    rotor_speed_max_rad_s: float | None = None
    full_stick_rad_s: tuple[float, float, float] | None = None
    """Roll, pitch and yaw rate of the firmware at full stick."""
    notes: tuple[str, ...] = ()
    """Remarks on the import for the reader of the file."""


def layout(arm_m: float, frame: str, firmware: str | None = None) -> tuple[FloatArray, FloatArray]:
    """Hubs (r, 3) and spins (r,) of a symmetric frame, counter-clockwise from the front left (`+`: from the front).

    Args:
        arm_m: from the centre to a hub.
        firmware: whose order of motors to take instead; see `layouts`.
    """
    found = layouts.find(frame, firmware)
    if not 1e-3 <= arm_m <= 10.0:
        raise InputError(
            f"an arm of {arm_m:g} m is not between 0.001 and 10 m; give it from the centre to a motor, in m"
        )
    return found.geometry(arm_m)


def spins(known: Known) -> FloatArray:
    """(r,) those known, or the usual ones of four."""
    return np.array(USUAL_SPINS) if known.spin is None else known.spin


def missing(known: Known) -> list[str]:
    """The data that no formula can estimate: a description of each, with the option that sets it."""
    hubs = known.hub_body_m if known.arm_known else None
    required = {
        "the mass (--mass, kg: weigh it ready to fly)": known.mass_kg,
        "where the rotors are (--arm, metres from the centre to a motor)": hubs,
        "the propeller's diameter (--prop-diameter, metres)": known.rotor_radius_m,
    }
    return [description for description, value in required.items() if value is None]


def draft(known: Known, *, limits: str | None = None) -> Vehicle:
    """A complete vehicle from the known data.

    Args:
        limits: a preset's name; None: that of `preset_for`.

    Raises:
        InputError: mass, rotors or propeller are not known, or a value is out of bounds.
    """
    if lacking := missing(known):
        raise InputError(f"not known: {'; '.join(lacking)}")
    assert known.mass_kg is not None
    assert known.hub_body_m is not None
    assert known.rotor_radius_m is not None
    density = Parameter(
        1.225, 0.05, "kg/m3", "default: standard atmosphere at sea level; 1.1 on a hot day, less in hills"
    )
    given = {"mass_kg": known.mass_kg, "rotor_radius_m": known.rotor_radius_m, "air_density_kg_m3": density}
    given |= {name: p for name, p in known.parameters.items() if "." not in name}
    given = inertia(known.mass_kg.value, known.hub_body_m) | _pose_sensor() | given
    body = body_parameters(**given)
    radius_m = body["rotor_radius_m"].value
    if not 1e-3 <= radius_m <= 10.0:
        raise InputError(f"a propeller of {2 * radius_m:g} m diameter is not between 0.002 and 20 m; give metres")
    acting = _effects(known, radius_m, body["air_density_kg_m3"].value)
    names = sorted({name.split(".")[0] for name in acting}, key=lambda name: find(name).stage)
    rotors = len(known.hub_body_m)
    hover_rad_s = _hover_speed(known.mass_kg.value, rotors, acting, known.hover_rad_s)
    if hover_rad_s is not None:
        _check_propellers(known.mass_kg.value, rotors, hover_rad_s, radius_m, body["air_density_kg_m3"].value)
    spin = spins(known)
    require_controllable(known.hub_body_m, spin, known.axis_body)
    made = Vehicle(
        name=known.name or "my-vehicle",
        parameters=body | acting,
        hub_body_m=known.hub_body_m,
        spin=spin,
        axis_body=known.axis_body,
        effects=tuple(names),
        limits=_rotor_limits(known, hover_rad_s),
        provenance={"made_by": "goshawk vehicle new", "notes": list(known.notes)} | _full_stick(known),
    )
    return replace(made, limits=presets.limits(made, limits or preset_for(known)))


def preset_for(known: Known) -> str:
    """The usual limits where the ratio of thrust to weight is known; careful ones while either is a guess."""
    thrust = known.hover_rad_s is not None or any(name.startswith("thrust_") for name in known.parameters)
    return "usual" if thrust and known.rotor_speed_max_rad_s is not None else "careful"


def _full_stick(known: Known) -> dict[str, list[float]]:
    return {} if known.full_stick_rad_s is None else {presets.FULL_STICK: list(known.full_stick_rad_s)}


def require_controllable(hub_body_m: FloatArray, spin: FloatArray, axis_body: FloatArray | None = None) -> None:
    """Refuse rotors that cannot hold a level hover and turn about all axes: in another order or unit.

    Raises:
        InputError: an arm of another unit, spins alike, or a torque that cannot be made.
    """
    arms = np.hypot(hub_body_m[:, 0], hub_body_m[:, 1])
    if not (arms.min() >= 1e-3 and arms.max() <= 10.0):
        raise InputError(f"arms of {arms.min():.4g} to {arms.max():.4g} m are not from 0.001 to 10 m; give --arm")
    turns = ", ".join(TURNS[int(s)] for s in spin)
    named = f"rotors 0 to {len(spin) - 1} turn {turns}"
    if len(spin) == 4 and axis_body is None and abs(spin.sum()) > 0.0:
        raise InputError(f"{named}; two each way are needed to hold the heading: mend the spins")
    effort = efforts(hub_body_m / arms.max(), spin, axis_body)
    if np.linalg.svd(effort, compute_uv=False)[-1] < LEAST_AUTHORITY:
        raise InputError(
            f"{named} at {np.round(hub_body_m[:, :2], 4).tolist()} m: they cannot lift and turn "
            "about all three axes; neighbours turn opposite ways: mend places or spins"
        )
    if len(spin) == 4:
        return
    share = np.linalg.pinv(effort)[:, 0]
    if share.min() < LEAST_SHARE * share.mean():
        raise InputError(
            f"{named}: a level hover without turning leaves rotor {share.argmin()} with "
            f"{100.0 * share.min() / share.mean():.0f} % of the mean thrust, {100.0 * LEAST_SHARE:.0f} % or more is "
            "needed: mend places, spins or axes"
        )


def efforts(arm: FloatArray, spin: FloatArray, axis_body: FloatArray | None = None) -> FloatArray:
    """(4, r) lift, roll, pitch and yaw by the thrust of each rotor.

    Args:
        arm: (r, 3) hubs in units of the longest arm; yaw is in units of a rotor's torque.
    """
    if axis_body is None:
        return np.stack([np.ones(len(spin)), arm[:, 1], -arm[:, 0], -spin])
    lever = np.cross(arm, axis_body)
    yaw = ARM_OVER_TORQUE * lever[:, 2] - spin * axis_body[:, 2]
    return np.stack([axis_body[:, 2], lever[:, 0], lever[:, 1], yaw])


def _check_propellers(mass_kg: float, rotors: int, hover_rad_s: float, radius_m: float, density_kg_m3: float) -> None:
    """Refuse a hover that no propeller makes: a number in another unit.

    Raises:
        InputError: the tips would be faster than sound, or the thrust coefficient is far from any propeller's.
    """
    tip_m_s = hover_rad_s * radius_m
    figures = f"a mass of {mass_kg:g} kg on {COUNTS.get(rotors, rotors)} propellers of {2.0 * radius_m:g} m"
    if tip_m_s > SOUND_M_S:
        raise InputError(
            f"{figures} hovers at {hover_rad_s / RAD_S_PER_RPM:.0f} rpm with tips at {tip_m_s:.0f} m/s, faster than "
            f"sound ({SOUND_M_S:g} m/s); check --mass (kg), --prop-diameter (m) and --hover-rpm"
        )
    thrust_n = mass_kg * GRAVITY_M_S2 / rotors
    number = thrust_n / (density_kg_m3 * (hover_rad_s / (2.0 * np.pi)) ** 2 * (2.0 * radius_m) ** 4)
    if not THRUST_NUMBERS[0] <= number <= THRUST_NUMBERS[1]:
        raise InputError(
            f"{figures} that hovers at {hover_rad_s / RAD_S_PER_RPM:.0f} rpm has a thrust coefficient C_T of "
            f"{number:.2g}; propellers have {THRUST_NUMBERS[0]:g} to {THRUST_NUMBERS[1]:g}: check --mass (kg), "
            "--prop-diameter (m) and --hover-rpm (rpm, not rad/s)"
        )


def _pose_sensor() -> dict[str, Parameter]:
    place = Parameter(0.0, 0.03, "m", "default: markers or camera at the centre of mass; measure it or let a flight")
    turned = Parameter(0.0, 0.05, "rad", "default: pose sensor not turned; let a flight measure it")
    places = {f"pose_sensor_{axis}_m": place for axis in "xyz"}
    return places | {f"pose_sensor_rotation_{axis}_rad": turned for axis in "xyz"}


def inertia(mass_kg: float, hub_body_m: FloatArray) -> dict[str, Parameter]:
    """Estimated inertias about the centre of mass (Beard 2008, sec. 2, with unequal arms allowed)."""
    from_centre = hub_body_m - hub_body_m.mean(axis=0)
    x, y, z = from_centre.T
    ball = 0.4 * (1.0 - MOTOR_SHARE) * mass_kg * (BALL_RADIUS * float(np.hypot(x, y).mean())) ** 2
    motor_kg = MOTOR_SHARE * mass_kg / len(hub_body_m)
    square_m2 = {"xx": y**2 + z**2, "yy": x**2 + z**2, "zz": x**2 + y**2}
    source = (
        f"estimated: {100 * MOTOR_SHARE:.0f} % of the mass at the hubs, the rest a ball of half the arm (Beard 2008)"
    )
    values = {axis: ball + motor_kg * float(squares.sum()) for axis, squares in square_m2.items()}
    return {
        f"inertia_{axis}_kg_m2": Parameter(_short(v), _short(INERTIA_STD * v, 2), "kg m2", source)
        for axis, v in values.items()
    }


def _effects(known: Known, radius_m: float, density_kg_m3: float) -> dict[str, Parameter]:
    """Parameters of motor lag, thrust and yaw torque, unless given, and of every other effect that is given."""
    given = {name: p for name, p in known.parameters.items() if "." in name}
    assert known.mass_kg is not None
    if not any(name.startswith("thrust_") for name in given):
        given["thrust_quadratic.k_n_s2"] = _thrust(known, radius_m, density_kg_m3)
    if "rotor_yaw_torque.torque_n_m_s2" not in given and "thrust_quadratic.k_n_s2" in given:
        given["rotor_yaw_torque.torque_n_m_s2"] = _yaw_torque(
            given["thrust_quadratic.k_n_s2"], known.yaw_torque_to_thrust_m, radius_m, density_kg_m3
        )
    lag = "default: typical of propellers of 5 inches; larger ones are slower, smaller ones faster"
    for name in ("motor_lag.rise_s", "motor_lag.fall_s"):
        given.setdefault(name, Parameter(0.03, 0.015, "s", lag))
    return given


def _thrust(known: Known, radius_m: float, density_kg_m3: float) -> Parameter:
    assert known.mass_kg is not None
    assert known.hub_body_m is not None
    if known.hover_rad_s is not None:
        rotors = len(known.hub_body_m)
        k = known.mass_kg.value * GRAVITY_M_S2 / (rotors * known.hover_rad_s**2)
        times = COUNTS.get(rotors, rotors)
        source = f"estimated: weight over {times} times the square of the hover speed, {known.hover_rad_s:.0f} rad/s"
        return Parameter(_short(k), _short(0.1 * k, 2), "N s2", source)
    diameter = (2.0 * radius_m) ** 4
    k, std = (c * density_kg_m3 * diameter / (4.0 * np.pi**2) for c in (THRUST_NUMBER, THRUST_NUMBER_STD))
    source = (
        f"estimated: C_T rho D^4 / (4 pi^2), C_T = {THRUST_NUMBER} +- {THRUST_NUMBER_STD} at rest (Brandt, Selig 2011)"
    )
    return Parameter(_short(k), _short(std, 2), "N s2", source + "; --hover-rpm gives a better one")


def _yaw_torque(thrust: Parameter, ratio_m: float | None, radius_m: float, density_kg_m3: float) -> Parameter:
    k = thrust.value
    if ratio_m is not None:
        source = f"given ratio of torque to thrust, {ratio_m:g} m, times thrust_quadratic"
        return Parameter(_short(ratio_m * k), _short(ratio_m * (0.2 * k + thrust.std), 2), "N m s2", source)
    ideal = k * float(np.sqrt(k / (2.0 * density_kg_m3 * np.pi * radius_m**2)))
    share = float(np.hypot(1.5 * thrust.std / k, FIGURE_OF_MERIT_STD / FIGURE_OF_MERIT)) if k > 0.0 else 1.0
    value = ideal / FIGURE_OF_MERIT
    source = f"estimated: momentum theory, figure of merit {FIGURE_OF_MERIT} +- {FIGURE_OF_MERIT_STD} (Leishman 2006)"
    return Parameter(_short(value), _short(share * value, 2), "N m s2", source)


def _hover_speed(
    mass_kg: float, rotors: int, acting: Mapping[str, Parameter], given_rad_s: float | None
) -> float | None:
    """None where the thrust law is not the plain square of rotor speed."""
    k = acting.get("thrust_quadratic.k_n_s2")
    if given_rad_s is not None or k is None or k.value <= 0.0:
        return given_rad_s
    return float(np.sqrt(mass_kg * GRAVITY_M_S2 / (rotors * k.value)))


def _rotor_limits(known: Known, hover_rad_s: float | None) -> Limits:
    """Rotor speeds as known, else from hover and a typical ratio of thrust to weight."""
    plain = Limits()
    usual_max = plain.rotor_speed_max_rad_s if hover_rad_s is None else float(np.sqrt(THRUST_TO_WEIGHT)) * hover_rad_s
    usual_min = plain.rotor_speed_min_rad_s if hover_rad_s is None else 0.2 * hover_rad_s
    fastest = known.rotor_speed_max_rad_s or _short(usual_max)
    if hover_rad_s is not None and fastest <= hover_rad_s:
        raise InputError(
            f"at its fastest rotor speed, {fastest:.0f} rad/s ({fastest / RAD_S_PER_RPM:.0f} rpm), it does not lift "
            f"its weight: hover takes {hover_rad_s:.0f} rad/s with this mass and thrust; check all three"
        )
    slowest = known.rotor_speed_min_rad_s or _short(usual_min)  # rotors that stop cannot be controlled
    return Limits(rotor_speed_min_rad_s=min(slowest, 0.5 * fastest), rotor_speed_max_rad_s=fastest)


def _short(value: float, digits: int = 4) -> float:
    """Rounded to few digits, as an estimate is not exact."""
    return float(f"{value:.{digits}g}")
