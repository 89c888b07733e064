"""A damaged recording of any format gives a log or a sentence with its name, never a traceback."""

import numpy as np
import pytest

from flight import FlightError
from sysid.logs.reading import read_log
from tests.sysid.logs.readers import good_files

NAMES = ("a.BIN", "a.BFL", "a.usd", "a.tlog", "a.tum", "a.csv", "a.bag", "a.mcap", "a.db3")


@pytest.fixture(scope="module")
def good(tmp_path_factory) -> dict[str, bytes]:
    return good_files.every(tmp_path_factory.mktemp("good"))


def answer(path) -> str:
    """The name of the file that was read, or the sentence of the refusal."""
    try:
        log = read_log(path)
    except FlightError as error:
        return str(error)
    return log.metadata["source"]


@pytest.mark.parametrize("name", NAMES)
def test_a_damaged_recording_is_read_or_refused_with_its_name(tmp_path, good, name):
    rng = np.random.default_rng(3)
    (tmp_path / name).write_bytes(good[name])
    assert len(read_log(tmp_path / name)) > 5
    for _ in range(25):
        (tmp_path / name).write_bytes(good_files.mutated(good[name], rng, text=name in ("a.csv", "a.tum")))
        assert name in answer(tmp_path / name)
