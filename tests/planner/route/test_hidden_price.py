"""A price on space where an obstacle could hide: what it buys, and what it leaves as it was."""

import numpy as np
import pytest

from esdf import solids
from flight import FloatArray, InputError, Waypoints
from planner import PlanOptions
from planner.request import space
from planner.request.hidden import HiddenPrice
from planner.route import routes, search

START, GOAL = np.array([-3.0, 0.0, 1.0]), np.array([3.0, 0.0, 1.0])
OPTIONS = PlanOptions(radius_m=0.2, margin_m=0.1)


class Beyond:
    """Space that was not well seen where a coordinate is above, or below, some value."""

    def __init__(self, sign: float, axis: int = 1, end_m: float = 0.5) -> None:
        self.sign, self.axis, self.end_m = sign, axis, end_m

    def hidden_share(self, points_world_m: FloatArray) -> FloatArray:
        return (self.sign * np.asarray(points_world_m)[:, self.axis] > self.end_m).astype(np.float64)


class Nowhere:
    def hidden_share(self, points_world_m: FloatArray) -> FloatArray:
        return np.zeros(len(points_world_m))


@pytest.fixture(scope="module")
def two_doors() -> solids.Scene:
    """A wall with two doors, equally far from the straight line."""
    room = solids.Room((-4.0, -4.0, 0.0), (4.0, 4.0, 2.5))
    walls = [((-4.0), (-2.5)), ((-1.5), 1.5), (2.5, 4.0)]
    return solids.Scene([room, *(solids.Box((-0.1, low, 0.0), (0.1, high, 2.5)) for low, high in walls)])


def way(scene: solids.Scene, hidden: HiddenPrice | None, ends: FloatArray | None = None) -> FloatArray:
    points = np.array([START, GOAL]) if ends is None else ends
    asked = Waypoints(points, np.full(len(points), np.nan))
    options = PlanOptions(radius_m=0.2, margin_m=0.1, hidden=hidden)
    return routes.find(asked, scene, options).points


@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize("price", [0.5, 5.0])
def test_of_two_doors_as_far_away_the_seen_one_is_taken(two_doors, sign, price):
    found = way(two_doors, HiddenPrice(price, Beyond(sign)))
    assert (sign * found[:, 1]).min() < -1.0
    assert (sign * found[:, 1]).max() < 0.5 + 1e-9
    lines = space.check_lines(two_doors, found[:-1], found[1:], OPTIONS.clearance_m)
    assert all(line.free for line in lines)


class InDoor:
    """Only the door on one side was not well seen."""

    def __init__(self, sign: float) -> None:
        self.sign = sign

    def hidden_share(self, points_world_m: FloatArray) -> FloatArray:
        x, y, _ = np.asarray(points_world_m).T
        return np.asarray((np.abs(x) < 0.4) & (self.sign * y > 0.5), np.float64)


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_door_that_was_not_seen_is_left_for_the_other_where_all_before_it_was(two_doors, sign):
    found = way(two_doors, HiddenPrice(0.1, InDoor(sign)))
    assert (sign * found[:, 1]).min() < -1.0


def test_a_way_that_counts_more_than_a_free_straight_line_is_not_taken():
    straight, hidden = np.array([START, GOAL]), HiddenPrice(5.0, Nowhere())
    longer = np.array([START, (0.0, 1.0, 1.0), GOAL])
    assert routes._cheaper(None, straight, hidden) is straight
    assert routes._cheaper(longer, straight, hidden) is straight
    assert routes._cheaper(straight, longer, hidden) is straight


def test_where_all_is_well_seen_a_price_changes_nothing(two_doors):
    assert np.array_equal(way(two_doors, HiddenPrice(5.0, Nowhere())), way(two_doors, None))


def test_a_free_straight_line_is_left_only_for_a_way_that_counts_less():
    room = solids.Scene([solids.Room((-4.0, -4.0, 0.0), (4.0, 4.0, 2.5))])
    middle = Middle()
    straight = np.array([START, GOAL])
    assert np.array_equal(way(room, HiddenPrice(0.01, middle)), straight)  # a detour is dearer
    hidden = HiddenPrice(5.0, middle)
    found = way(room, hidden)
    assert hidden.cost_m(found) < hidden.cost_m(straight)
    assert hidden.cost_m(found) < 7.5  # 6 m straight on, with 10 m of price
    assert np.linalg.norm(np.diff(found, axis=0), axis=1).sum() > 6.1


class Middle:
    """A block in the way that no image shows, a metre to each side of it."""

    def hidden_share(self, points_world_m: FloatArray) -> FloatArray:
        inside = np.abs(np.asarray(points_world_m)[:, :2]) < 1.0
        return np.asarray(inside.all(axis=1), np.float64)


def test_a_line_pays_for_the_part_of_it_that_is_hidden():
    price = HiddenPrice(2.0, Beyond(1.0, axis=0, end_m=0.0))
    line = np.array([[-1.0, 0.0, 1.0], [3.0, 0.0, 1.0]])
    assert price.of_lines_m(line[:1], line[1:])[0] == pytest.approx(6.0, abs=0.1)
    assert price.cost_m(line) == pytest.approx(10.0, abs=0.1)
    assert price.cost_m(line[::-1]) == pytest.approx(price.cost_m(line))
    assert price.of_lines_m(np.zeros((0, 3)), np.zeros((0, 3))).shape == (0,)


def test_a_shortcut_does_not_lead_back_into_hidden_space():
    room = solids.Scene([solids.Room((-4.0, -4.0, 0.0), (4.0, 4.0, 2.5))])
    round_it = np.array([START, (-1.2, 1.3, 1.0), (1.2, 1.3, 1.0), GOAL])
    assert len(search.shortcut(round_it, room, 0.3, 0.35)) == 2
    assert np.array_equal(search.shortcut(round_it, room, 0.3, 0.35, HiddenPrice(5.0, Middle())), round_it)


@pytest.mark.parametrize("price", [0.0, -1.0, 1e3, float("nan")])
def test_a_price_out_of_range_is_refused(price):
    with pytest.raises(InputError, match="price of hidden space"):
        HiddenPrice(price, Nowhere())


def test_a_sampling_planner_has_no_price():
    with pytest.raises(InputError, match="grid search"):
        PlanOptions(search="rrt_star", hidden=HiddenPrice(1.0, Nowhere()))
