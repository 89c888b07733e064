"""Over a real UDP socket: upload, read back, fly, log."""

import queue
import threading
import time
from types import SimpleNamespace

import numpy as np
import pytest

from firmware_bridge import airborne, flying, wire
from firmware_bridge.controller import LinkLoss
from firmware_bridge.dialect.generated.messages import Command, MissionState, State
from firmware_bridge.impairment import Impairment
from firmware_bridge.link import CancelledError, connect
from firmware_bridge.port import patience_s
from firmware_bridge.sitl_vehicle import Sensors
from flight import InputError, LinkError
from tests import waiting


def test_a_trajectory_is_read_back_bit_for_bit(serve, dial, plans):
    file = plans.file(5)
    link = dial(serve())
    report = link.upload(file)
    held = link.read_back()
    sent = wire.plan_from_file(file)
    assert report.segments == 5
    assert report.restarts == 0
    assert (held.name, held.id, held.crc32) == (sent.name, sent.id, sent.crc32)
    np.testing.assert_array_equal(held.coefficients, sent.coefficients)
    np.testing.assert_array_equal(held.durations_us, sent.durations_us)
    assert held.map_hash == bytes.fromhex("ab" * 8)
    times = file.trajectory.sample(0.01)
    np.testing.assert_allclose(held.trajectory().evaluate(times), file.trajectory.evaluate(times), atol=1e-6)


def test_a_flight_leaves_a_whole_log_that_follows_the_plan(serve, dial, plans):
    file = plans.file(3)
    link = dial(serve(speed=0.0))
    link.upload(file)
    log = link.fly(file)
    assert log.metadata["source"] == "on-board log"
    np.testing.assert_allclose(np.diff(log.time_s), 0.005, atol=1e-9)  # nothing lost, 200 Hz
    for quantity in (
        "rotor_speed_rad_s",
        "rotor_speed_command_rad_s",
        "specific_force_body_m_s2",
    ):
        assert np.isfinite(log.vector(quantity)).all()
    on_path = log.columns["mission_state"] == MissionState.TRAJECTORY
    along_s = log.columns["trajectory_time_s"][on_path]
    planned = file.trajectory.position(np.clip(along_s, 0.0, file.trajectory.duration_s))
    assert on_path.sum() == pytest.approx(file.trajectory.duration_s * 200, abs=3)
    np.testing.assert_allclose(log.vector("setpoint_position_world_m")[on_path], planned, atol=1e-4)
    error_m = np.linalg.norm(log.vector("position_world_m")[on_path] - planned, axis=1)
    assert error_m.mean() < 0.02
    assert link.state.mission is MissionState.DISARMED
    assert log.vector("position_world_m")[-1, 2] < 0.05  # on the floor again


def test_a_flight_that_the_machine_holds_up_is_the_same_flight(serve, dial, plans):
    """Controller and plant share the simulated clock: what passes on the wall's is no tracking error."""
    file = plans.file(3)
    served = serve(speed=4.0)
    link = dial(served)
    link.upload(file)
    hold_up_at = [0.7, 0.4, 0.1]

    def hold_up(stage: str, fraction: float) -> None:
        if stage == "flight" and hold_up_at and fraction > hold_up_at[-1]:
            hold_up_at.pop()
            with served._lock:
                time.sleep(0.3)

    log = link.fly(file, progress=hold_up)
    assert not hold_up_at
    np.testing.assert_allclose(np.diff(log.time_s), 0.005, atol=1e-9)
    assert airborne.slowed(log) == ""
    flown = airborne.tracking(log)
    assert flown["flown_s"] == pytest.approx(file.trajectory.duration_s, abs=0.015)
    assert flown["tracking_worst_m"] < 0.03


def test_telemetry_is_lossless_at_100_hz_and_recorded_when_there_is_no_log_memory(serve, dial, plans):
    link = dial(serve(log_records=0, speed=2.0))
    link.upload(plans.file(1))
    log = link.fly(rate_hz=200.0)
    assert log.metadata["source"] == "telemetry"
    assert log.metadata["telemetry_lost_ratio"] <= 0.01  # a shared machine may stall once
    assert np.median(np.diff(log.time_s)) == pytest.approx(0.005, abs=1e-4)
    assert log.vector("rotor_speed_rad_s").max() > 500.0


def test_sensor_noise_reaches_the_log_and_the_vehicle_still_flies(serve, dial, plans):
    served = serve(speed=0.0, sensors=Sensors.typical(), seed=3)
    link = dial(served)
    link.upload(plans.file(2))
    log = link.fly()
    on_path = log.columns["mission_state"] == MissionState.TRAJECTORY
    position = log.vector("position_world_m")[on_path]
    error_m = np.linalg.norm(position - log.vector("setpoint_position_world_m")[on_path], axis=1)
    assert 0.001 < error_m.mean() < 0.08
    assert log.vector("rotor_speed_rad_s")[0].std() > 0.1  # the rotors stand still: all of it is noise


def test_flying_something_else_than_expected_is_refused_on_the_ground(serve, dial, plans):
    served = serve()
    link = dial(served)
    with pytest.raises(LinkError, match="holds no trajectory"):
        link.fly()
    link.upload(plans.file(2, name="lap-3"))
    with pytest.raises(LinkError, match=r"holds lap-3 \(crc [0-9a-f]{8}\), not other"):
        link.fly(plans.file(2, name="other", seed=5))
    assert served.plant.position_world_m[2] < 0.01


@pytest.mark.parametrize("log_records", [100_000, 0])
def test_cancelling_lands_the_vehicle_and_keeps_the_log(serve, dial, plans, log_records):
    served = serve(speed=4.0, log_records=log_records)
    link = dial(served)
    link.upload(plans.file(3))
    seen, kept = [], []
    with pytest.raises(CancelledError):
        link.fly(progress=lambda stage, _: seen.append(stage), cancel=lambda: "flight" in seen, ended_early=kept.append)
    waiting.until(lambda: link.state.mission is MissionState.DISARMED)
    assert served.plant.position_world_m[2] < 0.05
    (log,) = kept
    assert log.metadata["source"] == ("on-board log" if log_records else "telemetry")
    assert "flight cancelled" in log.metadata["ended_early"]
    assert log.vector("position_world_m")[:, 2].max() > 0.3
    assert log.columns["mission_state"][-1] in (MissionState.DISARMED, MissionState.LANDING)  # to its end


def test_a_flight_that_is_killed_keeps_its_log(serve, dial, plans):
    served = serve(speed=2.0)
    link = dial(served)
    link.upload(plans.file(4))
    kept = []

    def kill(stage: str, fraction: float) -> None:
        if stage == "flight" and fraction > 0.3 and not killed.is_set():
            killed.set()
            link.command(Command.KILL)

    killed = threading.Event()
    with pytest.raises(LinkError, match="because"):
        link.fly(progress=kill, ended_early=kept.append)
    assert kept[0].metadata["ended_early"]
    assert MissionState.TRAJECTORY in kept[0].columns["mission_state"]


def test_a_flight_whose_link_is_lost_keeps_what_was_heard(serve, dial, plans, monkeypatch):
    monkeypatch.setattr("firmware_bridge.flying._DOWN_S", 1.0)
    served = serve(speed=2.0)
    link = dial(served, timeout_s=0.5)
    link.upload(plans.file(4))
    kept = []

    def lose(stage: str, fraction: float) -> None:
        if stage == "flight" and fraction > 0.3:
            served.stop()

    with pytest.raises(LinkError):
        link.fly(progress=lose, ended_early=kept.append)
    assert kept[0].metadata["source"] == "telemetry"
    assert kept[0].vector("position_world_m")[-1, 2] > 0.3


def test_a_start_too_far_away_is_refused_with_the_rotors_still_and_the_last_log_kept(serve, dial, plans):
    served = serve(speed=0.0)
    link = dial(served)
    link.upload(plans.file(1))
    before = link.fly()
    link.take_control()
    link.set_parameters({"start_radius_m": 0.01})
    with pytest.raises(LinkError, match=r"not armed\. start: the trajectory begins .* put the vehicle at x"):
        link.fly()
    assert served.plant.rotor_speed_rad_s.max() < 1.0
    assert len(link.download_log()) == len(before)


def test_a_flight_that_another_station_ends_early_is_not_taken_for_a_whole_one(serve, dial, plans):
    served = serve(speed=2.0)
    pilot, other = dial(served), dial(served, system_id=200)
    pilot.upload(plans.file(4))

    def interfere(stage: str, fraction: float) -> None:
        if stage == "flight" and fraction > 0.3 and not other.state.in_control:
            other.take_control(force=True)
            other.command(Command.HOLD)
            waiting.until(lambda: pilot._port.control_lost)

    with pytest.raises(LinkError, match=r"station 200 \(.+\) took control of the vehicle during the flight"):
        pilot.fly(progress=interfere)


def test_an_invalid_order_is_refused_with_the_reason(serve, dial):
    link = dial(serve())
    link.take_control()
    with pytest.raises(LinkError, match="refused to land"):
        link.command(Command.LAND)


def test_a_lost_link_is_reported_in_one_sentence(plans, monkeypatch):
    monkeypatch.setattr("firmware_bridge.port.patience_s", lambda timeout_s: timeout_s)
    with pytest.raises(LinkError, match=r"no vehicle answers at udp://127.0.0.1:9 within 0\.8 s"):
        connect("udp://127.0.0.1:9", key=plans.key, timeout_s=0.8)


@pytest.mark.parametrize(("load", "expected_s"), [(0.0, 3.0), (2.0, 3.0), (3.0, 4.5), (20.0, 30.0)])
def test_a_busy_machine_is_waited_for_as_many_times_longer_as_it_is_overloaded(monkeypatch, load, expected_s):
    monkeypatch.setattr("os.cpu_count", lambda: 2)
    monkeypatch.setattr("os.getloadavg", lambda: (load, 0.0, 0.0))
    assert patience_s(3.0) == pytest.approx(expected_s)


def test_an_answer_that_a_busy_machine_holds_up_is_no_dead_link(serve, dial, monkeypatch):
    """The vehicle comes to nothing for longer than the time-out of an idle machine."""
    monkeypatch.setattr("firmware_bridge.port.patience_s", lambda timeout_s: 600.0 * timeout_s)
    served = serve()
    link = dial(served, timeout_s=0.1)
    with served._lock:
        asking = threading.Thread(target=link.take_control)
        asking.start()
        time.sleep(1.0)
    asking.join()
    assert link.state.in_control


def test_a_link_that_is_lost_later_is_reported_too(serve, plans):
    served = serve(line=Impairment())
    with connect(served.url, key=plans.key, timeout_s=0.8) as link:
        link.take_control()
        waiting.until(lambda: link.state is not None)
        served.stop()
        waiting.until(lambda: link.state.age_s > 1.5)
        with pytest.raises(LinkError, match="is lost: no message for"):
            link.command(Command.ARM)


@pytest.mark.parametrize("url", ["tcp://127.0.0.1:1", "udp://", "udp://host:port"])
def test_a_wrong_address_is_refused(url: str, plans):
    with pytest.raises(InputError, match="is not an address"):
        connect(url, key=plans.key)


def test_the_vehicles_clock_is_compared(serve, dial):
    served = serve()
    link = dial(served)
    offset_s, bound_s = link.clock_offset_s()
    before_s, there_s, after_s = time.monotonic(), served.time_s, time.monotonic()
    assert before_s + offset_s - bound_s - 0.1 < there_s < after_s + offset_s + bound_s + 0.1


def test_parameters_change_all_together_or_not_at_all(serve, dial):
    link = dial(serve())
    before = link.parameters()
    link.set_parameters({"mass_kg": 0.72, "kp_xy_1_s2": 8.0})
    after = link.parameters()
    assert after["mass_kg"] == pytest.approx(0.72)
    assert {k for k in after if after[k] != before[k]} == {"mass_kg", "kp_xy_1_s2"}
    with pytest.raises(LinkError, match=r"refused the parameters: .*kp_z_1_s2.*nothing was changed"):
        link.set_parameters({"mass_kg": 0.8, "kp_z_1_s2": -5.0})
    assert link.parameters() == after
    with pytest.raises(InputError, match="no parameter masss"):
        link.set_parameters({"masss": 1.0})
    with pytest.raises(InputError, match="not finite"):
        link.set_parameters({"mass_kg": float("nan")})


def test_parameters_may_be_set_while_an_upload_is_under_way(serve, dial, plans):
    served = serve(line=Impairment(delay_s=0.002, rate_bytes_s=50e3))
    link = dial(served)
    done = []

    def progress(stage: str, fraction: float) -> None:
        if stage == "upload" and 0.3 < fraction < 0.9 and not done:
            link.set_parameters({"mass_kg": 0.72})
            done.append(stage)

    report = link.upload(plans.file(60, name="undisturbed"), progress=progress, rate_bytes_s=50e3)
    assert done
    assert report.restarts == 0
    assert link.parameters()["mass_kg"] == pytest.approx(0.72)
    assert link.read_back().name == "undisturbed"


@pytest.mark.parametrize(
    ("policy", "end"),
    [
        (LinkLoss.LAND, MissionState.DISARMED),
        (LinkLoss.FINISH, MissionState.HOLD),
    ],
)
def test_a_vehicle_whose_operator_vanishes_does_what_was_agreed_at_the_upload(serve, dial, plans, policy, end):
    served = serve(speed=2.0)
    watcher, pilot = dial(served, system_id=200), dial(served)
    pilot.upload(plans.file(4), on_link_loss=policy)

    def crash(stage: str, fraction: float) -> None:
        if stage == "flight" and fraction > 0.05:
            pilot._port._closing.set()  # no farewell, no heartbeat
            raise RuntimeError("the ground station's program crashed")

    with pytest.raises(RuntimeError):
        pilot.fly(progress=crash)
    seen, ends = set(), (end, MissionState.ARMED if policy is LinkLoss.LAND else end)

    def has_ended() -> bool:
        seen.add(watcher.state.mission)
        return watcher.state.mission in ends

    waiting.until(has_ended, pause_s=0.02)
    assert MissionState.TRAJECTORY in seen
    assert (MissionState.ABORTING in seen) == (policy is LinkLoss.LAND)
    assert MissionState.STOPPING not in seen


def test_a_message_that_was_overtaken_does_not_turn_the_mission_back():
    """Seen on a jittering line: HOLD, then a TAKE_OFF that was sent before it, was taken for a refusal to start."""
    inbox: queue.SimpleQueue[State] = queue.SimpleQueue()
    watch = flying._Watch(
        SimpleNamespace(timeout_s=1.0, last_heard_s=time.monotonic(), control_lost=""), inbox, lambda: False
    )
    sent = [(10_000_000, MissionState.TAKE_OFF), (10_020_000, MissionState.HOLD), (10_010_000, MissionState.TAKE_OFF)]
    for time_us, mission in sent:
        inbox.put(State(time_us=time_us, mission_state=mission))
        watch.listen()
    assert watch.mission is MissionState.HOLD
    assert watch.time_s == pytest.approx(10.02)
    assert len(watch.states) == 3  # the log still wants it
    inbox.put(State(time_us=1_000, mission_state=MissionState.DISARMED))  # the vehicle was started anew
    watch.listen()
    assert watch.mission is MissionState.DISARMED
