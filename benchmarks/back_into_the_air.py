"""What learning a hidden effect is worth in the air: tracking error before, after, and with the truth known.

For each effect a vehicle that has it, and a controller whose model lacks it, fly; the effect is added to the model and
fitted to the log; the new parameters go to the controller; it flies again. Effects that the controller does not cancel
are there too, for what learning them is worth to it. The same once more without a given effect: a
diagnosis of the two logs names it, or does not.
"""

import controller as curves
import report
import second_flight
from second_flight import SecondFlight

import sysid
from firmware_bridge.controller import compensated_effects
from goshawk.demo.chain import vehicles
from vehicle import Vehicle

HIDDEN = {
    "rotor_drag_thrust": {"drag_s_m": 0.0175},
    "parasitic_drag": {"drag_xy_kg_m": 0.012, "drag_z_kg_m": 0.0185},
    "centre_of_mass": {"x_m": 0.012, "y_m": -0.008},
    "weak_rotor": {"loss_1": 0.12},
    "translational_lift": {"lift_kg_m": 0.0034},
    "flapping_moment": {"moment_kg_m": 1.5e-6},
    "angular_damping": {"x_n_m_s": 0.004, "y_n_m_s": 0.0045, "z_n_m_s": 0.0025},
    "payload": {"added_kg": 0.1, "x_m": 0.01, "z_m": -0.03},
    "airframe_side_moment": {"x_kg": 0.0, "y_kg": 0.0, "z_kg": 0.0006},
    "constant_wind": {"x_m_s": 2.0, "y_m_s": -1.0},
    "rotor_interaction": {"loss_s_m": 0.01},
    "gyroscopic_torque": {"rotor_inertia_kg_m2": 2e-5},
}
"""Effects of the true vehicle that the controller's model lacks, with sizes typical of such a vehicle."""

ONLY = {"payload": ("payload.added_kg", "payload.x_m", "payload.y_m")}
"""Free parameters for some effects: motion determines ratios to the mass, so for a payload the
other parameters are held at the values that were found without it."""


def hidden(effect: str) -> tuple[Vehicle, Vehicle]:
    """The true vehicle with the effect, and the model without it."""
    base = vehicles()[0]
    without = base.without_effect(effect) if effect in base.effects else base
    return without.with_effect(effect, **HIDDEN[effect]), without


def second(effect: str, *, given: bool = True) -> SecondFlight:
    """A level figure of eight at 7 m/s before and after; a second flight, with climbs and turns, teaches as well.

    Args:
        given: whether the effect is given; else a diagnosis has to find it.
    """
    truth, believed = hidden(effect)
    course = curves.FLIGHTS.figure_eight(7.0, 6.0, turns=1)
    turning = curves.FLIGHTS.general(turns=2)
    named = second_flight.adding(effect, sysid.Options(free=ONLY.get(effect)))
    return second_flight.fly_again(
        truth, believed, course, named if given else second_flight.diagnosing, training=[turning]
    )


def rows() -> list[report.Row]:
    found = []
    for effect in HIDDEN:
        flown, diagnosed = second(effect), second(effect, given=False)
        peers = {"before": 100 * flown.before_m, "truth known": 100 * flown.known_m}
        peers[f"diagnosed as {' and '.join(diagnosed.added) or 'nothing'}"] = 100 * diagnosed.after_m
        if compensated_effects()[effect]:
            bar = f"<= {110 * flown.known_m:.2f}"
            met = flown.after_m <= 1.1 * flown.known_m
            found.append(report.row(effect, 100 * flown.after_m, "cm", bar, met, peers))
        else:
            found.append(report.row(f"{effect} (not compensated)", 100 * flown.after_m, "cm", peers=peers))
    return found


if __name__ == "__main__":
    report.main(rows)
