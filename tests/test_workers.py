"""Tests that share something stay on one worker; what all share is made once."""

from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]


def test_the_tests_of_a_file_share_a_group_and_flights_by_the_clock_share_one(request: pytest.FixtureRequest):
    groups: dict[str, set[str]] = {}
    for item in request.session.items:
        mark = item.get_closest_marker("xdist_group")
        assert mark is not None
        groups.setdefault(item.path.relative_to(ROOT).as_posix(), set()).add(mark.args[0])
    assert all(len(names) == 1 for names in groups.values())
    assert groups[Path(__file__).relative_to(ROOT).as_posix()] == {"tests/test_workers.py"}


def test_two_processes_that_want_the_same_folder_make_it_once(made_once, tmp_path: Path):
    import os

    count = tmp_path / "count"

    def make(folder: Path) -> None:
        with open(count, "a") as file:
            file.write("x")
        (folder / "answer").write_text("42")

    name = f"once_{tmp_path.name}"
    child = os.fork()
    if child == 0:
        made_once(name, make)
        os._exit(0)
    folder = made_once(name, make)
    assert os.waitpid(child, 0)[1] == 0
    assert (folder / "answer").read_text() == "42"
    assert count.read_text() == "x"
