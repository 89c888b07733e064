"""In fast descent a rotor sinks into its own wake (vortex ring) and loses thrust."""

import numpy as np

from vehicle.effects.base import Effect, Flow, Spec, Stage, Values


def apply(flow: Flow, p: Values) -> None:
    v_z = flow.hub_velocity_m_s()[2]
    disk = 2.0 * flow.air_density_kg_m3 * np.pi * flow.radius_m**2
    lifting = np.real(flow.thrust_n) > 1e-9
    inflow = np.sqrt(np.where(lifting, flow.thrust_n, 1.0) / disk)
    off = (v_z / inflow - p.place) / p.half_width
    inside = lifting & (np.real(off) > -1.0) & (np.real(off) < 1.0)
    flow.thrust_n *= 1.0 - p.depth * np.where(inside, (1.0 - off * off) ** 2, 0.0)


EFFECT = Effect(
    name="descent_loss",
    number=20,
    family="inflow",
    form="lost in descent",
    stage=Stage.THRUST_FACTOR,
    apply=apply,
    parameters=(
        Spec("depth", "1", prior=0.2, bounds=(0.0, 1.0), planted=0.25),
        Spec("place", "1", prior=0.25, bounds=(-2.5, -0.3), default=-1.25, planted=-1.15, optional=True),
        Spec("half_width", "1", prior=0.25, bounds=(0.2, 2.0), default=0.75, planted=0.85, optional=True),
    ),
    law="T_i (1 - depth b((v_z / sqrt(T_i / 2 rho A) - place) / half_width)), b(x) = (1 - x^2)^2 where |x| < 1",
    source="Leishman, Principles of Helicopter Aerodynamics, on the vortex ring state; the bump is our own form",
    channel="F_z",
    regressor="v_z / v_ind",
    excited_by=("descent",),
    strength=("depth",),
)
