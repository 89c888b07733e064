"""Simple laws that a curve may be: functions of one variable, with at most one shape that is looked for on a grid.

A mirror image of a vehicle flies as its mirror image. So where a mirror turns both the channel and the variable around,
a law is odd in the variable; where it turns the variable alone, even.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

import numpy as np

from flight.rotations import FloatArray

Parity = Literal["odd", "even", "either"]
Law = Callable[[FloatArray, float], FloatArray]
FLIPPED = (
    frozenset(["F_x", "M_y", "M_z", "v_x", "w_y", "w_z"]),
    frozenset(["F_y", "M_x", "M_z", "v_y", "w_x", "w_z"]),
)
"""What a mirror along x turns around, and one along y."""
EXPONENT = "exponent"
"""Kind of a shape that has no unit."""


@dataclass(frozen=True, slots=True)
class Form:
    """A law without its coefficient: f(x), or f(x; s) with a shape s in the unit of x."""

    name: str
    """In words."""
    formula: str
    """With x for the variable and s for the shape."""
    code: str
    """The same as an effect's file computes it, by the helpers of `vehicle.effects.base`."""
    parity: Parity
    law: Law
    power: int
    """Of the variable's unit in f; the coefficient has the channel's unit over that."""
    shapes: tuple[float, ...] = ()
    """Where s is looked for, as shares of the largest |x| that was flown; an exponent as it is."""
    kind: Literal["", "exponent"] = ""
    carrier: Literal["", "n", "speed"] = ""
    """Mean rotor speed or air speed, where f(x) is multiplied by it."""

    def values(self, x: FloatArray, shape: float) -> FloatArray:
        return self.law(x, shape)

    def allowed(self, parity: Parity) -> bool:
        """Whether symmetry allows it."""
        return parity == "either" or self.parity == parity


def _step(x: FloatArray, s: float) -> FloatArray:
    return 0.5 * (1.0 + np.tanh((x - s) / (0.25 * s)))


_S = (0.15, 0.25, 0.4, 0.6, 1.0)
_FROM = (0.2, 0.35, 0.5, 0.7)
_STEP = "0.5 * (1.0 + np.tanh(({} - s) / (0.25 * s)))"
_ODD = (
    Form("linear", "x", "x", "odd", lambda x, s: x, 1),
    Form("quadratic", "x |x|", "x * magnitude(x)", "odd", lambda x, s: x * np.abs(x), 2),
    Form("cubic", "x^3", "x**3", "odd", lambda x, s: x**3, 3),
    Form("saturating", "tanh(x/s)", "np.tanh(x / s)", "odd", lambda x, s: np.tanh(x / s), 0, _S),
    Form(
        "a power of it", "x |x|^(s-1)", "x * magnitude(x) ** (s - 1.0)", "odd",
        lambda x, s: x * np.abs(x) ** (s - 1.0), 0, (1.5, 2.5), kind=EXPONENT,
    ),
)  # fmt: skip
_CARRIED = (
    Form("linear, with rotor speed", "n x", "n * x", "odd", lambda x, s: x, 1, carrier="n"),
    Form("linear, with air speed", "|v| x", "speed * x", "odd", lambda x, s: x, 1, carrier="speed"),
    Form("quadratic, with air speed", "|v| x |x|", "speed * x * magnitude(x)", "odd", lambda x, s: x * np.abs(x), 2,
         carrier="speed"),
)  # fmt: skip
_EVEN = (
    Form("square", "x^2", "x**2", "even", lambda x, s: x * x, 2),
    Form("absolute value", "|x|", "magnitude(x)", "even", lambda x, s: np.abs(x), 1),
    Form("saturating square", "x^2/(s^2 + x^2)", "x**2 / (s**2 + x**2)", "even",
         lambda x, s: x * x / (s * s + x * x), 0, _S),
)  # fmt: skip
_ONE_SIDED = (
    Form("one-sided", "max(0, x)", "positive(x)", "either", lambda x, s: np.maximum(0.0, x), 1),
    Form("one-sided", "max(0, -x)", "positive(-x)", "either", lambda x, s: np.maximum(0.0, -x), 1),
    Form("one-sided square", "max(0, x)^2", "positive(x) ** 2", "either", lambda x, s: np.maximum(0.0, x) ** 2, 2),
    Form("one-sided square", "max(0, -x)^2", "positive(-x) ** 2", "either", lambda x, s: np.maximum(0.0, -x) ** 2, 2),
    Form("a step", "step(x > s)", _STEP.format("x"), "either", _step, 0, _FROM),
    Form("a step", "step(-x > s)", _STEP.format("-x"), "either", lambda x, s: _step(-x, s), 0, _FROM),
)
_FADING = (
    Form("exponential", "exp(-x/s)", "np.exp(-x / s)", "either", lambda x, s: np.exp(-x / s), 0,
         (0.03, 0.06, 0.12, 0.25, 0.5)),
    Form("fading square", "s^2/(s^2 + x^2)", "s**2 / (s**2 + x**2)", "either",
         lambda x, s: s * s / (s * s + x * x), 0, (0.03, 0.06, 0.12, 0.25, 0.5)),
)  # fmt: skip
_ANGLE = (
    Form("sine", "sin(x)", "np.sin(x)", "either", lambda x, s: np.sin(x), 0),
    Form("cosine", "cos(x)", "np.cos(x)", "either", lambda x, s: np.cos(x), 0),
)


def forms(variable: str) -> tuple[Form, ...]:
    """Laws that are tried against a variable, the simplest first."""
    if variable == "heading":
        return _ANGLE
    if variable == "height":
        return (_ODD[0], *_FADING)
    if variable == "speed":
        return (_ODD[0], _EVEN[0], _ODD[2], _EVEN[2])
    if variable[0] == "n":
        return (_ODD[0], _EVEN[0], _ODD[2])
    if variable.startswith("dn_"):
        return (_ODD[0], _ODD[1])
    if variable == "s" or " " in variable:
        return (*_ODD, *_EVEN, *_ONE_SIDED)
    return (*_ODD, *_CARRIED, *_EVEN, *_ONE_SIDED)


def parity(channel: str, variable: str) -> Parity:
    """What symmetry says of a law in a channel; `either` where a mirror turns neither, or the channel alone."""
    turned = [(channel in mirror, _turned(variable, mirror)) for mirror in FLIPPED]
    if any(whole and part for whole, part in turned):
        return "odd"
    if any(part for _, part in turned):
        return "even"
    return "either"


def _turned(variable: str, mirror: frozenset[str]) -> bool:
    """Whether a mirror turns a variable around; a product of two where it turns one of them."""
    return sum(word in mirror for word in variable.split()) % 2 == 1
