"""The integration examples and the documentation's code: compiled, flown on a simulated body, and left hanging."""

import shutil
import signal
import subprocess
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import pytest

from firmware_bridge import connect
from firmware_bridge.link import Command
from flight import Trajectory, TrajectoryFile
from flight.trajectory import fingerprint, sealed

ROOT = Path(__file__).resolve().parents[2]
LIBRARY = ROOT / "firmware_bridge" / "controller"
EXAMPLES = ROOT / "examples" / "integration"
HARNESS = Path(__file__).parent / "integration"
BODY = EXAMPLES / "posix" / "simulated_body.c"
INCLUDES = (f"-I{LIBRARY / 'include'}", "-isystem", str(LIBRARY.parent / "dialect" / "generated"))
STRICT = ("-Wall", "-Wextra", "-Werror", "-Wdouble-promotion", "-Wshadow", "-ffp-contract=off", "-fno-math-errno")
SEGMENTS = "-DTC_MAX_SEGMENTS=32"
KEY = bytes(range(32))


def _run(*command: object, timeout_s: float = 300.0) -> str:
    words = [str(word) for word in command]
    done = subprocess.run(words, capture_output=True, text=True, timeout=timeout_s, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


@pytest.fixture(autouse=True)
def _compilers() -> None:
    for tool in ("gcc", "g++"):
        if shutil.which(tool) is None:
            pytest.skip(f"{tool} is not installed")


@pytest.fixture(scope="module")
def controller(tmp_path_factory: pytest.TempPathFactory) -> list[Path]:
    """The library's objects and those of the simulated body, 32 segments a slot."""
    folder = tmp_path_factory.mktemp("controller")
    objects = []
    for source in [*sorted((LIBRARY / "src").rglob("*.c")), BODY]:
        objects.append(folder / f"{source.stem}.o")
        _run("gcc", "-std=c11", "-O2", *STRICT, SEGMENTS, *INCLUDES, "-c", source, "-o", objects[-1])
    return objects


# Scenarios: a program that lists them without an argument, and runs the one that is named.

PX4 = EXAMPLES / "px4"
PX4_SCENARIOS = (
    "registers_its_mode_and_stays_silent_until_it_is_selected",
    "takes_over_in_flight_holds_and_publishes_what_px4_reads",
    "gives_back_when_the_pilot_selects_another_mode",
    "refuses_to_be_selected_outside_the_limits_of_taking_over",
    "idles_when_armed_on_the_ground",
    "lands_and_goes_on_asking_for_a_descent_until_px4_has_disarmed",
    "a_hang_keeps_the_collective_takes_the_torque_away_and_asks_for_land",
    "a_hang_of_everything_stops_the_motors",
    "rotors_that_stopped_for_good_are_not_started_by_px4_again",
    "unregisters_when_it_is_stopped",
    "a_new_mass_is_taken_from_the_parameters",
    "converts_resets_of_the_estimator",
    "marks_what_of_the_estimate_holds",
    "reads_rotor_speeds_from_the_escs_or_from_the_outputs",
)
CRAZYFLIE_SCENARIOS = (
    "the_pid_controller_flies_until_ours_is_asked_for",
    "the_stamp_is_kept_in_time_for_the_next_boot",
    "takes_off_and_lands_without_being_locked",
    "lands_when_the_supervisor_levels_out",
    "stops_when_the_supervisor_takes_the_setpoint_away",
    "a_hanging_stabilizer_task_loses_its_motors_within_60_ms",
    "a_busy_app_task_costs_a_tick_and_nothing_else",
    "an_app_task_that_never_gives_the_mutex_back_stops_the_motors_within_60_ms",
    "a_path_that_the_supervisor_would_take_for_a_tumble_is_not_begun",
    "that_path_would_have_been_stopped_by_the_supervisor",
)
FREERTOS_SCENARIOS = (
    "takes_off_hovers_and_lands",
    "a_hanging_control_task_loses_its_rotors_within_30_ms",
    "a_hang_on_the_ground_is_no_reason_to_refuse_the_next_flight",
    "parameters_that_cannot_fly_are_refused_with_the_reason",
)


@pytest.fixture(scope="module")
def px4(tmp_path_factory: pytest.TempPathFactory, controller: list[Path]) -> Path:
    program = tmp_path_factory.mktemp("px4") / "px4_module"
    module = PX4 / "src" / "modules" / "goshawk_control"
    defines = ('-DMODULE_NAME="goshawk_control"', SEGMENTS)
    language = ("-std=c++14", "-fno-exceptions", "-fno-rtti", "-O1")
    folders = (f"-I{PX4 / 'interface'}", f"-I{module}", f"-I{BODY.parent}", *INCLUDES)
    sources = [*sorted(module.glob("*.cpp")), HARNESS / "px4_module.cpp"]
    _run("g++", *language, *STRICT, *defines, *folders, *sources, *controller, "-o", program)
    return program


@pytest.fixture(scope="module")
def crazyflie(tmp_path_factory: pytest.TempPathFactory, controller: list[Path]) -> Path:
    folder = tmp_path_factory.mktemp("crazyflie")
    (folder / "goshawk_key.h").write_text("#define GOSHAWK_KEY {1, 2, 3}\n")
    example = EXAMPLES / "crazyflie"
    folders = (f"-I{folder}", f"-I{example / 'interface'}", f"-I{example / 'src'}", f"-I{BODY.parent}", *INCLUDES)
    source = HARNESS / "crazyflie_controller.c"
    program = folder / "crazyflie_controller"
    _run("gcc", "-std=gnu11", "-O1", *STRICT, SEGMENTS, *folders, source, *controller, "-lm", "-o", program)
    return program


@pytest.fixture(scope="module")
def freertos(tmp_path_factory: pytest.TempPathFactory, controller: list[Path]) -> Path:
    example = EXAMPLES / "freertos"
    folders = (f"-I{example / 'interface'}", f"-I{example}", f"-I{BODY.parent}", *INCLUDES)
    source = HARNESS / "freertos_tasks.c"
    program = tmp_path_factory.mktemp("freertos") / "freertos_tasks"
    _run("gcc", "-std=gnu11", "-O1", *STRICT, SEGMENTS, *folders, source, *controller, "-lm", "-o", program)
    return program


def test_every_scenario_of_the_compiled_examples_is_listed_here(px4, crazyflie, freertos):
    assert tuple(_run(px4).split()) == PX4_SCENARIOS
    assert tuple(_run(crazyflie).split()) == CRAZYFLIE_SCENARIOS
    assert tuple(_run(freertos).split()) == FREERTOS_SCENARIOS


@pytest.mark.parametrize("scenario", PX4_SCENARIOS)
def test_the_px4_module(px4, scenario):
    _run(px4, scenario, timeout_s=60.0)


@pytest.mark.parametrize("scenario", CRAZYFLIE_SCENARIOS)
def test_the_crazyflie_controller(crazyflie, scenario):
    _run(crazyflie, scenario, timeout_s=60.0)


@pytest.mark.parametrize("scenario", FREERTOS_SCENARIOS)
def test_the_freertos_tasks(freertos, scenario):
    _run(freertos, scenario, timeout_s=60.0)


def test_the_controller_compiles_where_the_build_puts_system_headers_before_every_source(tmp_path):
    """PX4's does: a static function of ours must not have the name of a POSIX one."""
    for source in sorted((LIBRARY / "src").rglob("*.c")):
        headers = ("-include", "unistd.h", "-include", "stdlib.h", "-include", "pthread.h", "-include", "time.h")
        _run("gcc", "-std=gnu11", *headers, *INCLUDES, "-fsyntax-only", source)


# The POSIX example: two real processes, a real link.


@pytest.fixture(scope="module")
def posix(tmp_path_factory: pytest.TempPathFactory, controller: list[Path]) -> Path:
    program = tmp_path_factory.mktemp("posix") / "goshawk_posix"
    sources = sorted(set((EXAMPLES / "posix").glob("*.c")) - {BODY})
    _run("gcc", "-std=c11", "-O2", *STRICT, SEGMENTS, *INCLUDES, *sources, *controller, "-lm", "-o", program)
    return program


@dataclass
class Posix:
    """The running example, and what it printed: wall-clock time and line."""

    process: subprocess.Popen[str]
    url: str
    controller_pid: int
    lines: list[tuple[float, str]] = field(default_factory=list)

    def wait_for(self, what: Callable[[str], bool], within_s: float) -> tuple[float, str]:
        """The first line from now on that is what is looked for."""
        seen, end_s = len(self.lines), time.monotonic() + within_s
        while time.monotonic() < end_s:
            for line in self.lines[seen:]:
                seen += 1
                if what(line[1]):
                    return line
            time.sleep(0.005)
        raise AssertionError(f"not within {within_s} s; last lines: {self.lines[-5:]}")

    def kill(self, number: signal.Signals) -> float:
        subprocess.run(["kill", f"-{number.name[3:]}", str(self.controller_pid)], check=True)
        return time.monotonic()


def _body(line: str) -> tuple[float, float]:
    """Height and mean rotor speed of a printed body; (-1, -1) for another line."""
    words = line.split()
    return (float(words[2]), float(words[4])) if words[0] == "body" else (-1.0, -1.0)


@contextmanager
def _running(program: Path, folder: Path) -> Iterator[Posix]:
    key = folder / "link.key"
    key.write_text(KEY.hex())
    process = subprocess.Popen([str(program), "0", str(key), "--print"], stdout=subprocess.PIPE, text=True)
    assert process.stdout is not None
    output = process.stdout
    url = output.readline().split()[1]
    run = Posix(process, url, int(output.readline().split()[2]))
    reader = threading.Thread(target=lambda: run.lines.extend((time.monotonic(), line) for line in output), daemon=True)
    reader.start()
    try:
        yield run
    finally:
        process.kill()
        process.wait()
        if Path(f"/proc/{run.controller_pid}").exists():
            run.kill(signal.SIGKILL)
        reader.join()


def _plan() -> TrajectoryFile:
    """Out and back by half a metre at 1 m, at rest at both ends."""
    pieces = np.zeros((2, 4, 8))
    for i, (start, step) in enumerate([(0.0, 0.5), (0.5, -0.5)]):
        pieces[i, 0, 0], pieces[i, 2, 0] = start, 1.0
        pieces[i, 0, 4:] = step * np.array([35.0, -84.0, 70.0, -20.0]) / 1.5 ** np.arange(4, 8)
    path = Trajectory(np.full(2, 1.5), pieces)
    item = TrajectoryFile(
        trajectory=path,
        name="out and back",
        map_hash="ab" * 32,
        vehicle_hash="cd" * 32,
        waypoints_world_m=np.zeros((2, 3)),
        check={"passed": True, "trajectory_hash": fingerprint(path)},
    )
    return sealed(item)


def test_the_posix_example_flies_a_plan_over_the_link(posix, tmp_path):
    with _running(posix, tmp_path) as run, connect(run.url, key=KEY) as link:
        link.take_control()
        file = _plan()
        link.upload(file)
        log = link.fly(file)
        position = log.vector("position_world_m")
        assert position[:, 0].max() == pytest.approx(0.5, abs=0.05)
        assert position[:, 2].max() == pytest.approx(1.0, abs=0.15)
        height_m, speed_rad_s = _body(run.wait_for(lambda line: line.startswith("body"), 1.0)[1])
        assert height_m <= 0.0
        assert speed_rad_s < 100.0
        assert not any("watchdog" in line for _, line in run.lines)


def _hover(run: Posix) -> None:
    with connect(run.url, key=KEY) as link:
        link.take_control()
        link.command(Command.ARM)
        time.sleep(0.2)
        link.command(Command.TAKE_OFF, 1.0)
        run.wait_for(lambda line: _body(line)[0] > 0.95, 10.0)


def test_a_posix_controller_that_is_stopped_loses_its_rotors_within_a_quarter_of_a_second(posix, tmp_path):
    """Stated: 100 ms of silence and 1 ms of its own period; the rest is this machine's load and the rotors' lag."""
    with _running(posix, tmp_path) as run:
        _hover(run)
        stopped_s = run.kill(signal.SIGSTOP)
        told_s, _ = run.wait_for(lambda line: line.startswith("watchdog"), 2.0)
        assert 0.08 < told_s - stopped_s < 0.25
        run.wait_for(lambda line: 0.0 <= _body(line)[1] < 10.0, 1.0)
        run.wait_for(lambda line: -0.5 < _body(line)[0] <= 0.0, 2.0)  # it lies on the floor
        run.kill(signal.SIGCONT)  # and comes back in the middle of its flight: the rotors stay off
        time.sleep(0.5)
        assert max(_body(line)[1] for _, line in run.lines[-20:]) < 10.0


def test_a_posix_controller_that_dies_loses_its_rotors_and_ends_the_program(posix, tmp_path):
    with _running(posix, tmp_path) as run:
        _hover(run)
        run.kill(signal.SIGKILL)
        run.wait_for(lambda line: line.startswith("watchdog"), 2.0)
        assert run.process.wait(timeout=5.0) == 0


# The documentation.

PAGE = (ROOT / "docs" / "firmware" / "c_integration.md").read_text()
THREE_FUNCTIONS = """\
#include <stdlib.h>
#include "goshawk_controller/link.h"
static tc_link_config link_config;
static uint8_t bytes[TC_FRAME_MAX], frame[TC_FRAME_MAX];
static size_t count;
static unsigned sent;
static uint64_t now_us(void) { static uint64_t t = 1; return t += 2500; }
static const float level[4] = {1.0f, 0.0f, 0.0f, 0.0f}, up[3] = {0.0f, 0.0f, 9.8f}, at_rest[3];
static struct {
    const float *position, *velocity, *q, *rate, *acceleration, *shift;
    uint64_t pose_time_us, imu_time_us;
    float position_std, velocity_std, voltage;
    uint8_t resets;
    int has_position;
} mine = {at_rest, at_rest, level, at_rest, up, at_rest, 0, 0, 0.05f, 0.05f, 15.0f, 0, 1};
static void write_rotor_speeds(const float speed[4]) { if (!(speed[0] >= 0.0f)) abort(); }
static void send(const uint8_t *f, size_t n) { sent += f[0] == 0xFDu && n > 11u; }
static void halt(const char *why) { (void)why; abort(); }
void setup(void);
void control_task(void);
void link_task(void);
EXAMPLE
int main(void)
{
    link_config.system_id = link_config.component_id = 1;
    link_config.bytes_per_s = 100000;
    setup();
    for (int i = 0; i < 1000; i++) {
        mine.pose_time_us = mine.imu_time_us = now_us();
        control_task();
        link_task();
    }
    return sent > 100 && tc_arming_check(&controller) == TC_OK ? 0 : 1;
}
"""


def test_the_three_functions_of_the_documentation_compile_and_make_the_vehicle_ready_to_arm(tmp_path, controller):
    assert "{literalinclude} ../../examples/integration/three_functions.c\n" in PAGE
    program = tmp_path / "example.c"
    program.write_text(THREE_FUNCTIONS.replace("EXAMPLE", (EXAMPLES / "three_functions.c").read_text()))
    _run("gcc", "-std=c11", *STRICT, SEGMENTS, *INCLUDES, program, *controller, "-lm", "-o", tmp_path / "example")
    _run(tmp_path / "example")


def test_interface_headers_are_used_by_the_tests_only():
    """Each build file of an example must take the real headers."""
    for build in [*EXAMPLES.rglob("CMakeLists.txt"), *EXAMPLES.rglob("Makefile"), *EXAMPLES.rglob("Kbuild")]:
        assert "interface" not in build.read_text(), build
