"""The embedded controller round a plant, without link and without clock: the same seed gives the same flight.

For benchmarks and studies of many flights; `SitlVehicle` is the same loop behind the link.
"""

from dataclasses import dataclass

import numpy as np

from firmware_bridge.controller import Command, Configuration, Controller, State
from firmware_bridge.sitl_vehicle import PlantLike, Sensors
from flight import FlightLog, FloatArray, LinkError, Trajectory
from flight.flight_log import from_vectors

TICK_US = 2500
_LOG_EVERY = 2  # ticks: 200 Hz, as on the vehicle
_FREE_AIR_M = 10.0
"""Clearance: there is nothing to hit here, and a path that is slowed for its tracking error is not comparable."""
_OBSERVER = (
    "disturbance_force_world_n", "disturbance_torque_body_n_m", "disturbance_torque_std_n_m", "disturbance_force_std_n",
    "observer_state",
)  # fmt: skip
_SCALARS = ("mission_state", "battery_v", "disturbance_force_std_n", "observer_state")
_STEP_S = 20.0  # more than any take-off or approach takes


@dataclass(frozen=True, slots=True)
class Flown:
    """One flight along a trajectory."""

    log: FlightLog
    """What the instruments wrote, at 200 Hz from hover to hover: a noisy pose, measured rotor speeds."""
    error_m: FloatArray
    """(n,) true distance from the set-point at every tick on the trajectory."""
    error_world_m: FloatArray
    """(n, 3) true position less the set-point."""


def fly(
    plant: PlantLike,
    configuration: Configuration,
    trajectory: Trajectory,
    *,
    sensors: Sensors | None = None,
    seed: int = 0,
    imu: bool = False,
) -> Flown:
    """Take off below the start of a trajectory, fly it, and hover.

    Args:
        plant: at rest on the ground, below the start of the trajectory.
        imu: give the controller the accelerometer and the rotor speeds, as the SITL vehicle does. Its disturbance
            observer then runs, and the log holds what it finds.

    Raises:
        RefusedError: the controller refuses its parameters or the trajectory.
        LinkError: the flight ended in another way than at the end of the trajectory.
    """
    loop = _Loop(plant, Controller(configuration), sensors or Sensors(), np.random.default_rng(seed), imu)
    loop.tick()
    loop.controller.command(Command.ARM)
    start_m = float(trajectory.position([0.0])[0, 2] - plant.position_world_m[2])
    loop.controller.command(Command.TAKE_OFF, start_m)
    loop.until(State.HOLD, _STEP_S)
    loop.run(1.0)
    loop.controller.upload(trajectory, clearance_m=_FREE_AIR_M)
    loop.recording = True
    loop.run(0.5)
    loop.controller.command(Command.START)
    loop.until(State.TRAJECTORY, _STEP_S)
    loop.until(State.HOLD, trajectory.duration_s + 1.0)
    loop.run(0.5)
    return loop.flown()


class _Loop:
    """Sense, control, move; and what is kept of it."""

    def __init__(
        self, plant: PlantLike, controller: Controller, sensors: Sensors, rng: np.random.Generator, imu: bool
    ) -> None:
        self.plant, self.controller, self.sensors, self.rng, self.imu = plant, controller, sensors, rng, imu
        self.recording = False
        self._time_us = 0
        self._past: list[tuple[int, FloatArray]] = []
        self._kept: list[dict[str, FloatArray]] = []
        self._errors: list[FloatArray] = []

    def tick(self) -> State:
        self._time_us += TICK_US
        p = self.plant
        truth = np.concatenate([p.position_world_m, p.velocity_world_m_s, p.q_world_body, p.rate_body_rad_s])
        self._past.append((self._time_us, truth))
        if len(self._past) > 1 + round(self.sensors.delay_s * 1e6 / TICK_US):
            self._past.pop(0)
        pose_us, seen = self._past[0]
        estimate = self.sensors.estimate(np.concatenate([seen[:10], truth[10:]]), self.rng)
        command = self.controller.tick(
            self._time_us,
            estimate,
            position_time_us=pose_us,
            attitude_time_us=pose_us,
            battery_v=p.battery_v,
            specific_force_body_m_s2=self._specific_force() if self.imu else None,
            rotor_speed_rad_s=self._rotor_speed() if self.imu else None,
        )
        state = self.controller.state
        if self.recording:
            self._keep(truth, command, state)
        p.step(command, TICK_US * 1e-6)
        return state

    def _specific_force(self) -> FloatArray:
        return self.plant.specific_force_body_m_s2 + self.rng.normal(0.0, self.sensors.specific_force_std_m_s2, 3)

    def _rotor_speed(self) -> FloatArray:
        return self.plant.rotor_speed_rad_s + self.rng.normal(0.0, self.sensors.rotor_speed_std_rad_s, 4)

    def _keep(self, truth: FloatArray, command: FloatArray, state: State) -> None:
        telemetry = self.controller.telemetry
        wanted = telemetry["setpoint"]["position_world_m"]
        if state is State.TRAJECTORY:
            self._errors.append(truth[:3] - wanted)
        if (self._time_us // TICK_US) % _LOG_EVERY:
            return
        seen = self.sensors.estimate(truth, self.rng)
        self._kept.append(
            {
                "time_s": np.array(self._time_us * 1e-6),
                "position_world_m": seen[:3],
                "velocity_world_m_s": seen[3:6],
                "q_world_body": seen[6:10],
                "rate_body_rad_s": seen[10:],
                "rotor_speed_rad_s": self._rotor_speed(),
                "specific_force_body_m_s2": self._specific_force(),
                "rotor_speed_command_rad_s": command,
                "setpoint_position_world_m": np.asarray(wanted, dtype=np.float64),
                "mission_state": np.array(float(state)),
                "battery_v": np.array(float(self.plant.battery_v)),
                **({name: np.asarray(telemetry[name], dtype=np.float64) for name in _OBSERVER} if self.imu else {}),
            }
        )

    def run(self, seconds: float) -> None:
        for _ in range(round(seconds * 1e6 / TICK_US)):
            self.tick()

    def until(self, wanted: State, limit_s: float) -> None:
        for _ in range(round(limit_s * 1e6 / TICK_US)):
            if self.tick() is wanted:
                return
        raise LinkError(f"not {wanted.name} within {limit_s:.0f} s: the vehicle is in {self.controller.state.name}")

    def flown(self) -> Flown:
        columns = {name: np.array([row[name] for row in self._kept]) for name in self._kept[0]}
        time_s = columns.pop("time_s")
        scalars = {name: columns.pop(name) for name in _SCALARS if name in columns}
        error = np.array(self._errors)
        log = from_vectors(time_s, columns, scalars=scalars, metadata={"source": "closed loop"})
        return Flown(log, np.linalg.norm(error, axis=1), error)
