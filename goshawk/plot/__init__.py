"""What there is to look at, as Matplotlib figures: a plan, a log, tracking, residual force, a slice of a map.

Each function returns a figure, drawn without a display in a light or a dark style; `figure.savefig(FILE)` writes it.
Matplotlib is imported when one is called.
"""

from goshawk.plot.flights import log, tracking
from goshawk.plot.maps import distances, map_slice, slices
from goshawk.plot.plans import plan
from goshawk.plot.residuals import residual

__all__ = ["distances", "log", "map_slice", "plan", "residual", "slices", "tracking"]
