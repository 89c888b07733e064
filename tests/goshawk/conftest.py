"""What several tests of the command line share."""

from pathlib import Path

import pytest

from tests.goshawk import foreign_files


@pytest.fixture(scope="module")
def folder(tmp_path_factory, pillar_map) -> Path:
    made = tmp_path_factory.mktemp("foreign")
    foreign_files.make(made, pillar_map)
    return made
