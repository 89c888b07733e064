"""What is known of a parameter whose value is not physical: its ratio to the one that flights tell it by.

Motion shows a torque only over an inertia and a force only over the mass. So where an inertia comes out beyond what
mass and size allow, the coefficient that turns the body about that axis is off by the same factor; their ratio holds.
"""

from collections.abc import Iterable, Mapping, Sequence

import numpy as np

from flight.rotations import FloatArray
from sysid.estimator import verdict as verdicts
from vehicle.purpose import EVERY

THRUST = "thrust_"
PARTNERS = {
    "inertia_xx_kg_m2": (THRUST, "k / I_xx"),
    "inertia_yy_kg_m2": (THRUST, "k / I_yy"),
    "inertia_zz_kg_m2": ("rotor_yaw_torque.", "c_q / I_zz"),
}
"""Of an inertia: how the name of the coefficient begins whose ratio to it shows, and that ratio in symbols."""
WORTH_SAYING = 0.2
"""A ratio whose relative standard error is above this is not called known."""


def doubtful(
    verdict: verdicts.Verdict, names: Sequence[str], values: Mapping[str, tuple[float, float]], correlation: FloatArray
) -> dict[str, str]:
    """Parameters that are not to be designed by, each with what is known all the same.

    Args:
        names: free parameters, in the order of `correlation` (p, p).
        values: of each, its value and robust standard error.
    """
    found: dict[str, str] = {}
    for name in verdict.unphysical:
        if name == verdicts.THRUST:
            found |= {thrust: "thrust / mass" for thrust in names if thrust.startswith(THRUST)}
        elif name in names:
            found[name] = _ratio(name, names, values, correlation)
    if verdict.against and not found:
        found[EVERY] = verdict.against[0]
    return found


def _ratio(name: str, names: Sequence[str], values: Mapping[str, tuple[float, float]], correlation: FloatArray) -> str:
    begins, symbols = PARTNERS.get(name, ("", ""))
    partner = _first(n for n in names if begins and n.startswith(begins))
    if partner is None:
        return ""
    (below, below_std), (above, above_std) = values[name], values[partner]
    if not (below and above):
        return ""
    a, b = above_std / abs(above), below_std / abs(below)
    r = float(correlation[names.index(partner), names.index(name)])
    relative = float(np.sqrt(max(0.0, a * a + b * b - 2.0 * r * a * b)))
    return f"{symbols} = {above / below:.3g} ± {100.0 * relative:.1g} % is known" if relative < WORTH_SAYING else ""


def _first(names: Iterable[str]) -> str | None:
    return next(iter(names), None)
