"""The embedded controller on the ground: from poses to the collective force and body rates that an inner loop follows.

The controller is the C code of the vehicle. Of its attitude loop only the outer half is used: the rate at which its
torque would be nought, `w_reference + (kp / kd) error`, is what the inner loop of another firmware is asked for. Of its
mixer the rotors' speeds are used: a throttle is a speed, and what that gives depends on how the vehicle moves.
"""

from dataclasses import dataclass, replace

import numpy as np

from firmware_bridge.controller import Configuration, Controller, State
from firmware_bridge.offboard.collective.at_rest import Lead, RotorsAtRest
from firmware_bridge.offboard.collective.effectiveness import SLOW_M_S, UPRIGHT, Effectiveness, Moment
from firmware_bridge.offboard.messages import Target
from firmware_bridge.offboard.poses import Poses
from firmware_bridge.offboard.prediction import Lags, Motion, Predictor
from firmware_bridge.offboard.thrust_map import ThrustMap
from firmware_bridge.offboard.turning.inner_lag import InnerLag
from firmware_bridge.words import reason_text
from flight import FloatArray, rotations

GAINS = {"kp_xy_1_s2": 9.0, "kd_xy_1_s": 5.0, "kp_z_1_s2": 9.0, "kd_z_1_s": 5.0, "obs_turn_rad_s2": 0.0,
         "att_kp_xy_1_s2": 220.0, "att_kd_xy_1_s": 22.0, "obs_force_hz": 0.2, "obs_fuse_rad_s": 0.0,
         "rotor_lag_s": 0.0, "battery_gain_1_v": 0.0}  # fmt: skip
"""Where the inner loop is another firmware's: softer position loops, and torques are not ours to observe.

The observer hears no accelerometer but what poses show, in which every lag of the inner loop is a force: it is slow.
The rotors' lag is led by us (`Lead`), and the battery is the thrust map's.
"""
_ESC_S = 0.005
"""From a throttle to the rotors, beside their lag."""
_RISEN_M = 0.1
"""In a take-off: off the ground, which bears the vehicle, and out of its effect."""
_MOVES = ("position_world_m", "velocity_world_m_s", "acceleration_world_m_s2")
_LEAD_S, _SHORTEST_S, _LONGEST_S = 0.018, 1e-3, 0.1
"""Low-pass of how the reference turns; steps of a tick."""
_LAG_EVERY = 25
"""Ticks of a plan's way between looks at what the inner loop's lag was found to be."""
STANDING = (State.DISARMED, State.ARMED, State.FAULT)
TARGETS_FROM_M_S, TARGETS_TO_M_S = 1.4, SLOW_M_S
"""Of set-point and vehicle: where a plan moves the firmware's position loops fly, and from what is slower we learn."""


@dataclass(frozen=True, slots=True)
class Demand:
    """What the inner loop is asked for."""

    time_s: float
    force_n: float
    """Collective, along body z, as the thrust map has it: of rotors in air at rest."""
    rate_body_rad_s: FloatArray
    """(3,)."""
    pose_time_s: float
    """Of the pose it rests on."""
    target: Target | None = None
    """What it follows, where a plan moves and other position loops are to fly it."""


class Tracker:
    """One vehicle; `tick` at 100 to 500 Hz."""

    def __init__(self, configuration: Configuration, poses: Poses, *, lags: Lags | None = None) -> None:
        values = configuration.parameters
        self.controller = Controller(configuration.with_values(**{**values, **GAINS}))
        parameters, lag_s = self.controller.parameters(), values.get("rotor_lag_s", 0.0)
        told = replace(Lags(), force_s=lag_s + _ESC_S) if lag_s > 0.0 else Lags()
        self._poses, self._lags = poses, lags or told
        self.mass_kg, self.gravity_m_s2 = parameters["mass_kg"], parameters["gravity_m_s2"]
        self.predictor = Predictor(self.mass_kg, self.gravity_m_s2, self._lags)
        self._at_rest = RotorsAtRest(self.controller.raw.parameters().ravel(), self.mass_kg)
        filter_s = parameters["lead_filter_s"]
        self._lead = Lead(self._lags.force_s if lag_s > 0.0 else filter_s, filter_s)
        self.thrust_map: ThrustMap | None = None
        """Where it is known, its least and most force bound what is predicted."""
        self.effectiveness = Effectiveness(self.gravity_m_s2)
        self.in_motion = 1.0
        """Force of the rotors over what they would give in air at rest at the same speeds."""
        self._speeds_rad_s, self._learns, self._clipped = np.zeros(4), False, False
        self._ground_m = self._ticked_s = 0.0
        self._ticks = 0
        self._per_error = np.array(
            [parameters[f"att_kp_{a}_1_s2"] / parameters[f"att_kd_{a}_1_s"] for a in ("xy", "xy", "z")]
        )
        self._largest_rad_s = parameters["yaw_slew_rad_s"], parameters["tilt_slew_rad_s"]
        self._begin_s: float | None = None
        self._last_reference, self._last_s = np.zeros(3), 0.0
        self._turning = np.zeros(3)
        self.motion: Motion | None = None
        """As last estimated."""
        self.gives_targets = self._moves = False
        """Whether position loops of the firmware's are to fly a plan."""
        self.inner_lag = InnerLag(float(np.mean(self._lags.rate_s)), self._lags.delay_s)

    def listen(self, now_s: float) -> None:
        """Take in the poses that have come."""
        for pose in self._poses(now_s):
            if self.predictor.pose(pose):
                self.inner_lag.pose(pose)

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

    def tick(self, now_s: float, *, battery_v: float = 0.0, by_targets: bool = False) -> Demand | None:
        """One step of the controller; None before the first pose.

        Args:
            battery_v: 0: not measured.
            by_targets: position loops of the firmware's fly: of force and rates nothing is sent, and nothing learnt.
        """
        self.listen(now_s)
        if self.predictor.pose_time_s == -np.inf:
            return None
        if self._begin_s is None:
            self._begin_s = now_s - 1.0
        self.motion = motion = self.predictor.at(now_s)
        time_us = round((now_s - self._begin_s) * 1e6)
        felt = self._felt_world_m_s2(motion)
        self.controller.tick(
            time_us,
            motion.row(),
            battery_v=battery_v,
            specific_force_body_m_s2=rotations.rotate(rotations.conjugate(motion.q_world_body), felt),
            rotor_speed_rad_s=self._at_rest.lagging_rad_s(
                self._speeds_rad_s, self.effectiveness.share * motion.force_n
            ),
        )
        self.controller.raw.ground_alive(0)
        standing = self.state in STANDING
        self.predictor.on_ground = standing
        demand = Demand(now_s, 0.0, np.zeros(3), self.predictor.pose_time_s)
        step_s = min(max(now_s - self._ticked_s, 0.0), _LONGEST_S)
        self._ticked_s = now_s
        if standing:
            self._lead.reset()
            self._ground_m, self._learns = float(motion.position_world_m[2]), False
        else:
            telemetry = self.controller.telemetry
            self._learn(step_s, motion, telemetry, by_targets=by_targets)
            demand = replace(
                demand,
                force_n=self._force_n(step_s, motion, telemetry),
                rate_body_rad_s=self._rate(motion, telemetry),
                target=self._target(motion, telemetry["setpoint"]),
            )
        given_n = self._given_n(demand.force_n, battery_v)
        self._clipped = given_n != demand.force_n
        self._sent(now_s, given_n, demand.rate_body_rad_s, by_targets=by_targets)
        return demand

    def _sent(self, now_s: float, force_n: float, rate_body_rad_s: FloatArray, *, by_targets: bool) -> None:
        """By it the motion is predicted; the inner loop's lag is learnt on a plan's way, short of what rotors give."""
        if by_targets:
            self.predictor.unknown(now_s)
        else:
            self.predictor.command(now_s, force_n, rate_body_rad_s)
        short = self._clipped or bool(self.controller.telemetry["saturation"])
        if by_targets or short or self.state is not State.TRAJECTORY:
            self.inner_lag.forget()
            return
        self.inner_lag.command(now_s, rate_body_rad_s)
        self._ticks += 1
        if self._ticks % _LAG_EVERY == 0:
            lags_s, _ = self.inner_lag.found()
            self._lags = replace(self._lags, rate_s=np.append(lags_s, self.inner_lag.assumed_s))
            self.predictor.follow(self._lags)

    def _target(self, motion: Motion, setpoint: dict) -> Target | None:
        """Only fast: below, hover thrust is learnt of what is commanded."""
        place, velocity, acceleration = (np.asarray(setpoint[name], np.float64) for name in _MOVES)
        slowest_m_s = min(float(np.linalg.norm(v)) for v in (velocity, motion.velocity_world_m_s))
        on_path = self.gives_targets and self.state is State.TRAJECTORY
        self._moves = on_path and slowest_m_s > (TARGETS_TO_M_S if self._moves else TARGETS_FROM_M_S)
        if not self._moves:
            return None
        return Target(place, velocity, acceleration, float(setpoint["yaw_rad"]), float(setpoint["yaw_rate_rad_s"]))

    def _given_n(self, force_n: float, battery_v: float) -> float:
        """What full or no throttle leaves of a force."""
        if self.thrust_map is None:
            return force_n
        least_n, most_n = (self.thrust_map.force_n(throttle, battery_v) for throttle in (0.0, 1.0))
        return min(max(force_n, least_n), most_n)

    def _force_n(self, step_s: float, motion: Motion, telemetry: dict) -> float:
        """The force in air at rest at whose throttle the rotors turn as the controller wants them to."""
        thrust_n = float(telemetry["thrust_n"])
        self._speeds_rad_s = np.asarray(telemetry["rotor_speed_rad_s"], np.float64)
        air = rotations.rotate(rotations.conjugate(motion.q_world_body), motion.velocity_world_m_s)
        self.in_motion = self._at_rest.in_motion(thrust_n, air)
        self.predictor.lift = self.effectiveness.share * self.in_motion
        return self._lead.force_n(thrust_n / self.in_motion / self.effectiveness.share, step_s)

    def _felt_world_m_s2(self, motion: Motion) -> FloatArray:
        """(3,) specific force, for the observer; what the thrust's scale takes up is none of its."""
        felt = self.predictor.acceleration_world_m_s2(motion, motion.q_world_body)
        felt[2] += self.gravity_m_s2
        up = rotations.matrix(motion.q_world_body)[:, 2]
        return felt - _excess_m_s2(motion, up) * up if self._learns else felt

    def _learn(self, step_s: float, motion: Motion, telemetry: dict, *, by_targets: bool) -> None:
        """From take-off to landing, as the ground is no thrust, and while the rotors can give what is asked for."""
        rises = self.state is State.TAKE_OFF and motion.position_world_m[2] < self._ground_m + _RISEN_M
        short = self._clipped or bool(telemetry["saturation"])
        self._learns = not (by_targets or rises or short or self.state in (State.LANDING, State.EMERGENCY))
        if not self._learns:
            return
        up = rotations.matrix(motion.q_world_body)[:, 2]
        bend_m_s2 = float(np.linalg.norm(telemetry["setpoint"]["acceleration_world_m_s2"][:2]))
        predicted_m_s2 = self.predictor.lift * motion.force_n / self.mass_kg
        speed_m_s = float(np.linalg.norm(motion.velocity_world_m_s))
        moment = Moment(speed_m_s, bend_m_s2, float(up[2]), predicted_m_s2, _excess_m_s2(motion, up))
        self._learns = self.effectiveness.learn(step_s, moment)

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


def _excess_m_s2(motion: Motion, up: FloatArray) -> float:
    """Along the body's z axis (3,), for the vertical part of what is unexplained: wind from aside is no thrust."""
    return float(motion.unexplained_world_m_s2[2] / max(float(up[2]), UPRIGHT))
