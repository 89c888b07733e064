"""Thrust terms below the square of rotor speed: a dead zone, a constant bias."""

from vehicle.effects.base import OF_THRUST, PER_ROTOR_SPEED, Effect, Flow, Spec, Stage, Values


def apply(flow: Flow, p: Values) -> None:
    flow.thrust_n += p.constant_n + p.slope_n_s * flow.rotor_speed_rad_s


EFFECT = Effect(
    name="thrust_affine",
    number=25,
    family="thrust curve",
    form="affine below the square",
    stage=Stage.THRUST,
    apply=apply,
    parameters=(
        Spec("constant_n", "N", prior=0.1, bounds=(-10.0, 10.0), planted=-0.08, scaling=OF_THRUST),
        Spec("slope_n_s", "N s", prior=1e-4, bounds=(-0.1, 0.1), planted=1.5e-4, scaling=PER_ROTOR_SPEED),
    ),
    law="T_i += k_0 + k_a n_i",
    source="own; Foerster 2015, System Identification of the Crazyflie 2.0 Nano Quadrocopter, has a thrust map that is "
    "not purely quadratic",
    channel="F_z",
    regressor="n",
    excited_by=("vertical", "throttle_steps"),
)
