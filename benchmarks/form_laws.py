"""The true laws of the campaigns of another form (`blind_forms`), as effects whose sizes and shapes a fit estimates.

With them a fit has the form that no catalogue holds: how far its held-out predictions are off is the best that a model
learnt from these flights can do.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import vehicle

NAME = "true_form"


@dataclass(frozen=True, slots=True)
class Law:
    """One law as an effect file says it."""

    stage: str
    body: str
    """Statements, one a line."""
    parameters: dict[str, tuple[str, float, float, float]]
    """Name to unit, start, least and most."""
    reads_height: bool = False


_WAKE = """arm = flow.hub_m[:2]
towards = -(arm * flow.velocity_m_s[:2, None]).sum(axis=0) / (arm * arm).sum(axis=0) ** 0.5
flow.thrust_n *= 1.0 - clipped(p.loss_s2_m2 * positive(towards) ** 2, 0.0, 0.4)"""
_LIFT = """square = (flow.velocity_m_s[:2] ** 2).sum(axis=0) / p.speed_m_s**2
flow.thrust_n += p.lift_n * square / (1.0 + square)"""
_SPEED = ("m/s", 3.0, 0.3, 30.0)

LAWS = {
    "M = -c |w|^0.5 w": Law(
        "FORCE",
        "for i, size in enumerate((p.x_n_m, p.y_n_m, p.z_n_m)):\n"
        "    flow.torque_n_m[i] -= size * flow.rate_rad_s[i] * magnitude(flow.rate_rad_s[i]) ** 0.5",
        dict.fromkeys(("x_n_m", "y_n_m", "z_n_m"), ("N m", 0.002, 0.0, 0.1)),
    ),
    "F_xy = -c tanh(v / s)": Law(
        "FORCE",
        "flow.force_n[:2] -= p.force_n * np.tanh(flow.velocity_m_s[:2] / p.speed_m_s)",
        {"force_n": ("N", 0.25, 0.0, 5.0), "speed_m_s": _SPEED},
    ),
    "F = -c |v|^1.6 v": Law(
        "FORCE",
        "flow.force_n -= p.force_n * (length(flow.velocity_m_s) / 5.0) ** 1.6 * flow.velocity_m_s / 5.0",
        {"force_n": ("N", 0.2, 0.0, 5.0)},
    ),
    "T (1 + a exp(-h / s))": Law(
        "THRUST_FACTOR",
        "assert flow.height_m is not None\n"
        "flow.thrust_n *= 1.0 + p.share * np.exp(-positive(flow.height_m) / p.fades_m)",
        {"share": ("1", 0.12, 0.0, 2.0), "fades_m": ("m", 0.17, 0.02, 2.0)},
        reads_height=True,
    ),
    "T + a v2 / (s2 + v2)": Law("THRUST", _LIFT, {"lift_n": ("N", 0.05, 0.0, 2.0), "speed_m_s": _SPEED}),
    "M = c tanh(v / s)": Law(
        "FORCE",
        "flow.torque_n_m[0] -= p.x_n_m * np.tanh(flow.velocity_m_s[1] / p.speed_m_s)\n"
        "flow.torque_n_m[1] += p.y_n_m * np.tanh(flow.velocity_m_s[0] / p.speed_m_s)",
        {"x_n_m": ("N m", 3e-3, 0.0, 0.1), "y_n_m": ("N m", 3e-3, 0.0, 0.1), "speed_m_s": _SPEED},
    ),
    "T falls by a step at a sink rate": Law(
        "THRUST_FACTOR",
        "flow.thrust_n *= 1.0 - p.share / (1.0 + np.exp((flow.velocity_m_s[2] + p.begins_m_s) / 0.4))",
        {"share": ("1", 0.08, 0.0, 0.9), "begins_m_s": ("m/s", 1.5, 0.3, 5.0)},
    ),
    "rear rotors lose v2": Law("THRUST_FACTOR", _WAKE, {"loss_s2_m2": ("s2/m2", 1.2e-3, 0.0, 0.05)}),
    "one rotor loses more the faster it turns": Law(
        "THRUST_FACTOR",
        "flow.thrust_n[ROTOR] *= 1.0 - p.share * (flow.rotor_speed_rad_s[ROTOR] / 450.0) ** 2",
        {"share": ("1", 0.03, 0.0, 0.9)},
    ),
}
"""By the law as the truth file says it."""


def informed(given: vehicle.Vehicle, law: str, variables: Sequence[str], folder: Path) -> vehicle.Vehicle:
    """The vehicle with the true law, its sizes unknown.

    Args:
        variables: what the truth file says the law reads: of one rotor's, which rotor.
        folder: where the effect's file is written.
    """
    file = folder / f"{NAME}_{list(LAWS).index(law)}_{'_'.join(variables)}.py"
    file.write_text(text(LAWS[law], file.stem, variables[0].removeprefix("n_")))
    return given.with_effect_file(file)


def text(law: Law, name: str, rotor: str = "0") -> str:
    """An effect file of a law."""
    specs = "".join(
        f'        Spec("{n}", "{unit}", prior={start}, bounds=({least}, {most}), default={start}, planted={start}),\n'
        for n, (unit, start, least, most) in law.parameters.items()
    )
    body = "\n".join(f"    {line}" for line in law.body.replace("ROTOR", rotor).splitlines())
    return f'''"""The true law of a campaign."""

import numpy as np

from vehicle.effects.base import Effect, Flow, Spec, Stage, Values, clipped, length, magnitude, positive


def apply(flow: Flow, p: Values) -> None:
{body}


EFFECT = Effect(
    name="{name}",
    number=0,
    stage=Stage.{law.stage},
    apply=apply,
    parameters=(
{specs}    ),
    law="the true one",
    source="blind_forms",
    channel="F_x F_y F_z M_x M_y M_z",
    regressor="",
    excited_by=("fast_level",),
    needs=({'"height_m",' if law.reads_height else ""}),
)
'''
