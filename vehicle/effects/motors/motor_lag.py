"""Rotors follow their command late; speeding up and slowing down take different times."""

import numpy as np

from vehicle.effects.base import Drive, Effect, Spec, Stage, Values


def apply(drive: Drive, p: Values) -> None:
    error = drive.command_rad_s - drive.speed_rad_s
    drive.acceleration_rad_s2 = error / np.where(np.real(error) > 0.0, p.rise_s, p.fall_s)


EFFECT = Effect(
    name="motor_lag",
    number=12,
    family="motor",
    form="first order, rise and fall apart",
    stage=Stage.DRIVE,
    apply=apply,
    parameters=(
        Spec("rise_s", "s", prior=0.05, bounds=(1e-4, 1.0), default=0.03, planted=0.045),
        Spec("fall_s", "s", prior=0.05, bounds=(1e-4, 1.0), default=0.03, planted=0.060),
    ),
    law="dn/dt = (n_c - n) / tau, tau_rise when n_c > n else tau_fall",
    source="Furrer, Burri, Achtelik, Siegwart 2016, RotorS: first order, one time constant up and one down",
    channel="command",
    regressor="d(command)/dt",
    excited_by=("doublets",),
)
