"""A pilot's mission: waypoints, and what is asked besides: laps, stays, gates, speeds of legs, a tube, take-off ...

It is kept in the waypoints file. Each kind of request is a plain record of its own; a file without any is what older
versions wrote, and is read and written as such.
"""

from dataclasses import dataclass, fields, replace
from itertools import pairwise
from pathlib import Path
from typing import Any, Literal, cast

import numpy as np

from flight import file_format, project
from flight.errors import FormatError, InputError
from flight.project import Waypoints
from flight.rotations import FloatArray

MOST_LAPS = 100
MOST_TUBE_POINTS = 1000
SLIMMEST_M = 0.05
"""Least radius of a tube: the planner itself keeps 2 cm from its surface."""
MOST_TURNED_RAD = 100.0
"""Largest heading to hold: some 16 turns, far more than a mission winds up and less than a heading in millidegrees."""
FARTHEST_M = 1e6
"""Largest coordinate of a point to look at."""


@dataclass(frozen=True, slots=True)
class Laps:
    """Waypoints `first` to `last`, and back to `first`, flown `count` times; those before lead in, those after out."""

    count: int
    first: int = 0
    last: int = -1
    """-1: the last waypoint, so that nothing leads out."""

    def ends(self, count: int) -> tuple[int, int]:
        """First and last waypoint of the laps, of so many waypoints that are listed."""
        return self.first, self.last if self.last >= 0 else count + self.last


@dataclass(frozen=True, slots=True)
class Stay:
    """Hovering at a waypoint."""

    waypoint: int
    duration_s: float


@dataclass(frozen=True, slots=True)
class Velocity:
    """The velocity to have at a waypoint; at the first or last one the path then starts or ends in motion."""

    waypoint: int
    velocity_world_m_s: tuple[float, float, float]


@dataclass(frozen=True, slots=True)
class FlyBy:
    """An inner waypoint that need only be passed within a radius."""

    waypoint: int
    radius_m: float


@dataclass(frozen=True, slots=True)
class Gate:
    """An upright or turned rectangle round an inner waypoint, anywhere in which the path may pass, forwards."""

    waypoint: int
    width_m: float
    """Of the opening for the vehicle's centre; what surrounds it belongs into the map."""
    height_m: float
    heading_rad: float
    """Of the horizontal direction in which it is passed, from x towards y."""
    pitch_rad: float = 0.0
    """How far that direction points upwards."""
    roll_rad: float = 0.0
    """How far the rectangle is turned about that direction, clockwise as seen by who flies through."""

    @property
    def edges_m(self) -> FloatArray:
        """(2, 3) world vectors from its centre to the middle of its left and of its upper edge."""
        h, p, r = self.heading_rad, self.pitch_rad, self.roll_rad
        level = np.array([-np.sin(h), np.cos(h), 0.0])
        upright = np.array([-np.sin(p) * np.cos(h), -np.sin(p) * np.sin(h), np.cos(p)])
        left, up = np.cos(r) * level + np.sin(r) * upright, np.cos(r) * upright - np.sin(r) * level
        return np.stack([0.5 * self.width_m * left, 0.5 * self.height_m * up])


@dataclass(frozen=True, slots=True)
class KeepIn:
    """A tube that the whole path stays in."""

    radius_m: float
    polyline_world_m: tuple[tuple[float, float, float], ...] | None = None
    """Its middle, say a recorded walk; None: straight lines from waypoint to waypoint."""


@dataclass(frozen=True, slots=True)
class LegSpeed:
    """The largest speed from waypoint `first` to waypoint `last`.

    With laps, one that spans all of them also holds on the way back to their first waypoint; the way out of the laps
    counts as the leg after their last waypoint, though it begins at the first.
    """

    first: int
    last: int
    speed_m_s: float


@dataclass(frozen=True, slots=True)
class LegJerk:
    """The largest jerk from waypoint `first` to waypoint `last`; with laps as `LegSpeed`."""

    first: int
    last: int
    jerk_m_s3: float


@dataclass(frozen=True, slots=True)
class Ground:
    """A take-off from, or landing on, the point vertically below the first or last waypoint's height."""

    position_world_m: tuple[float, float, float]
    """Of the vehicle's centre when it stands there."""
    climb_m_s: float = 1.0
    """Vertical speed at which the path is joined, or left."""


@dataclass(frozen=True, slots=True)
class Yaw:
    """How the vehicle looks where no waypoint asks for a heading; see the planner's option `yaw`."""

    mode: Literal["along_path", "smooth", "steady", "fixed", "look_at", "free"]
    heading_rad: float = 0.0
    look_at_world_m: tuple[float, float, float] | None = None


@dataclass(frozen=True, slots=True, eq=False)
class Mission:
    """Waypoints and requests; indices count the waypoints as they are listed, from 0."""

    waypoints: Waypoints
    laps: Laps | None = None
    stays: tuple[Stay, ...] = ()
    velocities: tuple[Velocity, ...] = ()
    fly_bys: tuple[FlyBy, ...] = ()
    gates: tuple[Gate, ...] = ()
    leg_speeds: tuple[LegSpeed, ...] = ()
    leg_jerks: tuple[LegJerk, ...] = ()
    take_off: Ground | None = None
    landing: Ground | None = None
    yaw: Yaw | None = None
    keep_in: KeepIn | None = None

    def __post_init__(self) -> None:
        count = len(self.waypoints.positions_world_m)
        of_waypoints = {"stay": self.stays, "velocity": self.velocities, "radius": self.fly_bys, "gate": self.gates}
        for kind, records in of_waypoints.items():
            for record in records:
                if not 0 <= record.waypoint < count:
                    raise InputError(f"a {kind} belongs to waypoint {record.waypoint + 1}; {_counted(count)}")
        for stay in self.stays:
            if not 0.0 < stay.duration_s <= 3600.0:
                raise InputError(
                    f"the stay at waypoint {stay.waypoint + 1} lasts {stay.duration_s:g} s; give it 0 to 3600"
                )
        for velocity in self.velocities:
            if not np.isfinite(velocity.velocity_world_m_s).all():
                given = velocity.velocity_world_m_s
                raise InputError(f"the velocity at waypoint {velocity.waypoint + 1} is {given}; it must be finite")
        for fly_by in self.fly_bys:
            if not 0.0 < fly_by.radius_m < 100.0:
                where = f"waypoint {fly_by.waypoint + 1}"
                raise InputError(f"the radius at {where} is {fly_by.radius_m:g} m; it must be above 0 and below 100 m")
        for leg in self.leg_speeds:
            _check_leg("speed", leg.first, leg.last, leg.speed_m_s, "m/s", count)
        for leg in self.leg_jerks:
            _check_leg("jerk", leg.first, leg.last, leg.jerk_m_s3, "m/s3", count)
        for gate in self.gates:
            _check_gate(gate)
        if self.keep_in is not None:
            _check_keep_in(self.keep_in)
        cut = {f.waypoint for f in self.fly_bys} & {s.waypoint for s in self.stays}
        if cut:
            raise InputError(f"waypoint {min(cut) + 1} has a stay and a radius to pass it by; remove one of them")
        gated = [gate.waypoint for gate in self.gates]
        for kind, records in of_waypoints.items():
            others = [record.waypoint for record in records]
            both = [i for i in gated if others.count(i) > (kind == "gate")]
            if both:
                other = "another gate" if kind == "gate" else f"a {kind}"
                raise InputError(f"waypoint {both[0] + 1} has a gate and {other}; remove one of them")
        moving = {v.waypoint for v in self.velocities}
        both = sorted(moving & {s.waypoint for s in self.stays})
        if both:
            raise InputError(f"waypoint {both[0] + 1} has a stay and a velocity; remove one of them")
        for name, ground, end in (("take_off", self.take_off, 0), ("landing", self.landing, count - 1)):
            if ground is not None and not np.isfinite(ground.position_world_m).all():
                raise InputError(f"the {name} is at {ground.position_world_m}; its position must be finite")
            if ground is not None and not 0.0 < ground.climb_m_s < np.inf:
                raise InputError(f"the {name} climbs at {ground.climb_m_s:g} m/s; climb_m_s must be positive")
            if ground is not None and end in moving:
                raise InputError(f"waypoint {end + 1} has a velocity and a {name}; remove one of them")
            if ground is not None and end in {stay.waypoint for stay in self.stays}:
                raise InputError(f"waypoint {end + 1} has a stay and a {name}; add a waypoint for one of them")
        if self.yaw is not None and not abs(self.yaw.heading_rad) <= MOST_TURNED_RAD:
            raise InputError(
                f"the heading to hold is {self.yaw.heading_rad:g} rad; it must be from {-MOST_TURNED_RAD:g} to "
                f"{MOST_TURNED_RAD:g}"
            )
        look_at = self.yaw.look_at_world_m if self.yaw is not None else None
        if look_at is not None and not np.all(np.abs(look_at) <= FARTHEST_M):
            raise InputError(
                f"the point to look at is {look_at}; each coordinate must be from {-FARTHEST_M:g} to {FARTHEST_M:g} m"
            )
        self._check_laps(count)

    def _check_laps(self, count: int) -> None:
        laps = self.laps
        if laps is None:
            return
        first, last = laps.ends(count)
        if not 1 <= laps.count <= MOST_LAPS:
            raise InputError(f"{laps.count} laps are asked for; 1 to {MOST_LAPS} can be planned")
        if not 0 <= first < last < count:
            raise InputError(f"laps go from waypoint {first + 1} to {last + 1}; {_counted(count)}")

    @property
    def plain(self) -> bool:
        """Whether nothing is asked but waypoints."""
        return all(not getattr(self, field.name) for field in fields(self) if field.name != "waypoints")

    def unrolled(self) -> "Mission":
        """The same flight without laps: their waypoints, and what is asked there, repeated."""
        if self.laps is None:
            return self
        count = len(self.waypoints.positions_world_m)
        start, end = self.laps.ends(count)
        loop = list(range(start, end + 1))
        order = np.array([*range(start), *loop * self.laps.count, start, *range(end + 1, count)])
        places = {i: np.flatnonzero(order == i).tolist() for i in range(count)}
        spans = [_spanned(int(a), int(b)) for a, b in pairwise(order)]

        def flown(record: LegSpeed | LegJerk) -> list[int]:
            return [i for i, (first, last) in enumerate(spans) if record.first <= first and last <= record.last]

        return replace(
            self,
            waypoints=Waypoints(self.waypoints.positions_world_m[order], self.waypoints.yaw_rad[order]),
            laps=None,
            stays=tuple(replace(s, waypoint=i) for s in self.stays for i in places[s.waypoint]),
            velocities=tuple(replace(v, waypoint=i) for v in self.velocities for i in places[v.waypoint]),
            fly_bys=tuple(replace(f, waypoint=i) for f in self.fly_bys for i in places[f.waypoint]),
            gates=tuple(replace(g, waypoint=i) for g in self.gates for i in places[g.waypoint]),
            leg_speeds=tuple(replace(s, first=i, last=i + 1) for s in self.leg_speeds for i in flown(s)),
            leg_jerks=tuple(replace(j, first=i, last=i + 1) for j in self.leg_jerks for i in flown(j)),
        )


def _counted(count: int) -> str:
    return f"there are 1 to {count} (0 to {count - 1} in the file)"


def _check_leg(kind: str, first: int, last: int, most: float, unit: str, count: int) -> None:
    if not 0 <= first < last < count:
        raise InputError(f"a {kind} is given from waypoint {first + 1} to {last + 1}; {_counted(count)}")
    if not (np.isfinite(most) and most > 0.0):
        raise InputError(f"the {kind} from waypoint {first + 1} is {most:g} {unit}; it must be positive")


def _check_gate(gate: Gate) -> None:
    where = f"the gate at waypoint {gate.waypoint + 1}"
    for name in ("width_m", "height_m"):
        if not 0.01 <= getattr(gate, name) < 100.0:
            raise InputError(f"{where} has a {name} of {getattr(gate, name):g}; it must be from 0.01 to 100 m")
    for name in ("heading_rad", "pitch_rad", "roll_rad"):
        if not np.isfinite(getattr(gate, name)):
            raise InputError(f"{where} has a {name} of {getattr(gate, name):g}; it must be finite")


def _check_keep_in(tube: KeepIn) -> None:
    if not SLIMMEST_M <= tube.radius_m < 1000.0:
        raise InputError(
            f"the tube to keep in has a radius_m of {tube.radius_m:g}; it must be {SLIMMEST_M:g} to 1000 m"
        )
    line = tube.polyline_world_m
    if line is None:
        return
    if not 2 <= len(line) <= MOST_TUBE_POINTS:
        raise InputError(
            f"the tube to keep in has a polyline of {len(line)} points; 2 to {MOST_TUBE_POINTS} can be planned with: "
            "thin a recorded walk (`goshawk plan --path`, or `planner.route.simplify.rdp`)"
        )
    broken = [i for i, point in enumerate(line) if not np.isfinite(point).all()]
    if broken:
        raise InputError(f"point {broken[0] + 1} of the tube to keep in is {line[broken[0]]}; it must be finite")


def _spanned(start: int, end: int) -> tuple[int, int]:
    """First and last of the listed waypoints that a leg of laps spans: all of them on the way back to the first one."""
    return (end, start) if end < start else (end - 1, end)


_LISTS = {
    "stays": Stay, "velocities": Velocity, "fly_bys": FlyBy, "gates": Gate, "leg_speeds": LegSpeed,
    "leg_jerks": LegJerk,
}  # fmt: skip
_SINGLE = {"laps": Laps, "take_off": Ground, "landing": Ground, "yaw": Yaw, "keep_in": KeepIn}


def save(path: Path, mission: Mission) -> None:
    """Write the waypoints file; one that holds waypoints only can be read by older versions."""
    if mission.plain:
        project.save_waypoints(path, mission.waypoints)
        return
    body: dict[str, Any] = {"waypoints": project.waypoint_records(mission.waypoints)}
    for name in _LISTS:
        body |= {name: [_record(item) for item in getattr(mission, name)]} if getattr(mission, name) else {}
    for name in _SINGLE:
        body |= {name: _record(getattr(mission, name))} if getattr(mission, name) is not None else {}
    file_format.write_json(path, format=project.WAYPOINTS_FORMAT, version=project.MISSION_VERSION, body=body)


def load(path: Path) -> Mission:
    """Read a waypoints file, with or without requests.

    Raises:
        InputError: no such file, or a request that cannot be met.
        FormatError: it is damaged, of another format, or newer than this version.
    """
    document = file_format.read_json(path, format=project.WAYPOINTS_FORMAT, version=project.MISSION_VERSION)
    waypoints = project.waypoints_from(document, path)
    known = {"format", "version", "waypoints", *_LISTS, *_SINGLE}
    unknown = sorted(set(document) - known)
    if unknown:
        raise FormatError(f"{path} asks for {', '.join(unknown)}, which this version does not know")
    try:
        lists = {name: _all_made(kind, document.get(name, [])) for name, kind in _LISTS.items()}
        single = {name: _made(kind, document[name]) for name, kind in _SINGLE.items() if name in document}
    except (TypeError, ValueError) as error:
        raise FormatError(f"{path} is a damaged waypoint file: {error}") from error
    return Mission(waypoints, **lists, **single)


def _record(item: Any) -> dict[str, Any]:
    found = {field.name: getattr(item, field.name) for field in fields(item)}
    return {name: list(cast("tuple[float, ...]", v)) if isinstance(v, tuple) else v for name, v in found.items()}


def _all_made(kind: Any, records: list[dict[str, Any]]) -> tuple[Any, ...]:
    return tuple(_made(kind, record) for record in records)


def _made(kind: Any, record: dict[str, Any]) -> Any:
    """A record of this kind; lists are points of three numbers, and whole numbers count waypoints and laps."""
    known = [field.name for field in fields(kind)]
    unknown = [name for name in record if name not in known]
    if unknown:
        raise ValueError(f"a record has {unknown[0]}, but what it is about has {', '.join(known)}")
    values: dict[str, Any] = {}
    for name, value in record.items():
        if name == "polyline_world_m" and value is not None:
            values[name] = tuple(_point(point) for point in value)
        elif isinstance(value, list):
            values[name] = _point(cast("list[Any]", value))
        else:
            values[name] = value if value is None or name == "mode" else _number(name, value)
    return kind(**values)


def _point(numbers: list[Any]) -> tuple[float, float, float]:
    x, y, z = (float(number) for number in numbers)
    return x, y, z


def _number(name: str, value: Any) -> float | int:
    if name in ("waypoint", "first", "last", "count"):
        if not isinstance(value, int) or isinstance(value, bool):
            raise TypeError(f"{name} is {value!r}; a whole number is expected")
        return value
    return float(value)
