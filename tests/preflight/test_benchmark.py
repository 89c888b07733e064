"""benchmarks/preflight.py: what it keeps of many flights, and that its rows can be measured."""

import importlib.util
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from tests.preflight.conftest import EXACT

FOLDER = Path(__file__).parents[2] / "benchmarks"
FLIGHTS = 10


@pytest.fixture
def benchmark_script(monkeypatch):
    """The module, under a name that is not the package's, with chunks of four flights."""
    monkeypatch.setattr(sys, "path", [*sys.path, str(FOLDER)])
    spec = importlib.util.spec_from_file_location("preflight_benchmark", FOLDER / "preflight.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    monkeypatch.setitem(sys.modules, spec.name, module)
    spec.loader.exec_module(module)
    monkeypatch.setattr(module, "CHUNK", 4)
    return module


def counted(module, monkeypatch) -> list[int]:
    """Seeds of the chunks that are flown from now on."""
    seeds, fly = [], module.short

    def short(flights: int, seed: int, *given):
        seeds.append(seed)
        return fly(flights, seed, *given)

    monkeypatch.setattr(module, "short", short)
    return seeds


def test_what_is_kept_is_not_flown_again_unless_it_is_damaged(benchmark_script, monkeypatch, tmp_path):
    seeds = counted(benchmark_script, monkeypatch)
    first = benchmark_script.Kept(tmp_path, EXACT, FLIGHTS).clearance
    assert first.shape == (FLIGHTS,)
    assert len(seeds) == len(set(seeds)) == 3
    np.testing.assert_array_equal(benchmark_script.Kept(tmp_path, EXACT, FLIGHTS).clearance, first)
    assert len(seeds) == 3
    torn, short, empty = sorted(tmp_path.glob("*.npy"))
    torn.write_bytes(torn.read_bytes()[:-9])
    np.save(short, np.zeros(3))
    empty.write_bytes(b"")
    np.testing.assert_array_equal(benchmark_script.Kept(tmp_path, EXACT, FLIGHTS).clearance, first)
    assert seeds[3:] == seeds[:3]


def test_another_world_plan_vehicle_wall_rate_or_code_has_files_of_its_own(benchmark_script, monkeypatch, tmp_path):
    def stem(world=EXACT) -> str:
        return benchmark_script.Kept(tmp_path, world, FLIGHTS)._stem

    usual, module = stem(), benchmark_script
    assert stem() == usual
    found, asked, beside = [stem(replace(EXACT, wind_m_s=1.0))], module.asked, module.beside
    for name, other in (
        ("SHORT", (1.0, 1.1)),
        ("CHUNK", 5),
        ("FIRST_SEED", 7),
        ("asked", lambda *given: replace(asked(*given), rate_hz=500)),
        ("beside", lambda wall_m: replace(beside(wall_m), field=module.conftest.Wall(0.1))),
        ("beside", lambda wall_m: replace(beside(wall_m), vehicle=beside(0.0).vehicle.with_value("mass_kg", 0.8))),
    ):
        with monkeypatch.context() as patched:
            patched.setattr(module, name, other)
            found.append(f"{stem()}_{module.FIRST_SEED}")
    other_code = tmp_path / "preflight"
    other_code.mkdir()
    (other_code / "__init__.py").write_text("")
    monkeypatch.setattr(module.preflight, "__file__", str(other_code / "__init__.py"))
    found.append(stem())
    assert len({usual, f"{usual}_{module.FIRST_SEED}", *found}) == len(found) + 2


@pytest.mark.slow
def test_every_row_is_measured_with_few_flights_too(benchmark_script, monkeypatch, tmp_path):
    monkeypatch.setattr(benchmark_script, "of_other_physics", lambda truths: [])  # slow, and tested itself
    monkeypatch.setattr(benchmark_script, "CHUNK", 1000)
    found = benchmark_script.rows(4, 1000, 2, 1, "", str(tmp_path), 1, 1)
    assert {"1,000 flights of 20 s, CPU", "99 % tube holds"} <= {row.name for row in found}
    assert any("by levels, stated 95 % bound" in row.name for row in found)
    assert all(np.isfinite(row.value) for row in found)
