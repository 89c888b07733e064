"""Changes of a vehicle model in words and pictures: errors in people's units, the staircase."""

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from flight import InputError
from sysid.estimator.validation.changes import HORIZON_S, KEYS
from sysid.estimator.validation.comparison import QUANTITIES
from sysid.report import drawing
from sysid.report.pages import SHOWN
from vehicle.history import Step


def prediction_error(quantity: str, value: float) -> str:
    """An error of `sysid.compare` in the unit that people read: `130 mm`, `5.6 deg`."""
    unit, scale = SHOWN[quantity]
    return f"{scale * value:.3g} {unit}"


def staircase(steps: Sequence[Step], errors: Sequence[Mapping[str, float]], flights: Sequence[str], path: Path) -> None:
    """Draw the held-out errors over a model's versions, one panel per quantity; SVG or PNG by the file's name."""
    if path.suffix not in (".svg", ".png"):
        raise InputError(f"{path}: a figure is an .svg or a .png")
    figure, panels = drawing.figure(1, len(QUANTITIES), (9.0, 2.1 + 0.3 * len(steps)), sharey=True)
    _draw(panels[0], [_label(step) for step in steps], errors)
    drawing.headed(figure, f"error after {HORIZON_S:g} s on {', '.join(flights)}")
    drawing.written(figure, path)


def _label(step: Step) -> str:
    return f"{step.number}  {step.action} {step.effect}".rstrip()


def _draw(panels: np.ndarray, labels: list[str], errors: Sequence[Mapping[str, float]]) -> None:
    places = range(len(labels))
    colour = drawing.look().colours[1]
    for axes, (quantity, unit) in zip(panels, QUANTITIES.items(), strict=True):
        values = [error[KEYS[quantity]] for error in errors]
        axes.stairs(values, np.arange(len(labels) + 1) - 0.5, orientation="horizontal", color=colour, linewidth=1.6)
        for place, value in zip(places, values, strict=True):
            axes.annotate(f"{value:.3g}", (value, place), (3, 0), textcoords="offset points", va="center", fontsize=7.5)
        axes.set_xlim(0.0, 1.35 * max(values))
        axes.set_ylim(len(labels) - 0.5, -0.5)
        drawing.plain(axes, quantity, unit, "")
        axes.set_yticks(list(places), labels)
        axes.locator_params(axis="x", nbins=4)
        axes.grid(False, axis="y")
