"""Drag of body and rotors in proportion to the airspeed, each body axis on its own: the drag of most simulators."""

from vehicle.effects.base import ADVANCE_OF_WEIGHT, Effect, Flow, Spec, Stage, Values


def apply(flow: Flow, p: Values) -> None:
    v = flow.velocity_m_s
    flow.force_n[0] -= p.drag_x_n_s_m * v[0]
    flow.force_n[1] -= p.drag_y_n_s_m * v[1]
    flow.force_n[2] -= p.drag_z_n_s_m * v[2]


EFFECT = Effect(
    name="parasitic_drag_linear",
    number=5,
    family="drag",
    form="linear in airspeed",
    stage=Stage.FORCE,
    apply=apply,
    parameters=(
        Spec("drag_x_n_s_m", "N s/m", prior=0.05, bounds=(0.0, 5.0), planted=0.12, scaling=ADVANCE_OF_WEIGHT),
        Spec("drag_y_n_s_m", "N s/m", prior=0.05, bounds=(0.0, 5.0), planted=0.1, scaling=ADVANCE_OF_WEIGHT),
        Spec("drag_z_n_s_m", "N s/m", prior=0.05, bounds=(0.0, 5.0), planted=0.15, scaling=ADVANCE_OF_WEIGHT),
    ),
    law="F_i = -d_i v_i",
    source="Faessler, Franchi, Scaramuzza 2018, Differential Flatness of Quadrotor Dynamics Subject to Rotor Drag; "
    "crazyflow, gym-pybullet-drones",
    channel="F_x F_y F_z",
    regressor="v_i",
    excited_by=("fast_level", "vertical"),
)
