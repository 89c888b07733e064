"""The centre of mass lies beside the middle of the hubs, so that thrust has a lever arm."""

import numpy as np

from vehicle.effects.base import LENGTH, Effect, RigidBody, Spec, Stage, Values


def apply(body: RigidBody, p: Values) -> None:
    zero = 0.0 * (p.x_m + p.y_m)
    offset = np.stack(np.broadcast_arrays(p.x_m, p.y_m, zero))
    body.centre_of_mass_m = body.centre_of_mass_m.reshape(3, *(1,) * (offset.ndim - 1)) + offset


EFFECT = Effect(
    name="centre_of_mass",
    number=16,
    stage=Stage.MASS,
    apply=apply,
    parameters=(
        Spec("x_m", "m", prior=2e-3, bounds=(-0.1, 0.1), planted=1.4e-3, scaling=LENGTH),
        Spec("y_m", "m", prior=2e-3, bounds=(-0.1, 0.1), planted=-0.8e-3, scaling=LENGTH),
    ),
    law="hub i sits at r_i - (dx, dy, 0) from the centre of mass",
    source="Rigter et al. eq. (3)",
    channel="M_x M_y",
    regressor="T",
    excited_by=("hover", "vertical"),
)
