"""Turning the body turns the rotors' net angular momentum: a torque across both."""

import numpy as np

from vehicle.effects.base import INERTIA, Effect, Flow, Spec, Stage, Values, cross


def apply(flow: Flow, p: Values) -> None:
    if flow.tilt is not None:
        along = np.einsum("ir,rn->in", flow.tilt[:, 2], flow.spin * flow.rotor_speed_rad_s)
        flow.torque_n_m -= cross(flow.rate_rad_s, p.rotor_inertia_kg_m2 * along)
        return
    momentum = p.rotor_inertia_kg_m2 * (flow.spin * flow.rotor_speed_rad_s).sum(axis=0)
    w_x, w_y, _ = flow.rate_rad_s
    flow.torque_n_m[0] -= w_y * momentum
    flow.torque_n_m[1] += w_x * momentum


EFFECT = Effect(
    name="gyroscopic_torque",
    number=13,
    stage=Stage.FORCE,
    apply=apply,
    parameters=(Spec("rotor_inertia_kg_m2", "kg m2", prior=5e-6, bounds=(0.0, 1e-2), planted=6e-6, scaling=INERTIA),),
    law="M = -w x J_r (sum spin_i n_i) e3",
    source="rigid-body mechanics; Bouabdallah 2007, thesis",
    channel="M_x M_y",
    regressor="w x net n",
    excited_by=("rotation", "yaw_doublets"),
)
