"""Flights that all hover are refused; of others it is said which kinds of motion none of them shows."""

import numpy as np
import pytest

import vehicle
from flight import FlightLog, InputError, flight_log, rotations
from sysid.logs import kinds_of_motion

TIME_S = 0.01 * np.arange(1500)
WAVE = np.sin(2.0 * TIME_S)
DOWNWASH_M_S = kinds_of_motion._downwash_m_s(vehicle.example())


def log(level: float = 0.0, vertical: float = 0.0, roll: float = 0.0, yaw: float = 0.0) -> FlightLog:
    """Waves up to so many downwashes of level and vertical speed, rad/s of roll and of yaw."""
    position = 0.5 * DOWNWASH_M_S * np.stack([level * WAVE, 0.0 * WAVE, vertical * WAVE], axis=1)
    q = rotations.exp(0.5 * np.stack([roll * WAVE, 0.0 * WAVE, yaw * WAVE], axis=1))
    return flight_log.from_vectors(TIME_S, {"position_world_m": position, "q_world_body": q})


WHOLE = {"level": 1.0, "vertical": 0.5, "roll": 2.0, "yaw": 1.5}


def test_two_hovers_are_refused_with_what_to_fly():
    gusty = log(level=0.08, vertical=0.08, roll=0.7, yaw=0.5)
    with pytest.raises(InputError, match=r"all flights hover.*fly fast_level, vertical, doublets, yaw_doublets"):
        kinds_of_motion.check([gusty, log()], vehicle.example())


@pytest.mark.parametrize("moves", [{"level": 0.15}, {"vertical": 0.15}, {"roll": 1.2}, {"yaw": 0.9}])
def test_what_moves_slowly_or_turns_in_place_is_no_hover(moves: dict[str, float]):
    (said,) = kinds_of_motion.check([log(**moves), log()], vehicle.example())
    assert "cannot be told; fly" in said


@pytest.mark.parametrize("kind", WHOLE)
def test_flights_of_one_manoeuvre_are_told(kind: str):
    (said,) = kinds_of_motion.check([log(**{kind: WHOLE[kind]})] * 2, vehicle.example())
    assert said.startswith("all flights are of one manoeuvre")
    assert len(said.split(";")[1].split(",")) == 3


@pytest.mark.parametrize(("kind", "manoeuvre"), zip(WHOLE, kinds_of_motion.FLY.values(), strict=True))
def test_the_kind_that_no_flight_shows_is_told_and_no_other(kind: str, manoeuvre: str):
    flights = [log(**{other: size}) for other, size in WHOLE.items() if other != kind]
    (said,) = kinds_of_motion.check(flights, vehicle.example())
    assert said.endswith(f"fly {manoeuvre}")
    assert "one manoeuvre" not in said


def test_flights_that_show_every_kind_together_are_not_spoken_of():
    assert kinds_of_motion.check([log(**{kind: size}) for kind, size in WHOLE.items()], vehicle.example()) == ()


def test_the_motion_of_a_log_without_a_pose_is_not_judged():
    bare = flight_log.from_vectors(TIME_S, {"rate_body_rad_s": np.zeros((len(TIME_S), 3))})
    assert kinds_of_motion.check([bare], vehicle.example()) == ()


def test_gaps_and_noise_of_a_pose_are_no_motion():
    still = log()
    noise = np.random.default_rng(1).normal(scale=2e-3, size=(len(TIME_S), 3))
    columns = {**still.columns, **{f"position_world_{a}_m": noise[:, i] for i, a in enumerate("xyz")}}
    columns["position_world_x_m"] = np.where(np.arange(len(TIME_S)) % 7 == 0, np.nan, columns["position_world_x_m"])
    with pytest.raises(InputError, match="hover"):
        kinds_of_motion.check([FlightLog(columns, still.metadata)], vehicle.example())


def test_a_log_in_another_unit_of_time_is_left_to_the_check_of_its_time_base():
    """In microseconds a grid of 0.2 s would have 75 million samples."""
    hover = log()
    late = FlightLog({**hover.columns, "time_s": 1e6 * hover.time_s}, hover.metadata)
    assert kinds_of_motion.check([late], vehicle.example()) == ()
