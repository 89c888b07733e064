"""Path search by OMPL's sampling planners, as options beside the grid search; seeded, so that a search can be repeated.

A motion is checked exactly (`space.check_lines`), not at samples, so every line of the answer keeps the clearance. The
search ends after a number of checked motions rather than at a time: the same seed gives the same path on any machine.
"""

from typing import Any

import numpy as np

from flight import FloatArray
from planner.request import space
from planner.route import search

SAMPLERS = {"rrt_star": "RRTstar", "informed_rrt_star": "InformedRRTstar", "bit_star": "BITstar", "aorrtc": "AORRTC"}
"""OMPL's class for each name: RRT* (Karaman and Frazzoli 2011), InformedRRT* (Gammell et al. 2014), BIT* (Gammell et
al. 2015), AORRTC (Wilson et al. 2025)."""


def route(
    field: space.DistanceField,
    start: FloatArray,
    goal: FloatArray,
    required_m: float,
    *,
    sampler: str,
    margin_m: float,
    checks: int,
    seed: int,
) -> FloatArray | None:
    """Points (m, 3) from start to goal whose straight lines all keep `required_m`; None if none was found.

    Args:
        sampler: the name of one of OMPL's classes, a value of `SAMPLERS`.
        margin_m: how far round the two points is searched.
        checks: motions that may be checked; more find shorter ways.
        seed: of the random numbers; at least 1.
    """
    import ompl.base as ob
    import ompl.geometric as og
    import ompl.util as ou

    ou.setLogLevel(ou.LOG_NONE)
    ou.RNG.setSeed(seed)
    low, high = search.region(field, np.stack([start, goal]), margin_m)
    state_space = ob.RealVectorStateSpace(3)
    bounds = ob.RealVectorBounds(3)
    for axis in range(3):
        bounds.setLow(axis, float(low[axis]))
        bounds.setHigh(axis, float(high[axis]))
    state_space.setBounds(bounds)
    information = ob.SpaceInformation(state_space)

    class Free(ob.StateValidityChecker):
        def isValid(self, state: Any) -> bool:
            return bool(space.distance(field, _point(state)[None])[0] >= required_m)

    class Motion(ob.MotionValidator):
        count = 0

        def checkMotion(self, first: Any, last: Any) -> bool:
            self.count += 1
            return space.check_lines(field, _point(first)[None], _point(last)[None], required_m)[0].free

    free, motion = Free(information), Motion(information)
    information.setStateValidityChecker(free)
    information.setMotionValidator(motion)
    information.setup()
    problem = ob.ProblemDefinition(information)
    problem.setStartAndGoalStates(_state(state_space, start), _state(state_space, goal))
    problem.setOptimizationObjective(ob.PathLengthOptimizationObjective(information))
    planner = getattr(og, sampler)(information)
    planner.setProblemDefinition(problem)
    planner.setup()
    planner.solve(ob.PlannerTerminationCondition(lambda: motion.count >= checks))
    if not problem.hasExactSolution():
        return None
    path: Any = problem.getSolutionPath()
    points = np.array([_point(path.getState(i)) for i in range(path.getStateCount())])
    points[0], points[-1] = start, goal
    return search.shortcut(points, field, required_m, required_m + 0.05)


def _point(state: Any) -> FloatArray:
    return np.array([state[0], state[1], state[2]])


def _state(state_space: Any, point: FloatArray) -> Any:
    state = state_space.allocState()
    for axis in range(3):
        state[axis] = float(point[axis])
    return state
