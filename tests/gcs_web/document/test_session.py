"""The project under edit: nothing is lost, nobody's change is undone in silence, however the station ends."""

import errno
import subprocess
import sys
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from flight import FormatError, InputError, Waypoints, mission, project
from gcs_web.document import journal
from gcs_web.document.document import Settings
from gcs_web.document.session import Session
from gcs_web.protocol.document import Delete, Insert, Move, Shift

START = np.array([[0.8, 0.8, 1.0], [3.0, 2.0, 1.2], [5.2, 0.8, 1.2]])
HEADINGS = np.array([np.nan, 0.5, np.nan])


def new_project(folder: Path) -> project.Project:
    opened = project.create(folder, "two pillars")
    project.save_waypoints(opened.waypoints, Waypoints(START, HEADINGS))
    return opened


@pytest.fixture
def opened(tmp_path: Path) -> project.Project:
    return new_project(tmp_path / "project")


@pytest.fixture
def session(opened):
    edited = Session(opened, Settings())
    yield edited
    edited.close()


def positions(session: Session) -> np.ndarray:
    return session.content.waypoints().positions_world_m


def raised(session: Session, waypoint: int, author: str = "Anna", *, revision: int | None = None) -> np.ndarray:
    """Lift a waypoint by 0.1 m; the positions after it."""
    seen = session.revision if revision is None else revision
    session.edit(Shift(serial=0, revision=seen, waypoints=[waypoint], z_m=0.1), author)
    return positions(session)


def reopened(session: Session) -> Session:
    session.close()
    return Session(session.project, Settings())


def test_undo_and_redo_walk_along_the_same_changes(session: Session):
    steps = [START, *(raised(session, i) for i in range(3))]
    for expected in reversed(steps[:-1]):
        session.undo("Anna")
        np.testing.assert_array_equal(positions(session), expected)
    with pytest.raises(InputError, match="nothing to undo"):
        session.undo("Anna")
    for expected in steps[1:]:
        session.redo("Anna")
        np.testing.assert_array_equal(positions(session), expected)
    with pytest.raises(InputError, match="nothing to redo"):
        session.redo("Anna")


def test_a_new_change_discards_the_redo_list(session: Session):
    raised(session, 0)
    session.undo("Anna")
    after = raised(session, 1)
    assert session.document().redo == ""
    with pytest.raises(InputError):
        session.redo("Anna")
    np.testing.assert_array_equal(positions(session), after)


def test_undo_says_whose_change_it_takes_back(session: Session):
    raised(session, 0, "Anna")
    assert session.undo("Ben").endswith("waypoint 1 moved 0.10 m (by Anna)")
    raised(session, 0, "Ben")
    assert session.undo("Ben").endswith("waypoint 1 moved 0.10 m")


def test_a_change_that_changes_nothing_is_no_revision(session: Session):
    move = Move(serial=0, revision=0, waypoints=[1], x_m=3.0)
    assert session.edit(move, "Anna") == ""
    assert session.revision == 0


def test_every_change_is_on_disk_at_once_with_its_headings(session: Session):
    after = raised(session, 2)
    saved = project.load_waypoints(session.project.waypoints)
    np.testing.assert_array_equal(saved.positions_world_m, after)
    np.testing.assert_array_equal(saved.yaw_rad, HEADINGS)


def test_undo_and_redo_go_on_after_a_restart(session: Session):
    first, second = raised(session, 0), raised(session, 1)
    session.undo("Anna")
    again = reopened(session)
    try:
        np.testing.assert_array_equal(positions(again), first)
        again.redo("Anna")
        np.testing.assert_array_equal(positions(again), second)
        again.undo("Anna")
        again.undo("Anna")
        np.testing.assert_array_equal(positions(again), START)
    finally:
        again.close()


def test_edits_of_different_waypoints_on_one_revision_are_both_kept(session: Session):
    raised(session, 0, "Anna", revision=0)
    raised(session, 1, "Ben", revision=0)
    np.testing.assert_allclose(positions(session) - START, [[0, 0, 0.1], [0, 0, 0.1], [0, 0, 0]], atol=1e-12)


def test_an_edit_of_what_another_person_changed_meanwhile_is_refused(session: Session):
    after = raised(session, 1, "Anna", revision=0)
    with pytest.raises(InputError, match="Anna changed the same meanwhile"):
        raised(session, 1, "Ben", revision=0)
    np.testing.assert_array_equal(positions(session), after)
    raised(session, 1, "Anna", revision=0)  # one's own are not in conflict: the page sends them before it hears
    raised(session, 1, "Ben")


def test_an_edit_of_a_waypoint_that_another_person_deleted_is_refused(session: Session):
    session.edit(Delete(serial=0, revision=0, waypoints=[1]), "Anna")
    with pytest.raises(InputError, match="deleted meanwhile"):
        raised(session, 1, "Ben", revision=0)


def test_an_undo_counts_as_a_change_of_what_it_takes_back(session: Session):
    raised(session, 1, "Anna")
    seen = session.revision
    session.undo("Anna")
    with pytest.raises(InputError, match="Anna changed the same meanwhile"):
        raised(session, 1, "Ben", revision=seen)


def test_what_another_program_wrote_is_taken_over_and_can_be_undone(session: Session):
    other = Waypoints(START[:2] + 0.5, np.array([0.1, np.nan]))
    project.save_waypoints(session.project.waypoints, other)
    assert session.take_files()
    np.testing.assert_array_equal(positions(session), other.positions_world_m)
    assert not session.take_files()
    session.undo("Anna")
    np.testing.assert_array_equal(positions(session), START)
    np.testing.assert_array_equal(session.content.waypoints().yaw_rad, HEADINGS)


def test_another_program_may_restore_the_file_of_before_the_last_edit(session: Session):
    after = raised(session, 1)
    project.save_waypoints(session.project.waypoints, Waypoints(START, HEADINGS))
    assert session.take_files()
    np.testing.assert_array_equal(positions(session), START)
    session.undo("Anna")
    np.testing.assert_array_equal(positions(session), after)
    np.testing.assert_array_equal(project.load_waypoints(session.project.waypoints).positions_world_m, after)


def test_a_file_that_could_not_be_written_is_no_change_of_another_program(session: Session, monkeypatch):
    with monkeypatch.context() as full:

        def refuse(*_: object) -> None:
            raise OSError(errno.ENOSPC, "No space left on device")

        full.setattr(project, "save_waypoints", refuse)
        after = raised(session, 1)
    assert not session.take_files()
    np.testing.assert_array_equal(positions(session), after)


def test_what_another_program_writes_during_an_edit_is_kept_beside_the_file_and_said(session: Session):
    other = Waypoints(START[:2] + 0.5, np.array([0.1, np.nan]))
    project.save_waypoints(session.project.waypoints, other)
    after = raised(session, 0)  # before anybody looked at the file
    np.testing.assert_array_equal(project.load_waypoints(session.project.waypoints).positions_world_m, after)
    kept = session.project.folder / "waypoints.json.old-1"
    np.testing.assert_array_equal(project.load_waypoints(kept).positions_world_m, other.positions_world_m)
    assert session.take_notice().endswith("its version is kept as waypoints.json.old-1")
    raised(session, 1)
    assert session.take_notice() == ""
    assert not session.project.folder.joinpath("waypoints.json.old-2").exists()


def test_a_file_that_another_program_wrote_into_a_project_without_one_is_kept_at_the_next_edit(tmp_path: Path):
    edited = Session(project.create(tmp_path / "project", "empty"), Settings())
    try:
        path = edited.project.waypoints
        project.save_waypoints(path, Waypoints(START, HEADINGS))
        edited.edit(Insert(serial=0, revision=0, after=None, x_m=1.0, y_m=1.0, z_m=1.0), "Anna")
        assert len(project.load_waypoints(path).positions_world_m) == 1
        kept = project.load_waypoints(path.with_name("waypoints.json.old-1"))
        np.testing.assert_array_equal(kept.positions_world_m, START)
        assert edited.take_notice().endswith("its version is kept as waypoints.json.old-1")
    finally:
        edited.close()


def test_a_damaged_file_of_another_program_is_refused_and_kept_at_the_next_edit(session: Session):
    session.project.waypoints.write_text("{")
    with pytest.raises(FormatError):
        session.take_files()
    raised(session, 0)
    assert session.project.folder.joinpath("waypoints.json.old-1").read_text() == "{"


def test_writers_on_three_threads_lose_no_edit_and_undo_nobody_elses(session: Session):
    edits_each = 50

    def lift(waypoint: int) -> None:
        for _ in range(edits_each):
            raised(session, waypoint, f"writer {waypoint}")

    with ThreadPoolExecutor(3) as writers:
        list(writers.map(lift, range(3)))
    assert session.revision == 3 * edits_each
    np.testing.assert_allclose(positions(session) - START, np.array([[0, 0, 0.1 * edits_each]] * 3), atol=1e-9)
    again = reopened(session)
    try:
        assert again.revision == 3 * edits_each
    finally:
        again.close()


def test_a_snapshot_that_the_disk_refuses_is_tried_again_and_loses_nothing(opened: project.Project, monkeypatch):
    monkeypatch.setattr(journal, "COMPACT_AFTER", 3)
    edited = Session(opened, Settings())
    snapshot = opened.folder / ".session" / "document.json"
    first = snapshot.read_bytes()
    with monkeypatch.context() as full:

        def refuse(*_: object) -> None:
            raise OSError(errno.ENOSPC, "No space left on device")

        full.setattr(journal.file_format, "write_bytes", refuse)
        full.setattr(project, "save_waypoints", refuse)
        after = [raised(edited, k) for k in (0, 1, 2, 0)][-1]
    assert snapshot.read_bytes() == first
    assert edited.take_notice().startswith("waypoints.json could not be written: No space left")
    np.testing.assert_array_equal(positions(edited), after)
    after = raised(edited, 1)
    assert snapshot.read_bytes() != first
    again = reopened(edited)
    try:
        np.testing.assert_array_equal(positions(again), after)
    finally:
        again.close()


class _Killed(BaseException):
    """As kill -9: nothing below catches it."""


def killed_before_the_file(session: Session, monkeypatch, change: Callable[[], object]) -> None:
    """Make a change whose station ends between the journal and `waypoints.json`."""

    def kill(*_):
        raise _Killed

    with monkeypatch.context() as patch:
        patch.setattr(mission, "save", kill)
        with pytest.raises(_Killed):
            change()


def test_killed_between_the_journal_of_an_undo_and_the_file_the_journal_counts(session: Session, monkeypatch):
    raised(session, 1)
    after = START
    killed_before_the_file(session, monkeypatch, lambda: session.undo("Anna"))
    again = reopened(session)
    try:
        np.testing.assert_array_equal(positions(again), after)
        np.testing.assert_array_equal(project.load_waypoints(again.project.waypoints).positions_world_m, after)
    finally:
        again.close()


def test_killed_between_the_journal_of_an_edit_and_the_file_the_journal_counts(session: Session, monkeypatch):
    killed_before_the_file(session, monkeypatch, lambda: raised(session, 1))
    after = positions(session)
    again = reopened(session)
    try:
        np.testing.assert_array_equal(positions(again), after)
    finally:
        again.close()


def test_what_another_program_put_back_while_the_station_was_closed_is_taken_over_and_can_be_undone(session: Session):
    """It equals the document of before the last edit, and yet it is no file that we left."""
    before = session.project.waypoints.read_bytes()
    after = raised(session, 1)
    session.close()
    session.project.waypoints.write_bytes(before)
    again = Session(session.project, Settings())
    try:
        np.testing.assert_array_equal(positions(again), START)
        again.undo("Anna")
        np.testing.assert_array_equal(positions(again), after)
    finally:
        again.close()


def test_two_stations_cannot_have_one_project(session: Session):
    with pytest.raises(InputError, match=r"another ground station \(process \d+\) has this project open"):
        Session(session.project, Settings())


def test_a_full_disk_refuses_the_change_and_loses_nothing(opened: project.Project):
    script = f"""
import resource, sys
from pathlib import Path
from flight import InputError, project
from gcs_web.document.document import Settings
from gcs_web.document.session import Session
from gcs_web.protocol.document import Shift
session = Session(project.open_project(Path({str(opened.folder)!r})), Settings())
def shift(z):
    session.edit(Shift(serial=0, revision=session.revision, waypoints=[0], z_m=z), "Anna")
shift(0.1)
size = (Path({str(opened.folder)!r}) / ".session" / "journal.jsonl").stat().st_size
import signal
signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
resource.setrlimit(resource.RLIMIT_FSIZE, (size + 20, resource.RLIM_INFINITY))
try:
    shift(0.2)
except InputError as error:
    print(error)
resource.setrlimit(resource.RLIMIT_FSIZE, (resource.RLIM_INFINITY, resource.RLIM_INFINITY))
shift(0.4)
"""
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert "the change was not saved" in done.stdout
    again = Session(opened, Settings())
    try:
        np.testing.assert_allclose(positions(again)[0], START[0] + [0.0, 0.0, 0.5], atol=1e-12)
    finally:
        again.close()


@settings(max_examples=40, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.integers(1, 400))
def test_a_journal_cut_off_anywhere_opens_with_all_whole_changes(tmp_path_factory, cut: int):
    edited = Session(new_project(tmp_path_factory.mktemp("cut") / "project"), Settings())
    after = [START, *(raised(edited, i) for i in (0, 1, 2))]
    path = edited.project.folder / ".session" / "journal.jsonl"
    data = path.read_bytes()
    edited.close()
    path.write_bytes(data[:-cut])
    edited.project.waypoints.unlink()
    again = Session(edited.project, Settings())
    try:
        whole = path.read_bytes().count(b"\n")
        assert again.revision == whole
        assert again.take_notice() == ""
        np.testing.assert_array_equal(positions(again), after[whole])
        raised(again, 0)
    finally:
        again.close()


def test_damage_inside_the_journal_is_told_and_the_rest_is_kept(session: Session):
    first = raised(session, 0)
    raised(session, 1)
    raised(session, 2)
    path = session.project.folder / ".session" / "journal.jsonl"
    session.close()
    lines = path.read_bytes().splitlines(keepends=True)
    lines[1] = lines[1].replace(b"waypoint 2", b"waypoint 7")
    path.write_bytes(b"".join(lines))
    session.project.waypoints.unlink()
    again = Session(session.project, Settings())
    try:
        np.testing.assert_array_equal(positions(again), first)
        said = "the journal is damaged after revision 1; what followed is kept in journal.jsonl.old-1"
        assert again.take_notice() == said
        assert (path.parent / "journal.jsonl.old-1").read_bytes() == b"".join(lines)
    finally:
        again.close()


def test_a_flipped_byte_anywhere_in_the_snapshot_is_refused_and_the_file_left_as_it_is(session: Session):
    raised(session, 0)
    session._journal.compact()
    raised(session, 1)
    session.close()
    path = session.project.folder / ".session" / "document.json"
    whole = path.read_bytes()
    for place in (*range(0, len(whole), 5), *range(len(whole) - 24, len(whole))):  # among them all of the CRC's own
        damaged = whole[:place] + bytes([whole[place] ^ (1 << place % 8)]) + whole[place + 1 :]
        path.write_bytes(damaged)
        with pytest.raises(FormatError, match=r"document\.json"):
            journal.Journal(path.parent)
        assert path.read_bytes() == damaged
    path.unlink()  # the way out that is told
    again = Session(session.project, Settings())
    try:
        lifted = START.copy()
        lifted[:2, 2] += 0.1
        np.testing.assert_allclose(positions(again), lifted)
    finally:
        again.close()


def test_a_flipped_byte_anywhere_in_the_journal_loses_no_waypoint_and_is_told(session: Session):
    for number in range(3):
        after = raised(session, number)
    session.close()
    path, waypoints = session.project.folder / ".session" / "journal.jsonl", session.project.waypoints.read_bytes()
    whole = path.read_bytes()
    for place in range(0, len(whole), 41):
        path.write_bytes(whole[:place] + bytes([whole[place] ^ (1 << place % 8)]) + whole[place + 1 :])
        session.project.waypoints.write_bytes(waypoints)
        again = Session(session.project, Settings())
        try:
            np.testing.assert_array_equal(positions(again), after)  # the file had them
            assert "journal is damaged" in again.take_notice() or "waypoint 3" in whole[place:].decode()
        finally:
            again.close()


def test_a_long_session_is_compacted_without_losing_undo(opened: project.Project, monkeypatch):
    monkeypatch.setattr(journal, "COMPACT_AFTER", 7)
    edited = Session(opened, Settings())
    steps = [START, *(raised(edited, k % 3) for k in range(20))]
    assert (opened.folder / ".session" / "journal.jsonl").read_bytes().count(b"\n") < 7
    again = reopened(edited)
    try:
        assert again.revision == 20
        for expected in reversed(steps[:-1]):
            again.undo("Anna")
            np.testing.assert_array_equal(positions(again), expected)
    finally:
        again.close()


def test_a_process_that_is_killed_loses_no_change_it_has_acknowledged(opened: project.Project):
    script = f"""
import sys
from pathlib import Path
from flight import project
from gcs_web.document.document import Settings
from gcs_web.document.session import Session
from gcs_web.protocol.document import Shift
session = Session(project.open_project(Path({str(opened.folder)!r})), Settings())
while True:
    session.edit(Shift(serial=0, revision=session.revision, waypoints=[0], z_m=0.001), "Anna")
    print(session.revision, flush=True)
"""
    acknowledged = 0
    for lines in (3, 1, 12, 5):
        child = subprocess.Popen([sys.executable, "-c", script], stdout=subprocess.PIPE, text=True)
        assert child.stdout is not None
        for _ in range(lines):
            acknowledged = int(child.stdout.readline())
        child.kill()
        acknowledged = max([acknowledged, *map(int, child.stdout.read().split())])
        child.wait()
        again = Session(opened, Settings())
        try:
            assert again.revision in (acknowledged, acknowledged + 1)
            expected = START[0, 2] + 0.001 * again.revision
            assert positions(again)[0, 2] == pytest.approx(expected, abs=1e-9)
        finally:
            again.close()
