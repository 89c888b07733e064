"""Each diff of the page on extending Goshawk applies, touches as many files as the page says, and works."""

import json
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from goshawk.installation import PACKAGES
from tests.waiting import PATIENCE_S

ROOT = Path(__file__).parents[1]
PAGE = ROOT / "docs" / "how-to" / "extend.md"
DIFFS = PAGE.parent / "extend"
TOUCHED = {
    # diff: files that it adds, files that it changes
    "effect": (1, 0),
    "sensor": (1, 0),
    "camera_model": (0, 1),
    "verb": (1, 0),
    "panel": (2, 1),
    "message": (0, 3),
}
LEFT_OUT = shutil.ignore_patterns("node_modules", "__pycache__")
FIRST = """
import importlib.machinery, pathlib, sys

class Changed:
    \"\"\"Imports the packages of the folder from there; their compiled parts from where they are installed.\"\"\"

    @staticmethod
    def find_spec(name, path=None, target=None):
        if pathlib.Path(sys.argv[1], name.partition(".")[0]).is_dir():
            return importlib.machinery.PathFinder.find_spec(name, path or [sys.argv[1]])

sys.meta_path.insert(0, Changed)
"""


def checked(*command: object, folder: Path) -> str:
    """What a command printed; it must end well."""
    words = [str(word) for word in command]
    done = subprocess.run(words, cwd=folder, capture_output=True, text=True, timeout=PATIENCE_S, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


def applied(name: str, package: str, folder: Path) -> Path:
    """A folder with a copy of a package, the diff applied."""
    shutil.copytree(ROOT / package, folder / package, ignore=LEFT_OUT)
    checked("git", "apply", "--verbose", DIFFS / f"{name}.diff", folder=folder)
    return folder


def run(folder: Path, code: str) -> str:
    """Run code with the changed package; what it printed."""
    return checked(sys.executable, "-c", FIRST + code, folder, folder=ROOT)


@pytest.mark.parametrize("name", TOUCHED)
def test_a_diff_touches_as_many_files_as_the_page_says(name):
    diff = (DIFFS / f"{name}.diff").read_text()
    assert (diff.count("\nnew file mode"), diff.count("diff --git") - diff.count("\nnew file mode")) == TOUCHED[name]


def test_the_page_shows_every_diff():
    shown = re.findall(r"literalinclude} extend/(\w+)\.diff", PAGE.read_text())
    assert sorted(shown) == sorted(TOUCHED) == sorted(path.stem for path in DIFFS.iterdir())


def test_the_effect_is_found_again_by_the_fit(tmp_path):
    code = """
import numpy as np, vehicle
recovery = vehicle.self_test.run("side_guard_drag", rng=np.random.default_rng(1))
assert recovery.passed, recovery
"""
    run(applied("effect", "vehicle", tmp_path), code)


def test_the_sensor_is_read_fitted_and_reported(tmp_path):
    code = """
import numpy as np, sysid, vehicle
from flight import FlightLog
from flight.flight_log import COLUMNS
from tests.sysid import flying

rng = np.random.default_rng(2)
logs = flying.fly(flying.Truth(), flying.paper_flights(rng), 3, duration_s=6.0, rng=rng, rate_hz=100.0)

def with_velocity(log):
    measured = np.gradient(log.vector("position_world_m"), log.time_s, axis=0)
    return FlightLog({**log.columns, **dict(zip(COLUMNS["velocity_world_m_s"], measured.T))}, log.metadata)

options = sysid.Options(free=("thrust_bem.k1_n_s2",), pose_sensor=False, gusts="white")
fit = sysid.identify([with_velocity(log) for log in logs], vehicle.example("rigter2019"), options).as_dict()
assert fit["noise"]["velocity_m_s"] > 0.0
assert 0.9 < fit["residuals"]["velocity"]["rms"] < 1.1
"""
    run(applied("sensor", "sysid", tmp_path), code)


def test_the_camera_model_projects_as_colmap_does(tmp_path):
    code = """
import numpy as np, pycolmap
from mapping.camera import lens
rays = np.random.default_rng(1).normal(size=(100, 3)) + [0.0, 0.0, 3.0]
focal_px, centre_px = [300.0, 310.0], [320.0, 240.0]
named = dict(zip(lens.PARAMETERS["FISHEYE"], focal_px + centre_px))
ours = lens.of_model("FISHEYE", named).place(rays) * focal_px + centre_px
colmap = pycolmap.Camera(model="FISHEYE", width=640, height=480, params=focal_px + centre_px)
np.testing.assert_allclose(ours, colmap.img_from_cam(rays), atol=1e-9)
"""
    run(applied("camera_model", "mapping", tmp_path), code)


def test_the_verb_answers(tmp_path):
    code = """
import numpy as np
from pathlib import Path
from flight import TrajectoryFile, trajectory
from goshawk.cli import main
straight = trajectory.Trajectory(np.array([2.0]), np.array([[[0.0, 1.5], [0.0, 2.0], [1.0, 0.0], [0.0, 0.0]]]))
trajectory.save(Path(sys.argv[1], "walk.json"), TrajectoryFile(straight, "walk", "", "", np.zeros((2, 3)), {}))
main(["length", f"{sys.argv[1]}/walk.json", "--json"])
"""
    applied("verb", "goshawk", tmp_path)
    for package in PACKAGES:  # Goshawk starts only where all of them are in one folder
        shutil.copytree(ROOT / package, tmp_path / package, ignore=LEFT_OUT)
    answer = run(tmp_path, code)
    assert json.loads(answer)["length_m"] == pytest.approx(5.0)


def test_the_message_reaches_the_controller(tmp_path):
    folder = applied("message", "firmware_bridge", tmp_path)
    subprocess.run([sys.executable, folder / "firmware_bridge/dialect/generate.py"], check=True)
    controller = folder / "firmware_bridge" / "controller"
    (folder / "main.c").write_text(
        """
#undef main
#include "link_cases.h"
int main(void) {
    start_link(false, 4);
    SEND(PILOT, GOSHAWK_PATH_RATE, goshawk_path_rate, TO_VEHICLE, .rate = 0.5f);
    must(controller.time_scale == 1.0f, "only from the station in control");
    lease(PILOT, 1);
    SEND(PILOT, GOSHAWK_PATH_RATE, goshawk_path_rate, TO_VEHICLE, .rate = 0.5f);
    must(controller.time_scale == 0.5f, "carried out");
    return 0;
}
"""
    )
    includes = (controller / "include", controller / "test/cases/link", folder / "firmware_bridge/dialect/generated")
    sources = [*(controller / "src").rglob("*.c"), *(controller / "test/cases").rglob("*.c"), folder / "main.c"]
    flags = ["-std=c11", "-O0", "-w", "-Dmain=cases_main", *(f"-I{path}" for path in includes)]
    checked("gcc", *flags, *sources, "-o", folder / "program", "-lm", folder=folder)
    checked(folder / "program", folder=folder)


@pytest.mark.slow
@pytest.mark.skipif(shutil.which("npm") is None, reason="needs npm, from Debian's nodejs or nodejs.org")
def test_the_panel_fits_the_page(tmp_path):
    client = applied("panel", "gcs_web/client", tmp_path) / "gcs_web" / "client"
    (client.parent / "static").mkdir()
    for words in ("ci", "run check", "run bundle"):
        checked("npm", *words.split(), folder=client)
    assert "Propellers tight" in (client.parent / "static" / "app.js").read_text()
