"""The document: what a patch says is all that changed, and taking it back brings back what was there."""

import msgspec
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from flight import InputError, Waypoints
from gcs_web.document import edits
from gcs_web.document.document import Content, Patch, Point, Settings, difference, patched
from gcs_web.protocol.document import Choose, Delete, Insert, Move, Reverse, Shift, Turn

coordinates = st.floats(-1000.0, 1000.0, allow_nan=False)
headings = st.none() | st.floats(-3.0, 3.0)


@st.composite
def contents(draw) -> Content:
    ids = draw(st.lists(st.integers(0, 30), unique=True, max_size=8))
    points = [Point(i, draw(st.tuples(coordinates, coordinates, coordinates)), draw(headings)) for i in ids]
    settings = Settings(speed_m_s=draw(st.floats(0.1, 40.0)), yaw=draw(st.sampled_from(["along_path", "smooth"])))
    return Content(tuple(points), settings, 31)


@given(contents(), contents())
def test_a_patch_leads_from_one_content_to_the_other_and_its_inverse_back(before: Content, after: Content):
    assert patched(before, difference(before, after)) == after
    assert patched(after, difference(after, before)) == before


@given(contents(), contents())
def test_a_patch_survives_being_written_down(before: Content, after: Content):
    patch = difference(before, after)
    assert msgspec.json.decode(msgspec.json.encode(patch), type=Patch) == patch


@given(contents())
def test_nothing_changed_is_an_empty_patch_that_touches_nothing(content: Content):
    patch = difference(content, content)
    assert patch == Patch()
    assert patch.touched == frozenset()


def three() -> Content:
    waypoints = Waypoints(np.array([[0.0, 0.0, 1.0], [2.0, 0.0, 1.0], [4.0, 2.0, 1.0]]), np.full(3, np.nan))
    return Content().with_waypoints(waypoints)


def edit(kind: type, content: Content | None = None, **arguments) -> tuple[Content, str]:
    return edits.apply(three() if content is None else content, kind(serial=0, revision=0, **arguments))


def test_a_move_sets_only_the_coordinates_it_names():
    after, label = edit(Move, waypoints=[1], z_m=1.5)
    assert [p.position_world_m for p in after.points] == [(0.0, 0.0, 1.0), (2.0, 0.0, 1.5), (4.0, 2.0, 1.0)]
    assert label == "waypoint 2 moved 0.50 m"


def test_moving_keeps_every_heading():
    turned, _ = edit(Turn, waypoints=[0, 2], yaw_deg=450.0)
    after, _ = edit(Shift, turned, waypoints=[0, 1, 2], x_m=1.0)
    assert [p.yaw_rad for p in after.points] == pytest.approx([np.pi / 2, None, np.pi / 2])


def test_an_inserted_waypoint_stands_half_way_or_a_metre_beyond_the_ends():
    for after_id, number, expected in ((1, 2, (3.0, 1.0, 1.0)), (2, 3, (5.0, 2.0, 1.0)), (None, 0, (-1.0, 0.0, 1.0))):
        content, _ = edit(Insert, after=after_id)
        assert content.points[number].position_world_m == expected
        assert content.points[number].id == 3


def test_an_id_is_never_used_again():
    fewer, _ = edit(Delete, waypoints=[2])
    more, _ = edit(Insert, fewer, after=1)
    assert [p.id for p in more.points] == [0, 1, 3]


def test_reversing_keeps_who_is_who():
    after, _ = edit(Reverse)
    assert [p.id for p in after.points] == [2, 1, 0]
    assert difference(three(), after).touched == {0, 1, 2}


@pytest.mark.parametrize(
    ("kind", "arguments", "said"),
    [
        (Move, {"waypoints": []}, "no waypoint is selected"),
        (Move, {"waypoints": [7], "x_m": 1.0}, "deleted meanwhile"),
        (Move, {"waypoints": [0], "x_m": 1e9}, "within 10000 m"),
        (Move, {"waypoints": [0], "x_m": float("inf")}, "must be finite"),
        (Move, {"waypoints": [0], "x_m": float("nan")}, "must be finite"),
        (Delete, {"waypoints": [0, 1]}, "two waypoints are the least"),
        (Choose, {"speed_m_s": 0.0}, "speed 0 is refused; it must be from 0.1 to 40"),
        (Choose, {"margin_m": float("nan")}, "must be from 0 to 10"),
        (Choose, {"jerk_m_s3": -1.0}, "jerk -1 is refused; it must be from 0 to 100000"),
    ],
)
def test_what_cannot_be_done_is_refused_with_the_bound(kind, arguments, said):
    with pytest.raises(InputError, match=said):
        edit(kind, **arguments)
