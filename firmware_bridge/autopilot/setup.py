"""What the guard of a flight on an autopilot is started with."""

import json
from dataclasses import asdict, dataclass

from firmware_bridge.autopilot.thrust import AutopilotThrust
from firmware_bridge.offboard.thrust_map import ThrustMap


@dataclass(frozen=True, slots=True)
class AutopilotSetup:
    """One flight."""

    address: str
    system: int
    """The autopilot's id."""
    own_system: int
    custom_mode: int
    """In which it follows us."""
    mode_in_command: int
    """The same as MAV_CMD_DO_SET_MODE wants it: PX4's main mode without its sub mode."""
    arms: bool
    """Ask for the mode and to arm; else the pilot does both."""
    thrust: AutopilotThrust
    mass_kg: float
    gravity_m_s2: float
    pose_host: str
    pose_port: int
    pose_delay_s: float
    period_s: float = 0.004
    clock_port: int = 0
    """Of a simulated body; 0: the machine's clock."""

    def to_json(self) -> str:
        return json.dumps(asdict(self))

    @staticmethod
    def from_json(text: str) -> "AutopilotSetup":
        values = json.loads(text)
        by_file = values["thrust"]["by_file"]
        shape = ThrustMap(**{**by_file, "coefficients_n": tuple(by_file["coefficients_n"])})
        return AutopilotSetup(**{**values, "thrust": AutopilotThrust(**{**values["thrust"], "by_file": shape})})
