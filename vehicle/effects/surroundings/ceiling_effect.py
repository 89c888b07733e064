"""Under a ceiling the rotors pull harder."""

from vehicle.effects.base import Effect, Flow, Spec, Stage, Values, clipped

SMALLEST_GAP_RADII = 0.5
"""Below half a radius the law does not hold; the gap is clipped there."""

FAR_M = 1e6
"""Used in place of infinity, which would break derivatives."""


def apply(flow: Flow, p: Values) -> None:
    assert flow.ceiling_gap_m is not None
    gap = clipped(flow.ceiling_gap_m, SMALLEST_GAP_RADII * flow.radius_m, FAR_M)
    flow.thrust_n *= 1.0 + p.strength * (flow.radius_m / gap) ** 2


EFFECT = Effect(
    name="ceiling_effect",
    number=11,
    stage=Stage.THRUST_FACTOR,
    apply=apply,
    parameters=(Spec("strength", "1", prior=0.1, bounds=(0.0, 5.0), planted=0.12),),
    law="T (1 + g_c (R / d)^2)",
    source="own one-parameter form of the trend in Hsiao, Chirarattananon 2019, Ceiling Effects for Hybrid "
    "Aerial-Surface Locomotion of Small Rotorcraft",
    channel="F_z",
    regressor="gap to the ceiling",
    excited_by=("ceiling_climb",),
    needs=("ceiling_gap_m",),
)
