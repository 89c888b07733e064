"""A new sensor is one block: a barometer is read, fitted, and reported."""

from collections.abc import Iterator

import numpy as np
import pytest

import sysid
from flight import FlightLog
from sysid.estimator.blocks.base import At, Block, Channel, Linear
from sysid.estimator.blocks.catalogue import BLOCKS
from sysid.estimator.flights.flight_data import Flight
from sysid.estimator.flights.sampling import Stretch
from sysid.estimator.trajectory.states import POSITION
from tests.sysid.flying import Truth

QUANTITY = "pressure_height_m"


class Barometer(Block):
    """Height at every node, with a constant bias per log."""

    name = "barometer"
    levels = ("pressure_height_m",)
    usual = (1.0,)
    level_of_row = (0,)
    channels = (Channel("pressure_height", (0,), "m"),)
    bias = ("barometer_bias_m",)
    bias_std = 100.0

    def read(self, stretch: Stretch) -> dict[str, np.ndarray]:
        columns = stretch.log.columns
        return {QUANTITY: columns[QUANTITY][stretch.nodes, None]} if QUANTITY in columns else {}

    def measured(self, flight: Flight) -> bool:
        return QUANTITY in flight.readings

    def residual(self, at: At) -> np.ndarray:
        bias = at.values(self.bias_names(at.flight.log_index))
        return at.flight.readings[QUANTITY] - at.states.position_world_m[:, 2:] - bias

    def linear(self, at: At) -> Linear:
        by_state = at.by_state(1, self.between)
        by_state[:, 0, POSITION.stop - 1] = -1.0
        names = self.bias_names(at.flight.log_index)
        return Linear(self.residual(at), (by_state,), np.full((len(at.flight), 1, 1), -1.0), names)


@pytest.fixture
def barometer() -> Iterator[None]:
    BLOCKS.append(Barometer())
    yield
    BLOCKS.pop()


def _with_height(log: FlightLog, bias_m: float, rng: np.random.Generator) -> FlightLog:
    height_m = log.vector("position_world_m")[:, 2] + bias_m + 0.2 * rng.standard_normal(len(log))
    return FlightLog({**log.columns, QUANTITY: height_m}, log.metadata)


@pytest.mark.usefixtures("barometer")
def test_a_new_sensor_is_one_block(flying, truth):
    rng = np.random.default_rng(2)
    logs = flying.fly(Truth(), flying.paper_flights(rng), 3, duration_s=6.0, rng=rng, rate_hz=100.0)
    logs[:2] = [_with_height(log, bias_m, rng) for log, bias_m in zip(logs, (2.5, -1.0), strict=False)]
    free = ("thrust_bem.k1_n_s2",)
    fit = sysid.identify(logs, truth, sysid.Options(free=free, pose_sensor=False, gusts="white"))
    assert fit.unknowns.bias == ("barometer_bias_m[0]", "barometer_bias_m[1]")
    offset_m = truth.value("pose_sensor_z_m")  # the height that was logged is the pose sensor's
    found = [fit.solution.point.sensors[name] - offset_m for name in fit.unknowns.bias]
    assert found == pytest.approx([2.5, -1.0], abs=0.03)  # three standard errors of 600 samples
    described = fit.as_dict()
    assert described["noise"][QUANTITY] == pytest.approx(0.2, rel=0.06)
    assert described["residuals"]["pressure_height"]["rms"] == pytest.approx(1.0, abs=0.05)
