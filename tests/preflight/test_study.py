"""A preflight: what it concludes of a wall beside the way."""

import inspect
from dataclasses import replace

import numpy as np
import pytest

import preflight
from firmware_bridge import closed_loop
from firmware_bridge.sitl_vehicle import SitlVehicle
from flight import InputError, Trajectory
from preflight import clearance, core, draws, remedies, statistics, study
from preflight.result import BINS
from preflight.study import require_hover
from tests.preflight.conftest import EXACT, Wall

RADIUS_M = 0.2


def flown(drone, curve, wall_m, *, flights=60, uncertainty=EXACT, risk=0.05, **options):
    return preflight.fly(
        preflight.Scenario(drone, curve, Wall(wall_m), radius_m=RADIUS_M, clearance_m=1.0),
        preflight.Options(flights=flights, risk=risk, uncertainty=uncertainty, **options),
    )


def decided(*arguments, **options):
    """As `flown`, without shares of factors, for which as many are flown again; no more than one batch of flights."""
    return flown(*arguments, decide_only=True, **options)


def test_far_from_the_wall_it_is_a_go_and_through_it_a_no_go(drone, curve):
    far, through = decided(drone, curve, 1.0), decided(drone, curve, 0.1)
    assert far.go
    assert far.touched.count == 0
    assert far.lost.upper == pytest.approx(3.0 / 60, rel=0.1)
    assert not through.go
    assert through.touched.count == 60
    assert far.record.clearance_m.mean() == pytest.approx(1.0 - RADIUS_M, abs=0.05)


def test_a_go_needs_as_many_flights_as_show_it(drone, curve):
    few = decided(drone, curve, 1.0, flights=50, risk=1e-2)
    assert few.touched.count == 0
    assert not few.go
    assert "299" in few.reason()
    assert preflight.Options(risk=1e-2).count == 299


def test_a_wider_body_and_a_nearer_wall_never_lower_the_risk(drone, curve):
    loose = replace(EXACT, localization_std_m=0.05)
    touched = [decided(drone, curve, wall, uncertainty=loose).record.touched for wall in (0.32, 0.28, 0.24)]
    assert not (touched[0] & ~touched[1]).any()
    assert not (touched[1] & ~touched[2]).any()
    assert touched[2].sum() > touched[0].sum()


@pytest.mark.parametrize(
    ("factor", "given"),
    [
        ("localization", {"localization_std_m": 0.05}),
        ("map surface", {"map_error_std_m": 0.05}),
        ("map scale", {"map_scale_std_ratio": 0.3}),
    ],
)
def test_what_was_planted_decides_most_and_its_removal_takes_the_risk_away(drone, curve, factor, given):
    found = flown(drone, curve, 0.27, uncertainty=replace(EXACT, **given), flights=90)
    assert found.dominating is not None
    assert found.dominating[0] == factor
    assert found.touched.count > 6
    assert found.removed is not None
    assert found.removed.factor == factor
    assert found.removed.risk.count < 0.2 * found.lost.count


class Room(Wall):
    """A floor at z = 0 and a ceiling, and a wall."""

    def __init__(self, height_m: float) -> None:
        super().__init__(1.0)
        self.height_m = height_m

    def distance(self, points_world_m):
        z = np.asarray(points_world_m)[:, 2]
        return np.minimum(super().distance(points_world_m), np.minimum(z, self.height_m - z))


def test_floor_and_ceiling_are_found_in_the_map_or_not():
    points = np.array([[0.0, 5.0, 1.5], [1.0, 5.0, 1.2]])
    assert clearance.below_and_above(Room(2.5), points) == pytest.approx((0.0, 2.5), abs=0.01)
    assert clearance.below_and_above(Wall(1.0), points) == (-np.inf, np.inf)


@pytest.mark.parametrize(("effect", "room_m", "gap_m"), [("ground_effect", 9.0, 0.15), ("ceiling_effect", 2.0, 1.85)])
def test_a_floor_or_ceiling_near_the_path_lets_the_rotors_turn_slower(drone, curve, effect, room_m, gap_m):
    coefficients = curve.coefficients.copy()
    coefficients[:, 2, 0] = gap_m
    path = Trajectory(curve.durations_s, coefficients)
    near = drone.with_effect(effect, strength=1.0)
    reserve = []  # towards the slowest speed
    for model, room in ((drone, Room(room_m)), (near, Room(room_m)), (near, Wall(1.0))):
        options = preflight.Options(flights=4, risk=0.4, uncertainty=EXACT, rate_hz=500, explain=False)
        found = preflight.fly(preflight.Scenario(model, path, room, radius_m=0.1, clearance_m=1.0), options)
        reserve.append(float(found.record.rotor_reserve.mean()))
    assert reserve[1] < reserve[0] - 0.002
    assert reserve[2] == pytest.approx(reserve[0], rel=1e-6)
    assert any(f"flown without {effect}" in sentence for sentence in found.assumed)


class Shelf(Wall):
    """A floor at z = 0, and a shelf on it below where the path begins."""

    def distance(self, points_world_m):
        points = np.asarray(points_world_m)
        x, z = points[:, 0] - 0.3, points[:, 2] - 1.1
        shelf = np.where((x <= 0.0) & (z <= 0.0), np.maximum(x, z), np.hypot(np.maximum(x, 0.0), np.maximum(z, 0.0)))
        return np.minimum(super().distance(points), np.minimum(points[:, 2], shelf))


def test_a_shelf_below_a_part_of_the_path_alone_is_no_floor_of_all_of_it(drone, curve):
    coefficients = curve.coefficients.copy()
    coefficients[:, 2] = -0.25 * coefficients[:, 0]
    coefficients[:, 2, 0] += 1.5
    path = Trajectory(curve.durations_s, coefficients)
    heights = path.position(np.linspace(0.0, path.duration_s, 50))[:, 2]
    assert heights.min() < 1.1 < heights.max()
    near = drone.with_effect("ground_effect", strength=1.0)
    options = preflight.Options(flights=8, risk=0.4, uncertainty=EXACT, explain=False)
    found = preflight.fly(preflight.Scenario(near, path, Shelf(3.0), radius_m=0.1, clearance_m=1.0), options)
    assert found.finished == 1.0
    assert found.lost.count == 0
    assert "flown without ground_effect: the map has no floor below the path of one height" in found.assumed


def test_a_wrong_scale_moves_the_walls_of_a_map_that_the_pose_is_not_one_in(drone, curve):
    """A wall along the way is as near as before where it is at the origin, and 4 m off moves by 4 m times the error."""

    class Ahead(Wall):
        def distance(self, points_world_m):
            return self.away_m - np.asarray(points_world_m)[:, 0]

    unsure = replace(EXACT, map_scale_std_ratio=0.05)
    spread_m = []
    for of_map in (True, False):
        options = preflight.Options(flights=60, uncertainty=replace(unsure, pose_of_map=of_map), decide_only=True)
        found = preflight.fly(preflight.Scenario(drone, curve, Ahead(4.5), radius_m=0.2, clearance_m=1.0), options)
        spread_m.append(found.record.clearance_m.std())
    assert spread_m[0] == pytest.approx(0.05 * 0.5, rel=0.3)  # metres to the wall
    assert spread_m[1] == pytest.approx(0.05 * 4.5, rel=0.3)  # metres from the origin


@pytest.mark.parametrize(
    ("factor", "given", "effect"),
    [
        (draws.MOTOR_FAULT, {"motor_fault_ratio": 0.5}, {}),
        (draws.POSE_JUMP, {"pose_jump_std_m": 0.1}, {}),
        (draws.BATTERY, {"battery_v": 13.2}, {"sag_per_v": 0.113, "reference_v": 16.8}),
    ],
)
def test_faults_are_named_and_taken_away(drone, curve, factor, given, effect):
    model = drone.with_effect("battery_sag", **effect) if effect else drone
    unsure = replace(EXACT, **given)
    found = flown(model, curve, 1.0, uncertainty=unsure, flights=100, explain=False)
    assert found.dominating is not None
    assert found.dominating[0] == factor
    believed, sure = remedies.without(model, unsure, factor)
    assert believed == model
    assert sure == EXACT
    assert "identify again" not in remedies.words(factor)


def test_gusts_are_named_though_no_number_drawn_before_tells_them(drone, curve):
    found = flown(drone, curve, 1.0, uncertainty=replace(EXACT, gust_std_m_s=2.0), flights=100)
    assert found.dominating is not None
    assert found.dominating[0] == remedies.GUSTS
    assert found.dominating[1] > 0.5


def test_gusts_too_weak_to_feel_are_not_named(drone, curve):
    found = flown(drone, curve, 1.0, uncertainty=replace(EXACT, gust_std_m_s=0.01), flights=40)
    assert found.dominating is not None
    assert found.dominating[0] == remedies.NOISE
    assert found.shares[remedies.GUSTS] < 0.3


def test_luck_has_no_more_of_the_spread_than_what_was_drawn_leaves(drone, curve, monkeypatch):
    """Flown again with other noise, what the noise only changes with something drawn is changed too."""
    monkeypatch.setattr(study._Study, "_anew", lambda *asked: (0.99, 0))
    found = flown(drone, curve, 9.0, uncertainty=replace(EXACT, localization_std_m=0.1), flights=60, explain=False)
    assert found.dominating is not None
    assert found.dominating[0] == "localization"
    assert found.shares[remedies.NOISE] <= 1.0 - found.shares["localization"]


def test_all_luck_together_has_no_more_than_what_was_drawn_leaves(drone, curve, monkeypatch):
    """What noise and gusts only change together, both change: more than all of the variance, each counted whole."""
    monkeypatch.setattr(study._Study, "_anew", lambda *asked: (0.8, 0))
    found = flown(drone, curve, 9.0, uncertainty=replace(EXACT, gust_std_m_s=0.25), flights=60, explain=False)
    assert found.shares[remedies.NOISE] == pytest.approx(0.5, abs=0.05)
    assert sum(found.shares.values()) == pytest.approx(1.0, abs=0.05)


def test_luck_is_scaled_to_what_was_drawn_leaves_and_keeps_its_order():
    drawn, within = {"wind": 0.25, "mass_kg": -0.05, "gusts": 0.1}, {"gusts": 0.8, "sensor noise": 0.6}
    shares = study._together(drawn, within)
    assert shares == pytest.approx({"gusts": 0.5, "sensor noise": 0.3, "wind": 0.25, "mass_kg": 0.0})
    assert next(iter(shares)) == "gusts"
    assert study._together(drawn, {"gusts": 0.2})["gusts"] == pytest.approx(0.3)


def test_gaps_of_the_pose_that_lose_flights_are_named_and_their_removal_saves_them(drone, curve):
    found = flown(drone, curve, 1.0, uncertainty=replace(EXACT, drop_outs_per_s=0.1, drop_out_s=1.0), flights=60)
    assert 10 <= found.lost.count < 50
    assert found.dominating is not None
    assert found.dominating[0] == remedies.DROP_OUTS
    assert found.loss_shares[remedies.DROP_OUTS] > 0.5
    assert found.removed is not None
    assert found.removed.risk.count == 0


def test_too_few_flights_name_nothing(drone, curve):
    found = flown(drone, curve, 0.1, flights=20)
    assert found.lost.count == 20
    assert found.dominating is None
    assert found.removed is None
    assert found.as_dict()["dominating"] is None


def test_a_risk_not_shown_after_a_loss_asks_for_as_many_as_would_do_and_another_seed(drone, curve):
    found = flown(drone, curve, 1.0, flights=30, risk=0.1, explain=False)
    found = replace(found, record=replace(found.record, left_map=np.arange(30) == 4))
    assert f"at least {statistics.flights_for(0.1, 1)} with another --seed" in found.reason()


def test_the_tube_widens_with_its_share_and_holds_its_flights(drone, curve):
    found = decided(drone, curve, 1.0, uncertainty=replace(EXACT, gust_std_m_s=1.0))
    tube = found.tube_m()
    assert tube.shape == (3, BINS)
    assert (np.diff(tube, axis=0) >= 0.0).all()
    assert np.mean(found.record.error_m <= tube[1]) == pytest.approx(0.9, abs=0.02)


def test_what_is_narrow_is_found_in_its_segment(drone, curve):
    class Post(Wall):
        def distance(self, points_world_m):
            return np.linalg.norm(np.asarray(points_world_m)[:, :2] - [4.0, 0.4], axis=1)

    found = preflight.fly(
        preflight.Scenario(drone, curve, Post(0.0), radius_m=0.1),
        preflight.Options(flights=40, uncertainty=EXACT, decide_only=True),
    )
    place = found.place()
    assert place is not None
    assert place.time_s == pytest.approx(2.0, abs=0.3)
    assert place.point_world_m[0] == pytest.approx(4.0, abs=0.1)
    assert not place.touching


def test_out_of_the_map_is_lost(drone, curve):
    class Small(Wall):
        def distance(self, points_world_m):
            points = np.asarray(points_world_m)
            return np.where(points[:, 0] < 3.0, 9.0, np.nan)

    found = preflight.fly(
        preflight.Scenario(drone, curve, Small(0.0)), preflight.Options(flights=10, uncertainty=EXACT)
    )
    assert found.left_map.count == 10
    assert found.lost.count == 10
    assert found.touched.count == 0


def test_a_landing_touches_the_floor_below_it_but_no_wall(drone, curve):
    """Positions that a landing might have: straight down to a floor, and into a wall."""
    down = np.linspace(1.5, -0.5, 50)
    paths = np.zeros((2, 50, 3), np.float32)
    paths[0, :, 2], paths[1, :, 2], paths[1, :, 1] = down, 1.5, down - 1.0
    state = np.full((2, 50), clearance.DESCENDING[0], np.uint8)
    blank = np.zeros((2, 50), np.float32)
    two = np.zeros(2, np.int64)
    none, no = np.zeros(2), np.zeros(2, bool)
    batch = core.Flown(paths, blank, blank, state, two, two, two, none, none, no, none, none, 0)

    class Corner(Wall):
        def distance(self, points_world_m):
            points = np.asarray(points_world_m)
            return np.minimum(points[:, 2], points[:, 1] + 1.0)

    found = clearance.nearest(batch, Corner(0.0), 0.1, np.ones(2), np.zeros(2))
    assert (found.clearance_m < 0.0).tolist() == [False, True]
    assert found.clearance_m[0] > 0.5  # the floor on which it lands is not what comes nearest


def test_ctrl_c_keeps_what_was_flown(drone, curve):
    told = []

    def stop_after_the_first(stage, fraction):
        told.append(fraction)
        if len(told) > 1 and fraction < 1.0:
            raise KeyboardInterrupt

    found = preflight.fly(
        preflight.Scenario(drone, curve, Wall(1.0), radius_m=RADIUS_M),
        preflight.Options(flights=300, uncertainty=replace(EXACT, localization_std_m=0.05), threads=1),
        progress=stop_after_the_first,
    )
    assert found.flights == 64
    assert found.wanted == 300
    assert not found.go
    assert found.shares == {}  # what comes anew in every flight was not asked


def test_ctrl_c_after_the_last_flight_keeps_them_and_explains_nothing(drone, curve, monkeypatch):
    def interrupted(*_, **__):
        raise KeyboardInterrupt

    monkeypatch.setattr(statistics, "adjusted_shares", interrupted)
    found = flown(drone, curve, 1.0)
    assert found.go
    assert found.flights == 60
    assert found.dominating is None
    assert found.unexplained


def test_ctrl_c_while_flown_without_what_decides_is_told(drone, curve):
    def stopped(stage, fraction):
        if stage.startswith("again without"):
            raise KeyboardInterrupt

    uncertain = preflight.Options(60, 0.05, uncertainty=replace(EXACT, localization_std_m=0.05))
    found = preflight.fly(preflight.Scenario(drone, curve, Wall(0.25), radius_m=0.2), uncertain, progress=stopped)
    assert found.unexplained
    assert found.removed is None
    assert not preflight.fly(preflight.Scenario(drone, curve, Wall(0.25), radius_m=0.2), uncertain).unexplained


def test_a_wind_in_which_it_cannot_hover_is_refused_with_one_in_which_it_can(drone):
    with pytest.raises(InputError, match=r"cannot hover in a wind of 40 m/s .* up to [\d.]+ m/s"):
        require_hover(drone, replace(EXACT, wind_m_s=40.0))
    require_hover(drone, replace(EXACT, wind_m_s=5.0))


def test_a_wind_against_which_it_would_lean_beyond_its_limit_is_refused(drone):
    windy = replace(EXACT, wind_m_s=5.0)
    tilt_rad, reserve = draws.hover_in_wind(drone, 5.0)
    assert reserve > 0.0
    with pytest.raises(InputError, match="within its limits of tilt and rotor speed"):
        require_hover(drone.with_limits(tilt_rad=0.9 * tilt_rad), windy)
    require_hover(drone.with_limits(tilt_rad=1.1 * tilt_rad), windy)


@pytest.mark.parametrize("risk", [0.0, -1.0, 1.0])
def test_a_risk_that_no_number_of_flights_shows_is_refused(risk):
    with pytest.raises(InputError, match="a risk of"):
        preflight.Options(risk=risk)


@pytest.mark.parametrize("rate_hz", [250, 1001])
def test_a_control_rate_that_the_observer_does_not_bear_is_refused_before_a_flight(rate_hz):
    with pytest.raises(InputError, match=f"a control rate of {rate_hz} Hz: it must be 400 to 1000"):
        preflight.Options(rate_hz=rate_hz)


def test_an_unknown_control_rate_is_that_of_sitl_and_said_to_be_assumed():
    assert preflight.Options().flown_hz == core.RATE_HZ == 400
    assert core.RATE_HZ * closed_loop.TICK_US == 1_000_000
    assert inspect.signature(SitlVehicle).parameters["tick_hz"].default == core.RATE_HZ
    (said,) = preflight.Options().assumed
    assert "400 Hz" in said
    assert preflight.Options(rate_hz=500).flown_hz == 500
    assert preflight.Options(rate_hz=400).assumed == ()


@pytest.mark.parametrize("seed", [-1, 2**32])
def test_a_seed_that_has_no_other_luck_beside_it_is_refused(seed):
    with pytest.raises(InputError, match="a seed of"):
        preflight.Options(seed=seed)
