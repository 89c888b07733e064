"""Carry out one repair of a log, and say so."""

import numpy as np

from flight import FlightLog, InputError, frames, rotations
from flight.flight_log import COLUMNS
from flight.rotations import FloatArray
from sysid.logs.checks.finding import turn_in_words
from sysid.logs.events.event import SPLITS, splits
from sysid.logs.events.frozen import within
from sysid.logs.events.repair import Repair
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
            return FlightLog(columns, {**log.metadata, SPLITS: [list(span) for span in both]})
        case "rotor order":
            for quantity in ("rotor_speed_rad_s", "rotor_speed_command_rad_s"):  # the same motors, in the same order
                names = COLUMNS[quantity]
                if log.has(quantity):
                    columns |= {names[i]: log.columns[names[k]] for i, k in enumerate(repair.order)}
        case _:
            for quantity, names in COLUMNS.items():
                if log.has(quantity) and set(names) <= set(there):
                    values = _changed(log, quantity, repair)
                    if repair.spans:
                        values = np.where(within(log.time_s, repair.spans)[:, None], values, log.vector(quantity))
                    columns |= dict(zip(names, values.T, strict=True))
    mended = FlightLog(columns, log.metadata)
    return _trimmed(mended, there) if repair.action == "shift" else mended


def _changed(log: FlightLog, quantity: str, repair: Repair) -> FloatArray:
    values, is_attitude = log.vector(quantity), quantity.endswith("q_world_body")
    if repair.action == "shift":
        return shifted(log.time_s, values, repair.shift_s, quaternion=is_attitude)
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
    known = np.flatnonzero(np.isfinite([log.columns[name] for name in names]).all(axis=0))
    if len(known) < 2:
        raise InputError(f"nothing is left of {names[0]} after the shift: it is longer than the log")
    kept = slice(known[0], known[-1] + 1)
    return FlightLog({name: values[kept] for name, values in log.columns.items()}, log.metadata)


def words(repair: Repair) -> str:
    """What was done, in words."""
    names = repair.columns[0] if len(repair.columns) == 1 else f"{repair.columns[0]} ... {repair.columns[-1]}"
    match repair.action:
        case "scale":
            return f"multiplied {names} by {repair.factor:.6g}"
        case "shift":
            return f"shifted the time stamps of {names} by {1000.0 * repair.shift_s:+.1f} ms"
        case "blank":
            return f"wrote NaN into {names} at {', '.join(f'{first:.3f}' for first, _ in repair.spans[:5])} s" + (
                f" and {len(repair.spans) - 5} more places" if len(repair.spans) > 5 else ""
            )
        case "split":
            return f"split the flight at {', '.join(f'{last:.3f}' for _, last in repair.spans)} s"
        case "rotor order":
            return f"took columns {list(repair.order)} of rotor speed (and of its command) as rotors 0 to 3"
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
