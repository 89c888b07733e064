"""A trajectory as it travels: centred float32 polynomials, integer microseconds, one CRC over all of it."""

import hashlib
import struct
import zlib
from dataclasses import dataclass

import numpy as np

from firmware_bridge._controller import MAX_COEFFICIENTS, MAX_SEGMENTS
from firmware_bridge.controller import LinkLoss
from firmware_bridge.dialect.generated.messages import TrajectoryBegin, TrajectorySamples, TrajectorySegment
from flight import FloatArray, InputError, Trajectory, TrajectoryFile, polynomial

SAMPLES = 8
"""TC_MAX_SAMPLES: how many check points travel with a trajectory."""
MIN_SEGMENT_S, MAX_SEGMENT_S = 0.02, 60.0
"""TC_MIN_SEGMENT_US, TC_MAX_SEGMENT_US."""


@dataclass(frozen=True, slots=True, eq=False)
class WirePlan:
    """A trajectory ready to send, or as it was read back."""

    name: str
    durations_us: np.ndarray
    """(k,) uint32."""
    coefficients: np.ndarray
    """(k, 4, n) float32, ascending powers of s = 2 t / T - 1."""
    on_link_loss: LinkLoss
    map_hash: bytes
    """First 8 bytes; zeros when there is none."""
    vehicle_hash: bytes
    id: int
    """Derived from all of the above; never 0."""

    @property
    def crc32(self) -> int:
        """`tc_trajectory_crc32` of the vehicle's trajectory.h."""
        k, _, n = self.coefficients.shape
        crc = zlib.crc32(struct.pack("<IHBB", self.id, k, n, self.on_link_loss))
        return zlib.crc32(_segment_bytes(self.durations_us, self.coefficients), crc)

    def begin(self, transfer_id: int) -> TrajectoryBegin:
        return TrajectoryBegin(
            transfer_id=transfer_id,
            trajectory_id=self.id,
            crc32=self.crc32,
            segments=len(self.durations_us),
            coefficient_count=self.coefficients.shape[2],
            link_loss_policy=self.on_link_loss,
            samples=SAMPLES,
            map_hash=tuple(self.map_hash),
            vehicle_hash=tuple(self.vehicle_hash),
            name=self.name[:24],
        )

    def segment(self, transfer_id: int, index: int) -> TrajectorySegment:
        padded = np.zeros((MAX_COEFFICIENTS, 4), dtype=np.float32)
        padded[: self.coefficients.shape[2]] = self.coefficients[index].T
        return TrajectorySegment(
            transfer_id=transfer_id,
            duration_us=int(self.durations_us[index]),
            index=index,
            coefficients=tuple(padded.ravel().tolist()),
        )

    def trajectory(self) -> Trajectory:
        """The curve these numbers describe."""
        durations_s = self.durations_us.astype(np.float64) * 1e-6
        return Trajectory(
            durations_s,
            polynomial.seconds_from_centred(
                self.coefficients.astype(np.float64), np.broadcast_to(durations_s[:, None], (len(durations_s), 4))
            ),
        )


def _segment_bytes(durations_us: np.ndarray, coefficients: np.ndarray) -> bytes:
    k = len(durations_us)
    words = np.concatenate(
        [durations_us.astype("<u4")[:, None], coefficients.astype("<f4").reshape(k, -1).view("<u4")], axis=1
    )
    return words.tobytes()


def _short_hash(text: str) -> bytes:
    """The first 8 bytes of a hash in hex; zeros for an empty one."""
    try:
        return bytes.fromhex(text[:16]).ljust(8, b"\0")
    except ValueError:
        return hashlib.sha256(text.encode()).digest()[:8]


def plan_from_file(file: TrajectoryFile, *, on_link_loss: LinkLoss = LinkLoss.HOLD) -> WirePlan:
    """Convert a trajectory for the wire.

    Raises:
        InputError: the vehicle's store cannot hold it (too many segments or coefficients, segments too short or long).
    """
    durations_s, coefficients = file.trajectory.durations_s, _without_zero_powers(file.trajectory.coefficients)
    k, _, n = coefficients.shape
    if k > MAX_SEGMENTS:
        raise InputError(f"{file.name} has {k} segments; the vehicle stores {MAX_SEGMENTS}: plan with fewer waypoints")
    if n > MAX_COEFFICIENTS:
        raise InputError(f"{file.name} is of degree {n - 1}; the vehicle flies up to {MAX_COEFFICIENTS - 1}")
    if durations_s.min() < MIN_SEGMENT_S or durations_s.max() > MAX_SEGMENT_S:
        i = int(durations_s.argmin() if durations_s.min() < MIN_SEGMENT_S else durations_s.argmax())
        raise InputError(
            f"segment {i} of {file.name} lasts {durations_s[i]:g} s; "
            f"the vehicle takes {MIN_SEGMENT_S:g} to {MAX_SEGMENT_S:g} s"
        )
    durations_us = np.rint(durations_s * 1e6).astype(np.uint32)
    centred = polynomial.centred_from_seconds(coefficients, np.broadcast_to(durations_s[:, None], (k, 4)))
    wire = centred.astype(np.float32)
    name = file.name.encode("ascii", "replace")[:24].decode()
    map_hash, vehicle_hash = _short_hash(file.map_hash), _short_hash(file.vehicle_hash)
    content = name.encode() + map_hash + vehicle_hash + bytes([on_link_loss]) + _segment_bytes(durations_us, wire)
    identity = int.from_bytes(hashlib.sha256(content).digest()[:4], "little") or 1
    return WirePlan(name, durations_us, wire, on_link_loss, map_hash, vehicle_hash, identity)


def _without_zero_powers(coefficients: FloatArray) -> FloatArray:
    """The same polynomials without highest powers that are zero everywhere."""
    used = np.flatnonzero(np.any(coefficients != 0.0, axis=(0, 1)))
    return coefficients[..., : int(used[-1]) + 1 if used.size else 1]


def samples(plan: WirePlan, trajectory: Trajectory, transfer_id: int) -> TrajectorySamples:
    """Check points of the planner's own float64 curve, spread over the whole flight and off the joins."""
    starts_us = np.concatenate([[0], np.cumsum(plan.durations_us.astype(np.int64))])
    times_us = ((np.arange(SAMPLES) + 0.37) / SAMPLES * starts_us[-1]).astype(np.int64)
    segment = np.searchsorted(starts_us, times_us, side="right") - 1
    # durations were rounded to microseconds: the same fraction of the segment is the same point
    fraction = (times_us - starts_us[segment]) / plan.durations_us[segment]
    local_s = fraction * trajectory.durations_s[segment]
    values = polynomial.evaluate(trajectory.coefficients[segment], local_s[:, None])
    return TrajectorySamples(
        transfer_id=transfer_id, sample_us=tuple(times_us.tolist()), values=tuple(values.ravel().tolist())
    )


def plan_from_messages(header: TrajectoryBegin, segments: dict[int, TrajectorySegment]) -> WirePlan:
    """Put together what was read back."""
    ordered = [segments[i] for i in range(header.segments)]
    grid = np.array([s.coefficients for s in ordered], dtype=np.float32).reshape(len(ordered), MAX_COEFFICIENTS, 4)
    return WirePlan(
        name=header.name,
        durations_us=np.array([s.duration_us for s in ordered], dtype=np.uint32),
        coefficients=np.ascontiguousarray(grid.transpose(0, 2, 1)[..., : header.coefficient_count]),
        on_link_loss=LinkLoss(header.link_loss_policy),
        map_hash=bytes(header.map_hash),
        vehicle_hash=bytes(header.vehicle_hash),
        id=header.trajectory_id,
    )
