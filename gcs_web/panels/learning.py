"""The model: keeping and dropping a tried change, versions of the vehicle."""

from gcs_web.desk import Desk
from gcs_web.panels.handlers import Handlers
from gcs_web.protocol.learning import DropTried, Keep, ReturnTo
from gcs_web.protocol.people import Person


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
    Keep: _keep,
    DropTried: _drop,
    ReturnTo: _return_to,
}
