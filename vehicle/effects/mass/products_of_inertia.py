"""The body's principal axes are not its arms' axes."""

import numpy as np

from vehicle.effects.base import INERTIA, Effect, RigidBody, Spec, Stage, Values


def apply(body: RigidBody, p: Values) -> None:
    zero = 0.0 * (p.xy_kg_m2 + p.xz_kg_m2 + p.yz_kg_m2)
    rows = ((zero, p.xy_kg_m2, p.xz_kg_m2), (p.xy_kg_m2, zero, p.yz_kg_m2), (p.xz_kg_m2, p.yz_kg_m2, zero))
    added = np.stack([np.stack(np.broadcast_arrays(*row)) for row in rows])
    shape = (3, 3, *(1,) * (added.ndim - 2))
    own = body.inertia_kg_m2.reshape(shape) if body.inertia_kg_m2.ndim == 2 else body.inertia_kg_m2
    body.inertia_kg_m2 = own + added


EFFECT = Effect(
    name="products_of_inertia",
    number=26,
    stage=Stage.MASS,
    apply=apply,
    parameters=(
        Spec("xy_kg_m2", "kg m2", prior=1e-4, bounds=(-1.0, 1.0), planted=1.1e-4, scaling=INERTIA),
        Spec("xz_kg_m2", "kg m2", prior=1e-4, bounds=(-1.0, 1.0), planted=-1.6e-4, scaling=INERTIA),
        Spec("yz_kg_m2", "kg m2", prior=1e-4, bounds=(-1.0, 1.0), planted=0.7e-4, scaling=INERTIA),
    ),
    law="I = [[Ixx, xy, xz], [xy, Iyy, yz], [xz, yz, Izz]] (the entries themselves, sign included)",
    source="Euler",
    channel="M_x M_y M_z",
    regressor="dw/dt of another axis",
    excited_by=("rotation",),
)
