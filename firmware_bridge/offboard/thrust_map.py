"""Between normalised throttle and collective force: as a vehicle model has it, or fitted to a flight."""

from dataclasses import dataclass, replace

import numpy as np

from flight import FloatArray, InputError

_FEWEST = 50
"""Rows that a fit needs."""
_VOLTAGE_RATIO = 0.5, 1.2
"""Of thrusts by voltage; a reading beyond is none of this battery's."""


@dataclass(frozen=True, slots=True)
class ThrustMap:
    """force = (c0 + c1 u + c2 u^2) (1 - s (V0 - V))^2 for a throttle u of 0 to 1 in air at rest.

    A rotor's speed falls with the voltage, and its thrust goes with the square of the speed; the throttle is that of
    rotors whose output is an affine function of it, as Betaflight's without `thrust_linear`.
    """

    coefficients_n: tuple[float, float, float]
    """c0, c1, c2."""
    reference_v: float = 0.0
    """V0, of a battery at which the coefficients hold."""
    sag_per_v: float = 0.0
    """s, the share of speed lost per volt below it; 0: the battery's voltage is not allowed for."""

    def force_n(self, throttle: float, battery_v: float = 0.0) -> float:
        """Collective force of a throttle; without a measured voltage (0) as at the reference."""
        c0, c1, c2 = self.coefficients_n
        return self._voltage_ratio(battery_v) * (c0 + c1 * throttle + c2 * throttle**2)

    def throttle(self, force_n: float, battery_v: float = 0.0) -> float:
        """The throttle of 0 to 1 that comes closest to a force."""
        c0, c1, c2 = self.coefficients_n
        wanted_n = force_n / self._voltage_ratio(battery_v) - c0
        if abs(c2) < 1e-9 * abs(c1):
            return float(np.clip(wanted_n / c1, 0.0, 1.0))
        root = max(c1**2 + 4.0 * c2 * wanted_n, 0.0)
        return float(np.clip((np.sqrt(root) - c1) / (2.0 * c2), 0.0, 1.0))

    def _voltage_ratio(self, battery_v: float) -> float:
        if not battery_v > 0.0:
            return 1.0
        speed = max(1.0 - self.sag_per_v * (self.reference_v - battery_v), 0.0)
        return float(np.clip(speed**2, *_VOLTAGE_RATIO))


def through(
    throttle: FloatArray, force_n: FloatArray, *, reference_v: float = 0.0, sag_per_v: float = 0.0
) -> ThrustMap:
    """The map nearest to points (n,) of throttle and collective force.

    Raises:
        InputError: it does not rise with the throttle.
    """
    terms = np.column_stack([np.ones_like(throttle), throttle, throttle**2])
    c = np.linalg.lstsq(terms, force_n, rcond=None)[0]
    span = np.linspace(float(throttle.min()), float(throttle.max()), 20)
    if not (np.diff(c[0] + c[1] * span + c[2] * span**2) > 0.0).all():
        raise InputError(f"the thrust does not rise with the throttle from {span[0]:.2f} to {span[-1]:.2f}")
    return ThrustMap((float(c[0]), float(c[1]), float(c[2])), reference_v, sag_per_v)


def scaled_to_flight(
    before: ThrustMap, throttle: FloatArray, force_n: FloatArray, battery_v: FloatArray | None = None
) -> ThrustMap:
    """A map whose size is that of a flight: its shape stays, as hover and gentle flight show one point of it.

    Args:
        throttle: (n,) that was commanded, of rows in free air.
        force_n: (n,) collective force felt: mass times specific force along body z.

    Raises:
        InputError: too few rows.
    """
    rows = np.isfinite(throttle) & np.isfinite(force_n) & (throttle > 0.02)
    if rows.sum() < _FEWEST:
        raise InputError(f"{int(rows.sum())} rows of throttle and force in free air; a thrust map needs {_FEWEST}")
    volts = np.zeros(len(throttle)) if battery_v is None else battery_v
    model_n = np.array([before.force_n(float(u), float(v)) for u, v in zip(throttle[rows], volts[rows], strict=True)])
    ratio = float(model_n @ force_n[rows] / (model_n @ model_n))
    c0, c1, c2 = before.coefficients_n
    return replace(before, coefficients_n=(ratio * c0, ratio * c1, ratio * c2))
