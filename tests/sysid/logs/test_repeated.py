"""Two logs of one flight are told by poses that are equal to the last bit, whatever their files, clocks or lengths."""

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
        repeated.refuse([whole, late], ["a", "b"])


def test_pieces_of_one_flight_that_do_not_overlap_are_two():
    whole = log(np.random.default_rng(2))
    repeated.refuse([whole.slice(0.0, 1.995), whole.slice(2.0, 4.0)], ["a", "b"])


def test_flights_that_rest_in_the_same_place_are_two():
    repeated.refuse([log(np.random.default_rng(seed), at_rest=300) for seed in (3, 4)], ["a", "b"])


def test_logs_without_a_pose_are_not_asked():
    imu = FlightLog({"time_s": np.arange(100.0)}, {})
    repeated.refuse([imu, imu], ["a", "b"])
