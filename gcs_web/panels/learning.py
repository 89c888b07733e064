"""Comparison and model: a residual against a variable, keeping and dropping a tried change, versions of the vehicle."""

from gcs_web.desk import Desk
from gcs_web.panels.handlers import Handlers
from gcs_web.protocol.comparison import ReadScatter
from gcs_web.protocol.learning import DropTried, Keep, ReturnTo
from gcs_web.protocol.people import Person
from gcs_web.protocol.reply import Reply


def _scatter(desk: Desk, _: Person, wanted: ReadScatter) -> Reply:
    return Reply(wanted.serial, scatter=desk.comparing.scatter(wanted.channel, wanted.variable))


def _keep(desk: Desk, person: Person, wanted: Keep) -> None:
    step = desk.learning.keep(wanted.vehicle_hash)
    desk.show_learning()
    desk.notice(f"{person.name} kept {step.effect}: the vehicle file is at version {step.number}.")


def _drop(desk: Desk, _: Person, __: DropTried) -> None:
    desk.learning.drop()
    desk.show_learning()


def _return_to(desk: Desk, person: Person, wanted: ReturnTo) -> None:
    left, now = desk.learning.return_to(wanted.version)
    desk.show_learning()
    desk.notice(f"{person.name} returned the vehicle file from version {left.number} to {now.number}.")


HANDLERS: Handlers = {
    ReadScatter: _scatter,
    Keep: _keep,
    DropTried: _drop,
    ReturnTo: _return_to,
}
