"""Draws docs/pictures/map_plan_fly_learn.svg from the files of a demo: map, plan, two flights, the error that falls.

    goshawk demo --out demo-out
    python tools/moving_picture.py demo-out docs/pictures/map_plan_fly_learn.svg

An animated SVG without scripts, so that it also moves where a page shows it as a picture. A viewer that does not
animate shows all but the captions at once.
"""

import base64
import sys
from dataclasses import dataclass
from pathlib import Path

import numpy as np

import mapping
from firmware_bridge.airborne import tracking
from firmware_bridge.controller import State
from flight import FloatArray, flight_log, project, trajectory
from flight.file_format import write_bytes

LOOP_S = 16.0
MAP, PLAN, FIRST, SECOND, REST = (0.0, 0.16), (0.18, 0.36), (0.38, 0.60), (0.66, 0.88), 0.98
"""Begin and end of each scene as shares of the loop."""
WIDTH, HEIGHT, PLOT_X, PLOT_WIDTH, TOP, BOTTOM = 960, 410, 490, 450, 80, 350
FREE, SOLID, UNKNOWN = (244, 246, 248), (84, 96, 110), (212, 217, 223)
BLUE, RED, GREEN = "#1f6f8b", "#c8452c", "#2e8b57"


@dataclass(frozen=True, slots=True)
class Flown:
    """One flight along the trajectory."""

    path_world_m: FloatArray
    """(n, 3), equally spaced in time."""
    error_m: FloatArray
    """(n,) distance to the set-point."""
    time_s: FloatArray
    """(n,) from the trajectory's start."""
    mean_error_m: float
    """Over all of the trajectory, not only the n moments."""


def flown(path: Path, samples: int = 90) -> Flown:
    log = flight_log.load(path)
    rows = np.flatnonzero(log.columns["mission_state"] == State.TRAJECTORY)
    rows = rows[np.linspace(0, len(rows) - 1, samples).round().astype(int)]
    here, wanted = log.vector("position_world_m")[rows], log.vector("setpoint_position_world_m")[rows]
    error_m = np.linalg.norm(here - wanted, axis=1)
    return Flown(here, error_m, log.time_s[rows] - log.time_s[rows[0]], tracking(log)["tracking_mean_m"])


class Plan:
    """Where a point of the world lies in the picture, seen from above."""

    def __init__(self, low_m: FloatArray, high_m: FloatArray) -> None:
        self.low, self.high = low_m, high_m
        self.scale = min((PLOT_X - 100) / (high_m - low_m)[0], (BOTTOM - TOP + 40) / (high_m - low_m)[1])

    def __call__(self, points_world_m: FloatArray) -> FloatArray:
        x = 20.0 + self.scale * (points_world_m[:, 0] - self.low[0])
        y = TOP - 10.0 + self.scale * (self.high[1] - points_world_m[:, 1])
        return np.stack([x, y], axis=1)


def slice_png(area: mapping.Map, height_m: float) -> tuple[str, FloatArray, FloatArray]:
    """What is free, solid and unknown at a height, as base64 PNG, with its lower and upper corner."""
    import cv2

    grid = area.field.grid
    level = int(np.argmin(np.abs(grid.axis_centres(2) - height_m)))
    state = area.field.state[:, :, level]
    pixels = np.array([UNKNOWN, FREE, SOLID], dtype=np.uint8)[_rank(state)]
    picture = np.ascontiguousarray(np.swapaxes(pixels, 0, 1)[::-1, :, ::-1])  # north up, and OpenCV's colour order
    done, data = cv2.imencode(".png", picture)
    assert done
    low = np.asarray(grid.low_world_m)
    return base64.b64encode(data.tobytes()).decode(), low, low + np.array(grid.shape) * np.array(grid.voxel_m)


def _rank(state: np.ndarray) -> np.ndarray:
    """0 unknown, 1 free, 2 solid."""
    import esdf

    return np.select([state == esdf.FREE, state == esdf.OCCUPIED], [1, 2], 0)


# -- SVG ---------------------------------------------------------------------------------------------------------------


def line(points: FloatArray) -> str:
    return "M" + "L".join(f"{x:.1f} {y:.1f}" for x, y in points)


def animate(attribute: str, values: list[object], shares: list[float]) -> str:
    keys = ";".join(f"{share:.4f}" for share in shares)
    return (
        f'<animate attributeName="{attribute}" dur="{LOOP_S:g}s" repeatCount="indefinite" '
        f'values="{";".join(map(str, values))}" keyTimes="{keys}"/>'
    )


def shown(begin: float, end: float = REST) -> str:
    """Fade in at the begin, out at the end."""
    begin = max(begin, 0.01)
    return animate("opacity", [0, 0, 1, 1, 0, 0], [0.0, begin - 0.01, begin, end, min(end + 0.015, 0.999), 1.0])


def drawn(path: str, colour: str, scene: tuple[float, float], width: float) -> str:
    """A line that grows during its scene."""
    grow = animate("stroke-dashoffset", [1, 1, 0, 0], [0.0, scene[0], scene[1], 1.0])
    return (
        f'<path d="{path}" pathLength="1" stroke-dasharray="1" fill="none" stroke="{colour}" stroke-width="{width}" '
        f'stroke-linejoin="round">{grow}{shown(scene[0])}</path>'
    )


def vehicle(points: FloatArray, colour: str, scene: tuple[float, float]) -> str:
    """A dot that flies along the points during its scene, at the pace of the log."""
    shares = [0.0, *np.linspace(*scene, len(points)).tolist(), 1.0]
    places = np.concatenate([points[:1], points, points[-1:]])
    values = [[f"{v:.1f}" for v in places[:, axis]] for axis in (0, 1)]
    moves = "".join(animate(name, [*v], shares) for name, v in zip(("cx", "cy"), values, strict=True))
    return f'<circle r="6" fill="{colour}" stroke="#fff" stroke-width="1.5">{moves}{shown(*scene)}</circle>'


def caption(words: str, begin: float, end: float) -> str:
    fade = shown(begin, end)
    return f'<text x="20" y="36" font-size="20" font-weight="600" opacity="0">{words}{fade}</text>'


def axes(most_mm: float, longest_s: float) -> str:
    marks = []
    for share in (0.0, 0.5, 1.0):
        y = BOTTOM - share * (BOTTOM - TOP)
        marks.append(f'<path d="M{PLOT_X} {y:.1f}h{PLOT_WIDTH}" stroke="#dde2e7"/>')
        marks.append(f'<text x="{PLOT_X - 8}" y="{y + 4:.1f}" text-anchor="end">{share * most_mm:.0f}</text>')
    marks.append(f'<text x="{PLOT_X}" y="{TOP - 16}">tracking error (mm)</text>')
    marks.append(f'<text x="{PLOT_X + PLOT_WIDTH}" y="{BOTTOM + 22}" text-anchor="end">{longest_s:.1f} s</text>')
    return "".join(marks)


def picture(demo: Path) -> str:
    opened = project.open_project(demo)
    item = trajectory.load(opened.trajectory("walk"))
    first, second = flown(opened.flight("walk")), flown(opened.flight("walk-learned"))
    png, low, high = slice_png(mapping.open_map(opened.map), float(first.path_world_m[:, 2].mean()))
    place = Plan(low, high)
    corner, opposite = place(np.array([[low[0], high[1], 0.0], [high[0], low[1], 0.0]]))
    most_mm = float(np.ceil(1000.0 * first.error_m.max() / 50.0) * 50.0)
    planned_s = item.trajectory.duration_s
    longest_s = float(max(first.time_s[-1], second.time_s[-1]))  # a vehicle that falls behind is slowed down

    def curve(flight: Flown) -> str:
        x = PLOT_X + PLOT_WIDTH * flight.time_s / longest_s
        return line(np.stack([x, BOTTOM - (BOTTOM - TOP) * 1000.0 * flight.error_m / most_mm], axis=1))

    def result(flight: Flown, words: str, colour: str, row: int, scene: tuple[float, float]) -> str:
        said = f"{words}: {1000.0 * flight.mean_error_m:.0f} mm mean"
        y = BOTTOM + 22 + 20 * row
        return f'<text x="{PLOT_X}" y="{y}" fill="{colour}" font-weight="600">{said}{shown(scene[1])}</text>'

    planned = line(place(item.trajectory.position(item.trajectory.sample(0.05))))
    size = opposite - corner
    grow = animate("width", [0, f"{size[0]:.0f}", f"{size[0]:.0f}"], [0.0, MAP[1], 1.0])
    place_and_size = f'x="{corner[0]:.1f}" y="{corner[1]:.1f}" width="{size[0]:.1f}" height="{size[1]:.1f}"'
    clip = f'<clipPath id="seen"><rect {place_and_size}>{grow}</rect></clipPath>'
    parts = [
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH} {HEIGHT}" font-family="sans-serif" '
        f'font-size="13" fill="#26303a">',
        "<title>Map, plan, flight, and the tracking error that falls after learning</title>",
        f'<rect width="{WIDTH}" height="{HEIGHT}" rx="8" fill="#fff"/>{clip}',
        f'<image {place_and_size} preserveAspectRatio="none" style="image-rendering:pixelated" '
        f'clip-path="url(#seen)" href="data:image/png;base64,{png}"/>',
        axes(most_mm, longest_s),
        drawn(planned, BLUE, PLAN, 3.0),
        drawn(line(place(first.path_world_m)), RED, FIRST, 1.6),
        drawn(line(place(second.path_world_m)), GREEN, SECOND, 1.6),
        drawn(curve(first), RED, FIRST, 2.2),
        drawn(curve(second), GREEN, SECOND, 2.2),
        result(first, "as believed at first", RED, 0, FIRST),
        result(second, "with what was learned", GREEN, 1, SECOND),
        vehicle(place(first.path_world_m), RED, FIRST),
        vehicle(place(second.path_world_m), GREEN, SECOND),
        caption("1 Map: camera images to free, solid, unknown", MAP[0], PLAN[0] - 0.03),
        caption(f"2 Plan: {planned_s:.1f} s, clearance proven over the whole curve", PLAN[0], FIRST[0] - 0.03),
        caption("3 Fly: the embedded C controller, a simulated body", FIRST[0], SECOND[0] - 0.06),
        caption("4 Learn from the logs, fly again", SECOND[0] - 0.04, REST),
        "</svg>",
    ]
    return "\n".join(parts) + "\n"


def main() -> int:
    if len(sys.argv) != 3:
        print(f"usage: {(__doc__ or '').splitlines()[3].strip()}", file=sys.stderr)
        return 2
    write_bytes(Path(sys.argv[2]), picture(Path(sys.argv[1])).encode())
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
