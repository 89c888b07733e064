"""Accelerometer: mean specific force over each interval, with a constant bias and a delay per log."""

from collections.abc import Sequence

import numpy as np

from flight import rotations
from flight.rotations import FloatArray
from sysid.estimator.blocks.base import At, Block, Channel, Linear
from sysid.estimator.flights.clocks import ACCELEROMETER as QUANTITY
from sysid.estimator.flights.clocks import delay_name, moved_reading
from sysid.estimator.flights.flight_data import Flight
from sysid.estimator.flights.sampling import Stretch
from sysid.estimator.trajectory.midpoint import Middle, rates_of_change
from sysid.estimator.trajectory.states import ATTITUDE, VELOCITY, States


class Accelerometer(Block):
    """What it read less what the states say; the noise is that of the mean over an interval."""

    name = "accelerometer"
    order = 5
    between = True
    levels = ("force_m_s2",)
    usual = (0.3,)
    level_of_row = (0, 0, 0)
    channels = (Channel("specific_force", (0, 1, 2), "m/s2"),)
    bias = tuple(f"accelerometer_bias_{axis}_m_s2" for axis in "xyz")
    bias_std = 0.3

    def read(self, stretch: Stretch) -> dict[str, FloatArray]:
        """Only without a pose, or when it is asked for."""
        wanted = stretch.options.use_accelerometer or not stretch.with_pose
        used = wanted and stretch.sampled(QUANTITY)
        return {QUANTITY: stretch.between_nodes(QUANTITY) if used else stretch.unmeasured(3, between=True)}

    def measured(self, flight: Flight) -> bool:
        return flight.has_accelerometer

    def residual(self, at: At) -> FloatArray:
        moved = moved_reading(QUANTITY, at.flight, at.sensors, between=True)[0]
        return residual(at.flight, at.states, at.mid, at.values(self.bias_names(at.flight.log_index))) + moved

    def linear(self, at: At) -> Linear:
        by_bias = np.broadcast_to(-np.eye(3), (len(at.mid.step_s), 3, 3))
        slope = moved_reading(QUANTITY, at.flight, at.sensors, between=True)[1]
        names = (*self.bias_names(at.flight.log_index), delay_name(QUANTITY, at.flight.log_index))
        by_shared = np.concatenate([by_bias, slope[:, :, None]], axis=2)
        return Linear(self.residual(at), jacobians(at.states, at.mid), by_shared, names)

    def updated(self, levels: FloatArray, ratio: FloatArray, flights: Sequence[Flight]) -> FloatArray:
        if not all(flight.has_pose for flight in flights):
            return levels  # without a pose nothing tells accelerometer noise from unmodelled force
        return super().updated(levels, ratio, flights)


BLOCK = Accelerometer()


def residual(flight: Flight, states: States, mid: Middle, bias_m_s2: FloatArray) -> FloatArray:
    """(k, 3) mean specific force measured over each interval, less what the states say."""
    return flight.specific_force_body_m_s2 - bias_m_s2 - rates_of_change(states, mid)[:, :3]


def jacobians(states: States, mid: Middle) -> tuple[FloatArray, FloatArray]:
    """Derivatives of `residual` by the state before and the state after, (k, 3, s)."""
    k, h = len(mid.step_s), mid.step_s[:, :, None]
    Rt = np.swapaxes(mid.R_world_body, 1, 2)
    hat_force = rotations.hat(rates_of_change(states, mid)[:, :3])
    quarter_turn = 0.125 * rotations.hat(mid.turn_rad)
    before, after = np.zeros((2, k, 3, states.size))
    before[:, :, VELOCITY], after[:, :, VELOCITY] = Rt / h, -Rt / h
    before[:, :, ATTITUDE] = -hat_force @ (0.5 * np.eye(3) - quarter_turn)
    after[:, :, ATTITUDE] = -hat_force @ (0.5 * np.eye(3) + quarter_turn)
    return before, after
