"""More thrust in edgewise flow, quadratic in lateral air speed: a simple alternative to the induced-velocity law."""

from vehicle.effects.base import ADVANCE_SQUARED, Effect, Flow, Spec, Stage, Values


def apply(flow: Flow, p: Values) -> None:
    a_x, a_y, _ = flow.hub_velocity_m_s()
    flow.thrust_n += p.lift_kg_m * (a_x * a_x + a_y * a_y)


EFFECT = Effect(
    name="translational_lift",
    number=7,
    family="inflow",
    form="quadratic in level airspeed",
    stage=Stage.THRUST,
    apply=apply,
    parameters=(Spec("lift_kg_m", "N s2/m2", prior=3e-3, bounds=(-0.1, 0.1), planted=3.4e-3, scaling=ADVANCE_SQUARED),),
    law="T_i += k_h (a_x^2 + a_y^2)",
    source="Svacha, Mohta, Kumar 2017 (ICUAS), k_h; RotorPy (Folk, Paulos, Kumar 2023), k_h",
    channel="F_z",
    regressor="v_xy^2",
    excited_by=("fast_level",),
)
