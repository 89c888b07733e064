"""Thrust that depends on rotor speed alone: the static law every textbook starts from."""

from vehicle.effects.base import PER_ROTOR_SPEED_SQUARED, Effect, Flow, Spec, Stage, Values


def apply(flow: Flow, p: Values) -> None:
    flow.thrust_n += p.k_n_s2 * flow.rotor_speed_rad_s**2


EFFECT = Effect(
    name="thrust_quadratic",
    number=0,
    family="thrust curve",
    form="quadratic",
    stage=Stage.THRUST,
    apply=apply,
    parameters=(
        Spec(
            "k_n_s2",
            "N s2",
            prior=3e-6,
            bounds=(0.0, 1e-3),
            default=1.9e-6,
            planted=1.9e-6,
            scaling=PER_ROTOR_SPEED_SQUARED,
        ),
    ),
    law="T = k n^2",
    source="Mahony, Kumar, Corke 2012, Multirotor Aerial Vehicles (RAM 19-3), the static thrust law",
    channel="F_z",
    regressor="n^2",
    excited_by=("hover", "vertical"),
)
