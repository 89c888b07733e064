"""The same preflight gives the same bits whatever the processor: flown in processes that see fewer of its features."""

import json
import os
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import preflight
from preflight import draws
from tests.preflight.conftest import Wall, exact_vehicle, there_and_back
from tests.waiting import PATIENCE_S

ROOT = Path(__file__).parents[2]
UNCERTAIN = ("mass_kg", "motor_lag.rise_s", "parasitic_drag.drag_xy_kg_m", "thrust_bem.k1_n_s2")
ELSEWHERE = {
    "OPENBLAS_CORETYPE": "Prescott",
    "NPY_DISABLE_CPU_FEATURES": "X86_V3 X86_V4 AVX512_ICL AVX512_SPR",
    "GLIBC_TUNABLES": "glibc.cpu.hwcaps=-AVX2,-FMA,-FMA4,-AVX512F",
}
WORLD = preflight.Uncertainty(wind_m_s=2.0, gust_std_m_s=1.0, motor_fault_ratio=0.1, pose_jump_std_m=0.02)


def told(flights: int, by_levels: bool) -> str:
    """All of a preflight of a model with correlated errors."""
    drone = exact_vehicle()
    for name in UNCERTAIN:
        drone = drone.with_value(name, drone.value(name), std=0.05 * abs(drone.value(name)), source="identified")
    matrix = np.full((4, 4), 0.6) + 0.4 * np.eye(4)
    drone = replace(drone, provenance={draws.CORRELATION: {"names": list(UNCERTAIN), "matrix": matrix.tolist()}})
    options = preflight.Options(
        flights=flights, uncertainty=WORLD, rate_hz=400, rare=by_levels, risk=1e-2, explain=False, threads=1
    )
    found = preflight.fly(preflight.Scenario(drone, there_and_back(1.0, 1.0), Wall(0.25), radius_m=0.1), options)
    return json.dumps(found.as_dict(), sort_keys=True)


def told_with(setting: dict[str, str], asked: str) -> str:
    code = f"from tests.preflight import test_one_answer; print(test_one_answer.told({asked}))"
    environment = os.environ | setting
    return subprocess.run(
        [sys.executable, "-c", code], cwd=ROOT, env=environment, capture_output=True, text=True, timeout=PATIENCE_S,
        check=True,
    ).stdout  # fmt: skip


def test_draws_flights_and_shares_are_equal_without_vector_units_and_with_another_blas():
    """That the settings change what NumPy computes, tests/planner/test_one_answer.py shows."""
    here = told_with({}, "40, False")
    assert json.loads(here)["shares"]
    assert told_with(ELSEWHERE, "40, False") == here


@pytest.mark.slow
def test_levels_and_their_bounds_are_equal_too():
    here = told_with({}, "200, True")
    assert json.loads(here)["risk"]["levels"] > 1
    assert told_with(ELSEWHERE, "200, True") == here
