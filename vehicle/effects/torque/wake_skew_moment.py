"""Edgewise flow skews a rotor's wake: inflow grows towards the rear, the rear lifts less, the vehicle tips back.

The inflow over the disc is v_ind (1 + k (r/R) cos psi) with k in proportion to the sine of the wake's skew angle. Near
hover the moment has the size of that of `flapping_moment` and the opposite sign; faster, or in climb, the wake is
swept away and it falls. Arms and body sit in that wake, so roll and pitch differ.
"""

import numpy as np

from vehicle.effects.base import PER_ROTOR_SPEED_SQUARED, Effect, Flow, Spec, Stage, Values, positive
from vehicle.effects.thrust.thrust_bem import induced_velocity


def apply(flow: Flow, p: Values) -> None:
    a_x, a_y, a_z = flow.hub_velocity_m_s()
    edgewise_squared = a_x * a_x + a_y * a_y
    two_rho_area = 2.0 * flow.air_density_kg_m3 * np.pi * flow.radius_m**2
    # momentum theory for a thrust that is known: the blade-element side is that thrust, whatever the flow
    v_ind = induced_velocity(np.ones_like(a_z), a_z, edgewise_squared, positive(flow.thrust_n), 0.0, two_rho_area)
    through_wake = np.sqrt(edgewise_squared + (a_z + v_ind) ** 2 + 1e-12)
    strength = flow.rotor_speed_rad_s * v_ind / through_wake
    flow.add_rotor_torque(0, 1.0, p.roll_kg_m * strength * a_y)
    flow.add_rotor_torque(1, -1.0, p.pitch_kg_m * strength * a_x)


EFFECT = Effect(
    name="wake_skew_moment",
    number=8,
    family="flapping",
    form="each axis, fading with airspeed",
    stage=Stage.FORCE,
    apply=apply,
    parameters=(
        Spec("roll_kg_m", "kg m", prior=1e-6, bounds=(-1e-3, 1e-3), planted=1.2e-6, scaling=PER_ROTOR_SPEED_SQUARED),
        Spec("pitch_kg_m", "kg m", prior=1e-6, bounds=(-1e-3, 1e-3), planted=1.8e-6, scaling=PER_ROTOR_SPEED_SQUARED),
    ),
    law="M_x = sum k_x n_i s_i a_y, M_y = -sum k_y n_i s_i a_x, s_i = v_ind / sqrt(a_xy^2 + (a_z + v_ind)^2)",
    source="White and Blake's inflow gradient, sqrt(2) sin(skew), as in Chen 1990 (NASA TM 102219); own linearisation",
    channel="M_x M_y",
    regressor="n v",
    excited_by=("fast_level", "oblique"),
)
