"""Long flights: the fit uses the segments that tell most, says which, and leaves the rest to be predicted."""

from dataclasses import replace

import numpy as np
import pytest

import sysid
import vehicle
from flight import FlightLog, InputError
from sysid.estimator import segments
from sysid.estimator.flights.flight_data import left_out
from sysid.estimator.prepare import prepare_all
from tests.sysid import flying

LIVELY_S = (30.0, 60.0)
FEW = sysid.Options(most_nodes=5000)


@pytest.fixture(scope="module")
def long_log() -> FlightLog:
    """Hover, but for half a minute in the middle."""
    rng = np.random.default_rng(3)
    whole = flying.paper_flights(rng)

    def reference(t: float) -> tuple[np.ndarray, ...]:
        position, velocity, acceleration, yaw = (part[2:3] for part in whole(t))
        on = float(LIVELY_S[0] < t < LIVELY_S[1])
        return on * position, on * velocity, on * acceleration, on * yaw

    truth = flying.Truth()
    (log,) = flying.fly(truth, reference, 1, duration_s=90.0, rng=rng, rate_hz=100.0, gyro_noise_rad_s=0.02)
    return log


def inside(flights: list, spans_s: tuple[float, float]) -> list[bool]:
    return [spans_s[0] - 5.0 < f.time_s[0] and f.time_s[-1] < spans_s[1] + 5.0 for f in flights]


def test_the_segments_that_tell_most_are_those_in_which_the_vehicle_moves(long_log):
    flights = prepare_all([long_log], FEW, [vehicle.example()])
    assert sum(len(f) for f in flights) <= segments.USED * FEW.most_nodes
    assert flights
    assert all(inside(flights, LIVELY_S))
    assert [f.time_s[0] for f in flights] == sorted(f.time_s[0] for f in flights)


def test_what_was_used_is_said_in_one_line_with_the_way_to_use_more(long_log):
    (sentence,) = left_out(prepare_all([long_log], FEW, [vehicle.example()]))
    assert "of 10 s" in sentence
    assert "of 89 s" in sentence or "of 90 s" in sentence
    assert "most_nodes" in sentence


def test_the_rest_has_no_moment_of_what_was_fitted(long_log):
    models = [vehicle.example()]
    fitted = prepare_all([long_log], FEW, models)
    held_out = prepare_all([long_log], replace(FEW, segments="rest"), models)
    assert held_out
    assert not {t for f in fitted for t in f.time_s} & {t for f in held_out for t in f.time_s}


def test_a_log_that_is_not_long_is_one_flight(long_log):
    short = long_log.slice(0.0, 45.0)
    assert len(prepare_all([short], FEW, [vehicle.example()])) == 1
    assert not segments.are_long([short], FEW)
    assert segments.are_long([short, short], FEW)


@pytest.mark.parametrize("piece", [(0.0, 3.0), (1.0, 14.9), (2.0, 15.5), (0.0, 100.0)])
def test_segments_are_the_piece_without_a_gap(piece):
    cut = segments.cut([piece])
    edges = [cut[0][0], *(end for _, end in cut)]
    assert (edges[0], edges[-1]) == piece
    assert [begin for begin, _ in cut] == edges[:-1]
    assert all(end - begin < 1.6 * segments.SEGMENT_S for begin, end in cut)


def test_too_few_nodes_are_refused_with_the_bound():
    with pytest.raises(InputError, match="most_nodes is 100; it must be at least 5000"):
        sysid.Options(most_nodes=100)


@pytest.mark.slow
def test_the_chosen_segments_show_the_inertia_and_the_rest_is_predicted(long_log):
    truth, given = flying.Truth(), vehicle.example()
    fit = sysid.identify([long_log], given, replace(FEW, gusts="white"))
    for axis, true in zip(("xx", "yy"), truth.inertia, strict=False):
        found = fit.estimate(f"inertia_{axis}_kg_m2")
        assert abs(found.value - true) < 0.01 * true + 4.0 * found.std_robust
    found = sysid.compare([long_log], {"given": given, "fitted": fit.vehicle}, replace(FEW, segments="rest"))
    assert "held out" in found.left_out[0]
