"""How the embedded C is examined: coverage, mutation score, static analysis, cost on a Cortex-M4F, fuzzing.

    python tools/assure.py coverage           branches of codec, link, state machine, failsafes; MC/DC with clang-19
    python tools/assure.py mutate [FILES]     mutation score of state machine, failsafes, shaping and mixer limits
    python tools/assure.py misra              strict warnings of gcc and clang; cppcheck's MISRA rules but deviations
    python tools/assure.py size               stack of every entry point, memory and flash on a Cortex-M4F
    python tools/assure.py cost [--markdown]  worst instructions of every public function; also into the documentation
    python tools/assure.py fuzz [HOURS]       libFuzzer with address and undefined-behaviour sanitizers, 8 hours

Each needs its tools (clang-19 with libclang-rt-19-dev and llvm-19; cppcheck; gcc-arm-none-eabi, qemu-system-arm) and
reports which is missing. The slow tests run all of them, the last for a minute. See docs/firmware/assurance.md.
"""

import importlib.util
import json
import os
import re
import shutil
import subprocess
import sys
import tempfile
from collections import Counter
from dataclasses import dataclass
from pathlib import Path
from types import ModuleType

sys.path.insert(0, str(Path(__file__).parent))
import mutation

ROOT = Path(__file__).resolve().parents[1]
LIBRARY = ROOT / "firmware_bridge" / "controller"
DIALECT = LIBRARY.parent / "dialect" / "generated"
DEVIATIONS = ROOT / "docs" / "firmware" / "misra.md"
INCLUDES = (f"-I{LIBRARY / 'include'}", "-isystem", str(DIALECT))
MAP_READER = ROOT / "mapping" / "localization" / "reader" / "goshawk_localization_map.c"
"""Flies as well, on a vehicle that localizes itself: held to the same style."""
TESTS = LIBRARY / "test"
CASES = tuple(sorted((TESTS / "cases").rglob("*.c")))
WHOLE = (
    "crc32.c", "failsafe.c", "landing.c", "mission.c", "requests.c", "supervisor.c", "transitions.c",
    *sorted(path.name for path in (LIBRARY / "src" / "link").rglob("*.c")),
)  # fmt: skip
"""Codec, link endpoint, state machine and failsafes: every branch of these files is taken."""
GROUPS = ("supervisor", "landing", "ground", "emergency", "mixer", "shaping", "tables", "safety", "reaction", "mission")
"""The case files that run against mutants; the link's are left out, as they fly no vehicle."""
STRICT = (
    "-Wall", "-Wextra", "-Wpedantic", "-Wconversion", "-Wsign-conversion", "-Wdouble-promotion", "-Wshadow",
    "-Wcast-align", "-Wcast-qual", "-Wstrict-prototypes", "-Wmissing-prototypes", "-Wundef",
    "-Wfloat-equal", "-Wwrite-strings", "-Wvla", "-Wnull-dereference", "-Wformat=2", "-Werror",
)  # fmt: skip
MIXER_LIMITS = frozenset({
    "rotor_margins", "collective_range", "change_demand", "cut_tilt", "part_of", "desaturate", "keep_within_limits",
    "all_between", "clip",
})  # fmt: skip
MUTATED: dict[str, frozenset[str] | None] = {
    "mission.c": None, "transitions.c": None, "failsafe.c": None, "landing.c": None, "supervisor.c": None,
    "shaping.c": None, "mixer.c": MIXER_LIMITS,
}  # fmt: skip
"""Sources whose faults the case files must notice, all of them or these functions."""
LEAST_SCORE = 0.9
ARM = ("-mcpu=cortex-m4", "-mthumb", "-mfloat-abi=hard", "-mfpu=fpv4-sp-d16", "-ffp-contract=off", "-fno-math-errno")


class MissingToolError(RuntimeError):
    """A program that this machine does not have."""


def sources() -> list[Path]:
    return sorted((LIBRARY / "src").rglob("*.c"))


def source(name: str) -> Path:
    return next(path for path in sources() if path.name == name)


def need(*tools: str) -> None:
    """
    Raises:
        MissingToolError: one of them is not installed.
    """
    missing = [tool for tool in tools if shutil.which(tool) is None]
    if missing:
        raise MissingToolError(f"not installed: {', '.join(missing)}")


def run(*command: object, **options: object) -> str:
    """Run a program to its end; what it printed. Its failure is ours, with its output."""
    words = [str(word) for word in command]
    done = subprocess.run(words, capture_output=True, text=True, check=False, **options)  # pyright: ignore[reportArgumentType, reportCallIssue]
    if done.returncode:
        raise SystemExit(f"{' '.join(words)}\n{done.stdout}{done.stderr}")
    return done.stdout


# -- coverage ----------------------------------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class FileCoverage:
    branches: int
    taken: int
    conditions: int
    """Of decisions with several conditions."""
    independent: int
    """Of those, shown to decide by themselves (MC/DC)."""
    open: tuple[str, ...]
    """Branches never taken, as `line:column true` or `false`."""


def coverage(folder: Path) -> dict[str, FileCoverage]:
    """What the case files, a scripted mission and some fuzzing inputs take of every source, by file name."""
    need("clang-19", "llvm-cov-19", "llvm-profdata-19")
    instrument = ("-fprofile-instr-generate", "-fcoverage-mapping", "-fcoverage-mcdc")
    fuzz, binaries = LIBRARY / "fuzz", []
    for name, files, flags, arguments in (
        ("cases", [*CASES], ["-DTC_MAX_SEGMENTS=32"], []),
        ("mission", [TESTS / "driver" / "driver.c", TESTS / "driver" / "host_main.c"], [], [60_000]),
        ("link", [fuzz / "fuzz_link.c", fuzz / "fuzz_main.c"], ["-DTC_MAX_SEGMENTS=32"], [1, 3000]),
        ("controller", [fuzz / "fuzz_controller.c"], ["-DSTANDALONE", "-DTC_MAX_SEGMENTS=8"], [3000]),
    ):
        program = folder / name
        run("clang-19", "-std=c11", "-O0", *instrument, "-fno-math-errno", *flags, INCLUDES[0], f"-I{DIALECT}",
            *files, *sources(), "-lm", "-o", program)  # fmt: skip
        run(program, *arguments, env={**os.environ, "LLVM_PROFILE_FILE": f"{program}.profraw"})
        run("llvm-profdata-19", "merge", f"{program}.profraw", "-o", f"{program}.profdata")
        binaries.append(program)
    found = [json.loads(run("llvm-cov-19", "export", b, "-instr-profile", f"{b}.profdata")) for b in binaries]
    return _merge([file for export in found for file in export["data"][0]["files"]])


def _merge(exports: list[dict]) -> dict[str, FileCoverage]:
    """One entry per source: a branch counts as taken when any program, in any inlined copy, took it."""
    branches: dict[str, Counter[tuple[int, int, bool]]] = {}
    decisions: dict[str, dict[tuple[int, int], list[bool]]] = {}
    for file in exports:
        name = Path(file["filename"]).name
        if not any(folder in Path(file["filename"]).parents for folder in (LIBRARY / "src", DIALECT)):
            continue
        counts = branches.setdefault(name, Counter())
        for line, column, _, _, true, false, *_ in file["branches"]:
            counts[line, column, True] += true
            counts[line, column, False] += false
        for record in file.get("mcdc_records", []):
            shown = next(item for item in record if isinstance(item, list))
            known = decisions.setdefault(name, {}).setdefault((record[0], record[1]), [False] * len(shown))
            decisions[name][record[0], record[1]] = [a or b for a, b in zip(known, shown, strict=True)]
    return {name: _file(branches[name], decisions.get(name, {})) for name in sorted(branches)}


def _file(counts: Counter[tuple[int, int, bool]], decisions: dict[tuple[int, int], list[bool]]) -> FileCoverage:
    never = sorted(key for key, n in counts.items() if n == 0)
    shown = [condition for conditions in decisions.values() for condition in conditions]
    said = tuple(f"{line}:{column} {str(way).lower()}" for line, column, way in never)
    return FileCoverage(len(counts), len(counts) - len(never), len(shown), sum(shown), said)


def print_coverage() -> bool:
    with tempfile.TemporaryDirectory() as folder:
        found = coverage(Path(folder))
    print(f"{'':22}{'branches':>10}{'taken':>8}{'MC/DC':>12}")
    for name, file in found.items():
        mark = "all" if not file.open else f"{100.0 * file.taken / max(file.branches, 1):.1f} %"
        print(f"{name:22}{file.branches:10}{mark:>8}{file.independent:7} of {file.conditions}")
        if name in WHOLE:
            for place in file.open:
                print(f"    never taken: {name}:{place}")
    return all(not found[name].open for name in WHOLE)


# -- static analysis ---------------------------------------------------------------------------------------------------


def deviations() -> list[str]:
    """The rules that the written list names, as cppcheck calls them."""
    return [f"misra-c2012-{rule}" for rule in re.findall(r"^(\d+\.\d+) \|", DEVIATIONS.read_text(), re.MULTILINE)]


def warnings(folder: Path) -> list[str]:
    """Warnings of gcc and clang under all strict options."""
    found = []
    for compiler in ("gcc", "clang"):
        if shutil.which(compiler) is None:
            continue
        for source in (*sources(), MAP_READER):
            command = [compiler, "-std=c11", "-O2", *STRICT, "-fno-math-errno", *INCLUDES, "-c", str(source)]
            done = subprocess.run([*command, "-o", str(folder / "x.o")], capture_output=True, text=True, check=False)
            found += [line for line in done.stderr.splitlines() if "error:" in line]
    return found


def misra(*, all_rules: bool = False) -> list[str]:
    """cppcheck's findings, deviations left out unless `all_rules`."""
    need("cppcheck")
    suppress = [] if all_rules else [f"--suppress={rule}" for rule in deviations()]
    with tempfile.TemporaryDirectory() as folder:  # else it writes beside the sources
        done = subprocess.run(
            ["cppcheck", "--addon=misra", "--enable=warning,style,performance,portability", "--std=c11", "--quiet",
             "--platform=unix32", "--inline-suppr", "--template={id} {file}:{line} {message}", *suppress,
             "--suppress=missingIncludeSystem", "--suppress=*:*goshawk_dialect.h",
             "--suppress=badBitmaskCheck", f"--cppcheck-build-dir={folder}",
             f"-I{LIBRARY / 'include'}", f"-I{DIALECT}", *map(str, [*sources(), MAP_READER])],
            capture_output=True, text=True, check=False,
        )  # fmt: skip
    return [line for line in done.stderr.splitlines() if line.strip()]


def print_misra() -> bool:
    with tempfile.TemporaryDirectory() as folder:
        said = warnings(Path(folder))
    found = misra()
    for line in (*said, *found):
        print(line)
    print(f"{len(said)} warnings of the compilers, {len(found)} findings of cppcheck outside the deviations")
    return not said and not found


# -- stack, memory, flash ----------------------------------------------------------------------------------------------

SIZES = """\
#include "goshawk_controller/link.h"
char controller_ram[sizeof(tc_controller) - 2u * sizeof(tc_trajectory)];
char link_ram[sizeof(tc_link)];
"""


@dataclass(frozen=True, slots=True)
class Size:
    stack: dict[str, tuple[int, list[str]]]
    """Of every function that others may call: bytes, and the calls that need them."""
    ram: dict[str, int]
    """Of what the caller owns, trajectory slots left out."""


def _module(path: Path) -> ModuleType:
    spec = importlib.util.spec_from_file_location(path.stem, path)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def size(folder: Path, level: str = "-O2") -> Size:
    """Compile for a Cortex-M4F, file by file, and measure."""
    need("arm-none-eabi-gcc", "arm-none-eabi-nm")
    for source in sources():
        out = folder / f"{source.stem}.o"
        graph = ("-fcallgraph-info=su", "-dumpdir", f"{folder}/")
        run("arm-none-eabi-gcc", "-std=c11", *ARM, level, *graph, *INCLUDES, "-c", source, "-o", out)
    (folder / "sizes.c").write_text(SIZES)
    run("arm-none-eabi-gcc", *ARM, *INCLUDES, "-fcommon", "-c", folder / "sizes.c", "-o", folder / "sizes.o")
    listing = [line.split() for line in run("arm-none-eabi-nm", "-S", folder / "sizes.o").splitlines()]
    ram = {row[3].removesuffix("_ram"): int(row[1], 16) for row in listing if row[-1].endswith("_ram")}
    calls = _module(TESTS / "cost" / "stack_usage.py").CallGraph(folder)
    entries = sorted(name for name in calls.own if name.startswith("tc_"))
    return Size({name: calls.deepest(name) for name in entries}, ram)


def vehicle_library(folder: Path) -> Path:
    """The library as the documentation builds it for a Cortex-M4F: what is flown, counted and weighed."""
    need("cmake", "arm-none-eabi-gcc")
    run("cmake", "-S", LIBRARY, "-B", folder, "-DCMAKE_TOOLCHAIN_FILE=cmake/cortex-m4f.cmake")
    run("cmake", "--build", folder)
    return folder / "libgoshawk_controller.a"


def flash(folder: Path, library: Path) -> dict[str, int]:
    """Bytes of the smallest program that integrates the library, what it takes of the C library included."""
    need("arm-none-eabi-gcc", "arm-none-eabi-size")
    taken = {}
    for name, flags in (("controller", ["-DWITHOUT_LINK"]), ("controller and link", [])):
        program = folder / f"{name}.elf"
        run("arm-none-eabi-gcc", "-std=c11", *ARM, "-Os", *flags, *INCLUDES, TESTS / "cost" / "image.c", library,
            "-nostartfiles", "--specs=nosys.specs", "-Wl,--gc-sections,-e,reset", "-o", program)  # fmt: skip
        taken[name] = int(run("arm-none-eabi-size", program).splitlines()[1].split()[0])
    return taken


STACK_BAR, MEMORY_BAR, FLASH_BAR, TICK_BAR = 1024, 4608, 52 * 1024, 7500
"""Bytes of the deepest call, of what the caller owns besides trajectory slots, of flash with the link; instructions of
a tick in any situation."""


def print_size() -> bool:
    with tempfile.TemporaryDirectory() as folder:
        found = size(Path(folder))
        taken = flash(Path(folder), vehicle_library(Path(folder) / "library"))
    for name, (deepest, path) in sorted(found.stack.items(), key=lambda item: -item[1][0])[:12]:
        print(f"stack {deepest:5} B  {name}: {' > '.join(path[1:])}")
    for name in ("controller", "link"):
        print(f"{name}: {found.ram[name]} B of memory besides trajectory slots")
    for name, count in taken.items():
        print(f"{name}: {count} B of flash")
    deepest = max(needed for needed, _ in found.stack.values())
    return deepest <= STACK_BAR and sum(found.ram.values()) <= MEMORY_BAR and taken["controller and link"] <= FLASH_BAR


# -- worst instructions ------------------------------------------------------------------------------------------------

COST_PAGE = ROOT / "docs" / "firmware" / "cost.md"
COST_MARK = "<!-- written by tools/assure.py cost --markdown -->"
COST_SHOWN = 300
"""Instructions; functions that take fewer have no row on the page."""


def cost(folder: Path, library: Path) -> dict[str, int]:
    """Worst instructions of every public function, by name and situation: test/cost/worst_case.c, on QEMU.

    An emulator counts instructions; it does not model the cycles of a board's memory and pipeline.
    """
    need("arm-none-eabi-gcc", "qemu-system-arm")
    program = folder / "worst_case.elf"
    files = [TESTS / name for name in ("cost/worst_case.c", "cost/worst_case_link.c", "driver/target_main.c")]
    run("arm-none-eabi-gcc", "-std=c11", *ARM, "-O2", "-DTICKS=0", *INCLUDES, *files, library, "-nostartfiles",
        "--specs=nosys.specs", "-Wl,--gc-sections", "-T", TESTS / "driver" / "target.ld", "-o", program)  # fmt: skip
    done = subprocess.run(
        ["qemu-system-arm", "-machine", "mps2-an386", "-icount", "shift=6,sleep=off", "-nographic", "-semihosting",
         "-kernel", str(program)], capture_output=True, text=True, check=True, timeout=300,
    )  # fmt: skip
    lines = (done.stdout or done.stderr).splitlines()  # the console is stderr when there is no terminal
    return {name: int(count) for count, _, name in (line.partition(" ") for line in lines) if name.startswith("tc_")}


def cost_table(counts: dict[str, int]) -> str:
    """Per function, and per state of a tick, the situation that takes most; those that take little are left out."""
    worst: dict[str, str] = {}
    for name in counts:
        what = _function_or_state(name)
        worst[what] = max(worst.get(what, name), name, key=counts.__getitem__)
    rows = [
        f"`{what}` | {counts[name]:,} | {name.removeprefix(what).lstrip(':, ')}".rstrip()
        for what, name in sorted(worst.items())
        if counts[name] >= COST_SHOWN
    ]
    return "\n".join(("function | worst | situation", "---|---|---", *rows))


def _function_or_state(name: str) -> str:
    """`tc_do: arm` is `tc_do`; `tc_tick: hold, all features` is `tc_tick: hold`."""
    function, _, situation = name.partition(": ")
    return f"{function}: {situation.partition(',')[0]}" if function == "tc_tick" else function


def print_cost(*, markdown: bool = False) -> bool:
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        counts = cost(folder, vehicle_library(folder / "library"))
    for function, count in sorted(counts.items()):
        print(f"{count:8}  {function}")
    if markdown:
        head, _, _ = COST_PAGE.read_text().partition(COST_MARK)
        COST_PAGE.write_text(f"{head}{COST_MARK}\n\n{cost_table(counts)}\n")
    return worst_tick(counts) <= TICK_BAR


def worst_tick(counts: dict[str, int]) -> int:
    return max(count for name, count in counts.items() if name.startswith("tc_tick"))


# -- mutation score ----------------------------------------------------------------------------------------------------


def mutate(files: list[str], every: int = 1) -> list[mutation.Score]:
    """Scores of these sources, all of MUTATED without a name; of every so manieth mutant."""
    need("clang-19", "gcc")
    unknown = sorted(set(files) - set(MUTATED))
    if unknown:
        raise SystemExit(f"no mutants are made of {', '.join(unknown)}; choose from {', '.join(MUTATED)}")
    return [
        mutation.score(source(name), MUTATED[name], CASES, every=every, arguments=GROUPS) for name in files or MUTATED
    ]


def print_mutate(files: list[str]) -> bool:
    scores = mutate(files)
    for found in scores:
        for mutant in found.survived:
            print(f"{mutant.file}:{mutant.line}  {mutant.key}")
    print(f"{'':16}{'mutants':>8}{'killed':>8}{'score':>8}   equivalent")
    for found in scores:
        tried = found.killed + len(found.survived)
        print(f"{found.file:16}{tried:8}{found.killed:8}{100 * found.share:7.1f} %{found.equivalent:11}")
    return all(found.share >= LEAST_SCORE for found in scores)


# -- fuzzing -----------------------------------------------------------------------------------------------------------

TARGETS = ("link", "controller")
"""Link with all behind it; state machine and control law alone."""
FUZZ = (
    "-fsanitize=fuzzer,address,undefined", "-fsanitize-trap=undefined",
    "-fno-sanitize-coverage=trace-cmp", f"-fsanitize-coverage-ignorelist={LIBRARY / 'fuzz' / 'not_counted.txt'}",
    f"-fsanitize-ignorelist={LIBRARY / 'fuzz' / 'not_sanitized.txt'}",
)  # fmt: skip
"""Both sanitizers; undefined behaviour ends in a trap rather than in a call that describes it, and comparisons are not
traced, as the targets build good frames themselves: that makes an execution several times as fast."""
QUICKER = ("crc32.c", "crc16.c")
"""Sources that fuzz/quick_crc.c replaces: the same values, several times as fast."""
LONGEST_INPUT = 64
"""Bytes: some 25 steps, enough for a whole flight."""


def fuzz_target(name: str, folder: Path) -> Path:
    """Build a libFuzzer program.

    Raises:
        MissingToolError: no clang with libFuzzer here.
    """
    need("clang-19")
    files = [LIBRARY / "fuzz" / "quick_crc.c", *(file for file in sources() if file.name not in QUICKER)]
    run("clang-19", "-std=c11", "-g", "-O2", *FUZZ, "-ffp-contract=off", "-fno-math-errno", "-DTC_MAX_SEGMENTS=8",
        *INCLUDES, LIBRARY / "fuzz" / f"fuzz_{name}.c", *files, "-lm", "-o", folder / f"fuzz_{name}")  # fmt: skip
    return folder / f"fuzz_{name}"


def link_flight() -> bytes:
    """An input of the link target: control, plan, arming, take-off, the path."""
    control, plan, tick, wait = (0, 0, 7, 9, 0, 0, 0, 0, 0, 1), (5, 0, 0), (11, 0), (11, 13)
    arm, take_off, start = (8, 0), (8, 2), (8, 3)
    climb = 5 * wait + control + 5 * wait
    return bytes((*control, *plan, *tick, *arm, *tick, *take_off, *climb, *start, *(4 * wait)))


def fuzz(hours: float) -> bool:
    """Both targets, half of the time each; inputs that lead somewhere stay in build/fuzz, findings too."""
    folder = ROOT / "build" / "fuzz"
    folder.mkdir(parents=True, exist_ok=True)
    for name in TARGETS:
        corpus = folder / f"corpus_{name}"
        corpus.mkdir(exist_ok=True)
        if name == "link":
            (corpus / "flight").write_bytes(link_flight())
        limit = f"-max_total_time={max(1, round(1800.0 * hours))}"
        flags = (f"-max_len={LONGEST_INPUT}", "-print_final_stats=1", "-detect_leaks=0", f"-artifact_prefix={folder}/")
        if subprocess.run([str(fuzz_target(name, folder)), *flags, limit, str(corpus)], check=False).returncode:
            return False
    return True


def main(arguments: list[str]) -> int:
    verbs = {"coverage": print_coverage, "misra": print_misra, "size": print_size, "cost": print_cost}
    try:
        if arguments[:1] == ["mutate"]:
            return 0 if print_mutate(arguments[1:]) else 1
        if arguments == ["cost", "--markdown"]:
            return 0 if print_cost(markdown=True) else 1
        if arguments[:1] == ["fuzz"]:
            return 0 if fuzz(float(arguments[1]) if len(arguments) > 1 else 8.0) else 1
        if len(arguments) == 1 and arguments[0] in verbs:
            return 0 if verbs[arguments[0]]() else 1
    except MissingToolError as error:
        print(error, file=sys.stderr)
        return 2
    print(__doc__, file=sys.stderr)
    return 2


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
