"""The page's preflight: the plan in simulation as the verb flies it, kept by what it was flown for."""

import os
import shutil
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import msgspec
import numpy as np
import pytest
from numpy.typing import ArrayLike

import mapping
import planner
import preflight
import vehicle
from esdf.storage import EDITS
from firmware_bridge.sitl_vehicle import Sensors
from flight import InputError, TrajectoryFile, Waypoints, project, silent
from flight.trajectory import fingerprint
from gcs_web.planning import preflown
from gcs_web.protocol.plan import PLENTY_M, Preflight, SimulatedFlight
from gcs_web.scene.flights_view import TOUCHING, flight_colours
from goshawk.commands.preflight import inputs
from goshawk.commands.preflight.like import Like
from goshawk.station_jobs import KINDS
from goshawk.station_jobs import preflight as job
from goshawk.station_jobs.preflight import Arguments
from preflight import worst

FEW = Arguments(risk_percent=10.0)
"""29 flights show it."""


@pytest.fixture(scope="module")
def opened(pillar_map: Path, tmp_path_factory) -> project.Project:
    made = project.create(tmp_path_factory.mktemp("preflight") / "project", "pillars")
    shutil.copytree(pillar_map, made.map)
    vehicle.save(made.vehicle, vehicle.example("rigter2019"))
    return made


@pytest.fixture(scope="module")
def item(opened: project.Project) -> TrajectoryFile:
    area, believed = mapping.open_map(opened.map), vehicle.load(opened.vehicle)
    return planned(area, believed)


def planned(area: mapping.Map, believed: vehicle.Vehicle, *, margin_m: float = 0.15) -> TrajectoryFile:
    places = np.array([[0.8, 0.8, 1.0], [3.0, 0.8, 1.2]])
    options = planner.PlanOptions(margin_m=margin_m).sized(believed)
    return planner.trajectory_file(
        planner.plan(Waypoints(places, np.full(2, np.nan)), area.field, believed, options), name="line"
    )


@pytest.fixture(scope="module")
def found(opened: project.Project, item: TrajectoryFile) -> Preflight:
    asked = msgspec.structs.replace(FEW, plan=preflown.put_down(opened.folder, item))
    return job._run(opened.folder, asked, silent)


def test_it_is_the_verbs_own_verdict_on_the_same_flights(opened, item, found):
    subject = inputs.subject(item, mapping.open_map(opened.map), vehicle.load(opened.vehicle), FEW.options())
    result = preflight.fly(subject.scenario, subject.options)
    assert found.state == "current"
    assert found.flights == result.flights == 29
    assert (found.verdict == "go") is result.go
    assert found.sentence.endswith("29 flights, no wind.")
    assert f"{job.percent(result.upper)}; 10 % is accepted." in found.sentence


def test_the_worst_come_first_and_their_clearance_is_that_of_the_vehicles_centre(opened, item, found):
    subject = inputs.subject(item, mapping.open_map(opened.map), vehicle.load(opened.vehicle), FEW.options())
    result = preflight.fly(subject.scenario, subject.options)
    assert [each.is_worst for each in found.paths] == [True] * 3 + [False] * job.SHOWN
    assert all(len(each.x_m) == len(each.clearance_m) <= job.SAMPLES + 1 for each in found.paths)
    least_m = min(found.paths[0].clearance_m)
    assert least_m - subject.radius_m == pytest.approx(result.record.clearance_m.min(), abs=1e-3)
    assert max(max(each.clearance_m) for each in found.paths) <= PLENTY_M


def keep(folder: Path, item: TrajectoryFile, found: Preflight) -> None:
    preflown.save(folder, preflown.Flown.of(folder, item), found)


def test_it_is_kept_for_this_plan_map_and_vehicle_and_stale_for_any_other(opened, item, found):
    assert preflown.of(opened.folder, item) == found
    assert preflown.of(opened.folder, replace(item, name="another name")) == found
    further = replace(item, trajectory=replace(item.trajectory, durations_s=item.trajectory.durations_s * 1.001))
    for changed, what in (
        (replace(item, map_hash="other"), "the map"),
        (replace(item, vehicle_hash="other"), "the vehicle"),
        (further, "the plan"),
        (replace(item, check=dict(item.check) | {"clearance_m": 1.0}), "the plan"),  # told to the vehicle alone
        (replace(item, check=dict(item.check) | {"conditions": {"ground": 0}}), "the plan"),  # where the ground is
    ):
        other = preflown.of(opened.folder, changed)
        assert (other.state, other.stale, other.paths) == ("stale", what, [])
        assert other.verdict == found.verdict


def test_the_same_waypoints_planned_again_are_the_same_plan(opened, item, found):
    again = planned(mapping.open_map(opened.map), vehicle.load(opened.vehicle))
    assert preflown.of(opened.folder, again) == found


def test_a_no_go_is_told_after_a_waypoint_of_nine_was_moved_and_moved_back(opened, found, tmp_path):
    """Plans go on from the last one, so the same waypoints may have another path: then it is stale, not forgotten."""
    folder = shutil.copytree(opened.folder, tmp_path / "project", ignore=shutil.ignore_patterns(".session"))
    area, believed = mapping.open_map(opened.map), vehicle.load(opened.vehicle)
    places = np.linspace([0.8, 0.8, 1.0], [5.2, 0.8, 1.2], 9) + 0.05 * (np.arange(9) % 2)[:, None]
    options = planner.PlanOptions(margin_m=0.15).sized(believed)
    going_on = planner.Planner(Waypoints(places, np.full(9, np.nan)), area.field, believed, options)
    first = planner.trajectory_file(going_on.plan, name="line")
    preflown.save(folder, preflown.Flown.of(folder, first), msgspec.structs.replace(found, verdict="no_go"))
    moved = planner.trajectory_file(going_on.move(1, places[1] + [0.1, 0.05, 0.05]), name="line")
    back = planner.trajectory_file(going_on.move(1, places[1]), name="line")
    assert fingerprint(back.trajectory) != fingerprint(first.trajectory)
    for item in (moved, back):
        told = preflown.of(folder, item)
        assert (told.state, told.stale, told.verdict) == ("stale", "the plan", "no_go")
    assert preflown.of(folder, first).state == "current"


@pytest.mark.parametrize("name", ["report.json", "map.toml", "poses.csv", "visibility.npz", f"esdf/{EDITS}"])
def test_what_the_map_says_of_itself_counts_though_no_voxel_changes(opened, item, found, tmp_path, name):
    shutil.copytree(opened.folder, tmp_path / "project")
    told = tmp_path / "project" / "map" / name
    told.write_bytes((told.read_bytes() if told.exists() else b"") + b" ")
    assert preflown.of(tmp_path / "project", item).stale == "the map"
    longer, written_ns = preflown.Flown.of(tmp_path / "project", item), told.stat().st_mtime_ns
    told.write_bytes(told.read_bytes()[:-1] + b"!")  # as long as before
    os.utime(told, ns=(written_ns, written_ns + 10_000_000))
    assert preflown.Flown.of(tmp_path / "project", item).map != longer.map


def test_another_version_of_the_simulation_is_flown_again(opened, item, found, monkeypatch):
    monkeypatch.setattr(preflown.metadata, "version", lambda _: "another")
    assert preflown.of(opened.folder, item).stale == "the simulation"


def flight(clearance_m, *, lost: bool, moment: int = 0, on_path: ArrayLike = True) -> worst.Track:
    """Along x, a metre a sample."""
    clearance_m = np.asarray(clearance_m, dtype=np.float64)
    steps = np.arange(float(clearance_m.size))
    line_m = np.stack([steps, 0.0 * steps, 0.0 * steps], axis=1)
    follows = np.broadcast_to(np.asarray(on_path, dtype=np.bool_), steps.shape)
    return worst.Track(
        7, steps, steps, follows, line_m, clearance_m, 0.0 * steps, lost=lost, moment=moment, surface_world_m=None
    )


def red(track: worst.Track, radius_m: float = 0.2) -> list[float]:
    """Where it is drawn so, x in m."""
    shown = job.path(track, radius_m, is_worst=True)
    colours = flight_colours(shown, required_m=0.35).tolist()
    return [x for x, colour in zip(shown.x_m, colours, strict=True) if colour == list(TOUCHING)]


def test_a_flight_is_red_from_its_first_touch_on():
    clearance_m = np.full(200, np.inf)
    clearance_m[101:150] = -0.05
    drawn = red(flight(clearance_m, lost=True, moment=101))
    assert drawn[0] == 101.0  # which thinning keeps
    assert drawn[-1] == 199.0


@pytest.mark.parametrize("radius_m", [0.2, 0.2353])
def test_a_touch_is_judged_before_anything_is_rounded(radius_m):
    assert red(flight([0.3, 1e-4, 0.3, 0.3], lost=False, moment=1), radius_m) == []
    assert red(flight([0.3, -3e-4, 0.3, 0.3], lost=True, moment=1), radius_m) == [1.0, 2.0, 3.0]


def test_a_flight_that_is_lost_without_a_touch_is_red_where_it_leaves_the_map_or_ends():
    inf = np.inf
    assert red(flight([0.4, 0.4, 0.4, inf, inf, 0.4], lost=True)) == [3.0, 4.0, 5.0]
    assert red(flight([0.4, 0.3, 0.2, 0.1], lost=True, moment=3)) == [3.0]
    down = flight([0.4, 0.3, inf, inf], lost=True, on_path=[True, True, False, False])
    assert red(down) == [1.0, 2.0, 3.0]
    assert red(replace(down, lost=False)) == []  # a landing


def test_of_a_flight_that_diverged_only_the_finite_part_is_kept(tmp_path, item, found):
    steps = np.arange(10.0)
    line_m = np.stack([steps, steps, steps], axis=1)
    line_m[6:] = [np.nan, np.inf, 0.0]
    near_m = np.where(steps < 6.0, 0.3, np.nan)
    track = worst.Track(
        7, steps, steps, np.full(10, True), line_m, near_m, steps, lost=True, moment=8, surface_world_m=None
    )
    shown = job.path(track, 0.2, is_worst=True)
    assert shown.x_m == shown.z_m == [0.0, 1.0, 2.0, 3.0, 4.0, 5.0]
    assert shown.clearance_m == [0.5] * 6
    assert shown.ends == 5
    gone = replace(track, position_world_m=np.full((10, 3), np.nan))
    kept = msgspec.structs.replace(found, paths=[shown, job.path(gone, 0.2, is_worst=False)])
    keep(tmp_path, item, kept)
    assert preflown.of(tmp_path, item) == kept  # JSON has no NaN: it would count as damaged


def test_without_any_there_is_none_and_a_damaged_one_counts_as_none(tmp_path, item, found):
    assert preflown.of(tmp_path, item) == Preflight("none")
    keep(tmp_path, item, found)
    (file,) = (tmp_path / ".session" / "preflights").iterdir()
    file.write_bytes(file.read_bytes()[:100])
    assert preflown.of(tmp_path, item) == Preflight("none")


def test_no_more_results_and_plans_than_the_newest_are_kept(tmp_path, item, found):
    for number in range(preflown.MOST_KEPT + 3):
        keep(tmp_path, replace(item, map_hash=f"{number}"), found)
    for number in range(preflown.MOST_PLANS + 3):
        preflown.put_down(tmp_path, replace(item, map_hash=f"{number}"))
    names = [file.name for file in (tmp_path / ".session" / "preflights").iterdir()]
    assert sum(name.endswith(".plan.json") for name in names) == preflown.MOST_PLANS
    assert len(names) == preflown.MOST_PLANS + preflown.MOST_KEPT
    newest = replace(item, map_hash=f"{preflown.MOST_KEPT + 2}")
    assert preflown.of(tmp_path, newest).state == "current"


@pytest.mark.parametrize("ended", [{"wanted": 1000}, {"unexplained": True}])
def test_what_was_cancelled_leaves_no_verdict(opened, item, monkeypatch, ended):
    flown = preflight.fly

    def cut_off(scenario, options, *, progress):
        return replace(flown(scenario, options), **ended)

    monkeypatch.setattr(preflight, "fly", cut_off)
    other = replace(item, name="cut off")
    before = preflown.of(opened.folder, other)
    with pytest.raises(KeyboardInterrupt):
        job._run(opened.folder, msgspec.structs.replace(FEW, plan=preflown.put_down(opened.folder, other)), silent)
    assert preflown.of(opened.folder, other) == before


def test_a_plan_that_is_not_there_is_refused(opened):
    for key in ("", "0" * 32, "../../waypoints"):
        with pytest.raises(InputError, match="no checked plan to fly"):
            job._run(opened.folder, Arguments(plan=key), silent)


class Flown(SimpleNamespace):
    """What a verdict is read from."""


def flown(estimate: float, upper: float, *, finished: float = 1.0, hides: bool = False, reached=None):
    lost = SimpleNamespace(estimate=estimate, reached=reached)
    rare = None if reached is None else SimpleNamespace(risk=lost)
    go = upper <= 1e-3 and finished >= 0.9
    return Flown(go=go, lost=lost, upper=upper, risk=1e-3, finished=finished, hides=hides, hidden=None, rare=rare)


@pytest.mark.parametrize(
    ("result", "verdict"),
    [
        (flown(0.0, 9.9e-4), "go"),
        (flown(0.0, 3e-2), "not_shown"),  # too few flights
        (flown(5e-4, 2e-3), "not_shown"),
        (flown(2e-3, 4e-3), "no_go"),
        (flown(0.0, 9.9e-4, finished=0.5), "no_go"),
        (flown(0.0, 3e-2, hides=True), "no_go"),
        (flown(2e-2, 3e-2, reached=False), "not_shown"),  # the chance is that of the last level
        (flown(2e-2, 3e-2, reached=True), "no_go"),
    ],
)
def test_only_what_the_flights_show_is_a_no_go(result, verdict):
    assert job.verdict(result) == verdict


def test_remedies_are_told_without_the_options_of_a_verb():
    from preflight import remedies

    every = [job.in_words(remedies.words(name)) for name in [*remedies._WORDS, "mass_kg with x"]]
    assert not [words for words in every if "--" in words or "goshawk" in words]
    assert job.in_words(remedies.words("wind")) == "wait for less wind, or plan with more margin"


def test_what_the_map_may_have_missed_has_its_own_remedy(opened, item):
    subject = inputs.subject(item, mapping.open_map(opened.map), vehicle.load(opened.vehicle), FEW.options())
    thing = preflight.Hidden(0.3, (1.0, 2.0, 0.5), "7.png")
    options = replace(subject.options, hidden=thing)
    result = preflight.fly(subject.scenario, options)
    hides = job.told(
        result, preflight.replay(subject.scenario, result, options, bundle=1), replace(subject, options=options), FEW
    )
    assert hides.verdict == "no_go"
    assert hides.sentence.startswith("The map may miss a thing in the way: 30 %; 10 % is accepted.")
    near = "take more images near (1.00, 2.00, 0.50) m (look at 7.png)"
    assert hides.remedy == f"{near}, or clear what is empty on step 1, Map"


def test_wind_gusts_and_risk_reach_the_flights_in_their_units():
    options = Arguments(wind_m_s=3.0, gust_std_m_s=1.0, risk_percent=1.0, flights=7).options()
    assert (options.uncertainty.wind_m_s, options.uncertainty.gust_std_m_s) == (3.0, 1.0)
    assert options.uncertainty.wind_direction is None
    assert (options.risk, options.flights) == (0.01, 7)
    assert Arguments().options() == preflight.Options()


def test_a_flights_wind_gaps_and_noise_are_flown_but_for_a_wind_that_is_given():
    noisy = replace(Sensors.typical(), position_std_m=0.05)
    like = Like(0.5, 0.4, 2.0, 0.6, 0.7, noisy)
    as_flown, windier = Arguments().options(like), Arguments(wind_m_s=3.0, gust_std_m_s=1.5).options(like)
    for options in (as_flown, windier):
        assert (options.uncertainty.drop_outs_per_s, options.uncertainty.drop_out_s) == (0.5, 0.4)
        assert options.sensors == noisy
    air = as_flown.uncertainty
    assert (air.wind_m_s, air.wind_spread_ratio, air.gust_std_m_s) == (2.0, 0.6, 0.7)
    assert (windier.uncertainty.wind_m_s, windier.uncertainty.gust_std_m_s) == (3.0, 1.5)


def test_the_poses_error_and_delay_of_the_form_are_flown():
    air = Arguments(localization_std_m=0.01, pose_delay_s=0.002).options().uncertainty
    assert (air.localization_std_m, air.pose_delay_std_s) == (0.01, 0.002)


def test_a_flight_that_is_not_there_is_no_flight_to_be_like(opened):
    with pytest.raises(InputError, match="there is no flight 'gone'"):
        job.KIND.check(opened, Arguments(like="gone"))


def test_a_simulated_flight_is_yellow_up_to_the_limit_and_red_once_it_ends():
    shown = SimulatedFlight([0.0] * 4, [0.0] * 4, [0.0] * 4, [0.2, 0.35, 5.0, 5.0], ends=3, is_worst=True)
    near, limit, far, ended = flight_colours(shown, required_m=0.35).tolist()
    assert near == limit == [253, 231, 36]
    assert ended == list(TOUCHING)
    assert far not in (near, ended)


def test_what_nobody_told_is_said_beside_the_verdict(found):
    assert "what the map misses is not counted: it states no probabilities" in found.assumed
    assert not [each for each in found.assumed if "--" in each]


def test_it_can_be_flown_again_as_it_was_asked(found):
    again = msgspec.convert(found.asked, Arguments)
    assert again == FEW
    assert "plan" not in found.asked


def test_the_form_asks_for_no_plan_and_the_station_offers_it():
    assert job.KIND in KINDS
