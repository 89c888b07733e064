"""Two ground stations with the same id: the operator is a session, and both know who it is."""

import logging

import pytest

from firmware_bridge.dialect.generated import messages as m
from firmware_bridge.link import Command
from flight import LinkError
from tests import waiting


@pytest.fixture(params=["signed", "unsigned"])
def stations(request, serve, dial):
    """The vehicle, and as many stations as are asked for; all have the default id."""
    options = {"key": None, "unsigned": True} if request.param == "unsigned" else {}
    served = serve(key=None) if request.param == "unsigned" else serve()
    return served, lambda: dial(served, **options)


def test_the_second_station_is_refused_and_told_who_is_in_control_and_the_way_out(stations, plans):
    _, station = stations
    first, second = station(), station()
    first.take_control()
    for attempt in (second.take_control, lambda: second.upload(plans.file(1)), lambda: second.set_parameters({})):
        with pytest.raises(LinkError, match=r"station 255 \(.+:\d+\) is in control .* take_control\(force=True\)"):
            attempt()
    assert second.try_command(Command.HOLD) == m.LinkReason.NOT_IN_CONTROL
    waiting.until(lambda: first.state is not None and second.state is not None)
    assert first.state.in_control
    assert not second.state.in_control


def test_the_first_station_is_told_when_the_second_takes_over(stations, plans, caplog):
    _, station = stations
    first, second = station(), station()
    first.take_control()
    with caplog.at_level(logging.WARNING):
        second.take_control(force=True)
        waiting.until(lambda: not first._port.keep_lease)
        waiting.until(lambda: any("took control of the vehicle" in record.message for record in caplog.records))
    for attempt in (lambda: first.upload(plans.file(1)), lambda: first.command(Command.ARM), first.fly):
        with pytest.raises(LinkError, match=r"station 255 \(.+\) took control .* take_control\(force=True\)"):
            attempt()
    second.set_parameters({"link_loss_s": 4.0})
    first.take_control(force=True)
    first.set_parameters({"link_loss_s": 5.0})


def test_a_station_that_crashed_and_was_started_anew_takes_its_control_back(stations):
    _, station = stations
    crashed = station()
    crashed.take_control()
    crashed._port.keep_lease = False  # no renewal, no farewell
    again = station()
    again.take_control()
    assert again.try_command(Command.LOG_STOP) == 0


def test_the_station_in_control_gives_an_order_at_once_and_others_take_control_first(stations, monkeypatch):
    _, station = stations
    first, second = station(), station()
    waiting.until(lambda: first._port.vehicle is not None)
    sent, send = [], first._port.send
    monkeypatch.setattr(first._port, "send", lambda message: (sent.append(message), send(message)))
    for asks in (True, False):
        sent.clear()
        first.order(Command.LOG_STOP)
        questions = [each for each in sent if isinstance(each, m.LeaseRequest) and each.name]  # a renewal has no name
        assert (bool(questions), any(isinstance(each, m.MissionCommand) for each in sent)) == (asks, True)
    with pytest.raises(LinkError, match="is in control of the vehicle"):
        second.order(Command.LOG_STOP)
    second.order(Command.LOG_STOP, force=True)


def test_an_order_after_an_unnoticed_take_over_is_refused_unless_it_is_forced(stations):
    _, station = stations
    first, second = station(), station()
    first.take_control()
    second.take_control(force=True)
    first._port.keep_lease = True  # as if the news had been lost
    with pytest.raises(LinkError, match="is in control of the vehicle"):
        first.order(Command.LOG_STOP)
    first._port.keep_lease = True
    first.order(Command.LOG_STOP, force=True)
    assert second.try_command(Command.LOG_STOP) == m.LinkReason.NOT_IN_CONTROL


@pytest.mark.slow
def test_heartbeats_of_a_second_station_do_not_keep_the_link_of_a_dead_first_one_alive(stations):
    _, station = stations
    first, second = station(), station()
    first.set_parameters({"link_loss_s": 0.5})
    first.command(Command.ARM)
    first.command(Command.TAKE_OFF, 1.0)
    waiting.until(lambda: second.state is not None and second.state.mission is m.MissionState.HOLD)
    first._port.keep_lease = False  # dies in the air; the second lives on under the same id
    waiting.until(lambda: second.state.reason == "link is lost")


def test_an_upload_ends_when_another_station_takes_over_and_nothing_is_changed(stations, plans):
    _, station = stations
    first, second = station(), station()
    first.upload(plans.file(2, name="old"))
    taken = []

    def interfere(_: str, fraction: float) -> None:
        if fraction > 0.3 and not taken:
            taken.append(True)
            second.take_control(force=True)

    with pytest.raises(LinkError, match="took control of the vehicle; the vehicle still holds plan old"):
        first.upload(plans.file(80, name="new"), progress=interfere, rate_bytes_s=50e3)
    assert second.read_back().name == "old"


def test_a_station_that_dies_in_mid_upload_and_is_started_anew_begins_cleanly(stations, plans):
    """Nothing of the first transfer is taken over: its pieces carry the number of a session that is gone."""
    _, station = stations
    first = station()
    first.upload(plans.file(3, name="old"))
    died = []

    def die(_: str, fraction: float) -> None:
        if fraction > 0.3 and not died:
            died.append(True)
            first._port.keep_lease = False  # neither renewals nor pieces from here on

    with pytest.raises(LinkError, match="the vehicle still holds plan old"):
        first.upload(plans.file(60, name="new"), progress=die, rate_bytes_s=50e3)
    again = station()
    report = again.upload(plans.file(60, name="new"))
    assert report.restarts == 0
    assert report.datagrams >= 62
    assert again.read_back().name == "new"
