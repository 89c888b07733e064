"""Background work: start, cancel, forget."""

from gcs_web.desk import Desk
from gcs_web.panels.handlers import Handlers
from gcs_web.protocol.jobs import CancelJob, ForeseeJob, ForgetJob, ListJobs, StartJob
from gcs_web.protocol.people import Person
from gcs_web.protocol.reply import Reply


def _start(desk: Desk, person: Person, wanted: StartJob) -> None:
    desk.jobs.start(wanted.kind, wanted.arguments, person.name)
    desk.control.audit(person, "job", "started", {"kind": wanted.kind, "arguments": wanted.arguments})


def _foresee(desk: Desk, _: Person, wanted: ForeseeJob) -> Reply:
    return Reply(wanted.serial, words=desk.jobs.foresee(wanted.kind, wanted.arguments))


def _cancel(desk: Desk, _: Person, unwanted: CancelJob) -> None:
    desk.jobs.cancel(unwanted.job)


def _forget(desk: Desk, _: Person, ended: ForgetJob) -> None:
    desk.jobs.forget(ended.job)


def _list(desk: Desk, _: Person, __: ListJobs) -> None:
    desk.jobs.look()
    desk.show_jobs()


HANDLERS: Handlers = {
    StartJob: _start,
    ForeseeJob: _foresee,
    CancelJob: _cancel,
    ForgetJob: _forget,
    ListJobs: _list,
}
