"""Files that earlier programs wrote are read: those in `earlier_files` were written by each version's own writer.

A new version of a format brings a file of the one before it: `docs/reference/formats.md` says what is promised.
"""

import re
import shutil
from pathlib import Path

import numpy as np
import pytest

import vehicle
from esdf import load_edits, solids
from flight import flight_log, mission, project, trajectory
from gcs_web.document import journal
from gcs_web.document.document import Settings
from gcs_web.document.session import Session
from mapping.camera import rig

EARLIER = Path(__file__).parent / "earlier_files"
POINTS = np.array([[0.0, 0.0, 1.0], [4.0, 1.0, 1.5], [2.0, -1.0, 1.0]])
YAW = np.array([np.nan, 1.5, np.nan])


def test_a_project_of_the_first_version(tmp_path):
    shutil.copy(EARLIER / "project.toml", tmp_path)
    assert project.open_project(tmp_path).name == "first"


def test_waypoints_of_version_1_and_a_mission_of_version_2():
    plain, asked = project.load_waypoints(EARLIER / "waypoints.json"), mission.load(EARLIER / "mission.json")
    for read in (plain, asked.waypoints):
        np.testing.assert_array_equal(read.positions_world_m, POINTS)
        np.testing.assert_array_equal(read.yaw_rad, YAW)
    assert asked.laps is not None
    assert asked.laps.count == 2
    assert [(stay.waypoint, stay.duration_s) for stay in asked.stays] == [(1, 1.5)]
    assert [(leg.first, leg.last, leg.speed_m_s) for leg in asked.leg_speeds] == [(0, 1, 2.0)]


@pytest.mark.parametrize(
    ("name", "version", "as_checked", "record_kept"),
    [("1", 1, False, None), ("1_hashed", 1, True, None), ("2", 2, True, True)],
)
def test_trajectories_of_versions_1_and_2_with_what_their_checks_vouch_for(name, version, as_checked, record_kept):
    item = trajectory.load(EARLIER / f"trajectory_{name}.json")
    assert (item.name, item.version, item.checked) == ("lap", version, True)
    assert (item.as_checked, item.record_kept) == (as_checked, record_kept)
    assert item.trajectory.duration_s == 2.0
    np.testing.assert_allclose(item.trajectory.position(np.array([0.0, 1.0, 2.0]))[:, 0], [0.0, 2.0, 4.0])
    np.testing.assert_array_equal(item.waypoints_world_m, POINTS)


def test_a_flight_log_of_the_first_version():
    log = flight_log.load(EARLIER / "flight.parquet")
    np.testing.assert_allclose(log.time_s, 0.01 * np.arange(5))
    np.testing.assert_array_equal(log.vector("position_world_m"), np.arange(15.0).reshape(5, 3))
    np.testing.assert_array_equal(log.vector("rotor_speed_rad_s"), np.full((5, 4), 500.0))


def test_a_vehicle_file_of_the_first_version_is_the_same_vehicle():
    """Its hash is what that version made of it, so plans of then still name it."""
    model = vehicle.load(EARLIER / "vehicle.toml")
    assert (model.name, model.mass_kg, model.rotors) == ("hummingbird", 0.5, 4)
    assert model.value("thrust_quadratic.k_n_s2") == 5.57e-6
    assert vehicle.vehicle_hash(model) == "8a6f146b79c30bd74c94a4e350c7fe7d8cc1f4e516117c87ebcbe2032a02c732"


def test_cameras_of_the_first_version():
    cameras = rig.load(EARLIER / "camera.toml")
    assert [camera.name for camera in cameras] == ["left", "right"]
    assert cameras.refine_intrinsics
    assert cameras.baseline_m == pytest.approx(0.11)
    np.testing.assert_array_equal(cameras["left"].params, [400.0, 401.0, 320.0, 240.0, -0.01, 0.002, 0.0, 0.0])


def test_edits_of_a_map_of_the_first_version():
    zone, crate = load_edits(EARLIER / "edits.json")
    assert (zone.action, zone.name, zone.solid) == ("no-fly", "stairs", solids.Sphere((1.0, 2.0, 0.5), 0.3))
    assert (crate.action, crate.name, crate.solid) == ("add", "crate", solids.Box((0.0, 0.0, 0.0), (1.0, 1.0, 2.0)))


@pytest.mark.parametrize("version", range(1, journal.VERSION))
def test_a_document_of_each_earlier_version_opens_with_its_journal_and_its_undo(tmp_path, version):
    opened = project.create(tmp_path / "project", "old")
    shutil.copytree(EARLIER / f"document_{version}", opened.folder / ".session")
    session = Session(opened, Settings())
    try:
        assert [point.position_world_m for point in session.content.points] == [tuple(p) for p in POINTS[:2].tolist()]
        assert session.document().undo == "waypoint 3 removed"
        session.undo("Ada")
        assert [point.position_world_m for point in session.content.points] == [tuple(p) for p in POINTS.tolist()]
    finally:
        session.close()


def test_a_newer_version_of_each_is_refused_with_the_way_out(tmp_path):
    readers = {
        "waypoints.json": project.load_waypoints,
        "trajectory_2.json": trajectory.load,
        "vehicle.toml": vehicle.load,
        "camera.toml": rig.load,
        "edits.json": load_edits,
    }
    for name, read in readers.items():
        newer = tmp_path / name
        newer.write_text(re.sub(r'("?version"?\s*[=:]\s*)\d+', r"\g<1>99", (EARLIER / name).read_text(), count=1))
        with pytest.raises(Exception, match="update Goshawk"):
            read(newer)
