"""The command line as a stranger meets it, judged by exit code and words; twice as a program of its own."""

import json
import os
import subprocess
import sys

import numpy as np
import pytest

from flight import flight_log
from goshawk.cli import verbs
from tests.goshawk.running import answer as goshawk
from tests.waiting import goshawk as program


def test_help_names_every_verb():
    answer = program("--help")
    assert answer.returncode == 0
    for verb, words in (item for summaries in verbs().values() for item in summaries.items()):
        assert f"  {verb} " in answer.stdout
        assert words.split()[0] in answer.stdout


@pytest.mark.parametrize("verb", [verb for summaries in verbs().values() for verb in summaries])
def test_the_help_of_every_verb_has_lines_to_paste(verb):
    answer = goshawk(verb, "--help")
    assert answer.returncode == 0, answer.stderr
    assert f"  goshawk {verb} " in answer.stdout.split("Options:")[0]
    assert answer.stdout.count("\n  goshawk ") >= 2


def test_wrong_usage_ends_with_2():
    for arguments in (["nonsense"], ["plan"], ["log", "show"], ["log", "show", "a", "b"]):
        assert goshawk(*arguments).returncode == 2


def test_a_missing_file_is_one_sentence_and_no_traceback(tmp_path):
    answer = program("log", "show", tmp_path / "none.parquet")
    assert answer.returncode == 2
    assert answer.stderr.startswith("goshawk: ")
    assert len(answer.stderr.splitlines()) == 1


def test_with_json_an_error_is_json_too(tmp_path):
    answer = goshawk("log", "show", tmp_path / "none.parquet", "--json")
    assert json.loads(answer.stdout)["error"]["kind"] == "InputError"


def test_a_log_is_described_with_its_gap(tmp_path):
    time_s = np.delete(np.arange(200) / 100.0, np.arange(50, 70))
    log = flight_log.from_vectors(time_s, {"position_world_m": np.ones((180, 3))}, metadata={"vehicle": "kestrel"})
    flight_log.save(tmp_path / "f.parquet", log)
    document = json.loads(goshawk("log", "show", tmp_path / "f.parquet", "--json").stdout)
    assert document["rows"] == 180
    assert document["gaps"] == 1
    assert document["longest_gap_s"] == pytest.approx(0.21)
    assert document["rate_hz"] == pytest.approx(100.0)
    assert "position_world_x_m" in goshawk("log", "show", tmp_path / "f.parquet").stdout
    checked = json.loads(goshawk("log", "check", tmp_path / "f.parquet", "--json").stdout)["check"]
    assert "gap" in {finding["what"] for finding in checked["findings"]}
    assert "error: 1 gap," in goshawk("log", "check", tmp_path / "f.parquet").stdout


@pytest.mark.parametrize(("asked", "set_to"), [(None, "1"), ("2", "2")])
def test_a_command_keeps_blas_to_one_thread_unless_told_otherwise(asked, set_to):
    environment = {name: value for name, value in os.environ.items() if not name.endswith("_NUM_THREADS")}
    environment |= {} if asked is None else {"OPENBLAS_NUM_THREADS": asked}
    code = (
        "import os, goshawk.cli, numpy, scipy.linalg; "  # as the entry point: NumPy comes after Goshawk
        "print(len(os.listdir('/proc/self/task')), *map(os.environ.get, ('OPENBLAS_NUM_THREADS', 'OMP_NUM_THREADS')))"
    )
    answer = subprocess.run([sys.executable, "-c", code], env=environment, capture_output=True, text=True, check=True)
    threads, openblas, openmp = answer.stdout.split()
    assert (openblas, openmp) == (set_to, "None")  # OpenMP's is left alone: COLMAP's own threads are not BLAS'
    assert asked is not None or threads == "1"


@pytest.mark.parametrize("verb", ["map", "localize"])
def test_a_verb_of_mapping_starts_without_packages_that_it_does_not_use(verb):
    code = f"import sys, goshawk.commands.map.{verb}; print(*sys.modules)"
    answer = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert not {"sysid", "planner", "pycolmap"} & set(answer.stdout.split())


def test_doctor_finds_this_installation_well():
    answer = goshawk("doctor", "--json")
    document = json.loads(answer.stdout)
    assert document["healthy"], [f for f in document["findings"] if not f["ok"]]
    assert answer.returncode == 0
