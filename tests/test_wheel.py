"""The wheel, installed outside the repository, is whole: kernels, packaged files, command."""

import importlib.util
import shutil
import sys
import sysconfig
import zipfile
from pathlib import Path
from types import ModuleType

import pytest

ROOT = Path(__file__).parent.parent


def load() -> ModuleType:
    spec = importlib.util.spec_from_file_location("goshawk_wheels", ROOT / "tools" / "wheels.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


wheels = load()
run = wheels.run


def test_the_wheel_is_tried_on_every_python_that_it_is_made_for():
    assert wheels.named()[0] == "3.11"
    assert wheels.interpreter("{}.{}".format(*sys.version_info)) == sys.executable


@pytest.fixture(scope="module")
def installed(tmp_path_factory) -> Path:
    """A folder with the wheel, and with `venv`, where it is installed."""
    tmp_path = tmp_path_factory.mktemp("wheel")
    if not wheels.UV.exists():
        pytest.skip("uv is not beside this Python; `make setup` puts it there")
    wheel = wheels.build(sys.executable, tmp_path, isolated=False)
    environment = tmp_path / "venv"
    run(sys.executable, "-m", "venv", "--without-pip", environment)
    python = environment / "bin" / "python"
    run(wheels.UV, "pip", "install", "--python", python, "--no-deps", wheel)
    site = Path(run(python, "-c", "import sysconfig; print(sysconfig.get_path('purelib'))").strip())
    # the libraries are those of this environment; only Goshawk itself is the wheel's
    (site / "libraries.pth").write_text(sysconfig.get_path("purelib") + "\n")
    return tmp_path


@pytest.mark.slow
def test_the_wheel_works_outside_the_repository(installed):
    tmp_path, python = installed, installed / "venv" / "bin" / "python"
    where = run(python, "-c", "import esdf, vehicle; vehicle.example('rigter2019'); print(esdf.__file__)", cwd=tmp_path)
    assert str(tmp_path) in where
    wheels.doctor(installed / "venv")
    listed = run(python, "-m", "zipfile", "-l", next(tmp_path.glob("*.whl")))
    assert "tests/" not in listed
    assert ".cpp" not in listed


@pytest.mark.slow
def test_the_wheel_holds_the_licences_of_what_is_compiled_in(installed):
    with zipfile.ZipFile(next(installed.glob("*.whl"))) as wheel:
        said = wheel.read("goshawk/compiled_in.txt").decode()
    assert "Wenzel Jakob" in said
    assert "MIT License" in said.split("tsl::robin_map")[1]


def test_what_differs_between_two_builds_is_named(tmp_path):
    for name, text in (("one", "a"), ("other", "b")):
        with zipfile.ZipFile(tmp_path / name, "w") as archive:
            archive.writestr("same.py", "x")
            archive.writestr("built.so", text)
    assert wheels._different(tmp_path / "one", tmp_path / "other") == ["built.so"]
    assert wheels._different(tmp_path / "one", tmp_path / "one") == ["their order or times"]


@pytest.mark.slow
def test_a_users_file_runs_and_is_clean_under_two_type_checkers(installed):
    python, file = (
        installed / "venv" / "bin" / "python",
        Path(shutil.copy(ROOT / "tests" / "a_users_file.py", installed)),
    )
    run(python, "-c", "import vehicle; vehicle.save('vehicle.toml', vehicle.example('rigter2019'))", cwd=installed)
    assert run(python, file, installed, cwd=installed).startswith("k1 = 3.1")
    run(sys.executable, "-m", "mypy", "--strict", "--python-executable", python, file, cwd=installed)
    run(sys.executable, "-m", "pyright", "--pythonpath", python, file, cwd=installed)
