"""The controller's compensation: compared with the kept model, and sent. Needs control and a nonce, as all orders."""

from flight.file_format import file_hash
from gcs_web.desk import Desk
from gcs_web.panels.handlers import Handlers
from gcs_web.protocol.compensation import Compensation, PrepareCompensation, SendCompensation
from gcs_web.protocol.people import Person
from gcs_web.protocol.reply import Reply
from gcs_web.vehicle import compensation


def _prepare(desk: Desk, person: Person, wanted: PrepareCompensation) -> Reply:
    found = compensation.read(desk.control.required(person), desk.project)
    nonce = desk.control.new_nonce(person, compensation.purpose(found))
    return Reply(wanted.serial, nonce=nonce, compensation=found)


def _send(desk: Desk, person: Person, wanted: SendCompensation) -> Reply:
    watch = desk.control.required(person)
    about: dict[str, object] = {}
    answers: list[tuple[Compensation, Compensation]] = []

    def send() -> None:
        shown = compensation.read(watch, desk.project)
        changed = compensation.changes(shown)
        about.update(version=shown.version, vehicle_sha256=file_hash(desk.project.vehicle), changes=changed)
        about.update(mark=shown.mark, accepted_mark=wanted.accepted_mark)
        desk.control.required(person)  # reading takes a while
        desk.control.use_nonce(wanted.nonce, person, compensation.purpose(shown))
        answers.append((shown, compensation.send(watch, desk.project, shown, wanted.accepted_mark)))

    desk.control.audited(person, "compensation", send, about)
    ((shown, now),) = answers
    desk.notice(
        f"{person.name} set {len(compensation.changes(shown))} parameters of the controller from {shown.vehicle}, "
        f"version {shown.version}: all or none, read back and equal."
    )
    return Reply(wanted.serial, compensation=now)


HANDLERS: Handlers = {
    PrepareCompensation: _prepare,
    SendCompensation: _send,
}
