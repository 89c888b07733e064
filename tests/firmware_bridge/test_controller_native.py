"""The C library as a flight-control developer meets it: builds alone, clean, and gives the same bits everywhere."""

import re
import shutil
import subprocess
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2] / "firmware_bridge" / "controller"
TEST = ROOT / "test" / "driver"
DIALECT = ROOT.parent / "dialect" / "generated"
INCLUDES = (f"-I{ROOT / 'include'}", "-isystem", DIALECT)
WARNINGS = ("-Wall", "-Wextra", "-Wconversion", "-Wdouble-promotion", "-Wshadow", "-Werror")
STRICT = ("-std=c11", *WARNINGS, "-ffp-contract=off", "-fno-math-errno")
TARGETS = {
    "M4F": ("-mcpu=cortex-m4 -mfpu=fpv4-sp-d16", "mps2-an386"),
    "M7": ("-mcpu=cortex-m7 -mfpu=fpv5-sp-d16", "mps2-an500"),
}
TICKS = 40_000
"""One whole round of the driver's script: take-off, trajectory, pause, slow motion, abort, landing."""
LONG = 100_000
"""For comparisons bit by bit."""


def _need(*tools: str) -> None:
    for tool in tools:
        if shutil.which(tool) is None:
            pytest.skip(f"{tool} is not installed")


def _run(*command: object) -> str:
    words = [str(word) for word in command]
    done = subprocess.run(words, capture_output=True, text=True, timeout=300)
    assert done.returncode == 0, f"{' '.join(words)}\n{done.stdout}{done.stderr}"
    return done.stdout or done.stderr  # QEMU's semihosting console is stderr when nobody watches


def _sources() -> list[Path]:
    return sorted((ROOT / "src").rglob("*.c"))


def _host(compiler: str, out: Path, *flags: str) -> Path:
    _run(compiler, *STRICT, *flags, *INCLUDES, *_sources(), TEST / "driver.c", TEST / "host_main.c", "-o", out, "-lm")
    return out


def _firmware(target: str, out: Path, *flags: str) -> tuple[Path, str]:
    cpu, machine = TARGETS[target]
    _run(
        "arm-none-eabi-gcc", *STRICT, *cpu.split(), "-mthumb", "-mfloat-abi=hard", "-nostartfiles",
        "--specs=nosys.specs", "-T", TEST / "target.ld", *flags, *INCLUDES,
        *_sources(), TEST / "driver.c", TEST / "target_main.c", "-o", out,
    )  # fmt: skip
    return out, machine


def _emulate(firmware: Path, machine: str) -> list[str]:
    return _run("qemu-system-arm", "-machine", machine, "-nographic", "-semihosting", "-kernel", firmware).split()


@pytest.fixture(scope="module")
def archive(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The library as its own build makes it for release."""
    _need("cmake", "gcc")
    folder = tmp_path_factory.mktemp("release")
    _run("cmake", "-S", ROOT, "-B", folder, "-DCMAKE_BUILD_TYPE=Release", "-DCMAKE_C_FLAGS=-fno-pie")
    _run("cmake", "--build", folder)
    return folder / "libgoshawk_controller.a"


def test_the_library_builds_alone(archive):
    assert archive.exists()


def test_no_two_sources_have_one_name():
    """Toolchains that collect all objects in one folder would lose one of them."""
    names = [source.name for source in _sources()]
    assert len(names) == len(set(names)) > 30


def test_headers_stand_alone_in_c_and_in_cpp(tmp_path):
    _need("gcc", "g++")
    for header in sorted((ROOT / "include" / "goshawk_controller").glob("*.h")):
        for compiler, language in (("gcc", "c"), ("g++", "c++")):
            _run(
                compiler,
                "-Wall",
                "-Wextra",
                "-Werror",
                f"-I{ROOT / 'include'}",
                "-fsyntax-only",
                "-x",
                language,
                header,
            )


def test_a_whole_mission_is_clean_under_sanitizers(sanitized, tmp_path):
    driver, sources = tmp_path / "driver", (TEST / "driver.c", TEST / "host_main.c")
    _run("gcc", *sanitized.flags, *INCLUDES, *sources, *sanitized.objects, "-o", driver, "-lm")
    crc, states = _run(driver, TICKS).split()
    assert int(states, 16) == 0b0110_1111_1111  # every state but stopping, emergency and fault
    assert int(crc, 16) != 0


def test_the_library_needs_no_heap_no_libm_and_no_globals(archive):
    _need("nm")
    allowed = {"memset", "memcpy", "memcmp", "strncmp", "memmove", "strlen", "sqrtf", "_GLOBAL_OFFSET_TABLE_"}
    wanted: set[str] = set()
    for line in _run("nm", archive).splitlines():
        words = line.split()
        if len(words) < 2:
            continue  # an empty line or a file's name
        kind, name = words[-2:]
        assert kind not in "dDbBC", f"{name} is a global variable"
        if kind == "U" and not name.startswith(("tc_", "link_", "__stack_chk")):
            wanted.add(name)
    assert wanted <= allowed


def test_no_source_uses_double_or_recursion_prone_constructs():
    for source in [*_sources(), *sorted((ROOT / "src").rglob("*.h"))]:
        code = source.read_text()
        for word in ("double ", "malloc", "free(", "goto ", "setjmp", "alloca"):
            assert word not in code, f"{source.name}: {word}"


def test_with_the_observer_off_the_flight_is_bit_for_bit_that_of_a_controller_without_one(archive, tmp_path):
    """What the last controller before the observer (parent of e885142f) said in this flight, until it is down."""

    def driver(name: str, *flags: str) -> Path:
        sources = (TEST / "driver.c", TEST / "host_main.c", archive)
        _run("gcc", *STRICT, "-O2", "-no-pie", *flags, *INCLUDES, *sources, "-o", tmp_path / name, "-lm")
        return tmp_path / name

    assert _run(driver("off", "-DADJUST=parameters.observer=0.0f;"), 29_000).split() == ["6d2efbae", "06ff"]
    assert _run(driver("on"), 29_000).split()[0] != "6d2efbae"


@pytest.mark.slow
def test_outputs_are_bit_identical_on_every_compiler_and_level(tmp_path):
    _need("gcc")
    compilers = [c for c in ("gcc", "clang", "clang-19") if shutil.which(c)]
    said = {
        (c, level): _run(_host(c, tmp_path / f"{c}{level}", level), LONG)
        for c in compilers
        for level in ("-O0", "-O2", "-O3")
    }
    assert len(set(said.values())) == 1, said


@pytest.mark.slow
@pytest.mark.parametrize(
    ("target", "level"),
    [
        ("M4F", ["-O2"]),
        ("M4F", ["-Os"]),
        ("M4F", ["-O3", "-flto", "-mtune=cortex-a5"]),
        ("M7", ["-O2"]),
    ],
)
def test_outputs_on_the_target_are_those_of_the_host(tmp_path, target, level):
    """-Os and that tuning multiply and add in one instruction."""
    _need("gcc", "arm-none-eabi-gcc", "qemu-system-arm")
    host = _run(_host("gcc", tmp_path / "host", "-O2"), LONG).split()
    crc, states, _stack, failed = _emulate(*_firmware(target, tmp_path / "firmware", *level, f"-DTICKS={LONG}"))
    assert int(failed, 16) == 0
    assert (int(crc, 16), int(states, 16)) == (int(host[0], 16), int(host[1], 16))


@pytest.mark.slow
def test_cppcheck_finds_nothing():
    _need("cppcheck")
    _run(
        "cppcheck", "--enable=warning,performance,portability", "--std=c11", "--error-exitcode=1", "--quiet",
        "--inline-suppr", f"-I{ROOT / 'include'}", ROOT / "src",
    )  # fmt: skip


def test_every_number_of_the_sources_has_a_type():
    """A macro has none, and no debugger shows it; what the preprocessor itself needs is in the public headers."""
    code = "".join(source.read_text() for source in [*_sources(), *(ROOT / "src").rglob("*.h")])
    assert re.findall(r"^#define \w+ \(?-?\d", code, re.MULTILINE) == []


def test_arbitrary_bytes_break_nothing(tmp_path):
    """A short run of the fuzz target with its own random bytes; docs/firmware/c_integration.md has long runs."""
    _need("gcc")
    flags = ("-O1", "-DSTANDALONE", "-DTC_MAX_SEGMENTS=8", "-fsanitize=undefined", "-fno-sanitize-recover=all")
    sources = [path for path in _sources() if "link" not in path.parts]
    out = tmp_path / "fuzz"
    _run("gcc", "-std=c11", *flags, *INCLUDES, *sources, ROOT / "fuzz" / "fuzz_controller.c", "-o", out, "-lm")
    assert _run(out, 5000).strip() == "5000 runs"
