"""The controller as a CMake package: installed and found, or added as a subdirectory, with nothing else on the way."""

import json
import re
import shutil
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
LIBRARY = ROOT / "firmware_bridge" / "controller"
TOOLS = Path(sys.executable).parent
"""cmake and ninja are Python packages of the dev extra."""

FOUND = "find_package(goshawk_controller 0.1 CONFIG REQUIRED)"
ADDED = f'add_subdirectory("{LIBRARY.as_posix()}" goshawk)'
CONSUMER = """\
cmake_minimum_required(VERSION 3.21)
project(consumer LANGUAGES C CXX)
%s
add_executable(consumer main.c other.cpp)
target_link_libraries(consumer PRIVATE goshawk::controller)
"""
MAIN = """\
#include "goshawk_controller/goshawk_controller.h"
#include "goshawk_controller/link.h"
#include <stdio.h>

size_t size_in_cpp(void);
static tc_controller controller;
static tc_link link;

int main(void)
{
    static const tc_link_config config = {.system_id = 1, .component_id = 1};
    tc_estimate estimate = {0};
    tc_output output;
    tc_init(&controller);
    tc_link_init(&link, &controller, &config, 1u);
    (void)tc_tick(&controller, 2500u, &estimate, &output);
    printf("%d %d %d\\n", TC_MAX_SEGMENTS, TC_VERSION, sizeof controller == size_in_cpp());
    return output.rotor_speed_rad_s[0] > 0.0f;
}
"""
OTHER = """\
#include "goshawk_controller/goshawk_controller.h"

extern "C" size_t size_in_cpp();
size_t size_in_cpp() { return sizeof(tc_controller); }
"""


def _run(*command: object, expect: int = 0) -> str:
    done = subprocess.run([str(word) for word in command], capture_output=True, text=True, timeout=300, check=False)
    assert (done.returncode == 0) == (expect == 0), done.stdout + done.stderr
    return done.stdout + done.stderr


def _configure(source: Path, build: Path, *options: str, expect: int = 0) -> str:
    ninja = f"-DCMAKE_MAKE_PROGRAM={TOOLS / 'ninja'}"
    return _run(TOOLS / "cmake", "-S", source, "-B", build, "-G", "Ninja", ninja, *options, expect=expect)


def _build(build: Path) -> None:
    _run(TOOLS / "cmake", "--build", build)


@pytest.fixture(autouse=True)
def _compiler() -> None:
    if shutil.which("gcc") is None:
        pytest.skip("gcc is not installed")


@pytest.fixture(scope="module")
def prefix(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Where the library was installed, with 48 segments a slot."""
    folder = tmp_path_factory.mktemp("package")
    _configure(LIBRARY, folder / "build", f"-DCMAKE_INSTALL_PREFIX={folder / 'prefix'}", "-DTC_MAX_SEGMENTS=48")
    _build(folder / "build")
    _run(TOOLS / "cmake", "--install", folder / "build")
    return folder / "prefix"


def _consumer(folder: Path, way: str) -> Path:
    source = folder / "source"
    source.mkdir()
    (source / "CMakeLists.txt").write_text(CONSUMER % way)
    (source / "main.c").write_text(MAIN)
    (source / "other.cpp").write_text(OTHER)
    return source


def _commands(build: Path, name: str) -> str:
    entries = json.loads((build / "compile_commands.json").read_text())
    return next(entry["command"] for entry in entries if entry["file"].endswith(name))


def _version() -> tuple[int, int, int]:
    header = (LIBRARY / "include" / "goshawk_controller" / "version.h").read_text()
    major, minor, patch = (
        int(re.findall(rf"#define TC_VERSION_{part} (\d+)", header)[0]) for part in ("MAJOR", "MINOR", "PATCH")
    )
    return major, minor, patch


def test_the_version_header_and_the_python_package_state_the_same_version():
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    assert ".".join(map(str, _version())) == project["version"]


@pytest.mark.parametrize("build_type", ["Release", "Debug"])
def test_an_installed_library_is_found_and_linked(tmp_path, prefix, build_type):
    build = tmp_path / "build"
    options = (f"-DCMAKE_PREFIX_PATH={prefix}", f"-DCMAKE_BUILD_TYPE={build_type}")
    _configure(_consumer(tmp_path, FOUND), build, *options)
    _build(build)
    major, minor, patch = _version()
    assert _run(build / "consumer").split() == ["48", str(major * 1000000 + minor * 1000 + patch), "1"]


@pytest.mark.parametrize("build_type", ["Release", "Debug"])
def test_the_source_folder_is_added_and_linked(tmp_path, build_type):
    build = tmp_path / "build"
    _configure(_consumer(tmp_path, ADDED), build, "-DTC_MAX_SEGMENTS=16", f"-DCMAKE_BUILD_TYPE={build_type}")
    _build(build)
    assert _run(build / "consumer").split()[::2] == ["16", "1"]


@pytest.mark.parametrize("way", [FOUND, ADDED])
def test_linking_the_library_leaves_the_integrators_own_flags_alone(tmp_path, prefix, way):
    build = tmp_path / "build"
    options = (f"-DCMAKE_PREFIX_PATH={prefix}", "-DCMAKE_EXPORT_COMPILE_COMMANDS=ON", "-DTC_MAX_SEGMENTS=48")
    _configure(_consumer(tmp_path, way), build, *options)
    words = _commands(build, "source/main.c").split()
    flags = [word for word in words if word.startswith("-") and word not in ("-o", "-c")]
    assert {flag for flag in flags if not flag.startswith(("-I", "-isystem"))} <= {
        "-DTC_MAX_SEGMENTS=48",
        "-std=gnu11",
        "-std=gnu17",
    }
    assert not any("dialect" in word for word in words)


def test_the_library_itself_is_always_compiled_with_the_flags_that_keep_its_bits(tmp_path):
    build = tmp_path / "build"
    options = ("-DCMAKE_EXPORT_COMPILE_COMMANDS=ON", "-DCMAKE_C_FLAGS=-ffp-contract=fast", "-DCMAKE_BUILD_TYPE=Release")
    _configure(_consumer(tmp_path, ADDED), build, *options)
    command = _commands(build, "src/control/mixer.c")
    assert command.rindex("-ffp-contract=off") > command.rindex("-ffp-contract=fast")
    assert command.rindex("-O2") > command.rindex("-O3")
    assert "-fno-math-errno" in command
    assert "-Werror" not in command  # a newer compiler's new warning must not stop an integrator's build


def test_a_slot_size_that_cannot_be_is_refused_with_the_bounds(tmp_path):
    for value in ("0", "1025", "many"):
        message = _configure(LIBRARY, tmp_path / value, f"-DTC_MAX_SEGMENTS={value}", expect=1)
        assert "from 1 to 1024" in " ".join(message.split())
