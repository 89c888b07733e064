"""Flights on a simulated autopilot: the plan, and what is lost, refused, or taken over. Not PX4, not ArduPilot."""

import os
import re
import signal

import numpy as np
import pytest
from pymavlink.dialects.v20 import common as mavlink

from firmware_bridge.airborne import tracking
from firmware_bridge.autopilot import settings
from firmware_bridge.autopilot.line import MavlinkLine, parsed
from firmware_bridge.controller import State
from flight import LinkError, rotations
from goshawk.commands.fly import autopilot
from tests.firmware_bridge.autopilot import flights
from tests.firmware_bridge.autopilot.simulated_autopilot import (
    LAND,
    LOITER,
    PX4_LAND,
    PX4_OFFBOARD,
    PX4_POSITION,
    SimulatedAutopilot,
)
from tests.firmware_bridge.offboard import curves
from tests.firmware_bridge.offboard.page import unchecked
from tests.vehicle import frames
from vehicle import draft

HOVER = curves.hover(seconds=2.0)
SOFTLY_M_S = 1.2


def at(time_s: float, act):
    """`each_step` that acts once, so many seconds after the vehicle is above 0.8 m."""
    begun: list[float] = []

    def step(simulation: SimulatedAutopilot) -> None:
        if not begun and simulation.plant.position_world_m[2] > 0.8:
            begun.append(simulation.time_s)
        if len(begun) == 1 and simulation.time_s - begun[0] >= time_s:
            begun.append(simulation.time_s)
            act(simulation)

    return step


def _require_flown_and_landed(flown: flights.Flown, simulation: SimulatedAutopilot) -> None:
    assert not flown.error
    assert not flown.early
    assert flown.log is not None
    assert tracking(flown.log)["tracking_mean_m"] < 0.03
    assert simulation.fastest_down_m_s < SOFTLY_M_S
    assert not simulation.armed
    assert not simulation.disarmed_high


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["px4", "ardupilot"])
def test_a_circle_is_flown_and_landed(kind):
    simulation = flights.simulated(curves.circle(), kind)
    flown = flights.fly(curves.circle(), simulation)
    _require_flown_and_landed(flown, simulation)
    found_ms = re.findall(r"(\d+) ms", flown.log.metadata["inner_loop_lag"])
    assert [float(ms) for ms in found_ms[:2]] == pytest.approx([40.0, 40.0], abs=8.0)  # its rate loop's gain is 25 1/s


@pytest.mark.slow
def test_a_simulated_hexarotor_is_flown():
    simulation = flights.simulated(HOVER, model=draft.draft(frames.large("hex")))
    _require_flown_and_landed(flights.fly(HOVER, simulation), simulation)


def by_targets(simulation: SimulatedAutopilot, way=None, **more) -> tuple[flights.Flown, list[str]]:
    """A circle unless told otherwise; with what was said meanwhile."""
    said: list[str] = []
    way = curves.circle() if way is None else way
    kept = lambda text, _: said.append(text)  # noqa: E731
    return flights.fly(way, simulation, query="?targets=position", progress=kept, **more), said


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["px4", "ardupilot"])
def test_a_circle_is_flown_by_position_targets_where_it_moves(kind):
    """With the documented default gains of PX4's position loop, simulated: softer than by rates and thrust."""
    simulation = flights.simulated(curves.circle(), kind)
    flown, said = by_targets(simulation)
    assert not flown.error
    assert not flown.early
    assert flown.log is not None
    assert simulation.targets > 500
    assert tracking(flown.log)["tracking_mean_m"] < 0.06
    assert simulation.fastest_down_m_s < SOFTLY_M_S
    theirs = np.isnan(flown.log.columns["collective_force_n"])
    assert np.isnan(flown.log.columns["setpoint_rate_body_x_rad_s"][theirs]).all()
    assert abs(theirs.sum() - simulation.targets / 2) < 10  # every second tick is logged
    assert flown.log.metadata["targets"] == f"{theirs.sum() / _flying(flown).sum():.0%} of the path by position targets"
    assert said[1:] == ["its own position loops fly; our prediction and thrust learning rest",
                        "flown by rates and thrust"]  # fmt: skip
    assert _tilts_faster_at_handover_than(1.5, flown.log) == []
    assert float(flown.log.metadata["thrust_share"]) == pytest.approx(1.0, abs=0.02)


def _tilts_faster_at_handover_than(most_rad_s: float, log) -> list[float]:
    up = rotations.rotate(log.vector("q_world_body"), np.array([0.0, 0.0, 1.0]))
    rate = np.linalg.norm(np.diff(up, axis=0), axis=1) / np.diff(log.time_s)
    switches = np.flatnonzero(np.diff(np.isnan(log.columns["collective_force_n"]).astype(int)))
    assert len(switches) == 2
    worst = [float(rate[i : i + 100].max()) for i in switches]
    return [rate for rate in worst if rate > most_rad_s]


@pytest.mark.parametrize(
    ("more", "said"),
    [
        ({"frame_turned_rad": np.deg2rad(30.0)}, "the autopilot's heading is 30 deg off its poses', at most 5"),
        pytest.param(
            {"compass_off_rad": np.deg2rad(-30.0)}, "the autopilot's heading is 30 deg off its poses', at most 5",
            marks=pytest.mark.slow,
        ),
        pytest.param(
            {"frame_off_m": np.array([0.5, 0.0, 0.0])}, "m from its poses, at most 0.1; give its estimator these poses",
            marks=pytest.mark.slow,
        ),
    ],
)  # fmt: skip
def test_an_estimate_in_another_frame_is_not_armed_to_be_told_where_to_be(more, said, monkeypatch):
    monkeypatch.setattr("firmware_bridge.offboard.procedure.READY_S", 15.0)
    simulation = flights.simulated(HOVER, **more)
    flown, _ = by_targets(simulation, HOVER)
    assert said in flown.error
    assert simulation.targets == 0
    assert simulation.way[-1][1][2] < 0.1


@pytest.mark.slow
def test_a_frame_that_shows_only_by_its_way_to_be_turned_is_flown_by_rates_and_thrust():
    """A compass that is as wrong as the frame is turned, about the start."""
    turned = np.deg2rad(30.0)
    simulation = flights.simulated(curves.circle(), frame_turned_rad=turned, compass_off_rad=-turned)
    start = simulation.plant.position_world_m
    simulation.frame_off_m = start - rotations.rotate(rotations.from_yaw(turned), start)
    flown, said = by_targets(simulation)
    _require_flown_and_landed(flown, simulation)
    assert simulation.targets == 0
    assert "flown by rates and thrust: the autopilot" in said[1]
    assert "0% of the path by position targets: the autopilot" in flown.log.metadata["targets"]


@pytest.mark.slow
@pytest.mark.parametrize("fault", ["jump", "turn", "drift"])
def test_a_frame_that_parts_in_flight_ends_its_targets_for_good(fault):
    simulation = flights.simulated(curves.circle())
    began: list[float] = []

    def part(of: SimulatedAutopilot) -> None:
        if of.targets > 100:
            began.append(of.time_s)
            since_s = of.time_s - began[0]
            of.frame_off_m = np.array([{"jump": 2.0, "turn": 0.0, "drift": 0.3 * since_s}[fault], 0.0, 0.0])
            of.frame_turned_rad = 0.5 if fault == "turn" else 0.0

    simulation.each_step = part
    flown, said = by_targets(simulation)
    assert not flown.error
    assert not flown.early
    assert 100 < simulation.targets < 100 + (40 if fault != "drift" else 500)
    assert "flown by rates and thrust: the autopilot" in said[2]
    assert len(said) == 3
    assert simulation.fastest_down_m_s < SOFTLY_M_S
    errors = flown.log.vector("position_world_m") - flown.log.vector("setpoint_position_world_m")
    assert np.linalg.norm(errors[_flying(flown)], axis=1).max() < 0.45


def _flying(flown: flights.Flown) -> np.ndarray:
    return flown.log.columns["mission_state"] == State.TRAJECTORY


@pytest.mark.slow
@pytest.mark.parametrize("lost", ["poses", "planner"])
def test_what_is_lost_while_its_own_loops_fly_ends_in_a_soft_landing_by_rates_and_thrust(lost):
    simulation = flights.simulated(curves.circle())
    simulation.change_pose = lambda _, pose: None if lost == "poses" and simulation.targets > 100 else pose

    def cancel() -> bool:
        if lost == "planner" and simulation.targets > 100:
            raise LinkError("the planner died")
        return False

    flown, _ = by_targets(simulation, cancel=cancel)
    assert ("no pose for 0.2 s" if lost == "poses" else "the planner died") in flown.early
    assert simulation.targets < 100 + 80
    assert simulation.fastest_down_m_s < SOFTLY_M_S
    assert not simulation.disarmed_high
    assert not simulation.armed


def test_the_failsafe_is_said_before_it_is_armed_and_kept_in_the_log():
    simulation, said = flights.simulated(HOVER), []
    flown = flights.fly(HOVER, simulation, progress=lambda stage, _: said.append((stage, simulation.armed)))
    assert not flown.early
    assert said[0] == ("without us PX4 holds what we sent last for 0.5 s, then: lands where it is", False)
    assert flown.log is not None
    assert flown.log.metadata["failsafe"] == said[0][0]
    assert flown.log.metadata["firmware"] == "PX4 1.15.2"
    motors = flown.log.columns["motor_command_0_ratio"]
    assert np.nanmax(motors) > 0.3
    assert simulation.fastest_down_m_s < SOFTLY_M_S


@pytest.mark.parametrize(
    ("kind", "mode", "landing"),
    [
        ("px4", PX4_POSITION, PX4_LAND),
        pytest.param("ardupilot", LOITER, LAND, marks=pytest.mark.slow),
    ],
)
def test_the_pilots_mode_switch_ends_us_at_once(kind, mode, landing):
    simulation = flights.simulated(HOVER, kind)
    taken: list[tuple[float, int]] = []

    def take(of: SimulatedAutopilot) -> None:
        of.mode = mode
        taken.append((of.time_s, of.setpoints))

    simulation.each_step = at(1.0, take)
    stepped = simulation.each_step

    def then_land(of: SimulatedAutopilot) -> None:
        stepped(of)
        if taken and of.time_s - taken[0][0] > 2.0:
            of.mode = landing

    simulation.each_step = then_land
    flown = flights.fly(HOVER, simulation)
    assert "the pilot took the sticks back" in flown.early
    assert simulation.setpoints - taken[0][1] < 55  # .2 s of them, between two heartbeats
    assert simulation.fastest_down_m_s < SOFTLY_M_S


@pytest.mark.parametrize("kind", ["px4", "ardupilot"])
def test_cancelled_as_it_arms_it_is_disarmed_before_the_guard_ends(kind):
    """Its heartbeat, once a second, then still says that it is disarmed."""
    simulation, armed = flights.simulated(HOVER, kind), []
    asked = simulation._on_command_long

    def keep_the_heartbeat_slow(message) -> None:
        if not (message.command == 511 and message.param1 == 0.0):
            asked(message)

    simulation._on_command_long = keep_the_heartbeat_slow
    simulation.each_step = lambda of: armed.append(of.time_s) if of.armed else None
    flown = flights.fly(HOVER, simulation, cancel=lambda: simulation.armed)
    assert "cancelled" in flown.error
    assert armed
    assert not simulation.armed
    assert simulation.follows  # and by us, not by its failsafe
    assert simulation.way[-1][1][2] < 0.1


def test_a_pilot_who_leaves_the_mode_before_it_is_armed_ends_the_flight():
    simulation = flights.simulated(HOVER)
    left: list[float] = []

    def step(of: SimulatedAutopilot) -> None:
        of.prearm = "waiting" if of.mode == PX4_OFFBOARD or left else ""
        if of.mode == PX4_OFFBOARD and not left and "400: 1" in of.said:
            left.append(of.time_s)
            of.mode = PX4_POSITION

    simulation.each_step = step
    flown = flights.fly(HOVER, simulation)
    assert "the pilot took the sticks back" in flown.error
    assert simulation.mode == PX4_POSITION
    assert not simulation.armed


@pytest.mark.slow
def test_a_pilot_may_switch_and_arm_himself():
    simulation, said = flights.simulated(HOVER), []

    def pilot(of: SimulatedAutopilot) -> None:
        if of.setpoints > 1000 and said[-1].startswith("switch to OFFBOARD") and of.mode != PX4_OFFBOARD:
            of.mode, of.armed = PX4_OFFBOARD, True

    simulation.each_step = pilot
    flown = flights.fly(HOVER, simulation, arms=False, progress=lambda stage, _: said.append(stage))
    assert not flown.early
    assert "switch to OFFBOARD, then arm" in said
    assert not [text for text in simulation.said if text.startswith("176")]


def test_nothing_is_armed_that_was_not_asked_for(monkeypatch):
    monkeypatch.setattr("firmware_bridge.offboard.procedure.ARM_S", 2.0)
    simulation = flights.simulated(HOVER)
    flown = flights.fly(HOVER, simulation, arms=False)
    assert "it is not in mode OFFBOARD; switch to it, then arm" in flown.error
    assert not [text for text in simulation.said if text.startswith(("400", "176"))]
    assert simulation.way[-1][1][2] < 0.1


def test_what_it_does_not_arm_for_is_told_in_its_own_words(monkeypatch):
    monkeypatch.setattr("firmware_bridge.offboard.procedure.ARM_S", 2.0)
    simulation = flights.simulated(HOVER)

    def refuse(of: SimulatedAutopilot) -> None:
        of.prearm = "compass inconsistent" if of.mode == PX4_OFFBOARD else ""

    simulation.each_step = refuse
    flown = flights.fly(HOVER, simulation)
    assert "the firmware does not arm within 2 s" in flown.error
    assert "arming rejected for now; PreArm: compass inconsistent" in flown.error


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["px4", "ardupilot"])
def test_a_planner_that_dies_leaves_the_guard_which_lands_and_disarms(kind):
    simulation = flights.simulated(HOVER, kind)

    def cancel() -> bool:
        if simulation.plant.position_world_m[2] > 1.2:
            raise LinkError("the planner died")
        return False

    flown = flights.fly(HOVER, simulation, cancel=cancel)
    assert simulation.fastest_down_m_s < SOFTLY_M_S
    assert not simulation.armed
    assert not simulation.disarmed_high
    assert simulation.follows  # its own failsafe was not needed
    assert flown.early or flown.error


@pytest.mark.slow
@pytest.mark.parametrize(("kind", "mode"), [("px4", PX4_LAND), ("ardupilot", LAND)])
def test_a_guard_that_is_killed_leaves_the_autopilots_own_failsafe(kind, mode, monkeypatch):
    guards, started = [], autopilot.GuardProcess

    def noted(*arguments, **more):
        guards.append(started(*arguments, **more))
        return guards[-1]

    monkeypatch.setattr(autopilot, "GuardProcess", noted)
    simulation = flights.simulated(HOVER, kind)
    simulation.each_step = at(1.0, lambda _: os.kill(guards[0].process.pid, signal.SIGKILL))
    flights.fly(HOVER, simulation)
    assert simulation.mode == mode
    assert simulation.fastest_down_m_s < SOFTLY_M_S
    assert not simulation.disarmed_high


@pytest.mark.slow
@pytest.mark.parametrize("fault", ["lost", "frozen", "jump"])
def test_poses_that_end_or_lie_end_in_a_soft_landing(fault):
    simulation = flights.simulated(HOVER)
    kept, lost = [], []
    simulation.each_step = at(1.0, lambda _: lost.append(True))

    def change(time_s, pose):
        if not lost:
            kept[:] = [pose]
            return pose
        if fault == "lost":
            return None
        place = kept[0].position_world_m if fault == "frozen" else pose.position_world_m + np.array([2.0, 0.0, 1.0])
        q = kept[0].q_world_body if fault == "frozen" else pose.q_world_body
        return type(pose)(time_s, place, q)

    simulation.change_pose = change
    flown = flights.fly(HOVER, simulation)
    assert "no pose for 0.2 s that agrees with the flight" in flown.early
    assert simulation.fastest_down_m_s < 1.6
    assert not simulation.disarmed_high
    assert not simulation.armed


@pytest.mark.slow
def test_a_critical_battery_lands():
    simulation = flights.simulated(HOVER)
    simulation.each_step = at(0.5, lambda of: setattr(of, "charge_state", 3))
    flown = flights.fly(HOVER, simulation)
    assert "critical to the firmware" in flown.early
    assert simulation.fastest_down_m_s < SOFTLY_M_S


@pytest.mark.parametrize(
    ("more", "said"),
    [
        ({"parameters": {"COM_OBL_RC_ACT": 7}}, "not armed. COM_OBL_RC_ACT: 7, disarms: the rotors stop"),
        ({"parameters": {"MPC_THR_HOVER": 0.25}}, "not armed. MPC_THR_HOVER: 0.25, the vehicle file hovers at"),
        ({"armed": True}, "not armed. armed: armed; disarm it first"),
        ({"parameters": {"MC_PITCHRATE_MAX": 5.0}}, "set MC_PITCHRATE_MAX to"),
    ],
)
def test_a_wrong_set_up_is_refused_before_anything_flies(more, said):
    simulation = flights.simulated(curves.circle(), **more)
    flown = flights.fly(curves.circle(), simulation)
    assert said in flown.error
    assert not simulation.setpoints


def test_a_station_of_our_id_beside_us_is_refused():
    """ArduPilot passes the heartbeats of its other links on."""
    simulation = flights.simulated(HOVER, "ardupilot")
    streams, station = simulation._stream, mavlink.MAVLink(None, srcSystem=255, srcComponent=190)

    def stream() -> None:
        streams()
        beat = station.heartbeat_encode(mavlink.MAV_TYPE_GCS, mavlink.MAV_AUTOPILOT_INVALID, 0, 0, 4)
        if simulation._peer is not None:
            simulation._socket.sendto(beat.pack(station), simulation._peer)

    simulation._stream = stream
    flown = flights.fly(HOVER, simulation)
    assert "SYSID_MYGCS: 255, as which another station sends too" in flown.error
    assert not simulation.setpoints


def test_the_origin_is_told_and_poses_are_passed_on_in_its_axes():
    start = curves.hover(seconds=1.0)
    simulation = flights.simulated(start)
    simulation.plant = type(simulation.plant)(
        flights.MODEL, flights.vehicle.simulate.State(position_world_m=np.array([0.1, 0.2, 0.0])), ground_m=0.0
    )
    flown = flights.fly(start, simulation, query="?origin=47.5,8.5,400&vision=on", cancel=lambda: simulation.armed)
    assert "cancelled" in flown.error
    assert simulation.origin == (475000000, 85000000, 400000)
    assert np.median(np.array(simulation.visions), axis=0) == pytest.approx([0.1, -0.2, 0.0], abs=5e-3)


def test_who_does_not_answer_is_told_apart_from_who_is_no_multicopter():
    simulation = flights.simulated(HOVER)
    address = parsed(simulation.address)
    line = MavlinkLine(address)
    with pytest.raises(LinkError, match="no autopilot's heartbeat came"):
        settings.read(line, address, patience_s=0.2)
    line.close()
    simulation.close()


def test_the_command_of_the_page_asks_for_a_checked_plan(documented, tmp_path):
    (block,) = documented
    (command,) = block.commands
    done = unchecked(tmp_path, command)
    assert done.returncode != 0
    assert "has not passed the final gate" in done.stderr
