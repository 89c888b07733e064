"""Which column of rotor speed is which rotor, and which way does each turn? From the torque that each column makes.

Roll and pitch come from thrust times arm; yaw from the rotors' drag torque and from the reaction to their acceleration
(k: thrust coefficient; x_i, y_i: hub; k_m: torque coefficient; s_i: spin; J: a rotor's moment of inertia):

    I_xx dw_x/dt =  sum k y_i n_i^2
    I_yy dw_y/dt = -sum k x_i n_i^2
    I_zz dw_z/dt = -sum s_i (k_m n_i^2 + J dn_i/dt)

Angular acceleration is regressed on the squares of all four columns, in a band in which rotors cause the turning and do
not respond to it. Each order, and each balanced set of spins, predicts the pattern of the gains. Scales (inertias,
coefficients) are free but positive, so that place and sign alone decide. A decision needs 5 standard errors; otherwise
it is inconclusive.
"""

from dataclasses import dataclass
from itertools import permutations, product
from typing import TypeVar

import numpy as np

from flight import FlightLog
from flight.flight_log import COLUMNS
from flight.rotations import FloatArray
from sysid.logs.finding import Finding, Repair, error
from sysid.logs.streams import LONGEST_S
from vehicle import Vehicle

GRID_S = 0.01
WINDOW_S = 2.0
"""Length of the windows (Hann, half overlapping) of which spectra are taken."""
BAND_HZ = (2.0, 15.0)
"""Slower, the controller responds to disturbances with the rotors, which reverses cause and effect; faster is noise."""
LONGEST_DELAY_S = 0.15
DELAY_STEP_S = 0.003
NEARLY_BEST = 0.8
"""Delays with this share of what the best one explains must decide alike: an oscillation fits half a period later, too,
but with the opposite sign."""
LARGEST_GAP_S = 0.05
"""A window with a longer gap between samples is left out."""
LEAST_WINDOWS = 6
CERTAIN = 25.0
"""Difference of chi square (5 standard errors) that decides between two hypotheses."""
AS_GIVEN = (0, 1, 2, 3)

Hypothesis = TypeVar("Hypothesis")


@dataclass(frozen=True, slots=True)
class Rotors:
    """What a log shows of order and spin."""

    order: tuple[int, ...] | None
    """Which column is rotor 0, 1, 2, 3 of the vehicle file; None: inconclusive."""
    spin: tuple[int, ...] | None
    """+1 or -1 for each rotor of the file, in the file's sense; None: inconclusive, or the order is."""
    explained: FloatArray
    """(3,) share of roll, pitch and yaw acceleration within `BAND_HZ` that the four columns explain."""


@dataclass(frozen=True, slots=True)
class Gains:
    """Linear effect of some regressors on one axis."""

    value: FloatArray
    """(m,)"""
    information: FloatArray
    """(m, m) inverse of their covariance; errors correlated within a window are allowed for."""
    explained: float

    def misfit(self, pattern: FloatArray) -> float:
        """Chi square of gains that are a sum of the pattern's columns, (m, s), each with a positive factor."""
        from scipy.optimize import nnls

        root = np.linalg.cholesky(self.information).T
        return float(nnls(root @ pattern, root @ self.value)[1] ** 2)


def check(log: FlightLog, rate: tuple[FloatArray, FloatArray], vehicle: Vehicle) -> tuple[list[Finding], list[str]]:
    """Findings about order and spin, and what is inconclusive, in sentences.

    Args:
        log: with rotor speed.
        rate: time stamps (n,) and body rates (n, 3).
    """
    found = examine(log, rate, vehicle)
    roll, pitch, yaw = (f"{share:.0%}" for share in found.explained)
    if found.order is None:
        shares = f"rotor speeds explain {roll} of roll and {pitch} of pitch acceleration"
        return [], [f"rotor order and spins: {shares}; fly doublets about roll, pitch and yaw to decide"]
    if found.order != AS_GIVEN:
        columns = list(found.order)
        sentence = (
            f"roll and pitch do not follow the rotors in this order; in order {columns} rotor speeds explain {roll} of "
            f"roll and {pitch} of pitch acceleration"
        )
        repair = Repair("rotor order", COLUMNS["rotor_speed_rad_s"], order=found.order)
        fix = f"take columns {columns} of rotor_speed as rotors 0 to 3"
        return [error("rotor order", sentence, fix, repair=repair)], []
    if found.spin is None:
        return [], [f"spins: rotor speeds explain {yaw} of yaw acceleration; fly yaw doublets to decide"]
    wrong = [i for i in range(4) if found.spin[i] != int(np.sign(vehicle.spin[i]))]
    if not wrong:
        return [], []
    which = "all spins are" if len(wrong) == 4 else f"the spins of rotors {wrong} are"
    sentence = f"yaw turns against the rotors' torque: {which} the other way (they explain {yaw} of yaw acceleration)"
    which = "every spin" if len(wrong) == 4 else f"the spins of rotors {wrong}"
    return [error("rotor spin", sentence, f"turn the sign of {which} in the vehicle file")], []


def examine(log: FlightLog, rate: tuple[FloatArray, FloatArray], vehicle: Vehicle) -> Rotors:
    """Order and spin of the rotors of a log, as far as the flight shows them."""
    spectra = _spectra(log, rate)
    if spectra is None:
        return Rotors(None, None, np.zeros(3))
    hz, squared, turning = spectra
    delays = np.arange(-LONGEST_DELAY_S, LONGEST_DELAY_S + 1e-9, DELAY_STEP_S)
    advanced = [squared * np.exp(2j * np.pi * hz * delay_s)[:, None] for delay_s in delays]
    fits = [tuple(_gains(columns, turning[..., axis]) for axis in range(2)) for columns in advanced]
    shares = np.array([roll.explained + pitch.explained for roll, pitch in fits])
    best = int(shares.argmax())
    orders = {_order(*fits[i], vehicle) for i in np.flatnonzero(shares > NEARLY_BEST * shares[best])} - {None}
    squared, (roll, pitch) = advanced[best], fits[best]
    change = squared * (2j * np.pi * hz)[:, None]
    yaw = _gains(np.concatenate([squared, change], axis=2), turning[..., 2])
    explained = np.array([roll.explained, pitch.explained, yaw.explained])
    order = _order(roll, pitch, vehicle)
    if order is None or orders != {order}:
        return Rotors(None, None, explained)
    return Rotors(order, _spin(yaw, order, vehicle), explained)


def _order(roll: Gains, pitch: Gains, vehicle: Vehicle) -> tuple[int, ...] | None:
    def misfit(order: tuple[int, ...]) -> float:
        place = np.argsort(order)  # rotor of each column
        arms = ((roll, vehicle.hub_body_m[:, 1]), (pitch, -vehicle.hub_body_m[:, 0]))
        return sum(gains.misfit(arm[place][:, None]) for gains, arm in arms)

    return _decided({order: misfit(order) for order in permutations(range(4))}, freedom=6)


def _spin(yaw: Gains, order: tuple[int, ...], vehicle: Vehicle) -> tuple[int, ...] | None:
    place, nothing = np.argsort(order), np.zeros(4)

    def misfit(spin: tuple[int, ...]) -> float:
        sense = -np.array(spin, dtype=np.float64)[place]
        return yaw.misfit(np.stack([np.r_[sense, nothing], np.r_[nothing, sense]], axis=1))

    balanced = {spin for spin in product((-1, 1), repeat=4) if sum(spin) == 0}  # or the vehicle would not hold its yaw
    given = tuple(int(sense) for sense in np.sign(vehicle.spin))
    return _decided({spin: misfit(spin) for spin in balanced | {given}}, freedom=6)


def _decided(misfit: dict[Hypothesis, float], freedom: int) -> Hypothesis | None:
    """The hypothesis that fits better than all others by `CERTAIN`, errors being enlarged until it fits; or None."""
    best, second = sorted(misfit, key=lambda one: misfit[one])[:2]
    return best if misfit[second] - misfit[best] > CERTAIN * max(1.0, misfit[best] / freedom) else None


def _spectra(log: FlightLog, rate: tuple[FloatArray, FloatArray]) -> tuple[FloatArray, FloatArray, FloatArray] | None:
    """Frequencies (f,), spectra of squared rotor speed (w, f, 4) and angular acceleration (w, f, 3).

    None where fewer than `LEAST_WINDOWS` windows are without gaps, or the time is in another unit.
    """
    streams = []
    for time_s, values in ((log.time_s, log.vector("rotor_speed_rad_s")), rate):
        known = np.isfinite(values).all(axis=1)
        streams.append((time_s[known], values[known]))
    first_s = max(float(time_s[0]) for time_s, _ in streams)
    last_s = min(float(time_s[-1]) for time_s, _ in streams)
    if not 0.0 < last_s - first_s < LONGEST_S:
        return None
    length = round(WINDOW_S / GRID_S)
    grid_s = np.arange(first_s, last_s, GRID_S)
    starts = np.arange(0, len(grid_s) - length + 1, length // 2)
    starts = [s for s in starts if not any(_gap(time_s, grid_s[s], WINDOW_S) for time_s, _ in streams)]
    if len(starts) < LEAST_WINDOWS:
        return None
    hz = np.fft.rfftfreq(length, GRID_S)
    band = (hz > BAND_HZ[0]) & (hz < BAND_HZ[1])
    taken = []
    for (time_s, values), power in zip(streams, (2, 1), strict=True):
        even = np.stack([np.interp(grid_s, time_s, column) for column in values.T], axis=1) ** power
        windows = np.stack([even[s : s + length] for s in starts])
        windows = (windows - windows.mean(axis=1, keepdims=True)) * np.hanning(length)[:, None]
        taken.append(np.fft.rfft(windows, axis=1)[:, band])
    return hz[band], taken[0], taken[1] * (2j * np.pi * hz[band])[:, None]


def _gap(time_s: FloatArray, start_s: float, length_s: float) -> bool:
    first, end = np.searchsorted(time_s, [start_s, start_s + length_s])
    inside = time_s[first:end]
    return len(inside) < 2 or float(np.diff(np.r_[start_s, inside, start_s + length_s]).max()) > LARGEST_GAP_S


def _gains(regressors: FloatArray, acceleration: FloatArray) -> Gains:
    """Real gains by least squares over all windows and frequencies.

    Args:
        regressors: (w, f, m) spectra.
        acceleration: (w, f) spectra.
    """
    normal = np.einsum("wfi,wfj->ij", regressors.conj(), regressors).real
    value = np.linalg.solve(normal, np.einsum("wfi,wf->i", regressors.conj(), acceleration).real)
    left = acceleration - regressors @ value
    pulls = np.einsum("wfi,wf->wi", regressors.conj(), left).real
    squares = float((np.abs(left) ** 2).sum())
    variance = squares / max(2 * left.size - len(value), 1)
    scatter = float(np.trace(np.linalg.solve(normal, pulls.T @ pulls))) / (len(value) * variance)
    share = 1.0 - squares / float((np.abs(acceleration) ** 2).sum())
    return Gains(value, normal / (variance * max(1.0, scatter)), share)
