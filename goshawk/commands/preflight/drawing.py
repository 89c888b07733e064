"""Pictures of a preflight as SVG text: from above, along the path, clearance over time, and histograms.

Colours are classes of page.css, so that one picture is light and dark.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from html import escape
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

import esdf
from flight import FloatArray, Trajectory
from preflight.worst import Replay, Track

WIDTH = 560.0
SHADES = 10
"""Colours of clearance, `s0` to `s9`; `sx` is a touch."""
PLENTY_M = 0.5
"""Clearance beyond the vehicle from which on the colour is the last one."""
_AROUND_M = 0.7
"""Room shown around the flights."""
_COLUMNS = 240
"""Of the section along the path."""
_MOST_CELLS = 300
"""Of a picture's side: finer maps are drawn coarser, an obstacle in any voxel shown."""
_OVERLAP = 0.05
"""Of a rectangle with the next, so that rounding leaves no gap between them."""
_BINS = 24
_FULL = 0.25
"""Share of the heights flown that an obstacle fills at least where it is drawn dark from above; others are light."""


@dataclass(frozen=True, slots=True)
class Frame:
    """Where two coordinates fall in a picture: `at` in pixels is `zero` + `scale` * value."""

    low: tuple[float, float]
    high: tuple[float, float]
    width: float
    height: float
    left: float = 44.0
    right: float = 10.0
    top: float = 10.0
    bottom: float = 40.0

    @property
    def scale(self) -> FloatArray:
        size = np.array([self.width - self.left - self.right, -(self.height - self.top - self.bottom)])
        return size / (np.array(self.high) - np.array(self.low))

    @property
    def zero(self) -> FloatArray:
        return np.array([self.left, self.height - self.bottom]) - self.scale * np.array(self.low)

    def at(self, x: FloatArray, y: FloatArray) -> str:
        """Points (n,) of a polyline."""
        placed = self.zero + self.scale * np.column_stack([x, y])
        return " ".join(f"{a:.1f},{b:.1f}" for a, b in placed)

    @property
    def moved(self) -> str:
        """A transform: what is inside has the frame's own units."""
        return f"translate({self.zero[0]:.3f} {self.zero[1]:.3f}) scale({self.scale[0]:.5f} {self.scale[1]:.5f})"

    @property
    def box(self) -> str:
        """The area of the data, as attributes."""
        return (
            f"x='{self.left}' y='{self.top}' width='{self.width - self.left - self.right:.1f}' "
            f"height='{self.height - self.top - self.bottom:.1f}'"
        )


def square(low: FloatArray, high: FloatArray, tallest: float = 470.0) -> Frame:
    """A frame with one scale for both axes; space is added where the picture would be too tall or too flat."""
    inner = WIDTH - 54.0
    size = np.maximum(high - low, 0.5)
    middle = 0.5 * (low + high)
    height = float(np.clip(inner * size[1] / size[0], 180.0, tallest))
    width_m = max(size[0], size[1] * inner / height)
    half = 0.5 * np.array([width_m, width_m * height / inner])
    (a, b), (c, d) = middle - half, middle + half
    return Frame((float(a), float(b)), (float(c), float(d)), WIDTH, height + 44.0)


def svg(frame: Frame, name: str, label: str, parts: Sequence[str], x: str, y: str) -> str:
    """A picture with its axes; `name` is for the page's script."""
    data = " ".join(
        f"data-{key}='{value:.5f}'"
        for key, value in zip(("x0", "y0", "sx", "sy"), (*frame.zero, *frame.scale), strict=True)
    )
    clip = f"<clipPath id='clip-{name}'><rect {frame.box}/></clipPath>"
    inner = f"<g clip-path='url(#clip-{name})'><rect class='ground' {frame.box}/>{''.join(parts)}</g>"
    view = f"viewBox='0 0 {frame.width:.0f} {frame.height:.0f}'"
    return (
        f"<svg id='{name}' {view} {data} role='img' aria-label='{escape(label, quote=True)}'>{clip}{inner}"
        f"{_axes(frame, x, y)}</svg>"
    )


def _axes(frame: Frame, x: str, y: str) -> str:
    parts = [f"<rect class='frame' {frame.box}/>"]
    bottom = frame.height - frame.bottom
    for value in ticks(frame.low[0], frame.high[0]):
        at = frame.zero[0] + frame.scale[0] * value
        parts.append(f"<text class='mid' x='{at:.1f}' y='{bottom + 14:.1f}'>{_number(value)}</text>")
    for value in ticks(frame.low[1], frame.high[1]):
        at = frame.zero[1] + frame.scale[1] * value
        parts.append(f"<text class='end' x='{frame.left - 5:.1f}' y='{at + 4:.1f}'>{_number(value)}</text>")
    middle = 0.5 * (frame.left + frame.width - frame.right)
    parts.append(f"<text class='mid' x='{middle:.1f}' y='{frame.height - 5:.1f}'>{escape(x)}</text>")
    side = 0.5 * (frame.top + bottom)
    turned = f"transform='rotate(-90 11 {side:.1f})'"
    return "".join(parts) + f"<text class='mid up' x='11' y='{side:.1f}' {turned}>{escape(y)}</text>"


def ticks(low: float, high: float, most: int = 6) -> FloatArray:
    """Round values between two, `most` at most, steps of 1, 2 or 5."""
    raw = (high - low) / most
    ten = 10.0 ** np.floor(np.log10(raw))
    step = next(ten * factor for factor in (1.0, 2.0, 5.0, 10.0) if ten * factor >= raw * (1.0 - 1e-9))
    return np.asarray(step * np.arange(np.ceil(low / step - 1e-9), np.floor(high / step + 1e-9) + 1), dtype=np.float64)


def _number(value: float) -> str:
    return f"{value + 0.0:.4g}".replace("-", "−")


def above(
    replay: Replay, trajectory: Trajectory, field: esdf.Field, tube_m: FloatArray, radius_m: float
) -> tuple[str, tuple[float, float]]:
    """The flights from above, and the heights between which the map is shown."""
    planned = trajectory.position(trajectory.sample(0.02))
    low, high = _seen_box(replay, planned, field)
    frame = square(low[:2], high[:2])
    z = np.quantile(planned[:, 2], (0.0, 1.0)) + np.array([-1.0, 1.0]) * max(radius_m, 0.2)
    tracks = [(t.position_world_m[:, 0], t.position_world_m[:, 1], t) for t in replay.bundle]
    worst = [(t.position_world_m[:, 0], t.position_world_m[:, 1], t) for t in replay.worst]
    middle = trajectory.position((np.arange(tube_m.shape[1]) + 0.5) * trajectory.duration_s / tube_m.shape[1])
    parts = [
        *_ground(field, frame, float(z[0]), float(z[1])),
        *_tube(frame, middle, tube_m),
        *_bundle(frame, tracks),
        f"<polyline class='plan' points='{frame.at(planned[:, 0], planned[:, 1])}'/>",
        *_worst(frame, worst),
        *_obstacles(frame, replay.worst, (0, 1)),
        "<line class='to'/><circle class='vehicle' r='4'/>",
    ]
    label = "The flights from above, coloured by clearance, with obstacles and the tracking tube"
    return svg(frame, "above", label, parts, "x (m)", "y (m)"), (float(z[0]), float(z[1]))


def _seen_box(replay: Replay, planned_world_m: FloatArray, field: esdf.Field) -> tuple[FloatArray, FloatArray]:
    """Lowest and highest corner of what is shown: the flights and some room, as far as the map goes."""
    flown = np.concatenate([track.position_world_m for track in (*replay.worst, *replay.bundle)])
    low, high = flown.min(axis=0) - _AROUND_M, flown.max(axis=0) + _AROUND_M
    low, high = np.maximum(low, field.grid.low_world_m), np.minimum(high, field.grid.high_world_m)
    return np.minimum(low, planned_world_m.min(axis=0) - 0.1), np.maximum(high, planned_world_m.max(axis=0) + 0.1)


def _ground(field: esdf.Field, frame: Frame, low_m: float, high_m: float) -> list[str]:
    """Obstacles and unknown space between two heights."""
    grid = field.grid
    region = grid.region((*frame.low, low_m), (*frame.high, high_m))
    state = field.state[region.slices]
    if state.size == 0:
        return []
    step = max(1, int(np.ceil(max(state.shape[:2]) / _MOST_CELLS)))
    filled = (state == esdf.OCCUPIED).mean(axis=2)
    occupied = _coarser(filled >= _FULL, step)
    partly = _coarser(filled > 0.0, step) & ~occupied
    unknown = _coarser((state == esdf.UNKNOWN).mean(axis=2) > 0.5, step) & ~occupied & ~partly
    cell = step * np.array(grid.voxel_m[:2])
    origin = grid.low_world_m[:2] + np.array(region.low[:2]) * np.array(grid.voxel_m[:2])
    known = f"M{origin[0]:.3f} {origin[1]:.3f}h{cell[0] * occupied.shape[0]:.3f}v{cell[1] * occupied.shape[1]:.3f}"
    outside = f"{known}H{origin[0]:.3f}z"
    return [
        f"<rect class='unknown' {frame.box}/>",
        f"<g transform='{frame.moved}'><path class='ground' d='{outside}'/>",
        f"<path class='unknown' d='{_rectangles(unknown, origin, cell)}'/>",
        f"<path class='partly' d='{_rectangles(partly, origin, cell)}'/>",
        f"<path class='occupied' d='{_rectangles(occupied, origin, cell)}'/></g>",
    ]


def _coarser(mask: NDArray[np.bool_], step: int) -> NDArray[np.bool_]:
    """Blocks of `step` by `step` cells: whether any is set."""
    rows, columns = (-(-n // step) * step for n in mask.shape)
    filled = np.zeros((rows, columns), bool)
    filled[: mask.shape[0], : mask.shape[1]] = mask
    blocks = filled.reshape(rows // step, step, columns // step, step)
    return np.asarray(blocks.any(axis=(1, 3)), dtype=np.bool_)


def _rectangles(mask: NDArray[np.bool_], origin: FloatArray, cell: FloatArray) -> str:
    """One rectangle for each run of set cells (i, j) along j, in the frame's units."""
    edges = np.diff(np.pad(mask, ((0, 0), (1, 1))).astype(np.int8), axis=1)
    found: list[str] = []
    for i, first, last in zip(np.nonzero(edges == 1)[0], np.nonzero(edges == 1)[1], np.nonzero(edges == -1)[1],
                              strict=True):  # fmt: skip
        x, y = origin + np.array([i, first]) * cell
        height = (last - first) * cell[1]
        width = (1.0 + _OVERLAP) * cell[0]
        found.append(f"M{x:.4f} {y:.3f}h{width:.4f}v{height:.3f}h{-width:.4f}z")
    return "".join(found)


def _tube(frame: Frame, middle_world_m: FloatArray, tube_m: FloatArray) -> list[str]:
    """The widths that 99 and 90 % of flights keep, from above."""
    parts: list[str] = []
    for kind, width_m in (("tube99", tube_m[2]), ("tube90", tube_m[1])):
        pieces = np.stack([middle_world_m[:-1], middle_world_m[1:]], axis=1)
        lines = [
            f"<polyline stroke-width='{2.0 * frame.scale[0] * width:.1f}' points='{frame.at(at[:, 0], at[:, 1])}'/>"
            for width, at in zip(width_m, pieces, strict=False)
            if np.isfinite(width)
        ]
        parts.append(f"<g class='{kind}'>{''.join(lines)}</g>")
    return parts


Curve = tuple[FloatArray, FloatArray, Track]
"""Abscissae, ordinates, and the flight they are of."""


def _bundle(frame: Frame, curves: Sequence[Curve]) -> list[str]:
    """Every curve in stretches of one colour of clearance, the nearest on top."""
    stretches: list[list[str]] = [[] for _ in range(SHADES + 1)]
    for x, y, track in curves:
        drawn = np.isfinite(y)  # off the path it has no place in some pictures
        shade = shades(track.clearance_m[drawn])
        for first, last in _stretches(shade):
            points = frame.at(x[drawn][first : last + 1], y[drawn][first : last + 1])
            stretches[shade[first]].append(points)
    return [
        "<g class='bundle'>"
        + "".join(
            f"<path class='{'sx' if i == 0 else f's{i - 1}'}' d='{''.join(f'M{points}' for points in found)}'/>"
            for i, found in reversed(list(enumerate(stretches)))
            if found
        )
        + "</g>"
    ]


def shades(clearance_m: FloatArray) -> NDArray[np.int64]:
    """(n,) 0 where it touches, then 1 to `SHADES` from the limit to plenty."""
    share = np.clip(np.nan_to_num(clearance_m, nan=np.inf, posinf=1e9) / PLENTY_M * SHADES, 0, SHADES - 1)
    return np.where(clearance_m < 0.0, 0, share.astype(np.int64) + 1)


def _stretches(shade: NDArray[np.int64]) -> Iterator[tuple[int, int]]:
    """First and last index of each stretch of one shade, the first of the next included."""
    if not len(shade):
        return
    edges = [0, *(np.flatnonzero(np.diff(shade)) + 1).tolist(), len(shade) - 1]
    yield from ((a, b) for a, b in pairwise(edges) if b > a)


def _worst(frame: Frame, curves: Sequence[Curve]) -> list[str]:
    return [
        f"<polyline class='worst{' on' if i == 0 else ''}' data-flight='{i}' points='{frame.at(x, y)}'/>"
        for i, (x, y, _) in enumerate(curves)
    ]


def _obstacles(frame: Frame, tracks: Sequence[Track], axes: tuple[int, int]) -> list[str]:
    """A ring where each of the worst came closest, and a cross at the obstacle."""
    parts: list[str] = []
    for i, track in enumerate(tracks):
        point = track.position_world_m[track.moment]
        x, y = frame.zero + frame.scale * point[list(axes)]
        on = " on" if i == 0 else ""
        parts.append(f"<circle class='ring{on}' data-flight='{i}' cx='{x:.1f}' cy='{y:.1f}' r='6'/>")
        if track.surface_world_m is not None:
            a, b = frame.zero + frame.scale * np.array(track.surface_world_m)[list(axes)]
            cross = f"M{a - 4:.1f} {b - 4:.1f}l8 8m0-8l-8 8"
            parts.append(f"<path class='cross{on}' data-flight='{i}' d='{cross}'/>")
    return parts


def side(replay: Replay, trajectory: Trajectory, field: esdf.Field, tube_m: FloatArray) -> str:
    """Height over time on the path, through the map unrolled along the plan."""
    times = (np.arange(_COLUMNS) + 0.5) * trajectory.duration_s / _COLUMNS
    planned = trajectory.position(times)
    low, high = _seen_box(replay, planned, field)
    frame = Frame((0.0, float(low[2])), (trajectory.duration_s, float(high[2])), WIDTH, 250.0)
    bins = tube_m.shape[1]
    middle_s = (np.arange(bins) + 0.5) * trajectory.duration_s / bins
    height = trajectory.position(middle_s)[:, 2]
    parts = [
        f"<rect class='unknown' {frame.box}/>",
        f"<g transform='{frame.moved}'>{_curtain(field, planned, trajectory.duration_s, frame)}</g>",
        *(
            f"<polygon class='{kind}' points='{_band(frame, middle_s, height, width)}'/>"
            for kind, width in (("tube99", tube_m[2]), ("tube90", tube_m[1]))
        ),
        *_bundle(frame, [(t.path_s, np.where(t.on_path, t.position_world_m[:, 2], np.nan), t) for t in replay.bundle]),
        f"<polyline class='plan' points='{frame.at(times, planned[:, 2])}'/>",
        *_worst(frame, [(t.path_s, t.position_world_m[:, 2], t) for t in replay.worst]),
        "<line class='cursor'/><circle class='vehicle' r='4'/>",
    ]
    label = "Height of the flights over time on the path, through the map unrolled along it"
    return svg(frame, "side", label, parts, "time on the path (s)", "z (m)")


def _curtain(field: esdf.Field, planned_world_m: FloatArray, duration_s: float, frame: Frame) -> str:
    """What the map holds above and below each place of the plan."""
    grid = field.grid
    region = grid.region((*grid.low_world_m[:2], frame.low[1]), (*grid.high_world_m[:2], frame.high[1]))
    heights = grid.axis_centres(2, region)
    if not heights.size:
        return ""
    points = np.concatenate(
        [np.repeat(planned_world_m[:, None, :2], heights.size, axis=1),
         np.broadcast_to(heights[None, :, None], (len(planned_world_m), heights.size, 1))], axis=2,
    )  # fmt: skip
    inside = grid.contains(points)
    index = np.clip(grid.index(points.reshape(-1, 3)), 0, np.array(grid.shape) - 1)
    state = np.where(inside, field.state[tuple(index.T)].reshape(inside.shape), esdf.UNKNOWN)
    origin = np.array([0.0, heights[0] - 0.5 * grid.voxel_m[2]])
    cell = np.array([duration_s / len(planned_world_m), grid.voxel_m[2]])
    drawn = ((esdf.FREE, "ground"), (esdf.OCCUPIED, "occupied"))
    return "".join(f"<path class='{kind}' d='{_rectangles(state == which, origin, cell)}'/>" for which, kind in drawn)


def _band(frame: Frame, times: FloatArray, height_m: FloatArray, width_m: FloatArray) -> str:
    known = np.isfinite(width_m)
    times, height_m, width_m = times[known], height_m[known], width_m[known]
    edge = np.concatenate([height_m + width_m, (height_m - width_m)[::-1]])
    return frame.at(np.concatenate([times, times[::-1]]), edge)


def over_time(replay: Replay, trajectory: Trajectory) -> str:
    """Clearance of each flight over time on the path."""
    least = min(float(t.clearance_m.min()) for t in (*replay.worst, *replay.bundle))
    frame = Frame((0.0, min(least, 0.0) - 0.1), (trajectory.duration_s, 1.0), WIDTH, 210.0)
    x0, x1 = frame.left, frame.width - frame.right
    zero = frame.zero[1]
    parts = [
        f"<rect class='below' x='{x0}' width='{x1 - x0:.1f}' y='{zero:.1f}' height='{frame.height - zero:.1f}'/>",
        *_bundle(frame, [(t.path_s, np.where(t.on_path, _seen(t), np.nan), t) for t in replay.bundle]),
        *_worst(frame, [(t.path_s, _seen(t), t) for t in replay.worst]),
        f"<line class='limit' x1='{x0}' x2='{x1:.1f}' y1='{zero:.1f}' y2='{zero:.1f}'/>",
        "<line class='cursor'/><circle class='vehicle' r='4'/>",
    ]
    label = "Clearance beyond the vehicle over time on the path"
    return svg(frame, "clearance", label, parts, "time on the path (s)", "clearance (m)")


def _seen(track: Track) -> FloatArray:
    """Clearance; what is far off the picture stays just off it."""
    return np.minimum(track.clearance_m, 2.0)


def histogram(
    name: str,
    title: str,
    unit: str,
    values: FloatArray,
    limit: float | None,
    *,
    bad_above: bool,
    most: float = np.inf,
) -> str:
    """How often each value came, those beyond the limit in the colour of danger.

    Args:
        values: (n,) those that are not finite are left out.
        limit: an edge between two bars where it is in the picture.
        most: values above it are in the last bar, and the axis says so.
    """
    known = values[np.isfinite(values)]
    if not known.size:
        return ""
    finite = np.minimum(known, most)
    edges = _edges(finite, limit, bad_above)
    counts, _ = np.histogram(finite, edges)
    frame = Frame((float(edges[0]), 0.0), (float(edges[-1]), float(counts.max()) * 1.08), 280.0, 150.0)
    parts: list[str] = []
    for count, a, b in zip(counts, edges[:-1], edges[1:], strict=True):
        beyond = limit is not None and (a >= limit if bad_above else b <= limit)
        x, y = frame.zero + frame.scale * np.array([a, count])
        width, height = frame.scale[0] * (b - a) - 1.0, frame.zero[1] - y
        kind = "bar bad" if beyond else "bar"
        said = f"<title>{count}</title>"
        parts.append(
            f"<rect class='{kind}' x='{x:.1f}' y='{y:.1f}' width='{width:.1f}' height='{height:.1f}'>{said}</rect>"
        )
    if limit is not None and edges[0] <= limit <= edges[-1]:
        x = frame.zero[0] + frame.scale[0] * limit
        parts.append(f"<line class='limit' x1='{x:.1f}' x2='{x:.1f}' y1='{frame.top}' y2='{frame.zero[1]:.1f}'/>")
    more = "" if known.max() <= most else f"; last bar: {edges[np.searchsorted(edges, most, 'right') - 1]:.3g} and more"
    return svg(frame, name, f"Histogram of {title}", parts, f"{title} ({unit}{more})", "flights")


def _edges(finite: FloatArray, limit: float | None, bad_above: bool) -> FloatArray:
    """Of `_BINS` bars or one more, with some room beside; the limit is one of them unless it is far off."""
    low, high = (float(v) for v in (finite.min(), finite.max()))
    if limit is not None and abs(limit - (high if bad_above else low)) < 1.5 * max(high - low, 1e-9):
        low, high = min(low, limit), max(high, limit)
    room = 0.05 * (high - low) or 0.05 * abs(high) or 1.0
    low, high = low - room, high + room
    if limit is None or not low <= limit <= high:
        return np.linspace(low, high, _BINS + 1)
    width = (high - low) / _BINS
    first, last = np.floor((low - limit) / width), np.ceil((high - limit) / width)
    return np.asarray(limit + width * np.arange(first, last + 1), dtype=np.float64)
