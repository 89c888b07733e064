"""In forward flight the rear rotors work in the wake of the front ones and lose thrust; those in front may gain."""

import numpy as np

from vehicle.effects.base import ADVANCE, Effect, Flow, Spec, Stage, Values, positive

_MIDDLE_M2 = 1e-12


def apply(flow: Flow, p: Values) -> None:
    arm = flow.hub_m[:2]
    square = (arm * arm).sum(axis=0)
    middle = np.real(square) <= _MIDDLE_M2  # neither behind nor in front
    distance = np.where(middle, 1.0, square) ** 0.5
    behind = -(arm * flow.velocity_m_s[:2, None]).sum(axis=0) / distance  # m/s, positive for hubs downstream
    behind = np.where(middle, 0.0, behind)
    flow.thrust_n *= 1.0 - p.loss_s_m * positive(behind) + p.gain_s_m * positive(-behind)


EFFECT = Effect(
    name="rotor_interaction",
    number=19,
    family="inflow",
    form="lost in the others' wake",
    stage=Stage.THRUST_FACTOR,
    apply=apply,
    parameters=(
        Spec("loss_s_m", "s/m", prior=0.005, bounds=(0.0, 0.1), planted=0.006, scaling=ADVANCE),
        Spec("gain_s_m", "s/m", prior=0.005, bounds=(-0.1, 0.1), planted=0.0, optional=True, scaling=ADVANCE),
    ),
    law="T_i (1 - k max(0, s_i) + g max(0, -s_i)), s_i = -r_i . v_xy / |r_i|",
    source="own linear form of the wake effect in Yoon, Diaz, Boyd, Chan, Theodore 2017 (AHS Forum 73)",
    channel="M_x M_y",
    regressor="v_x, v_y",
    excited_by=("fast_level",),
    strength=("loss_s_m",),
)
