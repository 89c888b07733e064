"""The command line, and the demo that runs every package once."""

import os

# Our matrices are small or banded; BLAS threads only spin (nine times the CPU in the planner, measured). Read by
# OpenBLAS when NumPy is first imported, so it is set here, before anything else.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
