"""`goshawk plan batch --scheduler`: a Dask cluster whose parts fail."""

import contextlib
import json
import os
import pickle
import re
import signal
import subprocess
import sys
import threading
from collections.abc import Generator
from dataclasses import replace
from http.server import HTTPServer, SimpleHTTPRequestHandler
from pathlib import Path

import numpy as np
import pytest

import vehicle
from flight import Waypoints, project
from goshawk.commands.plan import batch_cluster, batch_mission
from goshawk.commands.plan import cluster as dask_cluster
from goshawk.demo import chain
from planner import PlanOptions
from tests import waiting
from tests.goshawk.dask_cluster import Cluster, cluster, end
from tests.goshawk.running import answer as goshawk

pytest.importorskip("distributed", reason="Dask is an optional engine")
LOOP = np.array([[0.8, 0.8, 1.0], [3.0, 2.0, 1.3], [5.2, 0.8, 1.0], [5.0, 3.4, 1.6]])


@pytest.fixture
def folder(pillar_map: Path, tmp_path: Path) -> Path:
    """A project with a map, a vehicle and a folder for missions; and one for the cluster."""
    os.symlink(pillar_map, tmp_path / "map")
    vehicle.save(tmp_path / "vehicle.toml", chain.vehicles()[1])
    (tmp_path / "missions").mkdir()
    (tmp_path / "dask").mkdir()
    return tmp_path


def ask(folder: Path, *names: str) -> None:
    """Missions of these names, each with its own waypoints."""
    for i, name in enumerate(names):
        points = LOOP + np.array([0.0, 0.0, 0.005 * i])
        project.save_waypoints(folder / "missions" / f"{name}.json", Waypoints(points, np.full(len(points), np.nan)))


def call(folder: Path, out: str, *options: object) -> tuple[object, ...]:
    where = ("--map", folder / "map", "--vehicle", folder / "vehicle.toml", "--out", folder / out)
    return ("plan", "batch", folder / "missions", *where, *options)


def results(folder: Path, out: str) -> list[dict]:
    """The rows in the results, without what differs from run to run."""
    rows = json.loads((folder / out / "results.json").read_text())["missions"]
    return [{name: cell for name, cell in row.items() if name != "cpu_s"} for row in rows]


def by_one_process(folder: Path) -> list[dict]:
    assert goshawk(*call(folder, "one")).returncode == 0
    return results(folder, "one")


def trajectories(folder: Path, out: str) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in (folder / out / "trajectories").iterdir()}


@contextlib.contextmanager
def running(folder: Path, made: Cluster) -> Generator[subprocess.Popen[str]]:
    """The command as a program of its own."""
    command = [sys.executable, "-m", "goshawk", *map(str, call(folder, "out", "--scheduler", made.address))]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as program:
        try:
            yield program
        finally:
            program.kill()


def ended(program: subprocess.Popen[str]) -> tuple[int, str]:
    """Exit code, and what was written to stderr beside the progress."""
    _, errors = program.communicate(timeout=waiting.PATIENCE_S)
    return program.returncode, "\n".join(line for line in errors.split("\n") if line and not line.startswith("  ["))


def test_a_cluster_plans_what_one_process_plans(folder, monkeypatch):
    ask(folder, "a", "b")
    with cluster(folder / "dask", 1, "--no-nanny") as made:
        monkeypatch.chdir(folder)  # workers are elsewhere: relative paths are this process's
        relative = ("--map", "map", "--vehicle", "vehicle.toml", "--out", "out", "--scheduler", made.address)
        got = goshawk("plan", "batch", "missions", *relative)
    assert got.returncode == 0, got.stderr
    assert results(folder, "out") == by_one_process(folder)
    assert trajectories(folder, "out") == trajectories(folder, "one")


def test_a_mission_whose_worker_is_killed_is_planned_by_another(folder):
    ask(folder, "a", "held", "z")
    with cluster(folder / "dask", 2, "--no-nanny") as made, running(folder, made) as program:
        killed = made.planner_of("held")
        os.kill(killed, signal.SIGKILL)
        waiting.until(lambda: made.begun().count("held") == 2, "the second attempt")
        made.let_go()
        assert ended(program) == (0, "")
        assert made.planner_of("held") != killed
    assert results(folder, "out") == by_one_process(folder)


def test_a_mission_that_kills_its_worker_is_a_crashed_row_and_those_beside_it_are_planned(folder):
    ask(folder, "a", "b", "poison")
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("DASK_DISTRIBUTED__SCHEDULER__ALLOWED_FAILURES", "0")  # else it kills eight of them
        with cluster(folder / "dask", 1, "--nthreads", 3) as made:
            got = goshawk(*call(folder, "out", "--scheduler", made.address))
    assert got.returncode == 1, got.stderr
    rows = results(folder, "out")
    assert [row["status"] for row in rows] == ["planned", "planned", "crashed"]
    assert "without an answer" in rows[-1]["reason"]
    (folder / "missions" / "poison.json").unlink()
    assert rows[:-1] == by_one_process(folder)


def test_a_lost_scheduler_ends_the_batch_with_one_sentence_and_the_same_command_goes_on(folder):
    ask(folder, "a", "b", "held")
    with cluster(folder / "dask") as made:
        with running(folder, made) as program:
            made.planner_of("held")
            end(made.processes[0])
            code, errors = ended(program)
        assert code == 1
        assert len(errors.splitlines()) == 1
        assert f"the Dask scheduler at {made.address} was lost; start it and its workers again" in errors
        assert f"2 of 3 missions are recorded in {folder / 'out'}, and the same command plans the others" in errors
        assert [row["name"] for row in results(folder, "out")] == ["a", "b"]
        made.let_go()
        made.scheduler()
        made.worker()
        with running(folder, made) as program:
            assert ended(program) == (0, "")
    assert made.begun().count("a") == made.begun().count("b") == 1
    assert results(folder, "out") == by_one_process(folder)


def test_after_ctrl_c_what_a_worker_had_begun_is_finished_and_the_rest_is_left(folder):
    ask(folder, "a", "held", "z")
    with cluster(folder / "dask", 1, "--no-nanny") as made, running(folder, made) as program:
        made.planner_of("held")
        program.send_signal(signal.SIGINT)
        made.let_go()
        assert ended(program) == (130, "goshawk: stopped; nothing half-written was left behind")
        assert "z" not in made.begun()
    assert [row["name"] for row in results(folder, "out")] == ["a", "held"]


def test_a_cluster_without_workers_is_named_with_the_way_out(folder, monkeypatch):
    monkeypatch.setattr(dask_cluster, "WORKER_S", 0.5)
    ask(folder, "a")
    with cluster(folder / "dask", 0) as made:
        got = goshawk(*call(folder, "out", "--scheduler", made.address))
    assert got.returncode == 1
    assert f"no worker is connected to {made.address}" in got.stderr
    assert f"start `dask worker {made.address}`" in got.stderr
    assert "0 of 1 missions" in got.stderr


def test_a_worker_with_another_goshawk_is_refused(folder, tmp_path):
    ask(folder, "a")
    other = tmp_path / "site" / "goshawk-9.9.dist-info"
    other.mkdir(parents=True)
    (other / "METADATA").write_text("Metadata-Version: 2.1\nName: goshawk\nVersion: 9.9\n")
    with cluster(folder / "dask", 0) as made:
        made.worker("--no-nanny", PYTHONPATH=str(tmp_path / "site"))
        got = goshawk(*call(folder, "out", "--scheduler", made.address))
    assert got.returncode == 2
    assert f"has Goshawk 9.9 (sources {dask_cluster.installed()[-9:-1]}), not {dask_cluster.installed()}" in got.stderr


@pytest.mark.parametrize("missing", ["missions/a.json", "map", "vehicle.toml"])
def test_a_file_that_a_worker_does_not_see_is_no_answer_about_the_mission(folder, missing):
    """What runs on a worker runs here, and a file is taken away before it looks."""
    ask(folder, "a")
    job = batch_mission.Job(folder / "map", folder / "vehicle.toml", PlanOptions(), folder / "out")
    job = replace(job, inputs=batch_mission.inputs_hash(job))
    path = folder / "missions" / "a.json"
    asked = (dask_cluster.installed(), pickle.dumps(job), path, batch_mission.key_of(path, job.inputs))
    (folder / missing).rename(folder / "elsewhere")
    with pytest.raises(dask_cluster.UnlikeWorkerError, match=missing):
        batch_cluster.work_there(*asked)


@pytest.mark.parametrize(
    ("address", "why"),
    [
        ("nonsense", "missing port number"),
        ("tcp://127.0.0.1:1", "no answer|timed out"),
        ("tpc://127.0.0.1:8786", "unknown address scheme"),
        ("tls://127.0.0.1:8786", "TLS"),
        ("ucx://127.0.0.1:8786", "."),
        ("http server", "no answer"),
        ("tcp://127.0.0.1:abc", "invalid literal"),
    ],
)
def test_an_address_without_a_scheduler_is_named(folder, address, why, monkeypatch):
    monkeypatch.setattr(dask_cluster, "CONNECT_S", 1.0)
    ask(folder, "a")
    with HTTPServer(("127.0.0.1", 0), SimpleHTTPRequestHandler) as server:
        threading.Thread(target=server.serve_forever, daemon=True).start()
        address = f"tcp://127.0.0.1:{server.server_port}" if address == "http server" else address
        got = goshawk(*call(folder, "out", "--scheduler", address))
        server.shutdown()
    assert got.returncode == 2, got.stderr
    assert re.search(f"--scheduler {address}: no Dask scheduler answers there .*({why})", got.stderr, re.IGNORECASE)
    assert "tcp://192.168.1.10:8786" in got.stderr


def test_without_dask_the_extra_is_named(folder, monkeypatch):
    monkeypatch.setitem(sys.modules, "distributed", None)
    ask(folder, "a")
    got = goshawk(*call(folder, "out", "--scheduler", "tcp://127.0.0.1:1"))
    assert got.returncode == 2
    assert 'pip install "goshawk[cluster]"' in got.stderr


@pytest.mark.slow
def test_sixty_one_missions_survive_killed_workers_a_killed_scheduler_and_a_mission_that_kills(monkeypatch):
    monkeypatch.syspath_prepend(Path(__file__).parents[4] / "benchmarks")
    import cluster as benchmark

    rows = benchmark.rows(61)
    assert [row.value for row in rows] == [61.0] * 6
    assert all(row.ok and row.peers.get("planned", 61) >= 50 for row in rows)
