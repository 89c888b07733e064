"""Missions on the page: nothing that a waypoints file asks for is lost, and every edit of a request has a way back."""

from dataclasses import replace

import msgspec
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import planner
from flight import InputError, Waypoints, mission, project
from flight.mission import FlyBy, Gate, Ground, KeepIn, Laps, LegJerk, LegSpeed, Mission, Stay, Velocity, Yaw
from gcs_web.document import edits, journal, missions
from gcs_web.document.document import LEG_LIMITS, Content, Settings, difference, patched
from gcs_web.document.session import Session
from gcs_web.protocol.base import Edit
from gcs_web.protocol.document import Ask, Choose, ClearGate, Delete, Loop, Pass, Reverse, SetGate, SetGround, SetTube
from gcs_web.scene import course_view

POINTS = np.array([[0.8, 0.8, 1.0], [3.0, 2.0, 1.3], [5.2, 0.8, 1.0], [5.0, 3.4, 1.6]])


def full() -> Mission:
    """Asks for one of everything."""
    return Mission(
        Waypoints(POINTS, np.array([np.nan, 0.5, np.nan, np.nan])),
        laps=Laps(3, 1, 2),
        stays=(Stay(0, 2.0),),
        velocities=(Velocity(2, (0.0, 2.0, 0.0)),),
        fly_bys=(FlyBy(1, 0.4),),
        leg_speeds=(LegSpeed(0, 2, 1.0), LegSpeed(2, 3, 2.0)),
        leg_jerks=(LegJerk(1, 2, 30.0),),
        landing=Ground((4.0, 2.0, 0.1), 0.5),
        yaw=Yaw("look_at", 0.0, (3.0, 2.0, 1.0)),
    )


def opened(asked: Mission | None = None) -> Content:
    return missions.with_mission(Content(), full() if asked is None else asked)


def edit(content: Content, kind: type, **arguments) -> Content:
    after, label = edits.apply(content, kind(serial=0, revision=0, **arguments))
    assert label
    assert patched(after, difference(after, content)) == content
    return after


@st.composite
def asked_missions(draw) -> Mission:
    count = draw(st.integers(3, 7))
    numbers = st.integers(0, count - 1)
    stays = draw(st.sets(numbers, max_size=2))
    balls = draw(st.sets(numbers, max_size=2)) - stays
    starts = draw(st.lists(st.integers(0, count - 2), max_size=3))
    return Mission(
        Waypoints(np.arange(3.0 * count).reshape(count, 3), np.full(count, np.nan)),
        laps=draw(st.none() | st.builds(Laps, st.integers(1, 5), st.integers(0, 1), st.sampled_from([-1, 2]))),
        stays=tuple(Stay(i, 1.5) for i in sorted(stays)),
        fly_bys=tuple(FlyBy(i, 0.3) for i in sorted(balls)),
        leg_speeds=tuple(LegSpeed(i, draw(st.integers(i + 1, count - 1)), float(i + 1)) for i in starts),
        leg_jerks=tuple(LegJerk(i, draw(st.integers(i + 1, count - 1)), float(9 * i + 5)) for i in starts[::-1]),
        yaw=draw(st.none() | st.just(Yaw("fixed", 0.7)) | st.just(Yaw("steady"))),
    )


def legs(asked: Mission) -> list[float]:
    """The largest speed of each leg as the planner takes it."""
    found = np.full(len(asked.waypoints.yaw_rad) - 1, np.inf)
    for record in asked.leg_speeds:
        found[record.first : record.last] = np.minimum(found[record.first : record.last], record.speed_m_s)
    return found.tolist()


def jerks(asked: Mission) -> list[float]:
    """The same of jerk."""
    speeds = tuple(LegSpeed(record.first, record.last, record.jerk_m_s3) for record in asked.leg_jerks)
    return legs(Mission(asked.waypoints, leg_speeds=speeds))


@given(asked_missions())
def test_a_mission_that_went_through_the_document_asks_for_the_same(asked: Mission):
    content = missions.with_mission(Content(), asked)
    back = missions.mission_of(content)
    assert missions.same(content, asked)
    assert (back.stays, back.fly_bys, back.yaw) == (asked.stays, asked.fly_bys, asked.yaw)
    assert (legs(back), jerks(back)) == (legs(asked), jerks(asked))
    np.testing.assert_array_equal(
        back.unrolled().waypoints.positions_world_m, asked.unrolled().waypoints.positions_world_m
    )


@given(asked_missions())
def test_no_leg_is_flown_faster_for_having_gone_through_the_document(asked: Mission):
    """The way back of the laps included, which is no leg between waypoints as they are listed."""
    back = missions.mission_of(missions.with_mission(Content(), asked))
    assert np.all(np.array(legs(back.unrolled())) <= legs(asked.unrolled()))
    assert np.all(np.array(jerks(back.unrolled())) <= jerks(asked.unrolled()))


def test_the_way_back_of_laps_keeps_its_limit_where_one_leg_is_slower():
    speeds = (LegSpeed(0, 3, 3.0), LegSpeed(1, 2, 2.0))
    asked = Mission(Waypoints(POINTS, np.full(4, np.nan)), laps=Laps(2), leg_speeds=speeds)
    back = missions.mission_of(missions.with_mission(Content(), asked))
    assert legs(back.unrolled()) == legs(asked.unrolled()) == [3.0, 2.0, 3.0, 3.0, 3.0, 2.0, 3.0, 3.0]


def course() -> Mission:
    """A race: two gates, one of them tilted, in a recorded tube."""
    line = ((0.0, 0.0, 1.0), (2.0, 1.0, 1.5), (4.0, 0.0, 1.0))
    gates = (Gate(1, 1.0, 0.8, 0.3), Gate(2, 1.5, 1.2, -1.0, 0.2, -0.4))
    return Mission(Waypoints(POINTS, np.full(4, np.nan)), gates=gates, keep_in=KeepIn(1.5, line))


def test_gates_and_a_tube_are_kept_through_edits_undo_and_another_program(tmp_path):
    folder = project.create(tmp_path / "project", "race")
    mission.save(folder.waypoints, course())
    session = Session(folder, Settings())

    def edit(change: Edit) -> Mission:
        session.edit(change, "Anna")
        return missions.mission_of(session.content)

    try:
        ids = [p.id for p in session.content.points]
        assert missions.same(session.content, course())
        wider = edit(SetGate(serial=0, revision=0, waypoint=ids[2], width_m=2.0, heading_deg=90.0))
        assert wider.gates == (course().gates[0], Gate(2, 2.0, 1.2, np.pi / 2, 0.2, -0.4))
        assert mission.load(folder.waypoints).gates == wider.gates
        session.undo("Anna")
        assert missions.same(session.content, course())
        revision = session.revision
        assert len(edit(ClearGate(serial=0, revision=revision, waypoint=ids[1])).gates) == 1
        tube = edit(SetTube(serial=0, revision=session.revision, radius_m=0.7)).keep_in
        assert tube == replace(course().keep_in, radius_m=0.7)
        assert edit(SetTube(serial=0, revision=session.revision, radius_m=None)).keep_in is None
        mission.save(folder.waypoints, course())
        assert session.take_files()
        assert missions.same(session.content, course())
    finally:
        session.close()


def test_a_new_gate_stands_across_the_way_and_is_refused_where_it_cannot_be():
    content = missions.with_mission(Content(), Mission(Waypoints(POINTS, np.full(4, np.nan))))
    ids = [p.id for p in content.points]
    after, _ = edits.apply(content, SetGate(serial=0, revision=0, waypoint=ids[1]))
    (gate,) = missions.mission_of(after).gates
    x, y, _ = POINTS[2] - POINTS[0]
    assert gate == Gate(1, 1.0, 1.0, float(np.arctan2(y, x)))
    wrong = ({"waypoint": ids[0]}, {"waypoint": ids[1], "width_m": 0.0}, {"waypoint": ids[1], "roll_deg": np.inf})
    for values in wrong:
        with pytest.raises(InputError):
            edits.apply(content, SetGate(serial=0, revision=0, **values))
    with pytest.raises(InputError, match="gate and a radius"):
        edits.apply(after, Ask(serial=0, revision=0, waypoints=[ids[1]], fly_by_m=0.5))
    with pytest.raises(InputError, match="radius_m"):
        edits.apply(content, SetTube(serial=0, revision=0, radius_m=0.01))


def test_reversed_gates_are_the_same_openings_passed_the_other_way():
    content = missions.with_mission(Content(), course())
    back, _ = edits.apply(content, Reverse(serial=0, revision=0))
    turned = {3 - gate.waypoint: gate.edges_m for gate in missions.mission_of(back).gates}
    for gate in course().gates:
        (left, up), (other_left, other_up) = gate.edges_m, turned[gate.waypoint]
        np.testing.assert_allclose([other_left, other_up], [-left, up], atol=1e-12)


def test_the_tube_that_is_shown_is_the_one_that_is_kept_in():
    recorded = missions.with_mission(Content(), course())
    np.testing.assert_array_equal(missions.tube_line(recorded), course().keep_in.polyline_world_m)
    loop = replace(course(), keep_in=KeepIn(0.5), laps=Laps(3), gates=())
    line = missions.tube_line(missions.with_mission(Content(), loop))
    np.testing.assert_array_equal(line, [*POINTS, POINTS[0]])
    vertices, faces = course_view.tube_mesh(line, 0.5)
    tube = planner.request.space.KeepIn(line, 0.5)
    depth = tube.distance(vertices)
    assert np.abs(depth).min() < 1e-6
    assert depth.min() > -1e-6  # nothing is drawn outside
    assert faces.max() == len(vertices) - 1
    lines = course_view.gate_lines(course().gates[1], POINTS[2])
    np.testing.assert_allclose(np.linalg.norm(lines[:4, 1] - lines[:4, 0], axis=1), [1.2, 1.5, 1.2, 1.5])


@given(asked_missions())
def test_flown_ids_are_those_of_the_unrolled_waypoints(asked: Mission):
    content = missions.with_mission(Content(), asked)
    places = {p.id: p.position_world_m for p in content.points}
    flown = [places[i] for i in missions.flown(content) if i is not None]
    np.testing.assert_array_equal(flown, asked.unrolled().waypoints.positions_world_m)


@given(asked_missions())
def test_reversing_flies_the_same_legs_backwards_at_the_same_speeds_and_twice_changes_nothing(asked: Mission):
    """With waypoints that lead into the loop and out of it, too."""
    content = missions.with_mission(Content(), asked)
    before = missions.mission_of(content).unrolled()
    try:
        once = edit(content, Reverse)
    except InputError:  # the only thing that a document cannot say
        loop = missions.lap_ends(content)
        assert loop is not None
        unequal = [{getattr(p, name) for p in content.points[slice(*loop)]} for name in LEG_LIMITS]
        assert max(map(len, unequal)) > 1
        return
    assert missions.flown(once) == missions.flown(content)[::-1]
    assert legs(missions.mission_of(once).unrolled()) == legs(before)[::-1]
    assert jerks(missions.mission_of(once).unrolled()) == jerks(before)[::-1]
    twice = edit(once, Reverse)
    assert twice.points == content.points
    assert missions.mission_of(twice).laps == missions.mission_of(content).laps


def test_a_loop_whose_way_back_would_lose_its_speed_is_not_reversed():
    speeds = (LegSpeed(0, 1, 1.0), LegSpeed(1, 2, 2.0))
    content = opened(Mission(Waypoints(POINTS, np.full(4, np.nan)), laps=Laps(2), leg_speeds=speeds))
    with pytest.raises(InputError, match="the leg after waypoint 1 would be the way back of the laps"):
        edit(content, Reverse)


def test_a_mission_file_is_opened_edited_saved_and_the_undo_brings_the_file_back(tmp_path):
    folder = project.create(tmp_path / "project", "mission")
    mission.save(folder.waypoints, full())
    before = folder.waypoints.read_bytes()
    session = Session(folder, Settings())
    try:
        assert missions.same(session.content, full())
        first = session.content.points[0].id
        session.edit(Ask(serial=0, revision=0, waypoints=[first], stay_s=4.0), "Anna")
        session.edit(Loop(serial=0, revision=1, laps=0), "Anna")
        written = mission.load(folder.waypoints)
        assert (written.stays, written.laps) == ((Stay(0, 4.0),), None)
        session.undo("Anna")
        session.undo("Anna")
        assert missions.same(session.content, mission.load(folder.waypoints))
        assert mission.load(folder.waypoints).laps == full().laps
        assert folder.waypoints.read_bytes() == before
    finally:
        session.close()
    again = Session(folder, Settings())
    again.close()
    assert again.revision == session.revision  # its own file is no change by another program


def test_a_file_that_asks_for_no_yaw_mode_leaves_the_one_of_the_page():
    content = Content(settings=Settings(yaw="smooth"))
    assert missions.with_mission(content, Mission(Waypoints(POINTS, np.full(4, np.nan)))).settings.yaw == "smooth"


def test_a_document_of_an_older_version_is_opened_and_written_as_the_new_one(tmp_path):
    folder = project.create(tmp_path / "project", "old")
    Session(folder, Settings()).close()
    path = folder.folder / ".session" / "document.json"
    snapshot = msgspec.json.decode(path.read_bytes())
    snapshot["version"] = 1
    del snapshot["crc32"]  # which came later
    snapshot["content"]["settings"] = {"speed_m_s": 3.0}
    snapshot["content"]["points"] = [{"id": 0, "position_world_m": [1.0, 2.0, 3.0]}]
    path.write_bytes(msgspec.json.encode(snapshot))
    session = Session(folder, Settings())
    session.close()
    assert session.content.settings.speed_m_s == 3.0
    assert session.content.points[0].plain
    assert msgspec.json.decode(path.read_bytes())["version"] == journal.VERSION  # an older program would drop requests


@pytest.mark.parametrize(
    ("kind", "arguments", "reason"),
    [
        (Ask, {"waypoints": [0], "stay_s": 3601.0}, "from 0 to 3600 s"),
        (Ask, {"waypoints": [0], "stay_s": float("nan")}, "from 0 to 3600 s"),
        (Ask, {"waypoints": [1], "stay_s": 1.0}, "a stay and a radius"),
        (Ask, {"waypoints": [2], "stay_s": 1.0}, "a stay and a velocity"),
        (Ask, {"waypoints": [9], "stay_s": 1.0}, "deleted meanwhile"),
        (Ask, {"waypoints": [3], "leg_speed_m_s": 1.0}, "no leg follows waypoint 4"),
        (Ask, {"waypoints": [3], "leg_jerk_m_s3": 20.0}, "no leg follows waypoint 4"),
        (Ask, {"waypoints": [0], "leg_jerk_m_s3": float("nan")}, "from 0 to 100000 m/s3"),
        (Pass, {"waypoints": [0], "velocity_m_s": (0.0, 1e9, 0.0)}, "is the most"),
        (Loop, {"laps": 101}, "from 0"),
        (Loop, {"laps": 2, "lap_first": 2, "lap_last": 1}, "laps go from waypoint 3 to 2"),
        (SetGround, {"end": "take_off"}, "a stay and a take_off"),
        (SetGround, {"end": "landing", "climb_m_s": 0.0}, "more than 0"),
        (SetGround, {"end": "landing", "x_m": 1e9}, "within"),
        (Choose, {"look_at_m": (0.0, float("inf"), 0.0)}, "within"),
        (Choose, {"heading_deg": float("nan")}, "no heading"),
    ],
)
def test_a_request_that_cannot_be_met_is_refused_in_words(kind, arguments, reason):
    with pytest.raises(InputError, match=reason):
        edits.apply(opened(), kind(serial=0, revision=0, **arguments))


def test_zero_drops_a_request():
    asked = edit(opened(), Ask, waypoints=[0], leg_jerk_m_s3=20.0)
    after = edit(asked, Ask, waypoints=[0], stay_s=0.0, leg_speed_m_s=0.0, leg_jerk_m_s3=0.0)
    assert after.points[0].plain


@pytest.mark.parametrize("name", ["leg_speed_m_s", "leg_jerk_m_s3"])
def test_a_limit_of_all_legs_is_none_of_the_last_waypoint_which_no_leg_follows(name):
    after = edit(opened(), Ask, waypoints=[0, 1, 2, 3], **{name: 1.5})
    assert [getattr(point, name) for point in after.points] == [1.5, 1.5, 1.5, None]


def test_a_jerk_of_zero_drops_the_limit_of_the_whole_path():
    asked = edit(opened(), Choose, jerk_m_s3=30.0)
    assert asked.settings.jerk_m_s3 == 30.0
    assert edit(asked, Choose, speed_m_s=2.0).settings.jerk_m_s3 == 30.0
    assert edit(asked, Choose, jerk_m_s3=0.0).settings.jerk_m_s3 is None


def test_deleting_an_end_of_the_loop_takes_its_neighbour_instead():
    content = edit(edit(opened(), Loop, laps=2, lap_first=1, lap_last=None), Delete, waypoints=[1])
    assert missions.mission_of(content).laps == Laps(2, 1, -1)
    assert content.settings.lap_first == 2


def test_looking_at_a_point_begins_with_the_middle_of_the_waypoints():
    content = edit(opened(Mission(Waypoints(POINTS, np.full(4, np.nan)))), Choose, yaw="look_at")
    np.testing.assert_allclose(content.settings.look_at_world_m, POINTS.mean(axis=0), atol=0.01)
    turned = edit(content, Choose, yaw="fixed", heading_deg=450.0)
    assert missions.mission_of(turned).yaw == Yaw("fixed", pytest.approx(np.pi / 2))
