"""Tasks of a map by the workers of a Dask cluster: they are sent what they need, and read no files."""

import pickle
import socket
import warnings
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Any

from flight import FlightError, InputError, Progress
from goshawk.commands.plan import cluster
from goshawk.commands.plan.cluster import ClusterError, UnlikeWorkerError
from mapping import stages
from mapping.workers import Arrays, Task


@dataclass(frozen=True, slots=True)
class DaskWorkers:
    """A `mapping.workers.Pool`."""

    scheduler: str
    """Its address."""

    def require_scheduler(self) -> None:
        """Check the address before any long work.

        Raises:
            InputError: no scheduler answers there.
            ModuleNotFoundError: Dask is not installed.
        """
        with cluster.connected(self.scheduler):
            pass

    def each(
        self,
        work: Callable[..., Arrays],
        tasks: Iterable[tuple[int, Task]],
        take: Callable[[int, Arrays], None],
        stage: str,
        progress: Progress,
    ) -> None:
        """Do all tasks; one that was only beside another that ends its worker is done again, alone.

        Raises:
            InputError: no scheduler answers at the address, or a worker is unlike this process.
            ClusterError: the scheduler was lost, there is no worker, or a task fails or ends its workers.
            FlightError: as raised by `work`.
        """

        here = (cluster.installed(), stages.libraries(), stages.program())

        def submit(task: tuple[int, Task]) -> Any:
            return client.submit(work_there, here, pickle.dumps((work, task[1])), pure=False)

        def answered(task: tuple[int, Task], answer: Any) -> None:
            if isinstance(answer, UnlikeWorkerError):
                raise InputError(f"{answer}; the workers need the same Goshawk and libraries")
            if isinstance(answer, FlightError):
                raise answer
            take(task[0], answer)

        with warnings.catch_warnings(), cluster.connected(self.scheduler) as client:
            warnings.filterwarnings("ignore", "Sending large graph")  # images, which the workers need
            for task in cluster.each(client, tasks, submit, answered, progress):
                if cluster.each(client, [task], submit, answered, progress):
                    raise ClusterError(
                        f"the workers that did task {task[0] + 1} of {stage} ended without an answer; give them more "
                        "memory, or fewer threads"
                    )


Program = tuple[str, dict[str, str], bytes]
"""What an answer depends on beside its task: `cluster.installed`, `stages.libraries` and `stages.program`."""


def work_there(asking: Program, sent: bytes) -> Arrays | FlightError:
    """On a worker: do one task.

    Args:
        asking: of the process that asks.
        sent: the pickled function and its arguments.
    """
    try:
        _require_same(*asking)  # before what is of another Goshawk is read
        work, task = pickle.loads(sent)
        answer: Arrays = work(*task)
    except FlightError as error:
        return error
    except MemoryError as error:
        return ClusterError(f"{_whose(error)}; give the workers more memory, or fewer threads")
    except Exception as error:
        return ClusterError(_whose(error))
    return answer


def _whose(error: Exception) -> str:
    return f"a task failed on the worker on {socket.gethostname()}: {type(error).__name__}: {error}"


def _require_same(installed: str, libraries: dict[str, str], program: bytes) -> None:
    """
    Raises:
        UnlikeWorkerError: this process would give other answers than the one that asks.
    """
    cluster.require_same(installed)
    mine, host = stages.libraries(), socket.gethostname()
    for name in sorted(mine.keys() | libraries.keys()):
        if mine.get(name) != libraries.get(name):
            has, wants = (versions.get(name, "none") for versions in (mine, libraries))
            raise UnlikeWorkerError(f"the worker on {host} has {name} {has}, not {wants}")
    if stages.program() != program:
        raise UnlikeWorkerError(f"the worker on {host} has another build of these sources: install one wheel on each")
