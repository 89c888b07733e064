"""A trajectory as it travels: centred float32 polynomials, integer microseconds, one CRC over all of it.

The only conversion there is: uploads with and without a link, benchmarks and tests all go through it.
"""

import hashlib
import struct
import zlib
from dataclasses import dataclass
from enum import IntEnum

import numpy as np

from firmware_bridge._controller import MAX_COEFFICIENTS, MAX_SEGMENTS
from firmware_bridge.dialect.generated.messages import TrajectoryBegin, TrajectorySamples, TrajectorySegment
from flight import FloatArray, InputError, Trajectory, TrajectoryFile, polynomial

SAMPLES = 8
"""TC_MAX_SAMPLES: how many check points travel with a trajectory."""
MIN_SEGMENT_US, MAX_SEGMENT_US = 20_000, 60_000_000
"""TC_MIN_SEGMENT_US, TC_MAX_SEGMENT_US."""
MAX_DURATION_US = 3_600_000_000
"""The longest trajectory that the vehicle's store lays out: one hour."""


class LinkLoss(IntEnum):
    """What to do when the ground falls silent while a trajectory is flown."""

    FINISH = 0
    HOLD = 1
    LAND = 2


@dataclass(frozen=True, slots=True, eq=False)
class WirePlan:
    """A trajectory ready to send, or as it was read back."""

    name: str
    durations_us: np.ndarray
    """(k,) uint32."""
    coefficients: np.ndarray
    """(k, 4, n) float32, ascending powers of s = 2 t / T - 1."""
    on_link_loss: LinkLoss
    clearance_m: float
    """Distance that the curve is proved to keep from obstacles; 0 when that is not known."""
    map_hash: bytes
    """First 8 bytes; zeros when there is none."""
    vehicle_hash: bytes
    id: int
    """Derived from all of the above; never 0."""

    @property
    def crc32(self) -> int:
        """`tc_trajectory_crc32` of the vehicle's trajectory.h."""
        k, _, n = self.coefficients.shape
        crc = zlib.crc32(struct.pack("<IHBBf", self.id, k, n, self.on_link_loss, self.clearance_m))
        return zlib.crc32(_segment_bytes(self.durations_us, self.coefficients), crc)

    def begin(self, transfer_id: int) -> TrajectoryBegin:
        return TrajectoryBegin(
            transfer_id=transfer_id,
            trajectory_id=self.id,
            crc32=self.crc32,
            clearance_m=self.clearance_m,
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
    """Convert a trajectory file, with its name, its hashes and the clearance that the final gate proved.

    Raises:
        InputError: as `plan_from_trajectory`.
    """
    return plan_from_trajectory(
        file.trajectory,
        name=file.name,
        map_hash=file.map_hash,
        vehicle_hash=file.vehicle_hash,
        clearance_m=proved_clearance_m(file),
        on_link_loss=on_link_loss,
    )


def plan_from_trajectory(
    trajectory: Trajectory,
    *,
    id: int | None = None,
    name: str = "trajectory",
    map_hash: str = "",
    vehicle_hash: str = "",
    clearance_m: float = 0.0,
    on_link_loss: LinkLoss = LinkLoss.HOLD,
) -> WirePlan:
    """Convert a trajectory for the wire.

    Joins are rounded to microseconds, not durations, so that rounding errors do not add up over many segments; each
    polynomial is stretched to its rounded duration.

    Args:
        id: 1 to 2^32 - 1; None derives it from the content.
        clearance_m: distance that the curve is proved to keep from obstacles; 0 when that is not known.

    Raises:
        InputError: the vehicle's store cannot hold it: too many segments or coefficients, segments too short or too
            long, numbers beyond float32, a bad id or clearance.
    """
    coefficients = _without_zero_powers(trajectory.coefficients)
    k, _, n = coefficients.shape
    if k > MAX_SEGMENTS:
        raise InputError(f"{name} has {k} segments; the vehicle stores {MAX_SEGMENTS}: plan with fewer waypoints")
    if n > MAX_COEFFICIENTS:
        raise InputError(f"{name} is of degree {n - 1}; the vehicle flies up to {MAX_COEFFICIENTS - 1}")
    if id is not None and not 0 < id < 2**32:
        raise InputError(f"trajectory id {id} is not within 1 to 2^32 - 1")
    if not 0.0 <= clearance_m <= np.finfo(np.float32).max:
        raise InputError(f"the clearance is {clearance_m:g} m; it must be finite and not negative (0: not known)")
    durations_us = _durations_us(trajectory, name)
    centred = polynomial.centred_from_seconds(coefficients, np.broadcast_to(trajectory.durations_s[:, None], (k, 4)))
    with np.errstate(over="ignore"):
        wire = np.ascontiguousarray(centred, dtype=np.float32)
    if not np.isfinite(wire).all():
        segment = int(np.argmin(np.isfinite(wire).all(axis=(1, 2))))
        raise InputError(
            f"segment {segment} of {name} has numbers beyond {np.finfo(np.float32).max:.3g}; plan it again"
        )
    ascii_name = name.encode("ascii", "replace")[:24].decode()
    short_map, short_vehicle = _short_hash(map_hash), _short_hash(vehicle_hash)
    if id is None:
        content = ascii_name.encode() + short_map + short_vehicle + struct.pack("<Bf", on_link_loss, clearance_m)
        content += _segment_bytes(durations_us, wire)
        id = int.from_bytes(hashlib.sha256(content).digest()[:4], "little") or 1
    clearance_m = float(np.float32(clearance_m))
    return WirePlan(ascii_name, durations_us, wire, on_link_loss, clearance_m, short_map, short_vehicle, id)


def proved_clearance_m(file: TrajectoryFile) -> float:
    """Room for the vehicle's tracking error: the clearance that the final gate proved, less the body's radius.

    0, not stated, when the file did not pass the gate or its report does not tell both.
    """
    clearance_m, radius_m = file.check.get("clearance_m"), file.check.get("body_radius_m")
    if not file.checked or not isinstance(clearance_m, int | float) or not isinstance(radius_m, int | float):
        return 0.0
    room_m = float(clearance_m) - float(radius_m)
    return room_m if np.isfinite(room_m) and room_m > 0.0 else 0.0


def _durations_us(trajectory: Trajectory, name: str) -> np.ndarray:
    """(k,) uint32, differences of the rounded joins, within what the vehicle stores."""
    joins_us = np.rint(trajectory.starts_s * 1e6)
    durations_us = np.diff(joins_us)
    wrong = (durations_us < MIN_SEGMENT_US) | (durations_us > MAX_SEGMENT_US)
    if wrong.any():
        i = int(wrong.argmax())
        raise InputError(
            f"segment {i} of {name} lasts {trajectory.durations_s[i]:g} s; "
            f"the vehicle takes {MIN_SEGMENT_US * 1e-6:g} to {MAX_SEGMENT_US * 1e-6:g} s"
        )
    if joins_us[-1] > MAX_DURATION_US:
        raise InputError(
            f"{name} lasts {trajectory.duration_s:g} s; the vehicle takes up to {MAX_DURATION_US * 1e-6:.0f} s"
        )
    return durations_us.astype(np.uint32)


def _without_zero_powers(coefficients: FloatArray) -> FloatArray:
    """The same polynomials without highest powers that are zero everywhere."""
    used = np.flatnonzero(np.any(coefficients != 0.0, axis=(0, 1)))
    return coefficients[..., : int(used[-1]) + 1 if used.size else 1]


def check_points(plan: WirePlan, trajectory: Trajectory) -> tuple[np.ndarray, np.ndarray]:
    """Points of the planner's own float64 curve, spread over the whole flight and off the joins.

    The vehicle compares them with its own evaluation of the plan.

    Returns:
        (SAMPLES,) uint32 microseconds from the start, and (SAMPLES, 4) float32 of x, y, z (m) and yaw (rad).
    """
    starts_us = np.concatenate([[0], np.cumsum(plan.durations_us.astype(np.int64))])
    times_us = ((np.arange(SAMPLES) + 0.37) / SAMPLES * starts_us[-1]).astype(np.int64)
    segment = np.searchsorted(starts_us, times_us, side="right") - 1
    # durations were rounded to microseconds: the same fraction of the segment is the same point
    fraction = (times_us - starts_us[segment]) / plan.durations_us[segment]
    local_s = fraction * trajectory.durations_s[segment]
    values = polynomial.evaluate(trajectory.coefficients[segment], local_s[:, None])
    return times_us.astype(np.uint32), values.astype(np.float32)


def samples(plan: WirePlan, trajectory: Trajectory, transfer_id: int) -> TrajectorySamples:
    """The check points as they travel."""
    times_us, values = check_points(plan, trajectory)
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
        clearance_m=header.clearance_m,
        map_hash=bytes(header.map_hash),
        vehicle_hash=bytes(header.vehicle_hash),
        id=header.trajectory_id,
    )
