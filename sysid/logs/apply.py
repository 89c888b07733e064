"""Carry out one repair of a log, and say so."""

import numpy as np

from flight import FlightLog, InputError, frames, rotations
from flight.flight_log import COLUMNS
from flight.rotations import FloatArray
from sysid.logs.checks.finding import turn_in_words
from sysid.logs.events.event import SPLITS, UPRIGHT, splits
from sysid.logs.events.frozen import within
from sysid.logs.events.repair import Repair
from sysid.logs.motors import rotor_places
from sysid.logs.motors.full_throttle import COMMAND, ratios
from sysid.logs.readers.streams import shifted


def apply(log: FlightLog, repair: Repair) -> FlightLog:
    """The log after one repair.

    Raises:
        InputError: the log would hold fewer than two rows.
    """
    columns = dict(log.columns)
    there = [name for name in repair.columns if name in columns]
    match repair.action:
        case "scale":
            columns |= {name: columns[name] * repair.factor for name in there}
        case "drop":
            columns = {name: values for name, values in columns.items() if name not in there}
        case "blank":
            columns |= {name: np.where(within(log.time_s, repair.spans), np.nan, columns[name]) for name in there}
        case "split":
            both = sorted({*splits(log), *repair.spans})
            log = FlightLog(columns, {**log.metadata, SPLITS: [list(span) for span in both]})
            return _one_attitude(log, repair)
        case "rotor order":
            for names in (
                log.names("rotor_speed_rad_s"),
                log.names(COMMAND),
                ratios(log),
            ):  # of the same motors, in one order
                if all(name in columns for name in names):
                    columns |= {names[i]: log.columns[names[k]] for i, k in enumerate(repair.order)}
            log = FlightLog(columns, rotor_places.reordered(log.metadata, repair.order))
        case _:
            for quantity in COLUMNS:
                names = log.names(quantity)
                if log.has(quantity) and set(names) <= set(there):
                    values = _changed(log, quantity, repair)
                    if repair.spans:
                        values = np.where(within(log.time_s, repair.spans)[:, None], values, log.vector(quantity))
                    columns |= dict(zip(names, values.T, strict=True))
    mended = FlightLog(columns, log.metadata)
    return _trimmed(mended, there) if repair.action in ("shift", "drift") else mended


def joined(log: FlightLog) -> FlightLog:
    """The log with its positions going on over each split as they went before it: for what is told by derivatives."""
    if not splits(log) or not log.has("position_world_m"):
        return log
    position = log.vector("position_world_m").copy()
    known = np.flatnonzero(np.isfinite(position).all(axis=1))
    if len(known) < 3:
        return log
    for begin_s, end_s in splits(log):
        k = int(np.searchsorted(log.time_s[known], 0.5 * (begin_s + end_s)))
        if 1 < k < len(known) - 1:
            moved = np.diff(position[known[k - 2 : k + 2]], axis=0) / np.diff(log.time_s[known[k - 2 : k + 2]])[:, None]
            expected = 0.5 * (moved[0] + moved[2]) * (log.time_s[known[k]] - log.time_s[known[k - 1]])
            position[known[k] :] -= position[known[k]] - position[known[k - 1]] - expected
    return FlightLog({**log.columns, **dict(zip(COLUMNS["position_world_m"], position.T, strict=True))}, log.metadata)


def _one_attitude(log: FlightLog, split: Repair) -> FlightLog:
    """The log with the shorter piece turned back by what the attitude jumped.

    About the vertical it is a heading that was reset: the world's axes; about another axis it is taken for what is
    tracked that slipped: the body's.
    """
    turn, (begin_s, end_s) = np.array(split.turn_rad), split.spans[0]
    if not turn.any():
        return log
    action = "turn"
    if abs(turn[2]) < UPRIGHT * float(np.linalg.norm(turn)):
        q = log.vector("q_world_body")[int(np.searchsorted(log.time_s, end_s))]
        action, turn = "turn body", rotations.rotate(rotations.conjugate(q), turn)
    first_s, last_s = float(log.time_s[0]), float(log.time_s[-1])
    spans = ((first_s, begin_s),)
    if last_s - end_s <= begin_s - first_s:
        turn, spans = -turn, ((end_s, last_s),)
    x, y, z = map(float, turn)
    return apply(log, Repair(action, COLUMNS["q_world_body"], turn_rad=(x, y, z), spans=spans))


def _changed(log: FlightLog, quantity: str, repair: Repair) -> FloatArray:
    values, is_attitude = log.vector(quantity), quantity.endswith("q_world_body")
    if repair.action in ("shift", "drift"):
        return shifted(log.time_s, values, repair.shift_s, factor=repair.factor, quaternion=is_attitude)
    if repair.action in ("turn", "turn body"):
        turn = rotations.exp(np.array(repair.turn_rad))
        if not is_attitude:
            return rotations.rotate(turn, values)
        return rotations.multiply(turn, values) if repair.action == "turn" else rotations.multiply(values, turn)
    if repair.action == "conjugate":
        return rotations.conjugate(values)
    if repair.action == "quaternion order":
        return np.roll(values, 1, axis=1)
    return frames.flip_attitude(values) if is_attitude else frames.flip_vector(values)


def _trimmed(log: FlightLog, names: list[str]) -> FlightLog:
    """Without the rows at the ends for which the shifted stream has nothing."""
    known = [np.flatnonzero(np.isfinite(log.columns[name])) for name in names]
    if min(map(len, known)) < 2:
        raise InputError(f"nothing is left of {names[0]} after the shift: it is longer than the log")
    kept = slice(max(rows[0] for rows in known), min(rows[-1] for rows in known) + 1)
    return FlightLog({name: values[kept] for name, values in log.columns.items()}, log.metadata)


def words(repair: Repair) -> str:
    """What was done, in words."""
    names = repair.columns[0] if len(repair.columns) == 1 else f"{repair.columns[0]} ... {repair.columns[-1]}"
    match repair.action:
        case "scale":
            return f"multiplied {names} by {repair.factor:.6g}"
        case "shift":
            return f"shifted the time stamps of {names} by {1000.0 * repair.shift_s:+.1f} ms"
        case "drift":
            return f"multiplied the time stamps of {names} by {repair.factor:.6f}, and added {repair.shift_s:+.4f} s"
        case "blank":
            return f"wrote NaN into {names} at {', '.join(f'{first:.3f}' for first, _ in repair.spans[:5])} s" + (
                f" and {len(repair.spans) - 5} more places" if len(repair.spans) > 5 else ""
            )
        case "split":
            return f"split the flight at {', '.join(f'{last:.3f}' for _, last in repair.spans)} s" + (
                ", and turned the shorter piece's attitude back" if any(repair.turn_rad) else ""
            )
        case "rotor order":
            return (
                f"took columns {list(repair.order)} of rotor speed and command as rotors 0 to {len(repair.order) - 1}"
            )
        case "drop":
            return f"dropped {names}"
        case "flip":
            return f"turned {names} from z down to z up"
        case "turn" | "turn body":
            axes = "world" if repair.action == "turn" else "body"
            return f"turned the {axes} axes of {names} by {turn_in_words(repair.turn_rad)}" + (
                f" from {repair.spans[0][0]:.3f} to {repair.spans[-1][1]:.3f} s" if repair.spans else ""
            )
        case "conjugate":
            return f"conjugated {names}"
        case "quaternion order":
            return f"reordered {names} from x y z w to w x y z"
