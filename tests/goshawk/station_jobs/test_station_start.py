"""Jobs that fill an empty project: a map of a mesh or points, a vehicle, and a simulator that the station hears."""

import ast
import importlib
import inspect
import pkgutil
import re
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
import trimesh
from PIL import Image

import mapping.cloud
import vehicle
from esdf import FREE
from flight import InputError, Waypoints, project
from gcs_web import GroundStation
from gcs_web.jobs.jobs import Jobs
from gcs_web.protocol.jobs import Job
from goshawk.commands.learn import fit_options
from goshawk.station_jobs import KINDS, import_shape, simulate
from tests.gcs_web.station_socket import Page, visit
from tests.waiting import until


@pytest.fixture
def opened(tmp_path: Path) -> project.Project:
    return project.create(tmp_path / "yard", "yard")


@pytest.fixture
def jobs(opened: project.Project) -> Iterator[Jobs]:
    running = Jobs(opened, KINDS, lambda: None, lambda kind, result: kind.done(None, result), lambda _: None)  # type: ignore[arg-type]
    yield running
    running.close()


def ended(jobs: Jobs, kind: str, **arguments: object) -> Job:
    number = jobs.start(kind, arguments, "Ada")
    until(lambda: next(j for j in jobs.state().jobs if j.id == number).state not in ("waiting", "running"), kind)
    return next(job for job in jobs.state().jobs if job.id == number)


def send(opened: project.Project, name: str) -> Path:
    """A room of 6 x 4 x 2.5 m, where a page's files wait."""
    place = opened.folder / ".session" / "incoming" / name
    place.parent.mkdir(parents=True, exist_ok=True)
    room = trimesh.creation.box(bounds=[[0, 0, 0], [6, 4, 2.5]])
    if name.startswith("points"):
        room = trimesh.PointCloud(room.sample(60_000, seed=1))
    room.export(place)
    return place


def test_a_mesh_that_was_sent_becomes_the_map(jobs, opened: project.Project):
    send(opened, "room.ply")
    jobs.look()
    form = next(kind for kind in jobs.state().kinds if kind.name == "import_map")
    assert form.fields[0].choices == ["room.ply"]
    assert "from 0.00, 0.00, 0.00 to 6.00, 4.00, 2.50 m" in jobs.foresee("import_map", {"file": "room.ply"})
    done = ended(jobs, "import_map", file="room.ply", unit="m", up="z", observed="1,1,1")
    assert done.state == "done", done.words
    field = mapping.open_map(opened.map).field
    assert field.state[tuple(field.grid.index(np.array([[3.0, 2.0, 1.2]]))[0])] == FREE
    with pytest.raises(InputError, match="has a map"):
        jobs.start("import_map", {"file": "room.ply"}, "Ada")


def test_points_of_one_place_become_the_map(jobs, opened: project.Project):
    send(opened, "points.ply")
    done = ended(jobs, "import_map", file="points.ply", unit="m", up="z", sensor="3,2,1.2")
    assert done.state == "done", done.words
    assert mapping.open_map(opened.map).field.distance(np.array([[3.0, 2.0, 1.2]]))[0] > 0.5


def test_a_refusal_names_the_boxes_of_the_form(jobs, opened: project.Project):
    send(opened, "room.ply")
    failed = ended(jobs, "import_map", file="room.ply", sensor="1,1,1")
    assert failed.state == "failed"
    assert 'the box "Measured from"' in failed.words
    assert "--" not in failed.words
    assert not opened.has_map
    with pytest.raises(InputError, match="not here"):
        jobs.start("import_map", {"file": "other.ply"}, "Ada")


def test_a_mesh_far_from_its_origin_is_moved_by_the_box_that_the_refusal_names(jobs, opened: project.Project):
    place = send(opened, "room.obj")
    room = trimesh.load_mesh(place)
    room.apply_translation([512_000.25, 0.0, 0.5])
    room.export(place)
    with pytest.raises(InputError, match='give the box "Origin" 512000,0,0') as caught:
        jobs.foresee("import_map", {"file": "room.obj", "up": "z"})
    assert "--" not in str(caught.value)
    asked = {"file": "room.obj", "up": "z", "origin": "512000.25,0,0.5", "observed": "1,1,1"}
    assert "from 0.00, 0.00, 0.00 to 6.00, 4.00, 2.50 m" in jobs.foresee("import_map", asked)
    done = ended(jobs, "import_map", **asked)
    assert done.state == "done", done.words


def test_every_option_that_an_import_names_has_a_box_or_is_said_to_be_elsewhere():
    names = [f"mapping.cloud.{found.name}" for found in pkgutil.iter_modules(mapping.cloud.__path__)]
    names += [f"mapping.{name}" for name in ("foreign_mesh", "imported", "map_server", "reach")]
    names += [f"goshawk.commands.map.{name}" for name in ("import_map", "import_cloud")]
    sources = [ast.parse(inspect.getsource(importlib.import_module(name))) for name in names]
    constants = [node.value for source in sources for node in ast.walk(source) if isinstance(node, ast.Constant)]
    texts = [text for text in constants if isinstance(text, str) and " " in text]
    options = {option for text in texts for option in re.findall(r"--[a-z]+(?:-[a-z]+)*", text)}
    options -= {"--height"}  # of an export
    assert {"--origin", "--unit", "--gap"} <= options
    left = {option for option in options if "--" in fit_options.worded(f"give {option} 1", import_shape.BOXES)}
    assert left == set()


def test_a_ros_map_that_was_sent_takes_no_image_of_elsewhere(jobs, opened: project.Project, tmp_path: Path):
    Image.fromarray(np.full((40, 40), 0, np.uint8)).save(tmp_path / "secret.png")
    file = opened.folder / ".session" / "incoming" / "hall.yaml"
    file.parent.mkdir(parents=True)
    file.write_text(
        "image: ../../../secret.png\nresolution: 0.1\norigin: [0, 0, 0]\noccupied_thresh: 0.65\nfree_thresh: 0.2\n"
    )
    failed = ended(jobs, "import_map", file="hall.yaml", heights="0,2")
    assert failed.state == "failed"
    assert "it must be the name of a file that was sent with this one" in failed.words
    assert not opened.has_map


def test_a_vehicle_is_made_of_a_data_sheet_and_kept(jobs, opened: project.Project):
    with pytest.raises(InputError, match="Mass, Propeller"):
        jobs.start("new_vehicle", {"arm_mm": 125.0}, "Ada")
    heavy = ended(jobs, "new_vehicle", mass_g=2e6, arm_mm=125.0, propeller_in=5.0)
    assert heavy.state == "failed"
    assert "--" not in heavy.words
    done = ended(jobs, "new_vehicle", name="kite", mass_g=720.0, arm_mm=125.0, propeller_in=5.0)
    assert done.state == "done", done.words
    made = vehicle.load(opened.vehicle)
    assert made.name == "kite"
    assert made.mass_kg == pytest.approx(0.72)
    with pytest.raises(InputError, match="which is kept"):
        jobs.start("example_vehicle", {"example": "hummingbird"}, "Ada")


def test_an_example_becomes_the_vehicle(jobs, opened: project.Project):
    assert ended(jobs, "example_vehicle", example="hummingbird").state == "done"
    assert vehicle.load(opened.vehicle).name == vehicle.example("hummingbird").name


def test_the_simulator_stands_below_the_first_waypoint(opened: project.Project):
    assert simulate.start_world_m(opened) == (0.0, 0.0, 0.0)
    project.save_waypoints(
        opened.waypoints, Waypoints(np.array([[1.0, 2.0, 1.2], [3.0, 2.0, 1.2]]), np.full(2, np.nan))
    )
    assert simulate.start_world_m(opened) == (1.0, 2.0, 0.0)


def test_the_simulator_runs_beside_the_queue_and_is_heard_until_it_is_cancelled(
    opened: project.Project, tmp_path: Path
):
    vehicle.save(opened.vehicle, vehicle.example("rigter2019"))
    key = tmp_path / "link.key"

    async def talk(page: Page) -> None:
        await page.until(lambda p: "jobs" in p.state)
        assert (await page.command("start_job", kind="simulate", arguments={"wind_m_s": 1.0}))["error"] == ""
        await page.until(lambda p: p.state["vehicle"]["link"] == "fresh")
        assert "runs already" in (await page.command("start_job", kind="simulate", arguments={}))["error"]
        (job,) = page.state["jobs"]["jobs"]
        assert job["stage"] == page.state["vehicle"]["name"]
        assert station.desk.jobs.end_if_idle()  # it keeps nobody from another project
        assert (await page.command("cancel_job", job=job["id"]))["error"] == ""
        await page.until(lambda p: p.state["vehicle"]["link"] == "none")

    with GroundStation(opened.folder, jobs=(*KINDS, simulate.kind(key)), key_file=key) as station:
        visit(station, 1, talk)
