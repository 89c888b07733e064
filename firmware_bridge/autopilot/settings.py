"""What an autopilot says of itself before anything is armed: who it is, and the parameters that matter."""

import struct
import time
from dataclasses import dataclass, replace

from firmware_bridge.autopilot.flavour import ARDUPILOT, BY_AUTOPILOT, COPTERS, REQUEST_MESSAGE, Flavour
from firmware_bridge.autopilot.line import AUTOPILOT_COMPONENT, Address, MavlinkLine
from firmware_bridge.dialect.generated.autopilot_messages import GpsGlobalOrigin, SetGpsGlobalOrigin
from firmware_bridge.dialect.generated.messages import (
    AutopilotVersion,
    CommandLong,
    Heartbeat,
    ParamRequestRead,
    ParamValue,
)
from flight import LinkError

ARMED = 128
ONBOARD, NO_AUTOPILOT = 18, 8
_INTEGERS = {1: "<B3x", 2: "<b3x", 3: "<H2x", 4: "<h2x", 5: "<I", 6: "<i"}
"""MAV_PARAM_TYPE in the bits of a float."""
_TRIES, _ANSWER_S, _HEARTBEAT_S, _STATIONS_S = 4, 0.5, 1.0, 1.5


@dataclass(frozen=True, slots=True)
class Settings:
    """What it has said."""

    flavour: Flavour
    system: int
    parameters: dict[str, float]
    """By name; one that it did not tell in four tries is missing."""
    armed: bool = False
    version: str = ""
    origin_known: bool = False
    """Its estimator knows where on Earth its local frame begins."""
    stations: frozenset[int] = frozenset()
    """Other systems that send heartbeats to it, or beside it."""
    kind: int = 0
    """MAV_TYPE of its heartbeat."""

    @property
    def firmware(self) -> str:
        return f"{self.flavour.name} {self.version}".strip()


def heartbeat() -> Heartbeat:
    return Heartbeat(type=ONBOARD, autopilot=NO_AUTOPILOT, system_status=4, mavlink_version=3)


def read(line: MavlinkLine, address: Address, *, patience_s: float = 10.0) -> Settings:
    """
    Raises:
        LinkError: no autopilot is there, or none that is known, or a vehicle that is no multicopter.
    """
    begin_s = time.monotonic()
    first, line.system = _first_heartbeat(line, patience_s)
    system = line.system
    flavour = BY_AUTOPILOT.get(first.autopilot)
    if flavour is None:
        raise LinkError(f"an autopilot of kind {first.autopilot} answers; PX4 (12) and ArduPilot (3) are flown")
    if first.type not in COPTERS:
        raise LinkError(f"a vehicle of MAV_TYPE {first.type} answers; only multicopters are flown")
    limits = tuple(limit.name for limit in flavour.limits) if address.position else ()
    asked = replace(flavour, parameters=flavour.parameters + limits)
    values, version, origin = _told(line, system, asked)
    if address.origin is not None and not origin:
        latitude, longitude, altitude_m = address.origin
        line.send(SetGpsGlobalOrigin(round(1e7 * latitude), round(1e7 * longitude), round(1e3 * altitude_m), system))
        _, _, origin = _told(line, system, asked, known=set(asked.parameters))
    while flavour is ARDUPILOT and (left_s := begin_s + _STATIONS_S - time.monotonic()) > 0.0:
        line.receive(left_s)  # a heartbeat of every station
    stations = frozenset(line.stations)
    return Settings(flavour, system, values, bool(first.base_mode & ARMED), version, origin, stations, first.type)


def _first_heartbeat(line: MavlinkLine, patience_s: float) -> tuple[Heartbeat, int]:
    end_s, told_s = time.monotonic() + patience_s, -_HEARTBEAT_S
    while (now_s := time.monotonic()) < end_s:
        if now_s - told_s >= _HEARTBEAT_S:
            line.send(heartbeat())
            told_s = now_s
        for received in line.receive(0.1):
            message = received.message
            if isinstance(message, Heartbeat) and received.component_id == AUTOPILOT_COMPONENT:
                return message, received.system_id
    raise LinkError("no autopilot's heartbeat came; does anything send MAVLink 2 to that port?")


def _told(
    line: MavlinkLine, system: int, flavour: Flavour, *, known: set[str] | None = None
) -> tuple[dict[str, float], str, bool]:
    """Parameters, version, and whether there is an origin: asked until they come, or were not told in time."""
    values: dict[str, float] = {}
    version, origin = "", False
    for _ in range(_TRIES):
        missing = [name for name in flavour.parameters if name not in values and name not in (known or ())]
        if not missing and version and origin:
            break
        line.send(heartbeat())
        for name in missing:
            line.send(ParamRequestRead(-1, system, AUTOPILOT_COMPONENT, name))
        for message_id in (AutopilotVersion.ID, GpsGlobalOrigin.ID):
            line.send(_asking(system, message_id))
        end_s = time.monotonic() + _ANSWER_S
        while (left_s := end_s - time.monotonic()) > 0.0:
            for received in line.receive(left_s):
                message = received.message
                if (received.system_id, received.component_id) != (system, AUTOPILOT_COMPONENT):
                    continue
                if isinstance(message, ParamValue) and message.param_id in missing:
                    values[message.param_id] = number(message, flavour)
                elif isinstance(message, AutopilotVersion):
                    version = ".".join(str(message.flight_sw_version >> shift & 255) for shift in (24, 16, 8))
                elif isinstance(message, GpsGlobalOrigin):
                    origin = True
            if version and origin and set(missing) <= set(values):
                break
    return values, version, origin


def _asking(system: int, message_id: int) -> CommandLong:
    return CommandLong(
        param1=float(message_id), command=REQUEST_MESSAGE, target_system=system, target_component=AUTOPILOT_COMPONENT
    )


def number(message: ParamValue, flavour: Flavour) -> float:
    """The value of a parameter: PX4 puts the bits of a whole number into the float."""
    layout = _INTEGERS.get(message.param_type)
    if layout is None or not flavour.integers_as_bits:
        return message.param_value
    return float(struct.unpack(layout, struct.pack("<f", message.param_value))[0])
