"""Stations that are killed at random moments of an edit: nothing acknowledged is lost, no planning process is left."""

from pathlib import Path

import pytest

BENCHMARKS = Path(__file__).parents[2] / "benchmarks"


@pytest.mark.slow
def test_fifty_killed_stations_lose_no_change_and_leave_no_process(tmp_path, monkeypatch):
    monkeypatch.syspath_prepend(BENCHMARKS)
    import gcs

    monkeypatch.setattr(gcs, "_WITH_PLANNER", 10)
    lost, left = gcs.killed(tmp_path, 50)
    assert lost.value == 0
    assert left.name.endswith("of 5")
    assert left.value == 0
