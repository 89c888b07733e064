"""Processes of the station: forked from one that has imported what they need, so that they begin in milliseconds.

A new interpreter spends .7 s of CPU on imports, after each cancelled plan and before each job. The server starts with
the first of them, and ends with the station, however that died.
"""

import multiprocessing
from collections.abc import Callable
from multiprocessing import connection
from typing import Any

_CONTEXT = multiprocessing.get_context("forkserver")
_CONTEXT.set_forkserver_preload(["__main__", "gcs_web.planning.planning", "sysid"])


def begin(main: Callable[..., None], *arguments: object, daemon: bool) -> tuple[Any, connection.Connection]:
    """A process that runs `main(its end of the pipe, *arguments)`, and our end.

    Args:
        main: a module-level function; its arguments can be pickled. Environment variables are those of the first time.
        daemon: whether it is ended with this process where that ends in order; then it may have no children of its own.
    """
    ours, theirs = _CONTEXT.Pipe()
    process = _CONTEXT.Process(target=main, args=(theirs, *arguments), daemon=daemon)
    process.start()
    theirs.close()
    return process, ours
