"""`goshawk log mark` writes into a log whether the payload was on board, and nothing else."""

import re

import numpy as np
import pytest

from flight import flight_log
from sysid.logs.checks.payload import PAYLOAD_CARRIED
from tests.goshawk.running import run

MAP = """
format = "goshawk-csv-map"
version = 1
[time]
column = "t"
unit = "s"
[quantity.position_world_m]
columns = ["x", "y", "z"]
unit = "m"
"""


@pytest.mark.parametrize(("word", "carried"), [("carried", True), ("left", False)])
def test_a_log_is_marked_and_stays_as_it_is_otherwise(tmp_path, word, carried):
    path = tmp_path / "lap.parquet"
    vectors = {"position_world_m": np.random.default_rng(0).normal(size=(200, 3))}
    log = flight_log.from_vectors(np.arange(200) / 100.0, vectors, metadata={"site": "hall"})
    flight_log.save(path, log)
    run("log", "mark", path, "--payload", word)
    marked = flight_log.load(path)
    assert marked.metadata == {"site": "hall", PAYLOAD_CARRIED: carried}
    for name, values in log.columns.items():
        np.testing.assert_array_equal(marked.columns[name], values)


def test_a_foreign_log_stays_and_gets_a_marked_one_of_ours_beside_it(tmp_path):
    rows = [f"{i / 100},{i},0,1" for i in range(100)]
    (tmp_path / "lap.csv").write_text("\n".join(["t,x,y,z", *rows]))
    (tmp_path / "map.toml").write_text(MAP)
    before = (tmp_path / "lap.csv").read_bytes()
    asked = ("log", "mark", tmp_path / "lap.csv", "--columns", tmp_path / "map.toml", "--payload", "left")
    said = run(*asked)
    assert re.search(r"payload +left", said)
    assert (tmp_path / "lap.csv").read_bytes() == before
    assert flight_log.load(tmp_path / "lap.parquet").metadata[PAYLOAD_CARRIED] is False
    assert "exists" in run(*asked, code=2)
