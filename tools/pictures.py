"""Rebuilds docs/pictures: `make pictures`; `python -m tools.pictures DEMO NAME ...` for some of them.

DEMO is the folder of a finished `goshawk demo`. What is drawn in both styles is written as NAME_light.png and
NAME_dark.png; every file stays below 150 kB, so that a page loads at once.
"""

import functools
import io
import runpy
import subprocess
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any, get_args

import numpy as np
from matplotlib.figure import Figure
from PIL import Image

import mapping
from esdf import pictures
from flight import FlightError, InputError, file_format, flight_log, project, trajectory
from goshawk import plot
from goshawk.plot import flights, maps, plans
from sysid.report import diagnosis_figures, drawing
from tools import manoeuvre_picture, mesh_picture, page_pictures

ROOT = Path(__file__).parents[1]
OUT = ROOT / "docs" / "pictures"
MOST_BYTES = 150_000
EXAMPLES = {
    "01_distance_field": "distance_field.png",
    "02_plan_through_pillars": "plan.png",
    "03_fly_and_learn": "learn.png",
    "04_back_into_the_air": "again.png",
    "06_laps_round_a_statue": "mission.png",
    "07_gates_and_a_tube": "gates.png",
    "08_after_the_papers_flights": "walk.png",
    "09_learn_a_betaflight": "learnt.png",
}
"""Example to the picture of it in the gallery; 05 has `error_falls`."""
SCRIPTS = {
    "mixer_initial_value": ("docs/evidence/studies/mixer_fit.py",),
    "identification_cost": ("benchmarks/identification_chart.py", "docs/pictures/identification_cost.svg"),
    "disturbances": ("benchmarks/controller_worlds.py", "--picture", "docs/pictures/disturbances.svg"),
    "ladder": ("benchmarks/ladder.py", "--figure", "docs/pictures/ladder.svg"),
}
"""SVG to the script that measures and draws it, and its arguments; the last two take minutes."""


def hero(demo: Path, style: drawing.Style) -> Figure:
    """Image, map, plan and the error that falls: what the demo leaves in its folder."""
    opened = project.open_project(demo)
    area, item = mapping.open_map(opened.map), trajectory.load(opened.trajectory("walk"))
    path = item.trajectory
    with drawing.styled(style) as look:
        figure, axes = drawing.figure(1, 4, (11.5, 2.9), width_ratios=[1.0, 1.0, 1.0, 1.1])
        image, sliced, above, error = axes[0]
        frames = sorted((demo / "rendered" / "front").glob("*.png"))
        image.imshow(_square(Image.open(frames[len(frames) // 2]).convert("L")), cmap="gray")
        image.set_axis_off()
        height_m = float(np.median(path.position(path.sample(0.1))[:, 2]))
        slice_ = pictures.axis_slice(area.field, "z", height_m)
        maps.draw_slice(sliced, slice_)
        colours = [look.colours[1]] * len(path.durations_s)
        plans.from_above(above, path, colours, item.waypoints_world_m, None, numbered=False)
        both = {"first model": "walk", "learned model": "walk-learned"}
        flights.draw_tracking(error, {label: flight_log.load(opened.flight(name)) for label, name in both.items()})
        left, right, bottom, top = slice_.extent_m
        maps.behind(above, area.field, np.array([left, bottom]), np.array([right, top]), height_m)
        for panel in (sliced, above):
            panel.tick_params(labelsize=8)
            panel.set(xlabel="x (m)", ylabel="y (m)", aspect="equal", xlim=(left, right), ylim=(bottom, top))
        error.set(ylabel="distance to the set-point (mm)", xlabel="time (s)")
        titles = (
            "1 images",
            "2 distance field",
            f"3 plan: {path.duration_s:.1f} s",
            "4 fly, learn, fly again",
        )
        for panel, title in zip(axes[0], titles, strict=True):
            panel.set_title(title, loc="left", fontsize=11)
    return figure


def _square(image: Image.Image) -> Image.Image:
    spare = (image.width - image.height) // 2
    return image.crop((spare, 0, spare + image.height, image.height))


def the_map(demo: Path, style: drawing.Style) -> Figure:
    area = mapping.open_map(project.open_project(demo).map)
    middle = 0.5 * (area.field.grid.low_world_m + area.field.grid.high_world_m)
    return plot.map_slice(area.field, round(float(middle[2]), 1), style=style)


def plan(_: Path, style: drawing.Style) -> Figure:
    made = example("02_plan_through_pillars")
    return plot.plan(made["plan"], made["kestrel"], made["forest"], style=style)


def error_falls(_: Path, style: drawing.Style) -> Figure:
    with drawing.styled(style):
        return diagnosis_figures.staircase(found())


def diagnosis(_: Path, style: drawing.Style) -> Figure:
    with drawing.styled(style):
        return diagnosis_figures.evidence_for(found(), diagnosis_figures.leading(found())[0])


@functools.cache
def example(name: str) -> dict[str, Any]:
    """What an example leaves in its namespace; its own files are thrown away."""
    before = sys.argv
    with tempfile.TemporaryDirectory() as folder:
        sys.argv = [name, folder]
        try:
            return runpy.run_path(str(ROOT / "examples" / f"{name}.py"))
        finally:
            sys.argv = before


@functools.cache
def found() -> Any:
    return example("05_find_a_missing_effect")["diagnosis"]()


def manoeuvres(_: Path, style: drawing.Style) -> Figure:
    return manoeuvre_picture.draw(style)


STYLED: dict[str, Callable[[Path, drawing.Style], Figure]] = {
    "hero": hero,
    "map": the_map,
    "plan": plan,
    "error_falls": error_falls,
    "diagnosis": diagnosis,
    "manoeuvres": manoeuvres,
}


def small(image: Image.Image) -> bytes:
    """A PNG of as many colours as keep it below `MOST_BYTES`, at most 256.

    Raises:
        InputError: even 16 colours take more.
    """
    for colours in (256, 128, 64, 32, 16):
        data = io.BytesIO()
        image.convert("RGB").quantize(colours, dither=Image.Dither.NONE).save(data, "PNG", optimize=True)
        if data.tell() < MOST_BYTES:
            return data.getvalue()
    raise InputError(f"a picture of {image.width} x {image.height} pixels is above {MOST_BYTES} bytes; draw it smaller")


def write(name: str, image: Image.Image) -> None:
    keep(f"{name}.png", small(image))


def keep(name: str, data: bytes) -> None:
    file_format.write_bytes(OUT / name, data)
    print(f"{name}  {len(data) / 1000.0:.0f} kB")


def drawn(figure: Figure) -> Image.Image:
    data = io.BytesIO()
    figure.savefig(data, format="png", dpi=drawing.DPI)
    return Image.open(data)


def rebuild(name: str, demo: Path) -> None:
    if name in STYLED:
        for style in get_args(drawing.Style):
            write(f"{name}_{style}", drawn(STYLED[name](demo, style)))
    elif name == "mesh_textured":
        write(name, mesh_picture.before_and_after(demo))
    elif name in EXAMPLES:
        with tempfile.TemporaryDirectory() as folder:
            subprocess.run([sys.executable, ROOT / "examples" / f"{name}.py", folder], check=True)
            write(f"examples/{name}", Image.open(Path(folder) / EXAMPLES[name]))
    elif name in SCRIPTS:
        subprocess.run([sys.executable, *SCRIPTS[name]], cwd=ROOT, check=True)
    else:
        for shot, image in page_pictures.shots(demo, name):
            data = io.BytesIO()
            image.convert("RGB").save(data, "WEBP", quality=80, method=6)  # few colours would cost the path its own
            keep(f"{shot}.webp", data.getvalue())


NAMES = (*STYLED, "mesh_textured", *EXAMPLES, *page_pictures.NAMES, *SCRIPTS)


def main() -> int:
    if len(sys.argv) < 2 or not Path(sys.argv[1]).is_dir() or set(sys.argv[2:]) - set(NAMES):
        print(f"usage: python -m tools.pictures DEMO [NAME ...]\nnames: {', '.join(NAMES)}", file=sys.stderr)
        return 2
    failed = [name for name in sys.argv[2:] or NAMES if not _rebuilt(name, Path(sys.argv[1]))]
    if failed:
        print(f"not rebuilt; again with: python -m tools.pictures {sys.argv[1]} {' '.join(failed)}", file=sys.stderr)
    return 1 if failed else 0


def _rebuilt(name: str, demo: Path) -> bool:
    """Whether it could be: half an hour of others is not lost to a refused scene, or to a link on a busy machine."""
    try:
        rebuild(name, demo)
    except (FlightError, OSError, subprocess.SubprocessError) as error:
        print(f"{name}: {error}", file=sys.stderr)
        return False
    return True


if __name__ == "__main__":
    raise SystemExit(main())
