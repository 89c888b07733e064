"""On Betaflight's own firmware: a plan is flown and logged, and what is lost ends in a soft landing."""

import json
import shlex
import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest

import vehicle
from firmware_bridge.betaflight_sitl import firmware
from firmware_bridge.betaflight_sitl.process import Sitl
from flight import InputError, LinkError, TrajectoryFile, silent, trajectory
from goshawk.commands.fly import offboard
from tests import waiting
from tests.firmware_bridge.offboard import curves, faults

MODEL = vehicle.example("rigter2019")


@pytest.fixture(scope="module")
def _betaflight():
    try:
        firmware.program()
    except firmware.UnavailableError as reason:
        pytest.skip(str(reason))


@pytest.fixture
def folder(tmp_path):
    """With a plan that was never checked, and a vehicle."""
    way = curves.circle()
    file = TrajectoryFile(way, "circle", "", "", way.position([0.0, way.duration_s]), {})
    trajectory.save(tmp_path / "walk.json", file)
    vehicle.save(tmp_path / "vehicle.toml", MODEL)
    return tmp_path


def run(folder, command):
    words = [sys.executable, "-m", *shlex.split(command)]
    return subprocess.run(words, cwd=folder, capture_output=True, text=True, timeout=waiting.PATIENCE_S, check=False)


@pytest.mark.slow
@pytest.mark.usefixtures("_betaflight")
def test_the_rehearsal_of_the_page_flies_a_circle(documented, folder):
    (block,) = documented
    fly, check = block.commands
    done = run(folder, f"{fly} --json")
    assert done.returncode == 0, done.stderr
    facts = json.loads(done.stdout)
    assert facts["tracking_mean_m"] < 0.03
    assert facts["touch_down_m_s"] < 1.2
    assert run(folder, check).returncode in (0, 1)  # read; what it finds in such a flight is its own test's business


def test_a_plan_that_was_not_checked_is_not_flown(documented, folder):
    (block,) = documented
    (fly,) = block.commands
    done = run(folder, fly)
    assert done.returncode != 0
    assert "has not passed the final gate" in done.stderr


def test_a_body_and_recordings_are_for_a_rehearsal_and_nothing_is_written_over(folder):
    done = run(folder, "goshawk fly walk.json --body vehicle.toml --record kept --out flown.parquet")
    assert done.returncode == 2
    assert "--body and --record are for --rehearse" in done.stderr
    (folder / "kept").mkdir()
    (folder / "kept" / "poses.tum").write_text("older")
    done = run(folder, "goshawk fly walk.json --rehearse --vehicle vehicle.toml --record kept --out flown.parquet")
    assert done.returncode == 2
    assert "poses.tum" in done.stderr
    assert (folder / "kept" / "poses.tum").read_text() == "older"


@pytest.mark.slow
@pytest.mark.usefixtures("_betaflight")
@pytest.mark.parametrize("kind", ["kill", "kill and pose lost", "pose jump", "low battery", "link lost"])
def test_what_is_lost_in_flight_ends_in_a_soft_landing(kind, tmp_path):
    ended = faults.fly(tmp_path, MODEL, curves.circle(), faults.Fault(kind, after_s=5.0))
    assert ended.begun_s is not None, ended.said
    assert ended.safe, ended


@pytest.mark.slow
@pytest.mark.usefixtures("_betaflight")
def test_the_pilots_switch_gives_the_sticks_back(tmp_path):
    """The pilot arms, gives the sticks away, takes them back on the way, and lands by hand."""
    fault = faults.Fault("stick override", after_s=5.0, size=1530.0)
    ended = faults.fly(tmp_path, MODEL, curves.circle(), fault, settings=faults.OVERRIDE)
    assert "the pilot took the sticks back" in ended.said
    assert ended.safe, ended


@pytest.mark.slow
@pytest.mark.usefixtures("_betaflight")
def test_a_firmware_that_stalls_as_it_starts_is_started_again(monkeypatch):
    begins, tries = Sitl.begins, []

    def stalled_at_first(self):
        tries.append(begins(self))
        return len(tries) > 1 and tries[-1]

    monkeypatch.setattr(Sitl, "begins", stalled_at_first)
    way = curves.hover(seconds=1.0)
    file = TrajectoryFile(way, "hover", "", "", way.position([0.0, way.duration_s]), {})
    _, early, down_m_s = offboard.rehearse(MODEL, file, seed=1, progress=silent, cancel=lambda: False)
    assert tries == [True, True]
    assert not early
    assert down_m_s < 1.2


def test_the_battery_of_the_vehicle_file_is_in_its_thrust_map():
    """At a lower voltage the throttle for the weight turns the rotors as fast as at the reference."""
    sagging = MODEL.with_effect("battery_sag", sag_per_v=0.04, reference_v=16.8)
    thrust, weight_n = offboard.thrust_map(sagging), MODEL.mass_kg * MODEL.gravity_m_s2

    def speed(battery_v: float) -> float:
        throttle = thrust.throttle(weight_n, battery_v)
        return (offboard.IDLE + (1.0 - offboard.IDLE) * throttle) * (1.0 - 0.04 * (16.8 - battery_v))

    assert thrust.throttle(weight_n, 14.8) > thrust.throttle(weight_n, 16.8)
    assert speed(14.8) == pytest.approx(speed(16.8), rel=0.01)
    assert offboard.thrust_map(MODEL).throttle(weight_n, 14.8) == offboard.thrust_map(MODEL).throttle(weight_n, 16.8)


SAGGING = MODEL.with_effect("battery_sag", sag_per_v=0.04, reference_v=25.2)


def test_the_rehearsed_body_has_the_voltage_that_the_map_assumes():
    """The firmware of the simulator measures none, so that a body below the reference could not be corrected."""
    body = offboard.body_of(SAGGING, curves.hover(), seed=1)
    throttle = offboard.thrust_map(SAGGING).throttle(MODEL.mass_kg * MODEL.gravity_m_s2)
    command = np.full(4, body.full_rad_s * (offboard.IDLE + (1.0 - offboard.IDLE) * throttle))
    for _ in range(500):
        body.plant.step(command, 2e-3)
    assert body.plant.rotor_speed_rad_s == pytest.approx(command, rel=0.01)


@pytest.mark.slow
@pytest.mark.usefixtures("_betaflight")
def test_a_vehicle_of_six_cells_is_rehearsed():
    way = curves.hover(seconds=2.0)
    file = TrajectoryFile(way, "hover", "", "", way.position([0.0, way.duration_s]), {})
    log, early, down_m_s = offboard.rehearse(SAGGING, file, seed=1, progress=silent, cancel=lambda: False)
    assert not early
    assert down_m_s < 1.2
    assert log.metadata["battery"] == offboard.NO_SAG


@pytest.mark.slow
@pytest.mark.usefixtures("_betaflight")
def test_a_firmware_that_always_stalls_ends_the_rehearsal_with_that_word(monkeypatch):
    tries = []
    monkeypatch.setattr(Sitl, "begins", lambda self: bool(tries.append(1)))
    way = curves.hover(seconds=1.0)
    file = TrajectoryFile(way, "hover", "", "", way.position([0.0, way.duration_s]), {})
    with pytest.raises(LinkError, match="stalled 3 times"):
        offboard.rehearse(MODEL, file, seed=1, progress=silent, cancel=lambda: False)
    assert len(tries) == 3


def test_a_plan_that_the_profile_cannot_follow_is_refused_with_the_figure():
    fast = curves.circle(speed_m_s=4.0, radius_m=0.8)
    thrust, plenty = offboard.thrust_map(MODEL), (17.0, 17.0, 17.0)
    least_n, most_n = thrust.force_n(0.0), thrust.force_n(1.0)
    offboard.require_followable(MODEL, fast, plenty, (least_n, most_n))
    with pytest.raises(InputError, match=r"deg/s about (roll|pitch) at .* set (roll|pitch)_srate"):
        offboard.require_followable(MODEL, fast, (0.5, 0.5, 17.0), (least_n, most_n))
    with pytest.raises(InputError, match="the rotors give"):
        offboard.require_followable(MODEL, fast, plenty, (least_n, 0.3 * most_n))


@pytest.mark.slow
@pytest.mark.usefixtures("_betaflight")
@pytest.mark.parametrize(
    ("setting", "model", "said"),
    [
        ("set pitch_rc_rate = 2", MODEL, r"deg/s about pitch at .* set pitch_srate"),
        ("set pitch_rc_rate = 100", MODEL.with_limits(rotor_speed_max_rad_s=1015.0), "hover throttle: 0.9. of full"),
    ],
)
def test_what_the_firmware_itself_is_set_up_for_decides_and_no_rotor_turns(setting, model, said):
    """Its rates are read back, a largest of 20 deg/s; the rotors' most is the vehicle file's."""
    way = curves.circle()
    body = offboard.body_of(MODEL, way, seed=1, believed=model)
    body.settings = (*body.settings, setting, setting.replace("rc_rate", "srate"))
    file = TrajectoryFile(way, "way", "", "", way.position([0.0, way.duration_s]), {})
    with pytest.raises((InputError, LinkError), match=said), offboard.rehearsing(body) as (where, restarted):
        offboard.fly(model, file, where, progress=silent, cancel=lambda: False, restarted=restarted)
    assert not body.way
    assert not body.plant.rotor_speed_rad_s.any()


STUMBLED_ON = {
    "thr_expo: 50, expected 0; set thr_expo = 0": "set thr_expo = 50",  # thrust scaling
    "throttle_limit_type: SCALE, expected OFF; set throttle_limit_type = OFF": "set throttle_limit_type = SCALE",
    "rates_type: BETAFLIGHT, expected ACTUAL; set rates_type = ACTUAL": "set rates_type = BETAFLIGHT",
    "small_angle: arms below 5 deg, at least 15; set small_angle = 25": "set small_angle = 5",
}
"""What is said, by the setting that it is said of."""


@pytest.mark.slow
@pytest.mark.usefixtures("_betaflight")
def test_what_people_stumble_on_is_read_back_and_said_before_any_rotor_turns():
    """Thrust scaling, rate profile, arming angle: set wrong in the real firmware; hover throttle: in the file."""
    way, slow = curves.circle(), MODEL.with_limits(rotor_speed_max_rad_s=1015.0)
    body = offboard.body_of(MODEL, way, seed=1, believed=slow)
    body.settings = (*body.settings, *STUMBLED_ON.values())
    file = TrajectoryFile(way, "way", "", "", way.position([0.0, way.duration_s]), {})
    with pytest.raises(LinkError) as refused, offboard.rehearsing(body) as (where, restarted):
        offboard.fly(slow, file, where, progress=silent, cancel=lambda: False, restarted=restarted)
    for words in (*STUMBLED_ON, "of full by the vehicle file, expected 0.15 to 0.8; mend its mass"):
        assert words in str(refused.value)
    assert not body.way


@pytest.mark.slow
@pytest.mark.usefixtures("_betaflight")
def test_a_clock_that_is_not_ours_is_said_before_it_is_armed():
    way, said = curves.circle(), list[str]()
    body = offboard.body_of(MODEL, way, seed=1)
    body.change_pose = lambda _, pose: replace(pose, time_s=pose.time_s - 1000.0)
    file = TrajectoryFile(way, "way", "", "", way.position([0.0, way.duration_s]), {})
    with pytest.raises(LinkError, match="cancelled"), offboard.rehearsing(body) as (where, restarted):
        offboard.fly(
            MODEL, file, where, progress=lambda text, _: said.append(text), cancel=lambda: bool(said),
            restarted=restarted,
        )  # fmt: skip
    assert said == ["the poses are stamped by another clock: taken to be as old as ?delay= says, 0 s without"]
    assert not body.plant.rotor_speed_rad_s.any()


def test_the_thrust_map_is_that_of_the_vehicle_at_hover():
    thrust = offboard.thrust_map(MODEL)
    weight_n = MODEL.mass_kg * MODEL.gravity_m_s2
    throttle = thrust.throttle(weight_n)
    speed = MODEL.limits.rotor_speed_max_rad_s * (offboard.IDLE + (1.0 - offboard.IDLE) * throttle)
    force, _ = vehicle.wrench(MODEL, np.zeros((1, 3)), np.zeros((1, 3)), np.full((1, 4), speed))
    assert force[0, 2] == pytest.approx(weight_n, rel=0.01)


def test_only_rotors_that_betaflights_mixer_knows_are_flown():
    assert sorted(offboard.rotor_of_motor(MODEL)) == [0, 1, 2, 3]
    from dataclasses import replace

    plus = replace(MODEL, hub_body_m=np.array([[0.1, 0, 0], [0, 0.1, 0], [-0.1, 0, 0], [0, -0.1, 0]]))
    with pytest.raises(InputError, match="QUADX"):
        offboard.rotor_of_motor(plus)


def test_a_rehearsal_is_not_flown_on_the_address_too(folder):
    done = run(folder, "goshawk fly walk.json --rehearse --on betaflight:tcp://127.0.0.1:5761 --out a.parquet")
    assert done.returncode == 2
    assert "give one of them" in done.stderr


@pytest.mark.parametrize("url", ["tcp://a:1", "udp://a", "udp://a:b", "udp://a:1?delay=9"])
def test_a_wrong_pose_stream_is_refused(url):
    with pytest.raises(InputError, match="--pose-stream"):
        offboard.pose_address(url)
