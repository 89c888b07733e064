"""The centre of mass lies below (or above) the hubs: drag at the rotors has a lever arm and tips the vehicle."""

import numpy as np

from vehicle.effects.base import Effect, RigidBody, Spec, Stage, Values


def apply(body: RigidBody, p: Values) -> None:
    zero = 0.0 * p.z_m
    offset = np.stack(np.broadcast_arrays(zero, zero, p.z_m))
    body.centre_of_mass_m = body.centre_of_mass_m.reshape(3, *(1,) * (offset.ndim - 1)) + offset


EFFECT = Effect(
    name="centre_of_mass_height",
    number=16,
    stage=Stage.MASS,
    apply=apply,
    parameters=(Spec("z_m", "m", prior=1e-2, bounds=(-0.3, 0.3), planted=-0.02),),
    law="hub i sits at r_i - (0, 0, dz) from the centre of mass",
    source="mechanics: drag f_i of the rotors at height -dz above the centre of mass adds the moment -dz e3 x f_i",
    channel="M_x M_y",
    regressor="drag of the rotors",
    excited_by=("fast_level", "rotation"),
    moves_like="flapping_moment",
)
