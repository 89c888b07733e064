"""Pictures of a comparison and of an identification, written as files; drawn without a display."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from flight import file_format
from flight.rotations import FloatArray
from sysid.comparison import HORIZONS_S, Comparison, means_over
from sysid.result import CHANNELS, Identification

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

COLOURS = ("#b0413e", "#1f6f8b", "#548c2f", "#8d5a97", "#c98a1b")
INK = "#2b2b2b"


def comparison(result: Comparison, folder: Path, *, suffix: str = "svg") -> list[Path]:
    """Write `prediction_error`, `residual_wrench` and `residual_against_speed`; returns the files."""
    folder = Path(folder)
    folder.mkdir(parents=True, exist_ok=True)
    drawings = {
        "prediction_error": _prediction_error(result),
        "residual_wrench": _residual_wrench(result),
        "residual_against_speed": _residual_against_speed(result),
    }
    return [_written(figure, folder / f"{name}.{suffix}") for name, figure in drawings.items()]


def identification(result: Identification, folder: Path, *, suffix: str = "svg") -> list[Path]:
    """Write `parameters`, `convergence` and `correlation`; returns the files."""
    folder = Path(folder)
    folder.mkdir(parents=True, exist_ok=True)
    drawings = {
        "parameters": _parameters(result),
        "convergence": _convergence(result),
        "correlation": _correlation(result),
    }
    return [_written(figure, folder / f"{name}.{suffix}") for name, figure in drawings.items()]


def repeated(results: Sequence[Identification], names: Sequence[str], path: Path) -> Path:
    """One parameter per panel over repeated trials with one-sigma bars (the paper's Fig. 8)."""
    figure, axes = _figure(1, len(names), (3.4 * len(names), 3.0))
    trial = np.arange(1, len(results) + 1)
    for panel, name in zip(axes[0], names, strict=True):
        value = np.array([r.estimate(name).value for r in results])
        std = np.array([r.estimate(name).std_robust for r in results])
        panel.errorbar(trial, value, std, fmt="o", color=COLOURS[1], capsize=3, markersize=4)
        panel.axhline(value.mean(), color=INK, linewidth=0.8, linestyle="--")
        _plain(panel, name, "trial", results[0].estimate(name).unit)
    return _written(figure, Path(path))


def _figure(rows: int, columns: int, size: tuple[float, float], **options: Any) -> "tuple[Figure, np.ndarray]":
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=size, layout="constrained", facecolor="white")
    FigureCanvasAgg(figure)
    return figure, figure.subplots(rows, columns, squeeze=False, **options)


def _written(figure: "Figure", path: Path) -> Path:
    with file_format.atomic_file(path) as temporary:
        figure.savefig(temporary, format=path.suffix[1:], dpi=130)
    return path


def _plain(axes: "Axes", title: str, x: str, y: str) -> None:
    axes.set_title(title, loc="left", fontsize=10, color=INK)
    axes.set_xlabel(x, fontsize=9, color=INK)
    axes.set_ylabel(y, fontsize=9, color=INK)
    axes.tick_params(labelsize=8, colors=INK)
    axes.spines[["top", "right"]].set_visible(False)
    axes.grid(True, color="#e6e6e6", linewidth=0.6)
    axes.set_axisbelow(True)


def _prediction_error(result: Comparison) -> "Figure":
    figure, axes = _figure(1, 4, (12.0, 3.3))
    shown = (
        ("position", "cm", 100.0),
        ("velocity", "m/s", 1.0),
        ("attitude", "deg", 180.0 / np.pi),
        ("rate", "rad/s", 1.0),
    )
    for panel, (quantity, unit, scale) in zip(axes[0], shown, strict=True):
        for colour, name in zip(_cycle(result.models), result.models, strict=True):
            values = scale * np.array(result.errors[name][quantity])
            panel.plot(HORIZONS_S, values, "o-", color=colour, label=name, markersize=5, linewidth=1.8)
        panel.set_xscale("log")
        panel.set_yscale("log")
        panel.set_xticks(HORIZONS_S, [f"{h:g}" for h in HORIZONS_S])
        panel.minorticks_off()
        _readable_log(panel)
        _plain(panel, quantity.capitalize(), "horizon (s)", f"error, rms ({unit})")
    axes[0, 0].legend(frameon=False, fontsize=9)
    names = ", ".join(f.name for f in result.flights)
    figure.suptitle(f"Open-loop prediction on {names} ({result.predictions} starts)", x=0.01, ha="left", fontsize=11)
    return figure


def _readable_log(axes: "Axes") -> None:
    """Ticks at 1, 2, 5 within the range, written plainly."""
    low, high = axes.get_ylim()
    low, high = min(low, high / 3.0), max(high, low * 3.0)
    decades = np.arange(np.floor(np.log10(low)), np.ceil(np.log10(high)) + 1)
    ticks = [t for d in decades for t in (10.0**d, 2 * 10.0**d, 5 * 10.0**d) if low <= t <= high]
    axes.set_ylim(low, high)
    axes.set_yticks(ticks, [f"{t:g}" for t in ticks])


def _residual_wrench(result: Comparison) -> "Figure":
    figure, axes = _figure(2, 3, (12.0, 5.4), sharex="col")
    for i, (panel, channel) in enumerate(zip(axes.ravel(), CHANNELS, strict=True)):
        scale, unit = (1.0, "N") if i < 3 else (1000.0, "mN m")
        for colour, name in zip(_cycle(result.models), result.models, strict=True):
            residual = result.residuals[name][0]
            smooth = scale * means_over(residual.wrench, residual.time_s, 0.1)[:, i]
            time_s = residual.time_s[0] + 0.1 * (np.arange(len(smooth)) + 0.5)
            panel.plot(time_s, smooth, color=colour, linewidth=1.0, label=f"{name}: {_rms(smooth):.2g} {unit}")
        panel.axhline(0.0, color=INK, linewidth=0.6)
        panel.legend(frameon=False, fontsize=8, loc="upper right")
        _plain(panel, channel.replace("_", " "), "time (s)" if i >= 3 else "", f"unexplained ({unit})")
    figure.suptitle(
        f"Force and torque the model does not explain, body axes, {result.flights[0].name} (means over 0.1 s)",
        x=0.01,
        ha="left",
        fontsize=11,
    )
    return figure


def _residual_against_speed(result: Comparison) -> "Figure":
    names = list(result.models)
    figure, axes = _figure(len(names), 3, (12.0, 2.7 * len(names)), sharex="col", sharey="col")
    for row, colour, name in zip(axes, _cycle(names), names, strict=True):
        force = np.concatenate([means_over(r.wrench[:, :3], r.time_s, 0.1) for r in result.residuals[name]])
        speed = np.concatenate([means_over(r.velocity_body_m_s, r.time_s, 0.1) for r in result.residuals[name]])
        for i, panel in enumerate(row):
            panel.plot(speed[:, i], force[:, i], ".", color=colour, alpha=0.25, markersize=4)
            centre, mean, error = binned(speed[:, i], force[:, i])
            panel.errorbar(centre, mean, 2.0 * error, color=INK, fmt="o-", markersize=3.5, linewidth=1.2, capsize=2)
            panel.axhline(0.0, color=INK, linewidth=0.6)
            last = row is axes[-1]
            label = f"velocity along body {'xyz'[i]} (m/s)" if last else ""
            _plain(panel, f"{name}: F {'xyz'[i]}", label, "unexplained force (N)" if i == 0 else "")
    figure.suptitle(
        "Unexplained force against air speed; a slope or curve is an effect the model lacks (bars: 2 standard errors)",
        x=0.01,
        ha="left",
        fontsize=11,
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


def _parameters(result: Identification) -> "Figure":
    free = [e for e in result.parameters if e.status == "free"]
    figure, axes = _figure(1, 2, (12.0, 0.32 * len(free) + 1.2))
    place = np.arange(len(free))[::-1]
    relative = np.array([e.std_robust / max(abs(e.value), 1e-300) for e in free])
    plain = np.array([e.std / max(abs(e.value), 1e-300) for e in free])
    axes[0, 0].barh(place, 100.0 * relative, color=COLOURS[1], height=0.7, label="robust")
    axes[0, 0].barh(place, 100.0 * plain, color="#9ec6d3", height=0.35, label="plain")
    axes[0, 0].set_xscale("log")
    axes[0, 0].set_yticks(place, [f"{e.name} = {e.value:.4g} {e.unit}" for e in free])
    axes[0, 0].legend(frameon=False, fontsize=8)
    _plain(axes[0, 0], "Standard error", "percent of the value", "")
    left = np.zeros(len(free))
    for i, flight in enumerate(result.flights):
        share = 100.0 * np.array([e.information[i] for e in free])
        axes[0, 1].barh(place, share, left=left, color=COLOURS[i % len(COLOURS)], height=0.7, label=flight.name)
        left += share
    axes[0, 1].set_yticks(place, [])
    axes[0, 1].legend(frameon=False, fontsize=8, loc="lower left", ncols=3, bbox_to_anchor=(0.0, 1.02))
    _plain(axes[0, 1], "", "information from each flight (%)", "")
    return figure


def _convergence(result: Identification) -> "Figure":
    record = result.solution.record
    figure, axes = _figure(1, 2, (10.0, 3.4))
    number = np.arange(1, len(record) + 1)
    axes[0, 0].semilogy(number, [max(i.step_sigma, 1e-6) for i in record], "o-", color=COLOURS[1], linewidth=1.6)
    axes[0, 0].axhline(0.05, color=INK, linewidth=0.8, linestyle="--")
    _plain(axes[0, 0], "Largest step of a parameter", "iteration", "standard errors")
    final = np.array([e.value for e in result.parameters if e.status == "free"])
    count = len(final)
    for i, name in enumerate(result.free_names):
        path = np.array([r.values[i] for r in record if len(r.values) >= count])
        if abs(final[i]) > 0.0 and not name.startswith("pose_sensor"):
            axes[0, 1].plot(np.arange(1, len(path) + 1), path / final[i], linewidth=1.2, label=name)
    axes[0, 1].legend(frameon=False, fontsize=6, loc="center left", bbox_to_anchor=(1.0, 0.5))
    _plain(axes[0, 1], "Parameters over their final value", "iteration", "ratio")
    return figure


def _correlation(result: Identification) -> "Figure":
    names = result.free_names
    size = 0.34 * len(names) + 2.6
    figure, axes = _figure(1, 1, (size + 1.0, size))
    panel = axes[0, 0]
    image = panel.imshow(result.correlation, vmin=-1.0, vmax=1.0, cmap="RdBu_r")
    panel.set_xticks(range(len(names)), names, rotation=90, fontsize=7)
    panel.set_yticks(range(len(names)), names, fontsize=7)
    panel.set_title("Correlation of the estimates", loc="left", fontsize=10)
    figure.colorbar(image, ax=panel, shrink=0.7)
    return figure


def _cycle(names: Any) -> Sequence[str]:
    return [COLOURS[i % len(COLOURS)] for i in range(len(names))]


def _rms(values: FloatArray) -> float:
    return float(np.sqrt((values**2).mean()))
