"""The command line, and the demo that runs every package once."""

import os

# Our matrices are small or banded; BLAS threads only spin (nine times the CPU in the planner, measured). Read by
# OpenBLAS when NumPy is first imported, so it is set here, before anything else.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

from goshawk import installation  # imports none of ours

__version__: str
"""Of the installed distribution; looked up when asked for."""

installation.require_own_packages()


def __getattr__(name: str) -> str:
    if name == "__version__":
        return installation.version()
    raise AttributeError(f"module 'goshawk' has no attribute {name!r}")
