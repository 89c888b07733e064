"""Flights on Betaflight's real firmware in which something is lost, and how they end by the body."""

import contextlib
import os
import signal
import subprocess
import sys
import threading
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

import vehicle
from firmware_bridge.betaflight_sitl.body import ADDRESS, Body
from firmware_bridge.betaflight_sitl.process import Sitl
from firmware_bridge.offboard.firmware import Alert
from firmware_bridge.offboard.poses import Pose
from flight import Trajectory, TrajectoryFile, rotations, trajectory
from goshawk.commands.fly import offboard
from tests.firmware_bridge.offboard.relay import Relay
from vehicle import Vehicle

SAFE_TOUCH_DOWN_M_S = 1.5
LARGEST_TILT_RAD = 1.0
"""A vehicle beyond it has been lost."""
FIRMWARE_LANDS_S = 12.0
GIVEN_BEFORE_S = 1.0
"""The pilot gives the sticks away, and then arms."""
FULL_V, EMPTY_V = 16.4, 13.1
ON_THE_LINE = ("low battery", "link lost")
"""Kinds that need a relay."""
LANDS_BRIEFLY = ("set failsafe_landing_time = 8",)
"""After which the firmware that lands by itself stops the rotors; by default it takes a minute."""
OVERRIDE = (
    "aux 1 50 1 1700 2100 0 0",
    "set msp_override_channels_mask = 15",
    "set msp_override_failsafe = OFF",
)  # fmt: skip
"""The pilot's receiver arms by its first switch and gives the sticks to MSP by its second."""


@dataclass(slots=True)
class Fault:
    """What happens `after_s` after the vehicle has reached a height."""

    kind: str = "none"
    """kill, guard killed, hang, pose lost, frozen, jump or late, kill and pose lost, stick override, low battery, link
    lost, none."""
    after_s: float = 3.0
    height_m: float = 1.0
    size: float = 1.0
    """Of a jump, metres; of a link that is lost, seconds; of the pilot's throttle, microseconds."""
    begun_s: float | None = None
    planner: subprocess.Popen | None = None
    relay: Relay | None = None
    frozen: Pose | None = None
    armed_by_pilot_s: float = 8.0
    _high_s: float | None = None
    _pose_at: list = field(default_factory=list)

    def each_step(self, body: Body, firmware: Sitl) -> None:
        """Of the body."""
        if self.relay is not None:
            self._on_the_line(body.time_s, self.relay)
        if self.kind.startswith("stick override") and round(body.time_s * 1000) % 10 < 2:
            firmware.sticks(body.time_s, self._pilot(body))
        if self._high_s is None and body.plant.position_world_m[2] > self.height_m:
            self._high_s = body.time_s
        due = self._high_s is not None and body.time_s > self._high_s + self.after_s
        if not due or self.begun_s is not None:
            return
        self.begun_s = body.time_s
        assert self.planner is not None
        if self.kind == "guard killed":
            for child in Path(f"/proc/{self.planner.pid}/task/{self.planner.pid}/children").read_text().split():
                os.kill(int(child), signal.SIGKILL)
        if self.kind.startswith("kill"):
            self.planner.send_signal(signal.SIGKILL)
            self.planner.wait()
        if self.kind == "hang":
            self.planner.send_signal(signal.SIGSTOP)

    def _on_the_line(self, time_s: float, relay: Relay) -> None:
        since_s = -1.0 if self.begun_s is None else time_s - self.begun_s
        relay.cut = self.kind == "link lost" and 0.0 <= since_s < self.size
        low = self.kind == "low battery" and since_s >= 0.0
        relay.battery = (EMPTY_V, Alert.CRITICAL) if low else (FULL_V, Alert.NONE)
        relay.pump()

    def _pilot(self, body: Body) -> list[float]:
        """Gives the sticks away, arms, and after the fault takes them back: level, and slowly down."""
        ours = self.begun_s is None
        armed = 2000.0 if body.time_s > self.armed_by_pilot_s else 1000.0
        if ours:
            given = body.time_s > self.armed_by_pilot_s - GIVEN_BEFORE_S
            return [1500.0, 1500.0, 1000.0, 1500.0, armed, 2000.0 if given else 1000.0]
        R = rotations.matrix(body.plant.q_world_body)
        climb = float(body.plant.velocity_world_m_s[2])
        on_ground = body.plant.position_world_m[2] < 0.01 and abs(climb) < 0.05
        roll, pitch = 1500.0 - 200.0 * R[2, 1], 1500.0 + 200.0 * R[2, 0]
        throttle = float(np.clip(self.size - 150.0 * (climb + 0.5), 1050.0, 1900.0))
        return [roll, pitch, 1000.0 if on_ground else throttle, 1500.0, 1000.0 if on_ground else 2000.0, 1000.0]

    def change_pose(self, time_s: float, pose: Pose) -> Pose | None:
        """Of the body."""
        self._pose_at.append(pose)
        if self.begun_s is None:
            return pose
        if "pose lost" in self.kind:
            return None
        if self.kind == "pose frozen":
            self.frozen = self.frozen or pose
            return replace(pose, position_world_m=self.frozen.position_world_m, q_world_body=self.frozen.q_world_body)
        if self.kind == "pose jump":
            return replace(pose, position_world_m=pose.position_world_m + np.array([self.size, 0.0, 0.0]))
        if self.kind == "pose late":
            return self._pose_at[-60]
        return pose


@dataclass(frozen=True, slots=True)
class Ended:
    """By the body's own truth."""

    begun_s: float | None
    """When the fault came; None: never."""
    touch_down_m_s: float
    on_ground: bool
    rotors_stand: bool
    worst_tilt_rad: float
    moved_m: float
    """Horizontally from the fault on."""
    lasted_s: float
    """From the fault to the end."""
    said: str
    """By the planner."""

    @property
    def safe(self) -> bool:
        return (
            self.on_ground
            and self.rotors_stand
            and self.touch_down_m_s < SAFE_TOUCH_DOWN_M_S
            and self.worst_tilt_rad < LARGEST_TILT_RAD
        )


def fly(
    folder: Path, model: Vehicle, way: Trajectory, fault: Fault, *, seed: int = 1, settings: Sequence[str] = ()
) -> Ended:
    """One flight of a planner of its own process."""
    body = offboard.body_of(model, way, seed=seed)
    body.settings = (*body.settings, *settings)
    vehicle.save(folder / "vehicle.toml", model)
    file = TrajectoryFile(way, "way", "", "", way.position([0.0, way.duration_s]), {})
    trajectory.save(folder / "way.json", file)
    worst_tilt, at_fault = [0.0], [np.zeros(3)]

    def each_step(body: Body, firmware: Sitl) -> None:
        before = fault.begun_s
        fault.each_step(body, firmware)
        if before is None and fault.begun_s is not None:
            at_fault[0] = body.plant.position_world_m.copy()
        worst_tilt[0] = max(worst_tilt[0], _tilt_rad(body))

    def start_planner() -> None:
        if fault.planner is None:
            address = fault.relay.address if fault.relay is not None else ADDRESS
            pilot = fault.kind == "stick override"
            arguments = (
                address,
                int(pilot),
                body.clock_port,
                folder / "vehicle.toml",
                folder / "way.json",
                folder / "log.parquet",
            )
            command = [sys.executable, "-m", "tests.firmware_bridge.offboard.planner", *map(str, arguments)]
            fault.planner = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
            threading.Thread(target=give_up_with, args=(fault.planner,), daemon=True).start()

    def give_up_with(planner: subprocess.Popen) -> None:
        """Without it the body would wait for ever for a planner that refused the flight."""
        planner.wait()
        body.given_up = True

    body.each_step, body.change_pose, body.on_ready = each_step, fault.change_pose, start_planner
    with contextlib.ExitStack() as stack:
        if fault.kind in ON_THE_LINE:
            fault.relay = stack.enter_context(Relay())
        try:
            body.run(longest_s=90.0, after_s=FIRMWARE_LANDS_S if fault.kind == "guard killed" else 0.5)
        finally:
            said = _ended(fault.planner)
    end = body.plant.position_world_m
    lasted_s = body.time_s - (fault.begun_s or body.time_s)
    return Ended(
        fault.begun_s, body.fastest_down_m_s, float(end[2]) < 0.02, float(body.plant.rotor_speed_rad_s.max()) < 1.0,
        worst_tilt[0], float(np.linalg.norm((end - at_fault[0])[:2])), lasted_s, said,
    )  # fmt: skip


def _ended(planner: subprocess.Popen | None) -> str:
    if planner is None:
        return ""
    if planner.poll() is None:
        os.kill(planner.pid, signal.SIGCONT)
    return str(planner.communicate(timeout=600)[0])


def _tilt_rad(body: Body) -> float:
    return float(np.arccos(np.clip(rotations.matrix(body.plant.q_world_body)[2, 2], -1.0, 1.0)))
