"""Their ladder, flown in simulation: each compensation helps where its physics acts."""

import numpy as np
import pytest

from goshawk.paper import curves, ladder, theirs


def test_the_courses_are_as_fast_as_theirs():
    for course, speed_m_s in zip(ladder.courses(), (8.5, 3.1), strict=True):
        times_s = np.linspace(0.0, course.trajectory.duration_s, 4000)
        speeds = np.linalg.norm(course.trajectory.position(times_s, 1), axis=1)
        assert speeds.max() == pytest.approx(speed_m_s, rel=0.01)
    level = ladder.courses()[0].trajectory
    times_s = np.linspace(0.0, level.duration_s, 4000)
    assert np.linalg.norm(level.position(times_s, 2), axis=1).max() == pytest.approx(10.8, rel=0.02)


def test_each_of_their_figures_stands_by_its_own_rung():
    level, vertical = ladder.courses()
    assert tuple(level.flown_cm.values()) == theirs.LEVEL_CM
    assert list(vertical.flown_cm) == [rung.name for rung in ladder.THEIRS]
    assert ladder.DELIVERED.name not in level.flown_cm
    assert ladder.general().flown_cm == {ladder.THEIRS[-1].name: theirs.GENERAL_CM}


def test_a_run_is_repeated_by_its_number():
    short = curves.vertical(turns=2)
    first, again, other = (ladder.tracking_cm(short, ladder.DELIVERED, seed) for seed in (1, 1, 2))
    assert first == again
    assert first != other


def test_a_figure_of_theirs_is_drawn_at_its_own_rung_wherever_that_stands():
    rungs = (ladder.DELIVERED, ladder.THEIRS[2], ladder.THEIRS[0])
    shown = {(course.name, rung.name): np.ones(2) for course in ladder.courses() for rung in rungs}
    for axes, course in zip(ladder.drawn(shown, rungs).axes, ladder.courses(), strict=True):
        (line,) = (line for line in axes.lines if line.get_label() == "paper, flown")
        named = {rungs[int(i)].name: cm for i, cm in zip(*line.get_data(), strict=True)}
        assert named == {rung.name: course.flown_cm[rung.name] for rung in rungs[1:]}


@pytest.mark.slow
def test_the_rungs_of_the_papers_ladder_lower_the_error_where_their_physics_acts():
    level, vertical = ladder.courses()
    plain, drag, thrust, _, quick, across, delivered = ladder.RUNGS
    courses = ladder.courses()
    error = {(c.name, r.name): ladder.tracking_cm(c.trajectory, r, seed=1) for c in courses for r in ladder.RUNGS}
    assert error[level.name, drag.name] < 0.4 * error[level.name, plain.name]
    assert error[level.name, across.name] < 0.7 * error[level.name, thrust.name]
    assert error[vertical.name, drag.name] < 0.9 * error[vertical.name, plain.name]
    assert error[vertical.name, thrust.name] < 0.9 * error[vertical.name, drag.name]
    assert error[vertical.name, quick.name] < 0.9 * error[vertical.name, thrust.name]
    assert error[vertical.name, delivered.name] < 0.8 * error[vertical.name, thrust.name]
