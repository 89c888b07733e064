"""The page of an empty project: each thing that is missing has a sentence and the buttons that bring it."""

import re
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
import trimesh
from PIL import Image

import vehicle
from flight import project
from gcs_web import GroundStation
from gcs_web.protocol.people import Person
from gcs_web.protocol.vehicle import FoundVehicle
from goshawk.station_jobs import KINDS, simulate
from tests.gcs_web.in_browser import needs_chromium, tab, visited
from tests.waiting import until as wait

pytestmark = needs_chromium
STEPS = {1: "None yet", 2: "There is no map", 3: "No vehicle is connected", 4: "No flights yet", 5: ""}


@pytest.fixture
def station(tmp_path: Path) -> Iterator[GroundStation]:
    opened = project.create(tmp_path / "yard", "yard")
    key = tmp_path / "link.key"
    with GroundStation(opened.folder, jobs=(*KINDS, simulate.kind(key)), key_file=key) as running:
        yield running


@pytest.fixture
def page(station, one_tab):
    with visited(station, one_tab) as opened:
        yield opened


def card(page, name: str):
    return page.get_by_role("region", name=name, exact=True)


def test_an_empty_project_opens_where_it_is_filled_and_every_step_says_what_it_lacks(page):
    page.get_by_role("heading", name="What do you have?").wait_for()
    for step, said in STEPS.items():
        page.keyboard.press(str(step))
        page.get_by_text(said).first.wait_for()
        assert page.get_by_role("button", name="Abort").is_visible()
    page.keyboard.press("2")
    page.get_by_role("region", name="Verdict").get_by_text("Import a map").wait_for()
    page.keyboard.press("3")
    page.get_by_role("button", name="An example").click()
    page.get_by_role("heading", name="What do you have?").wait_for()


def test_a_step_that_was_chosen_before_the_project_was_told_stays(station, browser):
    """On a slow line the page is there, and its keys work, before it knows what the project lacks."""
    waiting, socket = [], []

    def slow(page_end) -> None:
        station_end = page_end.connect_to_server()
        station_end.on_message(lambda said: waiting.append(said) if not socket else page_end.send(said))
        waiting.append(page_end)

    with tab(browser, with_view=False) as own:
        own.page.route_web_socket(re.compile("^ws"), slow)
        own.page.goto(station.url)
        wait(lambda: own.page.wait_for_timeout(20) or len(waiting) > 3, "what the station says")
        own.page.keyboard.press("4")
        page_end, *said = waiting
        socket.append(page_end)
        for message in said:
            page_end.send(message)
        own.page.get_by_text("Saved, revision").wait_for()
        own.page.get_by_text("No flights yet").first.wait_for()
        assert own.page.get_by_role("heading", name="What do you have?").count() == 0


def test_a_mesh_an_example_and_the_simulator_fill_it_on_the_page_alone(station, page, tmp_path: Path):
    room = tmp_path / "room.ply"
    trimesh.creation.box(bounds=[[0, 0, 0], [6, 4, 2.5]]).export(room)
    with page.expect_file_chooser() as chooser:
        card(page, "A map").get_by_text("Import a map").click()
    chooser.value.set_files(room)
    form = page.get_by_role("form", name="Map from a file")
    form.get_by_text("to 6.00, 4.00, 2.50 m").wait_for()
    form.get_by_text("Nothing is free until").wait_for()
    form.get_by_label("Unit").select_option("m")
    form.get_by_label("Up").select_option("z")
    form.get_by_label("A place that is free").fill("1, 1, 1")
    form.get_by_role("button", name="Start").click()
    card(page, "A map").get_by_role("button", name="Look at the map").wait_for()

    card(page, "A vehicle").get_by_role("button", name="An example").click()
    page.get_by_role("form", name="Example vehicle").get_by_label("Vehicle").select_option("rigter2019")
    page.get_by_role("form", name="Example vehicle").get_by_role("button", name="Start").click()
    card(page, "A vehicle").get_by_role("button", name="Plan with it").wait_for()

    card(page, "Connect").get_by_role("button", name="Start the simulator").click()
    page.get_by_role("form", name="Simulator").get_by_role("button", name="Start").click()
    card(page, "Connect").get_by_role("button", name="Fly it").wait_for()
    wait(lambda: station.watch.state().link == "fresh", "the simulator")
    card(page, "Connect").get_by_role("button", name=re.compile("Cancel")).click()
    card(page, "Connect").get_by_role("button", name="Start the simulator").wait_for()


def test_an_address_that_is_none_is_refused_and_a_vehicle_that_is_silent_is_left(station, page, tmp_path: Path):
    vehicle.save(station.desk.project.vehicle, vehicle.example("rigter2019"))
    card(page, "A vehicle").get_by_role("button", name="Plan with it").wait_for()
    card(page, "Connect").get_by_role("button", name="Connect to an address").click()
    form = page.get_by_role("form", name="Address of the vehicle")
    form.get_by_label("Address of the vehicle").fill("tcp://x")
    form.get_by_role("button", name="Connect").click()
    form.get_by_role("alert").get_by_text("udp://host:port").wait_for()
    form.get_by_label("Address of the vehicle").fill("udp://127.0.0.1:9")
    form.get_by_role("button", name="Connect").click()
    card(page, "Connect").get_by_text("udp://127.0.0.1:9: not heard.").wait_for()
    card(page, "Connect").get_by_role("button", name="Disconnect").click()
    card(page, "Connect").get_by_text("No vehicle is connected.").wait_for()


def test_the_example_is_one_press_and_is_planned_at_once(station, page):
    page.get_by_role("button", name="Open the example").click()
    card(page, "A map").get_by_role("button", name="Look at the map").wait_for()
    card(page, "A vehicle").get_by_role("button", name="Plan with it").click()
    page.get_by_text("Checked", exact=True).wait_for()
    assert len(station.desk.session.content.points) == 3
    page.keyboard.press("0")
    page.get_by_role("heading", name="What do you have?").wait_for()
    assert page.get_by_role("button", name="Open the example").count() == 0


def test_a_new_project_and_those_opened_before_are_offered_where_nothing_is_there_yet(
    station, page, monkeypatch, tmp_path
):
    far = project.create(tmp_path / "elsewhere" / "pond", "pond").folder
    opened: list[Path] = []
    monkeypatch.setattr(station.desk, "on_open", opened.append)
    monkeypatch.setattr(station.desk, "_opened_before", lambda: [far])
    page.get_by_role("button", name="New or recent project").click()
    page.get_by_text("in elsewhere: 0 trajectories, 0 flights").wait_for()
    form = page.get_by_role("form", name="New project")
    form.get_by_label("Name of a new project").fill("../x")
    form.get_by_role("button", name="New project").click()
    form.get_by_role("alert").get_by_text("cannot be a name here").wait_for()
    form.get_by_label("Name of a new project").fill("lap 3")
    form.get_by_role("button", name="New project").click()
    wait(lambda: opened == [tmp_path / "lap 3"], "the new project")


def test_a_new_project_is_not_made_where_this_one_cannot_be_left(station, page, monkeypatch, tmp_path):
    monkeypatch.setattr(station.desk, "on_open", lambda _: None)
    station.desk.control.take(Person("bo", "Bo"), force=False)
    page.get_by_role("button", name="New or recent project").click()
    form = page.get_by_role("form", name="New project")
    form.get_by_label("Name of a new project").fill("lap 3")
    form.get_by_role("button", name="New project").click()
    form.get_by_role("alert").get_by_text("in control").wait_for()
    assert not (tmp_path / "lap 3").exists()
    page.keyboard.press("Escape")


def test_vehicles_on_the_net_are_looked_for_and_connected_to(station, page, monkeypatch):
    card(page, "Connect").get_by_role("button", name="Connect to an address").click()
    form = page.get_by_role("form", name="Address of the vehicle")
    monkeypatch.setattr(station.desk, "find_vehicles", list)
    form.get_by_role("button", name="Look on the net").click()
    form.get_by_text("Nobody answered").wait_for()
    found = [FoundVehicle("udp://127.0.0.1:9", 1)]
    station.desk.control.take(Person("bo", "Bo"), force=False)
    monkeypatch.setattr(station.desk, "find_vehicles", lambda: found)
    form.get_by_role("button", name="Look on the net").click()
    form.get_by_role("status").get_by_role("listitem").get_by_text("system 1").wait_for()
    form.get_by_role("button", name="Connect to udp://127.0.0.1:9").click()
    form.get_by_role("alert").get_by_text("in control").wait_for()
    station.desk.control.give_up(Person("bo", "Bo"))
    monkeypatch.setattr(station.desk, "find_vehicles", lambda: found)
    form.get_by_role("button", name="Look on the net").click()
    form.get_by_role("button", name="Connect to udp://127.0.0.1:9").click()
    card(page, "Connect").get_by_text("udp://127.0.0.1:9: not heard.").wait_for()
    card(page, "Connect").get_by_role("button", name="Disconnect").click()


def test_a_ros_map_is_imported_with_its_image(station, page, tmp_path: Path):
    floor = np.full((40, 60), 254, dtype=np.uint8)
    floor[[0, -1]] = floor[:, [0, -1]] = 0
    Image.fromarray(floor).save(tmp_path / "hall.pgm")
    (tmp_path / "hall.yaml").write_text(
        "image: hall.pgm\nresolution: 0.1\norigin: [0, 0, 0]\nnegate: 0\noccupied_thresh: 0.65\nfree_thresh: 0.25\n"
    )
    with page.expect_file_chooser() as chooser:
        card(page, "A map").get_by_text("Import a map").click()
    chooser.value.set_files([tmp_path / "hall.pgm", tmp_path / "hall.yaml"])
    form = page.get_by_role("form", name="Map from a file")
    form.get_by_label("File").select_option("hall.yaml")
    form.get_by_text("say between which heights").wait_for()
    form.get_by_label("Between heights").fill("0, 2.5")
    form.get_by_role("button", name="Start").click()
    card(page, "A map").get_by_role("button", name="Look at the map").wait_for()
    assert station.desk.parts.map(station.desk.inputs).field.distance([[3.0, 2.0, 1.2]])[0] > 1.0
