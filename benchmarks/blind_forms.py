"""Laws of another form than the catalogue's: the same physics in other words, as a real vehicle has it.

Each saturates, has another exponent, or reads another variable than the law of the catalogue that is nearest to it.
For the diagnosis the nearest name is right, for it is the best that the catalogue has; so is the curve of the variable.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from blind_flight import Air, Array
from blind_truth import Added

Rng = np.random.Generator


@dataclass(frozen=True, slots=True)
class Form:
    """One drawn law, and which answers count as right."""

    extra: Any
    near: tuple[str, ...]
    """Effects of the catalogue that are the nearest."""
    channels: tuple[str, ...]
    variables: tuple[str, ...]
    law: str


def _of(air: Air, force: Array | None = None, torque: Array | None = None) -> tuple[Array, Array]:
    nothing = np.zeros_like(air.velocity)
    return (nothing if force is None else force), (nothing if torque is None else torque)


@dataclass(frozen=True, slots=True)
class RootDamping(Added):
    """Turning meets a torque with the exponent 1.5: between the catalogue's linear and its quadratic law."""

    torque_n_m: tuple[float, float, float]
    """At 1 rad/s."""

    def wrench(self, air: Air, thrust: Array) -> tuple[Array, Array]:
        size = np.array(self.torque_n_m)[:, None]
        return _of(air, torque=-size * np.sign(air.rate) * np.abs(air.rate) ** 1.5)


@dataclass(frozen=True, slots=True)
class SaturatingDrag(Added):
    """Level drag that grows with speed and then no more."""

    force_n: float
    speed_m_s: float

    def wrench(self, air: Air, thrust: Array) -> tuple[Array, Array]:
        force = np.zeros_like(air.velocity)
        force[:2] = -self.force_n * np.tanh(air.velocity[:2] / self.speed_m_s)
        return _of(air, force)


@dataclass(frozen=True, slots=True)
class SteepDrag(Added):
    """Drag with the exponent 2.6 of the air speed."""

    force_n: float
    """At 5 m/s."""

    def wrench(self, air: Air, thrust: Array) -> tuple[Array, Array]:
        speed = np.sqrt(np.square(air.velocity).sum(axis=0)) + 1e-9
        return _of(air, -self.force_n * (speed / 5.0) ** 2.6 * air.velocity / speed)


@dataclass(frozen=True, slots=True)
class SoftCushion(Added):
    """Ground effect that fades exponentially with the height, as measured on some multirotors."""

    share: float
    fades_over_m: float

    def thrust(self, air: Air, thrust: Array) -> Array:
        return thrust * (1.0 + self.share * np.exp(-np.maximum(air.position[2], 0.0) / self.fades_over_m))


@dataclass(frozen=True, slots=True)
class SaturatingLift(Added):
    """Translational lift that is used up at speed."""

    lift_n: float
    """Per rotor, at high speed."""
    speed_m_s: float

    def thrust(self, air: Air, thrust: Array) -> Array:
        square = np.square(air.velocity[:2]).sum(axis=0) / self.speed_m_s**2
        return thrust + self.lift_n * square / (1.0 + square)


@dataclass(frozen=True, slots=True)
class BluntMoment(Added):
    """A moment against the motion that does not know the rotor speed, weaker about one axis, and saturates."""

    torque_n_m: tuple[float, float]
    """About x and y."""
    speed_m_s: float

    def wrench(self, air: Air, thrust: Array) -> tuple[Array, Array]:
        torque = np.zeros_like(air.rate)
        torque[0] = -self.torque_n_m[0] * np.tanh(air.velocity[1] / self.speed_m_s)
        torque[1] = self.torque_n_m[1] * np.tanh(air.velocity[0] / self.speed_m_s)
        return _of(air, torque=torque)


@dataclass(frozen=True, slots=True)
class SinkLoss(Added):
    """Thrust lost in a descent: a step that begins at a sink rate, the same for every rotor and thrust."""

    share: float
    begins_m_s: float

    def thrust(self, air: Air, thrust: Array) -> Array:
        return thrust * (1.0 - self.share / (1.0 + np.exp((air.velocity[2] + self.begins_m_s) / 0.4)))


@dataclass(frozen=True, slots=True)
class QuadraticWake(Added):
    """Rear rotors lose thrust with the square of the speed at which the wake reaches them."""

    loss_s2_m2: float

    def thrust(self, air: Air, thrust: Array) -> Array:
        bearing = air.hub[:2] / np.hypot(air.hub[0], air.hub[1])
        towards = -bearing[0] * air.velocity[0] - bearing[1] * air.velocity[1]
        return thrust * (1.0 - np.minimum(self.loss_s2_m2 * np.square(np.maximum(towards, 0.0)), 0.4))


@dataclass(frozen=True, slots=True)
class TiringRotor(Added):
    """One rotor that loses more the faster it turns."""

    rotor: int
    share: float
    """At 450 rad/s."""

    def thrust(self, air: Air, thrust: Array) -> Array:
        left = thrust.copy()
        left[self.rotor] *= 1.0 - self.share * (air.rotor_speed[self.rotor] / 450.0) ** 2
        return left


def _size(rng: Rng, low: float, high: float) -> float:
    return float(np.exp(rng.uniform(np.log(low), np.log(high))))


def _damping(rng: Rng, radius_m: float) -> Form:
    about = (_size(rng, 1e-3, 5e-3), _size(rng, 1e-3, 5e-3), _size(rng, 5e-4, 2e-3))
    near = ("angular_damping", "angular_damping_quadratic")
    return Form(RootDamping(about), near, ("M_x", "M_y", "M_z"), ("w_x", "w_y", "w_z"), "M = -c |w|^0.5 w")


def _drag(rng: Rng, radius_m: float) -> Form:
    if rng.random() < 0.5:
        extra: Any = SaturatingDrag(_size(rng, 0.1, 0.5), float(rng.uniform(2.0, 4.0)))
        law = "F_xy = -c tanh(v / s)"
    else:
        extra, law = SteepDrag(_size(rng, 0.1, 0.4)), "F = -c |v|^1.6 v"
    near = ("parasitic_drag", "parasitic_drag_speed", "rotor_drag_speed", "rotor_drag_thrust")
    if isinstance(extra, SaturatingDrag):  # an exponent below one: the linear law is the nearest
        near += ("parasitic_drag_linear",)
    return Form(extra, near, ("F_x", "F_y", "F_z"), ("v_x", "v_y", "v_z", "speed"), law)


def _cushion(rng: Rng, radius_m: float) -> Form:
    extra = SoftCushion(_size(rng, 0.06, 0.25), float(rng.uniform(1.0, 2.5)) * radius_m)
    return Form(extra, ("ground_effect",), ("F_z",), ("height",), "T (1 + a exp(-h / s))")


def _lift(rng: Rng, radius_m: float) -> Form:
    extra = SaturatingLift(_size(rng, 0.02, 0.12), float(rng.uniform(2.0, 5.0)))
    return Form(extra, ("translational_lift", "thrust_bem"), ("F_z",), ("v_x", "v_y", "speed"), "T + a v2 / (s2 + v2)")


def _moment(rng: Rng, radius_m: float) -> Form:
    extra = BluntMoment((_size(rng, 1e-3, 8e-3), _size(rng, 1e-3, 8e-3)), float(rng.uniform(2.0, 5.0)))
    near = ("wake_skew_moment", "flapping_moment", "airframe_side_moment")  # the first saturates, in each axis apart
    return Form(extra, near, ("M_x", "M_y"), ("v_x", "v_y"), "M = c tanh(v / s)")


def _sink(rng: Rng, radius_m: float) -> Form:
    extra = SinkLoss(_size(rng, 0.03, 0.15), float(rng.uniform(1.0, 2.0)))
    return Form(extra, ("descent_loss", "thrust_bem"), ("F_z",), ("v_z",), "T falls by a step at a sink rate")


def _wake(rng: Rng, radius_m: float) -> Form:
    extra = QuadraticWake(_size(rng, 4e-4, 3e-3))
    return Form(extra, ("rotor_interaction",), ("F_z", "M_x", "M_y"), ("v_x", "v_y", "speed"), "rear rotors lose v2")


def _rotor(rng: Rng, radius_m: float) -> Form:
    rotor = int(rng.integers(4))
    extra = TiringRotor(rotor, _size(rng, 0.01, 0.06))
    channels = ("F_z", "M_x", "M_y", "M_z")
    return Form(extra, ("weak_rotor",), channels, (f"n_{rotor}",), "one rotor loses more the faster it turns")


FORMS: dict[str, Callable[[Rng, float], Form]] = {
    "damping": _damping,
    "drag": _drag,
    "cushion": _cushion,
    "lift": _lift,
    "moment": _moment,
    "sink": _sink,
    "wake": _wake,
    "rotor": _rotor,
}
"""Families of laws; each draws one from a generator and the rotor radius."""


def draw(rng: Rng, radius_m: float) -> Form:
    """A law of any family."""
    return FORMS[str(rng.choice(sorted(FORMS)))](rng, radius_m)
