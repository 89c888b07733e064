"""Changes a pilot makes to a map: a list that is replayed on top of it, with undo, and outlives every rebuild.

A voxel's state depends only on its mapped state and on the edits that reach it, and a distance capped at D only on
the states within D. So after an edit a small window is replayed and recomputed, and the result is bit-equal to a
rebuild of everything.
"""

from collections.abc import Iterable, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from esdf import solids
from esdf.build import Recipe, transform
from esdf.field import Field
from esdf.grid import FREE, OCCUPIED, Grid, Region, StateArray
from esdf.solids import Solid
from flight import FormatError, InputError, file_format

FORMAT = "goshawk-edits"
VERSION = 1
EDITS = "edits.json"
"""Its name in the folder of a field."""
MAX_UNDO = 1000

Action = Literal["add", "remove", "clear", "no-fly"]
ACTIONS: tuple[Action, ...] = ("add", "remove", "clear", "no-fly")


@dataclass(frozen=True, slots=True)
class Edit:
    """One change: an action on the voxels of a solid."""

    action: Action
    """"add": every voxel the solid touches is occupied. "remove": every voxel whose centre is inside is free, even
    if no camera observed it: the pilot takes responsibility. "clear": voxels mapped as occupied there become free;
    unknown ones stay unknown, and those that edits occupied stay occupied. "no-fly": as "add", but no other edit frees
    these voxels."""
    solid: Solid
    name: str = ""
    """The pilot's name for it; a no-fly zone must have one."""

    def __post_init__(self) -> None:
        if self.action not in ACTIONS:
            raise InputError(f"an edit's action is {self.action!r}; choose one of {', '.join(ACTIONS)}")
        if self.action == "no-fly" and not self.name:
            raise InputError("a no-fly zone needs a name")

    def reaches(self, grid: Grid, region: Region) -> NDArray[np.bool_]:
        """Which voxels of the region this edit changes."""
        if self.action in ("add", "no-fly"):
            return solids.touched(self.solid, grid, region)
        return self.solid.distance(grid.centres(region).reshape(-1, 3)).reshape(region.shape) <= 0.0


def replay(mapped: StateArray, grid: Grid, edits: Iterable[Edit], region: Region) -> StateArray:
    """The states of a region after all edits; no-fly zones come last, whenever they were drawn.

    Args:
        mapped: The region's states as mapped.
    """
    state = mapped.copy()
    edited = np.zeros(state.shape, bool)
    for edit in sorted(edits, key=lambda e: e.action == "no-fly"):
        for slab in solids.slabs(solids.covered_region(edit.solid, grid).common(region)):
            part = slab.relative_to(region).slices
            chosen = edit.reaches(grid, slab)
            if edit.action == "clear":
                chosen &= (state[part] == OCCUPIED) & ~edited[part]
            state[part][chosen] = OCCUPIED if edit.action in ("add", "no-fly") else FREE
            edited[part] |= chosen
    return state


class Editor:
    """A field under edit. `field` is live: every edit changes its arrays in place; take `snapshot` to keep a state."""

    def __init__(self, mapped: Field, edits: Sequence[Edit] = ()) -> None:
        self._mapped = mapped.state
        self._recipe = Recipe.of(mapped.grid, mapped.cap_m, mapped.unknown)
        self._field = replace(mapped, state=mapped.state.copy(), values_m=mapped.values_m.copy())
        self._regions: dict[Edit, Region] = {}
        self._history: list[tuple[Edit, ...]] = [()]
        self._now = 0
        if edits:
            for edit in edits:
                self._check(edit)
            self._history = [tuple(edits)]
            self._refresh(edits)

    @property
    def field(self) -> Field:
        return self._field

    @property
    def edits(self) -> tuple[Edit, ...]:
        """The present list, in the order in which it was made."""
        return self._history[self._now]

    def snapshot(self) -> Field:
        """A copy that later edits leave alone."""
        return replace(self._field, state=self._field.state.copy(), values_m=self._field.values_m.copy())

    def apply(self, edit: Edit) -> Region:
        """Append an edit; returns the box of voxels whose distance may have changed.

        Raises:
            InputError: the solid touches no voxel of the map, or a no-fly zone of that name exists.
        """
        self._check(edit)
        return self._record((*self.edits, edit))

    def replace(self, edits: Sequence[Edit]) -> Region:
        """Replace the list by one whose edits were checked before; can be undone like any edit."""
        return self._record(tuple(edits))

    def drop(self, name: str) -> Region:
        """Remove every edit of that name (a no-fly zone, say) from the list; can be undone like any edit."""
        kept = tuple(edit for edit in self.edits if edit.name != name)
        if len(kept) == len(self.edits):
            names = ", ".join(sorted({e.name for e in self.edits if e.name})) or "none"
            raise InputError(f"no edit is called {name!r}; the named ones are {names}")
        return self._record(kept)

    def undo(self) -> Region:
        """Back to before the last change; raises `InputError` if there is none."""
        if self._now == 0:
            raise InputError("there is nothing to undo")
        return self._move(self._now - 1)

    def redo(self) -> Region:
        """Forward again after `undo`; raises `InputError` if nothing was undone since the last change."""
        if self._now + 1 == len(self._history):
            raise InputError("there is nothing to redo")
        return self._move(self._now + 1)

    def require_reach(self, edit: Edit) -> None:
        """Raises `InputError` if the edit touches no voxel of the map."""
        if self._covered(edit).empty:
            raise InputError(f"the {type(edit.solid).__name__.lower()} to {edit.action} touches no voxel of this map")

    def _check(self, edit: Edit) -> None:
        self.require_reach(edit)
        if edit.action == "no-fly" and any(e.action == "no-fly" and e.name == edit.name for e in self.edits):
            raise InputError(f"there is a no-fly zone called {edit.name!r} already; drop it first")

    def _covered(self, edit: Edit) -> Region:
        if edit not in self._regions:
            self._regions[edit] = solids.covered_region(edit.solid, self._field.grid)
        return self._regions[edit]

    def _record(self, edits: tuple[Edit, ...]) -> Region:
        self._history = [*self._history[: self._now + 1], edits][-MAX_UNDO:]
        self._now = len(self._history) - 2 if len(self._history) > 1 else 0
        return self._move(len(self._history) - 1)

    def _move(self, to: int) -> Region:
        before, after = self.edits, self._history[to]
        self._now = to
        return self._refresh(differing(before, after))

    def _refresh(self, changed: Iterable[Edit]) -> Region:
        """Replay and recompute where the given edits reach; returns a box round everything recomputed."""
        grid, state, values = self._field.grid, self._field.state, self._field.values_m
        boxes: list[Region] = []
        for edit in changed:
            region = self._covered(edit)
            near = [e for e in self.edits if not self._covered(e).common(region).empty]
            fresh = replay(self._mapped[region.slices], grid, near, region)
            dirty = _bounding_box(fresh != state[region.slices], region)
            state[region.slices] = fresh
            if dirty.empty:
                continue
            window = dirty.grown(self._recipe.reach, grid.shape)
            transform(self._recipe, state, window, values[window.slices], self._recipe.faces)
            boxes.append(window)
        live = self._field
        live._hash.clear()  # pyright: ignore[reportPrivateUsage]
        self._field = replace(live)
        # Whoever holds an earlier `field` sees the same arrays, and so must see the same hash.
        object.__setattr__(self._field, "_hash", live._hash)  # pyright: ignore[reportPrivateUsage]
        return _union(boxes)


@dataclass(frozen=True, slots=True)
class Change:
    """What edits change in a field."""

    closed_m3: float
    """Space that is no longer free."""
    opened_m3: float
    """Space that is newly free."""
    voxels: int
    """Whose state is another one."""


def difference(before: Field, after: Field) -> Change:
    """The difference between two fields on one grid."""
    voxel_m3 = float(np.prod(after.grid.voxel_m))
    closed = (before.state == FREE) & (after.state != FREE)
    opened = (before.state != FREE) & (after.state == FREE)
    return Change(
        float(closed.sum()) * voxel_m3, float(opened.sum()) * voxel_m3, int((before.state != after.state).sum())
    )


def _union(boxes: Sequence[Region]) -> Region:
    """The smallest box round all of them (empty for none)."""
    if not boxes:
        return Region((0, 0, 0), (0, 0, 0))
    low = np.array([b.low for b in boxes]).min(axis=0)
    high = np.array([b.high for b in boxes]).max(axis=0)
    return Region(tuple(low.tolist()), tuple(high.tolist()))


def differing(a: tuple[Edit, ...], b: tuple[Edit, ...]) -> tuple[Edit, ...]:
    """The edits in one list and not in the other: what is left after the common beginning and end."""
    shorter = min(len(a), len(b))
    start = next((i for i in range(shorter) if a[i] != b[i]), shorter)
    end = next((i for i in range(shorter - start) if a[-1 - i] != b[-1 - i]), shorter - start)
    return a[start : len(a) - end] + b[start : len(b) - end]


def _bounding_box(mask: NDArray[np.bool_], region: Region) -> Region:
    """The smallest box round the True voxels of a mask over `region`."""
    low, high = [], []
    for axis in range(3):
        hits = np.flatnonzero(mask.any(axis=tuple(a for a in range(3) if a != axis)))
        low.append(region.low[axis] + (int(hits[0]) if hits.size else 0))
        high.append(region.low[axis] + (int(hits[-1]) + 1 if hits.size else 0))
    return Region(tuple(low), tuple(high))


def save_edits(path: Path, edits: Sequence[Edit]) -> None:
    """Write an edit list (format `goshawk-edits`, JSON)."""
    entries = [
        {"action": e.action, "name": e.name, "solid": type(e.solid).__name__, **asdict(e.solid)}  # pyright: ignore[reportArgumentType]
        for e in edits
    ]
    file_format.write_json(path, format=FORMAT, version=VERSION, body={"edits": entries})


def load_edits(path: Path) -> tuple[Edit, ...]:
    """Read an edit list; raises `InputError` if there is none, `FormatError` if it is damaged or newer."""
    document = file_format.read_json(path, format=FORMAT, version=VERSION)
    try:
        return tuple(_edit(dict(entry)) for entry in document["edits"])
    except (KeyError, TypeError, ValueError, InputError) as error:
        raise FormatError(f"{path} is a damaged edit list: {file_format.damage_text(error)}") from error


SHAPES = {
    s.__name__: s
    for s in (
        solids.Box,
        solids.Capsule,
        solids.Cylinder,
        solids.OrientedBox,
        solids.Prism,
        solids.Room,
        solids.Sphere,
        solids.Stroke,
    )
}


def _edit(entry: dict[str, Any]) -> Edit:
    action, name, shape = entry.pop("action"), entry.pop("name"), entry.pop("solid")
    return Edit(action, SHAPES[shape](**entry), name)
