"""A short trajectory, a SITL vehicle to send it to, and a key."""

from collections.abc import Callable, Iterator
from contextlib import ExitStack
from types import SimpleNamespace

import numpy as np
import pytest

import vehicle
from firmware_bridge.link import Link, connect
from firmware_bridge.sitl_vehicle import SitlVehicle
from flight import Trajectory, TrajectoryFile
from flight.trajectory import fingerprint, sealed
from vehicle import simulate

KEY = bytes(range(32))


def hops(segments: int, *, duration_s: float = 1.2, seed: int = 0) -> Trajectory:
    """Septic steps between random points at 1 m height, at rest at each of them."""
    rng = np.random.default_rng(seed)
    pieces = np.zeros((segments, 4, 8))
    here = np.array([0.0, 0.0, 1.0, 0.0])
    for piece in pieces:
        there = np.array([*rng.uniform(-0.4, 0.4, 2), 1.0, rng.uniform(-0.5, 0.5)])
        piece[:, 0] = here
        piece[:, 4:] = (there - here)[:, None] * np.array([35.0, -84.0, 70.0, -20.0]) / duration_s ** np.arange(4, 8)
        here = there
    return Trajectory(np.full(segments, duration_s), pieces)


def plan_file(segments: int = 3, *, name: str = "hops", seed: int = 0, checked: bool = True) -> TrajectoryFile:
    path = hops(segments, seed=seed)
    item = TrajectoryFile(
        trajectory=path,
        name=name,
        map_hash="ab" * 32,
        vehicle_hash="cd" * 32,
        waypoints_world_m=np.zeros((2, 3)),
        check={"passed": checked, "trajectory_hash": fingerprint(path)},
    )
    return sealed(item)


@pytest.fixture(scope="session")
def plans() -> SimpleNamespace:
    """`file(segments, name=, seed=, checked=)` and `key`."""
    return SimpleNamespace(file=plan_file, key=KEY)


@pytest.fixture
def serve() -> Iterator[Callable[..., SitlVehicle]]:
    """`serve(**options)` starts a SITL vehicle that stands on the floor."""
    truth = vehicle.example("rigter2019")
    with ExitStack() as stack:

        def start(*, key: bytes | None = KEY, **options) -> SitlVehicle:
            plant = simulate.Plant(truth, simulate.State(), ground_m=0.0)
            return stack.enter_context(SitlVehicle(plant, {}, key=key, **options))

        yield start


@pytest.fixture
def dial() -> Iterator[Callable[..., Link]]:
    """`dial(served, **options)` connects a ground station."""
    with ExitStack() as stack:

        def start(served: SitlVehicle, **options) -> Link:
            return stack.enter_context(connect(served.url, **({"key": KEY} | options)))

        yield start
