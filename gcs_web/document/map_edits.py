"""The pilot's edits of the map as the document keeps them, and as `esdf` applies and stores them."""

from dataclasses import asdict
from pathlib import Path
from typing import Any, Literal

import msgspec
import numpy as np

from esdf import Edit, edits, load_edits, save_edits, solids
from flight import FormatError, InputError, file_format
from gcs_web.protocol.map import Shape

MOST_EDITS = 500
MOST_POINTS = 500
"""Of a brush's stroke."""
LARGEST_COORDINATE_M = 10_000.0

Action = Literal["add", "remove", "clear", "no-fly"]


class MapEdit(msgspec.Struct, frozen=True):
    """One change of the map; its place in the list is its place in time."""

    id: int
    """Never used again, for waypoints neither."""
    action: Action
    name: str
    solid: str
    """One of `esdf.edits.SHAPES`."""
    values: dict[str, Any]
    """The solid's fields, world frame, metres."""

    def edit(self) -> Edit:
        """As the field takes it.

        Raises:
            InputError: the values do not make such a solid, or a no-fly zone has no name.
            FormatError: there is no such solid, or it has other values.
        """
        try:
            return Edit(self.action, edits.SHAPES[self.solid](**self.values), self.name)
        except (KeyError, TypeError) as error:
            raise FormatError(f"edit {self.id} of the map is damaged: {file_format.damage_text(error)}") from error


def of(number: int, edit: Edit) -> MapEdit:
    values = msgspec.json.decode(msgspec.json.encode(asdict(edit.solid)))  # pyright: ignore[reportArgumentType]
    return MapEdit(number, edit.action, edit.name, type(edit.solid).__name__, values)


def load(path: Path) -> tuple[Edit, ...]:
    """The edits of a map's distance field; none where there is no list.

    Raises:
        FormatError: the list is damaged.
    """
    return load_edits(path) if path.exists() else ()


def save(path: Path, listed: tuple[MapEdit, ...]) -> None:
    save_edits(path, [each.edit() for each in listed])


def renewed(listed: tuple[MapEdit, ...], found: tuple[Edit, ...], next_id: int) -> tuple[MapEdit, ...]:
    """The list that was found; an edit that was in the old list keeps its id."""
    known = {each.edit(): each.id for each in reversed(listed)}
    taken: list[MapEdit] = []
    for edit in found:
        number = known.pop(edit, None)
        if number is None:
            number, next_id = next_id, next_id + 1
        taken.append(of(number, edit))
    return tuple(taken)


def require_consistent(listed: tuple[MapEdit, ...]) -> None:
    """
    Raises:
        InputError: an edit is not possible by itself, two no-fly zones have one name, or there are too many.
    """
    if len(listed) > MOST_EDITS:
        raise InputError(f"{len(listed)} edits of the map; {MOST_EDITS} are the most the page takes")
    zones: set[str] = set()
    for each in listed:
        made = each.edit()
        if made.action == "no-fly" and made.name in zones:
            raise InputError(f"there is a no-fly zone called {made.name!r} already; give another name")
        zones |= {made.name} if made.action == "no-fly" else set()


def solid(shape: Shape) -> solids.Solid:
    """
    Raises:
        InputError: the numbers do not make one, or the page has no such form.
    """
    places = [*shape.corners_m, *shape.points_m]
    values = [*shape.centre_m, *shape.size_m, shape.radius_m, *(v for place in places for v in place)]
    if not all(abs(value) <= LARGEST_COORDINATE_M for value in values):  # NaN is not
        raise InputError(f"a shape's numbers must be finite and within {LARGEST_COORDINATE_M:g} m; got {values}")
    centre, size = np.array(shape.centre_m), np.array(shape.size_m)
    if shape.form == "box":
        return solids.Box(_vector(centre - 0.5 * size), _vector(centre + 0.5 * size))
    if shape.form == "sphere":
        return solids.Sphere(_vector(centre), shape.radius_m)
    if shape.form == "prism":
        low, high = centre[2] - 0.5 * size[2], centre[2] + 0.5 * size[2]
        return solids.Prism(tuple(shape.corners_m), float(low), float(high))
    if shape.form == "stroke":
        if not 0 < len(shape.points_m) <= MOST_POINTS:
            raise InputError(f"a stroke of {len(shape.points_m)} points; draw one of 1 to {MOST_POINTS}")
        return solids.Stroke(tuple(shape.points_m), shape.radius_m)
    raise InputError("this shape was made by `goshawk map edit`; the page can drop it, but not change it")


def shape_of(body: solids.Solid) -> Shape:
    """As the page shows it; `solid` makes the same of it but for forms that it does not have."""
    low, high = body.bounds_world_m
    if not np.isfinite([low, high]).all():
        return Shape("other")
    centre, size = _vector(0.5 * (low + high)), _vector(high - low)
    if isinstance(body, solids.Box):
        return Shape("box", centre, size)
    if isinstance(body, solids.Sphere):
        return Shape("sphere", centre, size, body.radius_m)
    if isinstance(body, solids.Prism):
        return Shape("prism", centre, size, corners_m=list(body.polygon_world_m))
    if isinstance(body, solids.Stroke) and len(body.points_world_m) <= MOST_POINTS:
        return Shape("stroke", centre, size, body.radius_m, points_m=list(body.points_world_m))
    return Shape("other", centre, size)


def words(body: solids.Solid) -> str:
    """What it is, and how large: "box, 2.0 m³"."""
    shape = shape_of(body)
    if shape.form == "sphere":
        return f"sphere, {shape.radius_m:.2f} m"
    if shape.form == "stroke":
        points = np.array(shape.points_m)
        return f"stroke, {np.linalg.norm(np.diff(points, axis=0), axis=1).sum():.1f} m"
    if shape.form == "prism":
        x, y = np.array(shape.corners_m).T
        area = 0.5 * abs(float(x @ np.roll(y, -1) - y @ np.roll(x, -1)))
        return f"prism, {area:.1f} m²"
    if shape.form == "box":
        return f"box, {float(np.prod(shape.size_m)):.1f} m³"
    return type(body).__name__.lower()


def _vector(values: np.ndarray) -> tuple[float, float, float]:
    x, y, z = (round(float(value), 6) for value in values)
    return (x, y, z)
