"""Fly the plan of the page many times in simulation: what `goshawk preflight` does."""

import re
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Literal, cast

import msgspec
import numpy as np

import mapping
import preflight
import vehicle
from flight import InputError, Progress
from flight.project import Project
from gcs_web.desk import Desk
from gcs_web.jobs.jobs import Choices, Kind
from gcs_web.planning import preflown
from gcs_web.protocol.plan import PLENTY_M, Preflight, SimulatedFlight
from gcs_web.protocol.wording import for_page
from goshawk.commands.preflight import inputs
from goshawk.commands.preflight.like import Like
from goshawk.commands.preflight.outcome import Outcome
from preflight import remedies, worst
from preflight.hidden import together
from preflight.result import LEAST_FINISHED

SHOWN, SAMPLES = 20, 80
"""Flights that are drawn beside the worst, and positions of each at most."""


class Arguments(msgspec.Struct, forbid_unknown_fields=True):
    wind_m_s: Annotated[
        float, msgspec.Meta(title="Wind, from anywhere", ge=0.0, le=30.0, extra_json_schema={"unit": "m/s"})
    ] = 0.0
    gust_std_m_s: Annotated[
        float, msgspec.Meta(title="Gusts, standard deviation", ge=0.0, le=10.0, extra_json_schema={"unit": "m/s"})
    ] = 0.0
    like: Annotated[
        str, msgspec.Meta(title="Wind and noise of a flight", description="As its log and its observer tell them")
    ] = ""
    risk_percent: Annotated[
        float, msgspec.Meta(title="Risk that is accepted", ge=0.001, le=50.0, extra_json_schema={"unit": "%"})
    ] = 0.1
    localization_std_m: Annotated[
        float,
        msgspec.Meta(title="Lasting error of the pose (0: assumed)", ge=0.0, le=1.0, extra_json_schema={"unit": "m"}),
    ] = 0.0
    pose_delay_s: Annotated[
        float,
        msgspec.Meta(title="Untold delay of the pose (0: assumed)", ge=0.0, le=0.1, extra_json_schema={"unit": "s"}),
    ] = 0.0
    flights: Annotated[int, msgspec.Meta(title="Flights (0: as many as it takes)", ge=0, le=1_000_000)] = 0
    plan: Annotated[str, msgspec.Meta(extra_json_schema={"given": True})] = ""

    def options(self, like: Like | None = None) -> preflight.Options:
        """Wind and gusts of a flight count where none are given here. Raises `InputError` where they make no sense."""
        told = like or Like()
        uncertainty = replace(
            inputs.blowing(str(self.wind_m_s)) if self.wind_m_s else told.blowing,
            gust_std_m_s=self.gust_std_m_s or told.gust_std_m_s,
            drop_outs_per_s=told.drop_outs_per_s,
            drop_out_s=told.drop_out_s,
            localization_std_m=self.localization_std_m or None,
            pose_delay_std_s=self.pose_delay_s or None,
        )
        return preflight.Options(
            self.flights or None, self.risk_percent / 100.0, uncertainty=uncertainty, sensors=told.sensors
        )


def _choices(project: Project) -> Choices:
    return {"like": ["", *(file.stem for file in project.flights())]}


def _check(project: Project, asked: Arguments) -> None:
    asked.options()
    if asked.like not in _choices(project)["like"]:
        raise InputError(f"there is no flight {asked.like!r} in this project (any more); choose another one")


def _foresee(_: Project, asked: Arguments) -> str:
    """The map may state what it misses, which asks for more."""
    options = asked.options()
    kind = "of each level of ever nearer ones" if options.by_levels else "to count"
    return f"{options.count:,} simulated flights {kind}, on all processors behind the page"


def _given(desk: Desk) -> dict[str, str]:
    return {"plan": preflown.put_down(desk.project.folder, replace(desk.checked(), name=desk.name))}


def _claimed(project: Project, asked: Arguments) -> Path | None:
    return project.folder / ".session" / "preflights" / asked.plan / "the plan's preflight"  # a name to be read


def _run(folder: Path, asked: Arguments, progress: Progress) -> Preflight:
    project, item = Project(folder, ""), preflown.taken(folder, asked.plan)
    progress("opening the map", 0.0)
    flown = preflown.Flown.of(folder, item)
    believed = vehicle.load(project.vehicle)
    like = Like.of([project.flight(asked.like)] if asked.like else [], models={project.vehicle: believed})
    subject = inputs.subject(item, mapping.open_map(project.map), believed, asked.options(like), like)
    result = preflight.fly(subject.scenario, subject.options, progress=progress)
    if result.cut_off or result.unexplained:
        raise KeyboardInterrupt  # cancelled: what was flown until then is no verdict
    progress("flights for the picture", 0.0)
    replay = preflight.replay(subject.scenario, result, subject.options, bundle=SHOWN)
    found = told(result, replay, subject, asked)
    preflown.save(folder, flown, found)
    return found


def told(result: preflight.Result, replay: preflight.Replay, subject: inputs.Subject, asked: Arguments) -> Preflight:
    """What the page says and draws of a preflight."""
    air, radius_m = subject.options.uncertainty, subject.radius_m
    decides, remedy = _decides(result)
    return Preflight(
        "current",
        verdict=verdict(result),
        sentence=f"{_risk(result)} {_flown(result, air)}",
        decides=decides,
        remedy=remedy,
        flights=result.flights,
        wind_m_s=air.wind_m_s,
        assumed=[in_words(for_page(each)) for each in Outcome(subject, result).assumed],
        asked={name: value for name, value in msgspec.structs.asdict(asked).items() if name != "plan"},
        paths=[path(each, radius_m, is_worst=each in replay.worst) for each in (*replay.worst, *replay.bundle)],
    )


def verdict(result: preflight.Result) -> Literal["go", "no_go", "not_shown"]:
    """A no-go is shown by the flights, or by what the map may have missed; what they leave open is neither."""
    if result.go:
        return "go"
    shown = result.finished < LEAST_FINISHED or result.hides or _estimate(result) > result.risk
    return "no_go" if shown else "not_shown"


def _estimate(result: preflight.Result) -> float:
    """Of the risk; where levels did not reach a loss, their bound alone is known, and nothing is shown."""
    reached = result.rare is None or result.rare.risk.reached
    return together(result.lost.estimate, result.hidden) if reached else 0.0


def _risk(result: preflight.Result) -> str:
    """The first sentence: what decides the verdict."""
    upper, accepted = percent(result.upper), f"{percent(result.risk)} is accepted"
    if result.go:
        return f"Risk at most {upper}; {accepted}."
    if result.finished < LEAST_FINISHED:
        return f"Only {100.0 * result.finished:.0f} % of the flights come to the end."
    if result.hidden is not None and result.hides:
        return f"The map may miss a thing in the way: {percent(result.hidden.probability)}; {accepted}."
    if verdict(result) == "no_go":
        return f"Risk about {percent(_estimate(result))}, at most {upper}; {accepted}."
    return f"Not shown: risk at most {upper}; {accepted}. Fly more."


def _flown(result: preflight.Result, air: preflight.Uncertainty) -> str:
    wind = f"wind {air.wind_m_s:.2g} m/s" if air.wind_m_s else "no wind"
    gusts = f", gusts {air.gust_std_m_s:.2g} m/s" if air.gust_std_m_s else ""
    return f"{result.flights:,} flights, {wind}{gusts}."


def percent(chance: float) -> str:
    """Of a probability, two digits."""
    return f"{float(f'{100.0 * chance:.2g}'):g} %"


def _decides(result: preflight.Result) -> tuple[str, str]:
    """What decides most, and what to do about it, without the options of a verb; empty where it is not told."""
    if result.hidden is not None and result.hides:
        return "what the map may have missed", in_words(result.hidden.remedy())  # no margin makes that a go
    if result.dominating is None:
        return "", ""
    factor, share = result.dominating
    of = "the losses" if result.loss_shares else "the spread of clearance"
    remedy = "" if result.go else in_words(remedies.words(factor))
    return f"{factor}: {100.0 * share:.0f} % of {of}", remedy


def in_words(remedy: str) -> str:
    """As the page says it."""
    plain = re.sub(r" \((?:goshawk|--)[^)]*\)", "", remedy).replace("a larger --margin", "more margin")
    return plain.replace("`goshawk next-flight`", "step 5, Learn,").replace("with `goshawk map edit`", "on step 1, Map")


def path(track: worst.Track, radius_m: float, *, is_worst: bool) -> SimulatedFlight:
    """A flight, thinned, but for where it came closest and where it ended."""
    known = np.flatnonzero(np.isfinite(track.position_world_m).all(axis=1))  # not where it diverged
    at = known[np.linspace(0, known.size - 1, min(known.size, SAMPLES)).astype(int)]
    ends = min(_ends(track), int(known[-1])) if known.size and (track.touches or track.lost) else len(track.time_s)
    at = np.union1d(at, known[np.isin(known, (track.moment, ends))])
    places = track.position_world_m[at].round(3)
    clearance_m = np.minimum(np.nan_to_num(track.clearance_m[at] + radius_m, nan=PLENTY_M), PLENTY_M).round(3)
    x_m, y_m, z_m = (cast("list[float]", places[:, axis].tolist()) for axis in range(3))
    return SimulatedFlight(x_m, y_m, z_m, clearance_m.tolist(), int(np.searchsorted(at, ends)), is_worst)


def _ends(track: worst.Track) -> int:
    """Index of the sample at which a flight that touches or is lost does so.

    Without a touch that is where its path leaves what the map knows, else the end of what is known of it.
    """
    if track.touches:
        return track.moment
    nowhere = ~np.isfinite(track.clearance_m)
    if (off := np.flatnonzero(nowhere & track.on_path)).size:
        return int(off[0])
    there = np.flatnonzero(~nowhere)
    return int(there[-1]) if there.size else 0


def _done(desk: Desk, found: Preflight) -> str:
    desk.show_preflight()
    words = {"go": "go", "no_go": "no-go", "not_shown": "not shown"}
    of = "" if desk.preflight == found else "of an earlier plan or map: "
    return f"{of}{words[found.verdict]}. {found.sentence}"


KIND = Kind(
    "preflight", "Preflight of the plan", Arguments, _run, _done, _choices, _check, _foresee, _claimed,
    given=_given,
)  # fmt: skip
