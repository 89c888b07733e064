"""Places to fly in, known in closed form."""

import numpy as np
import pytest

import vehicle
from esdf import solids
from flight import Waypoints


@pytest.fixture(scope="session")
def drone() -> vehicle.Vehicle:
    return vehicle.example("rigter2019")


@pytest.fixture(scope="session")
def open_sky() -> solids.Scene:
    """Nothing but a small ball far away."""
    return solids.Scene([solids.Sphere((1000.0, 0.0, 0.0), 1.0)])


@pytest.fixture(scope="session")
def pillar() -> solids.Scene:
    """One thick pillar at the origin, floor and ceiling and walls far round it."""
    return solids.Scene([solids.Room((-8.0, -8.0, 0.0), (8.0, 8.0, 3.0)), solids.Cylinder((0.0, 0.0, 1.5), 0.6, 3.0)])


@pytest.fixture(scope="session")
def two_rooms() -> solids.Scene:
    """A wall at x = 0 with a doorway 1 m wide and 2.1 m high at y = 2."""
    return solids.Scene(
        [
            solids.Room((-5.0, -4.0, 0.0), (5.0, 4.0, 3.0)),
            solids.Box((-0.1, -4.0, 0.0), (0.1, 1.5, 3.0)),
            solids.Box((-0.1, 2.5, 0.0), (0.1, 4.0, 3.0)),
            solids.Box((-0.1, 1.4, 2.1), (0.1, 2.6, 3.0)),
        ]
    )


@pytest.fixture
def through():
    """Waypoints without headings."""

    def make(*points: tuple[float, float, float]) -> Waypoints:
        return Waypoints(np.array(points), np.full(len(points), np.nan))

    return make
