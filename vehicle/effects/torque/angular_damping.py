"""Turning is resisted in proportion to the body rate."""

from vehicle.effects.base import DAMPING, Effect, Flow, Spec, Stage, Values


def apply(flow: Flow, p: Values) -> None:
    flow.torque_n_m[0] -= p.x_n_m_s * flow.rate_rad_s[0]
    flow.torque_n_m[1] -= p.y_n_m_s * flow.rate_rad_s[1]
    flow.torque_n_m[2] -= p.z_n_m_s * flow.rate_rad_s[2]


EFFECT = Effect(
    name="angular_damping",
    number=21,
    family="damping",
    form="linear in body rate",
    stage=Stage.FORCE,
    apply=apply,
    parameters=(
        Spec("x_n_m_s", "N m s", prior=1e-3, bounds=(0.0, 1.0), planted=8e-4, scaling=DAMPING),
        Spec("y_n_m_s", "N m s", prior=1e-3, bounds=(0.0, 1.0), planted=9e-4, scaling=DAMPING),
        Spec("z_n_m_s", "N m s", prior=1e-3, bounds=(0.0, 1.0), planted=5e-4, scaling=DAMPING),
    ),
    law="M = -D w",
    source="Faessler, Franchi, Scaramuzza 2018 (RA-L 3-2), the term linear in the body rate",
    channel="M_x M_y M_z",
    regressor="w",
    excited_by=("rotation", "yaw_sweep"),
)
