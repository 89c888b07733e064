"""After every single step of a long random edit session: the field equals one built from scratch, bit by bit.

    pytest tests/esdf/test_edit_steps.py                              # 2,000 steps
    GOSHAWK_EDIT_STEPS=1000000 pytest tests/esdf/test_edit_steps.py   # half an hour; GOSHAWK_EDIT_SEED=7 for others

The rebuild shares nothing with the editor but the solids: the list is replayed over the whole map, edit by edit, and
all distances are computed anew.
"""

import os

import numpy as np

from esdf import FREE, OCCUPIED, UNKNOWN, Edit, Editor, Grid, build, solids
from esdf.build import Recipe, transform
from flight import rotations
from tests.esdf.pilot import step

STEPS = int(os.environ.get("GOSHAWK_EDIT_STEPS", "2000"))
SEED = int(os.environ.get("GOSHAWK_EDIT_SEED", "0"))
STEPS_PER_SESSION = 40
GRIDS = [Grid((-0.7, 0.4, 0.1), 0.1, (18, 14, 12)), Grid((-0.7, 0.4, 0.1), (0.1, 0.08, 0.13), (16, 17, 9))]
ACTIONS = ("add", "remove", "clear", "no-fly")


def random_map(rng, grid):
    state = np.full(grid.shape, FREE, np.uint8)
    state[rng.random(grid.shape) < 0.02] = OCCUPIED
    state[:, :, int(rng.integers(4, grid.shape[2])) :] = UNKNOWN
    unknown = ("obstacle", "nan")[int(rng.integers(2))]
    return build(state, grid, cap_m=float(rng.uniform(0.15, 0.6)), unknown=unknown, threads=1)


def random_edit(rng, grid):
    low = rng.uniform(grid.low_world_m - 0.2, grid.high_world_m - 0.1)
    size = rng.uniform(0.02, 0.5, 3)
    centre, radius = tuple(low + size / 2), float(size[0] / 2)
    kind = int(rng.integers(7))
    if kind == 0:
        solid = solids.Box(tuple(low), tuple(low + size))
    elif kind == 1:
        solid = solids.OrientedBox(centre, tuple(size / 2), tuple(rotations.exp(rng.normal(size=3))))
    elif kind == 2:
        solid = solids.Sphere(centre, radius)
    elif kind == 3:
        solid = solids.Cylinder(centre, radius, float(size[2]))
    elif kind == 4:
        solid = solids.Capsule(tuple(low), tuple(low + size), radius / 3)
    elif kind == 5:
        solid = solids.Prism(tuple(tuple((low + size * c)[:2]) for c in np.eye(3)), low[2], low[2] + size[2])
    else:
        solid = solids.Stroke(tuple(map(tuple, low + rng.uniform(0, 0.4, (3, 3)))), radius / 3)
    action = ACTIONS[int(rng.choice(4, p=[0.4, 0.3, 0.15, 0.15]))]
    return Edit(action, solid, f"zone {int(rng.integers(3))}" if action == "no-fly" else "")


class Rebuild:
    """What a map looks like under a list of edits, from scratch."""

    def __init__(self, base):
        self.base = base
        self.recipe = Recipe.of(base.grid, base.cap_m, base.unknown)
        self.values = np.empty(base.grid.shape, np.float32)
        self.reached = {}

    def reach(self, edit):
        """Which voxels of the whole map an edit is about; worked out once."""
        if id(edit) not in self.reached:
            self.reached[id(edit)] = (edit, edit.reaches(self.base.grid, self.base.grid.everything))
        return self.reached[id(edit)][1]

    def of(self, edits):
        state = self.base.state.copy()
        mapped_here = np.ones(state.shape, bool)
        for edit in [e for e in edits if e.action != "no-fly"]:
            reach = self.reach(edit)
            if edit.action == "clear":
                reach = reach & mapped_here & (state == OCCUPIED)
            state[reach] = OCCUPIED if edit.action == "add" else FREE
            mapped_here &= ~reach
        for edit in [e for e in edits if e.action == "no-fly"]:
            state[self.reach(edit)] = OCCUPIED
        whole = self.base.grid.everything
        transform(self.recipe, state, whole, self.values, self.recipe.faces, threads=1)
        return state, self.values


def session(rng, steps):
    """Random steps on one random map, each compared; returns how many changed the list."""
    base = random_map(rng, GRIDS[int(rng.integers(len(GRIDS)))])
    editor, rebuild = Editor(base), Rebuild(base)
    edits = [random_edit(rng, base.grid) for _ in range(25)]
    taken = 0
    for _ in range(steps):
        taken += step(editor, lambda: edits[int(rng.integers(len(edits)))], rng)
        state, values = rebuild.of(editor.edits)
        assert editor.field.state.tobytes() == state.tobytes(), editor.edits
        assert editor.field.values_m.tobytes() == values.tobytes(), editor.edits
    return taken


def test_every_step_of_a_random_edit_session_equals_a_rebuild():
    rng = np.random.default_rng(SEED)
    done = 0
    while done < STEPS:
        done += session(rng, STEPS_PER_SESSION)
    print(f"{done} steps that changed the list, seed {SEED}: no difference")


def test_the_rebuild_notices_a_single_wrong_voxel():
    rng = np.random.default_rng(1)
    base = random_map(rng, GRIDS[0])
    editor, rebuild = Editor(base), Rebuild(base)
    editor.apply(Edit("add", solids.Box((0.0, 1.0, 0.2), (0.2, 1.2, 0.4))))
    editor.field.values_m[0, 0, 0] = np.nextafter(editor.field.values_m[0, 0, 0], np.float32(9))
    assert editor.field.values_m.tobytes() != rebuild.of(editor.edits)[1].tobytes()
