"""A part of the air's torque on each rotor that grows with rotor speed alone: blades at a low Reynolds number."""

from vehicle.effects.base import DAMPING, Effect, Flow, Spec, Stage, Values


def apply(flow: Flow, p: Values) -> None:
    flow.add_rotor_torque(2, -p.slope_n_m_s, flow.spin * flow.rotor_speed_rad_s)


EFFECT = Effect(
    name="torque_affine",
    number=27,
    family="torque curve",
    form="affine below the square",
    stage=Stage.FORCE,
    apply=apply,
    parameters=(Spec("slope_n_m_s", "N m s", prior=3e-6, bounds=(-1e-2, 1e-2), planted=4e-6, scaling=DAMPING),),
    law="M_z -= k_a sum spin_i n_i, beside rotor_yaw_torque; of a constant, rotors of both spins show nothing",
    source="own; Schuck, crazyflow 0.4 fits such curves to load cell data of the Crazyflie 2.1 Brushless",
    channel="M_z",
    regressor="sum spin n",
    excited_by=("yaw_doublets", "throttle_steps"),
)
