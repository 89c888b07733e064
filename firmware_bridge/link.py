"""The ground station's link to a vehicle: connect, upload, read back, fly, fetch the log.

with connect("udp://127.0.0.1:14550") as link:
    link.take_control()
    link.upload(trajectory.load(path))
    log = link.fly()
"""

import secrets
import time
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Self

import numpy as np

from firmware_bridge import arming, flying, keys, parameters, transfer, wire
from firmware_bridge.controller import LinkLoss as OnLinkLoss
from firmware_bridge.dialect.generated.messages import (
    AutopilotVersion,
    Command,
    LeaseRequest,
    LinkReason,
    MissionCommand,
    MissionResult,
    MissionState,
    MissionStatus,
    State,
    Timesync,
    TrajectoryResult,
)
from firmware_bridge.mavlink import Codec, Counts, Signing
from firmware_bridge.port import Port, station_words
from firmware_bridge.transfer import Cancel, CancelledError, UploadReport
from firmware_bridge.wire import WirePlan
from firmware_bridge.words import reason_text
from flight import FlightLog, FloatArray, FormatError, InputError, LinkError, Progress, TrajectoryFile, silent

__all__ = ["CancelledError", "Link", "OnLinkLoss", "Statistics", "UploadReport", "VehicleState", "connect"]


_LEASE_POLL_S = 0.4
"""A live station renews within this time, unless the line loses it."""
_TAKE_OVER = "wait until it disconnects, or take over: take_control(force=True), --take-over"
_RETRY_S = 0.1
_KILL_RETRY_S = 0.02
"""In a flood of forged frames only some of ours are looked at: more tries, sooner through."""


def never() -> bool:
    """The cancel of those who do not cancel."""
    return False


@dataclass(frozen=True, slots=True)
class VehicleState:
    """What the vehicle last said of itself."""

    age_s: float
    """Since the newest position and attitude came, whatever else was heard since."""
    time_s: float
    """Vehicle time."""
    position_world_m: FloatArray
    """(3,)"""
    q_world_body: FloatArray
    """(4,)"""
    velocity_world_m_s: FloatArray
    """(3,)"""
    battery_v: float
    """0 when not measured."""
    mission: MissionState
    reason: str
    """Why it is in that state."""
    trajectory_time_s: float
    """Negative when no trajectory is being flown."""
    active_name: str
    """Name of the trajectory it holds; empty if none."""
    active_id: int
    active_crc32: int
    in_control: bool
    """Whether this station has control."""
    operator_system: int
    """System id of the station in control; 0 nobody."""


@dataclass(frozen=True, slots=True)
class Statistics:
    """How the link is doing."""

    counts: Counts
    refused_by_vehicle: int
    """Frames of anybody that the vehicle refused since its start."""


def connect(
    url: str = "udp://127.0.0.1:14550",
    *,
    key: bytes | Path | None = None,
    unsigned: bool = False,
    system_id: int = 255,
    timeout_s: float = 3.0,
) -> "Link":
    """Open the link and wait until the vehicle is heard.

    Args:
        key: 32 bytes, or a key file; None takes the default key file (`keys.default_path`).
        unsigned: talk without signatures, to a vehicle that does.
        system_id: of this ground station.
        timeout_s: silence longer than this is a dead link; on a busy machine, as many times longer as it is overloaded.

    Raises:
        LinkError: no vehicle answers.
        InputError: the address or the key cannot be used.
    """
    if not 1 <= system_id <= 255:
        raise InputError(f"system id {system_id} is not within 1 to 255")
    signing = None
    if not unsigned:
        secret = key if isinstance(key, bytes) else keys.load(key)
        if len(secret) != 32:
            raise InputError(f"a link key has 32 bytes, this one {len(secret)}")
        # a stream of our own, beside stations of the same id; others use 0
        signing = Signing(secret, 2 + secrets.randbelow(254))
    port = Port(url, Codec(system_id, 190, signing), timeout_s)
    try:
        port.wait_for_vehicle()
        return Link(port)
    except BaseException:
        port.close()
        raise


class Link:
    """A connection to one vehicle; made by `connect`, closed by leaving its block."""

    def __init__(self, port: Port) -> None:
        self._port = port

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Give control back and hang up."""
        if self._port.keep_lease:
            self._port.keep_lease = False
            self._port.send(LeaseRequest(nonce=secrets.randbits(32), action=0))
        self._port.close()

    # -- what the vehicle says -------------------------------------------------------------------------------------

    @property
    def state(self) -> VehicleState | None:
        """The vehicle's last word, or None before the first telemetry."""
        state, status = self._port.latest.get(State), self._port.latest.get(MissionStatus)
        if not isinstance(state, State) or not isinstance(status, MissionStatus):
            return None
        return VehicleState(
            age_s=time.monotonic() - self._port.heard_s[State],
            time_s=state.time_us * 1e-6,
            position_world_m=np.array(state.position_world_m),
            q_world_body=np.array(state.q_world_body),
            velocity_world_m_s=np.array(state.velocity_world_m_s),
            battery_v=state.battery_v,
            mission=MissionState(state.mission_state),
            reason=reason_text(status.reason),
            trajectory_time_s=state.trajectory_time_s,
            active_name=status.name,
            active_id=status.active_id,
            active_crc32=status.active_crc32,
            in_control=self._port.keep_lease,
            operator_system=status.operator_system,
        )

    @property
    def statistics(self) -> Statistics:
        status = self._port.latest.get(MissionStatus)
        refused = status.frames_refused if isinstance(status, MissionStatus) else 0
        return Statistics(self._port.codec.counts, refused)

    def clock_offset_s(self) -> tuple[float, float]:
        """Vehicle time minus our monotonic clock, and half a round trip (its bound), from the best of eight exchanges.

        Raises:
            LinkError: no answer.
        """
        best = (float("inf"), 0.0)
        for _ in range(8):
            asked_ns = time.monotonic_ns()
            answer = self._port.ask(
                Timesync(tc1=0, ts1=asked_ns), Timesync, lambda m, at=asked_ns: m.ts1 == at and m.tc1 > 0
            )
            trip_ns = time.monotonic_ns() - asked_ns
            best = min(best, (trip_ns * 0.5e-9, (answer.tc1 - (asked_ns + trip_ns // 2)) * 1e-9))
        return best[1], best[0]

    @property
    def version(self) -> AutopilotVersion | None:
        """Who the vehicle says it is; it tells every 5 s."""
        version = self._port.latest.get(AutopilotVersion)
        return version if isinstance(version, AutopilotVersion) else None

    def arming_checks(
        self, parameters: Mapping[str, float], start_world_m: FloatArray | None = None
    ) -> tuple[arming.ArmingCheck, ...]:
        """What must hold before the rotors start, as the vehicle last said; none before its first telemetry.

        Args:
            parameters: of the vehicle, by name.
            start_world_m: (3,) where the trajectory begins.
        """
        state = self._port.latest.get(State)
        return arming.checks(state, parameters, start_world_m) if isinstance(state, State) else ()

    # -- control ---------------------------------------------------------------------------------------------------

    def take_control(self, *, force: bool = False) -> None:
        """Become the station whose orders count; kept until the link closes, or another station takes over.

        A station that fell silent, such as this one before it was started anew, keeps control for 3 s more: that is
        waited for.

        Args:
            force: take it from the station that has it.

        Raises:
            LinkError: another station has control (and not `force`), or no answer.
        """
        status = self._port.lease(2 if force else 1)
        while not self._port.keep_lease:
            left_s, asked_s = status.left_ms * 1e-3, time.monotonic()
            time.sleep(_LEASE_POLL_S)
            status = self._port.lease(1)
            if status.left_ms * 1e-3 > left_s - 0.5 * (time.monotonic() - asked_s) and not self._port.keep_lease:
                raise LinkError(f"{station_words(status)} is in control of the vehicle; {_TAKE_OVER}")

    def command(self, command: Command, value: float = 0.0, *, plan: WirePlan | None = None) -> None:
        """Give an order and wait for its acknowledgement. START needs `plan`.

        Raises:
            LinkError: the vehicle refused, or did not answer.
        """
        reason = self.try_command(command, value, plan=plan)
        if reason:
            if reason == LinkReason.NOT_IN_CONTROL:
                self._refuse_without_control()
            raise _refused(command, reason)

    def order(self, command: Command, *, force: bool = False) -> None:
        """Give an order of the station in control: at once if we have it, else as soon as we have taken it.

        Asking first would cost a round trip. Who took control unnoticed is found by the vehicle's refusal.

        Args:
            force: take control from the station that has it.

        Raises:
            LinkError: as `take_control` and `command`.
        """
        if self._port.keep_lease and (reason := self.try_command(command)) != LinkReason.NOT_IN_CONTROL:
            if reason:
                raise _refused(command, reason)
            return
        self.take_control(force=force)
        self.command(command)

    def _need_control(self) -> None:
        """Take control if it is free; never back from a station that took it from us."""
        self._refuse_without_control()
        if not self._port.keep_lease:
            self.take_control()

    def _refuse_without_control(self) -> None:
        if self._port.control_lost:
            raise LinkError(f"{self._port.control_lost}; {_TAKE_OVER}")

    def try_command(self, command: Command, value: float = 0.0, *, plan: WirePlan | None = None) -> int:
        """The same; returns the reason code, 0 when done."""
        order = MissionCommand(request_id=secrets.randbits(32) or 1, command=command, value=value)
        if plan:
            order.trajectory_id, order.crc32 = plan.id, plan.crc32
        kill = command is Command.KILL
        return self._port.ask(
            order,
            MissionResult,
            lambda result: result.request_id == order.request_id,
            retry_s=_KILL_RETRY_S if kill else _RETRY_S,
            steady=kill,
        ).reason

    # -- trajectories ----------------------------------------------------------------------------------------------

    def upload(
        self,
        file: TrajectoryFile,
        *,
        map_hash: str | None = None,
        vehicle_hash: str | None = None,
        allow_unchecked: bool = False,
        on_link_loss: OnLinkLoss = OnLinkLoss.HOLD,
        rate_bytes_s: float = 1e6,
        progress: Progress = silent,
        cancel: Cancel = never,
    ) -> UploadReport:
        """Send a trajectory, commit it, read it back and compare.

        Args:
            map_hash, vehicle_hash: what it must have been checked against; None does not ask.
            allow_unchecked: send one that never passed the planner's final gate.
            rate_bytes_s: how fast the line takes it; lowered when the line turns out slower.

        Raises:
            InputError: it is not checked, was changed after its check, is for another map or vehicle, or does not fit
                into the vehicle.
            FormatError: what it was checked for is damaged.
            LinkError: the vehicle refused or stopped answering; the message says what it holds now.
        """
        refuse_unfit(file, map_hash, vehicle_hash, allow_unchecked)
        plan = wire.plan_from_file(file, on_link_loss=on_link_loss)
        self._need_control()
        try:
            result, report = transfer.upload(
                self._port, plan, file.trajectory, rate_bytes_s=rate_bytes_s, progress=progress, cancel=cancel
            )
        except LinkError as error:
            raise type(error)(f"{error}; {self._holds(plan)}") from error
        if result.reason:
            raise LinkError(f"the vehicle refused {file.name}: {_verdict(result)}; {self._holds(plan)}")
        self._compare(plan, cancel)
        progress("upload", 1.0)
        return report

    def _compare(self, plan: WirePlan, cancel: Cancel) -> None:
        held = self.read_back(cancel=cancel)
        if held is None or (held.id, held.crc32, held.name) != (plan.id, plan.crc32, plan.name):
            raise LinkError(f"what was read back is not what was sent; do not fly it. {self._holds(plan)}")

    def read_back(self, *, progress: Progress = silent, cancel: Cancel = never) -> WirePlan | None:
        """The trajectory the vehicle holds, bit for bit; None if it holds none.

        Raises:
            LinkError: the vehicle stopped answering.
        """
        return transfer.read_back(self._port, progress=progress, cancel=cancel)

    def _holds(self, sent: WirePlan) -> str:
        """What the vehicle holds after a failed upload, in words. It is asked, as a commit may have come through."""
        try:
            header = transfer.read_header(self._port)
        except LinkError:
            return "what it holds now is not known; connect again and read back before flying"
        if not header.trajectory_id:
            return "the vehicle holds no plan"
        held = f"plan {header.name} (crc {header.crc32:08x})"
        if (header.trajectory_id, header.crc32) == (sent.id, sent.crc32):
            return f"the vehicle holds {held}, the one that was sent"
        return f"the vehicle still holds {held}; nothing was changed"

    # -- flying and logs -------------------------------------------------------------------------------------------

    def fly(
        self,
        file: TrajectoryFile | None = None,
        *,
        rate_hz: float = 100.0,
        progress: Progress = silent,
        cancel: Cancel = never,
        ended_early: flying.KeepLog | None = None,
    ) -> FlightLog:
        """Arm, take off, fly the trajectory the vehicle holds, land, disarm; the flight's log.

        On the ground, what `arming.checks` looks at is required first.

        The log is the vehicle's own, fetched after landing (nothing is lost on the way); a vehicle without log
        memory is recorded from its telemetry at `rate_hz`.

        Args:
            file: what the vehicle should hold; refused when it holds something else.
            cancel: when it says so the vehicle brakes and lands, and `CancelledError` is raised.
            ended_early: is given the log of a flight that is not finished, once the rotors stand, before the error is
                raised; the metadata's `ended_early` has the reason.

        Raises:
            LinkError: not fit to arm, refused, the flight ended early, or the link died; the message says which.
        """
        self._need_control()
        return flying.fly(
            self, self._port, file, rate_hz=rate_hz, progress=progress, cancel=cancel, ended_early=ended_early
        )

    def download_log(self, *, progress: Progress = silent, cancel: Cancel = never) -> FlightLog:
        """The vehicle's on-board log of its last flight.

        Raises:
            LinkError: it has none, or stopped answering.
        """
        return flying.download_log(self._port, progress=progress, cancel=cancel)

    # -- parameters ------------------------------------------------------------------------------------------------

    def parameters(self) -> dict[str, float]:
        """All parameters of the controller by name.

        Raises:
            LinkError: the vehicle stopped answering.
        """
        return parameters.read(self._port)

    def set_parameters(self, values: dict[str, float]) -> None:
        """Change some parameters, all of them or none.

        Raises:
            InputError: a name the vehicle does not know, or a value that is not finite.
            LinkError: the vehicle refused a value (the message says which), or stopped answering.
        """
        self._need_control()
        parameters.write(self._port, values)


def _refused(command: Command, reason: int) -> LinkError:
    return LinkError(f"the vehicle refused to {command.name.lower().replace('_', ' ')}: {reason_text(reason)}")


_OTHERS_ONLY = {
    "start": "starts in motion, but the vehicle begins a trajectory from hover: plan it without a velocity there",
    "end": "ends in motion, but the vehicle hovers after a trajectory: plan it without a velocity there",
    "ground_world_m": "takes off or lands itself, which the vehicle does on its own: plan it without",
}
"""What the final gate allows a plan to ask for, and our controller does not fly."""


def refuse_unfit(file: TrajectoryFile, map_hash: str | None, vehicle_hash: str | None, allow_unchecked: bool) -> None:
    """What `Link.upload` asks of a file before anything is sent; raises as it does."""
    if not file.checked and not allow_unchecked:
        raise InputError(f"{file.name} has not passed the final gate; run `goshawk check` on it first")
    if map_hash is not None and file.map_hash != map_hash:
        raise InputError(
            f"{file.name} was checked in map {file.map_hash[:8] or '(none)'}, not in this one ({map_hash[:8]}); "
            "plan or check it again"
        )
    if vehicle_hash is not None and file.vehicle_hash != vehicle_hash:
        raise InputError(
            f"{file.name} was checked for vehicle {file.vehicle_hash[:8] or '(none)'}, "
            f"not for this one ({vehicle_hash[:8]}); check it again"
        )
    if file.checked and not file.as_checked:
        raise InputError(
            f"{file.name} was changed after its check; run `goshawk check --renew` on it, or plan it again"
        )
    asked = file.check.get("conditions") or {}
    if not isinstance(asked, Mapping):
        raise FormatError(f"the conditions in {file.name} are damaged: {asked!r}; plan or check it again")
    for name, words in _OTHERS_ONLY.items():
        if asked.get(name) is not None:
            raise InputError(f"{file.name} {words}; `goshawk export` writes it for other autopilots")


def _verdict(result: TrajectoryResult) -> str:
    where = f" (segment {result.segment})" if 13 <= result.reason <= 27 else ""
    return reason_text(result.reason) + where
