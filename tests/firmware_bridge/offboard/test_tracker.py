"""The controller over an ideal inner loop: a body that turns at the rates and has the force that it is asked for."""

import numpy as np
import pytest

import vehicle
from firmware_bridge import controller
from firmware_bridge.controller import Command, LinkLoss, State
from firmware_bridge.offboard.poses import Pose
from firmware_bridge.offboard.thrust_map import ThrustMap
from firmware_bridge.offboard.tracker import Tracker
from flight import rotations
from tests.firmware_bridge.offboard import curves

TICK_S, LATE_S = 0.004, 0.012
MODEL = vehicle.example("rigter2019")


class IdealBody:
    """A thrust vector that follows force and rates with their lags, on the ground until it is lifted."""

    def __init__(self, weaker: float) -> None:
        self.position, self.velocity = np.zeros(3), np.zeros(3)
        self.q, self.rate, self.force_n = np.array([1.0, 0.0, 0.0, 0.0]), np.zeros(3), 0.0
        self._weaker = weaker

    def step(self, force_n: float, rate: np.ndarray) -> None:
        self.force_n += TICK_S / 0.035 * (self._weaker * force_n - self.force_n)
        self.rate += TICK_S / 0.025 * (rate - self.rate)
        lift = self.force_n / MODEL.mass_kg * rotations.matrix(self.q)[:, 2]
        acceleration = lift - np.array([0.0, 0.0, MODEL.gravity_m_s2])
        if self.position[2] <= 0.0 and acceleration[2] < 0.0:
            self.velocity[:] = 0.0
            return
        self.q = rotations.multiply(self.q, rotations.exp(TICK_S * self.rate))
        self.velocity += TICK_S * acceleration
        self.position += TICK_S * self.velocity


@pytest.mark.parametrize("weaker", [0.8, 0.95, 1.1])
def test_it_takes_off_and_hovers_where_the_rotors_are_weaker_than_the_file_says(weaker):
    """Of 20 % weaker ones an observer that is limited, or waits for the hover, leaves it low."""
    tracker, errors, climbed = hovered(IdealBody(weaker), MODEL)
    assert climbed
    assert max(errors) < 0.01
    assert tracker.effectiveness.share == pytest.approx(weaker, rel=0.05)


def test_a_landing_teaches_nothing_of_the_thrust():
    """The ground that bears it would pass for stronger rotors, and the next flight would begin with them."""
    tracker, _, _ = hovered(body := IdealBody(0.9), MODEL, lands_at=1300, ticks=2000)
    assert body.position[2] < 0.01
    assert tracker.effectiveness.share == pytest.approx(0.9, rel=0.01)


def hovered(
    body: "IdealBody",
    model,
    *,
    battery_v: float = 0.0,
    lands_at: int = -1,
    ticks: int = 1300,
    thrust_map: ThrustMap | None = None,
) -> tuple[Tracker, list[float], bool]:
    """A take-off at tick 300, 4 s with the hover after it; errors of the last 0.8 s."""
    inbox, now_s = [], 100.0

    def poses(now_s):
        due = [pose for pose in inbox if pose.time_s <= now_s - LATE_S]
        del inbox[: len(due)]
        return due

    tracker = Tracker(controller.parameters_of(model), poses)
    tracker.thrust_map = thrust_map
    errors, climbed = [], False
    for tick in range(ticks):
        now_s += TICK_S
        if tick % 3 == 0:
            inbox.append(Pose(now_s, body.position.copy(), body.q.copy()))
        demand = tracker.tick(now_s, battery_v=battery_v)
        if tick == 300:
            assert not tracker.unready
            tracker.controller.command(Command.ARM)
            tracker.controller.command(Command.TAKE_OFF, 1.0)
        climbed |= tracker.state is State.HOLD
        if tick == lands_at:
            tracker.controller.command(Command.LAND)
        if tick > 1100:
            errors.append(np.linalg.norm(body.position - tracker.controller.telemetry["setpoint"]["position_world_m"]))
        if demand is not None:
            body.step(demand.force_n, demand.rate_body_rad_s)
    return tracker, errors, climbed


def test_a_sagging_battery_is_allowed_for_once():
    """By the thrust map, behind us: the force that is asked for is the same at any voltage."""
    model = MODEL.with_effect("battery_sag", sag_per_v=0.06, reference_v=16.0)
    assert controller.parameters_of(model).parameters["battery_gain_1_v"] > 0.0
    for battery_v in (16.0, 13.5):
        body = IdealBody(1.0)
        tracker, errors, _ = hovered(body, model, battery_v=battery_v)
        assert tracker.effectiveness.share == pytest.approx(1.0, abs=0.01)
        assert max(errors) < 0.01


def test_what_is_not_sent_is_neither_learnt_from_nor_a_disturbance():
    """Position loops of another hold it 20 cm low, where more force is asked for than comes; then it is ours again."""
    tracker, _, _ = hovered(body := IdealBody(1.0), MODEL)
    share, now_s = tracker.effectiveness.share, 100.0 + 1300 * TICK_S
    low = body.position - np.array([0.0, 0.0, 0.2])
    inbox: list[Pose] = []
    tracker._poses = lambda _: [inbox.pop() for _ in inbox[:1]]
    asked = []
    for tick in range(800):
        now_s += TICK_S
        if tick % 3 == 0:
            inbox.append(Pose(now_s, body.position + (low - body.position) * min(tick / 400, 1.0), body.q))
        demand = tracker.tick(now_s, by_targets=True)
        asked.append(demand.force_n)
    assert asked[-1] > 1.1 * MODEL.mass_kg * MODEL.gravity_m_s2
    assert tracker.effectiveness.share == share
    assert tracker.controller.telemetry["disturbance_force_world_n"] == pytest.approx(np.zeros(3), abs=0.02)
    assert tracker.motion.force_n == pytest.approx(MODEL.mass_kg * MODEL.gravity_m_s2, rel=0.03)


def test_a_wind_that_was_learnt_is_still_known_after_position_targets():
    """Begun anew, the observer would right the vehicle at handback: it was blown 16 cm aside."""
    tracker, errors, _ = hovered(body := InWind(1.0), MODEL, ticks=2400)
    before_n, now_s = _disturbance_n(tracker), 100.0 + 2400 * TICK_S
    inbox: list[Pose] = []
    tracker._poses = lambda _: [inbox.pop() for _ in inbox[:1]]
    for tick in range(600):
        now_s += TICK_S
        theirs = tick < 100
        if tick % 3 == 0:
            inbox.append(Pose(now_s, body.position.copy(), body.q.copy()))
        demand = tracker.tick(now_s, by_targets=theirs)
        if not theirs:
            body.step(demand.force_n, demand.rate_body_rad_s)
            errors.append(np.linalg.norm(body.position - [0.0, 0.0, 1.0]))
        if tick == 100:
            assert _disturbance_n(tracker) == pytest.approx(before_n, abs=0.2)
    assert before_n[0] == pytest.approx(3.0 * MODEL.mass_kg, rel=0.1)
    assert max(errors[-500:]) < 0.05


def _disturbance_n(tracker: Tracker) -> np.ndarray:
    return np.array(tracker.controller.telemetry["disturbance_force_world_n"])


def test_without_a_pose_nothing_is_asked_of_the_vehicle():
    tracker = Tracker(controller.parameters_of(MODEL), lambda _: [])
    assert tracker.tick(1.0) is None
    assert "no pose" in tracker.unready


class InWind(IdealBody):
    def step(self, force_n: float, rate: np.ndarray) -> None:
        super().step(force_n, rate)
        if self.position[2] > 0.02:
            self.velocity[0] += TICK_S * 3.0


def test_a_steady_wind_does_not_pass_for_weak_rotors():
    """Leaning against it, force over weight is 1 / cos: it was learnt as a share of cos^2, .91."""
    tracker, _, _ = hovered(InWind(1.0), MODEL)
    assert tracker.effectiveness.share == pytest.approx(1.0, abs=0.01)


@pytest.mark.parametrize("share", [10.0, 0.97])
def test_the_lag_is_learnt_only_where_rotors_give_what_is_asked_for(share):
    """A body that is short of torque turns late: it passed for a lag of 69 ms."""
    way, now_s, inbox = curves.circle(), 100.0, []
    tracker = Tracker(controller.parameters_of(MODEL), lambda _: [inbox.pop(0) for _ in inbox[1:]])
    tracker.controller.upload(way, link_loss=LinkLoss.FINISH)
    body = IdealBody(1.0)
    body.position[:2] = way.position([0.0])[0, :2]
    for tick in range(2800):
        now_s += TICK_S
        if tick % 3 == 0:
            inbox.append(Pose(now_s, body.position.copy(), body.q.copy()))
        demand = tracker.tick(now_s)
        if tick == 300:
            tracker.controller.command(Command.ARM)
            tracker.controller.command(Command.TAKE_OFF, 1.5)
        if tick == 1200:
            tracker.controller.command(Command.START)
            tracker.thrust_map = ThrustMap((0.0, share * MODEL.mass_kg * MODEL.gravity_m_s2, 0.0))
        if demand is not None:
            body.step(demand.force_n, demand.rate_body_rad_s)
    assert tracker.state is State.TRAJECTORY
    assert (tracker.inner_lag.turns > 10) is (share > 1.0)


class FullThrottle(IdealBody):
    def __init__(self, most_n: float) -> None:
        super().__init__(1.0)
        self.most_n = most_n

    def step(self, force_n: float, rate: np.ndarray) -> None:
        super().step(min(force_n, self.most_n), rate)


def test_what_full_throttle_does_not_give_is_not_learnt():
    """It passed for weak rotors, and the hover rose by the difference when they gave it again."""
    most_n = 1.1 * MODEL.mass_kg * MODEL.gravity_m_s2
    tracker, _, _ = hovered(FullThrottle(most_n), MODEL, thrust_map=ThrustMap((0.0, most_n, 0.0)))
    assert tracker.effectiveness.share == pytest.approx(1.0, abs=0.01)
