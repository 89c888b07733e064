"""Builds the wheel for each Python that pyproject.toml names and tries it there: `make wheels`.

    tools/wheels.py                    doctor, and the README's program: a plan, a flight, an identification
    tools/wheels.py 3.13 --demo        one Python only; with every extra, the demo too

A Python that is neither on the path nor among pyenv's is asked of `uv python install`. The exit code is 1 when one is
not to be had or a wheel fails. Wheels stay in dist/.
"""

import argparse
import json
import os
import re
import shutil
import subprocess
import sys
import tempfile
import tomllib
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
UV = Path(sys.executable).parent / "uv"


class WheelError(RuntimeError):
    """A step failed; holds what it printed."""


def run(*command: object, cwd: Path = ROOT, environment: dict[str, str] | None = None) -> str:
    """Standard output of a command.

    Raises:
        WheelError: it failed.
    """
    words = [str(word) for word in command]
    done = subprocess.run(words, cwd=cwd, env=environment, capture_output=True, text=True, check=False)
    if done.returncode != 0:
        raise WheelError(f"{' '.join(words)} ended with {done.returncode}:\n{done.stdout[-2000:]}{done.stderr[-2000:]}")
    return done.stdout


def named() -> list[str]:
    """Versions of Python in the classifiers."""
    classifiers = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["classifiers"]
    return re.findall(r"Python :: (3\.\d+)$", "\n".join(classifiers), re.MULTILINE)


def interpreter(version: str) -> str | None:
    """A Python of this version that runs: found, or installed by uv."""
    found = next((path for path in _candidates(version) if _runs(path, version)), None)
    if found:
        return found
    try:
        run(UV, "python", "install", version)
        return run(UV, "python", "find", "--no-project", "--managed-python", version).strip()
    except WheelError:
        return None


def _candidates(version: str) -> Iterator[str]:
    yield sys.executable
    if found := shutil.which(f"python{version}"):
        yield found
    pyenv = Path(os.environ.get("PYENV_ROOT", Path.home() / ".pyenv"))
    yield from map(str, sorted(pyenv.glob(f"versions/{version}.*/bin/python"), reverse=True))


def _runs(python: str, version: str) -> bool:
    try:
        return run(python, "-c", "import sys; print('%d.%d' % sys.version_info[:2])").strip() == version
    except (WheelError, OSError):
        return False


def build(python: str, out: Path, *, isolated: bool = True) -> Path:
    """The wheel for that Python; not isolated, it is built by the tools beside this one.

    Raises:
        WheelError: it cannot be built.
    """
    path = f"{Path(sys.executable).parent}{os.pathsep}{os.environ.get('PATH', '')}"
    options = () if isolated else ("--no-build-isolation",)
    run(UV, "build", "--wheel", *options, "--python", python, "-o", out, ROOT, environment={**os.environ, "PATH": path})
    tag = run(python, "-c", "import sys; print('cp%d%d' % sys.version_info[:2])").strip()
    (wheel,) = out.glob(f"goshawk-*-{tag}-*.whl")
    return wheel


def doctor(environment: Path) -> None:
    """
    Raises:
        WheelError: the installation in that virtual environment is not well.
    """
    answer = json.loads(run(environment / "bin" / "goshawk", "doctor", "--json", cwd=environment))
    if not answer["healthy"]:
        raise WheelError("; ".join(f"{f['name']}: {f['detail']}" for f in answer["findings"] if not f["ok"]))


def plan_fly_learn(environment: Path) -> None:
    """
    Raises:
        WheelError: the README's program does not run in that virtual environment.
    """
    program = (ROOT / "README.md").read_text().split("```python\n")[1].split("```")[0]
    said = run(environment / "bin" / "python", "-c", program, cwd=environment)
    if "clearance at least" not in said:
        raise WheelError(f"the README's program printed\n{said}")


def attempt(version: str, *, demo: bool) -> str:
    """One Python, from the interpreter to the demo; what was tried.

    Raises:
        WheelError: a step failed, or there is no such Python here.
    """
    python = interpreter(version)
    if python is None:
        raise WheelError("no such Python here, and uv could not install one")
    wheel = build(python, ROOT / "dist")
    with tempfile.TemporaryDirectory() as folder:
        environment = Path(folder) / "venv"
        run(UV, "venv", "--python", python, environment)
        run(UV, "pip", "install", "--python", environment, wheel)
        doctor(environment)
        plan_fly_learn(environment)
        if demo:
            run(UV, "pip", "install", "--python", environment, f"{wheel}[all]")
            doctor(environment)
            run(environment / "bin" / "goshawk", "demo", "--out", Path(folder) / "demo", cwd=environment)
    return f"{wheel.name}: doctor, plan, flight, identification{', demo with every extra' if demo else ''}"


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("versions", nargs="*", help="Pythons to try [default: those of the classifiers]")
    parser.add_argument("--demo", action="store_true", help="install every extra and run the demo, too")
    asked = parser.parse_args()
    failed = 0
    for version in asked.versions or named():
        try:
            print(f"{version}  ok      {attempt(version, demo=asked.demo)}", flush=True)
        except WheelError as error:
            failed += 1
            print(f"{version}  FAILED  {error}", flush=True)
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
