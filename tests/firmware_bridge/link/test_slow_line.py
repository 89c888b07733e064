"""Lines that carry less than the telemetry takes, and lines that lose: judged by what comes of it, never by time."""

import pytest

from firmware_bridge import wire
from firmware_bridge.impairment import Impairment
from firmware_bridge.line import LineMeter
from firmware_bridge.link import Command
from flight import LinkError

RATES = [pytest.param(500.0, marks=pytest.mark.slow), pytest.param(2e3, marks=pytest.mark.slow), 4e3, 8e3]


@pytest.mark.parametrize("rate_bytes_s", RATES)
def test_a_plan_gets_over_a_slow_line_and_comes_back_equal(serve, dial, plans, rate_bytes_s):
    file = plans.file(12)
    link = dial(serve(line=Impairment(rate_bytes_s=rate_bytes_s)))
    report = link.upload(file)
    assert report.datagrams < 6 * 15
    assert link.read_back().crc32 == wire.plan_from_file(file).crc32
    assert link.state.in_control


@pytest.mark.slow
def test_an_unsigned_plan_gets_over_a_slow_line(serve, dial, plans):
    link = dial(serve(key=None, line=Impairment(rate_bytes_s=2e3)), key=None, unsigned=True)
    link.upload(plans.file(12))
    assert link.read_back().name == "hops"


@pytest.mark.slow
def test_orders_and_telemetry_go_on_while_bulk_uses_a_slow_line(serve, dial, plans):
    served = serve(line=Impairment(rate_bytes_s=4e3))
    link = dial(served)
    link.upload(plans.file(60))
    seen = []

    def during(_: str, __: float) -> None:
        seen.append(link.state.time_s)
        if len(seen) == 5:
            link.command(Command.LOG_STOP)

    link.read_back(progress=during)
    assert len(set(seen)) > 3


def test_a_vehicle_whose_own_rate_is_low_still_sends_bulk_beside_telemetry(serve, dial, plans):
    link = dial(serve(bytes_per_s=8000))
    link.upload(plans.file(12))
    assert link.read_back().name == "hops"


def test_an_error_names_what_was_measured(serve, dial, monkeypatch):
    monkeypatch.setattr("firmware_bridge.port.patience_s", lambda timeout_s: timeout_s)
    served = serve()
    link = dial(served, timeout_s=0.5)
    link.take_control()
    monkeypatch.setattr(type(link._port), "send", lambda *_: None)  # a line that carries nothing one way
    with pytest.raises(LinkError, match=r"alive but did not answer .*\d+ of the last \d+ frames .* kB/s") as caught:
        link.command(Command.ARM)
    assert "key" not in str(caught.value)


# -- the meter ------------------------------------------------------------------------------------------------------


def _telemetry(meter: LineMeter, now_s: float, sent_hz: float, arrives, *, seconds: float, sequence: int = 0):
    """Frames of 100 bytes; `arrives(i)` says which come through."""
    for i in range(round(seconds * sent_hz)):
        if arrives(i):
            meter.received((sequence + i) % 256, 100, now_s + i / sent_hz)
    return now_s + seconds, sequence + round(seconds * sent_hz)


def test_a_line_that_is_full_is_limited_to_what_arrives():
    meter = LineMeter()
    _telemetry(meter, 0.0, 100.0, lambda i: i % 10 == 0, seconds=3.0)
    assert meter.limit_bytes_s == pytest.approx(1000.0, rel=0.3)


def test_a_line_that_loses_a_third_is_not_limited():
    meter = LineMeter()
    _telemetry(meter, 0.0, 100.0, lambda i: i % 3 != 0, seconds=10.0)
    assert not meter.limit_bytes_s


def test_a_limit_that_does_not_lessen_the_loss_is_lifted():
    """It is the radio: sending less helps nobody."""
    meter = LineMeter()
    now_s, sequence = _telemetry(meter, 0.0, 100.0, lambda i: i % 10 == 0, seconds=3.0)
    for _ in range(20):
        if not (limit := meter.limit_bytes_s):
            break
        meter.reported(limit, now_s)
        now_s, sequence = _telemetry(meter, now_s, limit / 100.0, lambda i: i % 10 == 0, seconds=8.0, sequence=sequence)
    assert not meter.limit_bytes_s
    _telemetry(meter, now_s, 100.0, lambda i: i % 10 == 0, seconds=5.0, sequence=sequence)
    assert not meter.limit_bytes_s


def test_a_limit_that_loses_nothing_is_raised_only_after_the_vehicle_has_obeyed():
    meter = LineMeter()
    now_s, sequence = _telemetry(meter, 0.0, 100.0, lambda i: i % 10 == 0, seconds=3.0)
    limit = meter.limit_bytes_s
    now_s, sequence = _telemetry(meter, now_s, limit / 100.0, lambda _: True, seconds=5.0, sequence=sequence)
    assert meter.limit_bytes_s == limit
    meter.reported(limit, now_s)
    _telemetry(meter, now_s, limit / 100.0, lambda _: True, seconds=5.0, sequence=sequence)
    assert meter.limit_bytes_s == pytest.approx(1.25 * limit)


def test_a_restart_of_the_vehicles_sequence_is_not_a_full_line():
    meter = LineMeter()
    now_s, _ = _telemetry(meter, 0.0, 100.0, lambda _: True, seconds=2.0)
    _telemetry(meter, now_s, 100.0, lambda _: True, seconds=4.0, sequence=90)
    assert not meter.limit_bytes_s
