"""What a fit without a pose tells besides its parameters: thrust by command, the accelerometer's place."""

from collections.abc import Sequence

import numpy as np

from flight.rotations import FloatArray
from sysid.estimator.flights.clocks import ACCELEROMETER, STREAMS, Clock
from sysid.estimator.flights.flight_data import Flight
from sysid.estimator.joint_problem.solver import Solution, robust_covariance
from sysid.estimator.joint_problem.unknowns import Unknowns
from sysid.estimator.uncertainty.errors import NORMAL_90
from sysid.estimator.without_pose import rotors
from sysid.estimator.without_pose.anchors import nudged, rotor_thrust_n
from sysid.estimator.without_pose.sensing import PLACE, left
from sysid.logs.sensors.low_pass import KEY
from vehicle import Vehicle

COMMANDS = (0.3, 0.5, 0.7, 0.9)
"""Commands that the thrust is told at, where the rotors reached their speeds."""
ANSWERED = 0.3
"""Share of the vertical force's variance within a second that commands must explain."""
SPAN_S = 1.0
LATE_S = 8e-3
"""Of an accelerometer whose low-pass nobody named: twins' inertias were 1 % small at 7 ms, 3 % at 12, 72 % at 17."""
UNKNOWN = (
    "without a pose drag against wind, the size of mass and inertia (only their ratios to the mass given) and errors "
    "of the accelerometer's scale stay unknown"
)


def sentences(flights: Sequence[Flight], solution: Solution, unknowns: Unknowns) -> list[str]:
    """For the reader of the fit."""
    return [*_nominal(flights), *_thrust(flights, solution, unknowns), _place(solution, unknowns.names), UNKNOWN]


def unanswered(flights: Sequence[Flight], solution: Solution) -> list[str]:
    """A sentence if the accelerometer does not feel what is commanded: propellers off, another's outputs."""
    point = solution.point
    squares = np.zeros(2)
    for flight in flights:
        force, over = flight.specific_force_body_m_s2[:, 2], left(flight, point.vehicle, point.sensors)[:, 2]
        width = max(2, round(SPAN_S / float(np.median(flight.step_s))))
        squares += [float(((values - _slow(values, width)) ** 2).sum()) for values in (force, over)]
    explained = 1.0 - squares[1] / max(squares[0], 1e-300)
    if explained > ANSWERED:
        return []
    return [
        f"commands explain {max(explained, 0.0):.0%} of what the accelerometer feels along the thrust: another "
        "vehicle's outputs, an accelerometer on its side, or too little throttle to see above vibration. Fly throttle "
        "steps, and check rotor order and axes"
    ]


def unnamed_low_pass(flights: Sequence[Flight], delays: Sequence[Clock]) -> list[str]:
    """A sentence for each log whose accelerometer is late as one behind a low-pass, which the log does not name."""
    unnamed = {flight.name for flight in flights if flight.accelerometer_low_pass is None}
    late = [one for one in delays if one.stream == STREAMS[ACCELEROMETER] and one.off and one.delay_s > LATE_S]
    return [
        f"{one.flight}: accelerometer is {1e3 * one.delay_s:.0f} ms late: its low-pass makes inertias too small. Name "
        f"its low-pass in the log's metadata (a CSV's column map): [metadata.{KEY}], natural_rad_s and damping"
        for one in late
        if one.flight in unnamed
    ]


def thrust_by_command(
    flights: Sequence[Flight], solution: Solution, unknowns: Unknowns, ratio: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Thrust of one rotor at commands (n,) from 0 to 1, and half widths of the 90 % intervals, N.

    The flights must have had such commands (`full_throttle_rad_s`).
    """
    full = next(f.full_throttle_rad_s for f in flights if f.full_throttle_rad_s is not None)
    names, vehicle = unknowns.model, solution.point.vehicle
    thrust = [i for i, name in enumerate(names) if name.startswith("thrust_")]
    covariance = robust_covariance(solution, len(unknowns.bias) + len(unknowns.delay))[0]
    plain = solution.covariance()
    slopes = np.stack([_slope(vehicle, names[i], full * ratio) for i in thrust], axis=1)
    both = [np.einsum("ni,ij,nj->n", slopes, c[np.ix_(thrust, thrust)], slopes) for c in (covariance, plain)]
    moved = np.zeros(len(ratio))
    if solution.shifts is not None:
        moved = ((slopes @ solution.shifts[thrust]) ** 2).sum(axis=1)
    return rotor_thrust_n(vehicle, full * ratio), NORMAL_90 * np.sqrt(np.maximum(*both) + moved)


def _slow(values: FloatArray, width: int) -> FloatArray:
    """Running mean over `width` samples, or all."""
    ones = np.ones(min(width, len(values)))
    return np.convolve(values, ones, "same") / np.convolve(np.ones_like(values), ones, "same")


def _slope(vehicle: Vehicle, name: str, speed_rad_s: FloatArray) -> FloatArray:
    """Derivative of a rotor's thrust by a parameter: thrust is linear in them."""
    there, step = nudged(vehicle, name)
    return (rotor_thrust_n(there, speed_rad_s) - rotor_thrust_n(vehicle, speed_rad_s)) / step


def _nominal(flights: Sequence[Flight]) -> list[str]:
    full = {f.full_throttle_rad_s for f in flights if f.full_throttle_rad_s is not None}
    if not full:
        return []
    return [
        f"rotor speed was not logged: commands 0 to 1 were taken for 0 to {min(full):.0f} rad/s, the vehicle file's "
        "fastest. Thrust per command, lag and inertia do not depend on that"
    ]


def _thrust(flights: Sequence[Flight], solution: Solution, unknowns: Unknowns) -> list[str]:
    reached = _reached(flights, solution)
    if not len(reached) or not any(name.startswith("thrust_") for name in unknowns.model):
        return []
    low, usual, high = np.quantile(reached, [0.01, 0.5, 0.99])
    at = np.array([u for u in COMMANDS if low <= u <= high] or [usual])
    value, half = thrust_by_command(flights, solution, unknowns, at)
    listed = ", ".join(f"{v:.3g} ± {h:.1g} at {u:.2g}" for u, v, h in zip(at, value, half, strict=True))
    return [f"thrust of a rotor by command (N, 90 % interval): {listed}"]


def _reached(flights: Sequence[Flight], solution: Solution) -> FloatArray:
    """Rotor speeds over the fastest: commands that are gone before the rotors follow show nothing of their thrust."""
    point = solution.point
    return np.concatenate(
        [
            rotors.driven(f, point.vehicle, point.sensors).rotor_speed_rad_s.ravel() / f.full_throttle_rad_s
            for f in flights
            if f.full_throttle_rad_s is not None
        ]
        or [np.empty(0)]
    )


def _place(solution: Solution, names: Sequence[str]) -> str:
    columns = [names.index(name) for name in PLACE]
    place = 1e3 * np.array([solution.point.sensors.get(name, 0.0) for name in PLACE])
    std = 1e3 * np.sqrt(np.diag(solution.covariance()))[columns]
    listed = ", ".join(f"{axis} {p:.1f} ± {s:.1f}" for axis, p, s in zip("xyz", place, std, strict=True))
    return f"the accelerometer is at {listed} mm from the centre of mass"
