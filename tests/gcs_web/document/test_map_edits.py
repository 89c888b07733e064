"""Edits of the map in the document: the map's own list is always theirs, through undo, two people, and restarts."""

import errno
import json
from pathlib import Path

import numpy as np
import pytest

import esdf
from esdf import Edit, solids
from flight import FormatError, InputError, project
from gcs_web.document import map_edits
from gcs_web.document.document import Settings
from gcs_web.document.session import Session
from gcs_web.map.bodies import along, handles, outline, pulled
from gcs_web.protocol.document import Insert
from gcs_web.protocol.map import AddMapEdit, ChangeMapEdit, DropMapEdits, Shape

GRID = esdf.Grid((0.0, 0.0, 0.0), 0.1, (30, 20, 10))
BOX = Shape("box", (1.0, 1.0, 0.5), (0.4, 0.4, 0.4))
BALL = Shape("sphere", (2.0, 1.0, 0.5), radius_m=0.3)
STROKE = Shape("stroke", radius_m=0.2, points_m=[(0.5, 0.5, 0.5), (1.5, 0.5, 0.5), (1.5, 1.2, 0.7)])
COLUMN = Shape("prism", (1.0, 1.0, 0.5), (1.0, 1.0, 0.6), corners_m=[(0.5, 0.5), (1.5, 0.5), (1.5, 1.5)])


@pytest.fixture
def session(tmp_path: Path):
    opened = project.create(tmp_path / "project", "room")
    opened.map.mkdir()
    esdf.save(opened.map / "esdf", esdf.build(np.full(GRID.shape, esdf.FREE, dtype=np.uint8), GRID, cap_m=2.0))
    edited = Session(opened, Settings())
    yield edited
    edited.close()


def on_disk(session: Session) -> tuple[Edit, ...]:
    return map_edits.load(session.project.map / "esdf" / "edits.json")


def in_document(session: Session) -> tuple[Edit, ...]:
    return tuple(each.edit() for each in session.content.map_edits)


def add(session: Session, name: str, shape: Shape = BOX, author: str = "Ada", *, revision: int | None = None) -> None:
    seen = session.revision if revision is None else revision
    session.edit(AddMapEdit(serial=0, revision=seen, action="no-fly", name=name, shape=shape), author)


def by_hand(session: Session, *edits: Edit) -> None:
    esdf.save_edits(session.project.map / "esdf" / "edits.json", edits)


def test_the_map_on_disk_has_every_edit_at_once_and_loses_it_with_undo(session: Session):
    lists = [()]
    for name, shape in (("a", BOX), ("b", BALL), ("c", COLUMN)):
        add(session, name, shape)
        lists.append(in_document(session))
        assert on_disk(session) == lists[-1]
    field = esdf.load(session.project.map / "esdf")
    assert field.distance([[2.0, 1.0, 0.5]])[0] < 0.0
    for expected in reversed(lists[:-1]):
        session.undo("Ada")
        assert on_disk(session) == in_document(session) == expected
    for expected in lists[1:]:
        session.redo("Bo")
        assert on_disk(session) == expected


def test_a_restart_finds_the_edits_and_their_undo(session: Session):
    add(session, "a")
    add(session, "b", BALL)
    before = in_document(session)
    session.close()
    again = Session(session.project, Settings())
    try:
        assert in_document(again) == on_disk(again) == before
        again.undo("Ada")
        assert [edit.name for edit in on_disk(again)] == ["a"]
    finally:
        again.close()


class _Killed(BaseException):
    """As kill -9: nothing below catches it."""


def test_killed_between_journal_and_file_the_file_is_written_on_opening(session: Session, monkeypatch):
    def kill(*_):
        raise _Killed

    add(session, "a")
    with monkeypatch.context() as patch:
        patch.setattr(map_edits, "save", kill)
        with pytest.raises(_Killed):
            add(session, "b", BALL)
    whole = in_document(session)
    assert on_disk(session) != whole
    session.close()
    again = Session(session.project, Settings())
    try:
        assert in_document(again) == on_disk(again) == whole
    finally:
        again.close()


def test_a_zone_that_another_program_put_back_while_the_station_was_closed_is_kept(session: Session):
    """The list equals that of before the last edit, and yet it is no file that we left."""
    add(session, "a")
    whole = on_disk(session)
    session.edit(DropMapEdits(serial=0, revision=session.revision, edits=[session.content.map_edits[0].id]), "Ada")
    session.close()
    by_hand(session, *whole)
    again = Session(session.project, Settings())
    try:
        assert in_document(again) == on_disk(again) == whole
        again.undo("Ada")
        assert in_document(again) == on_disk(again) == ()
    finally:
        again.close()


def test_what_goshawk_map_edit_writes_is_a_change_that_can_be_undone(session: Session):
    add(session, "a")
    mine = in_document(session)
    theirs = (*mine, Edit("add", solids.Capsule((0.0, 0.0, 0.5), (2.0, 1.0, 0.5), 0.05), "cable"))
    by_hand(session, *theirs)
    assert session.take_files() == ["edits.json"]
    assert in_document(session) == theirs
    assert session.content.map_edits[0].id == 0  # what stayed kept its identity
    assert session.document().map_edits[1].shape.form == "other"
    session.undo("Ada")
    assert on_disk(session) == mine
    (session.project.map / "esdf" / "edits.json").unlink()
    assert session.take_files() == ["edits.json"]
    assert in_document(session) == ()


def test_an_edit_of_a_waypoint_never_writes_over_the_maps_edits(session: Session):
    by_hand(session, Edit("add", solids.Sphere((1.0, 1.0, 0.5), 0.2)))
    theirs = on_disk(session)
    session.edit(Insert(serial=0, revision=session.revision, after=None, x_m=1.0, y_m=1.0, z_m=0.5), "Ada")
    assert on_disk(session) == theirs
    session.take_files()
    assert in_document(session) == theirs


def test_two_people_edit_different_zones_together_and_the_same_one_not(session: Session):
    add(session, "a")
    add(session, "b", BALL)
    seen = session.revision
    a, b = (each.id for each in session.content.map_edits)
    change = {"serial": 0, "revision": seen}
    session.edit(ChangeMapEdit(**change, edit=a, name="hall"), "Ada")
    session.edit(ChangeMapEdit(**change, edit=b, name="cable"), "Bo")
    add(session, "c", COLUMN, "Bo", revision=seen)
    assert [each.name for each in session.content.map_edits] == ["hall", "cable", "c"]
    with pytest.raises(InputError, match="Ada changed the same"):
        session.edit(DropMapEdits(**change, edits=[a]), "Bo")
    with pytest.raises(InputError, match="already"):
        session.edit(ChangeMapEdit(serial=0, revision=session.revision, edit=a, name="c"), "Ada")


def test_a_stroke_is_one_edit_of_the_map_that_survives_a_restart_and_can_be_undone(session: Session):
    add(session, "hose", STROKE)
    field = esdf.load(session.project.map / "esdf")
    assert (field.distance(STROKE.points_m) < 0.0).all()
    session.close()
    again = Session(session.project, Settings())
    try:
        (kept,) = again.document().map_edits
        assert (kept.shape.form, kept.shape.points_m, kept.words) == ("stroke", STROKE.points_m, "stroke, 1.7 m")
        again.undo("Ada")
        assert on_disk(again) == ()
    finally:
        again.close()


@pytest.mark.parametrize(
    "points",
    [[], [(0.0, 0.0, 0.0)] * 501, [(float("nan"), 0.0, 0.0)], [(1e9, 0.0, 0.0)]],
    ids=["0", "501", "nan", "far"],
)
def test_a_stroke_that_is_none_is_refused(session: Session, points):
    with pytest.raises(InputError):
        add(session, "x", Shape("stroke", radius_m=0.2, points_m=points))
    assert in_document(session) == ()


@pytest.mark.parametrize(
    "shape",
    [
        Shape("sphere", (0.0, 0.0, float("nan")), radius_m=1.0),
        Shape("box", (0.0, 0.0, 0.0), (1.0, 1.0, float("nan"))),
        Shape("prism", (0.0, 0.0, 0.0), (1.0, 1.0, 1.0), corners_m=[(0.0, 0.0), (1.0, 0.0), (float("nan"), 1.0)]),
        Shape("stroke", radius_m=0.1, points_m=[(0.0, 0.0, 0.0), (1.0, float("nan"), 0.0)]),
    ],
    ids=lambda shape: shape.form,
)
def test_a_shape_with_a_number_that_is_none_is_refused_wherever_it_stands(shape: Shape):
    with pytest.raises(InputError, match="must be finite"):
        map_edits.solid(shape)


def test_the_balls_of_a_drawn_stroke_are_on_its_line_and_few():
    balls = along([(0.0, 0.0, 0.0), (3.0, 0.0, 0.0), (3.0, 4.0, 0.0)], 0.1)
    assert len(balls) == 71
    assert np.linalg.norm(np.diff(balls, axis=0), axis=1).max() <= 0.1 + 1e-9
    np.testing.assert_array_equal(balls[[0, -1]], [[0.0, 0.0, 0.0], [3.0, 4.0, 0.0]])
    assert len(along([(0.0, 0.0, 0.0), (3000.0, 0.0, 0.0)], 0.1)) == 200
    assert along([(1.0, 2.0, 3.0)], 0.1).tolist() == [[1.0, 2.0, 3.0]]


def test_where_the_file_cannot_be_written_the_document_says_that_the_map_lacks_it(session: Session, monkeypatch):
    with monkeypatch.context() as full:

        def refuse(*_: object) -> None:
            raise OSError(errno.ENOSPC, "No space left on device")

        full.setattr(map_edits, "save", refuse)
        add(session, "a")
        assert "No space left" in session.map_edits_behind
        assert "nothing is planned or checked" in session.take_notice()
    add(session, "b", BALL)  # the next change writes all of them
    assert session.map_edits_behind == ""
    assert on_disk(session) == in_document(session)


def test_a_damaged_list_is_refused(session: Session):
    (session.project.map / "esdf" / "edits.json").write_text("{")
    with pytest.raises(FormatError):
        session.take_files()


@pytest.mark.parametrize("shape", [BOX, BALL, COLUMN], ids=["box", "sphere", "prism"])
def test_a_shape_survives_being_a_solid_and_a_handle_pulled_to_where_it_is_changes_nothing(shape: Shape):
    back = map_edits.shape_of(map_edits.solid(shape))
    assert map_edits.solid(back) == map_edits.solid(shape)
    for name, place in handles(back).items():
        assert map_edits.solid(pulled(back, name, np.array(place))) == map_edits.solid(shape)
    ends = outline(back).reshape(-1, 3)
    np.testing.assert_allclose(map_edits.solid(shape).distance(ends), 0.0, atol=1e-6)


def test_the_handle_of_a_side_leaves_the_opposite_corner_where_it_is():
    before, after = (map_edits.solid(s) for s in (BOX, pulled(BOX, "size", np.array([3.0, 2.0, 1.0]))))
    np.testing.assert_allclose(after.bounds_world_m[0], before.bounds_world_m[0])
    np.testing.assert_allclose(after.bounds_world_m[1], [3.0, 2.0, 1.0])


def test_a_document_of_before_map_edits_takes_them_over_and_undo_leaves_them(session: Session):
    """Ctrl+Z for a waypoint must not drop the no-fly zones that were drawn before the document knew of them."""
    session.edit(Insert(serial=0, revision=session.revision, after=None, x_m=1.0, y_m=1.0, z_m=0.5), "Ada")
    session.close()
    stairs = Edit("no-fly", solids.Sphere((1.0, 1.0, 0.5), 0.2), "stairs")
    by_hand(session, stairs)
    kept = session.project.folder / ".session" / "document.json"
    snapshot = json.loads(kept.read_text())
    del snapshot["content"]["map_edits"], snapshot["crc32"]
    kept.write_text(json.dumps(snapshot | {"version": 2}))
    again = Session(session.project, Settings())
    try:
        assert in_document(again) == (stairs,)
        assert again.document().undo == "waypoint 1 inserted"
        again.undo("Ada")
        add(again, "a")
        assert [edit.name for edit in on_disk(again)] == ["stairs", "a"]
        assert len({each.id for each in again.content.map_edits}) == 2
    finally:
        again.close()


def test_undo_does_not_write_over_what_goshawk_map_edit_wrote_just_now(session: Session):
    add(session, "a")
    theirs = (*on_disk(session), Edit("no-fly", solids.Sphere((2.0, 1.0, 0.5), 0.2), "b"))
    by_hand(session, *theirs)
    with pytest.raises(InputError, match="another program edited the map just now; nothing was taken back"):
        session.undo("Ada")
    assert on_disk(session) == in_document(session) == theirs


@pytest.mark.parametrize(("whole", "damaged"), [("Sphere", "Sphera"), ("radius_m", "radius_n")])
def test_an_edit_of_the_map_that_is_damaged_in_the_document_is_refused_in_words(session: Session, whole, damaged):
    add(session, "b", BALL)
    session.close()
    kept = session.project.folder / ".session" / "document.json"
    again = Session(session.project, Settings())
    again._journal.compact()
    again.close()
    kept.write_text(kept.read_text().replace(whole, damaged))
    with pytest.raises(FormatError, match="damaged"):
        Session(session.project, Settings())
