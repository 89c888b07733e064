"""What is known beside flights without a pose: a hover command, a rotor's thrust, the mass, the shape of a multirotor.

Each is a measurement with a standard deviation, and counts in the fit as such. Flights show forces and inertias over
the mass alone, so that a thrust on a balance measures the mass, too.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from flight import InputError
from flight.rotations import FloatArray
from sysid.estimator.flights.flight_data import Flight
from sysid.estimator.motors.battery import SAG
from sysid.estimator.options import HoverCommand, RotorThrust
from vehicle import Parameter, Vehicle, specs, wrench
from vehicle.forces import open_air

FLAT, FLAT_STD = 1.7, 0.2
"""Inertia about z over the mean of those about x and y, and its relative deviation: 2 for a flat body, 1 for a ball;
published quadrotors have 1.4 to 1.9. Yaw shows only torque over inertia, and this settles how large both are where
nothing else does."""
Z = "inertia_zz_kg_m2"
SIDEWAYS = ("inertia_xx_kg_m2", "inertia_yy_kg_m2")
SPINNING = ("rotor_acceleration_torque.rotor_inertia_kg_m2", "gyroscopic_torque.rotor_inertia_kg_m2")
"""One quantity in two torques."""
SPINNING_STD = 1e-4
"""By which they may differ, as each takes in a little of what else follows the rotors; a share of the mean of inertia
about x and y, of which a rotor has about a thousandth."""


@dataclass(frozen=True, slots=True, eq=False)
class Beside:
    """The measurements beside some flights."""

    hovers: tuple[HoverCommand, ...]
    """Whose command bears on the curve of thrust."""
    at_voltages: tuple[HoverCommand, ...]
    """Of which only the voltages' effect is of use, for the flights' voltage was not logged."""
    thrusts: tuple[RotorThrust, ...]
    full_rad_s: float
    """Speed that a command of 1 was taken for."""
    volts: float
    """The flights' mean; NaN where it was not logged."""
    mass: Parameter
    """As given."""
    flat: bool
    """Whether the usual shape of a multirotor counts."""
    spinning: bool
    """Whether the rotors' inertia is estimated from both torques that it makes."""

    @property
    def weighs(self) -> bool:
        """Whether the mass is estimated: it was given with an error, and a thrust measures it."""
        return bool(self.thrusts) and self.mass.std > 0.0

    def errors(self, vehicle: Vehicle) -> FloatArray:
        """(r,) in standard deviations, independent of each other."""
        rows = [self._lift(hover, vehicle) / _std_of_lift(hover, vehicle) for hover in self.hovers]
        if self.thrusts:
            rows += list(np.linalg.solve(self._scale(), self._pulls(vehicle)))
        mean = 0.5 * sum(vehicle.value(name) for name in SIDEWAYS)
        if self.flat:
            rows.append(np.log(max(vehicle.value(Z) / (FLAT * mean), 1e-6)) / FLAT_STD)
        if self.spinning and all(name in vehicle.parameters for name in SPINNING):
            one, other = (vehicle.value(name) for name in SPINNING)
            rows.append((other - one) / (SPINNING_STD * mean))
        return np.array(rows, dtype=np.float64)

    def slopes(self, vehicle: Vehicle, names: Sequence[str]) -> FloatArray:
        """(r, p) derivatives of the errors by parameters."""
        here = self.errors(vehicle)
        by = np.zeros((len(here), len(names)))
        for i, name in enumerate(names if len(here) else ()):
            there, step = nudged(vehicle, name)
            by[:, i] = (self.errors(there) - here) / step
        return by

    def mass_factor(self, vehicle: Vehicle) -> tuple[float, float]:
        """The mass by all that is known over the given one, and its standard error: 1 and 0 where nothing bears on it.

        Args:
            vehicle: fitted.
        """
        given = self.mass.std / self.mass.value
        if not self.weighs:
            return 1.0, given
        made = self._made(vehicle)
        weight = np.array([t.std_n for t in self.thrusts]) ** -2.0
        information = given**-2.0 + float(weight @ made**2)
        wanted = given**-2.0 + float(weight @ (made * [t.thrust_n for t in self.thrusts]))
        return wanted / information, information**-0.5

    def hovers_at(self, vehicle: Vehicle, hover: HoverCommand | None) -> float:
        """The command at which a vehicle hovers with the battery of a measured one."""
        ratio = np.linspace(0.01, 1.0, 100)
        thrust = np.maximum.accumulate(rotor_thrust_n(vehicle, self.full_rad_s * ratio))
        answered = float(np.interp(vehicle.mass_kg * vehicle.gravity_m_s2 / vehicle.rotors, thrust, ratio))
        return answered / (_battery_share(hover, vehicle) if hover else 1.0)

    def _lift(self, hover: HoverCommand, vehicle: Vehicle) -> float:
        """Acceleration beyond the weight's at a hover command, m/s2."""
        speed = hover.command * self.full_rad_s * _battery_share(hover, vehicle)
        thrust_n = vehicle.rotors * float(rotor_thrust_n(vehicle, np.array([speed]))[0])
        return thrust_n / vehicle.mass_kg - vehicle.gravity_m_s2

    def _made(self, vehicle: Vehicle) -> FloatArray:
        """Thrust at the commands of `thrusts` as if the mass were the given one, N."""
        speed = self.full_rad_s * np.array([t.command for t in self.thrusts])
        return rotor_thrust_n(vehicle, speed) * self.mass.value / vehicle.mass_kg

    def _pulls(self, vehicle: Vehicle) -> FloatArray:
        return self._made(vehicle) - np.array([t.thrust_n for t in self.thrusts])

    def _scale(self) -> FloatArray:
        """Cholesky factor of the thrusts' covariance: the mass, which is uncertain, moves them together."""
        measured = np.array([t.thrust_n for t in self.thrusts])
        by_mass = measured * self.mass.std / self.mass.value
        covariance = np.diag([t.std_n**2 for t in self.thrusts]) + np.outer(by_mass, by_mass)
        return np.asarray(np.linalg.cholesky(covariance), dtype=np.float64)


def beside(
    anchors: Sequence[HoverCommand | RotorThrust],
    flights: Sequence[Flight],
    vehicle: Vehicle,
    names: Sequence[str],
    priors: Mapping[str, float],
) -> Beside:
    """What is known beside these flights.

    Args:
        names: parameters that are estimated.
        priors: of some, the standard deviation that the user gave.

    Raises:
        InputError: there are anchors, and the flights were logged in rotor speeds.
    """
    full = [f.full_throttle_rad_s for f in flights if f.full_throttle_rad_s is not None]
    if anchors and not full:
        raise InputError(
            "hover commands and a rotor's thrust are told by commands from 0 to 1, and these flights were logged in "
            "rotor speeds: leave --hover and --rotor-thrust out"
        )
    volts = float(np.mean(np.concatenate([f.battery_v for f in flights])))
    hovers = [a for a in anchors if isinstance(a, HoverCommand)]
    own = [h for h in hovers if h.battery_v is None or np.isfinite(volts)]
    aside = [h for h in hovers if h.battery_v is not None and not np.isfinite(volts)]
    if len({h.battery_v for h in aside}) < 2:  # one voltage alone tells nothing: it was the flights'
        own, aside = hovers, []
    return Beside(
        hovers=tuple(own),
        at_voltages=tuple(aside),
        thrusts=tuple(a for a in anchors if isinstance(a, RotorThrust)),
        full_rad_s=full[0] if full else 1.0,
        volts=volts,
        mass=vehicle.parameter("mass_kg"),
        flat=Z in names and Z not in priors and all(name in names for name in SIDEWAYS),
        spinning=all(name in names for name in SPINNING),
    )


def with_sag(vehicle: Vehicle, known: Beside) -> Vehicle:
    """The vehicle with the battery's effect, where a hover command at a voltage can tell it beside logged voltage."""
    if SAG in vehicle.effects or not np.isfinite(known.volts) or all(h.battery_v is None for h in known.hovers):
        return vehicle
    return vehicle.with_effect(SAG, sag_per_v=0.03, reference_v=known.volts)


def scaled(vehicle: Vehicle, factor: float, std: float) -> Vehicle:
    """The vehicle with another mass, and with it all forces and inertias that flights show over the mass.

    Args:
        std: of the factor.
    """
    for name, parameter in vehicle.parameters.items():
        if parameter.unit.startswith(("N", "kg")) and name not in ("mass_kg", "air_density_kg_m3"):
            changed = factor * parameter.value
            vehicle = vehicle.with_value(name, changed, std=factor * parameter.std, source=parameter.source)
    mass_kg = factor * vehicle.mass_kg
    return vehicle.with_value("mass_kg", mass_kg, std=std * mass_kg / factor, source="given, and by a rotor's thrust")


def rotor_thrust_n(vehicle: Vehicle, speed_rad_s: FloatArray) -> FloatArray:
    """(n,) of one rotor in air at rest at speeds (n,)."""
    still = np.zeros((len(speed_rad_s), 3))
    speeds, share = np.repeat(speed_rad_s[:, None], vehicle.rotors, axis=1), 1.0 / vehicle.rotors
    return share * wrench(vehicle, still, still, speeds, open_air(len(speed_rad_s), vehicle.rotors))[0][:, 2]


def nudged(vehicle: Vehicle, name: str) -> tuple[Vehicle, float]:
    """The vehicle with one parameter a little off, within its bounds, and by how much: for derivatives."""
    value, (_, most) = vehicle.value(name), specs(vehicle)[name].bounds
    step = 1e-5 * max(abs(value), 1e-9)
    step = -step if value + step > most else step
    return vehicle.with_value(name, value + step), step


def _battery_share(hover: HoverCommand, vehicle: Vehicle) -> float:
    """Of the commanded speed that the battery makes."""
    if SAG not in vehicle.effects or hover.battery_v is None:
        return 1.0
    of = vehicle.values(SAG)
    return 1.0 - of.sag_per_v * (of.reference_v - hover.battery_v)


def _std_of_lift(hover: HoverCommand, vehicle: Vehicle) -> float:
    """By the square law, m/s2."""
    return 2.0 * vehicle.gravity_m_s2 * hover.std / hover.command
