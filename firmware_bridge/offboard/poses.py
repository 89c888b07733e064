"""Where the vehicle is, as a tracking system says: one small interface, and a stream of TUM lines over UDP."""

import contextlib
import math
import socket
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from flight import FloatArray, InputError

SYNCHRONISED_S = 0.05
"""A first stamp at most this old is on our clock; another clock's offset is estimated."""
AHEAD_S = 0.02
"""A stamp further in the future is no pose's."""
_WINDOW = 1000
"""Poses whose least delay tells the offset between the clocks."""


@dataclass(frozen=True, slots=True)
class Pose:
    """One measurement."""

    time_s: float
    """When it was true, on the clock of the one who reads it."""
    position_world_m: FloatArray
    """(3,)."""
    q_world_body: FloatArray
    """(4,) w x y z, unit."""


Poses = Callable[[float], list[Pose]]
"""Given the time now, every pose that has come since the last call, oldest first. Never waits."""


def tum_line(pose: Pose) -> bytes:
    """`time x y z qx qy qz qw`: seconds, metres, and w last as in the TUM format."""
    w, x, y, z = pose.q_world_body
    values = (pose.time_s, *pose.position_world_m, x, y, z, w)
    return (" ".join(f"{value:.9f}" for value in values) + "\n").encode()


def from_tum(line: bytes) -> Pose | None:
    """The pose of a line; None for a comment, or what is no pose: eight finite numbers and a unit quaternion."""
    try:
        values = [float(word) for word in line.split()]
    except ValueError:
        return None
    if len(values) != 8 or not all(map(math.isfinite, values)):
        return None
    q = np.array([values[7], *values[4:7]])
    size = float(np.linalg.norm(q))
    return Pose(values[0], np.array(values[1:4]), q / size) if abs(size - 1.0) < 0.01 else None


class UdpPoses:
    """Poses as datagrams of TUM lines; call it as `Poses`.

    A sender on our clock (Unix time), by its first stamp, is believed ever after: late is late. Of another clock the
    offset is the least difference between arrival and stamp, so that only the delay beyond the least is seen: `delay_s`
    is what the least one is.
    """

    def __init__(self, host: str, port: int, *, delay_s: float = 0.0) -> None:
        """
        Args:
            port: 0 takes a free one.
            delay_s: age of a pose that comes without any queueing, where the sender's clock is not ours.

        Raises:
            InputError: the address cannot be listened at.
        """
        self._socket = socket.socket(type=socket.SOCK_DGRAM)
        try:
            self._socket.bind((host, port))
        except OSError as error:
            raise InputError(f"poses cannot be listened for at udp://{host}:{port}: {error}") from error
        self._socket.setblocking(False)
        self._delay_s = delay_s
        self._differences_s: deque[float] = deque(maxlen=_WINDOW)
        self._believed: bool | None = None

    @property
    def other_clock(self) -> bool:
        """Whether its stamps are of a clock that is not ours; not known before the first."""
        return self._believed is False

    @property
    def address(self) -> tuple[str, int]:
        host, port = self._socket.getsockname()
        return str(host), int(port)

    def __call__(self, now_s: float) -> list[Pose]:
        found: list[Pose] = []
        while True:
            try:
                content = self._socket.recv(65536)
            except BlockingIOError:
                return found
            for line in content.splitlines():
                told = from_tum(line)
                pose = self._on_our_clock(told, now_s) if told is not None else None
                if pose is not None:
                    found.append(pose)

    def _on_our_clock(self, pose: Pose, now_s: float) -> Pose | None:
        """None for a stamp of the future."""
        difference_s = now_s - pose.time_s
        if self._believed is None:
            self._believed = -AHEAD_S <= difference_s <= SYNCHRONISED_S
        if self._believed:
            return pose if difference_s >= -AHEAD_S else None
        self._differences_s.append(difference_s)
        offset_s = min(self._differences_s) - self._delay_s
        return Pose(pose.time_s + offset_s, pose.position_world_m, pose.q_world_body)

    def drop(self) -> None:
        """What has queued while nobody read: it is old, whatever its clock."""
        with contextlib.suppress(BlockingIOError):
            while True:
                self._socket.recv(65536)

    def close(self) -> None:
        self._socket.close()
