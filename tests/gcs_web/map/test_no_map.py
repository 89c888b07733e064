"""A project without a map: its flights can be studied, nothing can be planned, and a map that comes is taken."""

import shutil
from collections.abc import Iterator
from pathlib import Path

import pytest

import vehicle
from flight import project
from gcs_web import GroundStation
from goshawk.station_jobs import KINDS
from tests.gcs_web.station_socket import Page, visit
from tests.waiting import until as wait

BOX = {"form": "box", "centre_m": [1.0, 1.0, 1.0], "size_m": [1.0, 1.0, 1.0]}


@pytest.fixture
def station(tmp_path: Path) -> Iterator[GroundStation]:
    opened = project.create(tmp_path / "yard", "yard")
    vehicle.save(opened.vehicle, vehicle.example("rigter2019"))
    with GroundStation(opened.folder, jobs=KINDS) as running:
        yield running


def test_nothing_is_planned_and_what_needs_a_map_is_answered_with_a_sentence(station):
    async def talk(page: Page) -> None:
        assert not page.state["files"]["has_map"]
        for _ in range(2):
            assert (await page.edit("insert", after=None, x_m=1.0, y_m=1.0, z_m=1.0))["error"] == ""
        await page.until(lambda p: p.state["plan"]["revision"] == p.state["document"]["revision"])
        assert page.state["plan"]["state"] == "none"
        assert "There is no map" in page.state["plan"]["sentence"]
        for name, given in (
            ("save", {"name": "lap"}),
            ("preview_map_edit", {"action": "no-fly", "shape": BOX}),
            ("compare_plans", {"names": [""]}),
            ("thin_path", {"source": "none", "tolerance_m": 0.1}),
        ):
            said = (await page.command(name, **given))["error"]
            assert said, name
            assert "internal error" not in said

    visit(station, 1, talk)


def test_a_map_that_is_added_is_shown_and_planned_in_and_without_it_again_nothing_is(station, pillar_map: Path):
    opened = station.desk.project

    async def talk(page: Page) -> None:
        for x_m in (0.8, 5.2):
            await page.edit("insert", after=None, x_m=x_m, y_m=0.8, z_m=1.0)
        shutil.copytree(pillar_map, opened.folder / ".coming")
        (opened.folder / ".coming").rename(opened.map)
        await page.until(lambda p: p.state["files"]["has_map"] and "map_shown" in p.state)
        await page.checked()  # at once: no plan of before became void
        opened.map.rename(opened.folder / "away")
        await page.until(lambda p: not p.state["files"]["has_map"] and p.state["plan"]["state"] == "none")
        assert (await page.command("save", name="lap"))["error"]

    visit(station, 1, talk)


def test_a_grid_of_metres_stands_in_for_the_map(station, pillar_map: Path):
    assert station.view._grid.visible
    shutil.copytree(pillar_map, station.desk.project.map)
    wait(lambda: not station.view._grid.visible, "the map in the 3D view")
