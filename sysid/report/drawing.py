"""How all our figures are drawn: without a display, plain axes, light or dark, written whole or not at all."""

from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from flight import InputError, file_format
from flight.rotations import FloatArray

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

DPI = 130
CELL_INK = "#2b2b2b"
"""What is written on pale cells, in either style."""
Style = Literal["light", "dark"]


@dataclass(frozen=True, slots=True)
class Look:
    """The colours of a style; curves keep a contrast of 3 to 1 with the paper."""

    paper: str
    ink: str
    pale: str
    """Bands and what stands back."""
    grid: str
    colours: tuple[str, ...]
    """Of curves, in their order."""


LOOKS: dict[str, Look] = {
    "light": Look("#ffffff", "#2b2b2b", "#cfd8dc", "#e6e6e6", ("#b0413e", "#1f6f8b", "#548c2f", "#8d5a97", "#c98a1b")),
    "dark": Look("#14181d", "#d5dbe1", "#3b444d", "#2a3138", ("#f0837d", "#54b3d6", "#8fcb63", "#c99bd4", "#ecb95a")),
}
_chosen: ContextVar[str] = ContextVar("style", default="light")


def look() -> Look:
    """The colours to draw with now."""
    return LOOKS[_chosen.get()]


@contextmanager
def styled(style: Style) -> Iterator[Look]:
    """Draw in this style, whatever Matplotlib's own settings are.

    Raises:
        InputError: there is no such style.
    """
    from matplotlib import rc_context, rcParamsDefault

    if style not in LOOKS:
        raise InputError(f"style {style!r} is not known; choose one of: {', '.join(LOOKS)}")
    here = LOOKS[style]
    inks = ("text.color", "axes.edgecolor", "axes.labelcolor", "axes.titlecolor", "xtick.color", "ytick.color")
    wanted: Any = {name: value for name, value in rcParamsDefault.items() if not name.startswith("backend")}
    wanted |= {"axes.facecolor": here.paper, "savefig.facecolor": "auto", **dict.fromkeys(inks, here.ink)}
    token = _chosen.set(style)
    try:
        with rc_context(wanted):
            yield here
    finally:
        _chosen.reset(token)


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

    drawn = Figure(figsize=size, layout=layout, facecolor=look().paper)
    FigureCanvasAgg(drawn)
    return drawn, drawn.subplots(rows, columns, squeeze=False, **options)


def written(drawn: "Figure", path: Path) -> Path:
    """Save by the suffix of `path`; the same drawing makes the same file."""
    from matplotlib import rc_context

    kind = path.suffix[1:]
    if (engine := drawn.get_layout_engine()) is not None:  # `savefig` would draw everything once more for its sake
        engine.execute(drawn)
        drawn.set_layout_engine(None)
    with file_format.atomic_file(path) as temporary, rc_context({"svg.hashsalt": "goshawk"}):
        drawn.savefig(temporary, format=kind, dpi=DPI, metadata={"Date": None} if kind == "svg" else None)
    return path


def plain(axes: "Axes", title: str, x: str, y: str) -> None:
    """Title, labels and a quiet look."""
    here = look()
    axes.set_title(title, loc="left", fontsize=10, color=here.ink)
    axes.set_xlabel(x, fontsize=9, color=here.ink)
    axes.set_ylabel(y, fontsize=9, color=here.ink)
    axes.tick_params(labelsize=8, colors=here.ink)
    axes.spines[["top", "right"]].set_visible(False)
    axes.grid(True, color=here.grid, linewidth=0.6)
    axes.set_axisbelow(True)


def headed(drawn: "Figure", sentence: str) -> None:
    """A heading over all panels."""
    drawn.suptitle(sentence, x=0.01, ha="left", fontsize=11)


def cycle(names: Iterable[Any]) -> Sequence[str]:
    """A colour for each."""
    colours = look().colours
    return [colours[i % len(colours)] for i, _ in enumerate(names)]


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
