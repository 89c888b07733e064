"""Flights from logs: cut at gaps, thinned to nodes, each block's readings and the rotor speed between nodes."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from flight import FlightLog, InputError, Progress, silent
from flight.frames import GRAVITY_M_S2
from flight.rotations import FloatArray
from sysid.estimator import segments
from sysid.estimator.blocks.catalogue import BLOCKS
from sysid.estimator.flights import clocks
from sysid.estimator.flights.flight_data import Flight, IndexArray, LeadIn
from sysid.estimator.flights.sampling import Stretch
from sysid.estimator.motors import battery, motor, rotor_speed
from sysid.estimator.options import Options
from sysid.estimator.without_pose.excited import require_range
from sysid.logs.apply import apply
from sysid.logs.checks import contact, gyro_clock, rotor_count
from sysid.logs.checks.clocks import Offset
from sysid.logs.checks.motion import kinematics
from sysid.logs.checks.payload import carries_payload
from sysid.logs.events import recording
from sysid.logs.events.event import splits
from sysid.logs.events.repair import Span
from sysid.logs.events.stamps import longest_pause_s
from sysid.logs.motors import full_throttle
from sysid.logs.sensors import low_pass
from vehicle import Vehicle

LEAD_IN_S = 0.3
"""Where only commands are known, this much is given to the rotors to reach the speed that nobody measured."""
EDGE_S = 0.03
"""Nothing is fitted this close to the ends of a stretch: a stream that is late or early has no samples for it there."""
SLOWEST_S = 0.5
"""Samples further apart than this show no motion of a multirotor; the time is in another unit."""
SHORTEST_S = 1.0
"""Pieces between gaps that are shorter say nothing and are left out."""

Gap = tuple[float, float, str]
"""Begin and end, on the log's clock, and what is missing."""


@dataclass(frozen=True, slots=True)
class _Source:
    """Which quantities of a log the estimator is going to use."""

    name: str
    nodes: tuple[str, ...]
    """Quantities that must be there at every node: the pose, or the IMU."""
    rotors: str
    """`rotor_speed_rad_s`, or the command."""


def prepare_all(
    logs: Sequence[FlightLog], options: Options, models: Iterable[Vehicle], progress: Progress = silent
) -> list[Flight]:
    """Flights of all logs, one after the other, flown where the models fly; of long ones, chosen segments.

    Raises:
        InputError: a log cannot be used, has more or fewer rotors than a model, or the models' gravities differ.
    """
    models = list(models)
    gravity_m_s2 = gravity_of(models)
    for i, log in enumerate(logs):
        for model in models:
            rotor_count.require(log, model, str(log.metadata.get("name", f"flight {i}")))
    logs = [full_throttle.by_limit(log, models[0].limits.rotor_speed_max_rad_s) for log in logs]
    long = segments.are_long(logs, options)
    flights = [
        flight
        for i, log in enumerate(logs)
        for flight in prepare(log, i, options, gravity_m_s2=gravity_m_s2, in_segments=long)
    ]
    if options.anchors and any(flight.has_pose for flight in flights):
        raise InputError(
            "hover commands and a rotor's thrust are for flights without a pose, and these have one: leave --hover and "
            "--rotor-thrust out"
        )
    return segments.chosen(flights, models[0], options, progress) if long else flights


def require_pose(flights: Iterable[Flight]) -> None:
    """Raises `InputError` if a flight shows no motion to compare models by."""
    for flight in flights:
        if not flight.has_pose:
            raise InputError(f"{flight.name} has no pose; models are compared along a measured motion")


def gravity_of(models: Iterable[Vehicle]) -> float:
    """Gravity where the models fly, m/s2. Raises `InputError` if it is not the same for all."""
    first, *others = models
    for other in others:
        if other.gravity_m_s2 != first.gravity_m_s2:
            raise InputError(
                f"gravity is {first.gravity_m_s2:g} m/s2 for {first.name} and {other.gravity_m_s2:g} for {other.name}; "
                "a flight has one: give --gravity"
            )
    return first.gravity_m_s2


def prepare(
    log: FlightLog,
    index: int,
    options: Options,
    *,
    gravity_m_s2: float = GRAVITY_M_S2,
    in_segments: bool = False,
) -> list[Flight]:
    """Flights without gaps from one log, less what was flown on the ground or in contact.

    Args:
        in_segments: cut them into segments.

    Raises:
        InputError: it has neither pose nor IMU, or neither rotor speed nor command, or there is a gap and the options
            refuse gaps.
    """
    source = _source(log, str(log.metadata.get("name", f"flight {index + 1}")))
    if source.nodes[0] != "position_world_m":
        require_range(log, source.name)
    log = _without_leaps(log, source.name, options)
    touched = contact.spans(log)
    pieces = _aloft(_split(log, source, options), touched, source.name)
    if in_segments:
        pieces = segments.cut(pieces)
    flights = [_flight(log, piece, source, index, len(pieces), options) for piece in pieces]
    left_out = contact.sentence(source.name, touched) if touched else ""
    clock = _gyro_clock(log) if any(clocks.GYRO in flight.streams for flight in flights) else None
    return [replace(f, left_out=left_out, gyro_clock=clock, gravity_m_s2=gravity_m_s2) for f in flights]


def _gyro_clock(log: FlightLog) -> Offset | None:
    motion = kinematics(log)
    return gyro_clock.after_attitude(log, motion) if motion is not None else None


def _aloft(pieces: list[Span], touched: Sequence[Span], name: str) -> list[Span]:
    """The pieces less the stretches in contact; what is left of them and too short says nothing.

    Raises:
        InputError: nothing is left.
    """
    for start_s, end_s in touched:
        parts = [part for a, b in pieces for part in ((a, min(b, start_s)), (max(a, end_s), b))]
        pieces = [(a, b) for a, b in parts if b - a >= SHORTEST_S]
    if not pieces:
        raise InputError(f"{contact.sentence(name, tuple(touched))}; no stretch of {SHORTEST_S:g} s in the air is left")
    return pieces


def _source(log: FlightLog, name: str) -> _Source:
    pose, imu = ("position_world_m", "q_world_body"), ("rate_body_rad_s", "specific_force_body_m_s2")
    if not all(log.has(q) for q in pose) and not all(log.has(q) for q in imu):
        missing = " and ".join(q for q in pose if not log.has(q))
        raise InputError(f"{name} has no {missing}; without them it needs both gyro and accelerometer")
    rotors = rotor_speed.QUANTITY if log.has(rotor_speed.QUANTITY) else motor.QUANTITY
    if not log.has(rotors) and full_throttle.has_ratios(log):
        raise InputError(
            f"{name} has motor commands from 0 to 1 and no rotor speed: give the speed at full throttle "
            "(goshawk log import --full-throttle RPM)"
        )
    if not log.has(rotors):
        raise InputError(
            f"{name} has no rotor_speed_rad_s and no rotor_speed_command_rad_s: something must drive the model. "
            "Record rotor speed (ESC telemetry), or map motor commands, scaled to 0 to 1, as "
            f"{full_throttle.RATIOS[0]} and so on"
        )
    return _Source(name, pose if all(log.has(q) for q in pose) else imu, rotors)


def gaps(log: FlightLog) -> list[Gap]:
    """Stretches without the pose (or IMU) or the rotor speed (or command) that a fit needs, in order.

    Raises:
        InputError: as `prepare`, but not for gaps.
    """
    log = full_throttle.by_limit(log, 1.0)
    pose_s, rotor_s, kind = _sampled(log, _source(log, str(log.metadata.get("name", "flight"))))
    return sorted(_gaps(pose_s, kind) + _gaps(rotor_s, "rotor speed"))


def gaps_sentence(found: Sequence[Gap]) -> str:
    """Of one gap or more: the first one, and how many there are besides."""
    begin, end, what = found[0]
    more = f" and {len(found) - 1} more gaps" if len(found) > 1 else ""
    return f"no {what} from {begin:.3f} s to {end:.3f} s ({end - begin:.3f} s){more}"


def _sampled(log: FlightLog, source: _Source) -> tuple[FloatArray, FloatArray, str]:
    """When pose (or IMU) and when rotor speed (or command) were sampled, and which of the former it is."""
    name = source.name
    pose_s = log.time_s[_finite_rows(log, source.nodes, name)]
    rotor_s = log.time_s[_finite_rows(log, (source.rotors,), name)]
    kind = "pose" if source.nodes[0] == "position_world_m" else "IMU"
    usual_s = float(np.median(np.diff(pose_s)))
    if usual_s >= SLOWEST_S:
        raise InputError(
            f"{name} has one {kind} sample every {usual_s:.3g} s: its time is in another unit, or it is too slow to "
            "fit; time_s must be in seconds"
        )
    return pose_s, rotor_s, kind


def _split(log: FlightLog, source: _Source, options: Options) -> list[Span]:
    """Start and end of each stretch where both pose (or IMU) and rotor speed (or command) were sampled, and went on."""
    name = source.name
    pose_s, rotor_s, kind = _sampled(log, source)
    cuts = splits(log)
    found = [gap for gap in sorted(_gaps(pose_s, kind) + _gaps(rotor_s, "rotor speed")) if not _cut_there(gap, cuts)]
    if found and options.gaps == "refuse":
        raise InputError(
            f"{name} has {gaps_sentence(found)}; "
            "fit the pieces between as separate flights with gaps='split', or cut the log there"
        )
    out = [*cuts, *((begin, end) for begin, end, _ in found)]
    pieces = _outside(max(pose_s[0], rotor_s[0]), min(pose_s[-1], rotor_s[-1]), out)
    if not pieces:
        raise InputError(f"{name} has no stretch of {SHORTEST_S:g} s with both pose and rotor speed")
    return pieces


def _without_leaps(log: FlightLog, name: str, options: Options) -> FlightLog:
    """The log, split or without a value where its pose leaps.

    Raises:
        InputError: it leaps, and the options refuse gaps.
    """
    broken = [] if options.robust and options.gaps == "refuse" else recording.leaps(log)
    if broken and options.gaps == "refuse":
        more = f" (and {len(broken) - 1} more)" if len(broken) > 1 else ""
        raise InputError(
            f"{name}: {broken[0].sentence}{more}; fit the pieces between as separate flights with gaps='split', or "
            "write a log that is mended there with `goshawk log fix`"
        )
    for event in broken:
        if event.repair is not None:
            log = apply(log, event.repair)
    return log


def _cut_there(gap: Gap, cuts: list[Span]) -> bool:
    return any(begin_s < gap[1] and gap[0] < end_s for begin_s, end_s in cuts)


def _outside(start_s: float, end_s: float, out: list[Span]) -> list[Span]:
    """What is left of a stretch without these, less what is too short to say anything."""
    pieces: list[Span] = []
    for begin, end in sorted(out):
        pieces.append((start_s, min(begin, end_s)))
        start_s = max(start_s, end)
    return [(a, b) for a, b in [*pieces, (start_s, end_s)] if b - a >= SHORTEST_S]


def _finite_rows(log: FlightLog, quantities: tuple[str, ...], name: str) -> IndexArray:
    values = np.concatenate([log.vector(quantity) for quantity in quantities], axis=1)
    finite = np.isfinite(values).all(axis=1)
    partly = np.isfinite(values).any(axis=1) & ~finite
    if partly.any():
        row = int(np.flatnonzero(partly)[0])
        raise InputError(
            f"{name}: in {int(partly.sum())} rows (the first is row {row}, {log.time_s[row]:.3f} s) some columns of "
            f"{' and '.join(quantities)} are finite and others not; where nothing was sampled, write NaN in all of them"
        )
    if finite.sum() < 10:
        raise InputError(
            f"{name} has {int(finite.sum())} samples of {' and '.join(quantities)}; at least 10 are needed"
        )
    return np.flatnonzero(finite)


def _gaps(time_s: FloatArray, what: str) -> list[Gap]:
    step_s = np.diff(time_s)
    gaps_at = np.flatnonzero(step_s > longest_pause_s(step_s))
    return [(float(time_s[i]), float(time_s[i + 1]), what) for i in gaps_at]


def _flight(
    log: FlightLog, piece: tuple[float, float], source: _Source, index: int, pieces: int, options: Options
) -> Flight:
    start_s, end_s = piece
    log = log.slice(start_s, np.nextafter(end_s, np.inf))
    inside = np.ones(len(log), dtype=bool)
    by_command = source.rotors != rotor_speed.QUANTITY
    edge_s = 0.0 if by_command else EDGE_S
    nodes = (log.time_s >= start_s + edge_s) & (log.time_s <= end_s - edge_s)
    rows = np.flatnonzero(nodes & np.isfinite(log.vector(source.nodes[0])).all(axis=1))
    rows = rows[_thin(log.time_s[rows], options.node_rate_hz)]
    stretch = Stretch(log, source.name, inside, rows, source.nodes[0] == "position_world_m", options)
    readings = {quantity: values for block in BLOCKS for quantity, values in block.read(stretch).items()}
    streams = {q: stretch.stream(q) for q in (clocks.GYRO, clocks.ACCELEROMETER) if np.isfinite(readings[q]).any()}
    if by_command:
        command = streams[motor.QUANTITY] = motor.read(stretch)
        speed = command.means(stretch.time_s)[0]
        acceleration = np.zeros_like(speed)
    else:
        streams[rotor_speed.QUANTITY] = stretch.stream(rotor_speed.QUANTITY)
        speed, acceleration = streams[rotor_speed.QUANTITY].means(stretch.time_s)
    flight = Flight(
        name=source.name if pieces == 1 else f"{source.name} from {start_s:.2f} s",
        log_index=index,
        time_s=stretch.time_s,
        readings=readings,
        rotor_speed_rad_s=speed,
        rotor_acceleration_rad_s2=acceleration,
        rotor_command_rad_s=speed if by_command else np.full_like(speed, np.nan),
        battery_v=battery.read(stretch),
        streams=streams,
        carries_payload=carries_payload(log),
        commands_on_time=by_command and not options.estimate_command_delay,
        full_throttle_rad_s=log.metadata.get(full_throttle.KEY) if by_command else None,
        accelerometer_low_pass=low_pass.of(log),
    )
    return _after_lead_in(flight) if by_command else flight


def _after_lead_in(flight: Flight) -> Flight:
    """The flight less its first moments, in which rotor speed still depends on what was before the log."""
    m = int(np.searchsorted(flight.time_s, flight.time_s[0] + LEAD_IN_S))
    own = {name: getattr(flight, name) for name in Flight.__slots__}
    cropped = {name: value[m:] if isinstance(value, np.ndarray) else value for name, value in own.items()}
    readings = {quantity: values[m:] for quantity, values in flight.readings.items()}
    before = LeadIn(flight.step_s[:m], flight.rotor_command_rad_s[:m], flight.battery_v[:m])
    return Flight(**{**cropped, "readings": readings, "lead_in": before})


def _thin(time_s: FloatArray, rate_hz: float) -> IndexArray:
    """Indices so that no more than about `rate_hz` remain per second."""
    every = max(1, int(np.floor(1.0 / (float(np.median(np.diff(time_s))) * rate_hz) + 0.5)))
    return np.arange(0, len(time_s), every)
