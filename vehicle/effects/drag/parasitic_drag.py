"""Airframe drag, each body axis on its own."""

from vehicle.effects.base import AREA, Effect, Flow, Spec, Stage, Values, magnitude


def apply(flow: Flow, p: Values) -> None:
    v = flow.velocity_m_s
    flow.force_n[0] -= p.drag_xy_kg_m * magnitude(v[0]) * v[0]
    flow.force_n[1] -= p.drag_xy_kg_m * magnitude(v[1]) * v[1]
    flow.force_n[2] -= p.drag_z_kg_m * magnitude(v[2]) * v[2]


EFFECT = Effect(
    name="parasitic_drag",
    number=5,
    family="drag",
    form="quadratic in each axis's airspeed",
    stage=Stage.FORCE,
    apply=apply,
    parameters=(
        Spec("drag_xy_kg_m", "N s2/m2", prior=0.01, bounds=(0.0, 1.0), planted=0.0055, scaling=AREA),
        Spec("drag_z_kg_m", "N s2/m2", prior=0.02, bounds=(0.0, 1.0), planted=0.0185, scaling=AREA),
    ),
    law="F_i = -c_i |v_i| v_i",
    source="Rigter et al. eq. (5)",
    channel="F_x F_y F_z",
    regressor="|v_i| v_i",
    excited_by=("fast_level", "vertical"),
)
