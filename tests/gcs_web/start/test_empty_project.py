"""An empty project: it opens, says what is missing, and takes a vehicle and an address while it runs."""

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

import vehicle
from firmware_bridge import SitlVehicle, controller, keys
from flight import InputError, project
from gcs_web import GroundStation
from goshawk.commands.project.project_parts import check_for_station
from goshawk.station_jobs import KINDS
from tests.gcs_web.station_socket import Page, visit


@pytest.fixture
def station(tmp_path: Path) -> Iterator[GroundStation]:
    opened = project.create(tmp_path / "yard", "yard")
    with GroundStation(opened.folder, jobs=KINDS, key_file=tmp_path / "link.key") as running:
        yield running


def test_an_empty_folder_becomes_a_project_and_another_one_does_not(tmp_path: Path):
    (tmp_path / "empty").mkdir()
    assert check_for_station(tmp_path / "empty").name == "empty"
    (tmp_path / "letters").mkdir()
    (tmp_path / "letters" / "to-a-friend.txt").write_text("hello")
    with pytest.raises(InputError, match=r"no project\.toml"):
        check_for_station(tmp_path / "letters")
    with pytest.raises(InputError, match="does not exist"):
        check_for_station(tmp_path / "nowhere")


def test_what_is_missing_is_told_and_what_needs_it_is_answered_with_a_sentence(station):
    async def talk(page: Page) -> None:
        files = page.state["files"]
        assert not files["has_map"]
        assert not files["has_vehicle"]
        await page.until(lambda p: "vehicle" in p.state)
        assert page.state["vehicle"]["link"] == "none"
        for _ in range(2):
            assert (await page.edit("insert", after=None, x_m=1.0, y_m=1.0, z_m=1.0))["error"] == ""
        await page.until(lambda p: p.state["plan"]["revision"] == p.state["document"]["revision"])
        assert page.state["plan"]["state"] == "none"
        for name, given in (("save", {"name": "lap"}), ("take_control", {}), ("prepare_upload", {}), ("abort", {})):
            said = (await page.command(name, **given))["error"]
            assert said or name == "take_control", name
            assert "internal error" not in said
            assert "--" not in said, said  # the page has buttons where the command line has options
        assert not [text for text in page.notices if "vehicle.toml" in text]

    visit(station, 1, talk)


def test_a_vehicle_that_comes_is_told_with_its_model(station):
    async def talk(page: Page) -> None:
        vehicle.save(station.desk.project.vehicle, vehicle.example("rigter2019"))
        await page.until(lambda p: p.state["files"]["has_vehicle"] and "model" in p.state)

    visit(station, 1, talk)


def test_a_page_connects_to_a_vehicle_and_leaves_it_but_not_in_flight(station, tmp_path: Path):
    believed = vehicle.example("rigter2019")
    on_ground = vehicle.simulate.State(position_world_m=np.zeros(3))
    plant = vehicle.simulate.Plant(believed, on_ground, ground_m=0.0)
    key = keys.create(tmp_path / "link.key")

    async def talk(page: Page, other: Page) -> None:
        assert "udp://host:port" in (await page.command("connect", url="tcp://x"))["error"]
        assert (await page.command("connect", url=simulated.url))["error"] == ""
        await page.until(lambda p: p.state["vehicle"]["link"] == "fresh" and p.state["vehicle"]["checks"])
        assert (await other.command("take_control"))["error"] == ""
        assert "is in control" in (await page.command("connect", url=""))["error"]
        assert (await other.command("give_up_control"))["error"] == ""
        assert (await page.command("take_control"))["error"] == ""
        nonce = (await page.command("prepare_order"))["nonce"]
        station.watch.order(station_arm())
        await page.until(lambda p: p.state["vehicle"]["armed"])
        assert "armed" in (await page.command("connect", url=""))["error"]
        assert (await page.command("order", order="disarm", nonce=nonce))["error"] == ""
        await page.until(lambda p: not p.state["vehicle"]["armed"])
        assert (await page.command("connect", url=""))["error"] == ""
        await page.until(lambda p: p.state["vehicle"]["link"] == "none")

    with SitlVehicle(plant, controller.parameters_of(believed).parameters, key=key) as simulated:
        visit(station, 2, talk)


def station_arm():
    from firmware_bridge.dialect.generated.messages import Command

    return Command.ARM
