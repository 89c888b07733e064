"""Which column of rotor speed or of motor commands is which rotor, and which way does each turn? By its torque.

Roll and pitch come from thrust times arm; yaw from the rotors' drag torque and from the reaction to their acceleration
(k: thrust coefficient; x_i, y_i: hub; k_m: torque coefficient; s_i: spin; J: a rotor's moment of inertia):

    I_xx dw_x/dt =  sum k y_i n_i^2
    I_yy dw_y/dt = -sum k x_i n_i^2
    I_zz dw_z/dt = -sum s_i (k_m n_i^2 + J dn_i/dt) + (I_xx - I_yy) w_x w_y

The last term (Euler's equations), large in loops and rolls, is fitted along: rotors that counteract it would show yaw
with the opposite sign.

Angular acceleration is regressed on the squares of all columns, in a band in which rotors cause the turning and do
not respond to it; where noise leaves nothing there, with the slower motion, if the rotors explain most of it.
Each order, and each balanced set of spins, predicts the pattern of the gains. Scales (inertias, coefficients) are free
but positive, so that place and sign alone decide. A decision needs 5 standard errors; otherwise it is inconclusive.
"""

from dataclasses import dataclass, replace
from itertools import permutations, product
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from flight import FlightLog
from flight.flight_log import COLUMNS
from flight.rotations import FloatArray
from sysid.logs.checks.finding import Finding, error
from sysid.logs.checks.motion import GRID_S, LEAST_SAMPLES, LONGEST_S
from sysid.logs.events.repair import Repair
from sysid.logs.motors import rotor_places
from sysid.logs.motors.full_throttle import COMMAND, ratios
from vehicle import Vehicle

WINDOW_S = 2.0
"""Length of the windows (Hann, half overlapping) of which spectra are taken."""
BAND_HZ = (2.0, 15.0)
"""Slower, the controller responds to disturbances with the rotors, which reverses cause and effect; faster is noise."""
SLOW_BAND_HZ, CLEAR = (0.4, 15.0), 0.8
"""Tried where the other does not decide: the rotors are believed there only if they explain this share of roll and of
pitch acceleration (for spins, of yaw), which rotors that answer disturbances do not."""
LONGEST_DELAY_S, DELAY_STEP_S = 0.5, 0.004
"""Rotor speed may be this much late or early."""
YAW_EVERY = 3
"""Of these delays, those tried for yaw alone: rotor acceleration, which is fitted along, makes up for the rest."""
COARSE_S = 0.1
"""Delays are shifts of the windows by multiples of this, and a phase for the rest."""
SEARCH_WINDOWS = 60
"""Windows on which delays are compared."""
LEAST_POWER = 1e-6
"""Of the combination of columns that moves least, to that which moves most."""
WAYS, LEAST_OWN = 4, 0.02
"""A mixer drives rotors in so many ways; these move by themselves if a fifth has this share of the third's power."""
NEARLY_BEST = 0.9
"""Delays with this share of what the best one explains must decide alike: an oscillation fits half a period later, too,
but with the opposite sign."""
LARGEST_GAP_S = 0.05
"""A window with a longer gap between samples is left out."""
LEAST_WINDOWS = 6
CERTAIN = 25.0
"""Difference of chi square (5 standard errors) that decides between two hypotheses."""
LEAST_EXPLAINED = 0.1
"""Of yaw acceleration, by which yaw alone decides: rotors that answer gusts explain up to a twentieth with any sign."""
LEAST_COMMANDED = 0.3
"""Of roll and pitch acceleration each, by which commands decide. They are no witness of the spins: a controller that
holds the heading turns their effect round (a real flight, with 34 % of yaw explained)."""
LEAST_TURN_RAD = np.deg2rad(15.0)
"""Hubs whose places are turned alike to within this are turned as a whole."""
LEAST_LEAD_S = 0.008
"""By which commands come before the turning that they cause. A controller that answers gusts comes after, and turns
the vehicle the other way."""
MEASURED = COLUMNS["rotor_speed_rad_s"]

Hypothesis = TypeVar("Hypothesis")
ComplexArray = NDArray[np.complex128]


@dataclass(frozen=True, slots=True)
class Rotors:
    """What a log shows of order and spin."""

    order: tuple[int, ...] | None
    """Which column is rotor 0, 1, ... of the vehicle file; None: inconclusive."""
    spin: tuple[int, ...] | None
    """+1 or -1 for each rotor of the file, in the file's sense; None: inconclusive. Where the order is, of each column
    as if it were the rotor of that number."""
    explained: FloatArray
    """(3,) share of roll, pitch and yaw acceleration within the band that the columns explain."""
    delay_s: float = 0.0
    """By how much the columns come later than the turning, where the order is known."""
    columns: tuple[str, ...] = MEASURED
    """Which columns."""


@dataclass(frozen=True, slots=True, eq=False)
class Spectra:
    """Windows of a flight within a band."""

    hz: FloatArray
    """(f,)"""
    squared: dict[int, ComplexArray]
    """(w, f, r), of squared rotor speed in windows that begin so many times `COARSE_S` later."""
    turning: ComplexArray
    """(w, f, 3), of angular acceleration."""
    coupling: ComplexArray
    """(w, f), of w_x w_y."""

    def advanced(self, delay_s: float) -> ComplexArray:
        """(w, f, r) of squared rotor speed, which is this much later than the turning."""
        coarse = round(delay_s / COARSE_S)
        rest_s = delay_s - coarse * COARSE_S
        return self.squared[coarse] * np.exp(2j * np.pi * self.hz * rest_s)[:, None]


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

    def misfits(self, patterns: FloatArray) -> FloatArray:
        """(p,) the same of many patterns (p, m) of one column each."""
        informed = self.information @ self.value
        size = np.einsum("pi,ij,pj->p", patterns, self.information, patterns)
        along = np.maximum(patterns @ informed, 0.0)
        return float(self.value @ informed) - along**2 / np.maximum(size, np.finfo(float).tiny)


def drivers(log: FlightLog) -> list[tuple[str, ...]]:
    """The columns of what turns the rotors: measured speed, then commands.

    Commands show the order, too: the rotors' lag is taken for a delay.
    """
    found = []
    for names in (log.names("rotor_speed_rad_s"), log.names(COMMAND), ratios(log)):
        if all(name in log.columns for name in names):
            known = np.isfinite(np.stack([log.columns[name] for name in names])).all(axis=0)
            found += [names] if known.sum() >= LEAST_SAMPLES else []
    return found


def check(
    log: FlightLog, rate: tuple[FloatArray, FloatArray], vehicle: Vehicle, *, gyro: bool = True
) -> tuple[list[Finding], list[str]]:
    """Findings about order and spin, and what is inconclusive, in sentences.

    Args:
        log: with one of `drivers` at least.
        rate: time stamps (n,) and body rates (n, 3).
        gyro: whether the log has one; without, an attitude with turned body axes looks like another order.
    """
    if vehicle.axis_body is not None:
        return [], ["rotor order and spins: not judged, as the file's rotors are tilted"]
    found = examine(log, rate, vehicle)
    roll, pitch, yaw = (f"{share:.0%}" for share in found.explained)
    what = "rotor speeds" if _measured(found.columns) else "motor commands"
    wrong = (
        []
        if found.spin is None
        else [i for i in range(vehicle.rotors) if found.spin[i] != int(np.sign(vehicle.spin[i]))]
    )
    if found.order is None and (place := _by_place(log, vehicle, found, what)) is not None:
        return [place], []
    if found.order is None and wrong:
        sentence = (
            f"yaw turns against the rotors' torque (they explain {yaw} of yaw acceleration): {_spins(wrong, vehicle)} "
            "the other way, or the rotors are in another order"
        )
        fix = (
            f"turn the sign of {_which(wrong, vehicle)} in the vehicle file, or take the columns of {what} in its order"
        )
        return [error("rotor spin", sentence, f"{fix}; roll and pitch do not show which: fly doublets about them")], []
    if found.order is None and _mixed(log, rate, found):
        several = f"rotor order and spins: {vehicle.rotors} rotors that one mixer drives do not show their order"
        return [], [f"{several}, however they are flown; run them up one by one to see it"]
    if found.order is None:
        shares = f"{what} explain {roll} of roll and {pitch} of pitch acceleration"
        why = shares if found.explained.any() else "there is no motion, or less than 8 s of it without gaps"
        return [], [f"rotor order and spins: {why}; fly doublets about roll, pitch and yaw to decide"]
    if found.order != _as_given(vehicle):
        order = list(found.order)
        sentence = (
            f"roll and pitch do not follow the rotors in this order; in order {order} {what} explain {roll} of "
            f"roll and {pitch} of pitch acceleration"
        )
        repair = Repair("rotor order", found.columns, order=found.order)
        fix = f"take columns {order} of {what} as rotors 0 to {len(order) - 1}"
        if not gyro and _may_be_turned(found, vehicle):
            return [error("rotor order", sentence, f"{fix}, or turn the attitude's body axes about z: see which")], []
        return [error("rotor order", sentence, fix, repair=repair)], []
    if found.spin is None and vehicle.rotors % 2:
        return [], [f"spins: not judged, as those of {vehicle.rotors} rotors never balance"]
    if found.spin is None and not _measured(found.columns):
        return [], ["spins: motor commands do not show them; record rotor speed, or look at the vehicle"]
    if found.spin is None:
        return [], [f"spins: {what} explain {yaw} of yaw acceleration; fly yaw doublets to decide"]
    if not wrong:
        return [], []
    sentence = (
        f"yaw turns against the rotors' torque: {_spins(wrong, vehicle)} the other way (they explain {yaw} of yaw "
        "acceleration)"
    )
    return [
        error(
            "rotor spin",
            sentence,
            f"turn the sign of {_which(wrong, vehicle)} in the vehicle file{_option(wrong, vehicle)}",
        )
    ], []


def _by_place(log: FlightLog, vehicle: Vehicle, found: Rotors, what: str) -> Finding | None:
    """What the places of the firmware's motors say of an order that the flight does not show."""
    order = rotor_places.order(log, vehicle)
    if order is None or order == _as_given(vehicle):
        return None
    if found.spin is not None and any(found.spin[k] != np.sign(vehicle.spin[i]) for i, k in enumerate(order)):
        return None  # yaw contradicts it
    sentence = (
        f"by its firmware the log's motors are {', '.join(log.metadata[rotor_places.KEY])}, not "
        f"{', '.join(rotor_places.of_vehicle(vehicle))} as in the vehicle file; the flight does not decide"
    )
    repair = Repair("rotor order", found.columns, order=order)
    return error(
        "rotor order", sentence, f"take columns {list(order)} of {what} as rotors 0 to {len(order) - 1}", repair=repair
    )


def _mixed(log: FlightLog, rate: tuple[FloatArray, FloatArray], found: Rotors) -> bool:
    """Whether more than four rotors move in the four ways of a mixer alone, so that flying more would not help.

    By the rank of their squares, beside the third of roll, pitch, yaw and thrust, which may be constant; or as clear
    motion left the order open.
    """
    if len(found.columns) <= WAYS:
        return False
    if found.explained[:2].min() > CLEAR:
        return True
    spectra = _spectra(log, found.columns, rate, BAND_HZ)
    if spectra is None or not _turns(spectra):
        return False
    powers = _powers(spectra)[::-1]
    return bool(powers[WAYS] < LEAST_OWN * powers[WAYS - 2])


def _as_given(vehicle: Vehicle) -> tuple[int, ...]:
    return tuple(range(vehicle.rotors))


def _measured(columns: tuple[str, ...]) -> bool:
    return columns[0] == MEASURED[0]


def _spins(wrong: list[int], vehicle: Vehicle) -> str:
    return "all spins are" if len(wrong) == vehicle.rotors else f"the spins of rotors {wrong} are"


def _option(wrong: list[int], vehicle: Vehicle) -> str:
    """What does the same from the start, if anything."""
    if len(wrong) < vehicle.rotors:
        return ""
    return " (`goshawk vehicle new` writes them so with --props-out, or without it if the file was made with it)"


def _which(wrong: list[int], vehicle: Vehicle) -> str:
    return "every spin" if len(wrong) == vehicle.rotors else f"the spins of rotors {wrong}"


def _may_be_turned(found: Rotors, vehicle: Vehicle) -> bool:
    """Whether columns in the order of the file, beside an attitude turned about body z, would look the same.

    They would if the order turns the hubs as a whole; unless the spins, which turn along, decide for the order.
    """
    assert found.order is not None
    order = list(found.order)
    hubs = vehicle.hub_body_m[:, 0] + 1j * vehicle.hub_body_m[:, 1]
    arm = np.abs(hubs)
    turned = np.angle(hubs[order] * hubs.conj())
    about = np.angle(np.exp(1j * (turned - turned[0])))
    whole = bool((np.abs(about) < LEAST_TURN_RAD).all() and np.allclose(arm[order], arm, rtol=0.1))
    given = np.sign(vehicle.spin).astype(int)
    decided = found.spin == tuple(given.tolist()) and (given[order] != given).any()
    return whole and not decided


def examine(log: FlightLog, rate: tuple[FloatArray, FloatArray], vehicle: Vehicle) -> Rotors:
    """Order and spin of the rotors of a log, as far as the flight shows them: nothing where they are tilted."""
    if vehicle.axis_body is not None:
        return Rotors(None, None, np.zeros(3), columns=next(iter(drivers(log)), MEASURED))
    for columns in drivers(log):  # rotor speed may be too slow where commands are not
        spectra = _spectra(log, columns, rate, BAND_HZ)
        if spectra is None:
            continue
        if _measured(columns):
            return replace(_by_speeds(log, rate, _examined(spectra, vehicle), vehicle), columns=columns)
        found = _examined(spectra, vehicle)
        sure = found.explained[:2].min() > LEAST_COMMANDED and found.delay_s <= -LEAST_LEAD_S
        return replace(found, order=found.order if sure else None, spin=None, columns=columns)
    return Rotors(None, None, np.zeros(3), columns=next(iter(drivers(log)), MEASURED))


def _by_speeds(log: FlightLog, rate: tuple[FloatArray, FloatArray], found: Rotors, vehicle: Vehicle) -> Rotors:
    """What was found, or what the slower motion shows where that is clearer."""
    if found.order is not None and found.spin is not None:
        return found
    slow = _examined(_spectra(log, log.names("rotor_speed_rad_s"), rate, SLOW_BAND_HZ), vehicle)
    if slow.order is not None and slow.explained[:2].min() > CLEAR:
        return slow if slow.explained[2] > CLEAR else replace(slow, spin=found.spin if found.order else None)
    return found


def _examined(spectra: Spectra | None, vehicle: Vehicle) -> Rotors:
    if spectra is None or not _excited(spectra):
        return Rotors(None, None, np.zeros(3))
    fits = {delay_s: _roll_and_pitch(spectra, delay_s, SEARCH_WINDOWS) for delay_s in _delays_s()}
    share = {delay_s: roll.explained + pitch.explained for delay_s, (roll, pitch) in fits.items()}
    best = max(share, key=lambda delay_s: share[delay_s])
    orders = {_order(*fits[d], vehicle) for d in fits if share[d] > NEARLY_BEST * share[best]} - {None}
    roll, pitch = _roll_and_pitch(spectra, best)
    yaw = _yaw(spectra, best)
    explained = np.array([roll.explained, pitch.explained, yaw.explained])
    order = _order(roll, pitch, vehicle)
    if order is None or orders != {order}:
        by_yaw = _by_yaw_alone(spectra, vehicle)
        return by_yaw if by_yaw.spin is not None else Rotors(None, None, explained)
    spin = _spin(yaw, order, vehicle)
    hubs = vehicle.hub_body_m[:, :2]
    if spin is None and np.allclose(hubs[list(order)], -hubs):
        return Rotors(None, None, explained)  # could be a clock that is off by more than `LONGEST_DELAY_S`
    return Rotors(order, spin, explained, best)


def _by_yaw_alone(spectra: Spectra, vehicle: Vehicle) -> Rotors:
    """The spins if the columns are in the file's order, which roll and pitch do not show."""
    yaw = {delay_s: _yaw(spectra, delay_s, SEARCH_WINDOWS) for delay_s in _delays_s()[::YAW_EVERY]}
    best = max(yaw, key=lambda delay_s: yaw[delay_s].explained)
    near = [one for one in yaw.values() if one.explained > NEARLY_BEST * yaw[best].explained]
    whole = _yaw(spectra, best)
    spin = _spin(whole, _as_given(vehicle), vehicle)
    explained = np.array([one.explained for one in (*_roll_and_pitch(spectra, best), whole)])
    sure = {_spin(one, _as_given(vehicle), vehicle) for one in near} - {None} == {spin}
    return Rotors(None, spin if sure and whole.explained > LEAST_EXPLAINED else None, explained)


def _delays_s() -> FloatArray:
    return np.arange(-LONGEST_DELAY_S, LONGEST_DELAY_S + 1e-9, DELAY_STEP_S)


def _excited(spectra: Spectra) -> bool:
    """Whether all columns move, each in its own way, and the body turns."""
    powers = _powers(spectra)
    return bool(powers[0] > LEAST_POWER * powers[-1]) and _turns(spectra)


def _powers(spectra: Spectra) -> FloatArray:
    """(r,) of the combinations of columns, from that which moves least to that which moves most."""
    squared = spectra.advanced(0.0)
    return np.asarray(np.linalg.eigvalsh(np.einsum("wfi,wfj->ij", squared.conj(), squared).real), dtype=np.float64)


def _turns(spectra: Spectra) -> bool:
    return bool((np.abs(spectra.turning).sum(axis=(0, 1)) > 0.0).all())


def _roll_and_pitch(spectra: Spectra, delay_s: float, most_windows: int | None = None) -> tuple[Gains, Gains]:
    every = 1 if most_windows is None else max(len(spectra.turning) // most_windows, 1)
    squared, turning = spectra.advanced(delay_s)[::every], spectra.turning[::every]
    roll, pitch = _gains(squared, turning[..., :2])
    return roll, pitch


def _yaw(spectra: Spectra, delay_s: float, most_windows: int | None = None) -> Gains:
    """Of rotor speed's squares, then of their slopes, on what w_x w_y leaves of the acceleration."""
    every = 1 if most_windows is None else max(len(spectra.turning) // most_windows, 1)
    squared = spectra.advanced(delay_s)[::every]
    change = squared * (2j * np.pi * spectra.hz)[:, None]
    columns = np.concatenate([squared, change, spectra.turning[::every, :, 2:]], axis=2)
    coupling = spectra.coupling[::every]
    power = max(float((np.abs(coupling) ** 2).sum()), np.finfo(float).tiny)
    columns = columns - coupling[..., None] * (np.einsum("wf,wfi->i", coupling.conj(), columns).real / power)
    return _gains(columns[..., :-1], columns[..., -1:])[0]


def _order(roll: Gains, pitch: Gains, vehicle: Vehicle) -> tuple[int, ...] | None:
    orders = list(permutations(_as_given(vehicle)))
    arms = ((roll, vehicle.hub_body_m[:, 1]), (pitch, -vehicle.hub_body_m[:, 0]))
    if vehicle.rotors > 4:
        places = np.argsort(orders, axis=1)
        both = np.sum([gains.misfits(arm[places]) for gains, arm in arms], axis=0)
        return _decided(dict(zip(orders, both.tolist(), strict=True)), freedom=2 * vehicle.rotors - 2)

    def misfit(order: tuple[int, ...]) -> float:
        place = np.argsort(order)  # rotor of each column
        return sum(gains.misfit(arm[place][:, None]) for gains, arm in arms)

    return _decided({order: misfit(order) for order in orders}, freedom=6)


def _spin(yaw: Gains, order: tuple[int, ...], vehicle: Vehicle) -> tuple[int, ...] | None:
    """None where no set is clearly better, and of an odd number of rotors, of which none is balanced."""
    if vehicle.rotors % 2:
        return None
    place, nothing = np.argsort(order), np.zeros(vehicle.rotors)

    def misfit(spin: tuple[int, ...]) -> float:
        sense = -np.array(spin, dtype=np.float64)[place]
        return yaw.misfit(np.stack([np.r_[sense, nothing], np.r_[nothing, sense]], axis=1))

    every = product((-1, 1), repeat=vehicle.rotors)
    balanced = {spin for spin in every if sum(spin) == 0}  # or the vehicle would not hold its yaw
    given = tuple(int(sense) for sense in np.sign(vehicle.spin))
    return _decided({spin: misfit(spin) for spin in balanced | {given}}, freedom=2 * vehicle.rotors - 2)


def _decided(misfit: dict[Hypothesis, float], freedom: int) -> Hypothesis | None:
    """The hypothesis that fits better than all others by `CERTAIN`, errors being enlarged until it fits; or None."""
    best, second = sorted(misfit, key=lambda one: misfit[one])[:2]
    return best if misfit[second] - misfit[best] > CERTAIN * max(1.0, misfit[best] / freedom) else None


def _spectra(
    log: FlightLog, columns: tuple[str, ...], rate: tuple[FloatArray, FloatArray], band_hz: tuple[float, float]
) -> Spectra | None:
    """None where fewer than `LEAST_WINDOWS` windows are without gaps, or the time is in another unit."""
    streams = []
    driven_by = np.stack([log.columns[name] for name in columns], axis=1)
    for time_s, values in ((log.time_s, driven_by), rate):
        known = np.isfinite(values).all(axis=1)
        streams.append((time_s[known], values[known]))
    first_s = max(float(time_s[0]) for time_s, _ in streams)
    last_s = min(float(time_s[-1]) for time_s, _ in streams)
    if not 0.0 < last_s - first_s < LONGEST_S:
        return None
    length, margin, step = (round(part_s / GRID_S) for part_s in (WINDOW_S, LONGEST_DELAY_S, COARSE_S))
    grid_s = np.arange(first_s, last_s, GRID_S)
    around_s = WINDOW_S + 2.0 * LONGEST_DELAY_S
    starts = np.arange(margin, len(grid_s) - length - margin + 1, length // 2)
    starts = [s for s in starts if not any(_gap(time_s, grid_s[s - margin], around_s) for time_s, _ in streams)]
    if len(starts) < LEAST_WINDOWS:
        return None
    hz = np.asarray(np.fft.rfftfreq(length, GRID_S), dtype=np.float64)
    band = (hz > band_hz[0]) & (hz < band_hz[1])
    speed, rate_body = (np.stack([np.interp(grid_s, t, column) for column in x.T], axis=1) for t, x in streams)

    def spectrum(values: FloatArray, later: int) -> ComplexArray:
        windows = np.stack([values[s + later : s + later + length] for s in starts])
        windows = (windows - windows.mean(axis=1, keepdims=True)) * np.hanning(length)[:, None]
        return np.fft.rfft(windows, axis=1)[:, band]

    squared = {later // step: spectrum(speed**2, later) for later in range(-margin, margin + 1, step)}
    turning = spectrum(rate_body, 0) * (2j * np.pi * hz[band])[:, None]
    return Spectra(hz[band], squared, turning, spectrum(rate_body[:, :1] * rate_body[:, 1:2], 0)[..., 0])


def _gap(time_s: FloatArray, start_s: float, length_s: float) -> bool:
    first, end = np.searchsorted(time_s, [start_s, start_s + length_s])
    inside = time_s[first:end]
    return len(inside) < 2 or float(np.diff(np.r_[start_s, inside, start_s + length_s]).max()) > LARGEST_GAP_S


def _gains(regressors: ComplexArray, accelerations: ComplexArray) -> list[Gains]:
    """Real gains by least squares over all windows and frequencies, axis by axis.

    Args:
        regressors: (w, f, m) spectra.
        accelerations: (w, f, c) spectra, of c axes.
    """
    parts, wanted = (np.concatenate([x.real, x.imag], axis=1) for x in (regressors, accelerations))  # (w, 2 f, ...)
    rows = parts.reshape(-1, parts.shape[2])
    normal = rows.T @ rows
    values = np.linalg.solve(normal, rows.T @ wanted.reshape(len(rows), -1))
    left = wanted - parts @ values
    pulls = left.swapaxes(1, 2) @ parts  # (w, c, m)
    found: list[Gains] = []
    for i, value in enumerate(values.T):
        squares = float(np.sum(left[..., i] ** 2))
        variance = squares / max(len(rows) - len(value), 1)
        own = pulls[:, i]
        scatter = float(np.trace(np.linalg.solve(normal, own.T @ own))) / (len(value) * variance)
        share = 1.0 - squares / float(np.sum(wanted[..., i] ** 2))
        found.append(Gains(value, normal / (variance * max(1.0, scatter)), share))
    return found
