"""The wheel, installed outside the repository, is whole: kernels, packaged files, command."""

import json
import shutil
import subprocess
import sys
import sysconfig
from pathlib import Path

import pytest

from tests.waiting import PATIENCE_S

ROOT = Path(__file__).parent.parent


def run(*command: object, cwd: Path) -> str:
    done = subprocess.run(
        [*map(str, command)], cwd=cwd, capture_output=True, text=True, timeout=PATIENCE_S, check=False
    )
    assert done.returncode == 0, done.stderr
    return done.stdout


@pytest.fixture(scope="module")
def installed(tmp_path_factory) -> Path:
    """A folder with the wheel, and with `venv`, where it is installed."""
    tmp_path = tmp_path_factory.mktemp("wheel")
    uv = Path(sys.executable).parent / "uv"
    if not uv.exists():
        pytest.skip("uv is not beside this Python; `make setup` puts it there")
    path = f"PATH={Path(sys.executable).parent}:/usr/local/bin:/usr/bin:/bin"
    run(
        "env",
        path,
        uv,
        "build",
        "--wheel",
        "--no-build-isolation",
        "--python",
        sys.executable,
        "-o",
        tmp_path,
        ROOT,
        cwd=tmp_path,
    )
    (wheel,) = tmp_path.glob("goshawk-*.whl")
    run(sys.executable, "-m", "venv", "--without-pip", tmp_path / "venv", cwd=tmp_path)
    python = tmp_path / "venv" / "bin" / "python"
    run(uv, "pip", "install", "--python", python, "--no-deps", wheel, cwd=tmp_path)
    site = Path(run(python, "-c", "import sysconfig; print(sysconfig.get_path('purelib'))", cwd=tmp_path).strip())
    # the libraries are those of this environment; only Goshawk itself is the wheel's
    (site / "libraries.pth").write_text(sysconfig.get_path("purelib") + "\n")
    return tmp_path


@pytest.mark.slow
def test_the_wheel_works_outside_the_repository(installed):
    tmp_path, python = installed, installed / "venv" / "bin" / "python"
    where = run(python, "-c", "import esdf, vehicle; vehicle.example('rigter2019'); print(esdf.__file__)", cwd=tmp_path)
    assert str(tmp_path) in where
    health = json.loads(run(tmp_path / "venv" / "bin" / "goshawk", "doctor", "--json", cwd=tmp_path))
    assert health["healthy"]
    listed = run(python, "-m", "zipfile", "-l", next(tmp_path.glob("*.whl")), cwd=tmp_path)
    assert "tests/" not in listed
    assert ".cpp" not in listed


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
