"""How much of the rotors' roll and pitch torque a moment in edgewise flow explains, on kinds of flight held out.

Run by `real_logs.py torque`. The torque of the measured rotor speeds is regressed on inertia times turning (gyroscopic
term included), on thrust times an offset of the centre of mass, and on a moment of the catalogue, and judged on the
kind of flight left out, all within a band. Before that, inertia by frequency: the ratio of torque to turning in each
flight.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline
from scipy.signal import butter, csd, sosfiltfilt

import vehicle
from flight import FlightLog, FloatArray, rotations
from sysid.logs.checks.consistency import GRID_S, kinematics

MOMENTS = {
    "none": {},
    "flapping_moment": {"moment_kg_m": 1e-7},
    "wake_skew_moment": {"roll_kg_m": 1e-7, "pitch_kg_m": 1e-7},
}
BESIDE = (
    "nothing",
    "rotors late",
    "rotor speed filtered, or a frame that flexes",
    "hub drag, n v",
    "unlike rotors",
    "battery",
)
"""What was tried beside a moment; a gyro's scale goes into the inertia, and the axes have coefficients of their own."""
BANDS_HZ = {"0.3-20 Hz": (0.3, 20.0), "3-20 Hz": (3.0, 20.0)}
TAKE_OFF_S, TOUCHDOWN_S = 1.5, 2.5
"""Left out at the ends, where the ground pushes as well."""
NARROW_HZ = (3.0, 4.5, 6.5, 9.0, 12.0, 16.0, 20.0)
"""Edges of the bands that inertia is listed by."""
WINDOW = 256
"""Samples of each spectrum: 2.56 s."""


@dataclass(frozen=True, slots=True)
class Motion:
    """One flight on the grid of the log's checks."""

    kind: str
    velocity_body_m_s: FloatArray
    rate_rad_s: FloatArray
    turning_rad_s2: FloatArray
    rotor_speed_rad_s: FloatArray
    thrust_n: FloatArray
    """(n,) of all rotors, by the vehicle file's coefficient."""
    torque_n_m: FloatArray
    """(n, 3) of the rotors, likewise."""
    battery_v: FloatArray
    """(n,)"""
    known: NDArray[np.bool_]
    """(n,) whether the position was there: around its jumps it is not."""


def flown(log: FlightLog) -> FlightLog:
    """The log without take-off and touchdown."""
    return log.slice(log.time_s[0] + TAKE_OFF_S, log.time_s[-1] - TOUCHDOWN_S)


def run(logs: Mapping[str, FlightLog], model: vehicle.Vehicle) -> None:
    """A table for each band: share of the torque's variance explained on each kind, learnt from the other kinds."""
    motions = [_motion(name.split("_")[0].rstrip("1"), flown(log), model) for name, log in logs.items()]
    kinds = sorted({m.kind for m in motions})
    _by_frequency(dict(zip(logs, motions, strict=True)))
    for title, band in BANDS_HZ.items():
        print(f"\n| {title}: share explained, held out | " + " | ".join(kinds) + " | inertia, 1e-5 kg m2 |")
        print("| --- |" + " --- |" * (len(kinds) + 1))
        for moment, values in MOMENTS.items():
            for axis, axis_name in enumerate(("roll", "pitch")):
                columns = [_banded(_columns(m, axis, moment, values, model), band)[m.known] for m in motions]
                torque = [_banded(m.torque_n_m[:, axis], band)[m.known] for m in motions]
                found = [_held_out(columns, torque, [m.kind == kind for m in motions]) for kind in kinds]
                inertia = " to ".join(f"{1e5 * f([size for _, size in found]):.2f}" for f in (min, max))
                print(f"| {moment}, {axis_name} | " + " | ".join(f"{s:.2f}" for s, _ in found) + f" | {inertia} |")
    _beside(motions, kinds, model)


def _beside(motions: list[Motion], kinds: list[str], model: vehicle.Vehicle) -> None:
    """What else could be wrong with the torque, beside no moment and beside the wakes': shares on kinds held out."""
    (band,) = (band for title, band in BANDS_HZ.items() if title.startswith("0.3"))
    print("\n| beside | " + " | ".join(f"{kind}, roll / pitch" for kind in kinds) + " |")
    print("| --- |" + " --- |" * len(kinds))
    for moment in ("none", "wake_skew_moment"):
        for other in BESIDE:
            shares = []
            for axis in (0, 1):
                columns = [
                    _banded(
                        np.hstack([_columns(m, axis, moment, MOMENTS[moment], model), _other(m, axis, other, model)]),
                        band,
                    )
                    for m in motions
                ]
                columns = [c[m.known] for c, m in zip(columns, motions, strict=True)]
                torque = [_banded(m.torque_n_m[:, axis], band)[m.known] for m in motions]
                shares.append([_held_out(columns, torque, [m.kind == kind for m in motions])[0] for kind in kinds])
            cells = " | ".join(f"{roll:.2f} / {pitch:.2f}" for roll, pitch in zip(*shares, strict=True))
            print(f"| {moment}, {other} | {cells} |")


def _other(m: Motion, axis: int, other: str, model: vehicle.Vehicle) -> FloatArray:
    """(n, c) torque by what else was tried; a short delay or filter acts through the torque's derivatives."""
    torque = m.torque_n_m[:, axis]
    slope = np.gradient(torque, GRID_S)
    if other == "rotors late":
        return slope[:, None]
    if other == "rotor speed filtered, or a frame that flexes":
        return np.stack([slope, np.gradient(slope, GRID_S)], axis=1)
    if other == "hub drag, n v":
        return (m.rotor_speed_rad_s.sum(axis=1) * m.velocity_body_m_s[:, 1 - axis])[:, None]
    if other == "unlike rotors":
        return np.diff(m.rotor_speed_rad_s**2 * model.hub_body_m[:, 1 - axis], axis=1)  # their mean is given
    if other == "battery":
        return (torque * (m.battery_v - m.battery_v.mean()))[:, None]
    return np.empty((len(torque), 0))


def _by_frequency(motions: Mapping[str, Motion]) -> None:
    """Inertia by torque regressed on turning and by turning regressed on torque; the truth lies between the two."""
    bands = list(pairwise(NARROW_HZ))
    print("\n| inertia, 1e-5 kg m2 | " + " | ".join(f"{low:g}-{high:g} Hz" for low, high in bands) + " |")
    print("| --- " * (len(bands) + 1) + "|")
    for name, m in motions.items():
        for axis, axis_name in enumerate(("roll", "pitch")):
            hz, both = csd(m.turning_rad_s2[:, axis], m.torque_n_m[:, axis], 1.0 / GRID_S, nperseg=WINDOW)
            own = [
                csd(v[:, axis], v[:, axis], 1.0 / GRID_S, nperseg=WINDOW)[1] for v in (m.turning_rad_s2, m.torque_n_m)
            ]
            cells = []
            for low, high in bands:
                inside = (hz >= low) & (hz < high)
                turning, torque, cross = (values[inside].sum() for values in (*own, both))
                below, above = 1e5 * cross.real / turning.real, 1e5 * torque.real / cross.real
                cells.append(f"{below:.2f}-{above:.2f}, {np.degrees(np.angle(cross)):+.0f} deg")
            print(f"| {name}, {axis_name} | " + " | ".join(cells) + " |")


def _motion(kind: str, log: FlightLog, model: vehicle.Vehicle) -> Motion:
    motion = kinematics(log)
    assert motion is not None
    speed, rate = (
        np.stack([np.interp(motion.time_s, log.time_s, column) for column in log.vector(quantity).T], axis=1)
        for quantity in ("rotor_speed_rad_s", "rate_body_rad_s")
    )
    still = np.zeros_like(rate)
    force_n, torque_n_m = vehicle.wrench(model, still, still, speed)
    return Motion(
        kind,
        rotations.rotate(rotations.conjugate(motion.q), motion.velocity_world_m_s),
        rate,
        CubicSpline(motion.time_s, rate)(motion.time_s, 1),  # central differences lose 25 % at 20 Hz
        speed,
        force_n[:, 2],
        torque_n_m,
        np.interp(motion.time_s, log.time_s, log.columns["battery_v"]),
        np.interp(motion.time_s, log.time_s, np.isfinite(log.vector("position_world_m")).all(axis=1)) > 0.99,
    )


def _columns(m: Motion, axis: int, moment: str, values: Mapping[str, float], model: vehicle.Vehicle) -> FloatArray:
    """(n, 3 or 4): turning, its gyroscopic term, thrust (on the arm of the centre of mass), and the moment's torque."""
    gyroscopic = m.rate_rad_s[:, 1 - axis] * m.rate_rad_s[:, 2]
    columns = [m.turning_rad_s2[:, axis], gyroscopic, m.thrust_n]
    if moment != "none":
        motion = m.velocity_body_m_s, m.rate_rad_s, m.rotor_speed_rad_s
        with_it = vehicle.wrench(model.with_effect(moment, **values), *motion)[1]
        columns.append((with_it - vehicle.wrench(model, *motion)[1])[:, axis])
    return np.stack(columns, axis=1)


def _banded(values: FloatArray, band: tuple[float, float]) -> FloatArray:
    return np.asarray(sosfiltfilt(butter(3, band, "band", fs=1.0 / GRID_S, output="sos"), values, axis=0))


def _held_out(columns: list[FloatArray], torque: list[FloatArray], left_out: list[bool]) -> tuple[float, float]:
    """Share explained on the flights left out, and the inertia, by least squares over the others."""

    def joined(parts: list[FloatArray], wanted: bool) -> FloatArray:
        return np.concatenate([part for part, out in zip(parts, left_out, strict=True) if out == wanted])

    x, y = joined(columns, False), joined(torque, False)
    scale = np.abs(x).max(axis=0)
    size = np.linalg.lstsq(x / scale, y, rcond=None)[0] / scale
    rest = joined(torque, True) - joined(columns, True) @ size
    return 1.0 - float((rest**2).sum() / (joined(torque, True) ** 2).sum()), float(size[0])
