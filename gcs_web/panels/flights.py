"""Recorded flights: what each is for, their streams over time, logs that are dropped, fixed, discarded."""

from collections.abc import Callable
from typing import Any

from gcs_web import protocol
from gcs_web.desk import Desk
from gcs_web.flights import aligning


def _list(desk: Desk, _: protocol.Person, __: protocol.ListFlights) -> None:
    desk.flights.refresh()


def _set_role(desk: Desk, _: protocol.Person, wanted: protocol.SetRole) -> None:
    desk.flights.set_role(wanted.flight, wanted.role)


def _open(desk: Desk, _: protocol.Person, wanted: protocol.OpenFlights) -> protocol.Reply:
    return protocol.Reply(wanted.serial, flights=[desk.comparing.opened(name) for name in wanted.flights])


def _align(desk: Desk, _: protocol.Person, wanted: protocol.AlignFlights) -> protocol.Reply:
    return protocol.Reply(wanted.serial, aligned=aligning.align(desk.flights.recorded, wanted.flights, wanted.by))


def _read(desk: Desk, _: protocol.Person, wanted: protocol.ReadStreams) -> protocol.Reply:
    parts = desk.comparing.read(wanted.flight, wanted.streams, wanted.from_s, wanted.to_s, wanted.points)
    return protocol.Reply(wanted.serial, parts=parts)


def _show(desk: Desk, person: protocol.Person, wanted: protocol.ShowFlights) -> None:
    desk.shown_flights.show(person.id, wanted)


def _moments(desk: Desk, person: protocol.Person, wanted: protocol.ShowMoments) -> None:
    desk.shown_flights.mark(person.id, wanted.stretches)


def _look(desk: Desk, person: protocol.Person, wanted: protocol.LookAtFlight) -> None:
    desk.shown_flights.look(person.id, wanted.time_s)


def _fix(desk: Desk, _: protocol.Person, wanted: protocol.FixFlight) -> protocol.Reply:
    name, done = desk.flights.fix(wanted.flight)
    desk.notice(f"{wanted.flight}: {'; '.join(done)}. Saved as {name}; {wanted.flight} stays as it is, left out.")
    return protocol.Reply(wanted.serial, name=name)


def _discard(desk: Desk, _: protocol.Person, wanted: protocol.DiscardFlight) -> protocol.Reply:
    kept = desk.flights.discard(wanted.flight)
    desk.notice(f"{wanted.flight} discarded; it is kept as {kept}.")
    return protocol.Reply(wanted.serial, name=kept)


def _restore(desk: Desk, _: protocol.Person, wanted: protocol.RestoreFlight) -> protocol.Reply:
    name = desk.flights.restore(wanted.kept)
    desk.notice(f"{name} is back.")
    return protocol.Reply(wanted.serial, name=name)


def _take(desk: Desk, _: protocol.Person, wanted: protocol.TakeLog) -> protocol.Reply:
    if wanted.column_map:
        taken = desk.flights.take_with_map(wanted.file, wanted.column_map)
    else:
        taken = desk.flights.take(wanted.file)
    if not isinstance(taken, str):
        return protocol.Reply(wanted.serial, incoming=taken)
    desk.notice(f"{wanted.file} imported as {taken}.")
    return protocol.Reply(wanted.serial, name=taken)


HANDLERS: dict[type, Callable[[Desk, protocol.Person, Any], protocol.Reply | None]] = {
    protocol.ListFlights: _list,
    protocol.SetRole: _set_role,
    protocol.OpenFlights: _open,
    protocol.AlignFlights: _align,
    protocol.ReadStreams: _read,
    protocol.ShowFlights: _show,
    protocol.ShowMoments: _moments,
    protocol.LookAtFlight: _look,
    protocol.FixFlight: _fix,
    protocol.DiscardFlight: _discard,
    protocol.RestoreFlight: _restore,
    protocol.TakeLog: _take,
}
