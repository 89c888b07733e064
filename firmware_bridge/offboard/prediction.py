"""From late poses and what was commanded to the state now: position, velocity, attitude, body rate.

A fading-memory filter at the stamp of each pose, and from there the commands of the time since: the inner loop follows
a commanded rate, and the rotors a commanded force, each with a lag. What the forces do not explain is a slow
acceleration, which is estimated too. A pose that contradicts the prediction is not used.

While other loops fly by commands that nobody knows, rates and force stay what poses show them to be.
"""

from collections import deque
from dataclasses import dataclass, field

import numpy as np

from firmware_bridge.offboard.poses import Pose
from flight import FloatArray, rotations

_KEPT_S = 1.0
"""Of commands: no pose that is older is used."""
_REACH_S = 0.3
"""Of a prediction: beyond, poses are stale, and every tick would integrate more of it."""
_STEP_S = 0.004
_MOST_GROWN = 1.5
"""Of the bounds on a pose, which spread while there are none: more would let a jump in before its time."""
_SEED_AFTER = 10
"""Refused in a row on the ground, where a vehicle is carried: then it is there."""
_UP = np.array([0.0, 0.0, 1.0])


@dataclass(frozen=True, slots=True)
class Lags:
    """How the vehicle follows its commands."""

    delay_s: float = 0.006
    """From a command to the first answer of the rotors."""
    rate_s: float | FloatArray = 0.025
    """Of the inner loop; (3,) about each axis where they are known."""
    force_s: float = 0.035
    """Of the rotors."""


@dataclass(frozen=True, slots=True)
class Memory:
    """How long the filter remembers, and which pose it refuses."""

    position_s: float = 0.05
    attitude_s: float = 0.025
    jump_m: float = 0.25
    """A pose this far from the prediction is none."""
    jump_rad: float = 0.5


@dataclass(slots=True)
class Motion:
    """A state, and how it goes on."""

    time_s: float
    position_world_m: FloatArray
    velocity_world_m_s: FloatArray
    q_world_body: FloatArray
    rate_body_rad_s: FloatArray
    force_n: float
    """Of the rotors, along body z, as it would be in air at rest."""
    unexplained_world_m_s2: FloatArray = field(default_factory=lambda: np.zeros(3))
    """Acceleration that force and gravity do not explain."""

    def row(self) -> FloatArray:
        """(13,) as the controller takes it."""
        return np.concatenate([self.position_world_m, self.velocity_world_m_s, self.q_world_body, self.rate_body_rad_s])


class Predictor:
    """Call `command` for every command sent, `pose` for every pose that comes, and `at` for the state."""

    def __init__(self, mass_kg: float, gravity_m_s2: float, lags: Lags | None = None, memory: Memory | None = None):
        self._mass_kg, self._gravity_m_s2 = mass_kg, gravity_m_s2
        self._lags, self._memory = lags or Lags(), memory or Memory()
        self._commands: deque[tuple[float, float | None, FloatArray]] = deque()
        """When each takes effect, force, rates; no force: nobody knows what was commanded."""
        self._last: Motion | None = None
        self.on_ground = True
        """While it stands, the ground holds it: no force is integrated."""
        self.lift = 1.0
        """Force of the rotors over what they would give in air at rest by the thrust map."""
        self.refused = 0
        """Poses in a row that contradict the prediction."""

    @property
    def pose_time_s(self) -> float:
        """Of the last pose used; minus infinity before the first."""
        return self._last.time_s if self._last is not None else -np.inf

    def follow(self, lags: Lags) -> None:
        """What the lags have been found to be, from now on."""
        self._lags = lags

    def command(self, time_s: float, force_n: float, rate_body_rad_s: FloatArray) -> None:
        self._keep(time_s, force_n, rate_body_rad_s)

    def unknown(self, time_s: float) -> None:
        """Instead of `command`: another was sent, or none."""
        self._keep(time_s, None, np.zeros(3))

    def _keep(self, time_s: float, force_n: float | None, rate_body_rad_s: FloatArray) -> None:
        self._commands.append((time_s + self._lags.delay_s, force_n, rate_body_rad_s))
        while self._commands[0][0] < time_s - _KEPT_S:
            self._commands.popleft()

    def reset(self) -> None:
        """Forget the state and the commands: another steers. The next pose begins anew, at rest."""
        self._commands.clear()
        self._last, self.refused = None, 0

    def _seed(self, pose: Pose) -> bool:
        still = np.zeros(3)
        self._last = Motion(pose.time_s, pose.position_world_m, still, pose.q_world_body, still.copy(), 0.0)
        self.refused = 0
        return True

    def pose(self, pose: Pose) -> bool:
        """Correct by a pose. Returns whether it was used."""
        if self._last is None:
            return self._seed(pose)
        since_s = pose.time_s - self._last.time_s
        if self.on_ground and (since_s >= _KEPT_S or (since_s > 0.0 and self.refused >= _SEED_AFTER)):
            return self._seed(pose)
        if not 0.0 < since_s < _KEPT_S:
            return False
        then = self._carried(self._last, pose.time_s)
        missed_m = pose.position_world_m - then.position_world_m
        turned_rad = rotations.log(rotations.multiply(rotations.conjugate(then.q_world_body), pose.q_world_body))
        grown = min(1.0 + since_s / 0.1, _MOST_GROWN)
        if (
            np.linalg.norm(missed_m) > self._memory.jump_m * grown
            or np.linalg.norm(turned_rad) > self._memory.jump_rad * grown
        ):
            self.refused += 1
            return False
        self.refused = 0
        self._last = self._corrected(then, missed_m, turned_rad, since_s)
        if self._unknown_at(pose.time_s):
            self._take_for_force(self._last)
        return True

    def _unknown_at(self, time_s: float) -> bool:
        due = [force_n for due_s, force_n, _ in self._commands if due_s <= time_s]
        return bool(due) and due[-1] is None

    def _take_for_force(self, now: Motion) -> None:
        """What is unexplained along body z is the rotors': nobody knows what they were asked for."""
        up = rotations.rotate(now.q_world_body, _UP)
        m_s2_of_n = self.lift / self._mass_kg
        force_n = max(now.force_n + float(now.unexplained_world_m_s2 @ up) / m_s2_of_n, 0.0)
        now.unexplained_world_m_s2 = now.unexplained_world_m_s2 - m_s2_of_n * (force_n - now.force_n) * up
        now.force_n = force_n

    def _corrected(self, then: Motion, missed_m: FloatArray, turned_rad: FloatArray, since_s: float) -> Motion:
        """Fading memory of second order in acceleration, of first order in rate (Morrison 1969)."""
        z = float(np.exp(-since_s / self._memory.position_s))
        turn = float(np.exp(-since_s / self._memory.attitude_s))
        q = rotations.multiply(then.q_world_body, rotations.exp((1.0 - turn**2) * turned_rad))
        unexplained = then.unexplained_world_m_s2 + (1.0 - z) ** 3 / since_s**2 * missed_m
        return Motion(
            then.time_s,
            then.position_world_m + (1.0 - z**3) * missed_m,
            then.velocity_world_m_s + 1.5 * (1.0 - z) ** 2 * (1.0 + z) / since_s * missed_m,
            q,
            then.rate_body_rad_s + (1.0 - turn) ** 2 / since_s * turned_rad,
            then.force_n,
            np.zeros(3) if self.on_ground else unexplained,
        )

    def at(self, time_s: float) -> Motion:
        """The state at a time, by the commands since the last pose, 0.3 s at most. There must have been one."""
        assert self._last is not None
        return self._carried(self._last, min(time_s, self._last.time_s + _REACH_S))

    def _carried(self, start: Motion, time_s: float) -> Motion:
        now = Motion(
            start.time_s, start.position_world_m.copy(), start.velocity_world_m_s.copy(), start.q_world_body,
            start.rate_body_rad_s.copy(), start.force_n, start.unexplained_world_m_s2,
        )  # fmt: skip
        due = [c for c in self._commands if c[0] <= now.time_s][-1:]
        due += [c for c in self._commands if now.time_s < c[0] < time_s]
        ends_s = [c[0] for c in due[1:]] + [time_s] if due else [time_s]
        force_n, rate = (due[0][1], due[0][2]) if due else (0.0, np.zeros(3))
        for i, end_s in enumerate(ends_s):
            if due:
                _, force_n, rate = due[i]
            while now.time_s < end_s - 1e-9:
                self._step(now, min(end_s, now.time_s + _STEP_S) - now.time_s, force_n, rate)
        return now

    def _step(self, now: Motion, step_s: float, force_n: float | None, rate_body_rad_s: FloatArray) -> None:
        """One Euler step, half a step of the attitude first."""
        if force_n is not None:
            now.rate_body_rad_s += (rate_body_rad_s - now.rate_body_rad_s) * (1.0 - np.exp(-step_s / self._lags.rate_s))
            now.force_n += (force_n - now.force_n) * (1.0 - np.exp(-step_s / self._lags.force_s))
        q_middle = rotations.multiply(now.q_world_body, rotations.exp(0.5 * step_s * now.rate_body_rad_s))
        now.q_world_body = rotations.multiply(now.q_world_body, rotations.exp(step_s * now.rate_body_rad_s))
        acceleration = self.acceleration_world_m_s2(now, q_middle)
        now.position_world_m += step_s * now.velocity_world_m_s + 0.5 * step_s**2 * acceleration
        now.velocity_world_m_s += step_s * acceleration
        now.time_s += step_s

    def acceleration_world_m_s2(self, now: Motion, q_world_body: FloatArray) -> FloatArray:
        """(3,) of the body as it is predicted."""
        if self.on_ground:
            return np.zeros(3)
        up = rotations.rotate(q_world_body, _UP)
        return self.lift * now.force_n / self._mass_kg * up - self._gravity_m_s2 * _UP + now.unexplained_world_m_s2
