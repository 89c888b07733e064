"""Elevation models: each column of voxels is where the heights are, and only what is stated above them is free."""

from pathlib import Path

import numpy as np
import pytest
from PIL import Image, TiffImagePlugin

from esdf import FREE, OCCUPIED, UNKNOWN
from flight import FlightError, FloatArray
from mapping.cloud import height_field
from mapping.cloud.height_field import HeightField

RNG = np.random.default_rng(0)
HEIGHTS = np.round(RNG.uniform(0.0, 3.0, (7, 5)), 3)
HEIGHTS[2, 3] = np.nan


def ascii_grid(path: Path, field: HeightField) -> Path:
    path.write_bytes(height_field.encode(field.height_m, field.cell_m, (float(field.low_m[0]), float(field.low_m[1]))))
    return path


def geotiff(
    path: Path,
    field: HeightField,
    *,
    model: int = 1,
    raster: int = 1,
    mode: str = "F",
    keys: dict[int, int] | None = None,
    no_data: str | None = "-32768",
    hole: float = -32768.0,
) -> Path:
    """As GDAL writes it: the first row in the north, the tie point at the corner or in the middle of a pixel."""
    rows = np.where(np.isfinite(field.height_m), field.height_m, hole).T[::-1].astype(np.float32)
    image = Image.fromarray(rows) if mode == "F" else Image.fromarray(rows.astype(np.uint8))
    tags = TiffImagePlugin.ImageFileDirectory_v2()
    half = 0.5 * field.cell_m if raster == 2 else 0.0
    x_m, y_m = field.low_m[0] + half, field.low_m[1] + field.cell_m * field.height_m.shape[1] - half
    tags[33550], tags[33922] = (field.cell_m, field.cell_m, 0.0), (0.0, 0.0, 0.0, x_m, y_m, 0.0)
    tags.tagtype[33550] = tags.tagtype[33922] = 12
    stated = {1024: model, 1025: raster} | (keys or {})
    directory = (1, 1, 0, len(stated), *(word for key, value in stated.items() for word in (key, 0, 1, value)))
    tags[34735], tags.tagtype[34735] = directory, 3
    if no_data is not None:
        tags[42113], tags.tagtype[42113] = no_data, 2
    image.save(path, tiffinfo=tags)
    return path


def model(low_m: tuple[float, float] = (10.0, -20.0)) -> HeightField:
    return HeightField(HEIGHTS, 0.5, np.array(low_m))


@pytest.mark.parametrize("write", [ascii_grid, geotiff, lambda path, field: geotiff(path, field, raster=2)])
def test_a_model_is_read_where_it_was_written(tmp_path: Path, write) -> None:
    suffix = ".asc" if write is ascii_grid else ".tif"
    found = height_field.read(write(tmp_path / f"m{suffix}", model()))
    np.testing.assert_allclose(found.height_m, HEIGHTS, atol=1e-4)
    np.testing.assert_allclose(found.low_m, [10.0, -20.0])
    assert found.cell_m == 0.5


@pytest.mark.parametrize("write", [ascii_grid, geotiff])
@pytest.mark.parametrize("hole", [-9999.0, -32767.0, -32768.0, -9999.9, 9001.0, 3.4028234663852886e38])
def test_values_that_are_no_heights_are_no_data_though_the_file_does_not_say_so(
    tmp_path: Path, write, hole: float
) -> None:
    path = tmp_path / ("m.asc" if write is ascii_grid else "m.tif")
    if write is geotiff:
        geotiff(path, model(), no_data=None, hole=hole)
    else:
        lines = ascii_grid(path, model()).read_text().replace("NODATA_value -9999\n", "NODATA_value -1\n")
        path.write_text(lines.replace("-9999.0000", repr(hole)))
    np.testing.assert_array_equal(np.isnan(height_field.read(path).height_m), np.isnan(HEIGHTS))


@pytest.mark.parametrize("no_data", ["-99.9", "-99.90000153"])
def test_the_value_for_no_data_is_compared_in_the_images_precision(tmp_path: Path, no_data: str) -> None:
    found = height_field.read(geotiff(tmp_path / "m.tif", model(), no_data=no_data, hole=-99.9))
    np.testing.assert_array_equal(np.isnan(found.height_m), np.isnan(HEIGHTS))


@pytest.mark.parametrize(
    ("keys", "asked", "unit_m", "said"),
    [
        ({}, None, 1.0, "assumed"),
        ({}, "ft", 0.3048, "as given"),
        ({3076: 9001}, None, 1.0, "GeoTIFF"),
        ({3076: 9002, 4099: 9002}, None, 0.3048, "GeoTIFF"),
        ({3076: 9003, 4099: 9003}, None, 1200 / 3937, "survey"),
        ({3076: 9003}, "ft", 0.3048, "as given"),
        ({3072: 2263}, "ft", 0.3048, "as given"),
    ],
)
def test_cells_places_and_heights_are_in_the_unit_that_is_stated(tmp_path: Path, keys, asked, unit_m, said) -> None:
    path = geotiff(tmp_path / "m.tif", model(), keys=keys)
    found = height_field.read(path, origin=np.array([9.0, -21.0, 1.0]), unit=asked)
    np.testing.assert_allclose(found.height_m, (HEIGHTS - 1.0) * unit_m, atol=1e-4)
    np.testing.assert_allclose([*found.low_m, found.cell_m], np.array([1.0, 1.0, 0.5]) * unit_m)
    assert said in found.unit


@pytest.mark.parametrize(
    ("keys", "said"),
    [
        ({3076: 9036}, "unit 9036"),
        ({3076: 9001, 4099: 9002}, "one unit"),
        ({3076: 9003}, "its plane alone; give --unit"),
        ({4099: 9001}, "its heights alone; give --unit"),
        ({3072: 2263}, "names a projection and not its unit"),
    ],
)
def test_a_unit_that_is_not_certain_is_refused(tmp_path: Path, keys: dict[int, int], said: str) -> None:
    with pytest.raises(FlightError, match=said):
        height_field.read(geotiff(tmp_path / "m.tif", model(), keys=keys))


@pytest.mark.parametrize("low_m", [-0.1, 0.0])
def test_no_air_is_free_beyond_the_cells(low_m: float) -> None:
    field = HeightField(np.zeros((21, 21)), 0.5, np.array([low_m, low_m]))
    space = height_field.space(field, 2.0, (0.0, 8.0))
    free = space.grid.centre(np.argwhere(space.state == FREE))
    assert len(free)
    assert free[:, :2].min() - 1.0 >= low_m - 1e-6
    assert free[:, :2].max() + 1.0 <= low_m + 10.5 + 1e-6


def test_a_national_grids_numbers_are_moved_and_else_the_remedy_is_said(tmp_path: Path) -> None:
    path = ascii_grid(tmp_path / "m.asc", model((512300.0, 5403200.0)))
    found = height_field.read(path, origin=np.array([512300.0, 5403200.0, 1.0]))
    np.testing.assert_allclose(found.low_m, [0.0, 0.0])
    np.testing.assert_allclose(found.height_m, HEIGHTS - 1.0, atol=1e-4)
    with pytest.raises(FlightError, match=r"--origin 512300,5403200,0"):
        height_field.read(path)


def states(field: HeightField, voxel_m: float, free_m: tuple[float, float] | None) -> tuple[FloatArray, np.ndarray]:
    """Centres (n, 3) of all voxels, and their states."""
    space = height_field.space(field, voxel_m, free_m)
    cells = np.argwhere(np.ones(space.grid.shape, bool))
    return space.grid.centre(cells), space.state[tuple(cells.T)]


def heights_at(field: HeightField, places: FloatArray) -> FloatArray:
    cell = np.floor((places[:, :2] - field.low_m) / field.cell_m).astype(int)
    inside = (cell >= 0).all(axis=1) & (cell < field.height_m.shape).all(axis=1)
    found = np.full(len(places), np.nan)
    found[inside] = field.height_m[tuple(cell[inside].T)]
    return found


@pytest.mark.parametrize("voxel_m", [0.05, 0.1, 0.3, 0.7])
def test_nothing_below_a_height_is_free_and_nothing_without_one_is_known(voxel_m: float) -> None:
    places, state = states(model(), voxel_m, (0.0, 5.0))
    for shift in np.array([[-0.49, -0.49], [0.49, -0.49], [-0.49, 0.49], [0.49, 0.49], [0.0, 0.0]]) * voxel_m:
        height_m = heights_at(model(), places + np.append(shift, 0.0))
        below = places[:, 2] - 0.5 * voxel_m < height_m - 1e-9
        assert not (state[below] == FREE).any()
        assert (state[np.isnan(height_m)] == UNKNOWN).all()
    free = places[state == FREE]
    assert len(free)
    assert free[:, 2].max() + 0.5 * voxel_m <= 5.0 + 1e-6


def test_without_a_statement_nothing_is_free() -> None:
    _, state = states(model(), 0.1, None)
    assert set(np.unique(state)) == {UNKNOWN, OCCUPIED}


def test_free_begins_at_the_lower_height() -> None:
    places, state = states(model(), 0.1, (3.5, 5.0))
    assert places[state == FREE][:, 2].min() == pytest.approx(3.55, abs=0.06)


def test_a_cliff_is_a_wall_without_a_hole() -> None:
    cliff = np.where(np.arange(6)[:, None] < 3, 0.0, 4.0) * np.ones((6, 4))
    space = height_field.space(HeightField(cliff, 1.0, np.zeros(2)), 0.25, (-1.0, 6.0))
    foot, top = space.grid.index(np.array([[2.2, 2.0, 0.9], [3.4, 2.0, 0.9]]))[:, 0]
    column = slice(*space.grid.index(np.array([[0.0, 0.0, 0.3], [0.0, 0.0, 3.9]]))[:, 2])
    across = space.state[foot : top + 1, 8, column]
    assert (across == OCCUPIED).any(axis=0).all()


def test_a_surface_joins_known_cells_only_and_looks_up() -> None:
    vertices, faces = height_field.surface(model())
    assert len(vertices) == np.isfinite(HEIGHTS).sum()
    assert len(faces) == 2 * (6 * 4 - 4)
    a, b, c = (vertices[faces[:, k]] for k in range(3))
    assert (np.cross(b - a, c - a)[:, 2] > 0.0).all()


def test_the_highest_occupied_voxels_are_the_model_of_a_map() -> None:
    flat = HeightField(np.full((20, 20), 1.23), 0.1, np.zeros(2))
    space = height_field.space(flat, 0.1, (0.0, 3.0))
    found = height_field.of_states(space.state, space.grid)
    known = found[np.isfinite(found)]
    assert len(known) >= 400
    assert ((known >= 1.23) & (known <= 1.34)).all()


HEAD = "ncols 2\nnrows 2\nxllcorner 0\nyllcorner 0\ncellsize 1\nNODATA_value -9999\n"


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (HEAD + "1 2\n3\n", "has 3 heights"),
        (HEAD + "1 2\n3 x\n", "must be a number"),
        (HEAD.replace("cellsize 1\n", "") + "1 2\n3 4\n", "no cellsize"),
        (HEAD + "-9999 -9999\n-9999 -9999\n", "holds no height"),
        (HEAD.replace("cellsize 1", "cellsize 0.0002") + "1 2\n3 4\n", "gdalwarp"),
        (HEAD.replace("ncols 2", "ncols 90000").replace("nrows 2", "nrows 90000") + "1\n", "8,100 million cells"),
        (HEAD.replace("ncols 2", "ncols 1") + "1\n2\n", "at least 2"),
        (HEAD.replace("ncols 2", "ncols two") + "1\n2\n", "line 1: 'two' is no number"),
    ],
)
def test_a_damaged_grid_says_what_is_wrong(tmp_path: Path, text: str, said: str) -> None:
    (tmp_path / "m.asc").write_text(text)
    with pytest.raises(FlightError, match=said):
        height_field.read(tmp_path / "m.asc")


def test_a_tiff_that_is_no_model_of_metres_says_so(tmp_path: Path) -> None:
    with pytest.raises(FlightError, match="in degrees"):
        height_field.read(geotiff(tmp_path / "a.tif", model(), model=2))
    with pytest.raises(FlightError, match="pixels of kind L"):
        height_field.read(geotiff(tmp_path / "b.tif", model(), mode="L"))
    Image.fromarray(np.zeros((4, 4), np.float32)).save(tmp_path / "c.tif")
    with pytest.raises(FlightError, match="does not say where it is"):
        height_field.read(tmp_path / "c.tif")
    (tmp_path / "d.tif").write_bytes(b"II*\x00nonsense")
    with pytest.raises(FlightError, match="cannot be read"):
        height_field.read(tmp_path / "d.tif")


def test_heights_that_end_below_the_surface_are_refused() -> None:
    with pytest.raises(FlightError, match="must rise"):
        height_field.space(model(), 0.1, (2.0, 1.0))
    with pytest.raises(FlightError, match="lowest place"):
        height_field.space(model(), 0.1, (-9.0, -8.0))
