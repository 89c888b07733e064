"""`goshawk preflight` in a map that states what its images may have missed: a probability in the total."""

import json
import os
import shutil
from pathlib import Path

import numpy as np
import pytest

import mapping
import vehicle
from mapping.dense import occupancy
from tests.goshawk.running import answer


@pytest.fixture(scope="module")
def folder(pillar_map: Path, tmp_path_factory) -> Path:
    """A plan in the pillars' map."""
    folder = tmp_path_factory.mktemp("hidden")
    os.symlink(pillar_map, folder / "map")
    vehicle.save(folder / "vehicle.toml", vehicle.example())
    (folder / "waypoints.csv").write_text("x,y,z\n0.8,0.8,1.0\n1.0,3.0,1.3\n3.0,3.2,1.2\n")
    given = ("--map", folder / "map", "--vehicle", folder / "vehicle.toml", "--speed", 3, "--out", folder / "plan.json")
    assert answer("plan", folder / "waypoints.csv", *given, "-q").returncode == 0
    return folder


def flown_ahead(folder: Path, area: Path, *options: object):
    given = ("--map", area, "--vehicle", folder / "vehicle.toml", "--flights", 60, "--risk", 0.08)
    return answer("preflight", folder / "plan.json", *given, "-q", *options)


def stating(folder: Path, to: Path, chance: float) -> Path:
    """A copy of the map that states so of each free voxel."""
    shutil.copytree(folder / "map", to, symlinks=False)
    shape = mapping.open_map(to).field.grid.shape
    occupancy.save(to / occupancy.FILE, np.full(shape, chance, np.float16))
    return to


def test_little_is_a_go_with_the_total_and_much_is_none_with_the_place_to_look(folder, tmp_path):
    little = flown_ahead(folder, stating(folder, tmp_path / "little", 5e-6), "--out", tmp_path / "little.json")
    assert little.returncode == 0, little.stdout + little.stderr
    assert "may be hidden" in little.stdout
    found = json.loads((tmp_path / "little.json").read_text())
    assert 0.0 < found["hidden"]["probability"] < 0.03
    total = 1.0 - (1.0 - found["risk"]["upper95"]) * (1.0 - found["hidden"]["probability"])
    assert found["risk_with_hidden"]["upper95"] == pytest.approx(total)
    much = flown_ahead(folder, stating(folder, tmp_path / "much", 1e-3))
    assert much.returncode == 1
    said = " ".join(much.stdout.split())
    assert "a thing hidden in the map is met by" in said
    assert "take more images near" in said


def test_a_map_that_states_nothing_says_that_it_is_not_counted(folder):
    ended = flown_ahead(folder, folder / "map", "--json")
    found = json.loads(ended.stdout)
    assert found["hidden"] is None
    assert found["risk_with_hidden"] is None
    assert any("what the map misses is not counted" in sentence for sentence in found["assumed"])
