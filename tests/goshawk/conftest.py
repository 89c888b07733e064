"""What several tests of the command line share."""

from pathlib import Path

import pytest

import vehicle
from tests.goshawk import foreign_files


@pytest.fixture(scope="module")
def folder(tmp_path_factory, pillar_map) -> Path:
    made = tmp_path_factory.mktemp("foreign")
    foreign_files.make(made, pillar_map)
    return made


@pytest.fixture(autouse=True)
def effect_files_are_held_back_no_longer_than_a_test():
    """`goshawk gcs` holds its process to the effect files that somebody agreed to, until the process ends."""
    held_before = vehicle.effects.agreed() is not None
    yield
    if not held_before:
        vehicle.effects.run_any()
