"""How all our figures are drawn: without a display, plain axes, written whole or not at all."""

from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from flight import file_format
from flight.rotations import FloatArray

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

COLOURS = ("#b0413e", "#1f6f8b", "#548c2f", "#8d5a97", "#c98a1b")
INK = "#2b2b2b"
PALE = "#cfd8dc"


def figure(
    rows: int,
    columns: int,
    size: tuple[float, float],
    layout: Literal["constrained"] | None = "constrained",
    **options: Any,
) -> "tuple[Figure, np.ndarray]":
    """A figure in inches and its axes (rows, columns)."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    drawn = Figure(figsize=size, layout=layout, facecolor="white")
    FigureCanvasAgg(drawn)
    return drawn, drawn.subplots(rows, columns, squeeze=False, **options)


def written(drawn: "Figure", path: Path) -> Path:
    """Save by the suffix of `path`; the same drawing makes the same file."""
    from matplotlib import rc_context

    kind = path.suffix[1:]
    with file_format.atomic_file(path) as temporary, rc_context({"svg.hashsalt": "goshawk"}):
        drawn.savefig(temporary, format=kind, dpi=130, metadata={"Date": None} if kind == "svg" else None)
    return path


def plain(axes: "Axes", title: str, x: str, y: str) -> None:
    """Title, labels and a quiet look."""
    axes.set_title(title, loc="left", fontsize=10, color=INK)
    axes.set_xlabel(x, fontsize=9, color=INK)
    axes.set_ylabel(y, fontsize=9, color=INK)
    axes.tick_params(labelsize=8, colors=INK)
    axes.spines[["top", "right"]].set_visible(False)
    axes.grid(True, color="#e6e6e6", linewidth=0.6)
    axes.set_axisbelow(True)


def headed(drawn: "Figure", sentence: str) -> None:
    """A heading over all panels."""
    drawn.suptitle(sentence, x=0.01, ha="left", fontsize=11)


def cycle(names: Iterable[Any]) -> Sequence[str]:
    """A colour for each."""
    return [COLOURS[i % len(COLOURS)] for i, _ in enumerate(names)]


def readable_log(axes: "Axes") -> None:
    """Ticks at 1, 2, 5 within the range, written plainly."""
    low, high = axes.get_ylim()
    low, high = min(low, high / 3.0), max(high, low * 3.0)
    decades = np.arange(np.floor(np.log10(low)), np.ceil(np.log10(high)) + 1)
    ticks = [t for d in decades for t in (10.0**d, 2 * 10.0**d, 5 * 10.0**d) if low <= t <= high]
    axes.set_ylim(low, high)
    axes.set_yticks(ticks, [f"{t:g}" for t in ticks])


def rms(values: FloatArray) -> float:
    return float(np.sqrt((values**2).mean()))


def binned(x: FloatArray, y: FloatArray, bins: int = 12) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Mean of y in bins of x with equally many samples, and its standard error: centres, means, errors."""
    order = np.argsort(x)
    parts = [p for p in np.array_split(order, bins) if len(p) > 1]
    centre = np.array([x[p].mean() for p in parts])
    mean = np.array([y[p].mean() for p in parts])
    error = np.array([y[p].std(ddof=1) / np.sqrt(len(p)) for p in parts])
    return centre, mean, error
