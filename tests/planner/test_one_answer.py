"""The same request gives the same bits whatever the processor: checked in processes that see fewer of its features."""

import importlib.util
import os
import subprocess
import sys
from pathlib import Path

import pytest

_BENCHMARKS = Path(__file__).parents[2] / "benchmarks"


@pytest.fixture(scope="module")
def harness():
    """The benchmark's own functions, loaded from their file."""
    sys.path.insert(0, str(_BENCHMARKS))
    spec = importlib.util.spec_from_file_location("planner_one_answer", _BENCHMARKS / "planner_one_answer.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    yield module
    sys.path.remove(str(_BENCHMARKS))
    sys.modules.pop("report", None)


def test_plans_and_reports_are_equal_bit_by_bit_without_vector_units_and_with_another_blas(harness):
    here, elsewhere = {}, {"OPENBLAS_CORETYPE": "Prescott"} | harness.FEATURES_OFF
    found = [harness.answers(["few"], setting) for setting in (here, elsewhere)]
    assert not any(answer.startswith("refused") for answer in found[0].values()), found[0]
    assert harness.compared(found) == (len(found[0]), [])


def test_the_settings_do_change_what_numpy_and_the_c_library_compute(harness):
    """Else the test above shows nothing."""
    if "avx2" not in Path("/proc/cpuinfo").read_text():
        pytest.skip("this processor has no vector units to switch off")
    elsewhere = {"OPENBLAS_CORETYPE": "Prescott"} | harness.FEATURES_OFF
    here = {name: value for name, value in os.environ.items() if name not in elsewhere}
    code = (
        "import ctypes, numpy as np; m = ctypes.CDLL('libm.so.6'); m.sin.restype = ctypes.c_double;"
        "m.sin.argtypes = [ctypes.c_double]; x = np.random.default_rng(0).uniform(size=(100, 100));"
        "print([a.tobytes().hex() for a in (x @ x, np.exp(x), np.array([m.sin(v) for v in x.ravel()]))])"
    )
    found = [
        subprocess.run(
            [sys.executable, "-c", code], env=environment, capture_output=True, text=True, check=True
        ).stdout.split(",")
        for environment in (here, here | elsewhere)
    ]
    assert all(a != b for a, b in zip(*found, strict=True))
