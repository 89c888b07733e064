"""The localization map's file: 57 bytes a point, the same to Python and C, and refused by both when it is damaged."""

import shutil
import subprocess
import zlib
from pathlib import Path

import numpy as np
import pytest

from flight import FormatError, InputError, file_format
from mapping.sparse import localization_map
from mapping.sparse.features import features
from mapping.sparse.localization_map import FILE, LEVELS, LocalizationMap, decode, encode

READER = Path(localization_map.__file__).parents[1] / "localization" / "reader"
GL_OK, GL_NOT_A_MAP, GL_OTHER_VERSION, GL_WRONG_SIZE, GL_DAMAGED = range(5)


def known(count: int = 40, *, at_m: float = 0.0, seed: int = 0) -> LocalizationMap:
    rng = np.random.default_rng(seed)
    return LocalizationMap(
        rng.uniform(-30.0, 30.0, (count, 3)) + at_m, features.unit(rng.gamma(0.6, 1.0, (count, 128)))
    )


def sealed(data: bytes) -> bytes:
    """The bytes with a checksum that matches."""
    return data[:-4] + zlib.crc32(data[:-4]).to_bytes(4, "little")


@pytest.fixture(scope="module")
def reader(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A program around the C reader, under the address and undefined-behaviour sanitizers."""
    if shutil.which("gcc") is None:
        pytest.skip("gcc is not installed")
    program = tmp_path_factory.mktemp("reader") / "print"
    flags = ["-std=c99", "-O1", "-g", "-Wall", "-Wextra", "-Wpedantic", "-Wconversion", "-Werror"]
    sources = [READER / "goshawk_localization_map.c", Path(__file__).parent / "print_localization_map.c"]
    command = ["gcc", *flags, "-fsanitize=address,undefined", "-fno-sanitize-recover=all", f"-I{READER}"]
    subprocess.run([*command, *map(str, sources), "-o", str(program)], check=True)
    return program


def printed(reader: Path, files: list[Path]) -> list[list[int]]:
    done = subprocess.run([reader, *files], capture_output=True, text=True, check=True)
    return [[int(word) for word in line.split()] for line in done.stdout.splitlines()]


@pytest.mark.parametrize("at_m", [0.0, -500_000.0, 5_000_000.0])
def test_points_come_back_to_half_a_millimetre_wherever_the_origin_is(at_m: float) -> None:
    given = known(at_m=at_m)
    np.testing.assert_allclose(decode(encode(given)).points_world_m, given.points_world_m, rtol=0.0, atol=5.1e-4)


def test_descriptors_come_back_as_the_nearest_levels() -> None:
    given = known()
    levels = np.array(LEVELS)
    nearest = levels[np.abs(512.0 * given.descriptors[..., None] - levels).argmin(axis=-1)]
    np.testing.assert_allclose(decode(encode(given)).descriptors, features.unit(nearest), atol=1e-6)


def test_a_map_written_again_is_the_same_to_a_bit_in_its_points() -> None:
    once = decode(encode(known()))
    np.testing.assert_array_equal(decode(encode(once)).points_world_m, once.points_world_m)


def test_a_point_takes_less_than_60_bytes() -> None:
    assert len(encode(known(1000))) <= 60 * 1000


def test_a_map_without_points_is_written_and_read() -> None:
    assert len(decode(encode(known(0))).points_world_m) == 0


@pytest.mark.parametrize(
    ("point", "said"), [([np.nan, 0.0, 0.0], "not finite"), ([40_000.0, 0.0, 0.0], "at most 16777 m fit")]
)
def test_points_that_the_file_cannot_hold_are_refused(point: list[float], said: str) -> None:
    given = known()
    with pytest.raises(InputError, match=said):
        encode(LocalizationMap(np.vstack([given.points_world_m, [point]]), given.descriptors))


def test_the_c_reader_reads_what_python_reads(reader: Path, tmp_path: Path) -> None:
    given = known(at_m=-1234.0)
    localization_map.save(tmp_path / "map", given)
    ours = localization_map.load(tmp_path / "map")
    status, *points = printed(reader, [tmp_path / "map" / FILE])
    assert status == [GL_OK, len(given.points_world_m)]
    rows = np.array(points)
    np.testing.assert_allclose(1e-3 * rows[:, :3], ours.points_world_m, rtol=0.0, atol=1e-9)
    np.testing.assert_array_equal(features.unit(rows[:, 3:]), ours.descriptors)
    np.testing.assert_array_equal(localization_map.load_points(tmp_path / "map" / FILE), ours.points_world_m)


def test_python_and_c_refuse_the_same_hostile_files(reader: Path, tmp_path: Path) -> None:
    """Cut off anywhere, longer, of another kind or version, of a size that overflows, and with a changed byte."""
    whole, rng = encode(known(3)), np.random.default_rng(5)
    hostile = {
        b"": GL_NOT_A_MAP,
        b"goshloc\0": GL_NOT_A_MAP,
        b"PK" + whole[2:]: GL_NOT_A_MAP,
        whole[:8] + (2).to_bytes(4, "little") + whole[12:]: GL_OTHER_VERSION,
        whole + b"\0": GL_WRONG_SIZE,
        sealed(whole[:12] + b"\xff\xff\xff\xff" + whole[16:]): GL_WRONG_SIZE,
        sealed(whole[:12] + bytes(4) + whole[16:]): GL_WRONG_SIZE,
        sealed(whole[:28] + whole[28:36][::-1] + whole[36:]): GL_DAMAGED,
        **{whole[:length]: GL_WRONG_SIZE for length in range(40, len(whole), 7)},
        **{whole[:length]: GL_NOT_A_MAP for length in range(9, 40)},
    }
    for _ in range(100):
        place = int(rng.integers(16, len(whole)))
        hostile[whole[:place] + bytes([whole[place] ^ (1 << int(rng.integers(8)))]) + whole[place + 1 :]] = GL_DAMAGED
    files = []
    for number, data in enumerate(hostile):
        files.append(tmp_path / f"{number}.bin")
        files[-1].write_bytes(data)
        with pytest.raises(FormatError):
            decode(data)
    assert printed(reader, files) == [[status, 0] for status in hostile.values()]


def test_a_damaged_file_is_named(tmp_path: Path) -> None:
    localization_map.save(tmp_path / "map", known())
    file = tmp_path / "map" / FILE
    file.write_bytes(file.read_bytes()[:100])
    with pytest.raises(FormatError, match=r"points\.bin: 100 bytes do not hold the 40 points.*build the map again"):
        localization_map.load(tmp_path / "map")


def test_an_earlier_map_is_still_read(tmp_path: Path) -> None:
    given = known()
    codes = np.clip(np.round(512.0 * given.descriptors), 0, 255).astype(np.uint8)
    np.savez(tmp_path / "points.npz", points_world_m=given.points_world_m, descriptors=codes)
    body = {"points": 40, "hash": file_format.file_hash(tmp_path / "points.npz")}
    file_format.write_toml(tmp_path / "localization.toml", format="goshawk-localization", version=1, body=body)
    read = localization_map.load(tmp_path)
    np.testing.assert_array_equal(read.points_world_m, given.points_world_m)
    np.testing.assert_array_equal(read.descriptors, features.unit(codes))
    np.testing.assert_array_equal(localization_map.load_points(localization_map.file(tmp_path)), given.points_world_m)
    (tmp_path / "points.npz").write_bytes(b"torn")
    with pytest.raises(FormatError, match="does not match its hash"):
        localization_map.load(tmp_path)
    with pytest.raises(FormatError, match="cannot be read"):
        localization_map.load_points(tmp_path / "points.npz")
    (tmp_path / "points.npz").unlink()
    with pytest.raises(InputError, match="build the map again"):
        localization_map.load(tmp_path)
