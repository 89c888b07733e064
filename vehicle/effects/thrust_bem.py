"""Thrust with induced velocity: blade-element theory closed by momentum theory, Rigter et al. eq. (1)-(2)."""

from typing import Any

import numpy as np

from vehicle.effects.base import Array, Effect, Flow, Spec, Stage, Values

NEWTON_STEPS = 7
"""Four reach rounding for axial speeds above -2 m/s; fast descent takes six; one more carries the derivative."""


def induced_velocity(n: Array, axial: Array, lateral_squared: Array, k1: Any, k2: Any, two_rho_area: Any) -> Array:
    """Root v_ind of 2 rho A v_ind sqrt((v_z + v_ind)^2 + v_xy^2) = k1 n^2 + k2 n (v_z + v_ind)."""
    a, b, c = two_rho_area, two_rho_area * axial - k2 * n, k1 * n * n + k2 * n * axial
    induced = (-b + np.sqrt(b * b + 4.0 * a * c)) / (2.0 * a)  # exact when v_xy = 0
    for _ in range(NEWTON_STEPS):
        through = axial + induced
        speed = np.sqrt(through * through + lateral_squared + 1e-12)
        defect = a * induced * speed - c - k2 * n * induced
        induced = induced - defect / (a * (speed + induced * through / speed) - k2 * n + 1e-12)
    return induced


def apply(flow: Flow, p: Values) -> None:
    v_x, v_y, v_z = flow.hub_velocity_m_s()
    n = flow.rotor_speed_rad_s
    area = np.pi * flow.radius_m * flow.radius_m
    two_rho_area = 2.0 * flow.air_density_kg_m3 * area
    v_ind = induced_velocity(n, v_z, v_x * v_x + v_y * v_y, p.k1_n_s2, p.k2_n_s2_m, two_rho_area)
    flow.thrust_n += p.k1_n_s2 * n * n + p.k2_n_s2_m * n * (v_z + v_ind)


EFFECT = Effect(
    name="thrust_bem",
    number=1,
    stage=Stage.THRUST,
    apply=apply,
    parameters=(
        Spec("k1_n_s2", "N s2", prior=3e-6, bounds=(0.0, 1e-3), default=3.119e-6, planted=3.119e-6),
        Spec("k2_n_s2_m", "N s2/m", prior=1.5e-4, bounds=(-1e-2, 0.0), default=-1.547e-4, planted=-1.547e-4),
    ),
    law="T = k1 n^2 + k2 n (v_z + v_ind),  T = 2 rho A v_ind sqrt((v_z + v_ind)^2 + v_xy^2)",
    source="Rigter, Morrell, Reid, Merrill, Tzoumanikas, Pounds, Mahony, eq. (1)-(2); Leishman, "
    "Principles of Helicopter Aerodynamics, ch. 2-3",
    channel="F_z",
    regressor="v_z n, v_xy",
    excited_by=("vertical", "fast_level"),
)
