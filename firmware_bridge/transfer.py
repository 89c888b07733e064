"""Many pieces over a lossy or slow line: upload by selective repeat, reading by asking for what is missing.

The vehicle reports which pieces it has (a bitmap, again and again while some are missing). A piece is taken for lost,
and sent again, when one sent after it has arrived (RACK, RFC 8985), or when a report that must have seen it does not
name it: so nothing is sent twice without need, and no timer is guessed. How many pieces are under way follows what the
reports confirm, so that the ground sends no faster than the line carries.
"""

import itertools
import queue
import secrets
import time
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field

from firmware_bridge import wire
from firmware_bridge.dialect.generated.messages import (
    LinkReason,
    TrajectoryBegin,
    TrajectoryCommit,
    TrajectoryRead,
    TrajectoryResult,
    TrajectorySegment,
    TrajectoryStatus,
)
from firmware_bridge.dialect.message import Message
from firmware_bridge.line import RoundTrip
from firmware_bridge.port import Answer, Port
from flight import LinkError, Progress, Trajectory

Cancel = Callable[[], bool]
_SLACK_S = 0.004  # a report may be this much older than the round trip says: scheduling, reordering
_PROBE_S = 0.15  # without a report for so long, ask for one
_LONGEST_PROBE_S = 1.5
_FIRST_WINDOW, _FIRST_WINDOW_FAR, _FAR_S = 16, 4, 0.05  # pieces under way at first; where the round trip is long
_LEAST_WINDOW = 2
_FULL_LOSS, _FULL_LOSS_FAR = 0.75, 0.35
"""Of a window: a radio that loses so many is rarer than a line that is full; more so where the round trip is long."""
_LEAST_PROBES = 5  # a stalled machine is not a silent vehicle
_RESTARTS = 5
_LONGEST_GAP_S = 0.5
_SPAN = 512  # bits of a request
_AT_ONCE = 192  # pieces asked for with one request


class CancelledError(LinkError):
    """The caller asked to stop; the vehicle keeps what it had."""


_LOST = (10, 15, LinkReason.SAMPLES_MISSING)
"""Verdicts on a commit to a vehicle that has lost the upload: TC_NO_UPLOAD and TC_SEGMENTS_MISSING of `reason.h`."""


@dataclass(slots=True)
class UploadReport:
    """How an upload went."""

    segments: int
    datagrams: int
    """Sent for this upload, the opening and the commit included."""
    duration_s: float
    restarts: int
    """How often the vehicle had forgotten the transfer (it restarted) and it began anew."""


@dataclass(slots=True)
class Pacer:
    """Keeps to a byte rate and to a number of pieces under way.

    Both shrink when the round trip grows (a queue is filling) and recover when it does not. The window also shrinks to
    what arrived when most of it was lost; it grows by what arrives, slowly once it has been too large.
    """

    rate_bytes_s: float
    most_bytes_s: float
    next_s: float = 0.0
    shortest_rtt_s: float = float("inf")
    round_trip: RoundTrip = field(default_factory=RoundTrip)
    window: float = _FIRST_WINDOW
    slow_from: float = float("inf")
    """Window from which on it grows by one a round trip."""
    arrived: int = 0
    lost: int = 0
    crowded: bool = False
    """Of the present window."""

    def sent(self, frame_bytes: int, now_s: float) -> None:
        # a late wake-up may catch up 5 ms, not more: the line's queue is shallow
        self.next_s = max(self.next_s, now_s - 0.005) + frame_bytes / self.rate_bytes_s

    def measured(self, rtt_s: float) -> None:
        self.shortest_rtt_s = min(self.shortest_rtt_s, rtt_s)
        self.round_trip.measured(rtt_s)
        crowded = rtt_s > 2.0 * self.shortest_rtt_s + 0.03
        self.crowded |= crowded
        changed = self.rate_bytes_s * (0.8 if crowded else 1.02)
        self.rate_bytes_s = min(max(changed, 2e4), self.most_bytes_s)

    def fates(self, arrived: int, lost: int) -> None:
        """So many of the pieces under way are known to have arrived, or to be lost."""
        self.arrived, self.lost = self.arrived + arrived, self.lost + lost
        self.window += arrived if self.window < self.slow_from else arrived / self.window
        known = self.arrived + self.lost
        if known < self.window:
            return
        if self.lost > (_FULL_LOSS_FAR if self.round_trip.mean_s > 2.0 * _FAR_S else _FULL_LOSS) * known:
            self.window = self.slow_from = float(max(self.arrived, _LEAST_WINDOW))
        elif self.crowded:
            self.window = self.slow_from = max(0.7 * self.window, float(_LEAST_WINDOW))
        self.arrived, self.lost, self.crowded = 0, 0, False


@dataclass(slots=True)
class Outgoing:
    """Which pieces were sent when, and which the vehicle has."""

    pieces: list[Message]
    sent_at_s: dict[int, float] = field(default_factory=dict[int, float])
    """Of pieces under way: sent and not yet known to have arrived or been lost."""
    times_sent: dict[int, int] = field(default_factory=dict[int, int])
    waiting: list[int] = field(default_factory=list[int])
    arrived: set[int] = field(default_factory=set[int])

    def __post_init__(self) -> None:
        self.waiting = list(reversed(range(len(self.pieces))))

    @property
    def complete(self) -> bool:
        return len(self.arrived) == len(self.pieces)

    def next(self, now_s: float) -> Message | None:
        """The piece to send now, if one is waiting."""
        while self.waiting:
            index = self.waiting.pop()
            if index not in self.arrived:
                self.sent_at_s[index] = now_s
                self.times_sent[index] = self.times_sent.get(index, 0) + 1
                return self.pieces[index]
        return None

    def newest(self) -> Message:
        """The piece not known to have arrived that was sent last; sent once more it is not counted (RFC 8985, TLP)."""
        lacking = [i for i in range(len(self.pieces)) if i not in self.arrived]
        index = max(lacking, key=lambda i: self.sent_at_s.get(i, 0.0))
        self.times_sent[index] = self.times_sent.get(index, 0) + 1
        return self.pieces[index]

    def reported(self, status: TrajectoryStatus, now_s: float, pacer: Pacer) -> bool:
        """Take a report in: what arrived, and what must have been lost. Whether it shows something new."""
        last = status.last_index
        present = {i for i in range(status.segments) if status.bitmap[i // 8] >> (i % 8) & 1}
        if last in present and self.times_sent.get(last) == 1 and last in self.sent_at_s:
            pacer.measured(now_s - self.sent_at_s[last])
        if status.samples:
            present.add(len(self.pieces) - 1)
        newest_s = max(
            (self.sent_at_s[i] for i in present if i in self.sent_at_s and self.times_sent[i] == 1), default=0.0
        )
        new = present - self.arrived
        self.arrived |= present
        for index in present:
            self.sent_at_s.pop(index, None)
        seen_before_s = max(now_s - pacer.round_trip.longest_s, newest_s) - _SLACK_S
        lost = [index for index, at_s in self.sent_at_s.items() if at_s < seen_before_s]
        for index in lost:
            del self.sent_at_s[index]
        self.waiting.extend(sorted(lost, reverse=True))
        pacer.fates(len(new), len(lost))
        return bool(new)


def upload(
    port: Port, plan: wire.WirePlan, trajectory: Trajectory, *, rate_bytes_s: float, progress: Progress, cancel: Cancel
) -> tuple[TrajectoryResult, UploadReport]:
    """Send a plan into the staging slot and commit it; the vehicle's verdict and how it went.

    Raises:
        LinkError: the vehicle stopped answering, refused the beginning, or another station began an upload.
        CancelledError: `cancel` said so.
    """
    started_s = time.monotonic()
    sent_before = port.codec.counts.sent
    pacer = Pacer(rate_bytes_s, rate_bytes_s)
    for restarts in range(_RESTARTS):
        transfer_id = secrets.randbits(32) or 1
        result = _attempt(port, plan, trajectory, transfer_id, pacer, progress, cancel)
        if result is not None:
            sent = port.codec.counts.sent - sent_before
            report = UploadReport(len(plan.durations_us), sent, time.monotonic() - started_s, restarts)
            return result, report
    raise LinkError(f"the vehicle lost the upload {_RESTARTS} times because it restarts; check its power supply")


def _attempt(
    port: Port,
    plan: wire.WirePlan,
    trajectory: Trajectory,
    transfer_id: int,
    pacer: Pacer,
    progress: Progress,
    cancel: Cancel,
) -> TrajectoryResult | None:
    """One transfer from beginning to commit; None when the vehicle no longer knows it."""
    with port.inbox(TrajectoryStatus, TrajectoryResult) as inbox:
        asked_s = time.monotonic()
        opened = port.ask(
            plan.begin(transfer_id), TrajectoryStatus, lambda s: s.transfer_id == transfer_id, retry_s=0.06
        )
        if opened.reason:
            return _refused(port, transfer_id, opened)
        if pacer.round_trip.mean_s <= 0.0:
            pacer.round_trip.measured(port.line.round_trip.mean_s or time.monotonic() - asked_s)
            pacer.window = _FIRST_WINDOW_FAR if pacer.round_trip.mean_s > _FAR_S else _FIRST_WINDOW
        pieces: list[Message] = [plan.segment(transfer_id, i) for i in range(len(plan.durations_us))]
        pieces.append(wire.samples(plan, trajectory, transfer_id))
        outgoing = Outgoing(pieces)
        heard_s = gained_s = probed_s = time.monotonic()
        unanswered = 0
        while not outgoing.complete:
            now_s = time.monotonic()
            if cancel():
                raise CancelledError("upload cancelled")
            if not port.keep_lease:
                raise LinkError(port.control_lost or "another station took control of the vehicle")
            if now_s - heard_s > port.timeout_s and unanswered >= _LEAST_PROBES:
                raise port.silence()
            if now_s - max(gained_s, probed_s) > _probe_s(pacer.round_trip, unanswered):
                probed_s = now_s
                unanswered += 1
                # a known beginning is answered with a report and shows a restart; a piece may be the one lacking
                port.send(outgoing.newest() if unanswered % 2 else plan.begin(transfer_id))
            may_send = now_s >= pacer.next_s and len(outgoing.sent_at_s) < pacer.window
            if may_send and (piece := outgoing.next(now_s)) is not None:
                before = port.codec.counts.sent_bytes
                port.send(piece)
                pacer.sent(port.codec.counts.sent_bytes - before, now_s)
                gained_s = now_s
            ready = outgoing.waiting and len(outgoing.sent_at_s) < pacer.window
            wait_s = pacer.next_s - time.monotonic() if ready else 0.02
            for status in _drain(inbox, wait_s):
                if not isinstance(status, TrajectoryStatus):
                    continue
                heard_s = time.monotonic()
                if status.transfer_id == 0:
                    return None
                if status.transfer_id != transfer_id:
                    continue  # an older report, still under way when this transfer began
                if status.reason:
                    return _refused(port, transfer_id, status)
                if outgoing.reported(status, heard_s, pacer):
                    gained_s, unanswered = heard_s, 0
                progress("upload", 0.95 * len(outgoing.arrived) / len(pieces))
        commit = TrajectoryCommit(transfer_id=transfer_id, trajectory_id=plan.id, crc32=plan.crc32)
        result = port.ask(
            commit, TrajectoryResult, lambda r: r.transfer_id == transfer_id, retry_s=pacer.round_trip.mean_s + 0.015
        )
        return None if result.reason in _LOST else result  # every piece had arrived: only a restart loses them


def _probe_s(round_trip: RoundTrip, unanswered: int) -> float:
    """How long to wait for a report before asking for one."""
    return max(min(_PROBE_S * 2.0**unanswered, _LONGEST_PROBE_S), 1.5 * round_trip.mean_s)


def _refused(port: Port, transfer_id: int, status: TrajectoryStatus) -> TrajectoryResult | None:
    """The verdict in a refusing report; None if all that is missing is control, lost in a restart and taken again."""
    if status.reason == LinkReason.NOT_IN_CONTROL and port.keep_lease:
        port.lease(1)
        if port.keep_lease:
            return None
    return TrajectoryResult(transfer_id=transfer_id, reason=status.reason, segment=status.last_index)


def _drain(inbox: "queue.SimpleQueue[Message]", wait_s: float) -> Iterable[Message]:
    """All messages that are there, after waiting for the first one at most so long."""
    try:
        yield inbox.get(timeout=max(wait_s, 0.0)) if wait_s > 0.0 else inbox.get_nowait()
        while True:
            yield inbox.get_nowait()
    except queue.Empty:
        return


def collect(
    port: Port,
    count: int,
    request: Callable[[int, tuple[int, ...]], Message],
    kind: type[Answer],
    index: Callable[[Answer], int | None],
    *,
    stage: str,
    progress: Progress,
    cancel: Cancel,
) -> dict[int, Answer]:
    """Ask for the missing ones of pieces 0 to count - 1, a window at a time, until all are there.

    Args:
        request: the message that asks for the pieces whose bits are set, counted from its first argument on.
        index: which piece an answer is; None if it belongs to something else.

    Raises:
        LinkError: nothing new came within the time-out.
        CancelledError: `cancel` said so.
    """
    found: dict[int, Answer] = {}
    heard_s = time.monotonic()
    first = unanswered = 0
    gap_s = 0.0  # between pieces, smoothed: a slow line is not a silent one
    with port.inbox(kind) as inbox:
        while len(found) < count:
            if cancel():
                raise CancelledError(f"{stage} cancelled")
            if time.monotonic() - heard_s > port.timeout_s and unanswered > _LEAST_PROBES:
                raise port.silence()
            unanswered += 1
            while first in found:
                first += 1
            span = range(first, min(first + _SPAN, count))
            missing = set(itertools.islice((i for i in span if i not in found), _AT_ONCE))
            port.send(request(first, _bits(i - first for i in missing)))
            quiet_s = max(0.1, port.line.round_trip.longest_s, 2.0 * gap_s)
            while missing:
                try:
                    answer = inbox.get(timeout=quiet_s)
                except queue.Empty:
                    break
                if isinstance(answer, kind) and (i := index(answer)) is not None and 0 <= i < count:
                    found[i] = answer
                    missing.discard(i)
                    now_s = time.monotonic()
                    gap_s += 0.25 * (min(now_s - heard_s, _LONGEST_GAP_S) - gap_s)
                    quiet_s, unanswered = max(0.03, 4.0 * gap_s), 0
                    progress(stage, len(found) / count)
                    heard_s = time.monotonic()  # what the caller did meanwhile is no gap
    return found


def _bits(indices: Iterable[int]) -> tuple[int, ...]:
    """The bytes of a request whose bits are set at these indices."""
    value = sum(1 << i for i in indices)
    return tuple(value.to_bytes(_SPAN // 8, "little"))


def read_header(port: Port) -> TrajectoryBegin:
    """Name, id and CRC of the active trajectory; id 0 if there is none.

    Raises:
        LinkError: the vehicle stopped answering.
    """
    transfer_id = secrets.randbits(32) or 1
    request = TrajectoryRead(transfer_id=transfer_id)
    return port.ask(request, TrajectoryBegin, lambda begin: begin.transfer_id == transfer_id)


def read_back(port: Port, *, progress: Progress, cancel: Cancel) -> wire.WirePlan | None:
    """The active trajectory as the vehicle holds it; None if it holds none.

    Raises:
        LinkError: the vehicle stopped answering, or what came does not fit its CRC.
    """
    header = read_header(port)
    transfer_id = header.transfer_id
    if header.trajectory_id == 0:
        return None
    segments = collect(
        port,
        header.segments,
        lambda first, wanted: TrajectoryRead(transfer_id=transfer_id, first=first, wanted=wanted),
        TrajectorySegment,
        lambda segment: segment.index if segment.transfer_id == transfer_id else None,
        stage="read back",
        progress=progress,
        cancel=cancel,
    )
    plan = wire.plan_from_messages(header, segments)
    if plan.crc32 != header.crc32:
        raise LinkError(f"what was read back has CRC {plan.crc32:08x}, its header says {header.crc32:08x}; read again")
    return plan
