"""Tasks of a map on a Dask cluster whose parts fail; `goshawk map build --scheduler` makes the map of one machine."""

import os
import pickle
import re
import signal
import socket
import time
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest

import mapping
from flight import InputError, MapError, silent
from goshawk.commands.map import task_cluster
from goshawk.commands.map.task_cluster import DaskWorkers
from goshawk.commands.plan import cluster as dask_cluster
from goshawk.rendered import world as rendered_world
from mapping import stages, workers
from tests.goshawk.dask_cluster import Cluster, cluster, end
from tests.goshawk.running import answer as goshawk

pytest.importorskip("distributed", reason="Dask is an optional engine")


def squared(number: int) -> dict[str, np.ndarray]:
    """A task; one ends its worker, one is bad input, one takes too much, one is a library's error."""
    if number == 13:
        os.kill(os.getpid(), signal.SIGKILL)
    if number == 17:
        raise MapError("17 cannot be squared")
    if number == 19:
        raise MemoryError("Unable to allocate 4.39 GiB")
    if number == 23:
        cv2.resize(np.zeros((0, 0), np.uint8), (3, 3))
    if number == 29:
        time.sleep(0.5)
    return {"square": np.array(number**2), "pid": np.array(os.getpid())}


def done(made: Cluster, folder: Path, numbers: list[int]) -> list[dict[str, np.ndarray]]:
    folder.mkdir(exist_ok=True)
    pool = DaskWorkers(made.address)
    found = workers.files_of(
        squared, len(numbers), lambda k: (numbers[k],), folder=folder, pool=pool, stage="squaring", progress=silent
    )
    return [workers.arrays(file) for file in found]


@pytest.fixture
def two(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    """Two workers; a task that ends one is not tried by others."""
    monkeypatch.setenv("DASK_DISTRIBUTED__SCHEDULER__ALLOWED_FAILURES", "0")
    (tmp_path / "dask").mkdir()
    root = str(Path(__file__).parents[4])
    with cluster(tmp_path / "dask", 0) as made:
        for _ in range(2):
            made.worker(PYTHONPATH=root)
        yield made


def test_tasks_are_divided_among_workers_and_an_error_is_that_of_its_task(two, tmp_path):
    found = done(two, tmp_path / "tasks", list(range(12)))
    assert [int(each["square"]) for each in found] == [k * k for k in range(12)]
    assert os.getpid() not in {int(each["pid"]) for each in found}
    with pytest.raises(MapError, match="17 cannot be squared"):
        done(two, tmp_path / "bad", [1, 17])


@pytest.mark.parametrize(("number", "said"), [(19, "MemoryError: Unable.*more memory"), (23, "error: OpenCV")])
def test_an_error_of_a_library_is_named_with_its_machine(number: int, said: str) -> None:
    """What runs on a worker runs here."""
    here = (dask_cluster.installed(), stages.libraries(), stages.program())
    found = task_cluster.work_there(here, pickle.dumps((squared, (number,))))
    assert isinstance(found, dask_cluster.ClusterError)
    assert re.search(rf"^a task failed on the worker on {re.escape(socket.gethostname())}: {said}", str(found))


def test_what_was_sent_before_bad_input_is_waited_for_and_kept(two, tmp_path):
    """Of tasks that are sent in one round, the second cannot be read."""

    def task(number: int) -> tuple[int]:
        if number:
            raise InputError("image 1 cannot be read")
        return (29,)

    pool = DaskWorkers(two.address)
    done(two, tmp_path / "warm", [1, 2, 3, 4])  # both workers are there
    with pytest.raises(InputError, match="image 1 cannot be read"):
        workers.files_of(squared, 2, task, folder=tmp_path, pool=pool, stage="squaring", progress=silent)
    assert int(workers.arrays(tmp_path / "000000.npz")["square"]) == 29**2


def test_a_task_that_ends_its_workers_is_named_and_the_others_are_done(two, tmp_path):
    with pytest.raises(dask_cluster.ClusterError, match="task 2 of squaring ended without an answer"):
        done(two, tmp_path / "tasks", [2, 13, 3, 4])
    assert sorted(file.name for file in (tmp_path / "tasks").iterdir()) == ["000000.npz", "000002.npz", "000003.npz"]
    assert [int(each["square"]) for each in done(two, tmp_path / "tasks", [2, 5, 3, 4])] == [4, 25, 9, 16]


def test_a_worker_of_another_goshawk_is_refused(two, tmp_path, monkeypatch):
    monkeypatch.setattr(dask_cluster, "installed", lambda: "1.0 (sources 00000000)")
    with pytest.raises(InputError, match=r"not 1.0 \(sources 00000000\); the workers need the same Goshawk"):
        done(two, tmp_path / "tasks", [1, 2])


def test_a_worker_of_other_libraries_or_another_build_is_refused(two, tmp_path, monkeypatch):
    """Its answers would be kept as those of this machine's."""
    here = stages.libraries()
    monkeypatch.setattr(stages, "libraries", lambda: here | {"numpy": "1.1"})
    with pytest.raises(InputError, match=rf"has numpy {re.escape(here['numpy'])}, not 1\.1; the workers"):
        done(two, tmp_path / "tasks", [1, 2])
    monkeypatch.undo()
    monkeypatch.setattr(stages, "program", lambda: b"a stale kernel")
    with pytest.raises(InputError, match="another build of these sources"):
        done(two, tmp_path / "tasks", [1, 2])
    assert not list((tmp_path / "tasks").iterdir())


def test_an_address_without_a_scheduler_is_named(tmp_path, monkeypatch):
    monkeypatch.setattr(dask_cluster, "CONNECT_S", 1.0)
    with pytest.raises(InputError, match=r"--scheduler tcp://127\.0\.0\.1:1: no Dask scheduler answers there"):
        DaskWorkers("tcp://127.0.0.1:1").each(squared, iter([(0, (1,))]), lambda *_: None, "squaring", silent)


def test_a_wrong_address_is_told_before_the_images_are_looked_at(tmp_path, monkeypatch):
    monkeypatch.setattr(dask_cluster, "CONNECT_S", 1.0)
    mapping.rig.save(tmp_path / "camera.toml", rendered_world.default_rig(0.5))
    (tmp_path / "images").mkdir()
    call = ("map", "build", tmp_path / "images", "--camera", tmp_path / "camera.toml", "--out", tmp_path / "map")
    found = goshawk(*call, "--scheduler", "tcp://127.0.0.1:1")
    assert found.returncode == 2
    assert "no Dask scheduler answers there" in found.stderr
    assert not (tmp_path / "map.work").exists()


@pytest.mark.slow
def test_one_and_two_workers_make_the_map_that_this_machine_makes(tmp_path):
    """And a run whose scheduler is lost goes on where it was."""
    flight = rendered_world.loop_flight(16, share=0.2)
    images = tmp_path / "images"
    rig = rendered_world.default_rig(0.5)
    rendered_world.write_rendered_sequence(images, rig=rig, flight=replace(flight, times_s=flight.times_s / 4.0))
    (tmp_path / "dask").mkdir()
    call = ("map", "build", images, "--camera", images / "camera.toml", "--out")
    assert goshawk(*call, tmp_path / "here").returncode < 2
    with cluster(tmp_path / "dask") as made:
        assert goshawk(*call, tmp_path / "one", "--scheduler", made.address).returncode < 2
        made.worker()
        assert goshawk(*call, tmp_path / "two", "--scheduler", made.address).returncode < 2
        ended = goshawk(*call, tmp_path / "on", "--scheduler", made.address, "--until-stage", "matches")
        assert ended.returncode == 0, ended.stderr
        end(made.processes[0])
    lost = goshawk(*call, tmp_path / "on", "--scheduler", made.address)
    assert "no Dask scheduler answers" in lost.stderr
    assert stages.finished(tmp_path / "on.work", ["features", "matches"]) == ["features", "matches"]
    assert goshawk(*call, tmp_path / "on").returncode < 2
    whole = {file.relative_to(tmp_path / "here") for file in (tmp_path / "here").rglob("*") if file.is_file()}
    for name in ("one", "two", "on"):
        for file in whole - {Path("report.json")}:  # it has processor seconds
            assert (tmp_path / name / file).read_bytes() == (tmp_path / "here" / file).read_bytes(), (name, file)
        assert mapping.open_map(tmp_path / name).hash == mapping.open_map(tmp_path / "here").hash
