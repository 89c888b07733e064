"""Wrong lens files, swapped folders and walls that repeat end in a refusal or a doubt that names the cause."""

from pathlib import Path

import pytest

from goshawk.rendered import hostile
from mapping.verdict import Standing

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def folders(tmp_path_factory: pytest.TempPathFactory) -> dict[bool, Path]:
    base = tmp_path_factory.mktemp("hostile")
    return {is_tiled: hostile.render(base / str(is_tiled), is_tiled=is_tiled) for is_tiled in (False, True)}


@pytest.mark.parametrize("what", list(hostile.cases()))
def test_no_hostile_input_becomes_a_good_map(what: str, folders: dict[bool, Path]) -> None:
    case = hostile.cases()[what]
    standing, why = hostile.outcome(folders[case.is_tiled], case.rig)
    assert standing != Standing.GOOD
    assert case.named in why
    assert "Rig with ID" not in why
