"""What of an autopilot's parameters must hold before anything is armed, and what it does when we die, in words."""

import math
from collections.abc import Iterator

from firmware_bridge.arming import ArmingCheck
from firmware_bridge.autopilot.flavour import PX4, ROTORS
from firmware_bridge.autopilot.settings import Settings
from firmware_bridge.autopilot.thrust import AutopilotThrust

LONGEST_HOLD_S = 0.5
"""Of the last rates and thrust, which both autopilots hold until they miss us."""
HOVER_APART = 0.15
"""Share by which the autopilot's hover thrust and the vehicle file's may differ; an observer makes up for the rest."""
FREE_RATE_DEG_S = 720.0
"""Where ArduPilot sets no limit (0)."""
RADIO_ARMS, THRUST_AS_THRUST = 1, 8
"""Of GUID_OPTIONS: a radio arms in GUIDED; without the other a thrust of .5 holds the height, others climb or sink."""
_PX4_FALLS = {6: "terminates: the rotors stop", 7: "disarms: the rotors stop"}
_PX4_ACTS = {
    0: "position mode, which needs a pilot's sticks", 1: "altitude mode, which needs a pilot's sticks",
    2: "manual mode, which needs a pilot's sticks", 3: "returns and lands", 4: "lands where it is", 5: "holds",
    **_PX4_FALLS,
}  # fmt: skip
_GCS_ACTS = {
    0: "nothing", 1: "returns and lands", 2: "goes on with its mission, else returns and lands",
    3: "returns the way it came, else lands", 4: "returns the way it came, else lands", 5: "lands where it is",
    6: "lands by its mission, else returns and lands", 7: "brakes, else lands",
}  # fmt: skip


def checks(
    found: Settings, *, weight_n: float, thrust: AutopilotThrust, arms: bool = True, origin: bool = False
) -> tuple[ArmingCheck, ...]:
    """Every condition with what was read.

    Args:
        arms: we ask it to arm; else the pilot arms it in our mode.
        origin: it was told one.
        thrust: by the vehicle file alone.
    """
    own = _px4(found) if found.flavour is PX4 else _ardupilot(found, arms=arms)
    taken = ArmingCheck(
        "origin",
        found.origin_known,
        "known to its estimator" if found.origin_known else "not taken",
        "leave out ?origin, or restart it",
    )
    return (_disarmed(found), *own, _hover(found, weight_n, thrust), *([taken] if origin else []))


def when_we_die(found: Settings) -> str:
    """What the vehicle does when nothing comes from here any more, by its own parameters."""
    value = found.parameters
    if found.flavour is PX4:
        act = _PX4_ACTS.get(int(value.get("COM_OBL_RC_ACT", -1)), "does what COM_OBL_RC_ACT says")
        return f"without us PX4 holds what we sent last for {value['COM_OF_LOSS_T']:g} s, then: {act}"
    act = _GCS_ACTS.get(int(value.get("FS_GCS_ENABLE", -1)), "does what FS_GCS_ENABLE says")
    return (
        f"without us ArduPilot holds what we sent last for {value['GUID_TIMEOUT']:g} s, then is level at its height, "
        f"and after {value.get('FS_GCS_TIMEOUT', 5.0):g} s, "
        f"only if no other station sends as {own_system(found)}: {act}"
    )


def largest_rad_s(found: Settings) -> tuple[float, float, float]:
    """Body rates about x, y, z that the autopilot is set up for."""
    told = [found.parameters.get(name, 0.0) for name in found.flavour.rates]
    x, y, z = (math.radians(rate if rate > 0.0 else FREE_RATE_DEG_S) for rate in told)
    return x, y, z


def own_system(found: Settings) -> int:
    """The id to send by: of the station whose silence ArduPilot acts on."""
    return int(found.parameters.get(_station_name(found), 255.0))


def _station_name(found: Settings) -> str:
    return "MAV_GCS_SYSID" if "MAV_GCS_SYSID" in found.parameters else "SYSID_MYGCS"


def _disarmed(found: Settings) -> ArmingCheck:
    return ArmingCheck("armed", not found.armed, "armed" if found.armed else "disarmed", "disarm it first")


def as_many_rotors(found: Settings, rotors: int) -> ArmingCheck:
    """Whether it mixes as many as the vehicle file has; a MAV_TYPE that tells no number passes."""
    theirs = ROTORS.get(found.kind, rotors)
    frame = "CA_ROTOR_COUNT and its rotors" if found.flavour is PX4 else "FRAME_CLASS"
    return ArmingCheck(
        "rotors", theirs == rotors,
        f"the autopilot is a vehicle of {theirs} (MAV_TYPE {found.kind}), the vehicle file has {rotors}",
        f"give the file of this vehicle, or set {frame}",
    )  # fmt: skip


def _at_most(found: Settings, name: str, most: float) -> ArmingCheck:
    value = found.parameters.get(name, math.nan)
    return ArmingCheck(name, 0.0 < value <= most, f"{_said(value)} s, at most {most:g}", f"set {name} to {most:g}")


def _said(value: float) -> str:
    return "not told" if math.isnan(value) else f"{value:g}"


def _px4(found: Settings) -> Iterator[ArmingCheck]:
    yield _at_most(found, "COM_OF_LOSS_T", LONGEST_HOLD_S)
    act = found.parameters.get("COM_OBL_RC_ACT", math.nan)
    words = _PX4_ACTS.get(int(act), "unknown") if act == act else "not told"
    good = act in _PX4_ACTS and act not in _PX4_FALLS
    yield ArmingCheck("COM_OBL_RC_ACT", good, f"{_said(act)}, {words}", "set COM_OBL_RC_ACT to 4, which lands")


def _ardupilot(found: Settings, *, arms: bool) -> Iterator[ArmingCheck]:
    yield _at_most(found, "GUID_TIMEOUT", LONGEST_HOLD_S)
    options = found.parameters.get("GUID_OPTIONS", math.nan)
    told, wanted = int(options) if options == options else 0, THRUST_AS_THRUST | (0 if arms else RADIO_ARMS)
    why = "else a thrust is a climb rate" + ("" if arms else ", and no radio arms it in GUIDED")
    yield ArmingCheck(
        "GUID_OPTIONS", told & wanted == wanted, f"{_said(options)}, expected {wanted} in it: {why}",
        f"set GUID_OPTIONS to {told | wanted}",
    )  # fmt: skip
    boost = found.parameters.get("ATC_ANGLE_BOOST", math.nan)
    yield ArmingCheck(
        "ATC_ANGLE_BOOST", boost == 0.0, f"{_said(boost)}, expected 0: else thrust grows with the tilt, ours and its",
        "set ATC_ANGLE_BOOST to 0",
    )  # fmt: skip
    enabled = found.parameters.get("FS_GCS_ENABLE", math.nan)
    yield ArmingCheck(
        "FS_GCS_ENABLE", enabled > 0.0,
        f"{_said(enabled)}, expected above 0: else it hovers without us until its battery is empty",
        "set FS_GCS_ENABLE to 5, which lands",
    )  # fmt: skip
    own, alone = own_system(found), own_system(found) not in found.stations
    yield ArmingCheck(
        _station_name(found), alone,
        f"{own}, as which " + ("no other sends" if alone else "another station sends too: ArduPilot would not miss us"),
        f"close it, or give it another id than {own}",
    )  # fmt: skip


def _hover(found: Settings, weight_n: float, thrust: AutopilotThrust) -> ArmingCheck:
    name = found.flavour.hover
    theirs, ours = found.parameters.get(name, math.nan), thrust.command(weight_n)
    apart = abs(theirs / ours - 1.0)
    return ArmingCheck(
        name, apart <= HOVER_APART,
        f"{_said(theirs)}, the vehicle file hovers at {ours:.3f}; at most {HOVER_APART:.0%} apart",
        f"hover it by hand and set {name} to what that takes, or mend the vehicle file's rotors",
    )  # fmt: skip
