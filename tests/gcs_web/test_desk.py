"""The desk without a browser: what it asks of the view, and what it refuses to open."""

import shutil
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from pathlib import Path
from unittest.mock import MagicMock

import pytest

import planner
import vehicle
from flight import InputError, project
from gcs_web import planning, protocol
from gcs_web.desk import Desk


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
            made = Desk(opened, MagicMock(), MagicMock(), None, base)
            stack.callback(made.close)
            return made

        yield start


def test_waypoints_are_placed_at_the_documents_clearance_before_any_plan(desk):
    running = desk(planner.PlanOptions(radius_m=0.3, margin_m=0.2))
    running.view.require_clearance.assert_called_once_with(pytest.approx(0.5))
    running.session.edit(protocol.Choose(serial=0, revision=0, margin_m=0.4), "Anna")
    running.view.require_clearance.assert_called_with(pytest.approx(0.7))


def test_a_method_that_the_page_cannot_set_is_refused_when_the_desk_opens(desk):
    with pytest.raises(InputError, match="can do fastest or corridor"):
        desk(planner.PlanOptions(method="bry"))
