"""Pictures of a comparison and of an identification, written as files; drawn without a display."""

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from flight.rotations import FloatArray
from sysid import drawing
from sysid.comparison import HORIZONS_S, Comparison, means_over
from sysid.fit_plots import identification, repeated
from sysid.result import CHANNELS

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = ["binned", "comparison", "identification", "repeated"]


def comparison(result: Comparison, folder: Path, *, suffix: str = "svg") -> list[Path]:
    """Write `prediction_error`, `residual_wrench` and `residual_against_speed`; returns the files."""
    folder = Path(folder)
    folder.mkdir(parents=True, exist_ok=True)
    drawings = {
        "prediction_error": _prediction_error(result),
        "residual_wrench": _residual_wrench(result),
        "residual_against_speed": _residual_against_speed(result),
    }
    return [drawing.written(figure, folder / f"{name}.{suffix}") for name, figure in drawings.items()]


def _prediction_error(result: Comparison) -> "Figure":
    figure, axes = drawing.figure(1, 4, (12.0, 3.3))
    shown = (
        ("position", "cm", 100.0),
        ("velocity", "m/s", 1.0),
        ("attitude", "deg", 180.0 / np.pi),
        ("rate", "rad/s", 1.0),
    )
    for panel, (quantity, unit, scale) in zip(axes[0], shown, strict=True):
        for colour, name in zip(drawing.cycle(result.models), result.models, strict=True):
            values = scale * np.array(result.errors[name][quantity])
            panel.plot(HORIZONS_S, values, "o-", color=colour, label=name, markersize=5, linewidth=1.8)
        panel.set_xscale("log")
        panel.set_yscale("log")
        panel.set_xticks(HORIZONS_S, [f"{h:g}" for h in HORIZONS_S])
        panel.minorticks_off()
        drawing.readable_log(panel)
        drawing.plain(panel, quantity.capitalize(), "horizon (s)", f"error, rms ({unit})")
    axes[0, 0].legend(frameon=False, fontsize=9)
    names = ", ".join(f.name for f in result.flights)
    drawing.headed(figure, f"Open-loop prediction on {names} ({result.predictions} starts)")
    return figure


def _residual_wrench(result: Comparison) -> "Figure":
    figure, axes = drawing.figure(2, 3, (12.0, 5.4), sharex="col")
    for i, (panel, channel) in enumerate(zip(axes.ravel(), CHANNELS, strict=True)):
        scale, unit = (1.0, "N") if i < 3 else (1000.0, "mN m")
        for colour, name in zip(drawing.cycle(result.models), result.models, strict=True):
            residual = result.residuals[name][0]
            smooth = scale * means_over(residual.wrench, residual.time_s, 0.1)[:, i]
            time_s = residual.time_s[0] + 0.1 * (np.arange(len(smooth)) + 0.5)
            panel.plot(time_s, smooth, color=colour, linewidth=1.0, label=f"{name}: {drawing.rms(smooth):.2g} {unit}")
        panel.axhline(0.0, color=drawing.INK, linewidth=0.6)
        panel.legend(framealpha=0.8, edgecolor="none", fontsize=8, loc="upper right")
        drawing.plain(panel, channel.replace("_", " "), "time (s)" if i >= 3 else "", f"unexplained ({unit})")
    drawing.headed(
        figure,
        f"Force and torque the model does not explain, body axes, {result.flights[0].name} (means over 0.1 s)",
    )
    return figure


def _residual_against_speed(result: Comparison) -> "Figure":
    names = list(result.models)
    figure, axes = drawing.figure(len(names), 3, (12.0, 2.7 * len(names)), sharex="col", sharey="col")
    for row, colour, name in zip(axes, drawing.cycle(names), names, strict=True):
        force = np.concatenate([means_over(r.wrench[:, :3], r.time_s, 0.1) for r in result.residuals[name]])
        speed = np.concatenate([means_over(r.velocity_body_m_s, r.time_s, 0.1) for r in result.residuals[name]])
        for i, panel in enumerate(row):
            panel.plot(speed[:, i], force[:, i], ".", color=colour, alpha=0.25, markersize=4)
            centre, mean, error = binned(speed[:, i], force[:, i])
            panel.errorbar(
                centre, mean, 2.0 * error, color=drawing.INK, fmt="o-", markersize=3.5, linewidth=1.2, capsize=2
            )
            panel.axhline(0.0, color=drawing.INK, linewidth=0.6)
            last = row is axes[-1]
            label = f"velocity along body {'xyz'[i]} (m/s)" if last else ""
            drawing.plain(panel, f"{name}: F {'xyz'[i]}", label, "unexplained force (N)" if i == 0 else "")
    drawing.headed(
        figure,
        "Unexplained force against air speed; a slope or curve is an effect the model lacks (bars: 2 standard errors)",
    )
    return figure


def binned(x: FloatArray, y: FloatArray, bins: int = 12) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Mean of y in bins of x with equally many samples, and its standard error: centres, means, errors."""
    order = np.argsort(x)
    parts = [p for p in np.array_split(order, bins) if len(p) > 1]
    centre = np.array([x[p].mean() for p in parts])
    mean = np.array([y[p].mean() for p in parts])
    error = np.array([y[p].std(ddof=1) / np.sqrt(len(p)) for p in parts])
    return centre, mean, error
