"""Blade-element thrust with the advance ratio: the advancing blade gains more than the retreating one loses.

The lift of a blade element goes with the square of its own air speed, n r + v_xy sin psi; integrated over disc and
turn this adds (3/2) mu^2 to the collective's term, mu = v_xy / (n R). `thrust_bem` leaves that out,
`translational_lift` leaves it free.
"""

import numpy as np

from vehicle.effects.base import Effect, Flow, Stage, Values
from vehicle.effects.thrust.thrust_bem import EFFECT as THRUST_BEM
from vehicle.effects.thrust.thrust_bem import induced_velocity


def apply(flow: Flow, p: Values) -> None:
    v_x, v_y, v_z = flow.hub_velocity_m_s()
    n, radius_m = flow.rotor_speed_rad_s, flow.radius_m
    edgewise_squared = v_x * v_x + v_y * v_y
    two_rho_area = 2.0 * flow.air_density_kg_m3 * np.pi * radius_m**2
    collective_n = p.k1_n_s2 * (n * n + 1.5 * edgewise_squared / radius_m**2)
    # with the collective's thrust in the place of k1 n^2, the balance with momentum theory is that of thrust_bem
    v_ind = induced_velocity(np.ones_like(n), v_z, edgewise_squared, collective_n, p.k2_n_s2_m * n, two_rho_area)
    flow.thrust_n += collective_n + p.k2_n_s2_m * n * (v_z + v_ind)


EFFECT = Effect(
    name="thrust_blade_element",
    number=1,
    family="inflow",
    form="blade element, inflow of hover",
    stage=Stage.THRUST,
    apply=apply,
    parameters=THRUST_BEM.parameters,
    law="T = k1 n^2 (1 + 1.5 mu^2) + k2 n (v_z + v_ind), mu = v_xy / (n R), v_ind as in thrust_bem",
    source="Leishman, Principles of Helicopter Aerodynamics, ch. 3: C_T ~ theta (1/3 + mu^2/2) - lambda/2",
    channel="F_z",
    regressor="v_z n, v_xy",
    excited_by=("vertical", "fast_level"),
    strength=("k2_n_s2_m",),
    instead_of="thrust_bem",
    takes_over=("k1_n_s2", "k1_n_s2"),
    moves_like="translational_lift",
)
