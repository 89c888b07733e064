"""Turning is resisted in proportion to the square of the body rate: the alternative to `angular_damping`."""

from vehicle.effects.base import DAMPING_SQUARED, Effect, Flow, Spec, Stage, Values, magnitude


def apply(flow: Flow, p: Values) -> None:
    squared = magnitude(flow.rate_rad_s) * flow.rate_rad_s
    flow.torque_n_m[0] -= p.x_n_m_s2 * squared[0]
    flow.torque_n_m[1] -= p.y_n_m_s2 * squared[1]
    flow.torque_n_m[2] -= p.z_n_m_s2 * squared[2]


EFFECT = Effect(
    name="angular_damping_quadratic",
    number=21,
    family="damping",
    form="quadratic in body rate",
    stage=Stage.FORCE,
    apply=apply,
    parameters=(
        Spec("x_n_m_s2", "N m s2", prior=2e-4, bounds=(0.0, 1.0), planted=2e-4, scaling=DAMPING_SQUARED),
        Spec("y_n_m_s2", "N m s2", prior=2e-4, bounds=(0.0, 1.0), planted=2.5e-4, scaling=DAMPING_SQUARED),
        Spec("z_n_m_s2", "N m s2", prior=2e-4, bounds=(0.0, 1.0), planted=1e-4, scaling=DAMPING_SQUARED),
    ),
    law="M_i = -D_i |w_i| w_i",
    source="own; airframe drag at the arms, as `parasitic_drag` for turning",
    channel="M_x M_y M_z",
    regressor="|w| w",
    excited_by=("rotation", "yaw_sweep"),
)
