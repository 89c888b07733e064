"""Airframe drag acts beside the centre of mass: a moment that grows with the square of speed."""

import numpy as np

from vehicle.effects.base import VOLUME, Effect, Flow, Spec, Stage, Values, cross, length


def apply(flow: Flow, p: Values) -> None:
    arm = np.stack(np.broadcast_arrays(p.x_kg, p.y_kg, p.z_kg)).reshape(3, -1)
    flow.torque_n_m -= length(flow.velocity_m_s) * cross(arm, flow.velocity_m_s)


EFFECT = Effect(
    name="airframe_side_moment",
    number=9,
    family="moments",
    form="quadratic in airspeed",
    stage=Stage.FORCE,
    apply=apply,
    parameters=(
        Spec("x_kg", "N s2/m", prior=2e-4, bounds=(-0.1, 0.1), planted=1e-4, scaling=VOLUME),
        Spec("y_kg", "N s2/m", prior=2e-4, bounds=(-0.1, 0.1), planted=-0.6e-4, scaling=VOLUME),
        Spec("z_kg", "N s2/m", prior=2e-4, bounds=(-0.1, 0.1), planted=2e-4, scaling=VOLUME),
    ),
    law="M = (c r_cp) x (-|v| v)",
    source="own form: one drag coefficient c at the centre of pressure r_cp",
    channel="M_x M_y M_z",
    regressor="|v| v",
    excited_by=("fast_level", "oblique"),
)
