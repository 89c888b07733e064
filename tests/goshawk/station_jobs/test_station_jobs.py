"""The station's kinds of jobs do what the verbs do, with a project's own files."""

import shutil
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
import pytest

import vehicle
from flight import FormatError, InputError, Waypoints, project, silent, trajectory
from gcs_web.jobs.jobs import Jobs
from goshawk.station_jobs import KINDS, identify, map_images, plan_batch
from mapping.camera import rig
from tests.waiting import until


@pytest.fixture
def opened(pillar_map: Path, tmp_path: Path) -> project.Project:
    """A project with a map, a vehicle and two missions, the second of which ends in a pillar."""
    made = project.create(tmp_path / "project", "pillars")
    shutil.copytree(pillar_map, made.map)
    vehicle.save(made.vehicle, vehicle.example("rigter2019"))
    for name, end in (("across", [5.2, 0.8, 1.2]), ("into", [4.0, 2.6, 1.2])):
        places = np.array([[0.8, 0.8, 1.0], end])
        (made.folder / "missions").mkdir(exist_ok=True)
        project.save_waypoints(made.folder / "missions" / f"{name}.json", Waypoints(places, np.full(2, np.nan)))
    return made


def test_a_folder_of_missions_is_planned_and_every_refusal_is_named(opened: project.Project):
    jobs = Jobs(opened, KINDS, lambda: None, lambda kind, result: kind.done(None, result), lambda _: None)  # type: ignore[arg-type]
    try:
        form = {field.name: field for field in jobs.state().kinds[0].fields}
        assert form["missions"].choices == ["missions"]
        jobs.start("plan_batch", {"missions": "missions"}, "Ada")
        until(lambda: jobs.state().jobs[0].state not in ("waiting", "running"), "the plans")
        ended = jobs.state().jobs[0]
    finally:
        jobs.close()
    assert ended.state == "done"
    assert ended.words.startswith("1 of 2 missions planned. into: ")
    assert trajectory.load(opened.folder / "plans" / "trajectories" / "across.json").checked


@pytest.mark.parametrize(
    ("kind", "arguments", "said"),
    [
        (plan_batch.KIND, {"missions": "../missions"}, "no folder of waypoint files"),
        (plan_batch.KIND, {"missions": "missions", "out": "../plans"}, "cannot be a name"),
        (plan_batch.KIND, {"missions": "missions", "out": "map"}, "cannot be written to map"),
        (identify.KIND, {"flights": ["none"]}, "no flight 'none'"),
        (map_images.KIND, {"images": "photos", "camera": "camera.toml"}, "no folder of images"),
    ],
)
def test_what_is_not_in_the_project_is_refused(
    opened: project.Project, kind: Any, arguments: dict[str, Any], said: str
):
    with pytest.raises(InputError, match=said):
        kind.check(opened, msgspec.convert(arguments, kind.arguments))


def test_a_fit_never_replaces_a_vehicle_unasked(opened: project.Project):
    opened.flight("a").parent.mkdir()
    opened.flight("a").touch()
    with pytest.raises(InputError, match="is a vehicle file"):
        identify.KIND.check(opened, identify.Arguments(["a"], out="vehicle"))
    identify.KIND.check(opened, identify.Arguments(["a"]))


def test_a_map_is_made_only_where_it_is_asked_to_replace_the_present_one(opened: project.Project):
    (opened.folder / "photos").mkdir()
    (opened.folder / "photos" / "0.jpg").touch()
    (opened.folder / "photos" / "camera.toml").touch()
    assert map_images.KIND.choices(opened) == {
        "images": ["photos"],
        "camera": ["photos/camera.toml"],
        "poses": [""],
        "odometry": [""],
    }
    asked = map_images.Arguments("photos", "photos/camera.toml")
    with pytest.raises(InputError, match="has a map"):
        map_images.KIND.check(opened, asked)
    again = msgspec.structs.replace(asked, overwrite=True)
    map_images.KIND.check(opened, again)
    with pytest.raises(FormatError, match="is empty"):  # an empty file is no camera; the map stays
        map_images.KIND.run(opened.folder, again, silent)
    assert opened.map.is_dir()


def test_a_map_takes_recorded_motion_and_a_thickness_of_the_project_alone(opened: project.Project):
    photos = opened.folder / "photos"
    photos.mkdir()
    (photos / "0.jpg").touch()
    rig.save(photos / "camera.toml", rig.Rig((rig.forward_camera("PINHOLE", 64, 48, [50.0, 50.0, 32.0, 24.0]),)))
    lines = [f"{0.1 * k:.1f} {k} 0 0 0 0 0 1" for k in range(4)]
    (photos / "tracker.txt").write_text("# a tracker\n" + "\n".join(lines))
    (photos / "times.csv").write_text("image,time_s\n0.jpg,0\n")
    (photos / "binary.tum").write_bytes(b"\xff\xfe\x00")
    assert map_images.KIND.choices(opened)["poses"] == ["", "photos/tracker.txt"]
    asked = map_images.Arguments("photos", "photos/camera.toml", poses="photos/tracker.txt", overwrite=True)
    map_images.KIND.check(opened, asked)
    assert "recorded poses: 4 over 0 s" in map_images.KIND.foresee(opened, asked)
    for field, value in (("odometry", "../tracker.txt"), ("poses", "photos/times.csv"), ("thinnest_m", 1e-4)):
        with pytest.raises(InputError, match=r"recorded motion|thinnest"):
            map_images.KIND.check(opened, msgspec.structs.replace(asked, **{field: value}))
