"""Rotor geometry from PX4's parameters: a `.params` file of QGroundControl, or the parameters in a ULog.

PX4's parameters give the rotors' positions (`CA_ROTOR*_PX, _PY, _PZ`, x forward, y right, z down), their spins (sign
of `_KM`) and little else: no mass, no inertia, no size of propeller, and thrust only as a share of full throttle.
"""

from pathlib import Path

import numpy as np

from flight import FormatError, InputError, errors
from vehicle.draft import COUNTS, Known
from vehicle.model import ROTORS
from vehicle.model import UPRIGHT as LEAST_UPRIGHT

GENERIC_KM = 0.05
"""PX4's default ratio of torque to thrust, which is not a measured value."""
UPRIGHT = 0.999
"""Cosine of a rotor's axis and body z, below which it is tilted."""
LARGEST_BYTES = 4_000_000


def read(path: Path) -> Known:
    """Rotors of a PX4 vehicle, in PX4's order of motors (as its logs have them).

    Raises:
        InputError: no such file, or not four to eight rotors.
        FormatError: it holds no parameters.
    """
    values = parameters(path)
    count = values.get("CA_ROTOR_COUNT")
    if count is not None and 0.0 < count < 1e-40:  # an integer saved as the bits of a float
        count = float(round(count / 2.0**-149))
    if count is None and "CA_ROTOR0_PX" not in values:
        raise InputError(
            f"{path} has no CA_ROTOR0_PX: its PX4 is older than 1.13 or geometry was never set; give --arm and --frame"
        )
    rotors = 4 if count is None else int(count)
    if not ROTORS[0] <= rotors <= ROTORS[1]:
        raise InputError(f"{path} has CA_ROTOR_COUNT = {count:g}; {ROTORS[0]} to {ROTORS[1]} rotors can be modelled")
    # parameters at PX4's defaults are not saved: 0 for places
    places = [[values.get(f"CA_ROTOR{i}_P{axis}", 0.0) for axis in "XYZ"] for i in range(rotors)]
    hubs, last = np.array(places) * [1.0, -1.0, -1.0], rotors - 1
    if len(np.unique(np.round(hubs, 6), axis=0)) < rotors or not np.isfinite(hubs).all():
        raise InputError(
            f"{path}: CA_ROTOR0_PX ... CA_ROTOR{last}_PY are not {COUNTS.get(rotors, rotors)} different places; give "
            "--arm and --frame"
        )
    axis = _axes(path, values, rotors)
    moment = np.array([values.get(f"CA_ROTOR{i}_KM", GENERIC_KM) for i in range(rotors)])
    if (moment == 0.0).any() or abs(np.sign(moment).sum()) == rotors:
        some = "two of each sign" if rotors == 4 else "some of each sign"
        raise InputError(f"{path}: CA_ROTOR0_KM ... CA_ROTOR{last}_KM are {moment.tolist()}; {some} are expected")
    size_m = float(np.abs(moment).mean())
    measured = not np.allclose(np.abs(moment), GENERIC_KM)
    return Known(
        hub_body_m=hubs + 0.0,
        spin=np.sign(moment),
        axis_body=axis,
        yaw_torque_to_thrust_m=size_m if measured else None,
        notes=_notes(Path(path).name, hubs, measured),
    )


def _axes(path: Path, values: dict[str, float], rotors: int) -> np.ndarray | None:
    """(r, 3) unit thrust axes in our body axes; None where all are along body z.

    Raises:
        InputError: an axis has no length, or is far from upright.
    """
    down = {"X": 0.0, "Y": 0.0, "Z": -1.0}
    axes = np.array([[values.get(f"CA_ROTOR{i}_A{a}", down[a]) for a in "XYZ"] for i in range(rotors)])
    size = np.linalg.norm(axes, axis=1)
    if not (size > 0.0).all() or (axes[:, 2] > -LEAST_UPRIGHT * size).any():
        raise InputError(
            f"{path}: CA_ROTOR*_AX, _AY, _AZ are {axes.tolist()}; only rotors that push upwards, by {LEAST_UPRIGHT:g} "
            "of their thrust or more, can be modelled"
        )
    if (axes[:, 2] <= -UPRIGHT * size).all():
        return None
    return axes / size[:, None] * [1.0, -1.0, -1.0] + 0.0


def _notes(name: str, hubs: np.ndarray, measured: bool) -> tuple[str, ...]:
    notes = [f"rotors 0 to {len(hubs) - 1} are PX4's motors 1 to {len(hubs)} of {name}"]
    arms = np.hypot(hubs[:, 0], hubs[:, 1])
    if np.allclose(np.abs(hubs[:, :2]), 0.15, atol=1e-3) or (np.ptp(arms) < 1e-6 and arms[0] > 0.6):
        notes.append("the places of the rotors look like PX4's generic ones: measure one arm and give --arm")
    if not measured:
        notes.append(f"CA_ROTOR*_KM = {GENERIC_KM} is PX4's generic ratio of torque to thrust: only its sign was used")
    return tuple(notes)


def parameters(path: Path) -> dict[str, float]:
    """Every parameter of a `.params` file (QGroundControl or `NAME VALUE` lines) or of a ULog (`.ulg`)."""
    path = Path(path)
    if not path.is_file():
        raise errors.missing(path)
    if path.suffix.lower() == ".ulg":
        return _of_ulog(path)
    if path.stat().st_size > LARGEST_BYTES:
        raise FormatError(f"{path} has {path.stat().st_size} bytes; a parameter file has less than {LARGEST_BYTES}")
    try:
        lines = path.read_text(encoding="utf-8-sig").splitlines()
    except UnicodeDecodeError:
        raise FormatError(
            f"{path} is not text: save the parameters from QGroundControl (Tools, Save to file), not from the SD card"
        ) from None
    found: dict[str, float] = {}
    senders: dict[str, str] = {}
    for number, line in enumerate(lines, 1):
        words = line.replace(",", " ").replace("=", " ").split()
        if not words or words[0].startswith("#"):
            continue
        numbered = len(words) >= 4 and words[0].isdigit()
        name, value = (words[2], words[3]) if numbered else (words[0], words[-1])
        try:
            if numbered and senders.setdefault(name, words[0]) != words[0]:
                raise InputError(
                    f"{path} holds {name} of vehicles {senders[name]} and {words[0]}; keep the lines of one"
                )
            found[name] = float(value)
        except ValueError:
            raise FormatError(f"{path}, line {number}: {value!r} is not the number of a parameter") from None
    if not found:
        raise FormatError(f"{path} holds no parameters")
    return found


def _of_ulog(path: Path) -> dict[str, float]:
    from pyulog import ULog

    try:
        values = ULog(str(path)).initial_parameters
    except Exception as error:  # pyulog's parser raises many types
        raise FormatError(f"{path} is not a readable ULog file: {error}") from error
    return {str(name): float(value) for name, value in values.items()}
