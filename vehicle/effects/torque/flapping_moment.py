"""Blade flapping in edgewise flow: a moment at each hub. A positive one tips the nose down in forward flight."""

from vehicle.effects.base import PER_ROTOR_SPEED_SQUARED, Effect, Flow, Spec, Stage, Values


def apply(flow: Flow, p: Values) -> None:
    a_x, a_y, _ = flow.hub_velocity_m_s()
    flow.add_rotor_torque(0, -1.0, p.moment_kg_m * flow.rotor_speed_rad_s * a_y)
    flow.add_rotor_torque(1, 1.0, p.moment_kg_m * flow.rotor_speed_rad_s * a_x)


EFFECT = Effect(
    name="flapping_moment",
    number=8,
    family="flapping",
    form="alike in roll and pitch",
    stage=Stage.FORCE,
    apply=apply,
    parameters=(
        Spec("moment_kg_m", "kg m", prior=1e-6, bounds=(-1e-3, 1e-3), planted=1.5e-6, scaling=PER_ROTOR_SPEED_SQUARED),
    ),
    law="M = -k_f sum n_i (a_i x e3)",
    source="RotorPy (Folk, Paulos, Kumar 2023), k_flap; for the physics Hoffmann, Huang, Waslander, Tomlin 2007",
    channel="M_x M_y",
    regressor="n v",
    excited_by=("fast_level",),
)
