"""Flights beside plan and model: in the 3D view, and a residual against a variable."""

from gcs_web.desk import Desk
from gcs_web.panels.handlers import Handlers
from gcs_web.protocol.comparison import LookAtFlight, ReadScatter, ShowFlights, ShowMoments
from gcs_web.protocol.people import Person
from gcs_web.protocol.reply import Reply


def _show(desk: Desk, person: Person, wanted: ShowFlights) -> None:
    desk.shown_flights.show(person.id, wanted)


def _moments(desk: Desk, person: Person, wanted: ShowMoments) -> None:
    desk.shown_flights.mark(person.id, wanted.stretches)


def _look(desk: Desk, person: Person, wanted: LookAtFlight) -> None:
    desk.shown_flights.look(person.id, wanted.time_s)


def _scatter(desk: Desk, _: Person, wanted: ReadScatter) -> Reply:
    return Reply(wanted.serial, scatter=desk.comparing.scatter(wanted.channel, wanted.variable))


HANDLERS: Handlers = {
    ShowFlights: _show,
    ShowMoments: _moments,
    LookAtFlight: _look,
    ReadScatter: _scatter,
}
