"""How fast crazyflow flies; run by an interpreter that has it:

    python benchmarks/crazyflow_steps.py WORLDS STEPS

Prints its closed-loop steps per CPU second of all threads: physics and state controller, 500 Hz, without compiling.
crazyflow is no dependency of ours: JAX and MuJoCo come with it. So this file imports nothing of Goshawk.
"""

import sys
import time
from importlib import import_module

import numpy as np


def rate(worlds: int, steps: int) -> float:
    """World steps per CPU second."""
    sim = import_module("crazyflow.sim").Sim(
        n_worlds=worlds, drone="cf21B_500", dynamics="first_principles", control="state", freq=500
    )
    sim.reset()
    asked = np.zeros((worlds, 1, 16))
    asked[:, :, 2], asked[:, :, 12] = 1.0, 1.0
    sim.state_control(asked)
    sim.step(steps)
    _ready(sim)
    before_s = time.process_time()
    sim.step(steps)
    _ready(sim)
    return worlds * steps / (time.process_time() - before_s)


def _ready(sim) -> None:
    np.asarray(sim.data.states.pos)


if __name__ == "__main__":
    print(rate(int(sys.argv[1]), int(sys.argv[2])))
