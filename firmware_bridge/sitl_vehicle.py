"""The SITL vehicle: the embedded controller and link (the very C files) on a plant of your choice, over UDP.

plant = vehicle.simulate.Plant(truth, ...)
with SitlVehicle(plant, controller_parameters, key=key) as served:
    with connect(served.url, key=key) as link: ...
"""

import json
import logging
import os
import secrets
import select
import socket
import threading
import time
from collections import deque
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol, Self

import numpy as np

from firmware_bridge import _controller
from firmware_bridge.dialect.generated.messages import Ping
from firmware_bridge.impairment import Impairment, Line
from firmware_bridge.mavlink import MAGIC, timestamp_now
from flight import FloatArray, FormatError, InputError, LinkError, rotations

logger = logging.getLogger(__name__)

LOG_PERIOD_US = 5000
_LOG_RECORDS = 200_000  # 31 MB, 17 minutes at 200 Hz
_STATION_SILENT_S = 2.0
"""A station sends twice a second; one silent for longer makes room for another."""
_FORGET_S = 10.0
"""After so long a silence nothing is sent to a station or listener any more."""
_STATIONS = 8
_CHECKS_PER_S = 50_000
"""Signature checks: a desktop processor has time for more than a flight computer."""
_COMMIT_SLICES = 64
"""A whole commit in one tick: here nothing else waits for the processor."""
_KEEP_S = 30.0
_VALID_ALL = 255
"""Pose, accelerometer and rotor speeds."""
_STATE_FORMAT, _STATE_VERSION = "goshawk-sitl-state", 1
_CHALLENGE_ID = Ping.ID.to_bytes(3, "little")
_DATAGRAMS_AT_ONCE = 64  # then the controller has its turn: a flood must not keep it from flying
_BATCH_S = 0.004  # how long the plant may run before the socket is looked after again
_GROUND_PAUSE_S = 0.02  # with the rotors off: to wake costs more than the ticks then due, and a datagram wakes at once
_BEHIND_S = 0.05  # lag behind the clock that is no longer made up for


Address = tuple[str, int]


class PlantLike(Protocol):
    """What is flown: `vehicle.simulate.Plant`, or anything with these."""

    @property
    def time_s(self) -> float: ...
    @property
    def position_world_m(self) -> FloatArray: ...
    @property
    def velocity_world_m_s(self) -> FloatArray: ...
    @property
    def q_world_body(self) -> FloatArray: ...
    @property
    def rate_body_rad_s(self) -> FloatArray: ...
    @property
    def rotor_speed_rad_s(self) -> FloatArray: ...
    @property
    def specific_force_body_m_s2(self) -> FloatArray: ...
    @property
    def battery_v(self) -> float: ...
    def step(self, rotor_speed_command_rad_s: FloatArray, duration_s: float) -> None: ...


@dataclass(frozen=True, slots=True)
class Sensors:
    """What stands between the truth and the controller's estimate. The default is perfect."""

    position_std_m: float = 0.0
    velocity_std_m_s: float = 0.0
    attitude_std_rad: float = 0.0
    rate_std_rad_s: float = 0.0
    specific_force_std_m_s2: float = 0.0
    rotor_speed_std_rad_s: float = 0.0
    delay_s: float = 0.0
    """Age of the pose and velocity when they reach the controller; it is told the true time stamp."""
    untold_delay_s: float = 0.0
    """What is older still, without the time stamp telling."""

    @staticmethod
    def typical() -> "Sensors":
        """A good visual-inertial estimator and a cheap IMU."""
        return Sensors(0.002, 0.02, 0.002, 0.005, 0.05, 2.0, 0.01)

    def estimate(self, state: FloatArray, rng: np.random.Generator) -> FloatArray:
        """A true state (13,) (position, velocity, q_world_body, body rate) with the estimator's noise on it."""
        seen = state.copy()
        if self.position_std_m or self.velocity_std_m_s:
            seen[:3] += rng.normal(0.0, self.position_std_m, 3)
            seen[3:6] += rng.normal(0.0, self.velocity_std_m_s, 3)
        if self.attitude_std_rad:
            error = rotations.exp(rng.normal(0.0, self.attitude_std_rad, 3))
            seen[6:10] = rotations.multiply(seen[6:10], error)
        seen[10:] += rng.normal(0.0, self.rate_std_rad_s, 3) if self.rate_std_rad_s else 0.0
        return seen


class SitlVehicle:
    """Serves one vehicle to any number of ground stations. Use as a context manager, or call `serve`."""

    def __init__(
        self,
        plant: PlantLike,
        parameters: Mapping[str, float],
        *,
        key: bytes | None,
        host: str = "127.0.0.1",
        port: int = 0,
        system_id: int = 1,
        speed: float = 1.0,
        tick_hz: int = 400,
        sensors: Sensors | None = None,
        line: Impairment | None = None,
        seed: int = 0,
        listeners: bool = True,
        bytes_per_s: int = 4_000_000,
        log_records: int = _LOG_RECORDS,
        signature_checks_per_s: int = _CHECKS_PER_S,
        state_file: Path | None = None,
    ) -> None:
        """
        Args:
            parameters: of the controller, by name; those not given keep their preset.
            key: 32 bytes that sign the link; None serves unsigned.
            port: UDP port; 0 takes a free one (see `url`).
            speed: vehicle seconds per second. 0: as fast as it can while the rotors turn.
            tick_hz: control rate.
            line: what the radio does to datagrams, both ways.
            listeners: whether stations without the key may listen (they can do nothing else).
            bytes_per_s: what the vehicle sends at the most.
            log_records: room in the on-board log (200 records a second).
            signature_checks_per_s: of the station in control; the others together have a quarter of it.
            state_file: permanent memory for the boot count and the last signature stamp. Without one the boot id is
                drawn at random and the stamp is kept over `restart` only.
        """
        if not (speed >= 0.0 and 100 <= tick_hz <= 4000):
            raise InputError(f"speed {speed:g} must not be negative, tick_hz {tick_hz} be within 100 to 4000")
        if key is not None and len(key) != 32:
            raise InputError(f"a link key has 32 bytes, this one {len(key)}")
        self.plant = plant
        self._slipped_s = 0.0  # of vehicle time, by which it fell behind the wall clock and stayed behind
        self._parameters, self._key, self._system_id = dict(parameters), key, system_id
        self._speed, self._tick_us = speed, round(1e6 / tick_hz)
        self._sensors, self._rng = sensors or Sensors(), np.random.default_rng(seed)
        self._bytes_per_s, self._log_records = bytes_per_s, log_records
        self._checks_per_s, self._state_file = signature_checks_per_s, state_file
        self._impairment = line or Impairment()
        self._up: Line[Address] = Line(self._impairment, np.random.default_rng(seed + 1))
        self._down: Line[None] = Line(self._impairment, np.random.default_rng(seed + 2))
        self._stations: dict[Address, float] = {}
        self._guests: dict[Address, float] = {}
        self._listeners = listeners
        self._truth: deque[tuple[int, FloatArray]] = deque(
            maxlen=1 + round((self._sensors.delay_s + self._sensors.untold_delay_s) * tick_hz)
        )
        self._time_us, self._kept_at_s = 0, 0.0
        self._boots, self._kept_stamp = (secrets.randbits(32), 0) if state_file is None else _load_state(state_file)
        self._lock = threading.RLock()
        self._closing = threading.Event()
        self._thread: threading.Thread | None = None
        self._failure: BaseException | None = None
        self._socket = _bind(host, port)
        self._boot(kept=None)

    @property
    def url(self) -> str:
        host, port = self._socket.getsockname()[:2]
        return f"udp://{host}:{port}"

    @property
    def time_s(self) -> float:
        """Vehicle time."""
        return self._time_us * 1e-6

    def counts(self) -> dict[str, int]:
        """What the link endpoint accepted and refused since its start."""
        with self._lock:
            return self._link.counts()

    def __enter__(self) -> Self:
        self._thread = threading.Thread(target=self._run, name="SITL vehicle", daemon=True)
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._closing.set()
        if self._thread:
            self._thread.join()
        self._keep_stamp()
        self._socket.close()
        if self._failure:
            raise self._failure

    def serve(self) -> None:
        """Run in this thread until `stop`, or Ctrl-C."""
        try:
            self._loop()
        finally:
            self._keep_stamp()
            self._socket.close()

    def stop(self) -> None:
        """End `serve` from another thread."""
        self._closing.set()

    def restart(self) -> None:
        """Switch the flight computer off and on. All is forgotten but the active trajectory (permanent memory)."""
        with self._lock:
            self._kept_stamp = self._link.stamp_to_keep()
            self._boot(kept=self._link.kept())

    def _boot(self, kept: bytes | None) -> None:
        self._boots = (self._boots + 1) & 0xFFFFFFFF
        _save_state(self._state_file, self._boots, self._kept_stamp)  # before anything is signed under this number
        self._controller = _controller.Controller()
        self._set_parameters()
        self._now0_s = time.monotonic()
        self._link = _controller.Link(
            self._controller,
            self._key,
            self._system_id,
            max(timestamp_now(), self._kept_stamp),
            self._boots,
            self._bytes_per_s,
            self._log_records,
            LOG_PERIOD_US,
            self._now_us(),
            self._checks_per_s,
            _COMMIT_SLICES,
        )
        self._command = np.zeros(4)
        if kept and (reason := self._link.restore(kept)):
            logger.warning("the kept trajectory was refused: %s", _controller.reason_text(reason))

    def _set_parameters(self) -> None:
        table = _controller.parameter_table()
        names = [row[0] for row in table]
        unknown = sorted(set(self._parameters) - set(names))
        if unknown:
            raise InputError(f"the controller has no parameter {', '.join(unknown)}")
        values = np.array([self._parameters.get(row[0], row[3]) for row in table], dtype=np.float32)
        reason, index = self._controller.set_parameters(values)
        if reason:
            where = f" ({names[index]})" if index >= 0 else ""
            raise InputError(f"the controller refuses its parameters{where}: {_controller.reason_text(reason)}")

    def _now_us(self) -> int:
        return int((time.monotonic() - self._now0_s) * 1e6) + 1

    def _run(self) -> None:
        try:
            self._loop()
        except BaseException as error:
            self._failure = error
            logger.error("the SITL vehicle stopped: %s", error)

    def _loop(self) -> None:
        wall_s, vehicle_s = time.monotonic(), self.time_s
        while not self._closing.is_set():
            with self._lock:
                self._receive()
                rotors_on = bool(self._command.any())
                rate = self._speed if self._speed > 0.0 or rotors_on else 1.0
                began_s = time.monotonic()
                due_s = vehicle_s + (began_s - wall_s) * rate if rate > 0.0 else float("inf")
                while self.time_s + self._tick_us * 1e-6 <= due_s and time.monotonic() - began_s < _BATCH_S:
                    self._tick()
                    self._transmit()
                behind_s = due_s - self.time_s
                if rate == 0.0 or behind_s > _BEHIND_S * rate:
                    if self._speed > 0.0:  # at 0 nobody asked it to keep up with a clock
                        self._slip(behind_s)
                    wall_s, vehicle_s = time.monotonic(), self.time_s
                self._transmit()
                self._forget_silent()
                if time.monotonic() - self._kept_at_s > _KEEP_S:
                    self._keep_stamp()
            if rate > 0.0:
                pause_s = (self.time_s + self._tick_us * 1e-6 - vehicle_s) / rate - (time.monotonic() - wall_s)
                if pause_s > 0.0 and not self._command.any():
                    pause_s = max(pause_s, _GROUND_PAUSE_S)
                soonest_s = min(self._up.next_s(), self._down.next_s()) - time.monotonic()
                select.select([self._socket], [], [], max(0.0, min(pause_s, soonest_s, 0.05)))

    def _slip(self, behind_s: float) -> None:
        before = int(self._slipped_s)
        self._slipped_s += behind_s
        if int(self._slipped_s) > before:
            logger.warning("slower than real time: vehicle time is %.1f s behind the wall clock", self._slipped_s)

    def _tick(self) -> None:
        """One control period: sense, control, move."""
        self._time_us += self._tick_us
        plant, sensors, rng = self.plant, self._sensors, self._rng
        truth = np.concatenate(
            [plant.position_world_m, plant.velocity_world_m_s, plant.q_world_body, plant.rate_body_rad_s]
        )
        self._truth.append((self._time_us, truth))
        pose_us, seen = self._truth[0]
        pose_us = min(pose_us + round(sensors.untold_delay_s * 1e6), self._time_us)
        estimate = sensors.estimate(np.concatenate([seen[:10], truth[10:]]), rng)
        command, _ = self._controller.tick(
            self._time_us,
            estimate,
            pose_us,
            pose_us,
            plant.battery_v,
            rate_time_us=self._time_us,
            valid=_VALID_ALL,
            more=self._imu_and_rotors(),
        )
        self._command = command.astype(np.float64)
        self._link.update(self._now_us())
        plant.step(self._command, self._tick_us * 1e-6)

    def _imu_and_rotors(self) -> FloatArray:
        """What else the estimate holds: specific force (3,), eleven unused numbers, rotor speeds (4,)."""
        sensors, rng, more = self._sensors, self._rng, np.zeros(18)
        more[14:] = self.plant.rotor_speed_rad_s
        if sensors.rotor_speed_std_rad_s:  # drawn first
            more[14:] += rng.normal(0.0, sensors.rotor_speed_std_rad_s, 4)
        more[:3] = self.plant.specific_force_body_m_s2
        if sensors.specific_force_std_m_s2:
            more[:3] += rng.normal(0.0, sensors.specific_force_std_m_s2, 3)
        return more

    def _receive(self) -> None:
        now_s = time.monotonic()
        for _ in range(_DATAGRAMS_AT_ONCE):
            try:
                datagram, address = self._socket.recvfrom(65536)
            except BlockingIOError:
                break
            except OSError:  # an earlier answer found nobody
                continue
            if self._impairment.perfect:
                self._take(datagram, address, now_s)
            else:
                self._up.push(datagram, address, now_s)
        for datagram, address in self._up.pop(now_s):
            self._take(datagram, address, now_s)

    def _take(self, datagram: bytes, address: Address, now_s: float) -> None:
        """Hand a datagram to the link. Who sends what it accepts is a station; other MAVLink 2 speakers may listen.

        Those that sign are challenged, listeners or not: so a station gets in.
        """
        accepted = self._link.receive(datagram, True, self._now_us())
        if accepted:
            self._guests.pop(address, None)
            _remember(self._stations, address, now_s)
        elif address not in self._stations and datagram[:1] == bytes([MAGIC]):
            _remember(self._guests, address, now_s)

    def _transmit(self) -> None:
        while (self._stations or self._guests) and (frame := self._link.transmit(self._now_us())):
            if self._impairment.perfect:
                self._send(frame)
            else:
                self._down.push(frame, None, time.monotonic())
        for frame, _ in self._down.pop(time.monotonic()):
            self._send(frame)

    def _send(self, frame: bytes) -> None:
        to_all = self._listeners or frame[7:10] == _CHALLENGE_ID
        for address in (*self._stations, *(self._guests if to_all else ())):
            try:
                self._socket.sendto(frame, address)
            except OSError:  # gone, or its buffer is full: a lost datagram
                continue

    def _forget_silent(self) -> None:
        oldest_s = time.monotonic() - _FORGET_S
        for heard_s in (self._stations, self._guests):
            for address in [address for address, at_s in heard_s.items() if at_s < oldest_s]:
                del heard_s[address]

    def _keep_stamp(self) -> None:
        self._kept_at_s = time.monotonic()
        _save_state(self._state_file, self._boots, self._link.stamp_to_keep())


def _load_state(path: Path) -> tuple[int, int]:
    """Boot count and signature stamp of a vehicle's permanent memory; zeros for a new one."""
    if not path.exists():
        return 0, 0
    try:
        state = json.loads(path.read_text())
        if (state["format"], state["version"]) != (_STATE_FORMAT, _STATE_VERSION):
            raise FormatError(f"{path} is {state['format']} {state['version']}, not {_STATE_FORMAT} {_STATE_VERSION}")
        return int(state["boots"]), int(state["stamp_10us"])
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise FormatError(
            f"{path} is not the memory of a SITL vehicle ({error}); name another file, or remove it and make a new key"
        ) from error


def _save_state(path: Path | None, boots: int, stamp_10us: int) -> None:
    if path is None:
        return
    state = {"format": _STATE_FORMAT, "version": _STATE_VERSION, "boots": boots, "stamp_10us": stamp_10us}
    temporary = path.with_name(path.name + ".new")
    with temporary.open("w") as file:
        file.write(json.dumps(state))
        file.flush()
        os.fsync(file.fileno())
    temporary.replace(path)


def _remember(stations: dict[Address, float], address: Address, now_s: float) -> None:
    """Note that a station was heard. When there is no room, the one that has been silent longest goes, if it is."""
    if address not in stations and len(stations) >= _STATIONS:
        quietest = min(stations, key=stations.__getitem__)
        if now_s - stations[quietest] < _STATION_SILENT_S:
            return
        del stations[quietest]
    stations[address] = now_s


def _bind(host: str, port: int) -> socket.socket:
    try:
        family, kind, _, _, address = socket.getaddrinfo(host, port, type=socket.SOCK_DGRAM)[0]
        bound = socket.socket(family, kind)
        bound.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4 << 20)
        bound.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, 4 << 20)
        bound.setblocking(False)
        bound.bind(address)
    except OSError as error:
        raise LinkError(f"cannot serve at {host}:{port}: {error}; choose another port, 0 for a free one") from error
    return bound
