"""Between collective force and an autopilot's thrust of 0 to 1: the vehicle file's shape through its hover thrust."""

import math
from dataclasses import dataclass, replace

from firmware_bridge.autopilot.flavour import ARDUPILOT, Flavour
from firmware_bridge.offboard.thrust_map import ThrustMap


@dataclass(frozen=True, slots=True)
class AutopilotThrust:
    """One vehicle on one autopilot."""

    by_file: ThrustMap
    """Force over the motors' output of 0 to 1, by the vehicle file."""
    linear: bool
    """The autopilot makes thrust proportional to force by itself, as ArduPilot's MOT_THST_EXPO."""
    quadratic_share: float = 0.0
    """PX4's THR_MDL_FAC f: thrust = f output^2 + (1 - f) output."""
    ratio: float = 1.0
    """Force in flight over that by the vehicle file."""

    def command(self, force_n: float, battery_v: float = 0.0) -> float:
        """The thrust of 0 to 1 that comes closest to a force."""
        by_file_n = force_n / self.ratio
        if self.linear:  # it allows for its battery by itself
            return min(max(by_file_n / self.by_file.force_n(1.0), 0.0), 1.0)
        output = self.by_file.throttle(by_file_n, battery_v)
        return self.quadratic_share * output**2 + (1.0 - self.quadratic_share) * output

    def force_n(self, command: float) -> float:
        """Of a thrust of 0 to 1."""
        if self.linear:
            return self.ratio * command * self.by_file.force_n(1.0)
        f = self.quadratic_share
        output = command if f < 1e-9 else (math.sqrt((1.0 - f) ** 2 + 4.0 * f * command) - 1.0 + f) / (2.0 * f)
        return self.ratio * self.by_file.force_n(output)

    def through(self, hover: float, weight_n: float) -> "AutopilotThrust":
        """The same shape, where `hover` carries the weight."""
        return replace(self, ratio=self.ratio * weight_n / self.force_n(hover))


def of(flavour: Flavour, parameters: dict[str, float], by_file: ThrustMap) -> AutopilotThrust:
    return AutopilotThrust(by_file, flavour is ARDUPILOT, parameters.get("THR_MDL_FAC", 0.0))
