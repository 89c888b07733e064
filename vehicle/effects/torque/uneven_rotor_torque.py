"""One rotor's air torque differs from the others': a bent or nicked blade needs more torque for the same thrust."""

import numpy as np

from vehicle.effects.base import YAW, Effect, Flow, Spec, Stage, Values


def apply(flow: Flow, p: Values) -> None:
    torques = np.broadcast_arrays(p.torque_0_n_m_s2, p.torque_1_n_m_s2, p.torque_2_n_m_s2, p.torque_3_n_m_s2)
    more = np.stack(torques).reshape(4, -1)
    flow.torque_n_m[2] -= (more * flow.spin * flow.rotor_speed_rad_s**2).sum(axis=0)


EFFECT = Effect(
    name="uneven_rotor_torque",
    number=18,
    family="torque curve",
    form="quadratic, each rotor's own",
    stage=Stage.FORCE,
    apply=apply,
    parameters=tuple(
        Spec(f"torque_{i}_n_m_s2", "N m s2", prior=1e-9, bounds=(-1e-5, 1e-5), planted=planted, scaling=YAW)
        for i, planted in enumerate((0.0, 3e-9, 0.0, -2e-9))
    ),
    law="M_z = -sum spin_i e_i n_i^2, beside the torque that all rotors share",
    source="own; with weak_rotor the actuator-effectiveness factors of fault diagnosis, thrust and torque apart",
    channel="M_z",
    regressor="one n_i^2",
    excited_by=("yaw_doublets", "rotation"),
    separate=True,
)
