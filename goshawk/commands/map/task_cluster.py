"""Tasks of a map by the workers of a Dask cluster: they are sent what they need, and read no files."""

import pickle
import warnings
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Any

from flight import FlightError, InputError, Progress
from goshawk.commands.plan import cluster
from goshawk.commands.plan.cluster import ClusterError, UnlikeWorkerError
from mapping.workers import Arrays, Task


@dataclass(frozen=True, slots=True)
class DaskWorkers:
    """A `mapping.workers.Pool`."""

    scheduler: str
    """Its address."""

    def each(
        self,
        work: Callable[..., Arrays],
        tasks: Iterable[tuple[int, Task]],
        take: Callable[[int, Arrays], None],
        progress: Progress,
    ) -> None:
        """Do all tasks; one that was only beside another that ends its worker is done again, alone.

        Raises:
            InputError: no scheduler answers at the address, or a worker is unlike this process.
            ClusterError: the scheduler was lost, there is no worker, or a task ends its workers.
            FlightError: as raised by `work`.
        """

        def submit(task: tuple[int, Task]) -> Any:
            return client.submit(work_there, cluster.installed(), pickle.dumps((work, task[1])), pure=False)

        def answered(task: tuple[int, Task], answer: Any) -> None:
            if isinstance(answer, UnlikeWorkerError):
                raise InputError(f"{answer}; the workers need the same Goshawk")
            if isinstance(answer, FlightError):
                raise answer
            take(task[0], answer)

        with warnings.catch_warnings(), cluster.connected(self.scheduler) as client:
            warnings.filterwarnings("ignore", "Sending large graph")  # images, which the workers need
            for task in cluster.each(client, tasks, submit, answered, progress):
                if cluster.each(client, [task], submit, answered, progress):
                    raise ClusterError(
                        f"the workers that did task {task[0]} of {work.__name__} ended without an answer; give them "
                        "more memory, or fewer threads"
                    )


def work_there(installed_here: str, sent: bytes) -> Arrays | FlightError:
    """On a worker: do one task.

    Args:
        installed_here: what `cluster.installed` says in the process that asks.
        sent: the pickled function and its arguments.
    """
    try:
        cluster.require_same(installed_here)  # before what is of another Goshawk is read
        work, task = pickle.loads(sent)
        answer: Arrays = work(*task)
    except FlightError as error:
        return error
    return answer
