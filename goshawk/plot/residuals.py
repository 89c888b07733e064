"""What models leave unexplained of the force on one flight: before and after an effect was added, say."""

from typing import TYPE_CHECKING

from flight import InputError
from sysid import Comparison
from sysid.estimator.result import CHANNELS
from sysid.report import drawing, residual_plots

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def residual(compared: Comparison, flight: str | None = None, *, style: drawing.Style = "light") -> "Figure":
    """Force in body axes, measured less modelled, of each model of a comparison, with the band of white noise.

    Args:
        flight: its name; the one that the first model leaves most of, if left out.

    Raises:
        InputError: no flight has this name.
    """
    names = [one.name for one in compared.flights]
    if flight is not None and flight not in names:
        raise InputError(f"the comparison has no flight {flight!r}; it has {', '.join(names)}")
    first = next(iter(compared.residuals.values()))
    shown = residual_plots.loudest(first) if flight is None else names.index(flight)
    with drawing.styled(style):
        return residual_plots.over_time(compared.residuals, shown, f"Unexplained force on {names[shown]}", CHANNELS[:3])
