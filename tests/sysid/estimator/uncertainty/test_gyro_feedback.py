"""How far a gyro's clock may be off because a controller answers its noise, by the bound and by the log's own clock."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from sysid.estimator.blocks.gyro import BLOCK as GYRO
from sysid.estimator.flights.clocks import GYRO as QUANTITY
from sysid.estimator.flights.clocks import PRIOR_S, delay_name
from sysid.estimator.uncertainty import gyro_feedback
from sysid.logs.checks.clocks import Offset

NAME = delay_name(QUANTITY, 0)


def bias_s(turned_rad_s2: float, read: Offset | None, fitted_s: float = 0.0) -> float:
    """Of one flight whose gyro has noise of 0.1 rad/s; everything else of its fit must stay zero."""
    stream: Any = SimpleNamespace(slope=lambda time_s: np.full((len(time_s), 3), turned_rad_s2 / np.sqrt(3.0)))
    flight: Any = SimpleNamespace(log_index=0, streams={QUANTITY: stream}, time_s=np.arange(5.0), gyro_clock=read)
    unknowns: Any = SimpleNamespace(size=2, delay=(NAME,), names=("mass_kg", NAME))
    solution: Any = SimpleNamespace(
        noise=SimpleNamespace(levels={GYRO.name: (0.1,)}), point=SimpleNamespace(sensors={NAME: fitted_s})
    )
    other, own = gyro_feedback.biases_s([flight], unknowns, solution, np.array([0.0, 1e-4]))
    assert other == 0.0
    return own


@pytest.mark.parametrize("read", [None, Offset(0.0, np.inf, 0.5)])
def test_where_the_log_shows_no_clock_what_the_flight_turned_bounds_it(read: Offset | None):
    assert bias_s(10.0, read) == pytest.approx(gyro_feedback.LOOP_RAD_S * 0.1**2 / 10.0**2)


@pytest.mark.parametrize("turned_rad_s2", [0.0, 1e-3, 1.0])
def test_of_a_flight_that_hardly_turns_no_clock_is_less_known_than_before_it(turned_rad_s2: float):
    """Its error moves all that moves with the clock: without this inertias of a hover were off by any amount."""
    assert bias_s(turned_rad_s2, None) == PRIOR_S


def test_the_clock_of_the_log_bounds_it_where_that_is_closer():
    assert bias_s(1.0, Offset(0.0, 5e-4, 0.9)) == pytest.approx(5e-4)
    apart = bias_s(1.0, Offset(0.0, 5e-4, 0.9), fitted_s=5e-3)
    assert 4.9e-3 < apart < 5.1e-3
