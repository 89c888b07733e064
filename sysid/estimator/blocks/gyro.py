"""Gyro: body rate at the nodes, with a constant bias and a delay per log."""

import numpy as np

from flight.rotations import FloatArray
from sysid.estimator.blocks.base import At, Block, Channel, Linear
from sysid.estimator.flights.clocks import GYRO as QUANTITY
from sysid.estimator.flights.clocks import delay_name, moved_reading
from sysid.estimator.flights.flight_data import Flight
from sysid.estimator.flights.sampling import Stretch
from sysid.estimator.trajectory.states import RATE


class Gyro(Block):
    """Measured less expected rate; zero at nodes where none was sampled."""

    name = "gyro"
    order = 4
    levels = ("rate_rad_s",)
    usual = (2e-2,)
    level_of_row = (0, 0, 0)
    channels = (Channel("rate", (0, 1, 2), "mrad/s", 1e3),)
    bias = tuple(f"gyro_bias_{axis}_rad_s" for axis in "xyz")
    bias_std = 0.1

    def read(self, stretch: Stretch) -> dict[str, FloatArray]:
        """Samples beside those of the pose; where nodes are the IMU's own, means about them."""
        if not stretch.with_pose:
            return {QUANTITY: stretch.around_nodes(QUANTITY)}
        used = stretch.options.use_rates and stretch.sampled(QUANTITY)
        return {QUANTITY: stretch.at_nodes(QUANTITY) if used else stretch.unmeasured(3)}

    def measured(self, flight: Flight) -> bool:
        return flight.has_gyro

    def residual(self, at: At) -> FloatArray:
        bias = at.values(self.bias_names(at.flight.log_index))
        moved = moved_reading(QUANTITY, at.flight, at.sensors, between=False)[0]
        return np.nan_to_num(at.flight.rate_body_rad_s + moved - at.states.rate_body_rad_s - bias)

    def linear(self, at: At) -> Linear:
        sampled = np.isfinite(at.flight.rate_body_rad_s).all(axis=1)
        by_rate = -np.eye(3) * sampled.reshape(-1, 1, 1)
        by_state = at.by_state(3, self.between)
        by_state[:, :, RATE] = by_rate
        slope = moved_reading(QUANTITY, at.flight, at.sensors, between=False)[1] * sampled.reshape(-1, 1)
        names = (*self.bias_names(at.flight.log_index), delay_name(QUANTITY, at.flight.log_index))
        return Linear(self.residual(at), (by_state,), np.concatenate([by_rate, slope[:, :, None]], axis=2), names)


BLOCK = Gyro()
