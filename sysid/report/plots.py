"""Pictures of a comparison and of an identification, written as files; drawn without a display."""

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from sysid.estimator.flights.sampling import means_over
from sysid.estimator.result import CHANNELS, SPAN_S
from sysid.estimator.validation.comparison import HORIZONS_S, Comparison
from sysid.report import drawing, residual_plots
from sysid.report.fit_plots import identification, repeated

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = ["comparison", "identification", "repeated"]


def comparison(result: Comparison, folder: Path, *, suffix: str = "svg") -> list[Path]:
    """Write what models predict and what they leave unexplained; returns the files.

    `prediction_error`, `residual_wrench` (the flight that the first model leaves most of), `residual_share` (channel
    against variable), `residual_against_all` (the same as curves), `residual_against` (the two pairs that tell most),
    `residual_against_speed` and `residual_path` (the same flight).
    """
    folder = Path(folder)
    folder.mkdir(parents=True, exist_ok=True)
    worst = residual_plots.loudest(next(iter(result.residuals.values())))
    where = result.flights[worst].name
    drawings = {
        "prediction_error": _prediction_error(result),
        "residual_wrench": residual_plots.over_time(result.residuals, worst, f"Unexplained on {where}, body axes"),
        "residual_share": residual_plots.heat_map(result.residuals),
        "residual_against_all": residual_plots.against_all(result.residuals),
        "residual_against": residual_plots.against(result.residuals, _pairs(result)),
        "residual_against_speed": _residual_against_speed(result),
        "residual_path": residual_plots.path(result.residuals, worst, f"Where on {where} the models fail"),
    }
    return [drawing.written(figure, folder / f"{name}.{suffix}") for name, figure in drawings.items()]


def _pairs(result: Comparison) -> list[tuple[str, str]]:
    """Of force and of torque, the channel and variable that tell most about the first model."""
    residuals = next(iter(result.residuals.values()))
    return [residual_plots.most_telling(residuals, CHANNELS[part])[:2] for part in (slice(0, 3), slice(3, 6))]


def _prediction_error(result: Comparison) -> "Figure":
    figure, axes = drawing.figure(1, 4, (12.0, 3.3))
    shown = (
        ("position", "mm", 1000.0),
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


def _residual_against_speed(result: Comparison) -> "Figure":
    names = list(result.models)
    figure, axes = drawing.figure(len(names), 3, (12.0, 2.7 * len(names)), sharex="col", sharey="col")
    for k, (row, colour, name) in enumerate(zip(axes, drawing.cycle(names), names, strict=True)):
        force = np.concatenate([r.means()[:, :3] for r in result.residuals[name]])
        speed = np.concatenate([means_over(r.velocity_body_m_s, r.time_s, SPAN_S) for r in result.residuals[name]])
        for i, panel in enumerate(row):
            residual_plots.scatter(panel, speed[:, i], force[:, i], colour)
            label = f"velocity along body {'xyz'[i]} (m/s)" if k == len(names) - 1 else ""
            drawing.plain(panel, f"{name}: F_{'xyz'[i]}", label, "unexplained force (N)" if i == 0 else "")
    drawing.headed(
        figure,
        "Unexplained force against air speed; a slope or curve is an effect the model lacks (line: mean, 95 % band)",
    )
    return figure
