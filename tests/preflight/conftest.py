"""A short flight along a wall, as a formula: nothing here needs a planner or a map folder."""

import numpy as np
import pytest

import preflight
import vehicle
from flight import Trajectory
from preflight import draws


class Wall:
    """Free space on the far side of the plane y = -`away_m`."""

    def __init__(self, away_m: float) -> None:
        self.away_m = away_m

    def distance(self, points_world_m):
        return np.asarray(points_world_m)[:, 1] + self.away_m


def there_and_back(length_m: float = 4.0, duration_s: float = 2.0) -> Trajectory:
    """Along x and back, at rest at the ends and between."""
    smooth = np.array([0.0, 0.0, 0.0, 10.0, -15.0, 6.0]) / duration_s ** np.arange(6)
    coefficients = np.zeros((2, 4, 6))
    coefficients[:, 2, 0] = 1.5
    coefficients[0, 0] = length_m * smooth
    coefficients[1, 0] = -length_m * smooth
    coefficients[1, 0, 0] = length_m
    return Trajectory(np.full(2, duration_s), coefficients)


EXACT = preflight.Uncertainty(
    pose_delay_std_s=0.0, localization_std_m=0.0, heading_std_rad=0.0, map_scale_std_ratio=0.0, map_error_std_m=0.0,
    start_std_m=0.0, start_yaw_std_rad=0.0, rotor_wear_ratio=0.0, wind_spread_ratio=0.0, gust_spread_ratio=0.0,
)  # fmt: skip
"""Nothing drawn but noise."""


def exact_vehicle() -> vehicle.Vehicle:
    """The example, its parameters known."""
    drone = vehicle.example()
    for name, parameter in drone.parameters.items():
        if parameter.std > 0.0:
            drone = drone.with_value(name, parameter.value)
    return drone


@pytest.fixture(scope="session")
def drone() -> vehicle.Vehicle:
    return exact_vehicle()


@pytest.fixture(scope="session")
def form(drone) -> vehicle.Vehicle:
    return draws.flown_form(drone)


@pytest.fixture(scope="session")
def curve() -> Trajectory:
    return there_and_back()
