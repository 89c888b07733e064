"""The embedded controller on the ground: from poses to the collective force and body rates that an inner loop follows.

The controller is the C code of the vehicle. Of its attitude loop only the outer half is used: the rate at which its
torque would be nought, `w_reference + (kp / kd) error`, is what the inner loop of another firmware is asked for.
"""

from dataclasses import dataclass, replace

import numpy as np

from firmware_bridge.controller import Configuration, Controller, State
from firmware_bridge.offboard.poses import Poses
from firmware_bridge.offboard.prediction import Lags, Motion, Predictor
from firmware_bridge.words import reason_text
from flight import FloatArray, rotations

GAINS = {"kp_xy_1_s2": 9.0, "kd_xy_1_s": 5.0, "kp_z_1_s2": 9.0, "kd_z_1_s": 5.0, "obs_turn_rad_s2": 0.0,
         "att_kp_xy_1_s2": 220.0, "att_kd_xy_1_s": 22.0}  # fmt: skip
"""Where the inner loop is another firmware's: softer position loops, and torques are not ours to observe."""
_LEAD_S, _SHORTEST_S = 0.018, 1e-3
"""Low-pass of how the reference turns."""
STANDING = (State.DISARMED, State.ARMED, State.FAULT)


@dataclass(frozen=True, slots=True)
class Demand:
    """What the inner loop is asked for."""

    time_s: float
    force_n: float
    """Collective, along body z."""
    rate_body_rad_s: FloatArray
    """(3,)."""
    pose_time_s: float
    """Of the pose it rests on."""


class Tracker:
    """One vehicle; `tick` at 100 to 500 Hz."""

    def __init__(self, configuration: Configuration, poses: Poses, *, lags: Lags | None = None) -> None:
        values = configuration.parameters
        self.controller = Controller(configuration.with_values(**{**values, **GAINS}))
        self._poses, self._lags = poses, lags or Lags()
        parameters = self.controller.parameters()
        self.mass_kg, self.gravity_m_s2 = parameters["mass_kg"], parameters["gravity_m_s2"]
        self.predictor = Predictor(self.mass_kg, self.gravity_m_s2, self._lags)
        self._per_error = np.array(
            [parameters[f"att_kp_{a}_1_s2"] / parameters[f"att_kd_{a}_1_s"] for a in ("xy", "xy", "z")]
        )
        self._largest_rad_s = parameters["yaw_slew_rad_s"], parameters["tilt_slew_rad_s"]
        self._begin_s: float | None = None
        self._last_reference, self._last_s = np.zeros(3), 0.0
        self._turning = np.zeros(3)
        self.motion: Motion | None = None
        """As last estimated."""

    def listen(self, now_s: float) -> None:
        """Take in the poses that have come."""
        for pose in self._poses(now_s):
            self.predictor.pose(pose)

    @property
    def ready(self) -> bool:
        """Whether the vehicle could be armed now, by the poses."""
        return not self.unready

    @property
    def unready(self) -> str:
        """Why not, in words."""
        if self.motion is None:
            return "there is no pose"
        reason = self.controller.raw.arming_check()
        return reason_text(reason) if reason else ""

    @property
    def state(self) -> State:
        return self.controller.state

    def tick(self, now_s: float, *, battery_v: float = 0.0) -> Demand | None:
        """One step of the controller; None before the first pose.

        Args:
            battery_v: 0: not measured.
        """
        self.listen(now_s)
        if self.predictor.pose_time_s == -np.inf:
            return None
        if self._begin_s is None:
            self._begin_s = now_s - 1.0
        self.motion = motion = self.predictor.at(now_s)
        time_us = round((now_s - self._begin_s) * 1e6)
        felt = self.predictor.acceleration_world_m_s2(motion, motion.q_world_body)
        felt[2] += self.gravity_m_s2
        self.controller.tick(
            time_us,
            motion.row(),
            battery_v=battery_v,
            specific_force_body_m_s2=rotations.rotate(rotations.conjugate(motion.q_world_body), felt),
        )
        self.controller.raw.ground_alive(0)
        standing = self.state in STANDING
        self.predictor.on_ground = standing
        demand = Demand(now_s, 0.0, np.zeros(3), self.predictor.pose_time_s)
        if not standing:
            telemetry = self.controller.telemetry
            demand = replace(
                demand, force_n=float(telemetry["thrust_n"]), rate_body_rad_s=self._rate(motion, telemetry)
            )
        self.predictor.command(now_s, demand.force_n, demand.rate_body_rad_s)
        return demand

    def _rate(self, motion: Motion, telemetry: dict) -> FloatArray:
        """Body rate at which the attitude loop asks for no torque, led by the inner loop's lag."""
        wanted = np.asarray(telemetry["q_reference"], dtype=np.float64)
        error = rotations.log(rotations.multiply(rotations.conjugate(motion.q_world_body), wanted))
        reference = np.asarray(telemetry["rate_reference_rad_s"], dtype=np.float64)
        step_s = max(motion.time_s - self._last_s, _SHORTEST_S)
        turning = (reference - self._last_reference) / step_s
        self._last_reference, self._last_s = reference, motion.time_s
        self._turning += (1.0 - np.exp(-step_s / _LEAD_S)) * (turning - self._turning)
        rate = reference + self._lags.rate_s * self._turning + self._per_error * error
        yaw, tilt = self._largest_rad_s
        return np.clip(rate, [-tilt, -tilt, -yaw], [tilt, tilt, yaw])
