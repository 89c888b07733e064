"""The project under edit, without page and planner: undo, redo, and which plan counts."""

import html
import shutil
from pathlib import Path

import numpy as np
import pytest

import vehicle
from flight import InputError, Trajectory, TrajectoryFile, Waypoints, project, trajectory
from gcs_web.page import plain
from gcs_web.session import PlanResult, Session

START = np.array([[0.8, 0.8, 1.0], [3.0, 2.0, 1.2], [5.2, 0.8, 1.2]])


@pytest.fixture
def session(pillar_map: Path, tmp_path: Path, monkeypatch):
    opened = project.create(tmp_path / "project", "two pillars")
    shutil.copytree(pillar_map, opened.map)
    vehicle.save(opened.vehicle, vehicle.example("rigter2019"))
    project.save_waypoints(opened.waypoints, Waypoints(START, np.full(3, np.nan)))
    monkeypatch.setattr(Session, "request_plan", lambda _: None)
    edited = Session(opened)
    yield edited
    edited.close()


def raised(session: Session, index: int, by_m: float = 0.1) -> np.ndarray:
    """Lift a waypoint; the positions after it."""
    session.move(index, session.positions_world_m[index] + [0.0, 0.0, by_m])
    return session.positions_world_m


def test_undo_and_redo_walk_along_the_same_changes(session: Session):
    steps = [START, *(raised(session, i) for i in range(3))]
    for expected in reversed(steps[:-1]):
        assert session.undo()
        np.testing.assert_array_equal(session.positions_world_m, expected)
    assert not session.undo()
    for expected in steps[1:]:
        assert session.redo()
        np.testing.assert_array_equal(session.positions_world_m, expected)
    assert not session.redo()


def test_a_new_change_discards_the_redo_list(session: Session):
    raised(session, 0)
    session.undo()
    after = raised(session, 1)
    assert not session.state()["can_redo"]
    assert not session.redo()
    np.testing.assert_array_equal(session.positions_world_m, after)


def test_moving_a_waypoint_to_where_it_is_changes_nothing(session: Session):
    before = session.state()
    session.move(1, START[1])
    assert session.state() == before


def test_every_change_is_on_disk_at_once_and_a_bad_one_is_not_taken_over(session: Session):
    after = raised(session, 2)
    np.testing.assert_array_equal(project.load_waypoints(session.project.waypoints).positions_world_m, after)
    with pytest.raises(InputError, match="not finite"):
        session.move(0, np.array([np.nan, 0.0, 1.0]))
    np.testing.assert_array_equal(session.positions_world_m, after)
    assert session.undo()
    np.testing.assert_array_equal(session.positions_world_m, START)


def test_the_last_two_waypoints_stay(session: Session):
    session.delete(1)
    with pytest.raises(InputError, match="two waypoints"):
        session.delete(0)
    assert len(session.positions_world_m) == 2


def test_a_plan_for_waypoints_that_were_changed_since_is_dropped(session: Session):
    def answer(revision: int) -> PlanResult:
        return PlanResult(revision, None, np.empty(0), np.empty((0, 3)), f"answer to {revision}")

    first = session.state()["revision"]
    raised(session, 1)
    session._receive(answer(first))
    assert session.plan is None
    session._receive(answer(first + 1))
    assert session.plan is not None
    session._receive(answer(first))  # a late one does not displace it
    assert session.state()["problem"] == f"answer to {first + 1}"
    raised(session, 1)
    assert session.plan is None


def planned(session: Session) -> None:
    """Give the session a checked plan for its waypoints."""
    revision = session.state()["revision"]
    hover = Trajectory(np.array([1.0 + revision]), np.zeros((1, 4, 8)))
    file = TrajectoryFile(hover, "plan", "ab" * 32, "cd" * 32, START, {"passed": True})
    session._receive(PlanResult(revision, file, np.ones(1), np.zeros((1, 3)), ""))


def test_a_saved_trajectory_is_replaced_only_when_asked_and_kept_beside(session: Session):
    planned(session)
    path = session.save_trajectory("lap").path
    first = path.read_bytes()
    assert trajectory.load(path).name == "lap"
    assert session.save_trajectory("lap").kept is None  # the same plan once more: nothing to do
    raised(session, 1)
    planned(session)
    assert session.would_replace("lap") == path
    with pytest.raises(InputError, match=r"lap\.json exists"):
        session.save_trajectory("lap")
    assert path.read_bytes() == first
    kept = session.save_trajectory("lap", overwrite=True).kept
    assert kept is not None
    assert kept.read_bytes() == first
    assert trajectory.load(path).trajectory.duration_s == 2.0
    assert session.would_replace("lap") is None


@pytest.mark.parametrize("name", ["../../../x", "", ".", ".hidden", "a/b", "a\\b", "<b>x</b>", "[x](y)", "{x}", "x\n"])
def test_a_name_that_leads_elsewhere_or_is_markup_is_refused(session: Session, name: str):
    planned(session)
    with pytest.raises(InputError, match="cannot be a name"):
        session.save_trajectory(name, overwrite=True)
    assert not list(session.project.folder.parent.rglob("*x*.json"))


def test_the_waypoints_that_a_session_began_with_are_kept(session: Session):
    raised(session, 0)
    raised(session, 1)
    kept = sorted(session.project.folder.glob("waypoints.json.old-*"))
    assert len(kept) == 1
    np.testing.assert_array_equal(project.load_waypoints(kept[0]).positions_world_m, START)


@pytest.mark.parametrize(
    "text", ["<img src=x>", "{alert(1)}", "[a](b)", "![a](b)", "**a**", "`a`", "&lt;", "a_b", "x | y"]
)
def test_no_text_from_elsewhere_is_markup_on_the_page(text: str):
    shown = plain(text)
    assert not set(shown.replace("&#", "")) & set("<>{}[]*`|!&")
    assert html.unescape(shown) == text
