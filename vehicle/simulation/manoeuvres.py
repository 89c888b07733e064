"""Manoeuvres that excite the effects, as trajectories for simulation, planning and flight.

Each is made of legs from rest to rest, every axis with its own list, so that axes can move at different times.
Sizes are for an open hall; `scaled` fits them to another place or vehicle.
"""

from collections.abc import Callable, Sequence
from math import pi

import numpy as np

from flight import FloatArray, InputError, Trajectory, polynomial

Leg = tuple[float, float]
"""Duration in seconds, and how far the axis goes in that time (metres, or radians for yaw)."""

_REST_TO_REST = np.array([0.0, 0.0, 0.0, 0.0, 35.0, -84.0, 70.0, -20.0])
"""Smoothest unit step: velocity, acceleration and jerk vanish at both ends. Peak speed 2.19, acceleration 7.51."""


def from_legs(
    x: Sequence[Leg] = (),
    y: Sequence[Leg] = (),
    z: Sequence[Leg] = (),
    yaw: Sequence[Leg] = (),
    *,
    start_world_m: tuple[float, float, float] = (0.0, 0.0, 1.5),
) -> Trajectory:
    """A trajectory whose axes each fly their own legs; shorter axes wait for the longest at the end.

    Raises:
        InputError: no axis moves, or a leg takes no time.
    """
    axes = (x, y, z, yaw)
    if any(duration <= 0.0 for legs in axes for duration, _ in legs):
        raise InputError("every leg needs a positive duration")
    breaks = [np.concatenate([[0.0], np.cumsum([duration for duration, _ in legs])]) for legs in axes]
    knots = _merged(np.concatenate(breaks))
    if len(knots) < 2:
        raise InputError("a manoeuvre needs at least one leg")
    coefficients = np.stack(
        [
            _on_knots(knots, own, [value for _, value in legs], begin)
            for own, legs, begin in zip(breaks, axes, (*start_world_m, 0.0), strict=True)
        ],
        axis=1,
    )
    return Trajectory(np.diff(knots), coefficients)


def _merged(times: FloatArray) -> FloatArray:
    """Sorted, without near duplicates."""
    times = np.sort(times)
    return times[np.concatenate([[True], np.diff(times) > 1e-9])]


def _on_knots(knots: FloatArray, breaks: FloatArray, steps: Sequence[float], start: float) -> FloatArray:
    """One axis's legs as coefficients (k, 8) on the common knots."""
    level = start + np.concatenate([[0.0], np.cumsum(steps)])
    pieces = np.zeros((len(knots) - 1, 8))
    for i, begin in enumerate(knots[:-1]):
        leg = int(np.searchsorted(breaks, begin + 1e-9, side="right")) - 1
        if leg >= len(steps):
            pieces[i, 0] = level[-1]
            continue
        duration = breaks[leg + 1] - breaks[leg]
        curve = steps[leg] * polynomial.scale_argument(_REST_TO_REST, 1.0 / duration)
        pieces[i] = polynomial.shift_argument(curve, begin - breaks[leg])
        pieces[i, 0] += level[leg]
    return pieces


def _there_and_back(duration_s: float, size: float, repeats: int = 1) -> list[Leg]:
    return [(duration_s, size), (duration_s, -size)] * repeats


def _hover() -> Trajectory:
    return from_legs(x=[(6.0, 0.0)])


def _long_hover() -> Trajectory:
    return from_legs(z=[(60.0, 1.0), (60.0, -1.0)])


def _vertical() -> Trajectory:
    return from_legs(z=_there_and_back(2.0, 4.0, 3) + _there_and_back(3.0, 9.0, 1))


def _throttle_steps() -> Trajectory:
    return from_legs(z=_there_and_back(0.7, 0.5, 4) + _there_and_back(1.0, 1.2, 3))


def _descent() -> Trajectory:
    return from_legs(z=[(6.0, 24.0), (5.2, -24.0), (6.0, 24.0), (8.0, -24.0)])


def _fast_level() -> Trajectory:
    turn = 11.0
    x = [*_there_and_back(4.5, 20.0), (turn, 0.0), *_there_and_back(3.5, 9.0)]
    y = [(9.0, 0.0), *_there_and_back(4.5, 20.0), (2.0, 0.0), *_there_and_back(3.5, 9.0)]
    return from_legs(x=x, y=y)


def _oblique() -> Trajectory:
    return from_legs(x=_there_and_back(4.0, 14.0, 2), y=_there_and_back(4.0, -10.0, 2), z=_there_and_back(4.0, 7.0, 2))


def _vertical_weave() -> Trajectory:
    bob = _there_and_back(1.25, 0.9)
    return from_legs(x=_there_and_back(4.0, 15.0), y=[(8.0, 0.0), *_there_and_back(4.0, 15.0)], z=bob * 6)


def _doublets() -> Trajectory:
    short = _there_and_back(0.8, 0.42, 3)
    wait = (0.8 * 6, 0.0)
    return from_legs(x=[*short, wait], y=[wait, *short])


def _rotation() -> Trajectory:
    return from_legs(
        x=_there_and_back(0.95, 0.42, 8),
        y=[(0.4, 0.0), *_there_and_back(1.05, 0.5, 6)],
        z=_there_and_back(1.3, 0.5, 5),
        yaw=_there_and_back(1.4, 0.8, 5),
    )


def _yaw_sweep() -> Trajectory:
    return from_legs(x=_there_and_back(4.0, 14.0, 2), yaw=[(1.5, 1.2 * pi), (1.5, -1.2 * pi)] * 5)


def _yaw_doublets() -> Trajectory:
    yaw = _there_and_back(1.0, 0.6, 4) + _there_and_back(1.5, 1.6, 3)
    return from_legs(x=_there_and_back(1.0, 0.6, 7), y=[(0.5, 0.0), *_there_and_back(1.1, 0.6, 6)], yaw=yaw)


def _ground_sweep() -> Trajectory:
    z = [(3.0, -0.42), (2.0, 0.0), (3.0, 0.10), (2.0, 0.0), (3.0, 0.35)]
    return from_legs(x=_there_and_back(6.0, 2.0), z=z, start_world_m=(0.0, 0.0, 0.5))


def _ceiling_climb() -> Trajectory:
    z = [(4.0, 1.27), (3.0, 0.08), (3.0, -0.10), (4.0, -1.25)]
    return from_legs(z=z, start_world_m=(0.0, 0.0, 1.5))


CEILING_M = 3.0
"""Height of the ceiling that `ceiling_climb` climbs to."""

LIBRARY: dict[str, Callable[[], Trajectory]] = {
    "hover": _hover,
    "long_hover": _long_hover,
    "vertical": _vertical,
    "throttle_steps": _throttle_steps,
    "descent": _descent,
    "fast_level": _fast_level,
    "oblique": _oblique,
    "vertical_weave": _vertical_weave,
    "doublets": _doublets,
    "rotation": _rotation,
    "yaw_sweep": _yaw_sweep,
    "yaw_doublets": _yaw_doublets,
    "ground_sweep": _ground_sweep,
    "ceiling_climb": _ceiling_climb,
}
"""Each manoeuvre's name to what makes it."""


def make(name: str) -> Trajectory:
    """A manoeuvre by name; raises `InputError` for an unknown one."""
    if name not in LIBRARY:
        raise InputError(f"there is no manoeuvre {name!r}; there are {', '.join(LIBRARY)}")
    return LIBRARY[name]()


def scaled(trajectory: Trajectory, factor: float) -> Trajectory:
    """The same manoeuvre with positions from its start stretched by `factor`; accelerations stretch with them."""
    coefficients = trajectory.coefficients.copy()
    start = trajectory.position(np.zeros(1))[0]
    coefficients[:, :3] *= factor
    coefficients[:, :3, 0] += (1.0 - factor) * start
    return Trajectory(trajectory.durations_s, coefficients)
