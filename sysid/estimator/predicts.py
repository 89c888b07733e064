"""How far the predictions of a fitted model are off, beside those of the model that was given."""

from dataclasses import dataclass
from typing import Any


@dataclass(frozen=True, slots=True)
class Predicts:
    """Open-loop position errors of two models from the same starts on the same flights."""

    horizon_s: float
    """How far ahead."""
    given_m: float
    """Root mean square error of the model that was given."""
    fitted_m: float
    """... and of the fitted one."""
    ratio90: tuple[float, float]
    """Interval that holds the ratio of the fitted model's error to the given one's with 90 %."""
    on: str
    """In words, the flights that judged."""

    @property
    def better(self) -> bool:
        """Whether the fitted model's error is clearly the smaller one."""
        return self.ratio90[1] < 1.0

    @property
    def sentence(self) -> str:
        """Both errors and the interval of their ratio."""
        low, high = self.ratio90
        judged = "predicts" if self.better else "not shown to predict better"
        return (
            f"{judged}: {self.horizon_s:g} s ahead it is {_mm(self.fitted_m)} mm off on {self.on}, the model given "
            f"{_mm(self.given_m)} ({low:.2g} to {high:.2g} times as much)"
        )

    def as_dict(self) -> dict[str, Any]:
        """Plain JSON values; an interval that is not known is null."""
        known = self.ratio90[1] < float("inf")
        return {
            "better": self.better,
            "horizon_s": self.horizon_s,
            "given_m": self.given_m,
            "fitted_m": self.fitted_m,
            "ratio90": list(self.ratio90) if known else None,
            "on": self.on,
        }


def _mm(length_m: float) -> str:
    return f"{1e3 * length_m:.1f}" if length_m < 0.1 else f"{1e3 * length_m:.0f}"
