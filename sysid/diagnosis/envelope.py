"""The flown envelope: all that a diagnosis says, above all that nothing is missing, holds within it and no farther."""

from collections.abc import Sequence
from dataclasses import asdict, dataclass

import numpy as np

from sysid.estimator.trajectory.states import States

REACHED = 0.995
"""A limit is what this share of the states stays below, as at the ends of a curve."""


@dataclass(frozen=True, slots=True)
class Envelope:
    """How far flights went; motion in world axes, z up."""

    level_speed_m_s: float
    climb_m_s: float
    sink_m_s: float
    rate_rad_s: float
    """Size of the body's rate."""

    @property
    def extent(self) -> str:
        """What was flown."""
        return (
            f"level speed to {self.level_speed_m_s:.1f} m/s, climb to {self.climb_m_s:.1f} m/s, sink to "
            f"{self.sink_m_s:.1f} m/s, body rate to {self.rate_rad_s:.1f} rad/s"
        )

    @property
    def sentence(self) -> str:
        """What was flown, and what that leaves open."""
        return (
            f"flown envelope: {self.extent}. What acts only beyond it, or is smaller than what these flights detect, "
            "cannot be excluded"
        )

    def as_dict(self) -> dict[str, float]:
        return asdict(self)


def flown(states: Sequence[States]) -> Envelope:
    """The envelope of flights, together."""
    velocity = np.concatenate([s.velocity_world_m_s for s in states])
    rate = np.concatenate([s.rate_body_rad_s for s in states])

    def most(values: np.ndarray) -> float:
        return float(max(np.quantile(values, REACHED), 0.0))

    return Envelope(
        level_speed_m_s=most(np.linalg.norm(velocity[:, :2], axis=1)),
        climb_m_s=most(velocity[:, 2]),
        sink_m_s=most(-velocity[:, 2]),
        rate_rad_s=most(np.linalg.norm(rate, axis=1)),
    )
