"""The embedded C under tools/assure.py, and its case files."""

import importlib.util
import re
import shutil
import subprocess
import sys
from pathlib import Path
from types import ModuleType

import pytest

ROOT = Path(__file__).resolve().parents[2]
LIBRARY = ROOT / "firmware_bridge" / "controller"
INCLUDES = (f"-I{LIBRARY / 'include'}", "-isystem", str(LIBRARY.parent / "dialect" / "generated"))


def _load_assure() -> ModuleType:
    spec = importlib.util.spec_from_file_location("assure", ROOT / "tools" / "assure.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules["assure"] = module
    spec.loader.exec_module(module)
    return module


assure = _load_assure()


def _need(*tools: str) -> None:
    for tool in tools:
        if shutil.which(tool) is None:
            pytest.skip(f"{tool} is not installed")


def _run(*command: object) -> str:
    done = subprocess.run([str(word) for word in command], capture_output=True, text=True, timeout=300, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


def test_every_case_of_codec_link_state_machine_and_failsafes_holds(debug_build, tmp_path):
    _run("gcc", *debug_build.flags, *INCLUDES, *assure.CASES, *debug_build.objects, "-lm", "-o", tmp_path / "cases")
    checks = int(_run(tmp_path / "cases").split()[0])
    assert checks > 100_000


@pytest.mark.slow
def test_every_branch_of_codec_link_state_machine_and_failsafes_is_taken(tmp_path):
    _need("clang-19", "llvm-cov-19", "llvm-profdata-19")
    found = assure.coverage(tmp_path)
    assert {name: found[name].open for name in assure.WHOLE if found[name].open} == {}
    open_conditions = {name: found[name].conditions - found[name].independent for name in assure.WHOLE}
    assert {name: count for name, count in open_conditions.items() if count} == {}  # MC/DC


@pytest.mark.slow
def test_static_analysis_finds_nothing_outside_the_written_deviations(tmp_path):
    _need("gcc", "cppcheck")
    assert assure.warnings(tmp_path) == []
    assert assure.misra() == []


@pytest.mark.slow
@pytest.mark.parametrize("level", ["-Os", "-O2"])
def test_every_call_keeps_to_a_kilobyte_of_stack_and_the_state_to_its_bar(tmp_path, level):
    """By the compiler's call graph for Cortex-M4F."""
    _need("arm-none-eabi-gcc")
    size = assure.size(tmp_path, level)
    assert sum(size.ram.values()) <= assure.MEMORY_BAR  # besides the trajectory slots
    public = {"tc_tick", "tc_link_receive", "tc_link_transmit", "tc_link_update", "tc_do", "tc_parameters_set"}
    assert public <= set(size.stack)
    assert {name: needed for name, (needed, _) in size.stack.items() if needed > assure.STACK_BAR} == {}


@pytest.mark.slow
def test_the_vehicles_build_does_not_grow_in_flash(tmp_path):
    """The goal of 52 kB is missed (docs/evidence/performance.md)."""
    _need("cmake", "arm-none-eabi-gcc")
    taken = assure.flash(tmp_path, assure.vehicle_library(tmp_path / "library"))
    assert taken["controller and link"] <= FLASH


@pytest.fixture(scope="module")
def counts(tmp_path_factory) -> dict[str, int]:
    _need("cmake", "arm-none-eabi-gcc", "qemu-system-arm")
    folder = tmp_path_factory.mktemp("cost")
    return assure.cost(folder, assure.vehicle_library(folder / "library"))


@pytest.mark.slow
def test_no_tick_in_any_situation_takes_more_than_the_documented_instructions(counts):
    ticks = {name: count for name, count in counts.items() if name.startswith("tc_tick")}
    assert {name.split(":")[1].split(",")[0].strip() for name in ticks} >= {
        "disarmed", "armed", "take-off", "hold", "approach", "trajectory", "pausing", "paused", "stopping",
        "landing", "emergency", "fault", "shadow",
    }  # fmt: skip
    assert {name: count for name, count in ticks.items() if count > WORST_TICK} == {}


@pytest.mark.slow
def test_the_documentation_lists_the_worst_instructions_of_every_public_function(counts):
    page = (ROOT / "docs" / "firmware" / "cost.md").read_text()
    assert assure.cost_table(counts) in page, "python tools/assure.py cost --markdown"
    headers = [(LIBRARY / "include" / "goshawk_controller" / name).read_text() for name in ("controller.h", "link.h")]
    declared = set(re.findall(r"^[a-z].*?\b(tc_\w+)\(", "\n".join(headers), re.MULTILINE))
    trivial = {"tc_parameters_now", "tc_telemetry_now", "tc_observer_now"}  # return a pointer
    counted = {re.split(r"[:,]", name)[0] for name in counts}
    assert declared - trivial - NOT_COUNTED <= counted


WORST_TICK = 7500
"""Instructions; measured 7,484."""
FLASH = 60_004
"""Bytes, as measured; the bar of 52 kB is missed, and what it takes must not grow."""

NOT_COUNTED = {"tc_link_restore", "tc_upload_check_ahead", "tc_upload_may_activate"}
"""The first: before the first tick only, all of a trajectory in one call. The others count in the link's."""


MUTANTS_TRIED = 8
"""Of so many one, in the slow tests: three minutes. `python tools/assure.py mutate` tries all."""


@pytest.mark.slow
@pytest.mark.parametrize("name", assure.MUTATED)
def test_the_case_files_notice_nine_of_ten_faults(name):
    _need("gcc", "clang-19")
    [found] = assure.mutate([name], every=MUTANTS_TRIED)
    assert found.killed + len(found.survived) > 10
    assert found.share >= assure.LEAST_SCORE, [mutant.key for mutant in found.survived]


TOY = """\
#include <stdbool.h>
static const float LIMIT = 2.0f;
int clamp(int x, float y);
int clamp(int x, float y) {
    bool high = x > 3 && y < LIMIT;
    if (high) x = x + 1;
    return -x;
}
"""


def test_mutants_are_small_faults_that_compile(tmp_path):
    _need("gcc", "clang-19")
    (tmp_path / "toy.c").write_text(TOY)
    found = assure.mutation.mutants(tmp_path / "toy.c")
    texts = {mutant.text for mutant in found}
    assert {
        "bool high = x <= 3 && y < LIMIT;", "bool high = x >= 3 && y < LIMIT;", "bool high = x > 4 && y < LIMIT;",
        "bool high = x > 3 || y < LIMIT;", "bool high = x > 3 && y >= LIMIT;", "if (!(high)) x = x + 1;",
        "if (0) x = x + 1;", "if (high) x = x - 1;", "without x = x + 1", "return x;",
        "static const float LIMIT = 3.0f;", "static const float LIMIT = 1.33333333f;",
    } <= texts  # fmt: skip
    assert "bool high = x > 3 && y <= LIMIT;" not in texts  # a boundary of floats
    for mutant in found:
        (tmp_path / "mutant.c").write_text(mutant.applied(TOY))
        _run("gcc", "-std=c11", "-w", "-c", tmp_path / "mutant.c", "-o", tmp_path / "mutant.o")


CHECKSUMS = """\
#include "goshawk_controller/link_codec.h"
#include "goshawk_controller/trajectory.h"
uint16_t quick16(uint16_t crc, const uint8_t *bytes, size_t n);
uint32_t quick_word(uint32_t, uint32_t);
uint32_t quick32(uint32_t crc, const uint8_t *bytes, size_t n);
int main(void)
{
    uint8_t bytes[300];
    for (size_t i = 0; i < sizeof bytes; i++) bytes[i] = (uint8_t)(37u * i * i + 11u);
    for (size_t n = 0; n <= sizeof bytes; n++) {
        if (tc_crc16((uint16_t)n, bytes, n) != quick16((uint16_t)n, bytes, n)) return 1;
        if (tc_crc32(99u * n, bytes, n) != quick32(99u * n, bytes, n)) return 2;
        if (tc_crc32_u32(99u * n, 77u * n) != quick_word(99u * n, 77u * n)) return 3;
    }
    return 0;
}
"""


def test_the_fuzz_targets_checksums_are_those_of_the_library(tmp_path):
    _need("gcc")
    main = tmp_path / "main.c"
    main.write_text(CHECKSUMS)
    quick = LIBRARY / "fuzz" / "quick_crc.c"
    renamed = ("-Dtc_crc16=quick16", "-Dtc_crc32=quick32", "-Dtc_crc32_u32=quick_word")
    _run("gcc", "-std=c11", *renamed, *INCLUDES, "-c", quick, "-o", tmp_path / "quick.o")
    plain = [assure.source(name) for name in assure.QUICKER]
    _run("gcc", "-std=c11", *INCLUDES, main, tmp_path / "quick.o", *plain, "-o", tmp_path / "checksums")
    _run(tmp_path / "checksums")


@pytest.mark.slow
def test_the_link_target_flies_a_path(tmp_path):
    """It did not while its estimates marked no field valid: nothing armed the vehicle."""
    _need("clang-19")
    corpus = tmp_path / "corpus"
    corpus.mkdir()
    (corpus / "flight").write_bytes(assure.link_flight())
    command = [assure.fuzz_target("link", tmp_path), "-runs=0", "-print_coverage=1", "-detect_leaks=0", corpus]
    done = subprocess.run([str(word) for word in command], capture_output=True, text=True, timeout=300, check=True)
    covered = set(re.findall(r"^COVERED_FUNC: .* (tc_\w+) ", done.stderr, re.MULTILINE))
    assert {"tc_mixer_solve", "tc_clock_advance"} <= covered


@pytest.mark.slow
@pytest.mark.parametrize("target", assure.TARGETS)
def test_libfuzzer_finds_nothing_in_a_short_run(tmp_path, target):
    _need("clang-19")
    program = assure.fuzz_target(target, tmp_path)
    _run(program, f"-max_len={assure.LONGEST_INPUT}", "-runs=50000", "-seed=1")
