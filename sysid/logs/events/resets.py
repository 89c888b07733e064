"""Where an estimator says itself that it moved its answer: its reset counters."""

import numpy as np

from flight.flight_log import COLUMNS
from flight.rotations import FloatArray
from sysid.logs.events.event import WAY_OUT_SPLIT, Event
from sysid.logs.events.repair import Repair


def of_counter(
    quantity: str, time_s: FloatArray, counter: FloatArray, moved: FloatArray, *, name: str, unit: str
) -> list[Event]:
    """One event for each time that a counter moves.

    Args:
        quantity: what is reset, of `COLUMNS`.
        counter: (n,) of the estimator.
        moved: (n,) by how much the last reset moved the quantity, as the estimator says; NaN: it does not say.
        name: of the counter.
    """
    events: list[Event] = []
    for i in np.flatnonzero(np.diff(counter) != 0.0):
        span = (float(time_s[i]), float(time_s[i + 1]))
        size = float(np.abs(moved[i + 1]))
        by = f" by {size:.3g} {unit}" if np.isfinite(size) and size > 0.0 else ""
        sentence = f"the estimator reset {quantity}{by} at {{at}}: its {name} moves"
        repair = Repair("split", COLUMNS[quantity], spans=(span,))
        events.append(
            Event("reset", quantity, span, size if by else 0.0, unit, sentence, WAY_OUT_SPLIT, True, repair=repair)
        )
    return events
