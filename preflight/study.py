"""The preflight itself: draw, fly in batches, ask the map, and conclude."""

import os
from collections.abc import Collection, Mapping
from dataclasses import dataclass, field, fields, replace
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from firmware_bridge import controller
from firmware_bridge.sitl_vehicle import Sensors
from flight import FloatArray, InputError, Progress, silent
from preflight import clearance, draws, hidden, rare, remedies, statistics, subset
from preflight.advice import Advice, advise
from preflight.core import DROP_OUTS, FINISHED, GUSTS, NOISE, RATE_HZ, WITHIN, Air, Flown, Loop, require_rate
from preflight.draws import Drawn, Uncertainty
from preflight.hidden import Hidden
from preflight.luck import Luck
from preflight.rare import Rare
from preflight.record import BINS, Record
from preflight.result import LEAST_FINISHED, Removed, Result, spread
from preflight.scenario import Scenario
from vehicle import Vehicle, native

_BATCH = 64
"""Flights of a call for each processor: what is kept of them meanwhile takes 0.2 MB each."""
_LEAST_LOST = 10
"""Flights, from which on it is told what loses them."""
_AGAIN = 128
"""Flights that are flown again with other noise, gusts or drop-outs."""
_NEAR_SURFACES = ("ground_effect", "ceiling_effect")
_LARGEST_SEED = 2**32 - 1
LEAST_RISK, LARGEST_RISK = 1e-5, 0.5
MOST_COUNTED, MOST_BESIDE_HIDDEN = 3000, 10_000
"""Flights, above which a risk is not shown by counting unless asked for."""
STRONGEST_M_S = 50.0


@dataclass(frozen=True, slots=True)
class Options:
    """How to fly it."""

    flights: int | None = None
    """None: as many as show the risk to be met if nothing happens in any; of a level, `rare.FLIGHTS`."""
    risk: float = 1e-3
    """Probability of touching anything that is accepted."""
    seed: int = 0
    uncertainty: Uncertainty = field(default_factory=Uncertainty)
    sensors: Sensors = field(default_factory=Sensors.typical)
    air: Air = field(default_factory=Air)
    rate_hz: int | None = None
    """Of the controller; None: not known, `core.RATE_HZ` is assumed."""
    rotor_speed_measured: bool = False
    """Whether the vehicle tells the controller the speeds of its rotors."""
    threads: int | None = None
    """None: as many as there are processors. The result does not depend on it."""
    explain: bool = True
    """If a flight was lost, fly all again without the dominating uncertainty."""
    hidden: Hidden | None = None
    """What the map may have missed in the plan's way; None: not known, and not counted."""
    decide_only: bool = False
    """Stop as soon as so many are lost that it can be no go."""
    rare: bool | None = None
    """Whether to go on to rarer flights, level by level (subset simulation); None: where counting takes more than
    `MOST_COUNTED` (`MOST_BESIDE_HIDDEN` where the map states what it misses), and no number of flights is given."""

    def __post_init__(self) -> None:
        if not LEAST_RISK <= self.risk <= LARGEST_RISK:
            raise InputError(
                f"a risk of {self.risk:g}: it must be from {LEAST_RISK:g} to {LARGEST_RISK:g}; no number of flights "
                "shows that it is nil, and one of 0.001 takes about 3000"
            )
        if self.flights is not None and self.flights < 1:
            raise InputError(f"{self.flights} flights; at least one is needed")
        if self.by_levels and not rare.LEAST_FLIGHTS <= self.count <= rare.MOST_FLIGHTS:
            raise InputError(
                f"{self.flights} flights of a level; it must be from {rare.LEAST_FLIGHTS} to {rare.MOST_FLIGHTS}, or "
                "leave out rare"
            )
        if not 0 <= self.seed <= _LARGEST_SEED:
            raise InputError(f"a seed of {self.seed}; it must be from 0 to {_LARGEST_SEED}")
        require_rate(self.flown_hz)

    @property
    def flown_hz(self) -> int:
        """Rate of the controller, known or assumed."""
        return RATE_HZ if self.rate_hz is None else self.rate_hz

    @property
    def assumed(self) -> tuple[str, ...]:
        """A sentence for what is not known of the controller."""
        return (
            () if self.rate_hz is not None else (f"a controller of {RATE_HZ} Hz, as that of `goshawk sitl` (--rate)",)
        )

    @property
    def left(self) -> float:
        """Of the risk, what the flights are to show."""
        return hidden.left_of(self.risk, self.hidden)

    @property
    def by_levels(self) -> bool:
        if self.rare is None:
            most = MOST_BESIDE_HIDDEN if self.left < self.risk else MOST_COUNTED
            return self.flights is None and statistics.flights_for(self.left) > most
        return self.rare

    @property
    def count(self) -> int:
        """Flights that are drawn independently."""
        if self.by_levels:
            return subset.GROUPS * -(-(self.flights or rare.FLIGHTS) // subset.GROUPS)
        return statistics.flights_for(self.left) if self.flights is None else self.flights


def fly(scenario: Scenario, options: Options | None = None, *, progress: Progress = silent) -> Result:
    """Fly a trajectory many times.

    Raises:
        InputError: the vehicle cannot hover in the wind, or has effects that cannot be flown in numbers.
        RefusedError: the controller refuses the vehicle's parameters or the trajectory.
        KeyboardInterrupt: before the first batch was flown; afterwards the result is of what was flown.
    """
    options = options or Options()
    vehicle, trajectory = scenario.vehicle, scenario.trajectory
    require_hover(vehicle, options.uncertainty)
    study = _Study(scenario, options)
    record, drawn, steps = study.flown(options.uncertainty, vehicle, "flights", progress)
    found, further = study.rarer(options.uncertainty, vehicle, record, drawn, progress)
    steps += further
    said = (*drawn.assumed, *options.assumed, *study.in_python(), *study.free_air())
    assumed = said if found is None else (*said, rare.assumed(record))
    if options.decide_only:
        return Result(
            record, trajectory, options.count, options.risk, {}, {}, assumed, steps=steps, rare=found,
            hidden=options.hidden,
        )  # fmt: skip
    interrupted = found is not None and found.cut_off
    told = None if interrupted else study.shares(record, drawn)
    shares, loss_shares, again = told or ({}, {}, 0)
    if found is not None:
        loss_shares = found.with_luck(shares, loss_shares)
    result = Result(
        record, trajectory, options.count, options.risk, shares, loss_shares, assumed, steps=steps + again,
        rare=found, unexplained=told is None, hidden=options.hidden,
    )  # fmt: skip
    first = result.dominating
    if first is None or not options.explain or result.cut_off or result.lost.count == 0:
        return result
    removed = study.without(first[0], progress)
    return replace(result, removed=removed, unexplained=removed is None)


def fly_again(scenario: Scenario, numbers: np.ndarray, options: Options | None = None) -> tuple[Flown, clearance.Along]:
    """The flights (m,) of these numbers once more, bit by bit, with all that was on their way; arguments as `fly`."""
    options, vehicle = options or Options(), scenario.vehicle
    loop = _Study(scenario, options).loop(options.uncertainty, vehicle)
    drawn = draws.draw(draws.flown_form(vehicle), loop.names, options.uncertainty, options.count, options.seed)
    flown = loop.fly(
        drawn.values[numbers], drawn.rows[numbers], seed=options.seed, numbers=numbers, threads=options.threads
    )
    scale, error_m, shift = drawn.map_scale[numbers], drawn.map_error_m[numbers], drawn.map_shift[numbers]
    return flown, clearance.along(flown, scenario.field or _Nothing(), scenario.size_m, scale, error_m, shift)


def records(scenario: Scenario, numbers: np.ndarray, options: Options) -> Record:
    """The flights (m,) of these numbers, in another scenario maybe; arguments as `fly`."""
    study = _Study(scenario, options)
    loop = study.loop(options.uncertainty, scenario.vehicle)
    form = draws.flown_form(scenario.vehicle)
    drawn = draws.draw(form, loop.names, options.uncertainty, options.count, options.seed)
    return study.batch(loop, drawn, numbers)[0]


def require_hover(vehicle: Vehicle, uncertainty: Uncertainty) -> None:
    """Check that the vehicle can hover in the mean wind.

    Raises:
        InputError: it cannot.
    """
    wind = uncertainty.wind_m_s
    if wind > STRONGEST_M_S:
        raise InputError(f"a wind of {wind:g} m/s; at most {STRONGEST_M_S:g} m/s is simulated")
    if not _hovers(vehicle, wind):
        raise InputError(
            f"{vehicle.name} cannot hover in a wind of {wind:g} m/s within its limits of tilt and rotor speed; it can "
            f"up to {strongest_hover(vehicle):.1f} m/s"
        )


def _hovers(vehicle: Vehicle, wind_m_s: float) -> bool:
    tilt, reserve = draws.hover_in_wind(vehicle, wind_m_s)
    return reserve > 0.0 and tilt < vehicle.limits.tilt_rad


def strongest_hover(vehicle: Vehicle) -> float:
    """The largest wind, m/s to a twentieth, in which the vehicle hovers within its limits."""
    least, most = 0.0, STRONGEST_M_S
    while most - least > 0.05:
        middle = 0.5 * (least + most)
        least, most = (middle, most) if _hovers(vehicle, middle) else (least, middle)
    return least


def advised(scenario: Scenario, result: Result, options: Options, *, progress: Progress = silent) -> Advice | None:
    """What would be a go, beside a result of the same arguments; None after Ctrl-C."""

    def is_go(wind_m_s: float, slower: float) -> bool:
        tried = f"trying {wind_m_s:g} m/s of wind" + (f", {slower:g} times slower" if slower > 1.0 else "")
        air = replace(options.uncertainty, wind_m_s=wind_m_s)
        path = scenario.trajectory if slower == 1.0 else scenario.trajectory.scale_time(slower)
        found = fly(
            replace(scenario, trajectory=path),
            replace(options, uncertainty=air, decide_only=True),
            progress=lambda stage, fraction: progress(tried, fraction),
        )
        if found.cut_off and (options.by_levels or not _is_lost(found.record, options)):
            raise KeyboardInterrupt  # cut off before it was decided
        return found.go

    try:
        return advise(options.uncertainty.wind_m_s, strongest_hover(scenario.vehicle), result.go, is_go)
    except KeyboardInterrupt:
        return None


def _is_lost(record: Record, options: Options) -> bool:
    """Whether so many flights are lost that the rest cannot make it a go."""
    return statistics.upper_bound(int(record.lost.sum()), options.count) > options.left


@dataclass(frozen=True)
class _Study:
    scenario: Scenario
    options: Options

    def loop(self, uncertainty: Uncertainty, believed: Vehicle) -> Loop:
        return Loop(
            draws.flown_form(believed),
            self.scenario.trajectory,
            controller.parameters_of(self.scenario.vehicle),
            clearance_m=self.scenario.clearance_m,
            sensors=_sensors(self.options.sensors, uncertainty),
            air=self.options.air,
            rate_hz=self.options.flown_hz,
            rotor_speed_measured=self.options.rotor_speed_measured,
            floor_m=self.between[0],
            ceiling_m=self.between[1],
        )

    @cached_property
    def between(self) -> tuple[float, float]:
        """Heights of floor and ceiling, infinite where the map or the model tells of none, or of none of one height:
        what is below a part of the path (a table) and above another is no floor of all of it."""
        floor_m, ceiling_m = self._nearest
        low_m, high_m = self._heights
        low_m, high_m = low_m - self.scenario.size_m, high_m + self.scenario.size_m
        return (floor_m if floor_m <= low_m else -np.inf), (ceiling_m if ceiling_m >= high_m else np.inf)

    @cached_property
    def _path_world_m(self) -> FloatArray:
        return self.scenario.trajectory.position(np.linspace(0.0, self.scenario.trajectory.duration_s, BINS))

    @property
    def _heights(self) -> tuple[float, float]:
        """Of the path's lowest and highest point."""
        return float(self._path_world_m[:, 2].min()), float(self._path_world_m[:, 2].max())

    @cached_property
    def _nearest(self) -> tuple[float, float]:
        """As `clearance.below_and_above`, where an effect of the model asks for it."""
        if self.scenario.field is None or not any(name in self.scenario.vehicle.effects for name in _NEAR_SURFACES):
            return -np.inf, np.inf
        return clearance.below_and_above(self.scenario.field, self._path_world_m)

    def in_python(self) -> tuple[str, ...]:
        """A sentence on effects of the user's own."""
        own = ", ".join(native.own_effects(self.scenario.vehicle))
        return (f"effects of your own ({own}) are called flight by flight: much slower",) if own else ()

    def free_air(self) -> tuple[str, ...]:
        """A sentence for each effect of the model that finds no surface to act on."""
        surfaces = zip(_NEAR_SURFACES, ("floor below", "ceiling above"), self.between, self._nearest, strict=True)
        return tuple(
            f"flown without {name}: the map has no {what} the path" + (" of one height" if np.isfinite(found) else "")
            for name, what, height, found in surfaces
            if name in self.scenario.vehicle.effects and not np.isfinite(height)
        )

    def flown(
        self, uncertainty: Uncertainty, believed: Vehicle, stage: str, progress: Progress
    ) -> tuple[Record, Drawn, int]:
        """All flights, or those flown until Ctrl-C."""
        options, loop = self.options, self.loop(uncertainty, believed)
        drawn = draws.draw(draws.flown_form(believed), loop.names, uncertainty, options.count, options.seed)
        parts: list[Record] = []
        steps, first = 0, 0
        batch = self._together
        try:
            for first in range(0, options.count, batch):
                progress(stage, first / options.count)
                part, taken = self.batch(loop, drawn, np.arange(first, min(first + batch, options.count)))
                parts.append(part)
                steps += taken
                if options.decide_only and not options.by_levels and _is_lost(Record.joined(parts), options):
                    break
            progress(stage, 1.0)
        except KeyboardInterrupt:
            if not parts:
                raise
        return Record.joined(parts), drawn, steps

    def rarer(
        self, uncertainty: Uncertainty, believed: Vehicle, record: Record, drawn: Drawn, progress: Progress
    ) -> tuple[Rare | None, int]:
        """What levels of ever nearer flights find beyond those drawn, and steps flown for that; None if not asked for,
        after Ctrl-C, or where too few come to the end."""
        if not self.options.by_levels or len(record) < self.options.count:
            return None, 0
        if float(np.mean(record.ending == FINISHED)) < LEAST_FINISHED:
            return None, 0  # no go, however rare a loss is
        loop, form, steps = self.loop(uncertainty, believed), draws.flown_form(believed), 0

        def fly(inputs: Mapping[str, FloatArray], luck: Luck) -> Record:
            nonlocal steps
            made, parts = draws.made_of(form, loop.names, uncertainty, inputs), []
            for first in range(0, len(luck), self._together):
                rows = np.arange(first, min(first + self._together, len(luck)))
                part, taken = self.batch(loop, made, rows, numbers=luck[rows])
                parts.append(part)
                steps += taken
            return Record.joined(parts)

        found = rare.find(record, drawn, fly, seed=self.options.seed, enough=self.options.left, progress=progress)
        return found, steps

    @property
    def _together(self) -> int:
        """Flights of a call."""
        return _BATCH * (self.options.threads or os.cpu_count() or 1)

    def shares(self, record: Record, drawn: Drawn) -> tuple[dict[str, float], dict[str, float], int] | None:
        """Of the variance of the least clearance, and of that of being lost, by factor; and steps flown for that.

        None after Ctrl-C, now or before: without what comes anew in every flight the wrong one would be first.
        """
        try:
            return self._shares(record, drawn) if len(record) == self.options.count else None
        except KeyboardInterrupt:
            return None

    def _shares(self, record: Record, drawn: Drawn) -> tuple[dict[str, float], dict[str, float], int]:
        loop = self.loop(self.options.uncertainty, self.scenario.vehicle)
        value, lost = spread(record), record.lost.astype(np.float64)
        many = lost.sum() >= _LEAST_LOST and statistics.decomposable(lost)
        told = ((value, statistics.decomposable(value), self._anew), (lost, many, self._kept))
        found, steps = [], 0
        for values, enough, share in told:
            shares = statistics.adjusted_shares(values, drawn.factors) if enough else {}
            within: dict[str, float] = {}
            for kind in self._kinds() if enough else ():
                within[kind], taken = share(kind, loop, record, drawn)
                steps += taken
            found.append(_together(shares, within))
        return found[0], found[1], steps

    def _kinds(self) -> list[str]:
        given = self.options.uncertainty
        sizes = {NOISE: given.noise_ratio, GUSTS: given.gust_std_m_s, DROP_OUTS: given.drop_outs_per_s}
        return [kind for kind in WITHIN if sizes[kind] > 0.0]

    def _anew(self, kind: str, loop: Loop, record: Record, drawn: Drawn) -> tuple[float, int]:
        """Share of the spread's variance that comes anew in every flight, also where it only acts with something drawn:
        some are flown again with another `kind`."""
        value = spread(record)
        some = np.arange(min(_AGAIN, len(value)))
        again, steps = self.batch(loop, drawn, some, anew=[kind])
        change = value[some] - spread(again)
        total = float(np.nanvar(value))
        if not total > 0.0 or not np.isfinite(change).any():
            return 0.0, steps
        return min(1.0, 0.5 * float(np.nanmean(change**2)) / total), steps

    def _kept(self, kind: str, loop: Loop, record: Record, drawn: Drawn) -> tuple[float, int]:
        """First-order share of the variance of being lost: how many lost flights are so again when all but `kind` is
        another flight's (pick-freeze estimate of a Sobol index, of the lost ones alone: the others are too many)."""
        lost = np.flatnonzero(record.lost)[:_AGAIN]
        others = (lost + len(record) // 2) % len(record)
        again, steps = self.batch(loop, drawn, others, numbers=lost, anew=[k for k in WITHIN if k != kind])
        risk = float(record.lost.mean())
        return max(0.0, (float(again.lost.mean()) - risk) / (1.0 - risk)), steps

    def batch(
        self,
        loop: Loop,
        drawn: Drawn,
        rows: np.ndarray,
        *,
        numbers: np.ndarray | Luck | None = None,
        anew: Collection[str] = (),
    ) -> tuple[Record, int]:
        flown = loop.fly(
            drawn.values[rows], drawn.rows[rows], seed=self.options.seed, numbers=rows if numbers is None else numbers,
            anew=anew, threads=self.options.threads,
        )  # fmt: skip
        near = clearance.nearest(
            flown,
            self.scenario.field or _Nothing(),
            self.scenario.size_m,
            drawn.map_scale[rows],
            drawn.map_error_m[rows],
            drawn.map_shift[rows],
        )
        record = Record(
            near.clearance_m, near.point_world_m, near.path_s, near.left_map,
            clearance.errors_along(flown, self.scenario.trajectory, BINS), flown.ending, flown.end_state, flown.reason,
            flown.tilt_rad, flown.fell, flown.rotor_reserve, flown.energy_j, flown.ended_s,
            flown.strain,
        )  # fmt: skip
        return record, flown.steps

    def without(self, factor: str, progress: Progress) -> Removed | None:
        """The same flights with one factor known exactly; None if Ctrl-C ended them."""
        believed, uncertainty = remedies.without(self.scenario.vehicle, self.options.uncertainty, factor)
        try:
            record, drawn, _ = self.flown(uncertainty, believed, f"again without {factor}", progress)
            found, _ = self.rarer(uncertainty, believed, record, drawn, progress)
        except KeyboardInterrupt:
            return None
        if len(record) < self.options.count or (found is not None and found.cut_off):
            return None
        return Removed(factor, statistics.Probability.of(record.lost) if found is None else found.risk)


def _together(drawn: dict[str, float], within: dict[str, float]) -> dict[str, float]:
    """Shares of what was drawn (`adjusted_shares`) and of what comes anew in every flight, scaled down to what those
    leave: all first-order shares together are at most 1."""
    left, asked = max(0.0, 1.0 - sum(drawn.values())), sum(within.values())
    scale = min(1.0, left / asked) if asked > 0.0 else 1.0
    shares = statistics.at_least_nil(drawn)
    return statistics.at_least_nil(
        shares | {kind: shares.get(kind, 0.0) + scale * share for kind, share in within.items()}
    )


def _sensors(sensors: Sensors, uncertainty: Uncertainty) -> Sensors:
    """Their noise as asked for, and the delay that their time stamps tell."""
    ratio = uncertainty.noise_ratio
    noise = {f.name: ratio * getattr(sensors, f.name) for f in fields(Sensors) if "_std_" in f.name}
    return replace(sensors, **noise, delay_s=uncertainty.pose_delay_s)


class _Nothing:
    """Space without obstacles or end."""

    def distance(self, points_world_m: ArrayLike, /) -> FloatArray:
        return np.full(len(np.asarray(points_world_m)), np.inf)
