"""Which parameter these flights show least, and whether they show it at all."""

from collections.abc import Collection

import numpy as np

from sysid.estimator.joint_problem.problem import Point
from sysid.estimator.joint_problem.solver import Solution
from sysid.estimator.joint_problem.unknowns import Unknowns
from vehicle import Vehicle, specs

UNSEEN_SHARE = 0.5
"""A parameter is not identifiable when its standard error exceeds this share of its typical size."""

NEVER_ZERO = ("inertia_", "thrust_quadratic.", "thrust_bem.", "thrust_blade_element.", "rotor_yaw_torque.")
"""What every vehicle has: its own value is its size. All others may be nil, which their typical size says."""


def usual_size(vehicle: Vehicle, point: Point, name: str) -> float:
    """The size a standard error is judged by: the value itself, or what is typical of the effect if larger."""
    value = max(abs(point.value(name)), abs(vehicle.value(name)))
    return value if name.startswith(NEVER_ZERO) and value > 0.0 else max(value, specs(vehicle)[name].prior)


def least_seen(solution: Solution, vehicle: Vehicle, unknowns: Unknowns, *, but: Collection[str] = ()) -> str | None:
    """The parameter these flights show least, if they do not show it at all.

    Args:
        but: names that are not asked for.
    """
    named = (*unknowns.model, *unknowns.sensor)
    asked = [i for i, name in enumerate(named) if name not in but]
    if not asked:
        return None
    std = np.sqrt(np.diag(solution.covariance()))[asked]
    named = tuple(named[i] for i in asked)
    share = std / np.array([usual_size(vehicle, solution.point, name) for name in named])
    worst = int(np.argmax(share))
    return named[worst] if share[worst] > UNSEEN_SHARE else None


def message(name: str) -> str:
    """Why a parameter is refused."""
    return (
        f"{name} is not identifiable from these flights: its standard error is larger than half its typical size; "
        "fly a manoeuvre that excites it, or hold it (--hold-unidentifiable)"
    )
