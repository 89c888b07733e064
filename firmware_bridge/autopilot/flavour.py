"""PX4 and ArduPilot: the mode that follows us, the parameters that matter, and what they mean.

From both projects' sources and documentation; not run on either.
"""

from dataclasses import dataclass

COPTERS = {2, 13, 14, 15, 29, 35}
"""MAV_TYPE of what flies on rotors alone."""
ROTORS = {2: 4, 13: 6, 14: 8, 15: 3, 35: 10}
"""Of them, how many each has; of 29 any number."""


@dataclass(frozen=True, slots=True)
class Limit:
    """A parameter that bounds what its position loops follow."""

    name: str
    does: str
    """What of a plan it bounds, as a verb."""
    unit: str
    scale: float = 1.0
    """Of the parameter's own unit."""
    none: float | None = None
    """The value that sets no limit."""


@dataclass(frozen=True, slots=True)
class Flavour:
    """One kind of autopilot."""

    name: str
    mode: str
    """The mode that follows us, in its words."""
    custom_mode: int
    """The same in HEARTBEAT."""
    parameters: tuple[str, ...]
    """What is read; one that a version does not have is missing."""
    rates: tuple[str, str, str]
    """Of them, the largest body rates about x, y, z, deg/s."""
    hover: str
    """Of them, the thrust that hovers."""
    integers_as_bits: bool
    """A parameter that is a whole number lies in the float's bits, not in its value."""
    limits: tuple[Limit, ...]
    """Read where it is told where to be."""


PX4 = Flavour(
    "PX4",
    "OFFBOARD",
    6 << 16,
    ("COM_OF_LOSS_T", "COM_OBL_RC_ACT", "MPC_THR_HOVER", "THR_MDL_FAC", "MC_ROLLRATE_MAX",
     "MC_PITCHRATE_MAX", "MC_YAWRATE_MAX"),
    ("MC_ROLLRATE_MAX", "MC_PITCHRATE_MAX", "MC_YAWRATE_MAX"),
    "MPC_THR_HOVER",
    True,
    (Limit("MPC_XY_VEL_MAX", "flies", "m/s"), Limit("MPC_Z_VEL_MAX_UP", "climbs", "m/s"),
     Limit("MPC_Z_VEL_MAX_DN", "sinks", "m/s"), Limit("MPC_TILTMAX_AIR", "tilts", "deg")),
)  # fmt: skip
ARDUPILOT = Flavour(
    "ArduPilot",
    "GUIDED",
    4,
    ("GUID_TIMEOUT", "GUID_OPTIONS", "FS_GCS_ENABLE", "FS_GCS_TIMEOUT", "SYSID_MYGCS", "MAV_GCS_SYSID",
     "MOT_THST_HOVER", "ATC_ANGLE_BOOST", "ATC_RATE_R_MAX", "ATC_RATE_P_MAX", "ATC_RATE_Y_MAX"),
    ("ATC_RATE_R_MAX", "ATC_RATE_P_MAX", "ATC_RATE_Y_MAX"),
    "MOT_THST_HOVER",
    False,
    (Limit("WPNAV_SPEED", "flies", "m/s", 0.01), Limit("WPNAV_SPEED_UP", "climbs", "m/s", 0.01),
     Limit("WPNAV_SPEED_DN", "sinks", "m/s", 0.01), Limit("WPNAV_ACCEL", "speeds up or bends by", "m/s2", 0.01),
     Limit("WPNAV_ACCEL_Z", "speeds up or down by", "m/s2", 0.01), Limit("ANGLE_MAX", "tilts", "deg", 0.01),
     Limit("PSC_ANGLE_MAX", "tilts", "deg", none=0.0)),
)  # fmt: skip
BY_AUTOPILOT = {12: PX4, 3: ARDUPILOT}
"""By MAV_AUTOPILOT of HEARTBEAT."""
RESULTS = {
    0: "accepted",
    1: "rejected for now",
    2: "denied",
    3: "unsupported",
    4: "failed",
    5: "in progress",
    6: "cancelled",
    7: "wanted as COMMAND_LONG",
    8: "wanted as COMMAND_INT",
    9: "unsupported frame",
    10: "refused: another station is in control",
}
"""MAV_RESULT of COMMAND_ACK."""
ARM_DISARM, DO_SET_MODE, SET_MESSAGE_INTERVAL, REQUEST_MESSAGE = 400, 176, 511, 512
COMMANDS = {ARM_DISARM: "arming", DO_SET_MODE: "the mode", SET_MESSAGE_INTERVAL: "a message's rate"}


def refusal(command: int, result: int) -> str:
    """A COMMAND_ACK in words; empty where it is none."""
    if result in (0, 5):
        return ""
    return f"{COMMANDS.get(command, f'command {command}')} {RESULTS.get(result, f'answered with {result}')}"
