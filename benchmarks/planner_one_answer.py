"""One answer per request: plans hashed in child processes that see other BLAS kernels and processor features."""

import itertools
import json
import os
import subprocess
import sys
from pathlib import Path

import report

KERNELS = ("Haswell", "Zen", "SkylakeX", "Sandybridge", "Prescott")
"""Of OpenBLAS."""
FEATURES_OFF = {
    "NPY_DISABLE_CPU_FEATURES": "X86_V3 X86_V4 AVX512_ICL AVX512_SPR",
    "GLIBC_TUNABLES": "glibc.cpu.hwcaps=-AVX2,-FMA,-FMA4,-AVX512F",
}
"""NumPy's vector paths (names of NumPy 2.4) and the C library's variants with fused multiply-add."""
SETTINGS = [{"OPENBLAS_CORETYPE": kernel} | off for kernel, off in itertools.product(KERNELS, ({}, FEATURES_OFF))]
_SCRIPT = Path(__file__).with_name("planner_answers.py")


def rows(clutter: int = 50, walks: int = 40) -> list[report.Row]:
    """How many plans have one hash under all settings."""
    found = []
    for name, count, arguments in (
        (f"{clutter} clutter scenes", clutter, ["clutter", "0", str(clutter)]),
        (f"{walks} walks x 3 vehicles", 3 * walks, ["walks", "0", str(walks)]),
    ):
        equal, apart = compared([answers(arguments, setting) for setting in SETTINGS])
        print(f"{name}: apart: {', '.join(apart) or 'none'}", file=sys.stderr)
        label = f"{name}: one hash under {len(SETTINGS)} settings"
        found.append(report.row(label, equal, "plans", f"{count}", equal == count))
    return found


def answers(arguments: list[str], setting: dict[str, str]) -> dict[str, str]:
    """Hashes by name from a child process with these environment variables."""
    environment = os.environ | {"OPENBLAS_NUM_THREADS": "1"} | setting
    done = subprocess.run(
        [sys.executable, str(_SCRIPT), *arguments], env=environment, capture_output=True, text=True, check=True
    )
    return json.loads(done.stdout)


def compared(all_answers: list[dict[str, str]]) -> tuple[int, list[str]]:
    """How many plans have the same hash in all answers, and the names of the others."""
    first = all_answers[0]
    apart = [name for name in first if any(answer[name] != first[name] for answer in all_answers)]
    return len(first) - len(apart), apart


if __name__ == "__main__":
    report.main(rows, clutter=50, walks=40)
