"""Processes that begin at once."""

import os
import signal
import sys
from multiprocessing import connection, forkserver

import pytest

from gcs_web.jobs import forked


def tell(pipe: connection.Connection, name: str) -> None:
    imported = name in sys.modules
    pipe.send((imported, os.getcwd(), os.getppid()))
    pipe.recv()


def told(process, pipe):
    answer = pipe.recv()
    pipe.send("go")
    process.join()
    assert process.exitcode == 0
    return answer


@pytest.mark.parametrize("name", ["planner", "sysid"])
def test_a_process_finds_imported_what_plans_and_jobs_need_in_the_folder_of_who_began_it(name, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    imported, folder, parent = told(*forked.begin(tell, name, daemon=True))
    assert imported
    assert folder == str(tmp_path)
    assert parent != os.getpid()  # forked by the server, not started by us


def test_after_its_server_was_killed_what_runs_goes_on_and_another_can_begin():
    first = forked.begin(tell, "planner", daemon=True)
    server = forkserver._forkserver._forkserver_pid  # type: ignore[attr-defined]
    os.kill(server, signal.SIGKILL)
    os.waitid(os.P_PID, server, os.WEXITED | os.WNOWAIT)
    second = forked.begin(tell, "planner", daemon=True)
    assert told(*second)[0]
    first[1].recv()  # it had lived on
    first[1].send("go")
