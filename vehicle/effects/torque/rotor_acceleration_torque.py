"""Speeding a rotor up turns the body the other way at once, before its air drag has changed."""

from vehicle.effects.base import INERTIA, Effect, Flow, Spec, Stage, Values


def apply(flow: Flow, p: Values) -> None:
    assert flow.rotor_acceleration_rad_s2 is not None
    flow.add_rotor_torque(2, -p.rotor_inertia_kg_m2, flow.spin * flow.rotor_acceleration_rad_s2)


EFFECT = Effect(
    name="rotor_acceleration_torque",
    number=14,
    family="torque curve",
    form="by rotor acceleration",
    stage=Stage.FORCE,
    apply=apply,
    parameters=(Spec("rotor_inertia_kg_m2", "kg m2", prior=5e-6, bounds=(0.0, 1e-2), planted=6e-6, scaling=INERTIA),),
    law="M_z = -J_r sum spin_i dn_i/dt",
    source="rigid-body mechanics: the reaction to spinning a rotor up",
    channel="M_z",
    regressor="sum spin dn/dt",
    excited_by=("yaw_doublets",),
    needs=("rotor_acceleration_rad_s2",),
)
