"""What several rooms' tests share: a small mapped room, without photographs; and how tests are dealt out to workers."""

import fcntl
import gc
import os
import shutil
import signal
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # as the command line and the Makefile do, before NumPy is imported
os.environ["XDG_STATE_HOME"] = os.path.join(tempfile.gettempdir(), "goshawk-tests-state")  # not the user's own
os.environ.setdefault("GOSHAWK_TRACEBACK", "1")  # a fault of our own is to be seen whole

import numpy as np
import pytest
from hypothesis import settings

if TYPE_CHECKING:
    from tests.docs import blocks

settings.register_profile("goshawk", deadline=None)  # no test asserts wall-clock times, Hypothesis' own limit included
settings.load_profile("goshawk")
pytest_plugins = ["tests.quick"]

# A shell that starts the tests in the background has Ctrl-C ignored, and every child would inherit that.
if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)


REAL_TIME = (
    "tests/firmware_bridge/link", "tests/gcs_web/test_page.py", "tests/goshawk/commands/fly/test_vehicle_verbs.py",
    "tests/goshawk/demo/test_chain.py",
)  # fmt: skip
"""A vehicle flies here by the clock: never two of these beside each other. Together they take longest, and begin."""


@pytest.hookimpl(tryfirst=True)
def pytest_collection(session: pytest.Session) -> None:
    """Each worker begins at another file, and finds compiled what others began with: all take 19 CPU seconds."""
    config = session.config
    worker, folders = getattr(config, "workerinput", None), [Path(place) for place in config.args]
    if worker is None or not all(folder.is_dir() for folder in folders):
        return
    files = [str(file) for folder in folders for file in sorted(folder.rglob("test_*.py"))]
    first = int(worker["workerid"].removeprefix("gw")) * len(files) // worker["workercount"]
    config.args = files[first:] + files[:first]


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Long files go to the workers first, or one of them works on while the others have nothing left."""
    from tests import quick  # a plugin, which pytest imports first

    took_s = quick.elsewhere_s()

    def turn(item: pytest.Item) -> tuple[int, float, str]:
        place = item.path.relative_to(item.config.rootpath).as_posix()
        clocked = next((i for i, start in enumerate(REAL_TIME) if place.startswith(start)), None)
        return (len(REAL_TIME), -took_s.get(place, 0.0), place) if clocked is None else (clocked, 0.0, place)

    items.sort(key=turn)


def pytest_collection_finish() -> None:
    """Look for garbage more rarely, and not in what was imported: it took a fifth of a simulated flight's CPU."""
    gc.freeze()
    gc.set_threshold(20_000, 20, 20)


@pytest.hookimpl(optionalhook=True)  # of pytest-xdist
def pytest_xdist_make_scheduler(config: pytest.Config, log: Any) -> Any:
    """A file's tests stay together, so that what they share is made once; all flights by the clock stay together.

    xdist's own groups (`--dist loadgroup`, 3.8) have no effect with pytest 9.2, which ignores the names they change.
    """
    from xdist.scheduler import LoadScopeScheduling

    class ByFile(LoadScopeScheduling):
        def _split_scope(self, nodeid: str) -> str:
            return "by the clock" if nodeid.startswith(REAL_TIME) else nodeid.split("::")[0]

    return ByFile(config, log)


@pytest.fixture(scope="session")
def made_once(tmp_path_factory: pytest.TempPathFactory) -> Callable[[str, Callable[[Path], None]], Path]:
    """`made_once(name, make)`: a folder that `make` fills, once for all workers; read it, change copies of it."""
    own = tmp_path_factory.getbasetemp()
    shared = own.parent if "PYTEST_XDIST_WORKER" in os.environ else own

    def get(name: str, make: Callable[[Path], None]) -> Path:
        folder, part = shared / name, shared / f"{name}.part"
        with open(shared / f"{name}.lock", "w") as lock:
            fcntl.flock(lock, fcntl.LOCK_EX)
            if not folder.exists():
                shutil.rmtree(part, ignore_errors=True)  # of a worker that failed to make it
                part.mkdir()
                make(part)
                part.rename(folder)
        return folder

    return get


@pytest.fixture
def documented(request: pytest.FixtureRequest) -> "list[blocks.Block]":
    """The blocks of README and docs that say `run by:` this test, to be run as they stand there."""
    from tests.docs import blocks

    found = blocks.run_by(request.node.nodeid.partition("[")[0])
    assert found, "no page names this test"
    return found


@pytest.fixture(scope="session")
def pillar_map(made_once) -> Path:
    """A map folder of a 6 x 4 x 2.5 m room with two pillars, made from solids."""
    return made_once("pillar_map", _make_pillar_map)


def _make_pillar_map(folder: Path) -> None:
    import trimesh

    import esdf
    import mapping
    from esdf import solids
    from flight import file_format
    from goshawk.rendered import world as rendered_world
    from mapping import map_folder
    from mapping.camera import rig

    pillars = [solids.Cylinder((2.0, 1.5, 1.25), 0.25, 2.5), solids.Cylinder((4.0, 2.6, 1.25), 0.35, 2.5)]
    room = solids.Scene([solids.Room((0.0, 0.0, 0.0), (6.0, 4.0, 2.5)), *pillars])
    grid = esdf.Grid(np.full(3, -0.2), np.full(3, 0.05), (128, 88, 58))
    field = esdf.build(esdf.rasterize(room, grid), grid)
    parts = [trimesh.creation.box(bounds=[[0.0, 0.0, -0.05], [6.0, 4.0, 0.0]])]
    for pillar in pillars:
        part = trimesh.creation.cylinder(pillar.radius_m, pillar.height_m)
        part.apply_translation(pillar.centre_world_m)
        parts.append(part)

    esdf.save(folder / "esdf", field)
    trimesh.util.concatenate(parts).export(folder / "mesh.glb")
    rig.save(folder / "camera.toml", rendered_world.default_rig())
    (folder / "poses.csv").write_text("image,time_s,x_m,y_m,z_m,qw,qx,qy,qz\n0.png,0,1,1,1,1,0,0,0\n")
    body = {"hash": field.hash, "verdict": "good", "reasons": []}
    file_format.write_toml(folder / "map.toml", format=map_folder.FORMAT, version=1, body=body)
    assert mapping.open_map(folder).hash == field.hash
