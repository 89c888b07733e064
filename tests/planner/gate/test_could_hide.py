"""How thin an obstacle could hide near a trajectory: the check, its words, and where it is not asked."""

from dataclasses import replace

import numpy as np
import pytest

import esdf
import vehicle
from esdf import Grid
from esdf.solids import Room
from esdf.visibility import Visibility
from flight import FormatError, InputError, TrajectoryFile, Waypoints, mission
from flight.mission import Ground, Mission
from mapping.free_space import FreeSpace
from planner import PlanOptions
from planner import mission as missions
from planner.gate import could_hide, gate

GRID = Grid((-0.1,) * 3, (0.1,) * 3, (62, 42, 27))
STATE = esdf.rasterize(Room((0.0, 0.0, 0.0), (6.0, 4.0, 2.5)), GRID)
FIELD = esdf.build(STATE, GRID)
DRONE = vehicle.example("rigter2019")


def space(thickness_m: float, below_z_m: float = np.inf) -> FreeSpace:
    """The room as images resolve it that show 5 mm, but below that height only what is thicker."""
    finest = np.where(GRID.centres()[..., 2] < below_z_m, thickness_m, 0.005).astype(np.float32)
    return FreeSpace(FIELD, Visibility(GRID, finest), np.zeros(GRID.shape, bool))


@pytest.fixture(scope="module")
def flown() -> tuple[gate.GateReport, mission.Mission, object]:
    asked = Mission(Waypoints([[1.0, 1.0, 1.2], [4.5, 2.5, 1.2]], [np.nan] * 2), take_off=Ground((1.0, 1.0, 0.15)))
    found = missions.plan(asked, FIELD, DRONE, PlanOptions())
    return found.gate, asked, found.trajectory


def test_the_check_passes_just_where_the_thickest_that_could_hide_is_no_thicker(flown):
    report, _, path = flown
    for thinnest_m, passes in ((0.051, True), (0.049, False)):
        found = could_hide.add(report, path, space(0.05), thinnest_m)
        assert found.passed is passes
        assert found.checks[-1].name == could_hide.CHECK
        assert found.checks[-1].value == pytest.approx(0.05)
    told = could_hide.add(report, path, space(0.05))
    assert told.checks == report.checks
    assert told.could_hide.thickness_m == pytest.approx(0.05)
    assert could_hide.worth_a_warning(told)
    assert not could_hide.worth_a_warning(could_hide.add(report, path, space(0.02)))


def test_where_the_map_states_how_likely_it_is_only_what_is_likely_is_a_warning(flown):
    report, _, path = flown
    for chance, warned in ((1e-7, False), (1e-2, True)):
        likely = replace(space(0.05), stated=np.full(GRID.shape, chance, np.float16))
        told = could_hide.add(report, path, likely)
        assert could_hide.worth_a_warning(told) is warned
        assert told.checks == report.checks
        failed = could_hide.add(report, path, likely, 0.049)
        assert failed.passed is False  # the gate itself asks what is resolved
        assert "50 mm thick" in failed.checks[-1].reason
        assert "chance" not in failed.checks[-1].reason
        assert "50 mm thick" in could_hide.describe(told)
        assert "along 100 % of the way" in could_hide.describe(told)


def test_what_is_spread_thin_or_was_never_looked_at_is_warned_of_though_no_stretch_is(flown):
    report, _, path = flown
    likely = replace(space(0.05), stated=np.full(GRID.shape, 1e-7, np.float16))
    told = could_hide.add(report, path, likely)
    assert told.could_hide is not None
    for change, warned in (({"probability": 0.02}, True), ({"thickness_m": np.inf}, True), ({}, False)):
        changed = replace(told, could_hide=replace(told.could_hide, stretches=(), **change))
        assert could_hide.worth_a_warning(changed) is warned


def test_without_images_it_is_not_known_and_a_check_that_asks_fails(flown):
    report, _, path = flown
    told = could_hide.add(report, path, None)
    assert told.passed
    assert told.as_dict()["could_hide"] is None
    assert "not known" in could_hide.describe(told)
    assert could_hide.worth_a_warning(told)
    assert not could_hide.add(report, path, None, 0.05).passed


def test_straight_above_the_ground_it_is_not_asked(flown):
    report, _, path = flown
    low = space(0.2, below_z_m=0.1)
    assert could_hide.add(report, path, low).could_hide.thickness_m == pytest.approx(0.005)
    times = could_hide.equally_spaced(path)
    assert low.along(times, path.position(times), report.required_clearance_m).thickness_m == pytest.approx(0.2)


def test_positions_are_equally_spaced_and_span_the_path(flown):
    path = flown[2]
    times = could_hide.equally_spaced(path)
    steps_m = np.linalg.norm(np.diff(path.position(times), axis=0), axis=1)
    assert (times[0], times[-1]) == (0.0, pytest.approx(path.duration_s))
    assert steps_m.max() < 0.021
    assert steps_m.min() > 0.5 * steps_m.max()


@pytest.mark.parametrize("wrong", [0.0, -0.03, 30.0, np.nan])
def test_a_thickness_in_another_unit_is_refused(flown, wrong):
    report, _, path = flown
    with pytest.raises(InputError, match="thinnest obstacle"):
        could_hide.add(report, path, space(0.05), wrong)


def test_a_file_tells_what_thickness_was_asked_of_it(flown):
    _, asked, path = flown
    points = asked.waypoints.positions_world_m
    for check, thinnest_m in (({}, None), ({"thinnest_m": None}, None), ({"thinnest_m": 0.03}, 0.03)):
        assert could_hide.asked_of(TrajectoryFile(path, "x", "", "", points, check)) == thinnest_m
    for damaged in ("thin", 0.0):
        with pytest.raises(FormatError, match="damaged"):
            could_hide.asked_of(TrajectoryFile(path, "x", "", "", points, {"thinnest_m": damaged}))


def test_the_advice_names_an_option_only_where_images_tell_what_could_hide(flown):
    report, _, path = flown
    assert "--thinnest" not in could_hide.advice(report)
    assert "--thinnest" in could_hide.advice(could_hide.add(report, path, space(0.05), None))


def test_only_as_low_above_the_ground_as_the_gate_asks_for_less_is_it_not_asked():
    ground, required_m = np.array([[1.0, 2.0, 0.5]]), 0.3
    heights_m = np.array([0.0, 0.2, 0.33, 0.35, 1.0])
    path = ground + heights_m[:, None] * [0.0, 0.0, 1.0]
    low = could_hide._above_ground(path, ground, required_m)
    np.testing.assert_array_equal(low, heights_m < required_m + 0.04)  # the ground may lie .02 deep, and .02 is allowed
    assert not could_hide._above_ground(path + np.array([0.01, 0.0, 0.0]), ground, required_m).any()
    assert not could_hide._above_ground(path, None, required_m).any()
