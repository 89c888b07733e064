"""Rotor drag proportional to total thrust (blade flapping and induced drag in one coefficient)."""

from vehicle.effects.base import ADVANCE, Effect, Flow, Spec, Stage, Values


def apply(flow: Flow, p: Values) -> None:
    flow.force_n[:2] -= p.drag_s_m * flow.thrust_n.sum(axis=0) * flow.velocity_m_s[:2]


EFFECT = Effect(
    name="rotor_drag_thrust",
    number=3,
    family="drag",
    form="linear in airspeed, times thrust",
    stage=Stage.FORCE,
    apply=apply,
    parameters=(Spec("drag_s_m", "s/m", prior=0.02, bounds=(0.0, 0.5), planted=0.0175, scaling=ADVANCE),),
    law="F_xy = -(sum T) c_dh (v_x, v_y)",
    source="Rigter et al. eq. (4); Mahony, Kumar, Corke 2012",
    channel="F_x F_y",
    regressor="T v",
    excited_by=("fast_level", "vertical_weave"),
)
