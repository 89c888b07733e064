"""What the images of a map may have missed in the way of a plan: a probability beside the flights', not a wall."""

from dataclasses import dataclass
from typing import Any

from esdf.visibility import CouldHide, percent

_MOST_OF_RISK = 0.9
"""Of an accepted risk, from which on what is hidden leaves the flights nothing to show."""


@dataclass(frozen=True, slots=True)
class Hidden:
    """What may be hidden within the vehicle's sphere along the plan."""

    probability: float
    """That something is: thicker than the map's threshold, by how often its images missed such things (not glass)."""
    point_world_m: tuple[float, float, float]
    """Where that is likeliest; where the images resolve least, if no place stands out."""
    image: str = ""
    """That shows the place from nearest by; empty if none does."""

    @staticmethod
    def of(found: CouldHide | None) -> "Hidden | None":
        """As a map states it; None where it does not."""
        if found is None or found.probability is None:
            return None
        if not found.stretches:
            return Hidden(found.probability, found.point_world_m)
        likeliest = found.stretches[0]
        return Hidden(found.probability, likeliest.point_world_m, likeliest.image)

    def remedy(self) -> str:
        """What to do about it."""
        x, y, z = self.point_world_m
        look = f" (look at {self.image})" if self.image else ""
        return (
            f"take more images near ({x:.2f}, {y:.2f}, {z:.2f}) m{look}, or clear what is empty with `goshawk map edit`"
        )

    def describe(self) -> str:
        """How likely, in words."""
        return f"{percent(self.probability)} that the map misses a thing in the plan's way; counted in the total"

    def as_dict(self) -> dict[str, Any]:
        return {
            "probability": self.probability, "point_world_m": list(self.point_world_m), "image": self.image or None
        }  # fmt: skip


def together(flown: float, hidden: Hidden | None) -> float:
    """Probability of either, the two independent."""
    return flown if hidden is None else flown + hidden.probability - flown * hidden.probability


def forbids(risk: float, hidden: Hidden | None) -> bool:
    """Whether it alone takes nearly all of an accepted risk, so that no flights could show a go."""
    return hidden is not None and hidden.probability > _MOST_OF_RISK * risk


def left_of(risk: float, hidden: Hidden | None) -> float:
    """Of an accepted risk, what the flights are to show; all of it where it is no go in any case."""
    return risk if hidden is None or forbids(risk, hidden) else risk - hidden.probability
