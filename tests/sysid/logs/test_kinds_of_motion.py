"""Which kinds of motion no flight shows is said, with what to fly; nothing of a kind that a log does not measure."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

import vehicle
from flight import FlightLog, flight_log, rotations
from sysid.logs import kinds_of_motion

TIME_S = 0.01 * np.arange(1500)
WAVE = np.sin(2.0 * TIME_S)
CAR = vehicle.example()
DOWNWASH_M_S = kinds_of_motion._downwash_m_s(CAR)
WHOLE: dict[str, Any] = {"level": 1.0, "vertical": 0.5, "roll": 2.0, "yaw": 1.5}
KINDS = dict(zip(WHOLE, kinds_of_motion.FLY, strict=True))


def log(
    level: float = 0.0,
    vertical: float = 0.0,
    roll: float = 0.0,
    yaw: float = 0.0,
    *,
    ahead: bool = True,
    time_s: np.ndarray = TIME_S,
    tilted: float = 0.0,
) -> FlightLog:
    """Waves up to so many downwashes of level and vertical speed, rad/s of roll and of yaw; along y and by pitch if not
    `ahead`, about a body that is tilted so far."""
    wave = np.sin(2.0 * time_s)
    still = 0.0 * wave
    along = [level * wave, still] if ahead else [still, level * wave]
    about = [roll * wave, still] if ahead else [still, roll * wave]
    position = 0.5 * DOWNWASH_M_S * np.stack([*along, vertical * wave], axis=1)
    q = rotations.exp(0.5 * np.stack([*about, yaw * wave], axis=1))
    q = rotations.multiply(rotations.exp(np.array([[tilted, 0.0, 0.0]])), q)
    return flight_log.from_vectors(time_s, {"position_world_m": position, "q_world_body": q})


def said(*logs: FlightLog) -> str:
    return " ".join(kinds_of_motion.notes(logs, CAR))


def test_of_hovers_all_kinds_are_told_with_what_to_fly():
    gusty = log(level=0.08, vertical=0.08, roll=0.7, yaw=0.5)
    assert said(gusty, log()) == (
        "all flights hover: no level flight, no climb and descent, no roll and pitch, no yaw, so what acts there "
        "cannot be told; fly fast_level, vertical, doublets, yaw_doublets"
    )
    assert said(log()).startswith("the flight hovers: no level flight")
    assert all(said(*flights).startswith(kinds_of_motion.HOVERING) for flights in ([log()], [gusty, log()]))


def test_flights_that_are_only_slow_are_not_said_to_hover():
    slow = log(level=0.2, vertical=0.2, roll=0.9)
    assert said(slow, slow).startswith("all flights are slow: no level flight, no climb and descent, no roll")
    assert said(slow).startswith("the flight is slow: ")
    assert not said(slow).startswith(kinds_of_motion.HOVERING)
    assert said(log(), slow).startswith("all flights are slow: ")


@pytest.mark.parametrize("kind", WHOLE)
def test_flights_are_of_one_kind_only_if_each_shows_it(kind: str):
    assert said(log(), log(**{kind: WHOLE[kind]})).startswith("no ")


@pytest.mark.parametrize("ahead", [True, False])
@pytest.mark.parametrize("kind", WHOLE)
def test_flights_of_one_kind_are_told(kind: str, ahead: bool):
    one = log(**{kind: WHOLE[kind]}, ahead=ahead)
    assert said(one, one).startswith("all flights are of one kind")
    assert said(one).startswith("no ")
    assert len(said(one).split(";")[1].split(",")) == 3
    assert f"no {KINDS[kind]}" not in said(one)


@pytest.mark.parametrize(("kind", "manoeuvre"), zip(WHOLE, kinds_of_motion.FLY.values(), strict=True))
def test_the_kind_that_no_flight_shows_is_told_and_no_other(kind: str, manoeuvre: str):
    flights = [log(**{other: size}) for other, size in WHOLE.items() if other != kind]
    assert said(*flights).endswith(f"fly {manoeuvre}")
    assert "one kind" not in said(*flights)


def test_flights_that_show_every_kind_together_are_not_spoken_of():
    assert said(*(log(**{kind: size}) for kind, size in WHOLE.items())) == ""


def test_a_long_hover_with_one_manoeuvre_shows_it():
    hover = log(time_s=0.01 * np.arange(60_000))
    position, q = hover.vector("position_world_m").copy(), hover.vector("q_world_body").copy()
    short = log(**WHOLE)
    position[30_000:30_400] = short.vector("position_world_m")[:400]
    q[30_000:30_400] = short.vector("q_world_body")[:400]
    flown = flight_log.from_vectors(hover.time_s, {"position_world_m": position, "q_world_body": q})
    assert said(flown) == ""


def test_a_jump_of_the_pose_its_noise_and_gaps_are_no_motion():
    still = log()
    noise = np.random.default_rng(1).normal(scale=2e-3, size=(len(TIME_S), 3))
    noise[700:] += 2.0
    columns = {**still.columns, **{f"position_world_{a}_m": noise[:, i] for i, a in enumerate("xyz")}}
    columns["position_world_x_m"] = np.where(np.arange(len(TIME_S)) % 7 == 0, np.nan, columns["position_world_x_m"])
    assert "no level flight, no climb and descent" in said(FlightLog(columns, still.metadata))


def test_a_gap_in_a_flight_makes_it_no_faster():
    slow = log(level=0.2)
    rows = np.r_[0:500, 900:1500]
    cut = FlightLog({name: values[rows] for name, values in slow.columns.items()}, slow.metadata)
    assert "no level flight" in said(cut)


def test_a_gap_makes_a_few_quick_samples_no_turn():
    time_s = np.r_[TIME_S[:500], TIME_S[:500] + 60.0]
    rate = np.zeros((1000, 3))
    rate[500:504] = 5.0
    jolted = flight_log.from_vectors(time_s, {"rate_body_rad_s": rate})
    assert "no roll and pitch, no yaw" in said(jolted)


def test_turns_are_about_the_body_however_it_is_tilted():
    assert "no roll and pitch" in said(log(yaw=1.5, tilted=1.2))
    assert "no yaw" not in said(log(yaw=1.5, tilted=1.2))


def test_a_gyro_shows_turns_too_quick_for_the_poses():
    hover = log()
    rate = 3.0 * np.sin(2.0 * np.pi * 5.0 * TIME_S)  # 5 Hz: 0.19 rad to and fro
    gyro = {f"rate_body_{a}_rad_s": rate for a in "xyz"}
    quick = FlightLog({**hover.columns, **gyro}, hover.metadata)
    assert said(quick).endswith("fly fast_level, vertical")


@pytest.mark.parametrize("lost", [np.nan, 0.0])
def test_a_gyro_that_ends_or_hangs_hides_no_turn_that_the_pose_shows(lost: float):
    whole = log(**WHOLE)
    rate = np.where(TIME_S < 1.0, 0.0, lost)
    gyro = {f"rate_body_{a}_rad_s": rate for a in "xyz"}
    assert said(FlightLog({**whole.columns, **gyro}, whole.metadata)) == ""


def test_the_noise_of_a_gyro_is_no_turn():
    hover = log()
    noise = np.random.default_rng(2).normal(scale=0.4, size=(3, len(TIME_S)))
    gyro = {f"rate_body_{a}_rad_s": noise[i] for i, a in enumerate("xyz")}
    assert "no roll and pitch, no yaw" in said(FlightLog({**hover.columns, **gyro}, hover.metadata))


def test_what_a_log_does_not_measure_is_not_said_of_the_others():
    bare = flight_log.from_vectors(TIME_S, {"rate_body_rad_s": np.zeros((len(TIME_S), 3))})
    assert said(bare) == "no roll and pitch, no yaw, so what acts there cannot be told; fly doublets, yaw_doublets"
    assert "level" not in said(bare, log())
    nothing = flight_log.from_vectors(TIME_S, {"rotor_speed_rad_s": np.full((len(TIME_S), 4), 400.0)})
    assert said(nothing, log()) == ""


def test_a_log_in_another_unit_of_time_is_left_to_the_check_of_its_time_base():
    """In microseconds a grid of 0.2 s would have 75 million samples."""
    hover = log()
    assert said(FlightLog({**hover.columns, "time_s": 1e6 * hover.time_s}, hover.metadata)) == ""


@pytest.mark.filterwarnings("error")
def test_damaged_positions_are_left_out():
    hover = log()
    damaged = np.where(np.arange(len(TIME_S)) == 9, 1e200, 0.0)
    columns = {**hover.columns, "position_world_x_m": damaged} | {f"rate_body_{a}_rad_s": damaged for a in "xyz"}
    assert "no level flight, no climb and descent, no roll and pitch, no yaw" in said(
        FlightLog(columns, hover.metadata)
    )


def test_the_downwash_is_that_of_all_rotors():
    angle = np.arange(6) * np.pi / 3.0
    hubs = 0.2 * np.stack([np.cos(angle), np.sin(angle), 0.0 * angle], axis=1)
    six = replace(CAR, hub_body_m=hubs, spin=np.resize([1.0, -1.0], 6))
    assert kinds_of_motion._downwash_m_s(six) == pytest.approx(DOWNWASH_M_S * np.sqrt(4.0 / 6.0))
    weight = CAR.value("mass_kg") * CAR.gravity_m_s2
    discs = 4.0 * np.pi * CAR.value("rotor_radius_m") ** 2
    assert 2.0 * CAR.value("air_density_kg_m3") * discs * DOWNWASH_M_S**2 == pytest.approx(weight)
