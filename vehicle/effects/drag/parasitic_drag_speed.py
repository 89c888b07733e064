"""Airframe drag that grows with the whole speed, not only its own component: the alternative to `parasitic_drag`."""

from vehicle.effects.base import AREA, Effect, Flow, Spec, Stage, Values, length


def apply(flow: Flow, p: Values) -> None:
    v = flow.velocity_m_s
    speed = length(v)
    flow.force_n[0] -= p.drag_x_kg_m * speed * v[0]
    flow.force_n[1] -= p.drag_y_kg_m * speed * v[1]
    flow.force_n[2] -= p.drag_z_kg_m * speed * v[2]


EFFECT = Effect(
    name="parasitic_drag_speed",
    number=6,
    family="drag",
    form="quadratic in the whole airspeed",
    stage=Stage.FORCE,
    apply=apply,
    parameters=(
        Spec("drag_x_kg_m", "N s2/m2", prior=0.01, bounds=(0.0, 1.0), planted=0.005, scaling=AREA),
        Spec("drag_y_kg_m", "N s2/m2", prior=0.01, bounds=(0.0, 1.0), planted=0.007, scaling=AREA),
        Spec("drag_z_kg_m", "N s2/m2", prior=0.02, bounds=(0.0, 1.0), planted=0.010, scaling=AREA),
    ),
    law="F_i = -c_i |v| v_i",
    source="RotorPy (Folk, Paulos, Kumar 2023), c_D",
    channel="F_x F_y F_z",
    regressor="|v| v_i",
    excited_by=("fast_level", "oblique"),
)
