"""Something was added or taken off: a point mass at a place.

Inertia depends on the square of its height only, so whether it sits above or below must come from the start value.
"""

import numpy as np

from vehicle.effects.base import LENGTH, OF_THRUST, Effect, RigidBody, Spec, Stage, Values


def apply(body: RigidBody, p: Values) -> None:
    place = np.stack(np.broadcast_arrays(p.x_m, p.y_m, p.z_m))
    tail = (1,) * (place.ndim - 1)
    centre = body.centre_of_mass_m.reshape(3, *tail) if body.centre_of_mass_m.ndim == 1 else body.centre_of_mass_m
    arm = place - centre
    total = body.mass_kg + p.added_kg
    reduced = body.mass_kg * p.added_kg / total
    square = (arm * arm).sum(axis=0) * np.eye(3).reshape(3, 3, *tail) - arm[:, None] * arm[None]
    inertia = body.inertia_kg_m2.reshape(3, 3, *tail) if body.inertia_kg_m2.ndim == 2 else body.inertia_kg_m2
    body.inertia_kg_m2 = inertia + reduced * square
    body.centre_of_mass_m = centre + arm * (p.added_kg / total)
    body.mass_kg = total


EFFECT = Effect(
    name="payload",
    number=22,
    stage=Stage.MASS,
    apply=apply,
    parameters=(
        Spec("added_kg", "kg", prior=0.1, bounds=(-100.0, 100.0), planted=0.12, scaling=OF_THRUST),
        Spec("x_m", "m", prior=0.03, bounds=(-1.0, 1.0), planted=0.01, scaling=LENGTH),
        Spec("y_m", "m", prior=0.03, bounds=(-1.0, 1.0), planted=-0.005, scaling=LENGTH),
        Spec("z_m", "m", prior=0.03, bounds=(-1.0, 1.0), default=-0.02, planted=-0.03, scaling=LENGTH),
    ),
    law="m + dm; parallel-axis inertia; the centre of mass moves by dm / (m + dm) of the arm",
    source="Newton; parallel-axis theorem",
    channel="F_z M_x M_y",
    regressor="T, between flights",
    excited_by=("vertical", "rotation"),
    strength=("added_kg",),
    between_flights=True,
)
