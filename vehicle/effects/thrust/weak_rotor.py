"""One rotor gives less thrust than the others: a nicked blade, a tired motor bearing."""

import numpy as np

from vehicle.effects.base import Effect, Flow, Spec, Stage, Values


def apply(flow: Flow, p: Values) -> None:
    rotors = len(flow.thrust_n)
    loss = np.stack(np.broadcast_arrays(*(getattr(p, f"loss_{i}") for i in range(rotors)))).reshape(rotors, -1)
    flow.thrust_n *= 1.0 - loss


def of_rotors(count: int) -> tuple[Spec, ...]:
    """One loss for each rotor; the self-test plants two."""
    planted = {1: 0.05, 3: 0.02}
    return tuple(
        Spec(f"loss_{i}", "1", prior=0.03, bounds=(-0.5, 1.0), planted=planted.get(i, 0.0)) for i in range(count)
    )


EFFECT = Effect(
    name="weak_rotor",
    number=18,
    family="thrust curve",
    form="one rotor loses a share",
    stage=Stage.THRUST_FACTOR,
    apply=apply,
    parameters=of_rotors(4),
    each_rotor=of_rotors,
    law="T_i (1 - e_i)",
    source="own; the usual actuator-effectiveness factor of fault diagnosis",
    channel="M_x M_y F_z",
    regressor="one n_i^2",
    excited_by=("rotation", "vertical"),
    separate=True,
)
