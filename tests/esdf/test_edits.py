"""Edits: any sequence, undone and redone, equals a rebuild bit by bit; no edit frees a no-fly zone; edits are kept."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from esdf import FREE, OCCUPIED, UNKNOWN, Edit, Editor, Grid, build, load, save, solids
from esdf.edits import load_edits, save_edits
from flight import FormatError, InputError, rotations
from tests.esdf.pilot import step

GRID = Grid((-1.0, 0.0, 0.5), 0.1, (30, 26, 22))


def mapped(rng, unknown="obstacle", cap_m=0.5):
    state = np.full(GRID.shape, FREE, np.uint8)
    state[rng.random(GRID.shape) < 0.01] = OCCUPIED
    state[:, :, 18:] = UNKNOWN
    return build(state, GRID, cap_m=cap_m, unknown=unknown)


def random_solid(rng):
    low = rng.uniform(GRID.low_world_m - 0.2, GRID.high_world_m - 0.3)
    size = rng.uniform(0.05, 0.8, 3)
    centre, radius = tuple(low + size / 2), float(size[0] / 2)
    makers = [
        lambda: solids.Box(tuple(low), tuple(low + size)),
        lambda: solids.OrientedBox(centre, tuple(size / 2), tuple(rotations.exp(rng.normal(size=3)))),
        lambda: solids.Sphere(centre, radius),
        lambda: solids.Cylinder(centre, radius, float(size[2])),
        lambda: solids.Capsule(tuple(low), tuple(low + size), radius / 3),
        lambda: solids.Prism(tuple(tuple((low + size * c)[:2]) for c in np.eye(3)), low[2], low[2] + size[2]),
        lambda: solids.Stroke(tuple(map(tuple, low + rng.uniform(0, 0.5, (4, 3)))), radius / 3),
    ]
    return makers[int(rng.integers(len(makers)))]()


def random_edit(rng):
    action = ("add", "remove", "clear", "no-fly")[int(rng.choice(4, p=[0.4, 0.3, 0.15, 0.15]))]
    return Edit(action, random_solid(rng), f"zone {int(rng.integers(3))}" if action == "no-fly" else "")


def assert_equals_rebuild(editor, base):
    rebuilt = Editor(base, editor.edits).field
    np.testing.assert_array_equal(editor.field.state, rebuilt.state)
    fresh = build(rebuilt.state, base.grid, cap_m=base.cap_m, unknown=base.unknown)
    np.testing.assert_array_equal(editor.field.values_m, fresh.values_m)
    assert editor.field.hash == fresh.hash


@given(st.integers(0, 2**32 - 1), st.sampled_from(["obstacle", "nan"]))
@settings(max_examples=25)
def test_any_sequence_of_edits_equals_a_rebuild_bit_by_bit(seed, unknown):
    rng = np.random.default_rng(seed)
    base = mapped(rng, unknown)
    editor = Editor(base)
    for _ in range(12):
        step(editor, lambda: random_edit(rng), rng)
    assert_equals_rebuild(editor, base)


def test_undoing_everything_gives_the_mapped_field_back_and_redoing_the_edited_one():
    rng = np.random.default_rng(1)
    base = mapped(rng)
    editor = Editor(base)
    for _ in range(6):
        editor.apply(Edit("add", solids.Sphere(tuple(rng.uniform((-0.5, 0.5, 1), (1.5, 2, 2))), 0.2)))
    edited = editor.snapshot()
    for _ in range(6):
        editor.undo()
    np.testing.assert_array_equal(editor.field.values_m, base.values_m)
    assert editor.field.hash == base.hash
    for _ in range(6):
        editor.redo()
    np.testing.assert_array_equal(editor.field.values_m, edited.values_m)


def test_an_earlier_view_of_the_live_field_never_has_the_hash_of_what_it_was():
    editor = Editor(mapped(np.random.default_rng(1)))
    views = [editor.field]
    for x in (0.0, 0.5):
        before = views[0].hash
        editor.apply(Edit("add", solids.Sphere((x, 1.0, 1.5), 0.3)))
        views.append(editor.field)
        assert views[-2] is not views[-1]
        assert {view.hash for view in views} == {editor.snapshot().hash}
        assert views[0].hash != before


def test_a_new_edit_discards_the_redo_list():
    editor = Editor(mapped(np.random.default_rng(2)))
    editor.apply(Edit("add", solids.Sphere((0, 1, 1), 0.2)))
    editor.undo()
    editor.apply(Edit("add", solids.Sphere((1, 1, 1), 0.2)))
    with pytest.raises(InputError, match="nothing to redo"):
        editor.redo()
    editor.undo()
    assert editor.edits == ()
    with pytest.raises(InputError, match="nothing to undo"):
        editor.undo()


def test_no_edit_opens_a_no_fly_zone_until_it_is_dropped_by_name():
    editor = Editor(mapped(np.random.default_rng(3)))
    zone = solids.Box((0.0, 1.0, 1.0), (0.5, 1.5, 1.5))
    editor.apply(Edit("no-fly", zone, "neighbour"))
    editor.apply(Edit("remove", solids.Box((-0.5, 0.5, 0.6), (1.0, 2.0, 2.0))))
    middle = [[0.25, 1.25, 1.25]]
    assert editor.field.distance(middle)[0] < 0
    editor.drop("neighbour")
    assert editor.field.distance(middle)[0] > 0
    editor.undo()
    assert editor.field.distance(middle)[0] < 0


def test_clearing_frees_mapped_obstacles_but_neither_unknown_nor_added_voxels():
    state = np.full(GRID.shape, FREE, np.uint8)
    state[5, 5, 5], state[6, 5, 5], state[9, 5, 5] = OCCUPIED, UNKNOWN, OCCUPIED
    editor = Editor(build(state, GRID))
    editor.apply(Edit("add", solids.Sphere(tuple(GRID.centre([7, 5, 5])), 0.01)))
    low, high = GRID.centre([4, 4, 4]), GRID.centre([8, 6, 6])
    editor.apply(Edit("clear", solids.Box(tuple(low), tuple(high))))
    assert editor.field.state[5:10, 5, 5].tolist() == [FREE, UNKNOWN, OCCUPIED, FREE, OCCUPIED]


def test_removing_frees_unknown_voxels_too():
    editor = Editor(mapped(np.random.default_rng(4)))
    editor.apply(Edit("remove", solids.Box((0.0, 1.0, 2.3), (0.5, 1.5, 2.7))))
    assert editor.field.distance([[0.25, 1.25, 2.5]])[0] > 0


def test_a_snapshot_does_not_follow_later_edits_and_the_mapped_field_never_changes():
    base = mapped(np.random.default_rng(5))
    before = base.values_m.copy()
    editor = Editor(base)
    kept = editor.snapshot()
    editor.apply(Edit("add", solids.Sphere((0, 1, 1), 0.3)))
    np.testing.assert_array_equal(base.values_m, before)
    np.testing.assert_array_equal(kept.values_m, before)
    assert (editor.field.values_m != before).any()


def test_the_region_returned_holds_every_changed_voxel():
    rng = np.random.default_rng(6)
    base = mapped(rng)
    editor = Editor(base)
    region = editor.apply(Edit("add", solids.Sphere((0.2, 1.2, 1.4), 0.15)))
    changed = editor.field.values_m != base.values_m
    assert changed.any()
    changed[region.slices] = False
    assert not changed.any()


def test_edits_survive_the_disk_and_a_rebuild_of_the_map(tmp_path):
    rng = np.random.default_rng(7)
    edits = [Edit("add", random_solid(rng), f"edit {i}") for i in range(40)]
    edits.append(Edit("no-fly", solids.Room((-1, 0, 0.6), (1.8, 2.4, 2.5)), "keep in"))
    save_edits(tmp_path / "edits.json", edits)
    assert load_edits(tmp_path / "edits.json") == tuple(edits)

    first, rebuilt = mapped(rng), mapped(rng)
    save(tmp_path / "map", first)
    save_edits(tmp_path / "map" / "edits.json", edits[-1:])
    assert load(tmp_path / "map").distance([[0.0, 1.0, 0.55]])[0] < 0
    save(tmp_path / "map", rebuilt)
    np.testing.assert_array_equal(load(tmp_path / "map").values_m, Editor(rebuilt, edits[-1:]).field.values_m)


def test_senseless_edits_are_refused(tmp_path):
    editor = Editor(mapped(np.random.default_rng(8)))
    with pytest.raises(InputError, match="no voxel"):
        editor.apply(Edit("add", solids.Sphere((50, 0, 0), 1.0)))
    with pytest.raises(InputError, match="name"):
        Edit("no-fly", solids.Sphere((0, 1, 1), 0.2))
    with pytest.raises(InputError, match="choose one of"):
        Edit("paint", solids.Sphere((0, 1, 1), 0.2))  # pyright: ignore[reportArgumentType]
    with pytest.raises(InputError, match="nothing to undo"):
        editor.undo()
    with pytest.raises(InputError, match="no edit is called"):
        editor.drop("attic")
    editor.apply(Edit("no-fly", solids.Sphere((0, 1, 1), 0.2), "attic"))
    with pytest.raises(InputError, match="already"):
        editor.apply(Edit("no-fly", solids.Sphere((0, 1, 1), 0.2), "attic"))
    (tmp_path / "edits.json").write_text('{"format": "goshawk-edits", "version": 1, "edits": [{"action": "add"}]}')
    with pytest.raises(FormatError, match="damaged"):
        load_edits(tmp_path / "edits.json")
