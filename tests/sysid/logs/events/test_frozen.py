"""A value that repeats is frozen only where it moves by many of its smallest steps before and after."""

import numpy as np
import pytest

from sysid.logs.events import frozen

REPEATS = 40
STEP_M = 0.01
"""Of a coarse recorder."""


@pytest.mark.parametrize(("steps", "moves"), [(0, False), (2, False), (7, False), (8, True), (30, True)])
@pytest.mark.parametrize("reverse", [False, True])
def test_a_coarse_value_must_move_by_eight_steps_on_both_sides_of_a_run(steps, moves, reverse):
    far = STEP_M * np.round(np.linspace(0.0, 30.0, REPEATS + 1))
    near = STEP_M * np.round(np.linspace(0.0, steps, REPEATS + 1))
    before, after = (near[::-1], far) if reverse else (far[::-1], near)
    values = np.concatenate([before, np.zeros(REPEATS), after[1:]])[:, None] + 1.0
    assert frozen._moves_around(values, REPEATS, 2 * REPEATS) is moves
