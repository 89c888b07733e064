"""Thrust lost to axial air speed, linearised: a simple alternative to the induced-velocity law."""

from vehicle.effects.base import BLADE, Effect, Flow, Spec, Stage, Values


def apply(flow: Flow, p: Values) -> None:
    flow.thrust_n -= p.inflow_kg * flow.rotor_speed_rad_s * flow.hub_velocity_m_s()[2]


EFFECT = Effect(
    name="inflow_linear",
    number=2,
    family="inflow",
    form="linear in axial airspeed",
    stage=Stage.THRUST,
    apply=apply,
    parameters=(Spec("inflow_kg", "kg", prior=1e-4, bounds=(-1e-2, 1e-2), planted=1.2e-4, scaling=BLADE),),
    law="T_i += -k_z n_i a_z",
    source="Svacha, Mohta, Kumar 2017 (ICUAS), k_z; RotorPy (Folk, Paulos, Kumar 2023), k_z",
    channel="F_z M_x M_y",
    regressor="n v_z; w",
    excited_by=("vertical", "rotation"),
)
