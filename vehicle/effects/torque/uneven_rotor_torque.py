"""One rotor's air torque differs from the others': a bent or nicked blade needs more torque for the same thrust."""

import numpy as np

from vehicle.effects.base import YAW, Effect, Flow, Spec, Stage, Values


def apply(flow: Flow, p: Values) -> None:
    rotors = len(flow.rotor_speed_rad_s)
    torques = np.broadcast_arrays(*(getattr(p, f"torque_{i}_n_m_s2") for i in range(rotors)))
    more = np.stack(torques).reshape(rotors, -1)
    flow.add_rotor_torque(2, -1.0, more * flow.spin * flow.rotor_speed_rad_s**2)


def of_rotors(count: int) -> tuple[Spec, ...]:
    """One torque for each rotor; the self-test plants two."""
    planted = {1: 3e-9, 3: -2e-9}
    return tuple(
        Spec(f"torque_{i}_n_m_s2", "N m s2", prior=1e-9, bounds=(-1e-5, 1e-5), planted=planted.get(i, 0.0), scaling=YAW)
        for i in range(count)
    )


EFFECT = Effect(
    name="uneven_rotor_torque",
    number=18,
    family="torque curve",
    form="quadratic, each rotor's own",
    stage=Stage.FORCE,
    apply=apply,
    parameters=of_rotors(4),
    each_rotor=of_rotors,
    law="M_z = -sum spin_i e_i n_i^2, beside the torque that all rotors share",
    source="own; with weak_rotor the actuator-effectiveness factors of fault diagnosis, thrust and torque apart",
    channel="M_z",
    regressor="one n_i^2",
    excited_by=("yaw_doublets", "rotation"),
    separate=True,
)
