"""The joint problem over all states and parameters, and its Gauss-Newton solver."""
