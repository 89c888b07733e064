"""The upload's byte rate: it backs off when the line's queue grows, and comes back when it is empty."""

import pytest

from firmware_bridge.dialect.generated.messages import TrajectoryStatus
from firmware_bridge.transfer import Outgoing, Pacer

MOST_BYTES_S = 1e6


def crowded_line(pacer: Pacer, reports: int, capacity_bytes_s: float) -> list[float]:
    """Round trips over a line of this capacity whose queue is what was sent beyond it, a report every 50 ms."""
    queue_bytes, rates = 0.0, []
    for _ in range(reports):
        queue_bytes = max(queue_bytes + 0.05 * (pacer.rate_bytes_s - capacity_bytes_s), 0.0)
        pacer.measured(0.02 + queue_bytes / capacity_bytes_s)
        rates.append(pacer.rate_bytes_s)
    return rates


def test_a_growing_round_trip_lowers_the_rate_by_a_fifth_each_time():
    pacer = Pacer(MOST_BYTES_S, MOST_BYTES_S)
    pacer.measured(0.02)
    for n in range(1, 6):
        pacer.measured(0.2)
        assert pacer.rate_bytes_s == pytest.approx(MOST_BYTES_S * 0.8**n)


def test_a_round_trip_that_merely_varies_does_not_lower_the_rate():
    pacer = Pacer(MOST_BYTES_S, MOST_BYTES_S)
    for rtt_s in (0.02, 0.05, 0.03, 0.069, 0.02):
        pacer.measured(rtt_s)
    assert pacer.rate_bytes_s == MOST_BYTES_S


def test_the_rate_returns_slowly_and_not_beyond_its_limit():
    pacer = Pacer(MOST_BYTES_S, MOST_BYTES_S)
    pacer.measured(0.02)
    pacer.measured(0.5)
    pacer.measured(0.02)
    assert pacer.rate_bytes_s == pytest.approx(0.8 * 1.02 * MOST_BYTES_S)
    for _ in range(50):
        pacer.measured(0.02)
    assert pacer.rate_bytes_s == MOST_BYTES_S


def test_a_lost_link_is_still_probed_at_20_kilobytes_a_second():
    pacer = Pacer(MOST_BYTES_S, MOST_BYTES_S)
    pacer.measured(0.02)
    for _ in range(200):
        pacer.measured(5.0)
    assert pacer.rate_bytes_s == 2e4


@pytest.mark.parametrize("capacity_bytes_s", [4e4, 1e5, 4e5])
def test_over_a_narrow_line_the_rate_settles_at_what_it_carries(capacity_bytes_s):
    pacer = Pacer(MOST_BYTES_S, MOST_BYTES_S)
    rates = crowded_line(pacer, 400, capacity_bytes_s)
    late = rates[200:]
    assert max(late) < 2.0 * capacity_bytes_s
    assert sum(late) / len(late) == pytest.approx(capacity_bytes_s, rel=0.25)


def test_frames_are_spaced_by_the_rate_that_holds_now():
    pacer = Pacer(1e5, 1e5)
    pacer.sent(1000, now_s=10.0)
    assert pacer.next_s == pytest.approx(10.005)  # a late wake-up may catch up 5 ms
    pacer.sent(1000, now_s=10.0)
    assert pacer.next_s == pytest.approx(10.015)
    pacer.rate_bytes_s = 5e4
    pacer.sent(1000, now_s=10.0)
    assert pacer.next_s == pytest.approx(10.035)


def test_a_report_of_a_piece_sent_once_measures_the_round_trip_and_backs_off():
    pacer = Pacer(MOST_BYTES_S, MOST_BYTES_S)
    pacer.measured(0.02)
    outgoing = Outgoing([TrajectoryStatus() for _ in range(3)])
    outgoing.next(now_s=5.0)
    status = TrajectoryStatus(segments=2, last_index=0, bitmap=bytes([1]) + bytes(63))
    outgoing.reported(status, now_s=5.4, pacer=pacer)
    assert pacer.rate_bytes_s == pytest.approx(0.8 * MOST_BYTES_S)


def test_a_piece_sent_twice_measures_nothing():
    """Which of the two arrived cannot be known (Karn's rule)."""
    pacer = Pacer(MOST_BYTES_S, MOST_BYTES_S)
    pacer.measured(0.02)
    outgoing = Outgoing([TrajectoryStatus() for _ in range(3)])
    outgoing.next(now_s=5.0)
    outgoing.waiting.append(0)
    outgoing.next(now_s=5.2)
    status = TrajectoryStatus(segments=2, last_index=0, bitmap=bytes([1]) + bytes(63))
    outgoing.reported(status, now_s=5.4, pacer=pacer)
    assert pacer.rate_bytes_s == MOST_BYTES_S
