"""A command of a page on a plan that was never checked."""

import shlex
import subprocess
import sys
from pathlib import Path

import vehicle
from flight import TrajectoryFile, trajectory
from tests import waiting
from tests.firmware_bridge.offboard import curves


def unchecked(folder: Path, command: str) -> subprocess.CompletedProcess[str]:
    """Run it where `walk.json` is such a plan and `vehicle.toml` its vehicle."""
    way = curves.circle()
    file = TrajectoryFile(way, "circle", "", "", way.position([0.0, way.duration_s]), {})
    trajectory.save(folder / "walk.json", file)
    vehicle.save(folder / "vehicle.toml", vehicle.example("rigter2019"))
    words = [sys.executable, "-m", *shlex.split(command)]
    return subprocess.run(words, cwd=folder, capture_output=True, text=True, timeout=waiting.PATIENCE_S, check=False)
