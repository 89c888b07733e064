"""In fast descent a rotor sinks into its own wake (vortex ring) and loses thrust."""

import numpy as np

from vehicle.effects.base import Effect, Flow, Spec, Stage, Values

CENTRE, HALF_WIDTH = -1.25, 0.75
"""The loss is nonzero where axial speed over hover inflow is in (-2, -0.5)."""


def apply(flow: Flow, p: Values) -> None:
    v_z = flow.hub_velocity_m_s()[2]
    disk = 2.0 * flow.air_density_kg_m3 * np.pi * flow.radius_m**2
    lifting = np.real(flow.thrust_n) > 1e-9
    inflow = np.sqrt(np.where(lifting, flow.thrust_n, 1.0) / disk)
    place = (v_z / inflow - CENTRE) / HALF_WIDTH
    inside = lifting & (np.real(place) > -1.0) & (np.real(place) < 1.0)
    flow.thrust_n *= 1.0 - p.depth * np.where(inside, (1.0 - place * place) ** 2, 0.0)


EFFECT = Effect(
    name="descent_loss",
    number=20,
    stage=Stage.THRUST_FACTOR,
    apply=apply,
    parameters=(Spec("depth", "1", prior=0.2, bounds=(0.0, 1.0), planted=0.25),),
    law="T_i (1 - depth b(v_z / sqrt(T_i / 2 rho A))), b a smooth bump on (-2, -0.5)",
    source="Leishman, Principles of Helicopter Aerodynamics, on the vortex ring state; the bump is our own form",
    channel="F_z",
    regressor="v_z / v_ind",
    excited_by=("descent",),
)
