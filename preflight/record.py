"""What is kept of flights."""

from dataclasses import dataclass

import numpy as np

from flight import FloatArray
from preflight import core

BINS = 100
"""Equal shares of the trajectory's time, for the tube."""
OVERTURNED_RAD = 0.5 * np.pi


@dataclass(frozen=True, slots=True, eq=False)
class Record:
    """What is kept of n flights."""

    clearance_m: FloatArray
    """(n,) least, beyond the vehicle's sphere; infinite without a map."""
    point_world_m: FloatArray
    """(n, 3) where."""
    path_s: FloatArray
    """(n,) when, as time on the trajectory."""
    left_map: np.ndarray
    error_m: np.ndarray
    """(n, `BINS`) largest tracking error along the trajectory."""
    ending: np.ndarray
    end_state: np.ndarray
    reason: np.ndarray
    tilt_rad: FloatArray
    fell: np.ndarray
    rotor_reserve: FloatArray
    energy_j: FloatArray
    duration_s: FloatArray
    strain: FloatArray
    """(n,) as `core.Flown.strain`."""

    def __len__(self) -> int:
        return len(self.ending)

    def __getitem__(self, rows: np.ndarray) -> "Record":
        return Record(**{name: getattr(self, name)[rows] for name in Record.__slots__})

    def with_rows(self, rows: np.ndarray, others: "Record") -> "Record":
        """With other flights (m,) in these rows (m,)."""
        changed = {name: getattr(self, name).copy() for name in Record.__slots__}
        for name, values in changed.items():
            values[rows] = getattr(others, name)
        return Record(**changed)

    @property
    def touched(self) -> np.ndarray:
        return self.clearance_m < 0.0

    @property
    def lost(self) -> np.ndarray:
        """(n,) whether it touched something, left the map, overturned, or came down without knowing where."""
        return self.touched | self.left_map | self.upset

    @property
    def upset(self) -> np.ndarray:
        """(n,) whether it overturned, or came down without knowing where."""
        return self.fell | (self.tilt_rad > OVERTURNED_RAD) | (self.ending == core.DIVERGED)

    @staticmethod
    def joined(parts: list["Record"]) -> "Record":
        names = Record.__slots__
        return Record(**{name: np.concatenate([getattr(part, name) for part in parts]) for name in names})
