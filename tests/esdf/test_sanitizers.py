"""The kernels under AddressSanitizer and UndefinedBehaviorSanitizer: the tests again on an instrumented build."""

import os
import platform
import shutil
import subprocess
import sys
import sysconfig
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
TESTS = ["build", "field", "edits", "blocks", "observe", "visibility", "regrid", "clearance"]
FLAGS = ["-std=c++17", "-O1", "-g", "-fPIC", "-ffp-contract=off", "-fno-math-errno", "-fno-omit-frame-pointer"]
SANITIZERS = ["-fsanitize=address,undefined", "-fno-sanitize-recover=undefined"]
RUNNER = """
import importlib.util, sys
spec = importlib.util.spec_from_file_location("esdf._esdf", sys.argv[1])
sys.modules["esdf._esdf"] = kernels = importlib.util.module_from_spec(spec)
spec.loader.exec_module(kernels)
import esdf, pytest
assert esdf.build.__globals__["_esdf"] is kernels
sys.exit(pytest.main(["-q", "-x", "-p", "no:cacheprovider", *sys.argv[2:]]))
"""


def _instrumented(folder: Path, compiler: str) -> Path:
    """The extension module, compiled anew with both sanitizers; nanobind itself without."""
    nanobind = pytest.importorskip("nanobind", reason="nanobind's sources are needed to build the kernels again")
    package = Path(nanobind.__file__).parent
    headers = [package / "include", package / "ext" / "robin_map" / "include", sysconfig.get_path("include")]
    include = [f"-I{header}" for header in headers]
    sources = sorted((ROOT / "esdf" / "src").glob("*.cpp"))
    jobs = [(source, SANITIZERS) for source in sources] + [(package / "src" / "nb_combined.cpp", [])]

    def compile_one(job: tuple[Path, list[str]]) -> str:
        target = folder / f"{job[0].stem}.o"
        command = [compiler, *FLAGS, *job[1], *include, "-c", job[0], "-o", target]
        subprocess.run(list(map(str, command)), check=True, capture_output=True)
        return str(target)

    with ThreadPoolExecutor(2) as workers:
        objects = list(workers.map(compile_one, jobs))
    module = folder / "_esdf.so"
    subprocess.run([compiler, "-shared", *SANITIZERS, *objects, "-o", str(module), "-lpthread"], check=True)
    return module


@pytest.mark.slow
def test_no_sanitizer_finds_anything_in_the_kernels(tmp_path):
    compiler = shutil.which("g++")
    if compiler is None or platform.system() != "Linux":
        pytest.skip("the instrumented build needs g++ on Linux")
    runtime = subprocess.run([compiler, "-print-file-name=libasan.so"], capture_output=True, text=True, check=True)
    module = _instrumented(tmp_path, compiler)
    environment = os.environ | {
        "LD_PRELOAD": runtime.stdout.strip(),
        "ASAN_OPTIONS": "detect_leaks=0:abort_on_error=0:exitcode=99",
        "UBSAN_OPTIONS": "print_stacktrace=1",
        "PYTHONMALLOC": "malloc",  # so that every array has a guarded zone round it
        "PYTHONPATH": str(ROOT),
    }
    tests = [str(ROOT / "tests" / "esdf" / f"test_{name}.py") for name in TESTS]
    command = [sys.executable, "-c", RUNNER, str(module), *tests]
    answer = subprocess.run(command, env=environment, cwd=ROOT, capture_output=True, text=True, check=False)
    assert answer.returncode == 0, answer.stdout[-4000:] + answer.stderr[-4000:]
    assert "runtime error" not in answer.stderr
    assert "AddressSanitizer" not in answer.stderr
