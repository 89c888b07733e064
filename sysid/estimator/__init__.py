"""Vehicle and states from flights: the joint problem, its solver, its results."""
