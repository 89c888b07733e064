"""The embedded C under tools/assure.py, its case files, and the documentation's examples, compiled."""

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
PAGE = (ROOT / "docs" / "c_integration.md").read_text()


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


def _has_sanitizers(folder: Path) -> bool:
    (folder / "probe.c").write_text("int main(void) { return 0; }\n")
    probe = ["gcc", "-fsanitize=address,undefined", str(folder / "probe.c"), "-o", str(folder / "probe")]
    return subprocess.run(probe, capture_output=True, check=False).returncode == 0


def test_every_corner_case_of_codec_link_and_state_machine_holds(tmp_path):
    _need("gcc")
    sanitizers = ("-fsanitize=address,undefined", "-fno-sanitize-recover=all") if _has_sanitizers(tmp_path) else ()
    cases = [LIBRARY / "test" / name for name in assure.CASES]
    flags = ("-std=c11", "-g", *sanitizers, "-fno-math-errno", "-DTC_MAX_SEGMENTS=32")
    _run("gcc", *flags, *INCLUDES, *cases, *assure.sources(), "-lm", "-o", tmp_path / "cases")
    checks = int(_run(tmp_path / "cases").split()[0])
    assert checks > 2500


def _block(language: str, containing: str) -> str:
    """The code block of the integration page in which these words are."""
    blocks = re.findall(rf"```{language}\n(.*?)```", PAGE, re.DOTALL)
    return next(block for block in blocks if containing in block)


THREE_FUNCTIONS = """\
#include <stdlib.h>
#include "goshawk_controller/link.h"
static tc_link_config link_config;
static tc_link_measured measured;
static uint8_t bytes[TC_FRAME_MAX], frame[TC_FRAME_MAX];
static size_t count;
static unsigned sent;
static uint64_t now_us(void) { static uint64_t t = 1; return t += 2500; }
static tc_estimate read_estimator(void) { tc_estimate e = {0}; e.q_world_body[0] = 1.0f; return e; }
static void write_rotor_speeds(const float speed[4]) { if (!(speed[0] >= 0.0f)) abort(); }
static void send(const uint8_t *f, size_t n) { sent += f[0] == 0xFDu && n > 11u; }
static void halt(void) { abort(); }
void setup(void);
void control_task(void);
void link_task(void);
EXAMPLE
int main(void)
{
    link_config.system_id = link_config.component_id = 1;
    link_config.bytes_per_s = 100000;
    setup();
    for (int i = 0; i < 1000; i++) { control_task(); link_task(); }
    return sent > 100 ? 0 : 1;
}
"""


def test_the_three_function_integration_of_the_documentation_compiles_and_speaks(tmp_path):
    _need("gcc")
    program = tmp_path / "example.c"
    program.write_text(THREE_FUNCTIONS.replace("EXAMPLE", _block("c", "void control_task")))
    flags = ("-std=c11", "-Wall", "-Wextra", "-Werror", "-fno-math-errno")
    _run("gcc", *flags, *INCLUDES, program, *assure.sources(), "-lm", "-o", tmp_path / "example")
    _run(tmp_path / "example")


PX4 = """\
#include <cstdint>
#include <cstring>
#include "goshawk_controller/goshawk_controller.h"
struct vehicle_local_position_s { uint64_t timestamp_sample; float x, y, z, vx, vy, vz; };
struct vehicle_attitude_s { uint64_t timestamp_sample; float q[4]; };
struct vehicle_angular_velocity_s { uint64_t timestamp_sample; float xyz[3]; };
struct actuator_motors_s { uint64_t timestamp; float control[12]; };
template <class T> struct Subscription { bool copy(T *to) { *to = T{}; return true; } };
template <class T> struct Publication { void publish(const T &) {} };
static uint64_t hrt_absolute_time() { return 1; }
static float throttle_of(float speed_rad_s) { return speed_rad_s / 1800.0f; }
class GoshawkModule {
  public:
    void Run();
  private:
    tc_controller _controller{};
    int _motor_of[4] = {0, 1, 2, 3};
    Subscription<vehicle_local_position_s> _position_sub;
    Subscription<vehicle_attitude_s> _attitude_sub;
    Subscription<vehicle_angular_velocity_s> _rate_sub;
    Publication<actuator_motors_s> _motors_pub;
};
"""


def test_the_px4_shaped_integration_of_the_documentation_compiles(tmp_path):
    """Against stand-ins with PX4's field names."""
    _need("g++")
    program = tmp_path / "module.cpp"
    program.write_text(PX4 + _block("cpp", "GoshawkModule::Run"))
    _run("g++", "-std=c++17", "-Wall", "-Wextra", "-Werror", *INCLUDES, "-c", program, "-o", tmp_path / "module.o")


@pytest.mark.slow
def test_every_branch_of_codec_link_and_state_machine_is_taken(tmp_path):
    _need("clang-19", "llvm-cov-19", "llvm-profdata-19")
    found = assure.coverage(tmp_path)
    assert {name: found[name].open for name in assure.WHOLE if found[name].open} == {}
    assert {name: found[name].independent for name in assure.WHOLE} == {
        name: found[name].conditions for name in assure.WHOLE
    }  # MC/DC


@pytest.mark.slow
def test_static_analysis_finds_nothing_outside_the_written_deviations(tmp_path):
    _need("gcc", "cppcheck")
    assert assure.warnings(tmp_path) == []
    assert assure.misra() == []


@pytest.mark.slow
@pytest.mark.parametrize("level", ["-Os", "-O2"])
def test_calls_from_the_ground_keep_to_512_bytes_of_stack_and_state_to_2_kilobytes(tmp_path, level):
    """By the compiler's call graph for Cortex-M4F; the tick has a bar of its own in benchmarks/controller.py."""
    _need("arm-none-eabi-gcc")
    size = assure.size(tmp_path, level)
    assert sum(size.ram.values()) <= 2048  # besides the trajectory slots
    stack = size.stack
    assert {"tc_link_receive", "tc_link_transmit", "tc_link_update", "tc_do", "tc_parameters_set"} <= set(stack)
    deep = {name: needed for name, (needed, _) in stack.items() if needed > 512}
    assert set(deep) <= {"tc_tick"}


@pytest.mark.slow
def test_the_vehicles_build_takes_no_more_flash_than_the_documentation_says(tmp_path):
    _need("cmake", "arm-none-eabi-gcc")
    taken = assure.flash(tmp_path, assure.vehicle_library(tmp_path / "library"))
    assert taken["controller and link"] <= 26_500


CHECKSUMS = """\
#include "goshawk_controller/link_codec.h"
#include "goshawk_controller/trajectory.h"
uint16_t quick16(uint16_t crc, const uint8_t *bytes, size_t n);
uint32_t quick32(uint32_t crc, const uint8_t *bytes, size_t n);
int main(void)
{
    uint8_t bytes[300];
    for (size_t i = 0; i < sizeof bytes; i++) bytes[i] = (uint8_t)(37u * i * i + 11u);
    for (size_t n = 0; n <= sizeof bytes; n++) {
        if (tc_crc16((uint16_t)n, bytes, n) != quick16((uint16_t)n, bytes, n)) return 1;
        if (tc_crc32(99u * n, bytes, n) != quick32(99u * n, bytes, n)) return 2;
    }
    return 0;
}
"""


def test_the_fuzz_targets_checksums_are_those_of_the_library(tmp_path):
    _need("gcc")
    main = tmp_path / "main.c"
    main.write_text(CHECKSUMS)
    quick = LIBRARY / "fuzz" / "quick_crc.c"
    renamed = ("-Dtc_crc16=quick16", "-Dtc_crc32=quick32")
    _run("gcc", "-std=c11", *renamed, *INCLUDES, "-c", quick, "-o", tmp_path / "quick.o")
    plain = [LIBRARY / "src" / name for name in assure.QUICKER]
    _run("gcc", "-std=c11", *INCLUDES, main, tmp_path / "quick.o", *plain, "-o", tmp_path / "checksums")
    _run(tmp_path / "checksums")


@pytest.mark.slow
@pytest.mark.parametrize("target", assure.TARGETS)
def test_libfuzzer_finds_nothing_in_a_short_run(tmp_path, target):
    _need("clang-19")
    program = assure.fuzz_target(target, tmp_path)
    _run(program, f"-max_len={assure.LONGEST_INPUT}", "-runs=50000", "-seed=1")
