"""How fast an autopilot's own position loops are set up to fly: they follow no target beyond it, and do not say so.

Names and what they bound are from both projects' sources (PX4's PositionControl, ArduPilot's ModeGuided).
"""

from dataclasses import dataclass

import numpy as np

from firmware_bridge.autopilot.settings import Settings
from flight import FloatArray, InputError

SHARE = 0.9
"""Of a limit, that a plan may use: the rest makes up for what is missed."""


@dataclass(frozen=True, slots=True)
class Asked:
    """What a plan asks for along its way, (n,) each."""

    time_s: FloatArray
    velocity_world_m_s: FloatArray
    """(n, 3)."""
    acceleration_world_m_s2: FloatArray
    """(n, 3)."""
    tilt_rad: FloatArray

    def of(self, does: str) -> FloatArray:
        """(n,) m/s, m/s2 or degrees, of what a limit bounds."""
        v, a = self.velocity_world_m_s, self.acceleration_world_m_s2
        return {
            "flies": np.hypot(v[:, 0], v[:, 1]), "climbs": v[:, 2], "sinks": -v[:, 2],
            "tilts": np.rad2deg(self.tilt_rad),
            "speeds up or bends by": np.hypot(a[:, 0], a[:, 1]), "speeds up or down by": np.abs(a[:, 2]),
        }[does]  # fmt: skip


def require_within(found: Settings, asked: Asked) -> None:
    """
    Raises:
        InputError: a limit is not told, or the plan goes beyond it: figure, instant and the way out.
    """
    for limit in found.flavour.limits:
        value = found.parameters.get(limit.name)
        if value is None:
            raise InputError(
                f"the autopilot does not tell {limit.name}, which bounds targets; leave out targets=position"
            )
        does, most = asked.of(limit.does), SHARE * limit.scale * value
        worst = int(np.nanargmax(does))
        if value != limit.none and not does[worst] <= most:
            wanted = np.ceil(does[worst] / SHARE / limit.scale)
            raise InputError(
                f"the plan {limit.does} {does[worst]:.2f} {limit.unit} at {asked.time_s[worst]:.1f} s, at most "
                f"{most:.2f} by position targets; set {limit.name} to {wanted:g}, or leave out targets=position"
            )
