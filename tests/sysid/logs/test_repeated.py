"""Two logs of one flight are told by equal poses in the same order, whatever their files, clocks or lengths."""

import numpy as np
import pytest

from flight import FlightLog, InputError, flight_log
from sysid.logs import repeated


def log(rng: np.random.Generator, rows: int = 400, at_rest: int = 0) -> FlightLog:
    """Of random poses, the first so many at rest."""
    position = rng.normal(size=(rows, 3))
    position[:at_rest] = 0.0
    q = rng.normal(size=(rows, 4))
    q[:at_rest] = [1.0, 0.0, 0.0, 0.0]
    q /= np.linalg.norm(q, axis=1, keepdims=True)
    return flight_log.from_vectors(0.01 * np.arange(rows), {"position_world_m": position, "q_world_body": q})


def test_a_part_of_a_log_on_another_clock_is_refused_by_both_names():
    whole = log(np.random.default_rng(1))
    part = whole.slice(1.0, 2.0)
    late = FlightLog({**part.columns, "time_s": part.time_s + 7.0}, part.metadata)
    with pytest.raises(InputError, match=r"a and b hold the same flight \(100% of the poses"):
        repeated.check([whole, late], ["a", "b"])


def test_pieces_of_one_flight_that_do_not_overlap_are_two():
    whole = log(np.random.default_rng(2))
    repeated.check([whole.slice(0.0, 1.995), whole.slice(2.0, 4.0)], ["a", "b"])


def test_flights_that_rest_in_the_same_place_are_two():
    repeated.check([log(np.random.default_rng(seed), at_rest=300) for seed in (3, 4)], ["a", "b"])


def scripted(rng: np.random.Generator) -> FlightLog:
    """Without noise: a tenth of the flight is the same take-off, the rest is not."""
    climbing = 0.01 * np.arange(300)
    position, q = rng.normal(size=(3000, 3)), np.tile([1.0, 0.0, 0.0, 0.0], (3000, 1))
    position[:300] = climbing[:, None] * [0.0, 0.0, 0.5]
    return flight_log.from_vectors(0.01 * np.arange(3000), {"position_world_m": position, "q_world_body": q})


def test_flights_that_a_script_starts_alike_are_two_and_it_is_said():
    said = repeated.check([scripted(np.random.default_rng(seed)) for seed in (5, 6)], ["a", "b"])
    assert said == ("a and b share 10% of their poses: that part counts twice",)


def test_hovers_that_come_upon_poses_of_three_decimals_by_chance_are_two():
    made = []
    for seed in (7, 8):
        rng = np.random.default_rng(seed)
        position, turns = 2e-3 * rng.normal(size=(6000, 3)), 1e-3 * rng.normal(size=(6000, 3))
        q = np.column_stack([np.ones(6000), turns])
        vectors = {"position_world_m": np.round(position, 3), "q_world_body": np.round(q, 3)}
        made.append(flight_log.from_vectors(0.01 * np.arange(6000), vectors))
    assert repeated.check(made, ["a", "b"]) == ()


def test_every_other_row_of_a_log_is_the_same_flight():
    whole = log(np.random.default_rng(9))
    thinned = FlightLog({name: column[::2] for name, column in whole.columns.items()}, whole.metadata)
    with pytest.raises(InputError, match="same flight"):
        repeated.check([thinned, whole], ["a", "b"])


@pytest.mark.parametrize("written", [lambda v: v.round(6), lambda v: v.astype(np.float32).astype(float)])
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_copy_with_fewer_digits_or_the_other_sign_of_its_quaternions_is_the_same_flight(written, sign):
    whole = log(np.random.default_rng(10))
    position, q = whole.vector("position_world_m"), sign * whole.vector("q_world_body")
    copy = flight_log.from_vectors(whole.time_s, {"position_world_m": written(position), "q_world_body": written(q)})
    with pytest.raises(InputError, match="same flight"):
        repeated.check([whole, copy], ["a", "b"])


def test_logs_without_a_pose_are_not_asked():
    imu = FlightLog({"time_s": np.arange(100.0)}, {})
    repeated.check([imu, imu], ["a", "b"])
