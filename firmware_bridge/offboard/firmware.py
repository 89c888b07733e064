"""Betaflight's messages: sticks out; attitude, arming, motors, voltage in."""

import math
import struct
from dataclasses import dataclass, field
from enum import IntEnum

import numpy as np

from firmware_bridge.offboard.byte_line import ByteLine
from firmware_bridge.offboard.msp import ANSWER, Decoder, Frame, encode
from flight import FloatArray


class Alert(IntEnum):
    """What the firmware says of the battery, by `vbat_warning_cell_voltage` and `vbat_min_cell_voltage`."""

    NONE = 0
    WARNING = 1
    CRITICAL = 2


class Function(IntEnum):
    """Requests that are used."""

    STATUS_EX = 150
    BOX_IDS = 119
    MOTOR = 104
    RC = 105
    ATTITUDE = 108
    ALTITUDE = 109
    BATTERY_STATE = 130
    SET_RAW_RC = 200


ARM_BOX, OVERRIDE_BOX = 0, 50
"""Permanent ids of modes."""
RATE_CHANGING = {
    1: "ANGLE", 2: "HORIZON", 3: "ALTHOLD", 5: "MAG", 6: "HEADFREE", 7: "HEADADJ", 11: "POS HOLD", 12: "PASSTHRU",
    27: "FAILSAFE", 30: "FPV ANGLE MIX", 35: "FLIP OVER AFTER CRASH", 45: "PARALYZE", 46: "GPS RESCUE",
    47: "ACRO TRAINER", 49: "LAUNCH CONTROL", 55: "CHIRP",
}  # fmt: skip
"""Modes in which a stick is not a body rate, or a throttle not a thrust."""
_ANSWER_S = 0.3
"""Older answers are none."""
_BAROMETER_BIT = 2
_ARMING_FLAGS = (
    "no gyro", "failsafe", "no receiver signal", "was not disarmed", "failsafe switch", "runaway take-off",
    "crash detected", "throttle not low", "tilted beyond small_angle", "just started", "no prearm", "processor load",
    "sensors calibrate", "command line open", "menu open", "BST", "held by MSP", "paralysed", "no GPS fix",
    "GPS rescue switch", "ESC telemetry", "restart needed", "DSHOT", "accelerometer not calibrated", "motor protocol",
    "crash flip", "altitude hold", "position hold", "the arm switch is on already",
)  # fmt: skip
_HARMLESS_FLAGS = 1 << 28
_TURN = (Function.ATTITUDE, Function.MOTOR, Function.ATTITUDE, Function.STATUS_EX, Function.ATTITUDE, Function.ALTITUDE,
         Function.ATTITUDE, Function.BATTERY_STATE)  # fmt: skip
"""Asked one a tick, so that attitude comes every other tick."""


@dataclass(slots=True)
class FirmwareState:
    """What the firmware has said last."""

    heard_s: float = -np.inf
    """When it answered last."""
    roll_pitch_rad: FloatArray = field(default_factory=lambda: np.full(2, np.nan))
    """Roll right, pitch nose down: rotations about x forward and y left."""
    attitude_s: float = -np.inf
    armed: bool = False
    arming_told: bool = True
    """Whether it has told that since it was last asked to arm or disarm."""
    left: bool = False
    """Whether the pilot has left the mode that follows us, before it was armed."""
    overriding: bool = False
    """Whether MSP has the sticks by the pilot's switch."""
    other_modes: tuple[int, ...] = ()
    """Permanent ids of those of `RATE_CHANGING` that are on."""
    arming_flags: int = 0
    """Why it does not arm, but for a switch that is on already."""
    has_barometer: bool = False
    altitude_m: float = np.nan
    climb_m_s: float = np.nan
    altitude_s: float = -np.inf
    altitude_changed_s: float = -np.inf
    """When it last was another: a barometer that stands still is broken."""
    battery_v: float = 0.0
    """0: not measured."""
    battery_alert: Alert = Alert.NONE
    motors: FloatArray = field(default_factory=lambda: np.full(4, np.nan))
    """Outputs of motors 1 to 4, 0 to 1."""

    def up_body(self, now_s: float) -> FloatArray | None:
        """World's up in body axes (3,); None when it has not been told of late."""
        if not now_s - self.attitude_s < _ANSWER_S:
            return None
        roll, pitch = self.roll_pitch_rad
        return np.array([-math.sin(pitch), math.sin(roll) * math.cos(pitch), math.cos(roll) * math.cos(pitch)])


def reasons(arming_flags: int) -> list[str]:
    """Why it does not arm, in words."""
    return [name for bit, name in enumerate(_ARMING_FLAGS) if arming_flags >> bit & 1]


class Firmware:
    """The firmware at the other end of a line."""

    def __init__(self, line: ByteLine) -> None:
        self._line, self._decoder = line, Decoder()
        self.state = FirmwareState()
        self._boxes: bytes | None = None
        self._turn = 0

    def sticks(self, channels_us: tuple[int, ...]) -> None:
        """Receiver's pulses, in the order of the receiver's channels."""
        self._send(Function.SET_RAW_RC, struct.pack(f"<{len(channels_us)}H", *channels_us))

    def ask(self) -> None:
        """One request; the answers come by and by."""
        self._turn += 1
        function = _TURN[self._turn % len(_TURN)]
        if self._boxes is None and function is Function.STATUS_EX:
            function = Function.BOX_IDS
        self._send(function)

    def _send(self, function: Function, payload: bytes = b"") -> None:
        self._line.write(encode(Frame(function, payload)))

    def listen(self, now_s: float) -> None:
        """Take in what has come."""
        while data := self._line.read():
            for frame in self._decoder.feed(data):
                if frame.direction == ANSWER:
                    self.state.heard_s = now_s
                    self._take(frame, now_s)

    def _take(self, frame: Frame, now_s: float) -> None:
        """Payloads as in Betaflight 4.3 and later; what is shorter than it must be is not looked at."""
        state, data = self.state, frame.payload
        if frame.function == Function.ATTITUDE and len(data) >= 4:
            state.roll_pitch_rad = np.deg2rad(np.array(struct.unpack_from("<2h", data)) / 10.0)
            state.attitude_s = now_s
        elif frame.function == Function.BOX_IDS:
            self._boxes = data
        elif frame.function == Function.STATUS_EX and len(data) >= 16:
            self._status(data)
        elif frame.function == Function.ALTITUDE and len(data) >= 6:
            altitude_cm, climb_cm_s = struct.unpack_from("<ih", data)
            if 0.01 * altitude_cm != state.altitude_m:
                state.altitude_changed_s = now_s
            state.altitude_m, state.climb_m_s, state.altitude_s = 0.01 * altitude_cm, 0.01 * climb_cm_s, now_s
        elif frame.function == Function.MOTOR and len(data) >= 8:
            state.motors = np.clip((np.array(struct.unpack_from("<4H", data)) - 1000.0) / 1000.0, 0.0, 1.0)
        elif frame.function == Function.BATTERY_STATE and len(data) >= 11:
            alert, centivolts = struct.unpack_from("<BH", data, 8)
            state.battery_v = 0.01 * centivolts
            state.battery_alert = Alert(alert) if alert <= Alert.CRITICAL else Alert.NONE

    def _status(self, data: bytes) -> None:
        state = self.state
        (sensors,) = struct.unpack_from("<H", data, 4)
        state.has_barometer = bool(sensors & _BAROMETER_BIT)
        more = data[15] & 15
        modes = int.from_bytes(data[6:10] + data[16 : 16 + more], "little")
        if self._boxes is not None:
            state.armed = self._mode(modes, ARM_BOX)
            state.overriding = self._mode(modes, OVERRIDE_BOX)
            state.other_modes = tuple(box for box in RATE_CHANGING if self._mode(modes, box))
        if len(data) >= 21 + more:
            state.arming_flags = struct.unpack_from("<I", data, 17 + more)[0] & ~_HARMLESS_FLAGS

    def _mode(self, modes: int, box: int) -> bool:
        assert self._boxes is not None
        return box in self._boxes and bool(modes >> self._boxes.index(box) & 1)
