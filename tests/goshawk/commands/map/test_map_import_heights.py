"""`goshawk map import` of elevation models: a ground to fly over, free only as far as it is stated."""

import json
from pathlib import Path

import numpy as np

import mapping
from esdf import FREE, OCCUPIED, UNKNOWN
from mapping.cloud import height_field
from tests.goshawk.running import answer, run

X_M, Y_M = (np.arange(n) * 0.5 for n in (40, 30))
HILL_M = 410.0 + 3.0 * np.exp(-((X_M[:, None] - 10.0) ** 2 + (Y_M - 7.0) ** 2) / 8.0)
PLACE = (512300.0, 5403200.0)
ORIGIN = ("--origin", f"{PLACE[0]:g},{PLACE[1]:.0f},410")


def hill(folder: Path) -> Path:
    (folder / "hill.asc").write_bytes(height_field.encode(HILL_M, 0.5, PLACE))
    return folder / "hill.asc"


def refusal(file: Path, *more: object) -> str:
    ended = answer("map", "import", file, "--out", file.parent / "none", *more)
    assert ended.returncode == 2
    assert not (file.parent / "none").exists()
    return ended.stderr


def test_a_hill_is_a_hill_with_air_above_it_as_stated(tmp_path: Path) -> None:
    out = tmp_path / "hill"
    said = run("map", "import", hill(tmp_path), "--out", out, *ORIGIN, "--voxel", "0.25", "--heights", "0,20", "--json")
    assert json.loads(said)["free_m3"] > 0.9 * 20.0 * 15.0 * 17.0
    field = mapping.open_map(out).field
    top, below, above = np.array([[10.1, 7.1, 3.0], [10.1, 7.1, 1.0], [10.1, 7.1, 5.0]])
    assert abs(field.distance(above[None])[0] - 2.0) < 0.4
    states = field.state[tuple(field.grid.index(np.array([top, below, above])).T)]
    assert states.tolist() == [OCCUPIED, UNKNOWN, FREE]


def test_what_is_missing_is_asked_for(tmp_path: Path) -> None:
    file = hill(tmp_path)
    assert "give --origin 512300,5403200,410" in refusal(file)
    assert "--observed is for meshes, points and volumes; FILE is an elevation model" in refusal(
        file, *ORIGIN, "--observed", "1,1,9"
    )
    advice = run("map", "import", file, "--out", tmp_path / "dry", *ORIGIN, "--voxel", "0.25", "--dry-run")
    assert "--heights LOW,HIGH" in advice
    assert "0 of 1,200 cells without data" in advice
    assert "assumed: the file does not say" in advice
    assert "rule" not in advice
    assert not (tmp_path / "dry").exists()


def test_the_model_that_a_map_gives_is_read_again_within_a_voxel(tmp_path: Path) -> None:
    run("map", "import", hill(tmp_path), "--out", tmp_path / "a", *ORIGIN, "--voxel", "0.25", "--heights", "0,9")
    run("map", "export", tmp_path / "a", "--out", tmp_path / "again.asc")
    again = height_field.read(tmp_path / "again.asc")
    places = again.low_m + again.cell_m * (np.argwhere(np.isfinite(again.height_m)) + 0.5)
    i, j = np.clip((places / 0.5).astype(int), 0, np.array(HILL_M.shape) - 1).T
    off_m = again.height_m[np.isfinite(again.height_m)] - (HILL_M[i, j] - 410.0)
    assert off_m.min() > -1e-3
    to_neighbour_m = sum(np.abs(np.diff(HILL_M, axis=axis)).max() for axis in (0, 1))
    assert off_m.max() < 0.25 + 0.5 * to_neighbour_m + 1e-3
