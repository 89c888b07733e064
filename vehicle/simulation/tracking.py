"""A simple tracking controller for simulated flights: feed-forward from flatness, small linear corrections.

Identification campaigns, self-tests and examples fly trajectories with it instead of the embedded controller. It
does not run on the vehicle.
"""

from dataclasses import dataclass

import numpy as np

from flight import FloatArray, InfeasibleError, Trajectory, rotations
from vehicle import allocation, dynamics, flatness
from vehicle.forces import open_air
from vehicle.model import Vehicle, rigid_body
from vehicle.simulation.simulate import Fleet


@dataclass(frozen=True, slots=True)
class Gains:
    """Of the corrections; natural frequencies about 2 rad/s for position and 12 rad/s for attitude."""

    position_1_s2: float = 5.0
    velocity_1_s: float = 3.5
    attitude_1_s2: float = 150.0
    rate_1_s: float = 20.0


class Tracker:
    """Rotor speed commands that keep a fleet on a trajectory, computed from a vehicle model."""

    def __init__(
        self, believed: Vehicle, trajectory: Trajectory, period_s: float = 0.005, gains: Gains | None = None
    ) -> None:
        """
        Raises:
            InfeasibleError: the model `believed` cannot fly the trajectory.
        """
        self._period_s, self._gains = period_s, gains or Gains()
        times = np.minimum(np.arange(0.0, trajectory.duration_s + period_s, period_s), trajectory.duration_s)
        flat = flatness.state(believed, trajectory, times)
        impossible = ~np.isfinite(flat.rotor_speed_rad_s).all(axis=1)
        if impossible.any():
            raise InfeasibleError(f"{believed.name} cannot fly this trajectory at {times[impossible][0]:.2f} s")
        self._flat, self._last = flat, len(times) - 1
        body = rigid_body(believed)
        self._mass, self._inertia = float(body.mass_kg), body.inertia_kg_m2
        self._mixer = _mixer(believed, flat)
        self._lead_rad_s = _lead(believed, flat, period_s)

    def __call__(self, fleet: Fleet) -> FloatArray:
        """Commands (m, r) for the fleet's present time."""
        k = min(round(fleet.time_s / self._period_s), self._last)
        f, g = self._flat, self._gains
        q = f.q_world_body[k]
        correction = g.position_1_s2 * (f.position_world_m[k] - fleet.position_world_m)
        correction += g.velocity_1_s * (f.velocity_world_m_s[k] - fleet.velocity_world_m_s)
        size = np.linalg.norm(correction, axis=1, keepdims=True)
        push = rotations.rotate(rotations.conjugate(q), correction * np.minimum(1.0, 5.0 / np.maximum(size, 1e-9)))
        # leaning by a small angle turns thrust towards the push
        lean = np.stack([-push[:, 1], push[:, 0], np.zeros(len(push))], axis=1) * self._mass / f.thrust_n[k]
        error = rotations.log(rotations.multiply(rotations.conjugate(q), fleet.q_world_body))
        turn = g.attitude_1_s2 * (lean - error) + g.rate_1_s * (f.rate_body_rad_s[k] - fleet.rate_body_rad_s)
        wanted = np.concatenate([self._mass * push[:, 2:], turn @ self._inertia.T], axis=1)
        return self._lead_rad_s[k] + wanted @ self._mixer[k].T


def _mixer(believed: Vehicle, flat: flatness.FlatState) -> FloatArray:
    """(n, r, 4): from small changes of thrust and torque to changes of rotor speed."""
    velocity = flatness.air_velocity_body(flat)
    around = open_air(len(velocity), believed.rotors)
    slope = dynamics.wrench_jacobian(
        believed, velocity, flat.rate_body_rad_s, flat.rotor_speed_rad_s, surroundings=around
    ).rotor_speed
    return allocation.by_wrench(believed, slope[:, 2:], flat.rotor_speed_rad_s)


def _lead(believed: Vehicle, flat: flatness.FlatState, period_s: float) -> FloatArray:
    """Commands that make lagging rotors reach the required speeds: ahead by lag times acceleration."""
    speed = flat.rotor_speed_rad_s
    if "motor_lag" not in believed.effects or len(speed) < 3:
        return speed
    values = believed.values("motor_lag")
    change = np.gradient(speed, period_s, axis=0)
    return speed + change * np.where(change > 0.0, values.rise_s, values.fall_s)
