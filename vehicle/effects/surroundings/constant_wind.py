"""A steady wind, given in world axes, that the log does not record."""

import numpy as np

from vehicle.effects.base import Effect, Flow, Spec, Stage, Values, cross


def apply(flow: Flow, p: Values) -> None:
    assert flow.q_world_body is not None
    wind = np.stack(np.broadcast_arrays(p.x_m_s, p.y_m_s, p.z_m_s)).reshape(3, -1)
    w, back = flow.q_world_body[0], -flow.q_world_body[1:]
    twice = 2.0 * cross(back, wind)
    flow.velocity_m_s = flow.velocity_m_s - (wind + w * twice + cross(back, twice))


EFFECT = Effect(
    name="constant_wind",
    number=17,
    stage=Stage.AIR,
    apply=apply,
    parameters=(
        Spec("x_m_s", "m/s", prior=1.0, bounds=(-40.0, 40.0), planted=0.8),
        Spec("y_m_s", "m/s", prior=1.0, bounds=(-40.0, 40.0), planted=-0.5),
        Spec("z_m_s", "m/s", prior=0.3, bounds=(-20.0, 20.0), planted=0.1),
    ),
    law="v_air = v - R_body_world wind",
    source="kinematics",
    channel="F_x F_y",
    regressor="world axes, whatever the heading",
    excited_by=("fast_level", "yaw_sweep"),
    needs=("q_world_body",),
)
