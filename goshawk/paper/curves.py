"""Curves to fly at the paper's speeds, from rest to rest: a level figure of eight, up and down, all axes at once."""

from collections.abc import Callable

import numpy as np

from flight import FloatArray, Trajectory, polynomial

Curve = Callable[[FloatArray], FloatArray]


def fitted(curve: Curve, durations_s: FloatArray) -> Trajectory:
    """Degree-11 pieces through a smooth curve of time, by Chebyshev least squares: errors far below a millimetre."""
    starts = np.concatenate([[0.0], np.cumsum(durations_s)])
    nodes = np.cos(np.pi * (np.arange(60) + 0.5) / 60)
    pieces = np.zeros((len(durations_s), 4, 12))
    for i, duration in enumerate(durations_s):
        values = curve(starts[i] + duration * (nodes + 1) / 2)
        for axis in range(4):
            centred = np.polynomial.chebyshev.cheb2poly(np.polynomial.chebyshev.chebfit(nodes, values[:, axis], 11))
            pieces[i, axis, : len(centred)] = centred
        pieces[i] = polynomial.seconds_from_centred(pieces[i], np.full(4, duration))
    return Trajectory(durations_s, pieces)


def _smooth_phase(t: FloatArray, rate: float, duration_s: float, rise_s: float) -> FloatArray:
    """Integral of a rate that rises from zero within `rise_s`, stays, and falls to zero at the end."""

    def ramp(u: FloatArray) -> FloatArray:
        return u**4 * (2.5 - 3 * u + u * u)

    rising = rise_s * ramp(np.clip(t / rise_s, 0, 1)) + np.clip(t - rise_s, 0, None)
    falling = np.clip((t - duration_s + rise_s) / rise_s, 0, 1)
    return rate * (rising - rise_s * ramp(falling))


def loop(shape: Callable[[FloatArray], list[FloatArray]], rate: float, turns: float, rise_s: float = 3.0) -> Trajectory:
    """`shape(phase)` gives x, y, z, yaw; the phase runs `turns` times round at `rate` rad/s, from rest to rest."""
    cruise_s = 2 * np.pi * turns / rate - rise_s
    duration_s = cruise_s + 2 * rise_s
    pieces = [np.full(6, rise_s / 6), np.full(round(cruise_s / 0.5), cruise_s / round(cruise_s / 0.5))]

    def curve(t: FloatArray) -> FloatArray:
        phase = _smooth_phase(t, rate, duration_s, rise_s)
        return np.stack([x + 0 * t for x in shape(phase)], axis=-1)

    return fitted(curve, np.concatenate([*pieces, np.full(6, rise_s / 6)]))


def figure_eight(speed_m_s: float = 8.5, size_m: float = 6.0, turns: float = 3) -> Trajectory:
    """Level; fastest in its middle."""
    rate = speed_m_s / (size_m * np.sqrt(2.0))
    return loop(
        lambda a: [size_m * np.sin(a), 0.5 * size_m * np.sin(2 * a), 1.5 + 0 * a, 0 * a], rate, turns, rise_s=3.5
    )


def vertical(speed_m_s: float = 3.1, size_m: float = 1.5, turns: float = 5) -> Trajectory:
    return loop(lambda a: [0 * a, 0 * a, 1.5 + size_m * (1 - np.cos(a)), 0 * a], speed_m_s / size_m, turns)


def general(rate: float = 1.4, turns: float = 4) -> Trajectory:
    """All axes and the heading at once; yaw rates to 5.3 rad/s."""
    return loop(
        lambda a: [3 * np.sin(a), 2 * np.sin(2 * a), 1.5 + 0.8 * (1 - np.cos(a)), 1.9 * np.sin(2 * a)], rate, turns, 3.5
    )
