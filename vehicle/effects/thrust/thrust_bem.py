"""Thrust with induced velocity: blade-element theory closed by momentum theory, Rigter et al. eq. (1)-(2)."""

from typing import Any

import numpy as np

from vehicle.effects.base import BLADE, PER_ROTOR_SPEED_SQUARED, Array, Effect, Flow, Spec, Stage, Values

MOST_STEPS = 60
"""Iterations. Three or four reach rounding in climb and level flight; only fast, oblique descent needs bisection."""


def defect_and_slope(
    induced: Array, n: Array, axial: Array, lateral_squared: Array, k1: Any, k2: Any, two_rho_area: Any
) -> tuple[Array, Array]:
    """How far v_ind misses 2 rho A v_ind sqrt((v_z + v_ind)^2 + v_xy^2) = k1 n^2 + k2 n (v_z + v_ind)."""
    through = axial + induced
    speed = np.sqrt(through * through + lateral_squared + 1e-12)
    defect = two_rho_area * induced * speed - k1 * n * n - k2 * n * through
    return defect, two_rho_area * (speed + induced * through / speed) - k2 * n + 1e-12


def induced_velocity(n: Array, axial: Array, lateral_squared: Array, k1: Any, k2: Any, two_rho_area: Any) -> Array:
    """The root between 0 and the root of purely axial flow: Newton, with bisection where it would leave the bracket."""
    real = [np.real(x) for x in (n, axial, lateral_squared, k1, k2, two_rho_area)]
    a, b = real[5], real[5] * real[1] - real[4] * real[0]
    c = real[3] * real[0] ** 2 + real[4] * real[0] * real[1]
    induced = (-b + np.sqrt(b * b + 4.0 * a * c)) / (2.0 * a)  # exact when v_xy = 0
    low, high = np.minimum(induced, 0.0), np.maximum(induced, 0.0)
    for _ in range(MOST_STEPS):
        defect, slope = defect_and_slope(induced, *real)
        low, high = np.where(defect > 0.0, low, induced), np.where(defect > 0.0, induced, high)
        moved = induced - defect / np.where(slope > 0.0, slope, np.nan)
        moved = np.where((moved >= low) & (moved <= high), moved, 0.5 * (low + high))
        change, induced = np.abs(moved - induced).max(initial=0.0), moved
        if change < 1e-8:
            break
    # the root is found with real numbers; this last step adds its derivative when a complex step is taken
    defect, slope = defect_and_slope(induced, n, axial, lateral_squared, k1, k2, two_rho_area)
    return induced - defect / slope


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
    family="inflow",
    form="momentum and blade element",
    stage=Stage.THRUST,
    apply=apply,
    parameters=(
        Spec(
            "k1_n_s2",
            "N s2",
            prior=3e-6,
            bounds=(0.0, 1e-3),
            default=3.119e-6,
            planted=3.119e-6,
            scaling=PER_ROTOR_SPEED_SQUARED,
        ),
        Spec(
            "k2_n_s2_m",
            "N s2/m",
            prior=1.5e-4,
            bounds=(-1e-2, 0.0),
            default=-1.547e-4,
            planted=-1.547e-4,
            scaling=BLADE,
        ),
    ),
    law="T = k1 n^2 + k2 n (v_z + v_ind),  T = 2 rho A v_ind sqrt((v_z + v_ind)^2 + v_xy^2)",
    source="Rigter et al. 2019 eq. (1)-(2); Leishman, Principles of Helicopter Aerodynamics, ch. 2-3",
    channel="F_z",
    regressor="v_z n, v_xy",
    excited_by=("vertical", "fast_level"),
    strength=("k2_n_s2_m",),
    instead_of="thrust_quadratic",
    takes_over=("k_n_s2", "k1_n_s2"),
)
