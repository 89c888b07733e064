"""Which things hang together, by pairs."""

import numpy as np


def groups(first: np.ndarray, second: np.ndarray, count: int) -> np.ndarray:
    """(count,) number of the group that each thing is in, from 0; pairs of things (n,) and (n,) are in one group."""
    from scipy.sparse import coo_array  # with its graphs a quarter of a second
    from scipy.sparse.csgraph import connected_components

    links = coo_array((np.ones(len(first)), (first, second)), shape=(count, count))
    return connected_components(links, directed=False)[1]
