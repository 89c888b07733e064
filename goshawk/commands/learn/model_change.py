"""Changes of a vehicle model in words and pictures: errors in people's units, the staircase."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from flight import InputError, file_format
from sysid.estimator.validation.changes import HORIZON_S, KEYS
from sysid.estimator.validation.comparison import QUANTITIES
from sysid.report.pages import SHOWN
from vehicle.history import Step

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def prediction_error(quantity: str, value: float) -> str:
    """An error of `sysid.compare` in the unit that people read: `130 mm`, `5.6 deg`."""
    unit, scale = SHOWN[quantity]
    return f"{scale * value:.3g} {unit}"


def staircase(steps: Sequence[Step], errors: Sequence[Mapping[str, float]], flights: Sequence[str], path: Path) -> None:
    """Draw the held-out errors over a model's versions, one panel per quantity; SVG or PNG by the file's name."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    if path.suffix not in (".svg", ".png"):
        raise InputError(f"{path}: a figure is an .svg or a .png")
    figure = Figure(figsize=(9.0, 0.9 + 0.3 * len(steps) + 1.2), layout="constrained", facecolor="white")
    FigureCanvasAgg(figure)
    _draw(figure, [_label(step) for step in steps], errors)
    figure.suptitle(f"error after {HORIZON_S:g} s on {', '.join(flights)}", fontsize=9, x=0.01, ha="left")
    with file_format.atomic_file(path) as temporary:
        figure.savefig(temporary, format=path.suffix[1:], dpi=130)


def _label(step: Step) -> str:
    return f"{step.number}  {step.action} {step.effect}".rstrip()


def _draw(figure: "Figure", labels: list[str], errors: Sequence[Mapping[str, float]]) -> None:
    places = range(len(labels))
    panels = figure.subplots(1, len(QUANTITIES), sharey=True)
    for axes, (quantity, unit) in zip(panels, QUANTITIES.items(), strict=True):
        values = [error[KEYS[quantity]] for error in errors]
        axes.stairs(
            values, [p - 0.5 for p in range(len(labels) + 1)], orientation="horizontal", color="#1f6f8b", lw=1.6
        )
        for place, value in zip(places, values, strict=True):
            axes.annotate(f"{value:.3g}", (value, place), (3, 0), textcoords="offset points", va="center", fontsize=7.5)
        axes.set_xlim(0.0, 1.35 * max(values))
        axes.set_ylim(len(labels) - 0.5, -0.5)
        axes.set_title(f"{quantity} ({unit})", loc="left", fontsize=9)
        axes.set_yticks(list(places), labels, fontsize=8)
        axes.tick_params(axis="x", labelsize=7.5)
        axes.locator_params(axis="x", nbins=4)
        axes.spines[["top", "right"]].set_visible(False)
