"""One rotor gives less thrust than the others: a nicked blade, a tired motor bearing."""

import numpy as np

from vehicle.effects.base import Effect, Flow, Spec, Stage, Values


def apply(flow: Flow, p: Values) -> None:
    loss = np.stack(np.broadcast_arrays(p.loss_0, p.loss_1, p.loss_2, p.loss_3)).reshape(4, -1)
    flow.thrust_n *= 1.0 - loss


EFFECT = Effect(
    name="weak_rotor",
    number=18,
    family="thrust curve",
    form="one rotor loses a share",
    stage=Stage.THRUST_FACTOR,
    apply=apply,
    parameters=(
        Spec("loss_0", "1", prior=0.03, bounds=(-0.5, 1.0), planted=0.0),
        Spec("loss_1", "1", prior=0.03, bounds=(-0.5, 1.0), planted=0.05),
        Spec("loss_2", "1", prior=0.03, bounds=(-0.5, 1.0), planted=0.0),
        Spec("loss_3", "1", prior=0.03, bounds=(-0.5, 1.0), planted=0.02),
    ),
    law="T_i (1 - e_i)",
    source="own; the usual actuator-effectiveness factor of fault diagnosis",
    channel="M_x M_y F_z",
    regressor="one n_i^2",
    excited_by=("rotation", "vertical"),
    separate=True,
)
