"""Near the ground the same rotor speed gives more thrust."""

import numpy as np

from vehicle.effects.base import Effect, Flow, Spec, Stage, Values, clipped

LARGEST_RATIO = 0.5
"""Below about a quarter of a radius the law does not hold; its ratio is clipped, so thrust at most doubles."""

FAR_M = 1e6
"""Used in place of infinity, which would break derivatives."""


def apply(flow: Flow, p: Values) -> None:
    assert flow.height_m is not None
    ratio = p.strength * (flow.radius_m / (4.0 * clipped(flow.height_m, 1e-3, FAR_M))) ** 2
    ratio = np.where(np.real(ratio) < LARGEST_RATIO, ratio, LARGEST_RATIO)
    flow.thrust_n *= 1.0 / (1.0 - ratio)


EFFECT = Effect(
    name="ground_effect",
    number=10,
    stage=Stage.THRUST_FACTOR,
    apply=apply,
    parameters=(Spec("strength", "1", prior=1.0, bounds=(0.0, 20.0), planted=1.3),),
    law="T / (1 - g (R / 4h)^2)",
    source="Cheeseman and Bennett 1955, ARC R&M 3021 (g = 1); for why g is free: Sanchez-Cuevas, "
    "Heredia, Ollero 2017, Characterization of the Aerodynamic Ground Effect",
    channel="F_z",
    regressor="height",
    excited_by=("ground_sweep",),
    needs=("height_m",),
)
