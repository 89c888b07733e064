"""Scans as laspy and pye57 write them are read as they are, with the places of the scanner; damage is a sentence."""

import signal
import struct
import sys
from pathlib import Path
from typing import Any

import laspy
import numpy as np
import pytest

from flight import FlightError, FormatError, InputError, MapError, extras
from mapping import child
from mapping.cloud import columns, e57_file, point_cloud

RNG = np.random.default_rng(6)
POINTS = RNG.uniform(-5.0, 5.0, (4000, 3))
CORNER = np.array([512_000.0, 5_403_000.0, 410.0])


GRID_IN = (
    'PROJCS["grid",GEOGCS["globe",DATUM["d",SPHEROID["s",6378137,298.257]],PRIMEM["Greenwich",0],'
    'UNIT["degree",0.0174532925199433]],PROJECTION["Transverse_Mercator"],PARAMETER["false_easting",500000],'
    'UNIT["{}",{}]]'
)
NEWER = (
    'PROJCRS["grid",BASEGEOGCRS["globe",DATUM["d",ELLIPSOID["s",6378137,298.257,LENGTHUNIT["metre",1]]]],'
    'CONVERSION["c",METHOD["Transverse Mercator"],PARAMETER["False easting",5e5,LENGTHUNIT["metre",1]]],'
    'CS[Cartesian,2],AXIS["(E)",east],AXIS["(N)",north],LENGTHUNIT["US survey foot",0.304800609601219]]'
)
HEIGHTS = 'COMPD_CS["both",{},VERT_CS["up",VERT_DATUM["d",2005],UNIT["{}",{}]]]'
ON_GLOBE = 'GEOGCS["globe",DATUM["d",SPHEROID["s",6378137,298.257]],UNIT["degree",0.0174532925199433]]'


def las(path: Path, kind: int = 6, points: np.ndarray = POINTS, record: tuple[int, bytes] | None = None) -> Path:
    header = laspy.LasHeader(point_format=kind, version="1.4" if kind > 5 else "1.2")
    header.scales, header.offsets = [1e-4] * 3, CORNER
    if record is not None:
        header.vlrs.append(laspy.VLR("LASF_Projection", record[0], "", record[1]))
    data = laspy.LasData(header)
    data.x, data.y, data.z = (points + CORNER).T
    if kind not in (0, 2):
        data.gps_time = np.arange(len(points)) / 100.0
    data.write(path)
    return path


def e57(path: Path, stations: tuple[Any, ...], points: np.ndarray = POINTS) -> Path:
    pye57 = pytest.importorskip("pye57", reason="has no wheels for this platform")
    file = pye57.E57(str(path), mode="w")
    for q, place in stations:
        columns = dict(zip(("cartesianX", "cartesianY", "cartesianZ"), points.T.copy(), strict=True))
        columns["cartesianInvalidState"] = (np.arange(len(points)) % 10 == 0).astype(int)
        file.write_scan_raw(columns, rotation=np.array(q), translation=np.array(place))
    file.close()
    return path


@pytest.mark.parametrize(("kind", "suffix"), [*((kind, "las") for kind in (0, 1, 3, 6, 7)), (1, "laz"), (6, "laz")])
def test_a_las_file_has_the_places_and_times_that_laspy_wrote(tmp_path: Path, suffix: str, kind: int) -> None:
    found = columns.read(las(tmp_path / f"scan.{suffix}", kind))
    assert np.stack([found[name] for name in "xyz"], axis=1) == pytest.approx(POINTS + CORNER, abs=6e-5)
    assert ("gps_time" in found) == (kind != 0)
    if kind != 0:
        assert np.array_equal(found["gps_time"], np.arange(4000) / 100.0)


@pytest.mark.parametrize("suffix", ["las", "laz"])
def test_a_las_file_that_lies_or_is_cut_off_is_refused(tmp_path: Path, suffix: str) -> None:
    whole = las(tmp_path / f"whole.{suffix}").read_bytes()
    file = tmp_path / f"bad.{suffix}"
    for share in (0.0, 0.01, 0.6, 0.99) if suffix == "las" else (0.0, 0.99):
        file.write_bytes(whole[: int(share * len(whole))])
        with pytest.raises(FormatError, match="again"):
            columns.read(file)
    for count, error in ((2**50, InputError), (29_000_000, FormatError), (0, FormatError)):
        file.write_bytes(whole[:247] + struct.pack("<Q", count) + whole[255:])
        with pytest.raises(error, match=r"million|cut off|no points"):
            columns.read(file)
    file.write_bytes(whole[:131] + struct.pack("<d", np.nan) + whole[139:])
    with pytest.raises(FormatError, match="scales"):
        columns.read(file)


def test_records_without_end_and_a_chunk_table_of_gigabytes_end_soon(tmp_path: Path) -> None:
    whole = las(tmp_path / "whole.laz").read_bytes()
    file = tmp_path / "bad.laz"
    file.write_bytes(whole[:100] + struct.pack("<I", 2**31 - 1) + whole[104:])
    assert len(columns.read(file)["x"]) == 4000
    offset = struct.unpack_from("<I", whole, 96)[0]
    file.write_bytes(whole[:offset] + struct.pack("<q", offset + 8) + whole[offset + 8 :])
    with pytest.raises(FormatError, match="damaged"):
        columns.read(file)


def test_each_scan_of_an_e57_file_lies_at_its_pose_and_was_measured_from_there(tmp_path: Path) -> None:
    pye57 = pytest.importorskip("pye57", reason="has no wheels for this platform")
    turned = ([np.cos(0.4), 0.0, 0.0, np.sin(0.4)], [2.0, -1.0, 1.5])
    file = e57(tmp_path / "two.e57", (([1.0, 0.0, 0.0, 0.0], [0.0, 0.0, 1.0]), turned))
    found = columns.read(file)
    read = [pye57.E57(str(file)).read_scan(k, ignore_missing_fields=True) for k in range(2)]
    for name, own in (("x", "cartesianX"), ("y", "cartesianY"), ("z", "cartesianZ")):
        assert found[name] == pytest.approx(np.concatenate([scan[own] for scan in read]), abs=1e-9)
    places = np.stack([found[name] for name in point_cloud.VIEWPOINT], axis=1)
    assert np.unique(places, axis=0).tolist() == [[0.0, 0.0, 1.0], [2.0, -1.0, 1.5]]
    assert len(places) == 2 * 3600


def test_integers_of_an_e57_file_take_as_few_bits_as_their_range() -> None:
    for least, most in ((0, 1), (-5, 1000), (-(2**31), 2**31 - 1), (-(2**40), 2**40), (7, 7)):
        bits = (most - least).bit_length()
        values = np.array([least + int(share * (most - least)) for share in RNG.uniform(0.0, 1.0, 100)])
        packed = sum(int(value - least) << (bits * k) for k, value in enumerate(values))
        stream = packed.to_bytes(-(-100 * bits // 8), "little")
        field = e57_file._Field("x", "", bits, least, 0.5, 3.0)
        assert np.array_equal(e57_file._decoded(field, stream, 100), 0.5 * values + 3.0)


def test_an_e57_file_with_one_bit_changed_or_cut_off_is_refused(tmp_path: Path) -> None:
    whole = e57(tmp_path / "whole.e57", (([1.0, 0.0, 0.0, 0.0], [0.0, 0.0, 1.0]),)).read_bytes()
    file = tmp_path / "bad.e57"
    for at in (60, len(whole) // 2, len(whole) - 10):
        file.write_bytes(whole[:at] + bytes([whole[at] ^ 4]) + whole[at + 1 :])
        with pytest.raises(FormatError, match="checksum"):
            columns.read(file)
    for length in (0, 40, 1024, len(whole) - 1024):
        file.write_bytes(whole[:length])
        with pytest.raises(FormatError, match="cut off"):
            columns.read(file)


def test_a_scan_of_a_national_grid_is_moved_by_the_origin_that_the_message_names(tmp_path: Path) -> None:
    file = las(tmp_path / "scan.las")
    with pytest.raises(InputError, match=r"give --origin 5119[0-9]0|give --origin 512"):
        point_cloud.read(file)
    cloud = point_cloud.read(file, origin=CORNER, sensor_world_m=np.array([1.0, 2.0, 3.0]))
    assert cloud.points_world_m == pytest.approx(POINTS, abs=6e-5)
    poses = tmp_path / "poses.tum"
    rows = [(0.1 * k, CORNER[0] + 0.01 * k, *CORNER[1:], 0, 0, 0, 1) for k in range(401)]
    poses.write_text("".join(" ".join(f"{value:.6f}" for value in row) + "\n" for row in rows))
    cloud = point_cloud.read(file, origin=CORNER, poses=poses)
    assert cloud.origins_world_m is not None
    assert cloud.origins_world_m[:, 0] == pytest.approx(np.arange(4000) / 1000.0, abs=1e-6)


def test_scans_are_joined_each_with_its_place_and_in_one_unit(tmp_path: Path) -> None:
    files = [las(tmp_path / f"{name}.las") for name in "ab"]
    places = [np.array([0.0, 0.0, 1.0]), np.array([3.0, 0.0, 1.0])]
    clouds = [
        point_cloud.read(file, origin=CORNER, sensor_world_m=place) for file, place in zip(files, places, strict=True)
    ]
    both = point_cloud.joined(clouds)
    assert both.origins_world_m is not None
    assert np.array_equal(both.origins_world_m[[0, -1]], places)
    assert len(both.points_world_m) == 8000
    assert both.sensor == "of each of 2 files: one place, as given"
    millimetres = point_cloud.read(las(tmp_path / "mm.las", points=1000.0 * POINTS), origin=CORNER)
    with pytest.raises(InputError, match="unit"):
        point_cloud.joined([clouds[0], millimetres])


def keys(*values: tuple[int, int]) -> tuple[int, bytes]:
    """GeoTIFF's directory of numbers."""
    rows = [(1, 1, 0, len(values)), *((key, 0, 1, value) for key, value in values)]
    return 34735, b"".join(struct.pack("<4H", *row) for row in rows)


@pytest.mark.parametrize(
    ("record", "unit"),
    [
        ((2112, GRID_IN.format("metre", "1").encode()), "m"),
        ((2112, GRID_IN.format("US survey foot", "0.304800609601219").encode() + b"\0"), "ft"),
        ((2112, HEIGHTS.format(GRID_IN.format("foot", "0.3048"), "foot", "0.3048").encode()), "ft"),
        ((2112, NEWER.encode()), "ft"),
        (keys((1024, 1), (3076, 9003)), "ft"),
        (keys((1024, 1), (3072, 25832), (3076, 9001), (4099, 9001)), "m"),
    ],
)
def test_the_unit_that_a_las_file_states_is_taken_and_not_guessed(tmp_path: Path, record: Any, unit: str) -> None:
    file = las(tmp_path / "scan.las", record=record)
    found = point_cloud.read(file, origin=CORNER)
    assert found.unit == f"{unit} (as the file states)"
    assert found.points_world_m == pytest.approx({"m": 1.0, "ft": 0.3048}[unit] * POINTS, abs=6e-5)
    assert point_cloud.read(file, origin=CORNER, unit="ft").unit == "ft (as given)"


def test_a_las_file_in_degrees_or_of_an_unknown_projection_is_not_guessed(tmp_path: Path) -> None:
    for record in ((2112, ON_GLOBE.encode()), keys((1024, 2))):
        for unit in (None, "m"):
            with pytest.raises(InputError, match="in degrees"):
                point_cloud.read(las(tmp_path / "globe.las", record=record), unit=unit)
    mixed = HEIGHTS.format(GRID_IN.format("US survey foot", "0.304800609601219"), "metre", "1")
    with pytest.raises(InputError, match=r"different units for its axes \(ft, m\)"):
        point_cloud.read(las(tmp_path / "mixed.las", record=(2112, mixed.encode())))
    feet_up = keys((1024, 1), (3076, 9001), (4099, 9003))
    with pytest.raises(InputError, match=r"different units for its axes \(ft, m\)"):
        point_cloud.read(las(tmp_path / "feet_up.las", record=feet_up))
    for record in (
        keys((1024, 1), (3072, 25832)),
        (2112, b"somewhere"),
        (34735, b"\1"),
        (2112, GRID_IN[:-20].encode()),
    ):
        file = las(tmp_path / "unknown.las", record=record)
        with pytest.raises(InputError, match="give --unit m or --unit ft"):
            point_cloud.read(file, origin=CORNER)
        assert point_cloud.read(file, origin=CORNER, unit="m").unit == "m (as given)"


def test_reading_laz_tells_its_progress_and_only_damage_is_called_damage(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    file, told = las(tmp_path / "scan.laz"), []
    columns.read(file, progress=lambda stage, fraction: told.append((stage, fraction)))
    assert told == [("decompress the points", 0.0)]

    def killed(code: int) -> str:
        def run(*_: object, **__: object) -> None:
            raise child.CrashError("decompress crashed", code)

        monkeypatch.setattr(child, "run", run)
        with pytest.raises(FlightError) as caught:
            columns.read(file)
        assert isinstance(caught.value, MapError) == (code != -signal.SIGABRT)
        return str(caught.value)

    assert "is damaged" in killed(-signal.SIGABRT)
    for code in (-signal.SIGKILL, 1):
        assert "memory" in killed(code)
        assert "damaged" not in killed(code)
    monkeypatch.setitem(sys.modules, "lazrs", None)
    with pytest.raises(ModuleNotFoundError) as caught:
        columns.read(file)
    assert "lazrs, which comes with an extra" in str(extras.missing(caught.value))


def made_e57(path: Path, fields: str, streams: list[bytes], count: object, pose: str = "", offset: object = 48) -> Path:
    """One scan in one packet, byte by byte."""

    def place(logical: int) -> int:
        return logical // 1020 * 1024 + logical % 1020

    body = struct.pack(f"<{len(streams)}H", *map(len, streams)) + b"".join(streams)
    body += bytes(-(6 + len(body)) % 4)
    packet = struct.pack("<BBHH", 1, 0, 6 + len(body) - 1, len(streams)) + body
    section = struct.pack("<B7xQQQ", 1, 32 + len(packet), place(80), 0) + packet
    text = (
        f'<e57Root><data3D><vectorChild>{pose}<points fileOffset="{offset}" recordCount="{count}"><prototype>{fields}'
        "</prototype></points></vectorChild></data3D></e57Root>"
    ).encode()
    used = 48 + len(section) + len(text)
    pages = -(-used // 1020)
    head = struct.pack("<8sIIQQQQ", b"ASTM-E57", 1, 0, 1024 * pages, place(48 + len(section)), len(text), 1024)
    whole = (head + section + text).ljust(1020 * pages, b"\0")
    parts = (whole[1020 * k : 1020 * (k + 1)] for k in range(pages))
    path.write_bytes(b"".join(part + struct.pack(">I", checksum(part)) for part in parts))
    return path


def checksum(data: bytes) -> int:
    """CRC-32C, bit by bit."""
    rest = 0xFFFFFFFF
    for byte in data:
        rest ^= byte
        for _ in range(8):
            rest = rest >> 1 ^ (0x82F63B78 if rest & 1 else 0)
    return rest ^ 0xFFFFFFFF


FEW = POINTS[:60]
XYZ = "".join(f'<cartesian{axis} type="Float"/>' for axis in "XYZ")
STREAMS = [column.astype("<f8").tobytes() for column in FEW.T]
POSE = "<pose><rotation><w>{}</w><z>{}</z></rotation><translation><x>{}</x></translation></pose>"


def test_an_e57_file_in_spherical_coordinates_has_its_points_where_they_are(tmp_path: Path) -> None:
    flat_m = np.hypot(FEW[:, 0], FEW[:, 1])
    ball = np.hypot(flat_m, FEW[:, 2]), np.arctan2(FEW[:, 1], FEW[:, 0]), np.arctan2(FEW[:, 2], flat_m)
    fields = "".join(f'<spherical{name} type="Float"/>' for name in ("Range", "Azimuth", "Elevation"))
    file = made_e57(tmp_path / "a.e57", fields, [column.tobytes() for column in ball], 60, POSE.format(0, 1, 3))
    found = columns.read(file)
    assert np.stack([found[name] for name in "xyz"], axis=1) == pytest.approx(FEW * [-1, -1, 1] + [3, 0, 0], abs=1e-9)


def test_scaled_integers_of_an_e57_file_are_their_scale_and_offset(tmp_path: Path) -> None:
    raw = np.rint((FEW - 1.5) / 0.001).astype(np.int64)
    field = '<cartesian{} type="ScaledInteger" minimum="-32768" maximum="32767" scale="0.001" offset="1.5"/>'
    streams = [(column + 32768).astype("<u2").tobytes() for column in raw.T]
    file = made_e57(tmp_path / "a.e57", "".join(map(field.format, "XYZ")), streams, 60)
    found = columns.read(file)
    assert np.stack([found[name] for name in "xyz"], axis=1) == pytest.approx(FEW, abs=5.1e-4)


def test_a_pose_that_turns_nothing_and_numbers_that_are_none_are_damage(tmp_path: Path) -> None:
    for pose in (POSE.format(0, 0, 3), POSE.format(1, 1, 3), POSE.format(1, 0, "nan"), POSE.format("here", 0, 3)):
        with pytest.raises(FormatError, match="pose"):
            columns.read(made_e57(tmp_path / "pose.e57", XYZ, STREAMS, 60, pose))
    for wrong in ("--5", "-5", "5-", "0x5", "9" * 30, "\u0665"):
        with pytest.raises(FormatError, match="recordCount is"):
            columns.read(made_e57(tmp_path / "count.e57", XYZ, STREAMS, wrong))
        with pytest.raises(FormatError, match="fileOffset is"):
            columns.read(made_e57(tmp_path / "offset.e57", XYZ, STREAMS, 60, offset=wrong))


def test_a_scanner_may_stand_at_the_origin_of_an_e57_file_and_must_stand_somewhere(tmp_path: Path) -> None:
    file = made_e57(tmp_path / "a.e57", XYZ, STREAMS, 60, POSE.format(1, 0, 0))
    found = point_cloud.read(file, viewpoints=True)
    assert found.origins_world_m is not None
    assert not found.origins_world_m.any()
    with pytest.raises(FormatError, match="not known"):
        point_cloud.read(made_e57(tmp_path / "b.e57", XYZ, STREAMS, 60), viewpoints=True)
