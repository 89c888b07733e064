"""What the environment switches off of a processor is off: these libraries ignore a name they do not know, silently."""

import ctypes
import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import scipy
from numpy._core import _multiarray_umath as numpy_core

from tests.waiting import PATIENCE_S

ROOT = Path(__file__).parents[1]
KERNEL_NAMES = {"Prescott": "Katmai", "Zen": "Haswell"}
"""Kernels that OpenBLAS' wheels share; it gives the name of the first."""
C_LIBRARY_FEATURES = {
    "AVX": (0, 2, 28),
    "FMA": (0, 2, 12),
    "AVX2": (1, 1, 5),
    "AVX512F": (1, 1, 16),
    "FMA4": (2, 2, 16),
}
"""Where cpuid shows each: leaf as glibc's <sys/platform/x86.h> counts them, register, bit."""


class CpuidLeaf(ctypes.Structure):
    """`struct cpuid_feature` of <sys/platform/x86.h>: what the processor has, and what the C library makes use of."""

    _fields_ = (("cpuid", ctypes.c_uint32 * 4), ("active", ctypes.c_uint32 * 4))


def names(variable: str) -> list[str]:
    """What the variable lists, separated by commas or spaces; nothing where it is not set."""
    return os.environ.get(variable, "").replace(",", " ").split()


def blas_kernels() -> set[str]:
    """The kernels that NumPy's and SciPy's own OpenBLAS took."""
    found = set()
    for package, suffix in ((np, "64_"), (scipy, "")):
        folder = Path(package.__path__[0]).parent / f"{package.__name__}.libs"
        for library in folder.glob("*openblas*"):
            name = getattr(ctypes.CDLL(str(library)), f"scipy_openblas_get_corename{suffix}")
            name.restype = ctypes.c_char_p
            found.add(name().decode())
    return found


def used_by_c_library(feature: str) -> bool:
    leaf, register, bit = C_LIBRARY_FEATURES[feature]
    get = ctypes.CDLL(None).__x86_get_cpuid_feature_leaf
    get.restype = ctypes.POINTER(CpuidLeaf)
    return bool(get(leaf)[0].active[register] >> bit & 1)


def test_blas_uses_the_kernel_that_the_environment_names():
    for kernel in names("OPENBLAS_CORETYPE"):
        assert blas_kernels() == {KERNEL_NAMES.get(kernel, kernel)}


def test_numpy_uses_no_vector_unit_that_the_environment_switches_off():
    for feature in names("NPY_DISABLE_CPU_FEATURES"):
        assert feature in numpy_core.__cpu_dispatch__
        assert not numpy_core.__cpu_features__[feature]


def test_the_c_library_uses_no_instruction_that_the_environment_switches_off():
    for tunable in os.environ.get("GLIBC_TUNABLES", "").split(":"):
        name, _, value = tunable.partition("=")
        for feature in value.split(",") if name == "glibc.cpu.hwcaps" else ():
            assert feature.removeprefix("-") in C_LIBRARY_FEATURES
            assert not used_by_c_library(feature.removeprefix("-"))


@pytest.mark.parametrize(
    ("variable", "value", "law"),
    [
        ("OPENBLAS_CORETYPE", "Presscott", test_blas_uses_the_kernel_that_the_environment_names),
        ("NPY_DISABLE_CPU_FEATURES", "AVX3", test_numpy_uses_no_vector_unit_that_the_environment_switches_off),
        (
            "GLIBC_TUNABLES",
            "glibc.cpu.hwcaps=-AVX2_Usable",
            test_the_c_library_uses_no_instruction_that_the_environment_switches_off,
        ),
    ],
)
def test_a_misspelled_setting_is_noticed(variable: str, value: str, law: Callable[[], None]):
    command = [sys.executable, "-c", f"from tests import test_processors; test_processors.{law.__name__}()"]
    environment = os.environ | {variable: value}
    done = subprocess.run(
        command, cwd=ROOT, env=environment, capture_output=True, text=True, timeout=PATIENCE_S, check=False
    )
    assert done.returncode == 1
    assert "AssertionError" in done.stderr
