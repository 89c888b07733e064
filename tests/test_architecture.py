"""The floors of docs/explain/architecture.md: who may import whom. A climb fails here, by file and line."""

import ast
import functools
import re
from collections import Counter
from collections.abc import Iterator, Mapping
from os.path import normpath
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent
MAY_IMPORT = {
    "flight": set(),
    "esdf": {"flight"},
    "vehicle": {"flight"},
    "mapping": {"flight", "esdf"},
    "planner": {"flight", "esdf", "vehicle"},
    "sysid": {"flight", "vehicle"},
    "firmware_bridge": {"flight"},
    "preflight": {"flight", "esdf", "vehicle", "firmware_bridge"},
    "gcs_web": {"flight", "esdf", "vehicle", "mapping", "planner", "sysid", "firmware_bridge"},
    "goshawk": {"flight", "esdf", "vehicle", "mapping", "planner", "sysid", "firmware_bridge", "preflight", "gcs_web"},
}
_BELOW_THE_DESK = (
    "protocol", "gateway", "jobs", "scene", "document", "planning", "map", "vehicle", "flights", "comparison",
    "learning",
)  # fmt: skip
ROOMS = {
    "mapping.camera": set(),
    "mapping.input": {"mapping.camera"},
    "mapping.sparse": {"mapping.camera", "mapping.input"},
    "mapping.dense": {"mapping.camera"},
    "mapping.localization": {"mapping.camera", "mapping.input", "mapping.sparse"},
    "mapping.exploration": {"mapping.camera"},
    "mapping.cloud": {"mapping.input"},
    "mapping.export": {"mapping.camera", "mapping.sparse", "mapping.dense"},
    "planner.request": set(),
    "planner.route": {"planner.request"},
    "planner.curve": {"planner.request"},
    "planner.gate": {"planner.request", "planner.curve"},
    "planner.optimise": {"planner.request", "planner.route", "planner.curve", "planner.gate"},
    "sysid.logs": set(),
    "sysid.estimator": {"sysid.logs"},
    "sysid.diagnosis": {"sysid.logs", "sysid.estimator"},
    "sysid.report": {"sysid.logs", "sysid.estimator", "sysid.diagnosis"},
    "firmware_bridge.offboard": set(),
    "firmware_bridge.betaflight_sitl": {"firmware_bridge.offboard"},
    "firmware_bridge.autopilot": {"firmware_bridge.offboard"},
    "firmware_bridge.crazyflie": set(),
    "goshawk.terminal": set(),
    "goshawk.rendered": set(),
    "goshawk.plot": set(),
    "goshawk.demo": {"goshawk.terminal", "goshawk.rendered"},
    "goshawk.paper": {"goshawk.rendered", "goshawk.plot"},
    "goshawk.commands.project": {"goshawk.terminal", "goshawk.demo", "goshawk.paper"},
    "goshawk.commands.plan": {"goshawk.terminal"},
    "goshawk.commands.preflight": {"goshawk.terminal", "goshawk.commands.plan"},
    "goshawk.commands.map": {"goshawk.terminal", "goshawk.plot", "goshawk.commands.plan"},
    "goshawk.commands.learn": {"goshawk.terminal", "goshawk.commands.plan"},
    "goshawk.station_jobs": {
        "goshawk.terminal",
        "goshawk.demo",
        "goshawk.commands.plan",
        "goshawk.commands.map",
        "goshawk.commands.learn",
        "goshawk.commands.preflight",
    },
    "goshawk.commands.fly": {
        "goshawk.terminal",
        "goshawk.commands.project",
        "goshawk.commands.plan",
        "goshawk.station_jobs",
    },
    "gcs_web.protocol": set(),
    "gcs_web.gateway": {"gcs_web.protocol"},
    "gcs_web.jobs": {"gcs_web.protocol"},
    "gcs_web.scene": {"gcs_web.protocol"},
    "gcs_web.document": {"gcs_web.protocol"},
    "gcs_web.planning": {"gcs_web.protocol", "gcs_web.scene", "gcs_web.document"},
    "gcs_web.map": {f"gcs_web.{room}" for room in ("protocol", "gateway", "jobs", "scene", "document", "planning")},
    "gcs_web.vehicle": {"gcs_web.protocol", "gcs_web.gateway", "gcs_web.scene", "gcs_web.planning"},
    "gcs_web.flights": {"gcs_web.protocol", "gcs_web.jobs"},
    "gcs_web.comparison": {"gcs_web.protocol", "gcs_web.gateway", "gcs_web.scene", "gcs_web.flights"},
    "gcs_web.learning": {"gcs_web.protocol", "gcs_web.flights", "gcs_web.comparison"},
    "gcs_web.view3d": {f"gcs_web.{room}" for room in ("protocol", "scene", "document", "map", "vehicle", "comparison")},
    "gcs_web.desk": {f"gcs_web.{room}" for room in (*_BELOW_THE_DESK, "view3d")},
    "gcs_web.panels": {f"gcs_web.{room}" for room in (*_BELOW_THE_DESK, "view3d", "desk")},
    "gcs_web.app": {f"gcs_web.{room}" for room in (*_BELOW_THE_DESK, "view3d", "desk", "panels")},
}
"""Rooms of a package that is large enough to have some, and which of its other rooms each may import."""
CONTROLLER = ROOT / "firmware_bridge" / "controller" / "src"
CONTROLLER_ROOMS = ["base", "trajectory", "upload", "control", "mission", "link/transport", "link/services", "link"]
"""Rooms of the embedded C, the lowest floor first: each may call and include those before it."""
FLOORS = {
    "mapping.sparse": (".", "calibration", "mapper", "recorded_motion", "features"),
    "vehicle": ("simulation", "importers", ".", "effects"),
    "vehicle.effects": ("torque", "thrust", "drag", "surroundings", "motors", "mass", "sensors", "."),
    "sysid.logs": (".", "checks", "readers", "events", "motors", "sensors"),
    "sysid.estimator": (
        "validation", ".", "without_pose", "uncertainty", "joint_problem", "blocks", "trajectory", "motors", "flights",
        "options",
    ),
    "sysid.diagnosis": ("experiment_design", ".", "evidence", "thresholds"),
}  # fmt: skip
"""The rooms in a folder from the top down, "." being its own modules: each imports only what stands below it."""
CODE = {".py", ".c", ".h", ".cpp", ".hpp", ".ts", ".tsx"}
NOT_PRODUCT = {"generated", "node_modules", "test"}
GROUND_FLOOR_LIBRARIES = {"numpy", "pyarrow", "tomli_w"}
HEAVY = {
    "open3d", "pycolmap", "matplotlib", "viser", "scipy.optimize", "scipy.signal", "scipy.stats", "osqp", "ompl",
    "aiohttp", "pyarrow",
}  # fmt: skip
WITHOUT_SCIPY = {"flight", "esdf", "vehicle", "mapping", "planner", "sysid", "firmware_bridge", "preflight", "gcs_web"}
"""Packages that import no SciPy either until they need it: half a second or more of processor time."""


def typing_only(tree: ast.AST) -> set[int]:
    """Nodes that only a type checker runs."""
    blocks = [b for b in ast.walk(tree) if isinstance(b, ast.If) and "TYPE_CHECKING" in ast.dump(b.test)]
    return {id(node) for block in blocks for node in ast.walk(block)}


@functools.cache
def parsed(path: Path) -> ast.Module:
    return ast.parse(path.read_text())


@functools.cache
def imports(tree: ast.AST) -> tuple[tuple[str, int, bool], ...]:
    """Every imported module, its line, and whether it is imported when the file is (not inside a function)."""
    return tuple(_imports(tree))


def _imports(tree: ast.AST) -> Iterator[tuple[str, int, bool]]:
    inner = {
        id(n) for f in ast.walk(tree) if isinstance(f, ast.FunctionDef | ast.AsyncFunctionDef) for n in ast.walk(f)
    }
    unused = typing_only(tree)
    for node in ast.walk(tree):
        at_import = id(node) not in inner and id(node) not in unused
        if isinstance(node, ast.Import):
            for alias in node.names:
                yield alias.name, node.lineno, at_import
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"relative import at line {node.lineno}: name the package"
            yield node.module or "", node.lineno, at_import


@functools.cache
def import_statements(tree: ast.AST) -> list[ast.Import | ast.ImportFrom]:
    """Those that are run, now or later."""
    unused = typing_only(tree)
    return [n for n in ast.walk(tree) if isinstance(n, ast.Import | ast.ImportFrom) and id(n) not in unused]


def imported_modules(tree: ast.AST, modules: set[str]) -> set[str]:
    """Which of `modules` a file runs, now or later: `from package import name` runs the module `name`, if it is one."""
    found: set[str] = set()
    for node in import_statements(tree):
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        elif node.module:
            inside = {f"{node.module}.{alias.name}" for alias in node.names}
            found |= {name if name in modules else node.module for name in inside}
    return found & modules


def circles(graph: Mapping[str, set[str]]) -> list[list[str]]:
    """Groups of modules that reach each other."""

    def reached(start: str) -> set[str]:
        seen: set[str] = set()
        left = [start]
        while left:
            new = graph[left.pop()] - seen
            seen |= new
            left += new
        return seen

    reach = {module: reached(module) for module in graph}
    groups = {frozenset(m for m in reach[module] if module in reach[m]) for module in graph if module in reach[module]}
    return sorted(sorted(group) for group in groups)


def room_of(module: str) -> str:
    """The innermost room that a module is in; empty where it is in none."""
    return max((room for room in ROOMS if f"{module}.".startswith(f"{room}.")), key=len, default="")


def files(package: str) -> list[Path]:
    places = [ROOT / f"{package}.py", *(ROOT / package).rglob("*.py")]
    found = [p for p in places if p.is_file() and "generated" not in p.parts]
    assert found, f"{package} has no Python files"
    return found


def modules_of(package: str) -> dict[str, Path]:
    """Every module of a package or room by its name, and its file."""
    found = files(package.replace(".", "/"))
    return {".".join(p.relative_to(ROOT).with_suffix("").parts).removesuffix(".__init__"): p for p in found}


@pytest.mark.parametrize("package", MAY_IMPORT)
def test_imports_only_go_down(package):
    climbs = [
        f"{path.relative_to(ROOT)}:{line} imports {module}"
        for path in files(package)
        for module, line, _ in imports(parsed(path))
        if (top := module.split(".")[0]) in MAY_IMPORT and top != package and top not in MAY_IMPORT[package]
    ]
    assert not climbs


@pytest.mark.parametrize("room", ROOMS)
def test_rooms_import_only_rooms_below_them(room):
    climbs = [
        f"{path.relative_to(ROOT)}:{line} imports {module}"
        for path in files(room.replace(".", "/"))
        for module, line, _ in imports(parsed(path))
        if module.split(".")[0] == room.split(".")[0]
        and (other := room_of(module))
        and other != room
        and other not in ROOMS[room]
    ]
    assert not climbs


@pytest.mark.parametrize("folder", FLOORS)
def test_rooms_in_a_folder_import_only_what_stands_below_them(folder):
    floors, places = FLOORS[folder], modules_of(folder)

    def floor(module: str) -> int:
        first = module.removeprefix(f"{folder}.").split(".")[0]
        return floors.index(first if first in floors else ".")

    climbs = [
        f"{name} imports {other}"
        for name, path in places.items()
        for other in imported_modules(parsed(path), set(places))
        if name != folder and floor(other) < floor(name)
    ]
    assert not climbs
    rooms = {p.parent.name for p in (ROOT / folder.replace(".", "/")).glob("*/*.py")}
    assert rooms <= set(floors), "a room without a floor"


@pytest.mark.parametrize("package", MAY_IMPORT)
def test_modules_of_a_package_do_not_import_each_other_in_a_circle(package):
    """Imports inside functions count: a circle is a circle however late it closes."""
    places = modules_of(package)
    places |= {f"{package}.{stub.stem}": stub for stub in (ROOT / package).glob("_*.pyi")}
    modules = set(places)
    graph = {name: imported_modules(parsed(path), modules) for name, path in places.items()}
    assert not circles(graph)


def test_a_circle_is_found_however_late_it_closes():
    late = ast.parse("def f():\n    from room import b\n")
    typed = ast.parse("from typing import TYPE_CHECKING\nif TYPE_CHECKING:\n    from room.a import A\n")
    modules = {"room", "room.a", "room.b", "room.c"}
    graph = {"room": set(), "room.a": imported_modules(late, modules), "room.c": imported_modules(typed, modules)}
    assert graph["room.a"] == {"room.b"}
    assert circles(graph | {"room.b": {"room.a", "room.c"}}) == [["room.a", "room.b"]]


def c_uses(sources: Mapping[str, str]) -> dict[str, set[str]]:
    """Of each C file, by its path: the others whose functions it calls or names, and the headers it includes."""
    comment_or_include = re.compile(r"/\*.*?\*/|^#include .*?$", re.DOTALL | re.MULTILINE)
    code = {path: comment_or_include.sub("", text) for path, text in sources.items() if path.endswith(".c")}
    function = re.compile(r"^(?!static\b|typedef\b)[a-z][\w \*]*?\b(\w+)\([^;{}]*\)\s*\{", re.MULTILINE)
    home = {name: path for path, text in code.items() for name in function.findall(text)}
    uses = {path: {home[word] for word in re.findall(r"\w+", code.get(path, "")) if word in home} for path in sources}
    for path, text in sources.items():
        for name in re.findall(r'^#include "([^"]+)"', text, re.MULTILINE):
            uses[path].add(normpath(Path(path).parent / name))
    return {path: (used & set(sources)) - {path} for path, used in uses.items()}


def controller_uses() -> dict[str, set[str]]:
    files = [*CONTROLLER.rglob("*.c"), *CONTROLLER.rglob("*.h")]
    return c_uses({path.relative_to(CONTROLLER).as_posix(): path.read_text() for path in files})


def test_files_of_the_controller_do_not_call_each_other_in_a_circle():
    assert not circles(controller_uses())


def test_rooms_of_the_controller_only_call_and_include_rooms_below_them():
    uses = controller_uses()
    floor = {path: CONTROLLER_ROOMS.index(Path(path).parent.as_posix()) for path in uses}
    climbs = [f"{path} needs {other}" for path, used in uses.items() for other in used if floor[other] > floor[path]]
    assert not climbs
    assert {floor[path] for path in uses} == set(range(len(CONTROLLER_ROOMS)))


def test_a_circle_of_c_files_is_found_by_calls_and_by_includes():
    low = '#include "../up/high.h"\nint low(void) { return 1; } /* high() */\n'
    high = "static int own(void) { return low(); }\nint high(int (*with)(void)) {\n    return own();\n}\n"
    uses = c_uses({"base/low.c": low, "up/high.c": high, "up/high.h": "int high(int (*with)(void));\n"})
    assert uses == {"base/low.c": {"up/high.h"}, "up/high.c": {"base/low.c"}, "up/high.h": set()}
    assert not circles(uses)
    assert circles(c_uses({"low.c": low.replace("/* high() */", "int x = high(0);"), "high.c": high}))


def test_the_ground_floor_needs_only_numpy_and_file_libraries():
    import sys

    foreign = [
        f"{path.name}:{line} imports {module}"
        for path in files("flight")
        for module, line, _ in imports(parsed(path))
        if module.split(".")[0] not in sys.stdlib_module_names | GROUND_FLOOR_LIBRARIES | {"flight"}
    ]
    assert not foreign


@pytest.mark.parametrize("package", MAY_IMPORT)
def test_heavy_libraries_wait_until_they_are_needed(package):
    """`goshawk --help` must not pay for a mesh library."""
    heavy = HEAVY | {"scipy"} if package in WITHOUT_SCIPY else HEAVY
    eager = [
        f"{path.relative_to(ROOT)}:{line} imports {module}"
        for path in files(package)
        for module, line, at_import in imports(parsed(path))
        if at_import and any(module == library or module.startswith(library + ".") for library in heavy)
    ]
    assert not eager


def test_every_package_is_in_the_wheel_with_its_types_and_on_a_floor():
    import tomllib

    settings = tomllib.loads((ROOT / "pyproject.toml").read_text())
    assert set(settings["tool"]["scikit-build"]["wheel"]["packages"]) == set(MAY_IMPORT)
    assert not [package for package in MAY_IMPORT if not (ROOT / package / "py.typed").exists()]


def test_no_module_is_longer_than_five_hundred_lines():
    """About 400 lines is where a file starts answering two questions; 500 is where this test says so."""
    sources = [p for package in MAY_IMPORT for p in files(package)]
    sources += [p for package in MAY_IMPORT for p in (ROOT / package).rglob("*.c") if "generated" not in p.parts]
    sources += [p for package in MAY_IMPORT for p in (ROOT / package).rglob("*.cpp")]
    long = {str(p.relative_to(ROOT)): n for p in sources if (n := p.read_text().count("\n")) > 500}
    assert not long


def test_no_folder_holds_more_than_twenty_modules():
    """A header and its source are one module."""
    sources = [
        path
        for package in MAY_IMPORT
        for path in (ROOT / package).rglob("*")
        if path.suffix in CODE and path.name != "__init__.py" and not NOT_PRODUCT & set(path.relative_to(ROOT).parts)
    ]
    modules = {(path.parent.relative_to(ROOT).as_posix(), path.stem) for path in sources}
    assert not {folder: n for folder, n in Counter(folder for folder, _ in modules).items() if n > 20}
