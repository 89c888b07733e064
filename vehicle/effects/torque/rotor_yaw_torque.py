"""The air's resistance to each rotor turns the body the other way; part of the base model, eq. (3)."""

from vehicle.effects.base import YAW, Effect, Flow, Spec, Stage, Values


def apply(flow: Flow, p: Values) -> None:
    flow.add_rotor_torque(2, -p.torque_n_m_s2, flow.spin * flow.rotor_speed_rad_s**2)


EFFECT = Effect(
    name="rotor_yaw_torque",
    number=0,
    family="torque curve",
    form="quadratic",
    stage=Stage.FORCE,
    apply=apply,
    parameters=(
        Spec("torque_n_m_s2", "N m s2", prior=3e-8, bounds=(0.0, 1e-4), default=3.1e-8, planted=3.1e-8, scaling=YAW),
    ),
    law="M_z = -c_q sum spin_i n_i^2",
    source="Rigter et al. eq. (3)",
    channel="M_z",
    regressor="sum spin n^2",
    excited_by=("yaw_doublets",),
)
