"""The desk without a browser: what it asks of the view, and what it refuses to open."""

import shutil
from collections.abc import Callable, Iterator
from contextlib import ExitStack, closing
from pathlib import Path
from unittest.mock import MagicMock

import numpy as np
import pytest

import mapping
import planner
import vehicle
from flight import InputError, Waypoints, file_format, project
from gcs_web.desk import Desk
from gcs_web.learning.consent import Consent
from gcs_web.planning import planning
from gcs_web.protocol.document import Choose, Move
from gcs_web.protocol.map import Paint, PreviewMapEdit, Shape, Slice
from gcs_web.protocol.people import Notice, Person
from gcs_web.protocol.vehicle import Vehicle
from tests.gcs_web.station_process import START
from tests.waiting import until


@pytest.fixture
def opened(pillar_map: Path, tmp_path: Path) -> project.Project:
    found = project.create(tmp_path / "project", "two pillars")
    shutil.copytree(pillar_map, found.map)
    vehicle.save(found.vehicle, vehicle.example("rigter2019"))
    return found


@pytest.fixture
def desk(opened: project.Project, monkeypatch) -> Iterator[Callable[[planner.PlanOptions], Desk]]:
    """`desk(options)` opens one that has no planner, and nobody to talk to."""
    monkeypatch.setattr(planning, "PlanningProcess", MagicMock())
    with ExitStack() as stack:

        def start(base: planner.PlanOptions) -> Desk:
            consent = stack.enter_context(closing(Consent(opened)))
            view = MagicMock(**{"map.required_m": 0.3})
            made = Desk(opened, MagicMock(), view, MagicMock(), base, consent=consent)
            stack.callback(made.close)
            return made

        yield start


def test_waypoints_are_placed_at_the_documents_clearance_before_any_plan(desk):
    running = desk(planner.PlanOptions(radius_m=0.3, margin_m=0.2))
    running.view.require_clearance.assert_called_once_with(pytest.approx(0.5))
    running.session.edit(Choose(serial=0, revision=0, margin_m=0.4), "Anna")
    running.view.require_clearance.assert_called_with(pytest.approx(0.7))


def test_a_method_that_the_page_cannot_set_is_refused_when_the_desk_opens(desk):
    with pytest.raises(InputError, match="can do fastest or corridor"):
        desk(planner.PlanOptions(method="bry"))


def notices(running: Desk) -> list[Notice]:
    published = [call.args[0] for call in running.hub.publish.call_args_list]
    return [message for message in published if isinstance(message, Notice)]


def judge_map(opened: project.Project, verdict: str, reasons: list[str]) -> None:
    path = opened.map / "map.toml"
    facts = file_format.read_toml(path, format="goshawk-map", version=1) | {"verdict": verdict, "reasons": reasons}
    file_format.write_toml(path, format="goshawk-map", version=1, body=facts)


def test_a_doubtful_map_is_said_with_its_reasons_when_it_is_opened_and_when_it_comes_later(desk, opened):
    running = desk(planner.PlanOptions())
    assert "doubtful" not in notices(running)[-1].text
    judge_map(opened, "doubtful", ["the walk is short", "the lens is bent"])
    running._files_changed()
    assert notices(running)[-1].text.endswith("The map is doubtful: the walk is short; the lens is bent.")
    running.close()
    again = desk(planner.PlanOptions())
    assert "opened" in notices(again)[-1].text
    assert "The map is doubtful: the walk is short; the lens is bent." in notices(again)[-1].text
    assert notices(again)[-1].level == "caution"


def test_a_refused_map_is_not_shown_and_the_reason_is_said(desk, opened):
    judge_map(opened, "refused", ["the scale is a guess"])
    running = desk(planner.PlanOptions())
    assert notices(running)[-1].level == "danger"
    assert "the scale is a guess" in notices(running)[-1].text
    running.view.draw_map.assert_not_called()


def test_a_verdict_that_nobody_knows_is_no_map_to_plan_in(desk, opened):
    judge_map(opened, "splendid", [])
    running = desk(planner.PlanOptions())
    assert "the verdict is 'splendid'; known are good" in notices(running)[-1].text


def test_an_opened_trajectory_is_the_plan_until_its_waypoints_change_or_are_planned_again(desk, opened):
    running = desk(planner.PlanOptions())
    area, believed = mapping.open_map(opened.map), vehicle.load(opened.vehicle)
    plan = planner.plan(Waypoints(START, np.full(len(START), np.nan)), area.field, believed)
    item = planner.trajectory_file(plan, name="kept")

    def asked() -> str:
        saved = running._planner.request.call_args.args[0].saved
        return "" if saved is None else saved.name

    running.open_saved(item, "Anna")
    assert (asked(), running.name) == ("kept", "kept")
    first = running.session.content.points[0].id
    now = running.session.revision
    running.session.edit(Move(serial=0, revision=now, waypoints=[first], x_m=0.9), "Anna")
    assert asked() == ""
    running.session.undo("Anna")
    assert asked() == "kept"
    running.request_plan(afresh=True)
    assert asked() == ""


ADA, BO = Person("a", "Ada"), Person("b", "Bo")


def test_one_person_paints_at_a_time_and_leaving_frees_the_brush(desk):
    running = desk(planner.PlanOptions())
    running.hub.people = [ADA, BO]
    brush = Paint(serial=0, active=True, radius_m=0.3)
    with pytest.raises(InputError, match="a brush of radius nan m is refused"):
        running.map.paint(Paint(serial=0, active=True, radius_m=float("nan")), ADA)
    running.map.paint(brush, ADA)
    running.view.map.mesh.paint.assert_called_with(True)
    for refused in (lambda: running.map.paint(brush, BO), lambda: running.map.preview(preview(), BO)):
        with pytest.raises(InputError, match="another person is drawing"):
            refused()
    running.map.preview(PreviewMapEdit(serial=0), ADA)  # the end of an earlier preview, that came late
    with pytest.raises(InputError, match="another person is drawing"):
        running.map.paint(brush, BO)
    running.left(ADA)
    running.view.map.mesh.paint.assert_called_with(False)
    running.map.paint(brush, BO)


def test_the_3d_view_shows_the_plan_when_a_page_has_left_and_nobody_looks_at_flights(desk):
    running = desk(planner.PlanOptions())
    running.view.flights.draw.return_value = (None, None)
    for others in ([BO], []):
        running.hub.people = others
        running.view.set_plan_aside.reset_mock()
        running.left(ADA)
        running.view.set_plan_aside.assert_called_once_with(False)


def preview() -> PreviewMapEdit:
    return PreviewMapEdit(serial=0, shape=Shape("box", (3.0, 3.4, 0.5), (0.5, 0.5, 0.5)))


def test_a_slice_that_is_nowhere_is_refused(desk):
    running = desk(planner.PlanOptions())
    for numbers in ((np.nan, 0.0, 0.0), (0.0, np.nan, 0.0), (0.0, 0.0, np.inf), (1e5, 0.0, 0.0)):
        with pytest.raises(InputError, match="give a finite place and direction"):
            running.map.show(Slice("oblique", numbers[0], "distance", *numbers[1:]), ["mesh"], "Ada")


def test_places_of_a_drag_become_one_stroke_and_those_beside_the_mesh_are_left_out(desk):
    running = desk(planner.PlanOptions())
    running.hub.people = [ADA]
    running.map.paint(Paint(serial=0, active=True, radius_m=0.3), ADA)
    for x in (1.0, 1.5, np.nan, 2.5):
        running.map._paint(np.array([x, 1.0, 0.5]), False)
    running.map._paint(np.full(3, np.nan), True)
    until(lambda: running.map._preview.shape is not None, "the stroke")
    shown = running.map._preview
    assert shown.shape.points_m == [(1.0, 1.0, 0.5), (1.5, 1.0, 0.5), (2.5, 1.0, 0.5)]
    assert (shown.author, shown.edit, shown.shape.form) == ("a", None, "stroke")
    assert shown.closed_m3 > 0.2
    running.map._paint(np.array([3.0, 1.0, 0.5]), False)  # the next one begins anew
    assert running.map._painted == [(3.0, 1.0, 0.5)]


def test_a_stroke_that_is_full_says_so_once_and_ends_there(desk, monkeypatch):
    monkeypatch.setattr("gcs_web.document.map_edits.MOST_POINTS", 3)
    running = desk(planner.PlanOptions())
    running.hub.people = [ADA]
    running.map.paint(Paint(serial=0, active=True, radius_m=0.3), ADA)
    for x in (1.0, 1.5, 2.0, 2.5, 3.0):
        running.map._paint(np.array([x, 1.0, 0.5]), False)
    said = [notice.text for notice in notices(running) if "stroke" in notice.text]
    assert said == ["A stroke has at most 3 places, and ends here; apply it, then draw on."]
    running.map._paint(np.full(3, np.nan), True)
    until(lambda: running.map._preview.shape is not None, "the stroke")
    assert [x for x, _, _ in running.map._preview.shape.points_m] == [1.0, 1.5, 2.0]


def test_another_project_is_refused_while_somebody_is_in_control_a_job_waits_or_the_vehicle_is_armed(desk, opened):
    other = project.create(opened.folder.parent / "yard", "yard")
    shutil.copytree(opened.map, other.map)
    shutil.copy(opened.vehicle, other.vehicle)
    running = desk(planner.PlanOptions())
    running.hub.people, went = [ADA], []
    with pytest.raises(InputError, match="goshawk gcs yard"):
        running.open_project("yard", ADA)
    running.on_open = went.append
    running.control.take(ADA, force=False)
    with pytest.raises(InputError, match="Ada is in control"):
        running.open_project("yard", ADA)
    running.control.give_up(ADA)
    running.watch = MagicMock()
    running.watch.state.return_value = Vehicle("lost", armed=True)
    with pytest.raises(InputError, match="the vehicle is armed"):
        running.open_project("yard", ADA)
    running.watch.state.return_value = Vehicle("fresh")
    running.jobs.close()
    running.jobs = MagicMock()
    running.jobs.end_if_idle.return_value = False
    with pytest.raises(InputError, match="a job runs or waits"):
        running.open_project("yard", ADA)
    running.jobs.end_if_idle.return_value = True
    assert went == []
    running.open_project("yard", ADA)
    assert went == [other.folder.resolve()]
    with pytest.raises(InputError):  # once
        running.open_project("yard", ADA)
    with pytest.raises(InputError, match="another project is being opened"):
        running.control.take(ADA, force=True)
