"""`goshawk map edit`: a pilot's edits of a map, saved with it and replayed on every rebuild."""

import math
from collections.abc import Callable, Iterable
from dataclasses import asdict
from pathlib import Path
from typing import Any

import click
import numpy as np

import esdf
from esdf import Edit, Editor, Field, pictures, solids
from esdf.edits import difference
from esdf.storage import EDITS
from flight import InputError, results
from goshawk.commands.map.show_esdf import field_folder
from goshawk.terminal import console, outputs
from goshawk.terminal.verbs import VerbGroup

DIMENSIONS = {
    # shape: what its numbers are (None: as many as it likes), in the words of --help
    "box": (6, "X,Y,Z,X,Y,Z: two opposite corners."),
    "turned-box": (7, "X,Y,Z,DX,DY,DZ,DEGREES: centre, edges, turned about the vertical."),
    "sphere": (4, "X,Y,Z,RADIUS."),
    "cylinder": (5, "X,Y,Z,RADIUS,HEIGHT: upright; the middle of its axis."),
    "capsule": (7, "X,Y,Z,X,Y,Z,RADIUS: a cable or beam between two points."),
    "prism": (None, "ZLOW,ZHIGH,X,Y,X,Y,X,Y...: an upright column over a polygon."),
    "stroke": (None, "RADIUS,X,Y,Z,X,Y,Z...: a brush along a line."),
    "outside": (6, "X,Y,Z,X,Y,Z: everything outside this box; to keep flights in it."),
}


_map_argument = click.argument("map_folder", metavar="MAP", type=click.Path(path_type=Path))


@click.group(cls=VerbGroup)
def edit() -> None:
    """Edit a map by hand: missing obstacles, no-fly zones, mapping errors.

    \b
    goshawk map edit add map --box 1,0,0,2,0.4,1.1 --name workbench
    goshawk map edit no-fly map kitchen --prism 0,2.5,3,0,5,0,5,4 --preview kitchen.png
    goshawk map edit remove map --sphere 2,1,1.2,0.3
    goshawk map edit list map
    goshawk map edit undo map

    Coordinates are in metres in the world frame. Edits are a list beside the map: the mapped voxels stay unchanged, and
    a rebuilt map in the same folder keeps them. They change the map's hash, so earlier plans must be made anew.
    """


def shape_options(command: Callable[..., None]) -> Callable[..., None]:
    """An option for each shape of `solid_from`."""
    for name, (_, words) in reversed(DIMENSIONS.items()):
        command = click.option(f"--{name}", metavar="NUMBERS", help=words)(command)
    return command


def _finish(command: Callable[..., None]) -> Callable[..., None]:
    preview = console.path_option("--preview", "preview", "Draw before and after to this PNG, and change nothing.")
    return preview(outputs.overwrite_option(console.common_options(command)))


def _changing(action: Any, summary: str) -> None:
    """A sub-verb that appends an edit of this action to the list."""

    def command(
        map_folder: Path, name: str, preview: Path | None, overwrite: bool, as_json: bool, **shapes: str | None
    ) -> None:
        folder, new = field_folder(map_folder), Edit(action, solid_from(shapes), name)
        editor = esdf.open_editor(folder)
        _change(folder, editor, lambda: editor.apply(new), preview, overwrite, as_json)

    named = (
        click.argument("name")
        if action == "no-fly"
        else click.option("--name", default="", help="Name: drop removes the edit by it.")
    )
    example = "no-fly map kitchen" if action == "no-fly" else f"{action} map"
    help = f"{summary}\n\n\b\ngoshawk map edit {example} --box 1,0,0,2,0.4,1.1\ngoshawk map edit list map"
    edit.command(action, help=help)(_map_argument(named(shape_options(_finish(command)))))


_changing("add", "Every voxel the shape touches becomes an obstacle.")
_changing(
    "remove",
    "Every voxel whose centre is inside becomes free, even if unknown: only for space that you know to be free.",
)
_changing("clear", "Mapped obstacles inside become free; unknown voxels stay unknown.")
_changing("no-fly", "A zone that counts as an obstacle and that no other edit frees; drop removes it by its NAME.")


@edit.command()
@_map_argument
@_finish
def undo(map_folder: Path, preview: Path | None, overwrite: bool, as_json: bool) -> None:
    """Remove the last edit from the list.

    \b
    goshawk map edit undo map
    goshawk map edit undo map --preview undone.png
    """
    folder = field_folder(map_folder)
    editor = esdf.open_editor(folder)
    if not editor.edits:
        raise InputError(f"{folder} has no edits; there is nothing to undo")
    _change(folder, editor, lambda: editor.replace(editor.edits[:-1]), preview, overwrite, as_json)


@edit.command()
@_map_argument
@click.argument("name")
@_finish
def drop(map_folder: Path, name: str, preview: Path | None, overwrite: bool, as_json: bool) -> None:
    """Remove every edit of that NAME from the list.

    \b
    goshawk map edit drop map kitchen
    goshawk map edit list map
    """
    folder = field_folder(map_folder)
    editor = esdf.open_editor(folder)
    _change(folder, editor, lambda: editor.drop(name), preview, overwrite, as_json)


@edit.command("list")
@_map_argument
@console.common_options
def list_(map_folder: Path, as_json: bool) -> None:
    """List the present edits, in the order in which they were made.

    \b
    goshawk map edit list map
    goshawk map edit list map --json
    """
    folder = field_folder(map_folder)
    edits = esdf.open_editor(folder).edits
    document = {"edits": [{"action": e.action, "name": e.name, **_described(e)} for e in edits]}
    if as_json:
        console.show("", {}, as_json=True, document=document)
    elif not edits:
        click.echo(f"{folder}: no edits")
    else:
        rows = [
            (number, e.action, e.name, type(e.solid).__name__, _dimensions(e))
            for number, e in enumerate(edits, start=1)
        ]
        console.table(f"edits of {folder}", ("", "action", "name", "shape", "dimensions"), rows)


def solid_from(shapes: dict[str, str | None]) -> solids.Solid:
    """The one shape that was given.

    Raises:
        InputError: none or several were given, or the numbers do not make one.
    """
    given = [(name.replace("_", "-"), text) for name, text in shapes.items() if text is not None]
    if len(given) != 1:
        raise InputError(f"give one shape: {', '.join(f'--{name}' for name in DIMENSIONS)}")
    name, text = given[0]
    n = console.numbers(f"--{name}", text, DIMENSIONS[name][0])
    if (name == "prism" and (len(n) < 8 or len(n) % 2)) or (name == "stroke" and (len(n) < 4 or len(n) % 3 != 1)):
        raise InputError(f"--{name} takes {DIMENSIONS[name][1]}")
    makers: dict[str, Callable[[], solids.Solid]] = {
        "box": lambda: solids.Box(*_corners(n)),
        "turned-box": lambda: solids.OrientedBox(_point(n), _point([0.5 * e for e in n[3:6]]), _about_vertical(n[6])),
        "sphere": lambda: solids.Sphere(_point(n), n[3]),
        "cylinder": lambda: solids.Cylinder(_point(n), n[3], n[4]),
        "capsule": lambda: solids.Capsule(_point(n), _point(n[3:]), n[6]),
        "prism": lambda: solids.Prism(tuple(zip(n[2::2], n[3::2], strict=True)), n[0], n[1]),
        "stroke": lambda: solids.Stroke(tuple(zip(n[1::3], n[2::3], n[3::3], strict=True)), n[0]),
        "outside": lambda: solids.Room(*_corners(n)),
    }
    return makers[name]()


def _point(numbers: list[float]) -> tuple[float, float, float]:
    return (numbers[0], numbers[1], numbers[2])


def _corners(numbers: list[float]) -> tuple[tuple[float, float, float], tuple[float, float, float]]:
    """Lower and upper corner, from any two opposite ones."""
    a, b = np.array(numbers[:3]), np.array(numbers[3:])
    return _point(np.minimum(a, b).tolist()), _point(np.maximum(a, b).tolist())


def _about_vertical(degrees: float) -> tuple[float, float, float, float]:
    half = 0.5 * math.radians(degrees)
    return (math.cos(half), 0.0, 0.0, math.sin(half))


def _change(
    folder: Path, editor: Editor, work: Callable[[], object], preview: Path | None, overwrite: bool, as_json: bool
) -> None:
    """Apply a change to the editor; save its list, or draw the preview; report the changes."""
    outputs.check(preview, overwrite=overwrite)
    before, old = editor.snapshot(), editor.edits
    work()
    after = editor.field
    change = difference(before, after)
    document: dict[str, Any] = {
        "closed_m3": change.closed_m3,
        "opened_m3": change.opened_m3,
        "voxels_changed": change.voxels,
        "edits": len(editor.edits),
        "hash": after.hash,
    }
    if preview is None:
        if (esdf.load_edits(folder / EDITS) if (folder / EDITS).exists() else ()) != old:
            raise InputError(f"another program changed {folder / EDITS} meanwhile; nothing was written, run this again")
        if len(editor.edits) < len(old):  # keep the old list: removed edits are stored nowhere else
            outputs.report_kept(folder / EDITS, results.keep(folder / EDITS))
        esdf.save_edits(folder / EDITS, editor.edits)
        document["written"] = str(folder / EDITS)
    else:
        from goshawk import plot
        from sysid.report import drawing

        z_m = _height(set(old) ^ set(editor.edits), after)
        fields = {"before": before, "after": after}
        slices = {f"{when}, z = {z_m:.2f} m": pictures.axis_slice(shown, "z", z_m) for when, shown in fields.items()}
        with outputs.file(preview, overwrite=overwrite) as temporary:
            plot.slices(slices).savefig(temporary, format="png", dpi=drawing.DPI)
        document["preview"] = str(preview)
    facts = {
        "no longer free": f"{document['closed_m3']:.3f} m3",
        "newly free": f"{document['opened_m3']:.3f} m3",
        "voxels changed": document["voxels_changed"],
        "edits on the list": document["edits"],
        **({"written": document["written"]} if preview is None else {"drawn, not saved": document["preview"]}),
    }
    console.show(f"edit of {folder}", facts, as_json=as_json, document=document)


def _height(changed: Iterable[Edit], field: Field) -> float:
    """Height of the preview's slice: the middle of the edits, within the map."""
    regions = [solids.covered_region(e.solid, field.grid) for e in changed]
    low, high = min(r.low[2] for r in regions), max(r.high[2] for r in regions)
    return float(field.grid.axis_centres(2)[min((low + high) // 2, field.grid.shape[2] - 1)])


def _described(e: Edit) -> dict[str, Any]:
    return {"solid": type(e.solid).__name__, **asdict(e.solid)}  # pyright: ignore[reportArgumentType]


def _dimensions(e: Edit) -> str:
    values = {name: value for name, value in _described(e).items() if name != "solid"}
    return ", ".join(f"{name} {np.round(np.array(value), 3).tolist()}" for name, value in values.items())
