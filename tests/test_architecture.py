"""The floors of docs/architecture.md: who may import whom. A climb fails here, by file and line."""

import ast
from collections.abc import Iterator
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
    "gcs_web": {"flight", "esdf", "vehicle", "mapping", "planner", "sysid", "firmware_bridge"},
    "goshawk": {"flight", "esdf", "vehicle", "mapping", "planner", "sysid", "firmware_bridge", "gcs_web"},
}
GROUND_FLOOR_LIBRARIES = {"numpy", "pyarrow", "tomli_w"}
HEAVY = {"open3d", "pycolmap", "matplotlib", "viser", "scipy.optimize", "osqp", "ompl", "aiohttp", "pyarrow"}


def imports(tree: ast.AST) -> Iterator[tuple[str, int, bool]]:
    """Every imported module, its line, and whether it is imported when the file is (not inside a function)."""
    inner = {
        id(n) for f in ast.walk(tree) if isinstance(f, ast.FunctionDef | ast.AsyncFunctionDef) for n in ast.walk(f)
    }
    typing_only = {
        id(n)
        for block in ast.walk(tree)
        if isinstance(block, ast.If) and "TYPE_CHECKING" in ast.dump(block.test)
        for n in ast.walk(block)
    }
    for node in ast.walk(tree):
        at_import = id(node) not in inner and id(node) not in typing_only
        if isinstance(node, ast.Import):
            for alias in node.names:
                yield alias.name, node.lineno, at_import
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"relative import at line {node.lineno}: name the package"
            yield node.module or "", node.lineno, at_import


def files(package: str) -> list[Path]:
    found = [p for p in (ROOT / package).rglob("*.py") if "generated" not in p.parts]
    assert found, f"{package} has no Python files"
    return found


@pytest.mark.parametrize("package", MAY_IMPORT)
def test_imports_only_go_down(package):
    climbs = [
        f"{path.relative_to(ROOT)}:{line} imports {module}"
        for path in files(package)
        for module, line, _ in imports(ast.parse(path.read_text()))
        if (top := module.split(".")[0]) in MAY_IMPORT and top != package and top not in MAY_IMPORT[package]
    ]
    assert not climbs


def test_the_ground_floor_needs_only_numpy_and_file_libraries():
    import sys

    foreign = [
        f"{path.name}:{line} imports {module}"
        for path in files("flight")
        for module, line, _ in imports(ast.parse(path.read_text()))
        if module.split(".")[0] not in sys.stdlib_module_names | GROUND_FLOOR_LIBRARIES | {"flight"}
    ]
    assert not foreign


@pytest.mark.parametrize("package", MAY_IMPORT)
def test_heavy_libraries_wait_until_they_are_needed(package):
    """`goshawk --help` must not pay for a mesh library."""
    eager = [
        f"{path.relative_to(ROOT)}:{line} imports {module}"
        for path in files(package)
        for module, line, at_import in imports(ast.parse(path.read_text()))
        if at_import and any(module == heavy or module.startswith(heavy + ".") for heavy in HEAVY)
    ]
    assert not eager


def test_every_package_is_in_the_wheel_and_on_a_floor():
    import tomllib

    settings = tomllib.loads((ROOT / "pyproject.toml").read_text())
    assert set(settings["tool"]["scikit-build"]["wheel"]["packages"]) == set(MAY_IMPORT)


def test_no_module_is_longer_than_five_hundred_lines():
    """About 400 lines is where a file starts answering two questions; 500 is where this test says so."""
    sources = [p for package in MAY_IMPORT for p in files(package)]
    sources += [p for package in MAY_IMPORT for p in (ROOT / package).rglob("*.c") if "generated" not in p.parts]
    sources += [p for package in MAY_IMPORT for p in (ROOT / package).rglob("*.cpp")]
    long = {str(p.relative_to(ROOT)): n for p in sources if (n := p.read_text().count("\n")) > 500}
    assert not long
