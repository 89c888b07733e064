"""Tests that share something stay on one worker; what all share is made once."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

RECORDING = """
import os, pathlib, pytest

@pytest.mark.parametrize("number", range(6))
def test_it(number):
    with open(pathlib.Path(__file__).parents[3] / "workers", "a") as file:
        print(NAME, os.environ["PYTEST_XDIST_WORKER"], file=file)
"""


def test_the_tests_of_a_file_stay_on_one_worker_and_flights_by_the_clock_on_one(tmp_path: Path):
    clocked = ("firmware_bridge/link/test_a.py", "goshawk/demo/test_chain.py")
    files = (*clocked, "planner/one/test_b.py", "planner/one/test_c.py")
    for name in files:
        path = tmp_path / "tests" / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(RECORDING.replace("NAME", repr(name)).replace("parents[3]", f"parents[{name.count('/') + 1}]"))
    for name in ("conftest.py", "quick.py", "seconds.toml"):
        shutil.copy(Path(__file__).with_name(name), tmp_path / "tests")
    (tmp_path / "pytest.ini").write_text("[pytest]\naddopts = --import-mode=importlib\n")
    environment = {name: value for name, value in os.environ.items() if not name.startswith("PYTEST_")}
    command = [sys.executable, "-m", "pytest", "-n", "2", "--dist", "loadscope", "--no-loadscope-reorder", "tests"]
    ended = subprocess.run(command, cwd=tmp_path, env=environment, capture_output=True, text=True, check=False)
    assert ended.returncode == 0, ended.stdout
    ran = [line.split() for line in (tmp_path / "workers").read_text().splitlines()]
    assert len(ran) == 6 * len(files)
    workers = {name: {worker for of, worker in ran if of == name} for name in files}
    assert all(len(of_file) == 1 for of_file in workers.values())
    assert workers[clocked[0]] == workers[clocked[1]]


def test_two_processes_that_want_the_same_folder_make_it_once(made_once, tmp_path: Path):
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
