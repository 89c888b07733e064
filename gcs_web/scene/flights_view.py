"""The simulated flights of a preflight in the 3D scene: thin lines, coloured by clearance on the scale of the path."""

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from flight import FloatArray
from gcs_web.protocol.plan import Preflight, SimulatedFlight
from gcs_web.scene import drawing

if TYPE_CHECKING:
    import viser

TOUCHING = (255, 122, 102)
"""Colour of where a flight touches something, or is lost; the page's legend has the same."""
_THIN_M, _WORST_M = 0.012, 0.028
"""Thickness of the lines of any flights, and of the worst."""


def flight_colours(flight: SimulatedFlight, required_m: float) -> np.ndarray:
    """By clearance of the vehicle's centre, and in the colour of danger once it touches or is lost: (n, 3) uint8."""
    colours = drawing.clearance_colours(np.array(flight.clearance_m), required_m).astype(np.uint8)
    colours[flight.ends :] = TOUCHING
    return colours


class FlightsView:
    """Not thread-safe: its owner locks."""

    def __init__(self, server: "viser.ViserServer") -> None:
        self._server = server
        self._lines: list[Any] = []

    def draw(self, found: Preflight, required_m: float) -> None:
        """In the place of those before; nothing for a preflight without paths."""
        for line in self._lines:
            line.remove()
        kinds = (("/flights", _THIN_M, False), ("/flights_worst", _WORST_M, True))
        drawn = [(*kind[:2], [each for each in found.paths if each.is_worst is kind[2]]) for kind in kinds]
        self._lines = [
            self._line(name, thickness_m, flights, required_m)
            for name, thickness_m, flights in drawn
            if any(len(each.x_m) > 1 for each in flights)
        ]

    @property
    def visible(self) -> bool:
        return any(line.visible for line in self._lines)

    def set_visible(self, visible: bool) -> None:
        for line in self._lines:
            line.visible = visible

    def _line(self, name: str, thickness_m: float, flights: Sequence[SimulatedFlight], required_m: float) -> Any:
        """All these flights as one node."""
        pieces = [_pairs(np.stack([each.x_m, each.y_m, each.z_m], axis=1)) for each in flights]
        colours = [_pairs(flight_colours(each, required_m)) for each in flights]
        return drawing.draw_pieces(
            self._server, np.concatenate(pieces), np.concatenate(colours), name=name, thickness_m=thickness_m
        )


def _pairs(values: FloatArray | np.ndarray) -> np.ndarray:
    """(n, 3) along a line to (n - 1, 2, 3), both ends of each piece."""
    return np.stack([values[:-1], values[1:]], axis=1)
