"""Points in metres with z up, and from where they were measured: units, axes, clocks, and what is refused."""

from pathlib import Path

import numpy as np
import pytest

from flight import FlightError, FloatArray
from mapping.cloud import point_cloud
from mapping.cloud.point_cloud import PointCloud

POINTS = np.random.default_rng(3).uniform([0.0, 0.0, 0.0], [6.0, 4.0, 2.5], (200, 3))
TIMES = np.linspace(100.0, 109.9, 200)


def written(path: Path, points: FloatArray, **more: np.ndarray) -> Path:
    """A binary PCD file with further columns."""
    columns = dict(zip("xyz", points.T, strict=True)) | more
    rows = np.zeros(len(points), [(name, column.dtype) for name, column in columns.items()])
    for name, column in columns.items():
        rows[name] = column
    kinds = {"f": "F", "i": "I", "u": "U"}
    head = [
        ("FIELDS", columns),
        ("SIZE", [c.dtype.itemsize for c in columns.values()]),
        ("TYPE", [kinds[c.dtype.kind] for c in columns.values()]),
        ("POINTS", [len(points)]),
        ("DATA", ["binary"]),
    ]
    text = "".join(f"{name} {' '.join(map(str, values))}\n" for name, values in head)
    path.write_bytes(text.encode() + rows.tobytes())
    return path


def poses(path: Path, times: FloatArray, first: float = 0.0) -> Path:
    """A straight way from (1, 1, 1) at 0.2 m/s along x, in TUM's format."""
    path.write_text("".join(f"{t:.6f} {1.0 + 0.2 * (t - times[0]) + first} 1 1 0 0 0 1\n" for t in times))
    return path


def refused(path: Path, **options: object) -> str:
    with pytest.raises(FlightError) as caught:
        point_cloud.read(path, **options)  # type: ignore[arg-type]
    return str(caught.value)


@pytest.mark.parametrize(
    ("scale", "unit", "said"), [(1.0, None, "m (guessed"), (1e3, None, "mm (g"), (100.0, "cm", "cm")]
)
def test_a_cloud_in_each_unit_is_the_same_cloud(tmp_path: Path, scale: float, unit: str | None, said: str) -> None:
    found = point_cloud.read(written(tmp_path / "a.pcd", scale * POINTS), unit=unit)
    assert found.points_world_m == pytest.approx(POINTS)
    assert found.unit.startswith(said)
    assert found.origins_world_m is None


def test_a_wrong_unit_is_refused(tmp_path: Path) -> None:
    assert "give --unit" in refused(written(tmp_path / "cm.pcd", 100.0 * POINTS))
    assert "another --unit" in refused(written(tmp_path / "mm.pcd", 1000.0 * POINTS), unit="m")
    assert "km from the origin" in refused(written(tmp_path / "far.pcd", POINTS + 4e5))


def test_points_that_were_rounded_to_single_precision_are_refused_whatever_the_origin(tmp_path: Path) -> None:
    grid = np.array([512_000.0, 5_403_000.0, 410.0])
    rounded = written(tmp_path / "a.pcd", (POINTS + grid).astype(np.float32))  # type: ignore[arg-type]
    for options in ({}, {"origin": grid}):
        said = refused(rounded, **options)
        assert "single precision" in said
        assert "0.5 m apart" in said
        assert "--origin" not in said
    places = dict(zip(point_cloud.VIEWPOINT, (POINTS[::-1] + grid).T, strict=True))
    file = written(tmp_path / "b.pcd", POINTS + grid, **places)
    found = point_cloud.read(file, origin=grid, viewpoints=True, up="y")
    assert found.points_world_m == pytest.approx(POINTS[:, [0, 2, 1]] * [1.0, -1.0, 1.0], abs=1e-6)
    assert sensors(found) == pytest.approx(found.points_world_m[::-1], abs=1e-6)


def test_points_that_are_not_finite_are_counted_and_dropped_with_their_sensor(tmp_path: Path) -> None:
    points, eyes = POINTS.copy(), POINTS[::-1]
    points[[3, 7], 0], points[9] = np.nan, np.inf
    names = dict(zip(point_cloud.VIEWPOINT, eyes.T, strict=True))
    found = point_cloud.read(written(tmp_path / "a.pcd", points, **names), viewpoints=True)
    whole = np.isfinite(points).all(axis=1)
    assert found.not_finite == 3
    assert np.array_equal(found.points_world_m, points[whole])
    assert np.array_equal(sensors(found), eyes[whole])
    assert "none of which is finite" in refused(written(tmp_path / "b.pcd", np.full((5, 3), np.nan)))


def test_axes_and_unit_of_the_file_turn_points_and_viewpoints_alike(tmp_path: Path) -> None:
    names = dict(zip(point_cloud.VIEWPOINT, 1e3 * POINTS[::-1].T, strict=True))
    found = point_cloud.read(written(tmp_path / "a.pcd", 1e3 * POINTS, **names), up="y", viewpoints=True)
    turned = POINTS[:, [0, 2, 1]] * [1.0, -1.0, 1.0]
    assert found.points_world_m == pytest.approx(turned, abs=1e-9)
    assert found.origins_world_m == pytest.approx(turned[::-1], abs=1e-9)


def sensors(found: PointCloud) -> FloatArray:
    assert found.origins_world_m is not None
    return found.origins_world_m


def test_the_sensor_is_where_it_was_at_the_time_of_each_point_whatever_the_unit_of_times(tmp_path: Path) -> None:
    path = poses(tmp_path / "tum.txt", np.arange(99.0, 111.0, 0.1))
    expected = np.stack([1.0 + 0.2 * (TIMES - 99.0), np.ones(200), np.ones(200)], axis=1)
    for name, times, unit in (
        ("time", TIMES, "s"), ("timestamp", 1e3 * TIMES, "ms"), ("t", np.rint(TIMES * 1e9).astype(np.uint64), "ns"),
    ):  # fmt: skip
        found = point_cloud.read(written(tmp_path / "a.pcd", POINTS, **{name: times}), poses=path)
        assert found.sensor == f"poses of tum.txt, times of points in {unit}"
        assert sensors(found) == pytest.approx(expected, abs=1e-5)
    turned = point_cloud.read(written(tmp_path / "a.pcd", POINTS, time=TIMES), poses=path, up="y")
    assert sensors(turned) == pytest.approx(expected[:, [0, 2, 1]] * [1.0, -1.0, 1.0], abs=1e-5)


def test_times_that_begin_at_nought_are_in_the_unit_in_which_they_fill_the_poses_times(tmp_path: Path) -> None:
    path = poses(tmp_path / "tum.txt", np.arange(0.0, 10.0, 0.1))
    for factor, unit in ((1.0, "s"), (1e3, "ms"), (1e6, "us")):
        file = written(tmp_path / "a.pcd", POINTS, time=factor * (TIMES - 100.0))
        assert str(point_cloud.read(file, poses=path).sensor).endswith(f" in {unit}")


def test_points_outside_the_times_of_the_poses_have_no_known_sensor(tmp_path: Path) -> None:
    path = poses(tmp_path / "tum.txt", np.concatenate([np.arange(99.0, 102.0, 0.1), np.arange(107.0, 109.0, 0.1)]))
    found = sensors(point_cloud.read(written(tmp_path / "a.pcd", POINTS, time=TIMES), poses=path))
    inside = (TIMES < 101.85) | ((TIMES > 107.05) & (TIMES < 108.85))
    outside = ((TIMES > 101.95) & (TIMES < 106.95)) | (TIMES > 108.95)
    assert np.isfinite(found[inside]).all()
    assert np.isnan(found[outside]).all()


def test_what_does_not_say_from_where_points_were_measured_is_refused(tmp_path: Path) -> None:
    plain, path = written(tmp_path / "a.pcd", POINTS), poses(tmp_path / "tum.txt", np.arange(99.0, 111.0, 0.1))
    assert "no vp_x" in refused(plain, viewpoints=True)
    none = dict.fromkeys(point_cloud.VIEWPOINT, np.zeros(200))
    assert "are all 0" in refused(written(tmp_path / "b.pcd", POINTS, **none), viewpoints=True)
    assert "no time" in refused(plain, poses=path)
    assert "another clock" in refused(written(tmp_path / "c.pcd", POINTS, time=TIMES + 1.7e9), poses=path)
    since_1970 = (TIMES + 1.7e9).astype(np.float32)
    assert "1.3e+02 apart" in refused(written(tmp_path / "d.pcd", POINTS, time=since_1970), poses=path)
    assert "give one of" in refused(plain, poses=path, viewpoints=True)
    timed = written(tmp_path / "e.pcd", POINTS, time=TIMES)
    assert "another unit or frame" in refused(timed, poses=poses(tmp_path / "mm.txt", np.arange(99.0, 111.0, 0.1), 2e3))
    assert "another unit or frame" in refused(plain, sensor_world_m=np.array([0.0, 1500.0, 0.0]))


def test_the_header_of_a_pcd_file_says_from_where_all_its_points_were_measured(tmp_path: Path) -> None:
    file = written(tmp_path / "a.pcd", POINTS)
    data, points = file.read_bytes(), b"\nPOINTS"
    file.write_bytes(data.replace(points, b"\nVIEWPOINT 1.5 -2 0.5 1 0 0 0" + points, 1))
    found = point_cloud.read(file, viewpoints=True, up="y")
    assert sensors(found) == pytest.approx(np.tile([1.5, -0.5, -2.0], (len(POINTS), 1)))
    assert found.points_world_m == pytest.approx(POINTS[:, [0, 2, 1]] * [1.0, -1.0, 1.0])
    file.write_bytes(data.replace(points, b"\nVIEWPOINT 0 0 0 1 0 0 0" + points, 1))
    assert "no header names a VIEWPOINT besides 0 0 0" in refused(file, viewpoints=True)
    file.write_bytes(data.replace(points, b"\nVIEWPOINT 1 2 nan 1 0 0 0" + points, 1))
    assert "a quaternion are expected" in refused(file, viewpoints=True)
    file.write_bytes(data.replace(points, b"\nVIEWPOINT here" + points, 1))
    assert "VIEWPOINT is 'here'" in refused(file, viewpoints=True)
