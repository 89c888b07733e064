"""An emptying battery turns the rotors slower for the same command."""

from vehicle.effects.base import Drive, Effect, Spec, Stage, Values


def apply(drive: Drive, p: Values) -> None:
    drive.command_rad_s = drive.command_rad_s * (1.0 - p.sag_per_v * (p.reference_v - drive.battery_v))


EFFECT = Effect(
    name="battery_sag",
    number=15,
    family="motor",
    form="speed falls with voltage",
    stage=Stage.COMMAND,
    apply=apply,
    parameters=(
        Spec("sag_per_v", "1/V", prior=0.05, bounds=(0.0, 1.0), planted=0.04),
        Spec("reference_v", "V", prior=1.0, bounds=(0.0, 100.0), default=16.8, planted=16.8, held=True),
    ),
    law="n_c (1 - s (V_ref - V)); V_ref, where speed equals command, is a convention and never estimated",
    source="own first-order form",
    channel="command to speed",
    regressor="battery voltage",
    excited_by=("long_hover",),
)
