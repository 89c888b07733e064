"""Rotor drag proportional to rotor speed, at each hub: it also damps yaw and tilts the vehicle when hubs are high."""

from vehicle.effects.base import BLADE, Effect, Flow, Spec, Stage, Values


def apply(flow: Flow, p: Values) -> None:
    flow.hub_force_n[:2] -= p.drag_kg * flow.rotor_speed_rad_s * flow.hub_velocity_m_s()[:2]


EFFECT = Effect(
    name="rotor_drag_speed",
    number=4,
    family="drag",
    form="linear in airspeed, times rotor speed",
    stage=Stage.FORCE,
    apply=apply,
    parameters=(Spec("drag_kg", "kg", prior=3e-5, bounds=(0.0, 1e-2), planted=3.2e-5, scaling=BLADE),),
    law="f_i = -k_d n_i (a_x, a_y, 0) at hub i",
    source="RotorPy (Folk, Paulos, Kumar 2023), k_d; RotorS (Furrer et al. 2016); Svacha, Mohta, Kumar 2017, Improving "
    "Quadrotor Trajectory Tracking by Compensating for Aerodynamic Effects",
    channel="F_x F_y M_z",
    regressor="n v; w_z",
    excited_by=("fast_level", "yaw_sweep"),
)
